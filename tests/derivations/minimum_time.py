"""Minimum time: one full push, then the opposite one.

The costate p_v is linear in time and the control is −1 where it is positive, so that there is at
most one switch, at t1; −1 comes first, as the start lies above the switching curve. Resting at the
origin determines t1 and T. With p_v(t1) = 0, H = 1 + p_x v + p_v u = 0 gives p_x = −1/v(t1).

Source: L. S. Pontryagin et al., The Mathematical Theory of Optimal Processes (1962).
"""

from __future__ import annotations

import numpy as np

from derivations.truth import Arc, Array, Flow, Law, Truth, integrate, newton, require, sample

START = np.array([1.0, 1.0])
SIGNS = (-1.0, 1.0)
GUESS = (2.0, 3.5)


def push(sign: float) -> Law:
    return lambda t, x: np.array([sign])


def flow(sign: float) -> Flow:
    return lambda t, x: np.array([x[1], sign])


def nodes(z: Array) -> list[Array]:
    """States at the start, the switch and the end."""
    turn = integrate(flow(SIGNS[0]), 0.0, z[0], START, 1e-13)
    return [START, turn, integrate(flow(SIGNS[1]), z[0], z[1], turn, 1e-13)]


def derive() -> Truth:
    z = newton(lambda z: nodes(z)[-1], GUESS)
    t1, end = (float(value) for value in z)
    x = nodes(z)
    p_x = -1 / x[1][1]
    require(p_x > 0, "p_v = p_x (t1 - t) is positive before the switch, negative after it")
    for t, v, u in ((0.0, x[0][1], SIGNS[0]), (end, x[2][1], SIGNS[1])):
        require(abs(1 + p_x * v + p_x * (t1 - t) * u) < 1e-11, "the Hamiltonian is zero")
    ends = (0.0, t1, end)
    arcs = [Arc(ends[i], ends[i + 1], x[i], flow(SIGNS[i]), push(SIGNS[i])) for i in range(2)]
    return Truth(end, 1e-11, (t1,), (0.0, end), *sample(arcs, 2, 100))
