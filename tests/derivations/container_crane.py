"""Container crane: x5 on its lower bound −1 until t₁, then no bound is active.

With H = ½(x3² + x6² + ρ u1² + ρ u2²) + p·f the controls are

    u1 = −(p4 − p6/x2)/ρ,   u2 = −p5/ρ;   on the arc u2 = 0, so p5 = 0.

x5 is of order one and u2 regular, so u2 and p5 are continuous at t₁. Unknown are t₁ and the
costates p1, p2, p3, p4, p6 at 0, against six final values. The multiplier of the bound,
η = ∂H/∂x5, must be positive on the arc, the other bounds inactive.

Source: D. Augustin and H. Maurer, in Online Optimization of Large Scale Systems (2001).
"""

from __future__ import annotations

import numpy as np

from derivations.truth import Arc, Array, Flow, Law, Truth, integrate, newton, require, sample

RHO, C4, C5, END = 0.01, 17.2656, 27.0756, 9.0
GUESS = (0.00243, 0.0018, 0.134, -0.0161, -0.214, 5.65)
START = (0.0, 22.0, 0.0, 0.0, -1.0, 0.0)
GOAL = np.array([10.0, 14.0, 0.0, 2.5, 0.0, 0.0])
LOWEST, HIGHEST = np.array([-2.83374, -0.80865]), np.array([2.83374, 0.71265])


def on_bound(t: float, y: Array) -> Array:
    return np.array([-(y[9] - y[11] / y[1]) / RHO, 0.0])


def free(t: float, y: Array) -> Array:
    return np.array([-(y[9] - y[11] / y[1]) / RHO, -y[10] / RHO])


def multiplier(y: Array) -> float:
    """η = ∂H/∂x5: p5' is η − ∂H/∂x5 = 0 on the arc, −∂H/∂x5 after it."""
    return float(y[7] - 2 * y[11] * y[5] / y[1])


def flow(law: Law) -> Flow:
    """Of (x, p, cost)."""

    def rates(t: float, y: Array) -> Array:
        _, x2, x3, x4, x5, x6 = y[:6]
        p1, _, p3, p4, _, p6 = y[6:12]
        u1, u2 = law(t, y)
        swing = -(u1 + C5 * x3 + 2 * x5 * x6) / x2
        p5_dot = -multiplier(y) if law is free else 0.0
        x_dot = [x4, x5, x6, u1 + C4 * x3, u2, swing]
        p_dot = [
            0.0,
            p6 * swing / x2,
            -x3 - p4 * C4 + p6 * C5 / x2,
            -p1,
            p5_dot,
            -x6 - p3 + 2 * p6 * x5 / x2,
        ]
        cost = 0.5 * (x3**2 + x6**2 + RHO * (u1**2 + u2**2))
        return np.array([*x_dot, *p_dot, cost])

    return rates


def nodes(z: Array) -> list[Array]:
    """Where arcs meet."""
    start = np.array([*START, *z[:4], 0.0, z[4], 0.0])
    middle = integrate(flow(on_bound), 0, z[5], start, 1e-13)
    return [start, middle, integrate(flow(free), z[5], END, middle, 1e-13)]


def derive() -> Truth:
    z = newton(lambda z: nodes(z)[-1][:6] - GOAL, GUESS)
    start, middle, end = nodes(z)
    t1 = float(z[5])
    arcs = [
        Arc(0.0, t1, start, flow(on_bound), on_bound),
        Arc(t1, END, middle, flow(free), free),
    ]
    _, first, _ = sample(arcs[:1], 13, 200)
    require(all(multiplier(y) > 0 for y in first[:-1]), "the bound's multiplier is positive")
    times, states, controls = sample(arcs, 6)
    require((controls > LOWEST).all() and (controls < HIGHEST).all(), "controls are free")
    require((states[400:-1, 4] >= -1).all() and (states[:-1, 3] < 2.5).all(), "states too")
    return Truth(float(end[12]), 1e-13, (t1,), (0.0, END), times, states, controls)
