"""Goddard's rocket: full thrust, singular thrust, none.

With pₕ(T) = −1, p_v(T) = 0 and H = 0 (free final time) the ascent ends where v = 0. The switching
function is Φ = p_v/m − p_m/c. Where Φ = Φ' = 0, eliminating the costates with H = 0 leaves

    S = D (1 + v/c) − m g = 0,

and S' = 0 gives the singular thrust in terms of h, v, m. So three stops in a row say everything:
S = 0 ends full thrust, m = 0.6 ends the singular arc, v = 0 ends the ascent. Costates integrated
backwards from there must have Φ < 0 under full thrust, Φ = 0 on the arc, Φ > 0 after it.

Source of the singular arc: P. Tsiotras and H. J. Kelley, J. Guid. Control Dyn. 15 (1992).
"""

from __future__ import annotations

import numpy as np

from derivations.truth import Arc, Array, Flow, Truth, integrate, newton, require, sample

D0, BETA, C, DRY, FULL = 310.0, 500.0, 0.5, 0.6, 3.5
GUESS = (0.0238, 0.0726, 0.1988)


def drag(x: Array) -> float:
    return float(D0 * x[1] ** 2 * np.exp(-BETA * (x[0] - 1)))


def surface(x: Array) -> float:
    """S, zero on the singular arc."""
    h, v, m = x[:3]
    return float(drag(x) * (1 + v / C) - m / h**2)


def singular(t: float, x: Array) -> Array:
    h, v, m = x[:3]
    D, g, g_h = drag(x), 1 / h**2, -2 / h**3
    slope = D * (2 / v + 3 / C)  # ∂S/∂v
    forces = slope * (D / m + g) + BETA * D * v * (1 + v / C) + m * g_h * v
    return np.array([forces / (slope / m + g / C)])


def full(t: float, x: Array) -> Array:
    return np.array([FULL])


def none(t: float, x: Array) -> Array:
    return np.zeros(1)


LAWS = (full, singular, none)


def rates(x: Array, thrust: float) -> Array:
    h, v, m = x[:3]
    return np.array([v, (thrust - drag(x)) / m - 1 / h**2, -thrust / C])


def flow(arc: int) -> Flow:
    return lambda t, x: rates(x, LAWS[arc](t, x)[0])


def with_costates(arc: int) -> Flow:
    """Of (h, v, m, p)."""

    def adjoint(t: float, y: Array) -> Array:
        (h, v, m), (p_h, p_v, _) = y[:3], y[3:]
        D, u = drag(y), LAWS[arc](t, y)[0]
        p = [-p_v * (BETA * D / m + 2 / h**3), -p_h + p_v * 2 * D / (v * m) if v else -p_h]
        return np.concatenate([rates(y, u), p, [p_v * (u - D) / m**2]])

    return adjoint


def nodes(times: Array) -> list[Array]:
    """States where arcs meet."""
    x = [np.array([1.0, 0.0, 1.0])]
    for arc, (a, b) in enumerate(zip([0.0, *times], times, strict=False)):
        x.append(integrate(flow(arc), a, b, x[-1]))
    return x


def stops(times: Array) -> Array:
    x = nodes(times)
    return np.array([surface(x[1]), x[2][2] - DRY, x[3][1]])


def switching(y: Array) -> float:
    """Φ."""
    return float(y[4] / y[2] - y[5] / C)


def check_costates(times: Array, x: list[Array]) -> None:
    t1, t2, end = times
    # Φ(t2) = 0 determines p_m, which is constant when the motor is off
    coast = integrate(with_costates(2), end, t2, np.array([*x[3], -1.0, 0.0, 0.0]))
    coast[5] = C * coast[4] / coast[2]
    require(abs(surface(x[2])) < 1e-11, "the singular arc stays on its surface")
    arc = [coast]
    for a, b in zip(np.linspace(t2, t1, 9), np.linspace(t2, t1, 9)[1:], strict=False):
        arc.append(integrate(with_costates(1), a, b, arc[-1]))
    require(max(abs(switching(y)) for y in arc) < 1e-9, "the switching function is zero")
    for t in np.linspace(0, t1, 9)[:-1]:
        require(switching(integrate(with_costates(0), t1, t, arc[-1])) < 0, "full thrust")
    for t in np.linspace(t2, end, 9)[1:]:
        require(switching(integrate(with_costates(2), t2, t, coast)) > 0, "no thrust")
    on = [singular(0, y)[0] for y in arc]
    require(min(on) > 0 and max(on) < FULL, "the singular thrust is within its bounds")


def derive() -> Truth:
    times = newton(stops, GUESS)
    x = nodes(times)
    check_costates(times, x)
    ends = np.concatenate([[0.0], times])
    arcs = [Arc(ends[i], ends[i + 1], x[i], flow(i), LAWS[i]) for i in range(3)]
    t1, t2, end = (float(t) for t in times)
    return Truth(float(x[3][0]), 1e-12, (t1, t2), (0.0, end), *sample(arcs, 3))
