"""Extremals that are known: of bundled problems, and of small ones with one kind of constraint."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from extremals import Extremal, Law, Phase
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import root

import quito_cli as quito
from quito_cli.optimality.polish.answer.exact import Atom
from quito_cli.problem.load import changed, load_text
from quito_cli.problem.schema import Problem

Array = NDArray[np.float64]
Rates = Callable[[float, Array], Array]


def constant(*values: float) -> Law:
    """A control, or multipliers, that do not change."""
    return lambda t, x, costate: np.tile(values, (len(t), 1))


def column(law: Callable[..., Array]) -> Law:
    """One entry, as a function of t and the entries of x and λ."""
    return lambda t, x, costate: np.asarray(law(t, *x.T, *costate.T))[:, None]


def carried(rates: Rates, y: Array, *times: float) -> Array:
    """Integrate from time to time."""
    for k in range(len(times) - 1):
        span = times[k], times[k + 1]
        y = solve_ivp(rates, span, y, method="DOP853", rtol=3e-14, atol=1e-15).y[:, -1]
    return y


def made(
    problem: Problem,
    phases: tuple[Phase, ...],
    arcs: dict[str, str],
    x: list[float],
    costate: list[float] | Array,
    cost: float,
) -> Extremal:
    """An extremal that is carried on from its start."""
    return Extremal(
        problem, phases, arcs, (np.array(x, float), np.array(costate, float)), cost=cost
    )


def bressan(late: float = 0.0) -> Extremal:
    """λ₃ = −1, λ₂ = t − T, λ₁' = λ₂ − 2 x₁ with λ₁(T) = 0: what the control of a late switch has.

    With L = T − a after the switch at a, λ₁(a) = L (T − 3a): zero where it should be, at T/3.
    """
    last, a = 10.0, 10.0 / 3 + late
    start = [(last - a) * (last - 3 * a) - 1.5 * a**2 + last * a, -last, -1.0]
    phases = (Phase(a, constant(-1.0), segments=3), Phase(last, constant(0.5), segments=4))
    return made(quito.load("bressan"), phases, {"u": "lower singular"}, [0] * 3, start, -500 / 9)


def bang_bang() -> Extremal:
    """The costate is zero where the control switches: λ' = t λ − (exp(−t) − 2t)/2."""
    t1, t2 = 0.19496562441559956, 0.5168613161702115
    start = carried(lambda t, y: t * y - (np.exp(-t) - 2 * t) / 2, np.zeros(1), t1, 0.0)
    phases = (Phase(t1, constant(-1.0)), Phase(t2, constant(1.0)), Phase(1.0, constant(-1.0)))
    arcs = {"u": "lower upper lower"}
    return made(quito.load("bang_bang"), phases, arcs, [0], start, -0.18305968077629106)


def van_der_pol() -> Extremal:
    """The reference's control; costates from λ(4) = 0 back to the start."""
    t1, t2, c = 1.3667400310631783, 2.4608743843185352, 0.0970199608658935

    def singular(t: Array) -> Array:
        z = c * np.cosh(4 - t)
        return np.asarray(2 * z + (1 - z**2) * c * np.sinh(4 - t))

    def rates(u: Callable[[Array], Array]) -> Rates:
        def all_rates(t: float, y: Array) -> Array:
            x1, x2, l1, l2 = y
            xdot = x2, (1 - x1**2) * x2 - x1 + u(np.array(t))
            return np.array([*xdot, -x1 + l2 * (2 * x1 * x2 + 1), -x2 - l1 - l2 * (1 - x1**2)])

        return all_rates

    lower, upper = rates(lambda t: 0 * t - 1), rates(lambda t: 0 * t + 1)
    x = carried(lower, np.array([0.0, 1, 0, 0]), 0, t1)
    x = carried(rates(singular), carried(upper, x, t1, t2), t2, 4)
    y = carried(rates(singular), np.array([x[0], x[1], 0, 0]), 4, t2)
    y = carried(lower, carried(upper, y, t2, t1), t1, 0)
    phases = (
        Phase(t1, constant(-1.0), segments=3),
        Phase(t2, constant(1.0), segments=3),
        Phase(4.0, column(lambda t, *_: singular(t)), segments=3),
    )
    arcs = {"u": "lower upper singular"}
    return made(quito.load("van_der_pol"), phases, arcs, [0, 1], y[2:], 0.7576179286593919)


def bryson_denham(ceiling: float = 1 / 9) -> Extremal:
    """H = u²/2 + λ₁x₂ + λ₂u: u = −λ₂, λ₁ is constant but for what x₁ at its bound takes from it.

    With an arc for l ≤ 1/6; between 1/6 and 1/4 x₁ is a cubic that touches l in the middle.
    """
    inner = column(lambda t, x1, x2, l1, l2: -l2)
    problem = quito.load("bryson_denham")
    if ceiling == 1 / 9:
        jump = 2 / (9 * ceiling**2)
        phases = (
            Phase(3 * ceiling, inner, segments=2, jump=(jump, 0)),
            Phase(1 - 3 * ceiling, constant(0.0), jump=(jump, 0)),
            Phase(1.0, inner, segments=2),
        )
        arcs = {"u": "interior active interior", "x1": "inactive active inactive"}
        start = [jump, 2 / (3 * ceiling)]
        touched = made(problem, phases, arcs, [0, 1], start, 4 / (9 * ceiling))
        return replace(touched, atoms=(Atom(2, 0, jump), Atom(3, 0, jump)))
    c = 4 - 16 * ceiling
    b = -1 - 0.75 * c
    halves = (Phase(0.5, inner, segments=2, jump=(12 * c, 0)), Phase(1.0, inner, segments=2))
    arcs = {"u": "interior interior", "x1": "inactive inactive"}
    # ∫ (2b + 6ct)² / 2 over both halves.
    cost = 4 * b**2 * 0.5 + 12 * b * c * 0.25 + 12 * c**2 * 0.125
    problem = changed(problem, {"l": ceiling})
    touched = made(problem, halves, arcs, [0, 1], [6 * c, -2 * b], cost)
    return replace(touched, atoms=(Atom(2, 0, 12 * c),))


def van_der_pol_state() -> Extremal:
    """x₂ slides along −0.4 with u = −λ₂/2 all the time: λ₂ is known there, and μ with it."""
    t1, t2 = 0.6275293929350234, 1.4690821492867296

    def bound(x1: Array) -> Array:
        return np.asarray(0.4 * (1 - x1**2) + x1)

    def rates(t: float, y: Array) -> Array:
        x1, x2, l1, l2 = y
        xdot = x2, (1 - x1**2) * x2 - x1 - l2 / 2
        return np.array([*xdot, -2 * x1 + l2 * (2 * x1 * x2 + 1), -2 * x2 - l1 - l2 * (1 - x1**2)])

    def missed(costate: Array) -> Array:
        x1, x2, _, l2 = carried(rates, np.array([1.0, 0, *costate]), 0, t1)
        return np.array([x2 + 0.4, l2 / 2 + bound(x1)])

    def mu(t: Array, x1: Array, x2: Array, l1: Array, l2: Array) -> Array:
        """From λ₂ = −2u along the arc: λ₂' = −2 (1 − 0.8 x₁) x₂ = −H_x₂ − μ."""
        return np.asarray(-2 * x2 - l1 - l2 * (1 - x1**2) + 2 * (1 - 0.8 * x1) * x2)

    inner = column(lambda t, x1, x2, l1, l2: -l2 / 2)
    on_bound = column(lambda t, x1, x2, l1, l2: bound(x1))
    start = root(missed, [4.0, 1.0], tol=1e-14).x
    phases = (
        Phase(t1, inner, segments=2),
        Phase(t2, on_bound, mu=column(mu), segments=3),
        Phase(5.0, inner, segments=6),
    )
    arcs = {"u": "interior active interior", "x2": "inactive active inactive"}
    problem = quito.load("van_der_pol_state")
    return made(problem, phases, arcs, [1, 0], start, 2.9537013423850373)


def minimum_time() -> Extremal:
    """Closed form on a free horizon: λ₁ = 1/s, λ₂ = (t₁ − t)/s, H = −1."""
    s = math.sqrt(1.5)
    phases = (Phase(1 + s, constant(-1.0)), Phase(1 + 2 * s, constant(1.0)))
    start = [1 / s, (1 + s) / s]
    problem = quito.load("minimum_time")
    return made(problem, phases, {"u": "lower upper"}, [1, 1], start, 1 + 2 * s)


SCALAR = """
time: {{initial: 0, final: 1}}
states: {{x: {{{ends}}}}}
controls: {{u: {{}}}}
{more}
dynamics: {{x: {rate}}}
cost: {{{cost}}}
constraints: {{{constraint}}}
"""


def scalar(**parts: str) -> Problem:
    """A problem of one state and one control."""
    given = {"ends": "initial: 0", "more": "", "rate": "u", "cost": "lagrange: 0.5*u^2"}
    return load_text(SCALAR.format(**given | parts), "test.yaml")


def mixed() -> Extremal:
    """u ≤ 1/2 + t until τ = 0.4, then u = k = 0.9 = −λ; μ = k − u."""
    problem = scalar(ends="initial: 0, final: 0.82", constraint='path: {most: "u <= 0.5 + t"}')
    phases = (
        Phase(0.4, column(lambda t, x, costate: 0.5 + t), mu=column(lambda t, x, costate: 0.4 - t)),
        Phase(1.0, constant(0.9)),
    )
    arcs = {"u": "active interior", "most": "active inactive"}
    return made(problem, phases, arcs, [0], [-0.9], ((0.9**3 - 0.5**3) / 3 + 0.486) / 2)


def parameter() -> Extremal:
    """x' = u + p to 1, both of the same price: λ = −u, p + λ = 0."""
    problem = scalar(
        ends="initial: 0, final: 1",
        more="parameters: {p: {guess: 0}}",
        rate="u + p",
        cost="lagrange: 0.5*u^2 + 0.5*p^2",
        constraint='path: {slack: "x <= 5"}',
    )
    found = made(
        problem,
        (Phase(1.0, constant(0.5)),),
        {"u": "interior", "slack": "inactive"},
        [0],
        [-0.5],
        0.25,
    )
    return replace(found, parameters=(0.5,))


def integral() -> Extremal:
    """Minimise x(1) with ∫u² ≤ 1: H = λu + νu², λ = 1, u = −1/(2ν) = −1."""
    problem = scalar(cost="mayer: x", constraint="integral: {effort: u^2 <= 1}")
    found = made(problem, (Phase(1.0, constant(-1.0)),), {"u": "interior"}, [0], [1], -1.0)
    return replace(found, integral=(0.5,))


def point() -> Extremal:
    """To 1 and back: u = 2, then −2; λ = −u jumps by ρ = −4, of the sign of a lower bound."""
    problem = scalar(
        ends="initial: 0, final: 0", constraint='point: {there: {at: 0.5, holds: "x >= 1"}}'
    )
    phases = (Phase(0.5, constant(2.0), jump=(-4.0,)), Phase(1.0, constant(-2.0)))
    found = made(problem, phases, {"u": "interior interior"}, [0], [-2], 2.0)
    return replace(found, points=((-4.0,),))


def point_at_an_end(at: int) -> Extremal:
    """At least 1 away from where the other end is held: |u| = 1, λ = −u, and ρ makes up for it."""
    problem = scalar(
        ends="final: 0" if at == 0 else "initial: 0",
        constraint=f'point: {{there: {{at: {at}, holds: "x >= 1"}}}}',
    )
    u = 2 * at - 1.0
    found = made(problem, (Phase(1.0, constant(u)),), {"u": "interior"}, [1 - at], [-u], 0.5)
    return replace(found, points=((-1.0,),))


def boundary() -> Extremal:
    """x(1) − x(0) = 1 with a price on x(0): u = 1, λ = ω = −1, x(0) = 0."""
    problem = scalar(
        ends="",
        cost="lagrange: 0.5*u^2, mayer: initial(x)^2",
        constraint="boundary: {apart: final(x) - initial(x) == 1}",
    )
    found = made(problem, (Phase(1.0, constant(1.0)),), {"u": "interior"}, [0], [-1], 0.5)
    return replace(found, boundary=(-1.0,))


def moving_ceiling() -> Extremal:
    """Bryson and Denham's problem as one sees it who is carried past: x₁ − t/2 stays under 1/9.

    Costates are the same; the Hamiltonian jumps with them, by the impulse times ∂c/∂t = −1/2.
    """
    still = bryson_denham()
    problem = load_text(
        """
time: {initial: 0, final: 1}
states: {x1: {initial: 0, final: 0.5}, x2: {initial: 1.5, final: -0.5}}
controls: {u: {}}
dynamics: {x1: x2, x2: u}
cost: {lagrange: 0.5*u^2}
constraints:
  path: {ceiling: "x1 - t/2 <= 1/9"}
""",
        "test.yaml",
    )
    arcs = {"u": "interior active interior", "ceiling": "inactive active inactive"}
    start = list(still.start[1])
    return replace(made(problem, still.phases, arcs, [0, 1.5], start, 4.0), atoms=still.atoms)


def floor(bound: bool = False) -> Extremal:
    """Down to x = 0 and along it to the end: λ = t₁ − t = −u, then 0, with μ = −1."""
    inner = column(lambda t, x, costate: -costate)
    phases = (Phase(0.5, inner), Phase(1.0, constant(0.0), mu=constant(-1.0)))
    problem = scalar(
        ends="initial: 0.125, lower: 0" if bound else "initial: 0.125",
        cost="lagrange: x + 0.5*u^2",
        constraint="" if bound else "path: {floor: x >= 0}",
    )
    arcs = {"u": "interior active", "x" if bound else "floor": "inactive active"}
    return made(problem, phases, arcs, [0.125], [0.5], 0.5**3 / 3)


def end(bound: bool = False) -> Extremal:
    """At x(1) there is a floor, and a prize for being lower: u = −1, λ = 1 = 2 − 1."""
    problem = scalar(
        ends="initial: 1, lower: 0" if bound else "initial: 1",
        cost="lagrange: 0.5*u^2, mayer: 2*x",
        constraint="" if bound else "path: {floor: x >= 0}",
    )
    arcs = {"u": "interior", "x" if bound else "floor": "inactive"}
    found = made(problem, (Phase(1.0, constant(-1.0)),), arcs, [1], [1], 0.5)
    return replace(found, atoms=(Atom(1, 0, -1.0),))


def start(bound: bool = False) -> Extremal:
    """At x(0) there is a ceiling, and a prize for being higher: u = −1, λ = 2 − 1."""
    problem = scalar(
        ends="final: 0, upper: 1" if bound else "final: 0",
        cost="lagrange: 0.5*u^2, mayer: -2*initial(x)",
        constraint="" if bound else "path: {ceiling: x <= 1}",
    )
    arcs = {"u": "interior", "x" if bound else "ceiling": "inactive"}
    found = made(problem, (Phase(1.0, constant(-1.0)),), arcs, [1], [1], -1.5)
    return replace(found, atoms=(Atom(0, 0, 1.0),))


def maximised() -> Extremal:
    """The most of x(1) by ∫u²/2, told as it is earned; the initial time is free, from −1 on."""
    problem = load_text(
        """
time: {initial: {lower: -1, upper: 0.5, guess: 0}, final: 1}
states: {x: {initial: 3}}
controls: {u: {}}
dynamics: {x: u}
cost: {lagrange: -0.5*u^2, mayer: x}
sense: maximize
""",
        "test.yaml",
    )
    found = made(problem, (Phase(1.0, constant(1.0)),), {"u": "interior"}, [3], [-1], -4.0)
    return replace(found, first=-1.0)


KNOWN: dict[str, Callable[[], Extremal]] = {
    "bang and singular": bressan,
    "bang-bang": bang_bang,
    "bang-bang and singular": van_der_pol,
    "state constraint of order two": bryson_denham,
    "touch": lambda: bryson_denham(0.2),
    "state constraint of order one": van_der_pol_state,
    "mixed constraint": mixed,
    "free horizon": minimum_time,
    "integral constraint": integral,
    "point constraint": point,
    "point constraint at the start": lambda: point_at_an_end(0),
    "point constraint at the end": lambda: point_at_an_end(1),
    "boundary constraint": boundary,
    "parameter": parameter,
    "constraint that moves": moving_ceiling,
    "arc to the end": floor,
    "arc of a bound to the end": lambda: floor(bound=True),
    "impulse at the end": end,
    "impulse of a bound at the end": lambda: end(bound=True),
    "impulse at the start": start,
    "impulse of a bound at the start": lambda: start(bound=True),
    "maximised": maximised,
}
"""By what they have."""
