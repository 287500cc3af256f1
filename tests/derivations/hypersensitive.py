"""Hyper-sensitive problem: a substitution in which nothing explodes.

u = −p from ∂H/∂u = 0, and H = (x² − p²)/2 − p x³ is constant, so that x'² = x⁶ + x² − 2 H. With the
least value m of x, 2 H = m⁶ + m². In x = m cosh s, where s rises through zero at the lowest point,

    s' = S(s) = (1 + x⁴ + x² m² + m⁴)^(1/2),   x' = m S sinh s,   p = −x³ − x'.

The integral of 1/S is T, which determines m. The cost is H T − ∫ p dx, as H = L + p x'; integrating
the running cost along the trajectory must agree.

Source of the problem: A. V. Rao and K. D. Mease, Optimal Control Appl. Methods 21 (2000).
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq

from derivations.truth import Arc, Array, Flow, Law, Truth, integrate, require, sample

ENDS, T = (1.5, 1.0), 25.0


def speed(s: float, m: float) -> float:
    """S."""
    x = m * np.cosh(s)
    return float(np.sqrt(1 + x**4 + x**2 * m**2 + m**4))


def control(s: float, m: float) -> float:
    """u = x³ + x'."""
    return float((m * np.cosh(s)) ** 3 + m * np.sinh(s) * speed(s, m))


def span(m: float) -> tuple[float, float]:
    """s at both ends."""
    return -float(np.arccosh(ENDS[0] / m)), float(np.arccosh(ENDS[1] / m))


def duration(m: float) -> float:
    return float(quad(lambda s: 1 / speed(s, m), *span(m), epsabs=1e-13, limit=200)[0])


def cost(m: float) -> float:
    """H T − ∫ p dx."""

    def work(s: float) -> float:
        return control(s, m) * m * float(np.sinh(s))

    return (m**6 + m**2) / 2 * T + float(quad(work, *span(m), epsabs=1e-13, limit=200)[0])


def flow(m: float) -> Flow:
    """Of s and the running cost."""

    def rates(t: float, y: Array) -> Array:
        x, u = m * np.cosh(y[0]), control(y[0], m)
        return np.array([speed(y[0], m), (x**2 + u**2) / 2])

    return rates


def law(m: float) -> Law:
    return lambda t, y: np.array([control(y[0], m)])


def derive() -> Truth:
    m = float(np.exp(brentq(lambda z: duration(np.exp(z)) - T, -20.0, -5.0, xtol=1e-14)))
    start, found = np.array([span(m)[0], 0.0]), cost(m)
    end = integrate(flow(m), 0.0, T, start, 1e-13)
    require(abs(end[0] - span(m)[1]) < 1e-10, "the trajectory ends where it should")
    require(abs(end[1] - found) < 1e-11, "the running cost has the same integral")
    times, s, controls = sample([Arc(0.0, T, start, flow(m), law(m))], 1, 6000)
    return Truth(found, 1e-11, (), (0.0, T), times, m * np.cosh(s), controls)
