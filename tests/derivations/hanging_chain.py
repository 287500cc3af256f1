"""Hanging chain: the Euler-Lagrange equation with a multiplier for the length, by shooting.

Minimise ∫ (y + μ) √(1 + u²) with y' = u: u' = (1 + u²)/(y + μ), and H = (y + μ)/√(1 + u²) is
constant. The slope at the start and μ follow from the other end and the length. Where y + μ > 0 the
integrand is strictly convex in u, and the chain hangs rather than arches. The catenary with the
same length and ends must agree.

Source of the problem: E. D. Dolan, J. J. Moré and T. S. Munson, COPS 3.0 (2004).
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from derivations.truth import Arc, Array, Flow, Truth, integrate, newton, require, sample

LEFT, RIGHT, LENGTH = 1.0, 3.0, 4.0
GUESS = (-6.0, 0.0)


def flow(mu: float) -> Flow:
    """Of height, slope, length and energy."""

    def rates(t: float, y: Array) -> Array:
        stretch = np.sqrt(1 + y[1] ** 2)
        return np.array([y[1], stretch**2 / (y[0] + mu), stretch, y[0] * stretch])

    return rates


def start(slope: float) -> Array:
    return np.array([LEFT, slope, 0.0, 0.0])


def miss(z: Array) -> Array:
    slope, mu = z
    end = integrate(flow(mu), 0.0, 1.0, start(slope), 1e-13)
    return np.array([end[0] - RIGHT, end[2] - LENGTH])


def catenary() -> float:
    """The slope at the start of y = c cosh((t − b)/c) + d."""
    apart = np.sqrt(LENGTH**2 - (RIGHT - LEFT) ** 2)
    c = brentq(lambda c: 2 * c * np.sinh(1 / (2 * c)) - apart, 0.1, 1.0, xtol=1e-15)
    return float(np.sinh(np.arcsinh((RIGHT - LEFT) / apart) - 1 / (2 * c)))


def slope(t: float, y: Array) -> Array:
    return np.array([y[1]])


def derive() -> Truth:
    first, mu = (float(value) for value in newton(miss, GUESS))
    times, states, controls = sample([Arc(0.0, 1.0, start(first), flow(mu), slope)], 4, 2000)
    hamiltonian = (states[:, 0] + mu) / np.sqrt(1 + controls[:, 0] ** 2)
    require(np.ptp(hamiltonian) < 1e-10, "the Hamiltonian is constant")
    require((states[:, 0] + mu > 0).all(), "the chain hangs")
    require(abs(first - catenary()) < 1e-9, "the chain is a catenary")
    return Truth(float(states[-1, 3]), 1e-10, (), (0.0, 1.0), times, states[:, :1], controls)
