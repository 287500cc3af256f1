"""Largest orbit: the thrust points along the costate of the velocity.

Maximise r(T): H = p·f, so that (sin φ, cos φ) = (p_u, p_v)/|(p_u, p_v)|, and p' = −∂H/∂x. The orbit
at the end is circular, u = 0 and v = r^(−1/2), with multipliers: p_r = 1 + p_v r^(−3/2)/2. Shooting
from the start has p(0) as unknowns; shooting from the end r(T), p_u(T), p_v(T), and must agree.

Source: A. E. Bryson and Y.-C. Ho, Applied Optimal Control (1975), section 2.5.
"""

from __future__ import annotations

import numpy as np

from derivations.truth import Arc, Array, Truth, integrate, newton, require, sample

THRUST, MASS_FLOW, T = 0.1405, 0.0749, 3.32
START = np.array([1.0, 0.0, 1.0])
GUESS = (1.9, 0.9, 2.0)
"""p at the start; any of its size will do."""


def flow(t: float, y: Array) -> Array:
    """Of (r, u, v, p)."""
    r, u, v, p_r, p_u, p_v = y
    a = THRUST / (1 - MASS_FLOW * t) / np.hypot(p_u, p_v)
    return np.array(
        [
            u,
            v**2 / r - 1 / r**2 + a * p_u,
            -u * v / r + a * p_v,
            p_u * (v**2 / r**2 - 2 / r**3) - p_v * u * v / r**2,
            -p_r + p_v * v / r,
            -2 * p_u * v / r + p_v * u / r,
        ]
    )


def from_start(p: Array) -> Array:
    r, u, v, p_r, _, p_v = integrate(flow, 0.0, T, np.concatenate([START, p]), 1e-13)
    return np.array([u, v - r**-0.5, p_r - 1 - p_v * r**-1.5 / 2])


def from_end(z: Array) -> Array:
    r, p_u, p_v = z
    end = np.array([r, 0.0, r**-0.5, 1 + p_v * r**-1.5 / 2, p_u, p_v])
    return np.array(integrate(flow, T, 0.0, end, 1e-13)[:3] - START)


def steering(t: float, y: Array) -> Array:
    """φ from 0 to 2π."""
    return np.array([np.arctan2(y[4], y[5]) % (2 * np.pi)])


def derive() -> Truth:
    start = np.concatenate([START, newton(from_start, GUESS)])
    end = integrate(flow, 0.0, T, start, 1e-13)
    again = newton(from_end, np.round(end[[0, 4, 5]], 2))
    require(abs(again[0] - end[0]) < 1e-11, "shooting from the end agrees")
    times, states, controls = sample([Arc(0.0, T, start, flow, steering)], 3, 2000)
    require((np.diff(controls[:, 0]) > 0).all(), "the angle grows without wrapping")
    return Truth(float(end[0]), 1e-11, (), (0.0, T), times, states, controls)
