"""Robot arm: three bang-bang controls with two, one and two switches, symmetric about T/2.

The lengthening is a double integrator: −1, 1, −1 with switches at T/4 and 3T/4 brings it back.
By symmetry the rest is known from its first half: θ(T/2) = π/3 and φ'(T/2) = 0 determine T and
the first switch s of u_φ. Then Pontryagin's conditions are checked: the costate is linear in its
initial value, which five zeros of the switching functions (one for each switch) and H = 0 with
the cost T determine uniquely; every control must oppose the sign of its switching function.

Source: E. D. Dolan, J. J. Moré and T. S. Munson, COPS 3.0 (2004).
"""

from __future__ import annotations

import itertools

import numpy as np

from derivations.truth import Arc, Array, Flow, Law, Truth, integrate, newton, require, sample

L, TURN = 5.0, 2 * np.pi / 3
START = np.array([4.5, 0.0, 0.0, 0.0, np.pi / 4, 0.0])
GOAL = np.array([4.5, 0.0, TURN, 0.0, np.pi / 4, 0.0])
GUESS = (9.141, 2.8)
SIGNS = ((-1, 1, -1), (1, 1, -1), (1, 1, 1), (1, -1, 1), (1, -1, -1), (-1, -1, -1))
"""Of the controls on the six arcs, for switches of ρ, φ, θ, φ, ρ in turn."""
SWITCHED = (0, 2, 1, 2, 0)


def inertia(rho: float) -> tuple[float, float]:
    """J and dJ/dρ."""
    return ((L - rho) ** 3 + rho**3) / 3, rho**2 - (L - rho) ** 2


def gains(y: Array) -> Array:
    """Accelerations per unit of control."""
    J = inertia(y[0])[0]
    return np.array([1 / L, 1 / (J * np.sin(y[4]) ** 2), 1 / J])


def switching(y: Array) -> Array:
    """∂H/∂u for every control."""
    return np.array(y[[7, 9, 11]] * gains(y))


def constant(value: tuple[int, int, int]) -> Law:
    return lambda t, y: np.array(value, dtype=float)


LAWS = tuple(constant(signs) for signs in SIGNS)


def flow(arc: int) -> Flow:
    """Of (x) or (x, p)."""
    u = np.array(SIGNS[arc], dtype=float)

    def rates(t: float, y: Array) -> Array:
        a = gains(y) * u
        x_dot = [y[1], a[0], y[3], a[1], y[5], a[2]]
        if len(y) == 6:
            return np.array(x_dot)
        J, slope = inertia(y[0])
        p = y[6:]
        by_rho = (p[3] * a[1] + p[5] * a[2]) * slope / J
        by_phi = 2 * p[3] * a[1] / np.tan(y[4])
        return np.array([*x_dot, by_rho, -p[0], 0.0, -p[2], by_phi, -p[4]])

    return rates


def instants(end: float, s: float) -> Array:
    """Ends of the arcs."""
    return np.array([0.0, end / 4, s, end / 2, end - s, 3 * end / 4, end])


def nodes(ends: Array, start: Array, arcs: int = 6) -> list[Array]:
    y = [start]
    for arc in range(arcs):
        y.append(integrate(flow(arc), ends[arc], ends[arc + 1], y[-1], 1e-13))
    return y


def half_way(z: Array) -> Array:
    middle = nodes(instants(*z), START, 3)[-1]
    return np.array([middle[2] - TURN / 2, middle[5]])


def costates(ends: Array) -> Array:
    """Return p(0)."""

    def conditions(p: Array) -> Array:
        y = nodes(ends, np.concatenate([START, p]))[1:-1]
        zeros = [switching(at)[control] for at, control in zip(y, SWITCHED, strict=True)]
        at_start = switching(np.concatenate([START, p])) @ np.array(SIGNS[0])  # H − 1, at rest
        return np.array([*zeros, at_start])

    matrix = np.column_stack([conditions(e) for e in np.eye(6)])
    require(np.linalg.cond(matrix) < 1e6, "the costate is unique")
    return np.array(np.linalg.solve(matrix, [0.0, 0.0, 0.0, 0.0, 0.0, -1.0]))


def check_signs(ends: Array) -> None:
    y = nodes(ends, np.concatenate([START, costates(ends)]))
    for arc, (a, b) in enumerate(itertools.pairwise(ends)):
        _, states, _ = sample([Arc(a, b, y[arc], flow(arc), LAWS[arc])], 12, 50)
        for at in states[1:-1]:
            require((switching(at) * SIGNS[arc] < 0).all(), "controls oppose their switching")


def derive() -> Truth:
    end, s = (float(value) for value in newton(half_way, GUESS))
    ends = instants(end, s)
    x = nodes(ends, START)
    require(np.max(abs(x[-1] - GOAL)) < 1e-10, "the arm arrives and rests")
    check_signs(ends)
    arcs = [Arc(ends[i], ends[i + 1], x[i], flow(i), LAWS[i]) for i in range(6)]
    switches = tuple(float(t) for t in ends[1:-1])
    return Truth(end, 1e-11, switches, (0.0, end), *sample(arcs, 6, 100))
