"""Soft landing: free fall, then full thrust.

The switching function 1 + p_v is linear in time, since p_v' = −p_h and p_h is constant; the thrust
is full where it is negative. It falls, and the switch at t1 and the landing at T follow from rest
on the ground. With 1 + p_v(t1) = 0, H = u + p_h v + p_v (u − g) = 0 gives p_h = −g/v(t1).

Source: J. S. Meditch, IEEE Trans. Automatic Control 9 (1964).
"""

from __future__ import annotations

import numpy as np

from derivations.truth import Arc, Array, Flow, Law, Truth, integrate, newton, require, sample

G, FULL = 1.5, 3.0
START = np.array([10.0, -2.0])
THRUSTS = (0.0, FULL)
GUESS = (1.5, 4.0)


def thrust(value: float) -> Law:
    return lambda t, x: np.array([value])


def flow(value: float) -> Flow:
    return lambda t, x: np.array([x[1], value - G])


def nodes(z: Array) -> list[Array]:
    """States at the start, the switch and the end."""
    turn = integrate(flow(THRUSTS[0]), 0.0, z[0], START, 1e-13)
    return [START, turn, integrate(flow(THRUSTS[1]), z[0], z[1], turn, 1e-13)]


def derive() -> Truth:
    z = newton(lambda z: nodes(z)[-1], GUESS)
    t1, end = (float(value) for value in z)
    x = nodes(z)
    p_h = -G / x[1][1]
    require(p_h > 0, "1 + p_v = p_h (t1 - t) is positive before the switch, negative after it")
    for t, v, u in ((0.0, x[0][1], THRUSTS[0]), (end, x[2][1], THRUSTS[1])):
        p_v = p_h * (t1 - t) - 1
        require(abs(u + p_h * v + p_v * (u - G)) < 1e-11, "the Hamiltonian is zero")
    ends = (0.0, t1, end)
    arcs = [Arc(ends[i], ends[i + 1], x[i], flow(THRUSTS[i]), thrust(THRUSTS[i])) for i in range(2)]
    return Truth(FULL * (end - t1), 1e-11, (t1,), (0.0, end), *sample(arcs, 2, 100))
