"""Brachistochrone: the path's angle grows at a constant rate, from straight down.

Energy gives v² = −2 g y. With H = 0 (free final time) and ∂H/∂θ = 0 the costate of the position
opposes its direction, (p_x, p_y) = −(cos θ, sin θ)/v. p_x is constant: cos θ/v = 1/k, Snell's law.
Its time derivative, with v' = −g sin θ, leaves θ' = g/k, and v(0) = 0 means θ(0) = −π/2. The rate
and the final time follow from the end point; the cycloid through it must agree.

Source: A. E. Bryson and Y.-C. Ho, Applied Optimal Control (1975), section 2.7.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from derivations.truth import Arc, Array, Flow, Law, Truth, integrate, newton, require, sample

G, END = 9.81, (10.0, -5.0)
GUESS = (1.0, 1.8)
START = np.zeros(3)


def angle(rate: float) -> Law:
    return lambda t, x: np.array([rate * t - np.pi / 2])


def flow(rate: float) -> Flow:
    def rates(t: float, x: Array) -> Array:
        theta = rate * t - np.pi / 2
        return np.array([x[2] * np.cos(theta), x[2] * np.sin(theta), -G * np.sin(theta)])

    return rates


def miss(z: Array) -> Array:
    rate, end = z
    return np.array(integrate(flow(rate), 0.0, end, START, 1e-13)[:2] - END)


def cycloid() -> float:
    """The time on x = R(φ − sin φ), y = −R(1 − cos φ), where φ grows at the rate √(g/R)."""

    def slope(phi: float) -> float:
        return float((phi - np.sin(phi)) * END[1] + (1 - np.cos(phi)) * END[0])

    phi = brentq(slope, 1.0, 6.0, xtol=1e-15)
    return float(phi * np.sqrt(-END[1] / (1 - np.cos(phi)) / G))


def derive() -> Truth:
    rate, end = (float(value) for value in newton(miss, GUESS))
    arc = Arc(0.0, end, START, flow(rate), angle(rate))
    times, states, controls = sample([arc], 3)
    snell = np.cos(controls[1:, 0]) / states[1:, 2]
    require(np.ptp(snell) < 1e-10, "the costate of x is constant")
    require(abs(end - cycloid()) < 1e-11, "the path is the cycloid")
    return Truth(end, 1e-11, (), (0.0, end), times, states, controls)
