"""Minimum fuel and other kinks in a control, polished, against closed forms and shooting by scipy.

Nothing here is told of the structure. Closed forms are derived at their problems; shooting knows
the order of arcs and nothing else of quito.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq, fsolve

import quito_cli as quito
from quito_cli.optimality.certificate.certificate import certify
from quito_cli.problem.model import Model
from quito_cli.solution.optimal import Arc, Extremal
from quito_cli.solution.polishing import PolishStatus
from quito_cli.solution.tally import failing as failing_rows

Array = NDArray[np.float64]
Solve = Callable[..., quito.Solution]
Build = Callable[[str], Model]

JUNCTIONS, COST = 1e-8, 1e-9
"""Absolute and relative."""
UNIFORM: dict[str, Any] = {"steps": 60, "mesh": "uniform", "polish": True}

CART = """
title: A cart
time: {initial: 0, final: %s}
states: {x: {initial: 1, final: 0}, v: {initial: 0, final: 0}}
controls: {u: {lower: -1, upper: 1}}
dynamics: {x: v, v: "%s"}
cost: {lagrange: "%s"}
"""


def cart(final: float | str = 3, cost: str = "abs(u)", force: str = "u") -> str:
    """Return the problem of a cart that is to stand still one unit back."""
    return CART % (final, force, cost)


def kinds(solution: quito.Solution, name: str = "u") -> str:
    return " ".join(arc.kind for arc in solution.arcs if arc.of == name)


def failing(found: Extremal) -> list[str]:
    """Return the conditions that an answer does not meet."""
    return [row.condition for row in failing_rows(found.certificate)]


def agrees(solution: quito.Solution, junctions: list[float], cost: float) -> None:
    """Hold a polished answer against junctions and cost."""
    assert solution.polished, solution.polishing and solution.polishing.outcome
    assert solution.extremal is not None
    assert failing(solution.extremal) == []
    assert solution.switching_times == pytest.approx(sorted(junctions), abs=JUNCTIONS, rel=0)
    assert solution.cost == pytest.approx(cost, rel=COST, abs=0)
    assert solution.evidence.resimulated_cost == pytest.approx(cost, rel=1e-8)
    assert solution.evidence.resimulation_gap < 1e-9


# Bang-off-bang in closed form


def stop(distance: float, final: float) -> float:
    """Return how long u = ∓1 lasts at either end: s (T − s) = distance."""
    return (final - math.sqrt(final**2 - 4 * distance)) / 2


@pytest.mark.parametrize("final", [2.05, 3.0, 5.0])
def test_minimum_fuel_of_a_cart(final: float, solve: Solve) -> None:
    s = stop(1, final)
    solution = solve(cart(final), **UNIFORM)
    agrees(solution, [s, final - s], 2 * s)
    assert kinds(solution) == "lower kink upper"
    t = np.array([s / 2, final / 2, final - s / 2])
    assert solution.control(t)[:, 0] == pytest.approx([-1, 0, 1], abs=1e-12)


def test_bound_and_kink_alone_and_bounds_that_differ(solve: Solve) -> None:
    """With −1/2 ≤ u ≤ 1: s/2 down, then s/4 up, 1 = (s/2)(T − s/2 − s/4); T = 4."""
    s = float(brentq(lambda s: (s / 2) * (4 - 0.75 * s) - 1, 0, 2, xtol=1e-15))
    text = cart(4).replace("lower: -1, upper: 1", "lower: -0.5, upper: 1")
    solution = solve(text, **UNIFORM)
    agrees(solution, [s, 4 - s / 2], s)


@pytest.mark.parametrize(("k", "up", "down"), [(1, 1, 2), (1, 3, 0), (2, 0.5, 0.25)])
def test_prices_of_either_side_and_of_time(k: float, up: float, down: float, solve: Solve) -> None:
    """J = k (2s + τ) + (a + b) s with s² + sτ = 1: s = √(k/(k + a + b)), τ = (1 − s²)/s.

    (M. Athans and P. L. Falb, Optimal Control, 1966, section 8-8.)
    """
    s = np.sqrt(k / (k + up + down))
    tau = (1 - s**2) / s
    free = "{lower: 0.5, upper: 20, guess: 3}"
    price = f"{k} + {up}*max(0, u) + {down}*max(0, -u)"
    solution = solve(cart(free, price), **UNIFORM)
    agrees(solution, [s, s + tau], k * (2 * s + tau) + (up + down) * s)
    assert solution.times[-1] == pytest.approx(2 * s + tau, abs=1e-8)


def test_least_time_with_so_much_fuel(solve: Solve) -> None:
    """2 s = 1 and s² + s τ = 1."""
    text = cart("{lower: 0.5, upper: 20, guess: 3}", "1")
    text += 'constraints: {integral: {fuel: "abs(u) <= 1"}}\n'
    agrees(solve(text, **UNIFORM), [0.5, 2.0], 2.5)


def test_least_time_with_two_gains(solve: Solve) -> None:
    """Down by 1, up by 2: s/2 up after s down, 1 = s²/2 + s²/4. A kink of the dynamics alone."""
    text = cart("{lower: 0.5, upper: 20, guess: 3}", "1", "if_else(u > 0, 2*u, u)")
    s = np.sqrt(4 / 3)
    solution = solve(text, **UNIFORM)
    agrees(solution, [s], 1.5 * s)
    assert kinds(solution) == "lower upper"


@pytest.mark.parametrize("vector", [False, True])
def test_two_controls_each_with_its_price(vector: bool, solve: Solve) -> None:
    names = ("a[0]", "a[1]") if vector else ("a", "b")
    both = "{lower: -1, upper: 1}"
    given = "{a: {size: 2, lower: -1, upper: 1}}" if vector else f"{{a: {both}, b: {both}}}"
    text = f"""
title: Two thrusters
time: {{initial: 0, final: 4}}
states:
  x: {{initial: 1, final: 0}}
  v: {{initial: 0, final: 0}}
  y: {{initial: -0.5, final: 0}}
  w: {{initial: 0, final: 0}}
controls: {given}
dynamics: {{x: v, v: "{names[0]}", y: w, w: "{names[1]}"}}
cost: {{lagrange: "abs({names[0]}) + abs({names[1]})"}}
"""
    first, second = stop(1, 4), stop(0.5, 4)
    solution = solve(text, **UNIFORM)
    agrees(solution, [second, first, 4 - first, 4 - second], 2 * (first + second))
    assert kinds(solution, names[0]) == "lower kink upper"
    assert kinds(solution, names[1]) == "upper kink lower"


def test_several_kinks_of_one_control(solve: Solve) -> None:
    """Steps of the price at 0, ±1/2 and 7/10; λ_v = b t − a, so that u is a staircase.

    u = −1, −1/2, 0, 1/2, 7/10 between λ_v = −3/2, −1, 1, 3/2 from above: a and b from ∫ u = 0 and
    ∫ (T − t) u = −1, integrals of a staircase.
    """
    levels, steps = np.array([-1, -0.5, 0, 0.5, 0.7]), np.array([1.5, 1.0, -1.0, -1.5])

    def times(unknown: Array) -> Array:
        a, b = unknown
        return np.concatenate([[0.0], (a - steps) / b, [3.0]])

    def misses(unknown: Array) -> list[float]:
        t = times(unknown)
        return [float(levels @ np.diff(t)), float(levels @ -np.diff((3 - t) ** 2) / 2) + 1]

    found = np.asarray(fsolve(misses, [1.8, 1.2], xtol=1e-13))
    assert np.abs(misses(found)).max() < 1e-13
    t = times(found)
    price = np.array([1.25, 0.5, 0, 0.5, 0.8])
    cost = "abs(u) + 0.5*max(0, abs(u) - 0.5) + 3*max(0, u - 0.7)"
    solution = solve(cart(3, cost), **UNIFORM)
    agrees(solution, list(t[1:-1]), float(price @ np.diff(t)))
    assert kinds(solution) == "lower kink kink kink kink"


# Regular arcs between off arcs


def test_fuel_and_energy(solve: Solve) -> None:
    """L = |u| + u²/2: u = 1 − q until q = α (1 − 2t/T) is 1, then none; odd about T/2.

    ∫ (T − 2t) u = −1 over the first half gives T²/2 (α/3 − 1/2 + 1/(6α²)) = 1.
    """
    T = 3.0
    alpha = float(brentq(lambda a: T**2 / 2 * (a / 3 - 0.5 + 1 / (6 * a**2)) - 1, 1.01, 9))
    off = T / 2 * (1 - 1 / alpha)

    def running(t: float) -> float:
        u = alpha * (1 - 2 * t / T) - 1
        return u + u**2 / 2

    cost = 2 * quad(running, 0, off, epsabs=1e-14)[0]
    text = cart(T, "abs(u) + u^2/2").replace("lower: -1, upper: 1", "lower: -5, upper: 5")
    solution = solve(text, **UNIFORM)
    agrees(solution, [off, T - off], cost)
    assert kinds(solution) == "interior kink interior"


def heated(t: float, y: Array) -> list[float]:
    """Rates of temperature, costate and cost; gains 2 and 1, prices 0.3 |u| + u²/2."""
    x, costate = y[:2]
    u = thermostat(costate)
    gain = 2 * u if u > 0 else u
    return [-x / 2 + gain, -2 * (x - 1) + costate / 2, (x - 1) ** 2 + 0.3 * abs(u) + u**2 / 2]


def thermostat(costate: float) -> float:
    """Return what minimises H: heating, cooling, or off between."""
    return max(-2 * costate - 0.3, 0.0) - max(costate - 0.3, 0.0)


def off_cooling(t: float, y: Array) -> float:
    return float(y[1] - 0.3)


def off_heating(t: float, y: Array) -> float:
    return float(2 * y[1] + 0.3)


def test_heating_and_cooling_by_different_gains(solve: Solve) -> None:
    """A first-order system with a dead zone between; shooting on λ(0) with λ(4) = 0."""

    def shot(first: float) -> Any:
        how: dict[str, Any] = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13, "max_step": 0.02}
        events = (off_cooling, off_heating)
        return solve_ivp(heated, (0, 4), [3.0, first, 0.0], events=events, **how)

    first = float(brentq(lambda given: shot(given).y[1, -1], 0.5, 6, xtol=1e-14, rtol=1e-14))
    run = shot(first)
    text = """
title: A room
time: {initial: 0, final: 4}
states: {x: {initial: 3}}
controls: {u: {lower: -9, upper: 9}}
dynamics: {x: "-x/2 + if_else(u > 0, 2*u, u)"}
cost: {lagrange: "(x - 1)^2 + 0.3*abs(u) + u^2/2"}
"""
    solution = solve(text, **UNIFORM)
    agrees(solution, [*run.t_events[0], *run.t_events[1]], float(run.y[2, -1]))
    assert kinds(solution) == "interior kink interior kink"


# Against shooting


def test_minimum_time_and_fuel_with_drag(solve: Solve) -> None:
    """v' = u − v²/2 from rest to rest; five unknowns, λ_v = −1, 1 where u changes, H = 0."""
    how: dict[str, Any] = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-14}

    def arc(u: float, length: float, y: Array) -> Array:
        def rates(t: float, y: Array) -> list[float]:
            _, v, a, b = y
            return [v, u - v**2 / 2, 0, -a + b * v]

        return np.asarray(solve_ivp(rates, (0, length), y, **how).y[:, -1])

    def shot(unknown: Array) -> list[float]:
        a, b, first, off, last = unknown
        y1 = arc(1, first, np.array([0, 0, a, b]))
        y2 = arc(0, off, y1)
        x, v, _, _ = arc(-1, last, y2)
        return [x - 1, v, y1[3] + 1, y2[3] - 1, 0.5 + 1 + b]

    found = np.asarray(fsolve(shot, [-1, -1.5, 0.6, 1.3, 0.3], xtol=1e-14))
    assert np.abs(shot(found)).max() < 1e-11
    _, _, first, off, last = found
    text = cart("{lower: 0.5, upper: 20, guess: 3}", "0.5 + abs(u)", "u - v^2/2")
    text = text.replace("{initial: 1, final: 0}", "{initial: 0, final: 1}")
    solution = solve(text, **UNIFORM)
    agrees(solution, [first, first + off], 0.5 * (first + off + last) + first + last)
    assert kinds(solution) == "upper kink lower"


# What the direct answer misses


def test_an_off_arc_that_the_direct_answer_misses(solve: Solve) -> None:
    direct = solve(cart(2.01), steps=30, mesh="uniform")
    assert kinds(direct) == "lower upper"
    s = stop(1, 2.01)
    agrees(solve(cart(2.01), steps=30, mesh="uniform", polish=True), [s, 2.01 - s], 2 * s)


def test_an_arc_that_rests_at_a_bound_is_found(solve: Solve) -> None:
    """u² + |u| of which the direct answer shows neither bound: |u| ≤ 1 for 0.036 of 3."""
    T, cost = 3.0, "abs(u) + u^2/2"
    solution = solve(cart(T, cost), **UNIFORM)
    a, b, c = solution.switching_times[0], solution.switching_times[1], T - 0.0

    def moved(alpha: float) -> float:
        def integrand(t: float) -> float:
            return (c - 2 * t) * min(max(alpha * (1 - 2 * t / c) - 1, 0), 1)

        kinked = [c / 2 * (1 - 2 / alpha), c / 2 * (1 - 1 / alpha)]
        return float(quad(integrand, 0, c / 2, points=kinked, epsabs=1e-14)[0]) - 1

    alpha = float(brentq(moved, 2.001, 4, xtol=1e-14))
    assert [a, b] == pytest.approx([c / 2 * (1 - 2 / alpha), c / 2 * (1 - 1 / alpha)], abs=1e-8)
    assert kinds(solution) == "lower interior kink interior upper"


# What is no answer


DEGENERATE = """
title: As fast as it likes
time: {initial: 0, final: 4}
states: {y: {initial: -1, final: 0}, w: {initial: 0.3, final: 0}}
controls: {u: {lower: -1, upper: 1}}
dynamics: {y: w, w: u}
cost: {lagrange: "abs(u)"}
"""
"""Braking alone does it: λ_w = 1 throughout, and all ways of braking in time cost 0.3."""


@pytest.mark.parametrize(
    "text",
    [
        DEGENERATE,
        "title: t\ntime: {initial: 0, final: 2}\nstates: {x: {initial: 0, final: 1}}\n"
        'controls: {u: {lower: -1, upper: 1}}\ndynamics: {x: u}\ncost: {lagrange: "abs(u)"}\n',
    ],
)
def test_a_slope_that_is_zero_on_an_interval_is_refused(text: str, solve: Solve) -> None:
    solution = solve(text, **UNIFORM)
    assert solution.success
    assert not solution.polished
    assert solution.polishing is not None
    assert solution.polishing.status in (PolishStatus.UNSUPPORTED, PolishStatus.DEGENERATE)


@pytest.mark.parametrize("cost", ["x^2 - 0.1*abs(u)", "u^2/2 - 0.1*abs(u)"])
def test_a_concave_kink_is_not_polished(cost: str, solve: Solve) -> None:
    """H falls on both sides of it: what the parts come to, if to anything, is on both at once."""
    solution = solve(cart(3, cost), max_iterations=300, **UNIFORM)
    assert solution.success
    assert not solution.polished


@pytest.mark.parametrize("force", ["if_else(u > 0, u, 3*u)", "if_else(u > 0, 3*u, u)"])
def test_energy_with_two_gains(force: str, solve: Solve) -> None:
    """u = −g λ/2 with g the gain of its side, λ linear: 3 τ = T − τ, or the other way round.

    The steeper side lasts a quarter: ∫ g² λ = 0. ∫ (T − t) g² λ/2 = 1 says how steep λ is.
    """
    T = 3.0
    first, second = (3.0, 1.0) if "3*u)" in force else (1.0, 3.0)
    turn = T * second / (first + second)
    unit = quad(lambda t: (T - t) * first**2 * (turn - t) / 2, 0, turn)[0]
    unit += quad(lambda t: (T - t) * second**2 * (turn - t) / 2, turn, T)[0]
    slope = 1 / unit  # λ = slope (turn − t), ∫ (T − t) f = −1
    cost = quad(lambda t: (first * slope * (turn - t)) ** 2 / 4, 0, turn)[0]
    cost += quad(lambda t: (second * slope * (turn - t)) ** 2 / 4, turn, T)[0]
    solution = solve(cart(T, "u^2", force), **UNIFORM)
    agrees(solution, [turn], float(cost))


@pytest.mark.parametrize("factor", [0.99, 1.01])
@pytest.mark.parametrize("polish", [False, True])
def test_wrong_costates_have_no_certificate(
    polish: bool, factor: float, solve: Solve, model: Build
) -> None:
    """Slopes of H scaled about the price: zero where u leaves its kink no more."""
    options: dict[str, Any] = UNIFORM if polish else {"steps": 200, "mesh": "adaptive"}
    solution = solve(cart(3), **options)
    assert failing(certify(model(cart(3)), solution)) == []
    costates = factor * solution.costates
    wrong = replace(solution, costates=costates)
    if solution.adjoint is not None:
        before = solution.adjoint.before
        assert before is not None
        adjoint = replace(
            solution.adjoint, states=factor * solution.adjoint.states, before=factor * before
        )
        wrong = replace(wrong, adjoint=adjoint)
    names = failing(certify(model(cart(3)), wrong))
    assert {name for name in names if "u⁺" in name}
    assert {name for name in names if "u⁻" in name}


def test_coasting_for_too_long_has_no_certificate(solve: Solve, model: Build) -> None:
    """The least fuel for T = 3 is none where time is free and has this price: T = 4/√3 is."""
    fixed = solve(cart(3, "1 + abs(u)"), **UNIFORM)
    free = cart("{lower: 0.5, upper: 20, guess: 3}", "1 + abs(u)")
    assert "transversality: final time" in failing(certify(model(free), fixed))


# Through the rest of the house


@pytest.mark.parametrize(
    "options",
    [
        {"discretization": "lgr", "steps": 20},
        {"control": "piecewise-constant", "steps": 60},
        {"control": "piecewise-linear", "steps": 60},
        {"generating_function": "laguerre4", "steps": 60},
        {"discretization": "hermite-simpson", "steps": 60},
        {"solver": "auto", "steps": 60},
    ],
    ids=lambda options: "-".join(str(value) for value in options.values()),
)
def test_every_method_solves_it(options: dict[str, Any], solve: Solve) -> None:
    """A direct answer of so many cells is a little dearer than the least."""
    solution = solve(cart(3), mesh="uniform", **options)
    assert solution.success
    assert solution.cost == pytest.approx(2 * stop(1, 3), rel=6e-3)
    assert solution.evidence.resimulated_cost == pytest.approx(solution.cost, rel=1e-2)


def test_an_adaptive_mesh_a_warm_start_and_a_file(solve: Solve, tmp_path: Path) -> None:
    s = stop(1, 3)
    solution = solve(cart(3), polish=True)
    agrees(solution, [s, 3 - s], 2 * s)
    solution.save(tmp_path / "a.h5")
    loaded = quito.Solution.load(tmp_path / "a.h5")
    assert loaded.arcs == solution.arcs == tuple(expected(solution, s))
    assert loaded.control(1.5) == pytest.approx(0, abs=1e-12)
    assert [q.name for q in loaded.origin.controls] == ["u"]
    direct = solve(cart(3), steps=40, mesh="uniform")
    problem = quito.load(tmp_path / "cart.yaml") if written(tmp_path, cart(3)) else None
    assert problem is not None
    again = quito.solve(problem, steps=40, mesh="uniform", guess=quito.solve(problem, steps=40))
    assert again.cost == pytest.approx(direct.cost, rel=1e-8)


def written(folder: Path, text: str) -> bool:
    return bool((folder / "cart.yaml").write_text(text, encoding="utf-8"))


def expected(solution: quito.Solution, s: float) -> list[Arc]:
    """Return the arcs of minimum fuel with the times that were found."""
    a, b = solution.switching_times
    assert abs(a - s) < JUNCTIONS
    doubt = solution.arcs[0].end_uncertainty
    return [
        Arc("u", "lower", 0.0, a, 0.0, doubt),
        Arc("u", "kink", a, b, doubt, doubt),
        Arc("u", "upper", b, 3.0, doubt, 0.0),
    ]
