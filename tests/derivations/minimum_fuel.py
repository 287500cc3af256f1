"""Minimum fuel: a push, then nothing, then the opposite push.

H = |u| + p_x v + p_v u is least at u = −1 where p_v > 1, at u = 1 where p_v < −1, and at u = 0 in
between; p_v is linear in time, and so falls from above 1 to below −1 at the two switches t1 and t2,
which rest at the origin determines. H is the same throughout: with u = 0 it is p_x v.

Source: M. Athans and P. L. Falb, Optimal Control (1966), section 8-6.
"""

from __future__ import annotations

import numpy as np

from derivations.truth import Arc, Array, Flow, Law, Truth, integrate, newton, require, sample

END = 3.0
START = np.array([1.0, 0.0])
PUSHES = (-1.0, 0.0, 1.0)
GUESS = (0.5, 2.5)


def push(value: float) -> Law:
    return lambda t, x: np.array([value])


def flow(value: float) -> Flow:
    return lambda t, x: np.array([x[1], value])


def nodes(z: Array) -> list[Array]:
    """States at the start, the switches and the end."""
    ends, found = (0.0, *z, END), [START]
    for i, value in enumerate(PUSHES):
        found.append(integrate(flow(value), ends[i], ends[i + 1], found[-1], 1e-13))
    return found


def derive() -> Truth:
    z = newton(lambda z: nodes(z)[-1], GUESS)
    t1, t2 = (float(value) for value in z)
    x = nodes(z)
    p_x = 2 / (t2 - t1)  # p_v = 1 at t1, −1 at t2
    require(0 < t1 < t2 < END, "the switches are in order")
    for t, v, u in ((0.0, x[0][1], -1.0), (END, x[3][1], 1.0)):
        p_v = 1 - p_x * (t - t1)
        require(u * p_v < -1, "the push is against p_v, where that is more than the price")
        require(abs(abs(u) + p_x * v + p_v * u - p_x * x[1][1]) < 1e-11, "H is constant")
    ends = (0.0, t1, t2, END)
    arcs = [Arc(ends[i], ends[i + 1], x[i], flow(u), push(u)) for i, u in enumerate(PUSHES)]
    cost = t1 + END - t2
    return Truth(cost, 1e-11, (t1, t2), (0.0, END), *sample(arcs, 2, 100))
