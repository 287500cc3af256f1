"""The strongest column: the least cross-section at both ends, a constant curvature between them.

With A the cross-section, y'' = −P y/A. The adjoint of the slope is a multiple of y (the problem is
self-adjoint), so that more volume at t raises the load P in proportion to (y/A)²: constant where A
is free, not larger where A is on its bound. Hence −y'' = k and A = P y/k between the junctions a
and 1 − a. Symmetry, y'(1/2) = 0, and the unit volume determine P and a.

Source: W. Prager and J. E. Taylor, J. Applied Mechanics 35 (1968).
"""

from __future__ import annotations

import numpy as np

from derivations.truth import Arc, Array, Flow, Law, Truth, integrate, newton, require, sample

LEAST = 0.5
START = np.array([0.0, 1.0, 0.0])
GUESS = (11.0, 0.15)


def at_bound(t: float, y: Array) -> Array:
    return np.array([LEAST])


def curved(ratio: float) -> Law:
    """A = y·ratio, where ratio is P/k."""
    return lambda t, y: np.array([y[0] * ratio])


def flow(load: float, law: Law) -> Flow:
    """Of deflection, slope and volume."""

    def rates(t: float, y: Array) -> Array:
        A = law(t, y)[0]
        return np.array([y[1], -load * y[0] / A, A])

    return rates


def arcs(load: float, a: float) -> list[Arc]:
    """Both ends and what is between them."""
    first = integrate(flow(load, at_bound), 0.0, a, START, 1e-13)
    between = curved(LEAST / first[0])
    second = integrate(flow(load, between), a, 1 - a, first, 1e-13)
    return [
        Arc(0.0, a, START, flow(load, at_bound), at_bound),
        Arc(a, 1 - a, first, flow(load, between), between),
        Arc(1 - a, 1.0, second, flow(load, at_bound), at_bound),
    ]


def conditions(z: Array) -> Array:
    half = arcs(*z)[1]
    y = integrate(half.flow, half.start, 0.5, half.begin, 1e-13)
    return np.array([y[1], y[2] - 0.5])


def derive() -> Truth:
    load, a = (float(value) for value in newton(conditions, GUESS))
    column = arcs(load, a)
    times, states, controls = sample(column, 3)
    ratio = states[:, 0] / controls[:, 0]
    require(ratio.max() <= ratio[len(ratio) // 2] + 1e-10, "no more load from volume at the bound")
    require(abs(states[-1, 0]) < 1e-10, "the column ends on its hinge")
    require(abs(states[-1, 2] - 1) < 1e-10, "the volume is one")
    require((states[1:-1, 0] > 0).all(), "the load is the first one")
    return Truth(load, 1e-10, (a, 1 - a), (0.0, 1.0), times, states[:, :2], controls)
