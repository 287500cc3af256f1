"""Arcs and certificates: right ones for right answers, wrong ones found out by name.

Structures and switching times are those of tests/reference, which Pontryagin's conditions gave as
boundary value problems, apart from quito. Wrong answers are made in `wrong_answers`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from conftest import Reference, Solve
from numpy.typing import NDArray
from wrong_answers import FREE_FLYING_ROBOT, bang_off_bang, moved, shifted, simulated

import quito_cli as quito
from quito_cli.optimality.certificate.certificate import certify
from quito_cli.problem.build import build
from quito_cli.problem.library import bundled
from quito_cli.problem.load import load_text
from quito_cli.problem.model import Model
from quito_cli.solution.optimal import Arc, Condition, Extremal, all_switches

Array = NDArray[np.float64]
Build = Callable[[str], Model]

STRUCTURES = {
    "van_der_pol": {"u": "lower upper singular"},
    "bressan": {"u": "lower singular"},
    "bang_bang": {"u": "lower upper lower"},
    "siri": {"u1": "lower upper", "u2": "lower upper", "u3": "upper lower"},
    "rayleigh": {"u": "upper interior lower interior"},
    "double_integrator_tracking": {
        "u": "interior lower interior upper interior lower interior",
    },
    "inverted_pendulum": {"u[0]": "interior", "u[1]": "lower interior upper interior"},
    "catalyst_mixing": {"u": "upper singular lower"},
}
ADAPTIVE = {"mesh": "adaptive"}
BUNDLED = sorted(name for name in bundled() if name != "auv_fleet")


def kinds(arcs: Iterable[Arc], of: str) -> str:
    return " ".join(arc.kind for arc in arcs if arc.of == of)


def row(rows: Iterable[Condition], name: str) -> Condition:
    return next(r for r in rows if r.condition == name)


def failing(rows: Iterable[Condition]) -> dict[str, str]:
    return {r.condition: r.reason for r in rows if r.verdict == "fails"}


@pytest.mark.parametrize("name", STRUCTURES)
def test_structure_as_in_the_reference_and_nothing_fails(
    name: str, solve: Solve, reference: Reference
) -> None:
    solution = solve(name, **ADAPTIVE)
    facts = reference(name)[0]
    assert {of: kinds(solution.arcs, of) for of in STRUCTURES[name]} == STRUCTURES[name]
    horizon = solution.times[-1] - solution.times[0]
    times = solution.switching_times
    assert len(times) == len(facts["switching_times"])
    np.testing.assert_allclose(times, facts["switching_times"], atol=2e-3 * horizon)
    assert failing(solution.certificate) == {}
    applied = [r for r in solution.certificate if r.verdict != "not applicable"]
    assert len(applied) >= 5
    assert all(r.residual >= 0 and r.scale > 0 for r in applied)


@pytest.mark.parametrize("name", STRUCTURES)
def test_arcs_follow_each_other_and_know_how_sure_they_are(
    name: str, solve: Solve, reference: Reference
) -> None:
    solution = solve(name, **ADAPTIVE)
    known = np.array(reference(name)[0]["switching_times"])
    for of in STRUCTURES[name]:
        own = [arc for arc in solution.arcs if arc.of == of]
        assert (own[0].start, own[-1].end) == (solution.times[0], solution.times[-1])
        assert own[0].start_uncertainty == own[-1].end_uncertainty == 0
        for before, after in pairwise(own):
            assert before.end == after.start
            assert before.end_uncertainty == after.start_uncertainty
            assert np.abs(known - before.end).min() <= before.end_uncertainty


def test_constraints_have_stretches(solve: Solve, reference: Reference) -> None:
    solution = solve("van_der_pol_state", **ADAPTIVE)
    t1, t2 = reference("van_der_pol_state")[0]["switching_times"]
    assert kinds(solution.arcs, "x2") == "inactive active inactive"
    assert kinds(solution.arcs, "u") == "interior active interior"
    (active,) = [a for a in solution.arcs if (a.of, a.kind) == ("x2", "active")]
    assert abs(active.start - t1) <= active.start_uncertainty < 0.1
    assert abs(active.end - t2) <= active.end_uncertainty < 0.1
    mixed = solve("rayleigh_mixed")
    assert kinds(mixed.arcs, "mixed") == "active inactive active inactive"
    assert kinds(mixed.arcs, "u") == "active interior active interior"
    denham = solve("bryson_denham", **ADAPTIVE)
    assert kinds(denham.arcs, "x1") == "inactive active inactive"
    for answer in (solution, mixed, denham):
        assert failing(answer.certificate) == {}


SHORT_ARC = """
title: A short stay at a bound
time: {initial: 0, final: 10}
states: {x: {initial: 0}, y: {initial: 0}}
controls: {u: {lower: 0, upper: 1}}
dynamics: {x: u, y: (u - 1.02*exp(-(t - 4)^2))^2}
cost: {mayer: y}
"""
"""The control is 1.02 exp(−(t−4)²) up to 1: at its bound for 0.28 of 10 units of time."""


def test_an_arc_of_little_more_than_the_transition_survives(solve: Solve) -> None:
    solution = solve(SHORT_ARC, **ADAPTIVE)
    way = np.sqrt(np.log(1.02))
    inner = [a for a in solution.arcs if a.of == "u" and a.kind == "upper"]
    assert len(inner) == 1
    assert abs(inner[0].start - (4 - way)) <= inner[0].start_uncertainty + 0.01
    assert abs(inner[0].end - (4 + way)) <= inner[0].end_uncertainty + 0.01


def test_the_union_of_junctions_has_each_once() -> None:
    arcs = (
        Arc("u", "lower", 0, 1, 0, 0.01),
        Arc("u", "upper", 1, 4, 0.01, 0),
        Arc("v", "lower", 0, 1.005, 0, 0.001),
        Arc("v", "upper", 1.005, 3, 0.001, 0.1),
        Arc("v", "interior", 3, 4, 0.1, 0),
    )
    assert all_switches(arcs, ()) == (1.005, 3)


def test_signs_agree_with_a_riccati_solution(solve: Solve, lq: str) -> None:
    """V = tanh(1−t) x²/2: λ = V_x, H = ½(x² + u²) + λu = 1/(2 cosh² 1), H_u = u + λ = 0."""
    solution = solve(lq, steps=40)
    assert solution.extremal is not None
    t = solution.extremal.times
    x = np.cosh(1 - t) / np.cosh(1)
    np.testing.assert_allclose(solution.costate(t)[:, 0], np.tanh(1 - t) * x, atol=2e-4)
    h = solution.extremal.curves["Hamiltonian"]
    np.testing.assert_allclose(h, 1 / (2 * np.cosh(1) ** 2), atol=1e-5)
    np.testing.assert_allclose(solution.extremal.curves["dH/du"], 0, atol=1e-3)
    assert failing(solution.certificate) == {}


def test_costates_of_the_other_sign_fail(solve: Solve, model: Build, lq: str) -> None:
    solution = solve(lq, steps=40)
    wrong = certify(model(lq), replace(solution, costates=-solution.costates))
    assert "dH/du = 0 on interior arcs of u" in failing(wrong.certificate)


DECAY = """
title: A free initial value of a nonlinear decay
time: {initial: 0, final: 1}
states: {x: {initial: 2}}
dynamics: {x: -x^2*(1 + 0.5*sin(3*t))}
cost: {lagrange: x^3, mayer: x}
"""


@pytest.mark.parametrize(
    ("scheme", "order"), [("euler", 1), ("trapezoidal", 2), ("rk4", 4), ("hermite-simpson", 4)]
)
def test_residuals_shrink_by_the_order_of_the_scheme(scheme: str, order: int, solve: Solve) -> None:
    """A defect over its cell's length is O(h^order)."""
    found = []
    for steps in (20, 40, 80):
        rows = solve(DECAY, steps=steps, discretization=scheme, substeps=1).certificate
        names = ("state equation", "costate equation")
        found.append([row(rows, name).residual for name in names])
    rates = np.log2(np.array(found[:-1]) / np.array(found[1:]))
    assert (np.abs(rates[-1] - order) < 0.3).all(), rates


@pytest.mark.parametrize(
    ("name", "condition", "order"),
    [
        ("rayleigh", "costate equation", 4),
        ("rayleigh", "H is constant", 1),
        ("catalyst_mixing", "dH/du = 0 on singular arcs of u", 2),
        ("van_der_pol", "dH/du = 0 on singular arcs of u", 1),
    ],
)
def test_residuals_shrink_with_the_mesh(
    name: str, condition: str, order: float, solve: Solve
) -> None:
    """By the scheme's order where all is smooth; a switch or kink within a cell leaves less."""
    first, second, last = (
        row(solve(name, steps=steps).certificate, condition).residual for steps in (100, 200, 400)
    )
    assert first > second > last
    assert np.log2(first / last) / 2 >= order - 0.3


@pytest.mark.parametrize("name", BUNDLED)
def test_no_false_alarm_on_coarse_uniform_meshes(name: str, solve: Solve) -> None:
    solution = solve(name, steps=60)
    rows = solution.certificate
    assert rows
    assert failing(rows) == {}
    if not solution.success:
        (only,) = rows
        assert only.verdict == "not applicable"
        assert np.isnan(only.residual)
        assert "the answer is none" in only.reason


@pytest.mark.parametrize(
    "options",
    [
        {"discretization": "lgr", "steps": 20},
        {"control": "piecewise-constant", "steps": 80},
        {"discretization": "euler", "steps": 100},
        {"discretization": "trapezoidal", "steps": 80},
        {"path_points": "substeps", "steps": 80},
    ],
    ids=lambda options: "-".join(str(value) for value in options.values()),
)
@pytest.mark.parametrize("name", ["van_der_pol", "bryson_denham", "rayleigh_mixed", "goddard"])
def test_no_false_alarm_with_other_methods(
    name: str, options: dict[str, str | int], solve: Solve
) -> None:
    solution = solve(name, **options)
    assert solution.success
    assert failing(solution.certificate) == {}


SHIFTS = {
    "van_der_pol": (2.9, 3.6, "singular arcs of u follow the feedback"),
    "rayleigh": (3.1, 4.0, "dH/du = 0 on interior arcs of u"),
}


@pytest.mark.parametrize("states", ["kept", "simulated"])
@pytest.mark.parametrize("name", SHIFTS)
def test_a_control_shifted_on_an_arc_fails(
    name: str, states: str, solve: Solve, model: Build
) -> None:
    """By a hundredth of its range, which is 2."""
    solution, (first, last, condition) = solve(name, **ADAPTIVE), SHIFTS[name]
    coefficients = shifted(solution, first, last, 0.02)
    wrong = replace(solution, coefficients=coefficients)
    if states == "simulated":
        wrong = simulated(model(name), solution, coefficients)
    found = certify(model(name), wrong).certificate
    assert condition in failing(found)
    assert first <= row(found, condition).time <= last + 0.4
    if states == "kept":
        assert "state equation" in failing(found)


@pytest.mark.parametrize(
    ("name", "control", "time"),
    [("van_der_pol", "u", 1.36674), ("siri", "u3", 7.43066), ("bang_bang", "u", 0.51686)],
)
def test_a_switching_time_moved_fails(
    name: str, control: str, time: float, solve: Solve, model: Build
) -> None:
    """By a hundredth of the horizon, later; states are those of the moved control."""
    wrong = moved(model(name), solve(name, **ADAPTIVE), time)
    found = failing(certify(model(name), wrong).certificate)
    names = (f"sign of dH/du on arcs of {control}", f"dH/du = 0 where {control} switches")
    assert any(condition.startswith(names) for condition in found), found


def test_the_bang_off_bang_extremal_of_the_free_flying_robot_fails() -> None:
    """Its switching functions are beyond their bound by 4e-4 where two singular arcs should be."""
    problem = load_text(FREE_FLYING_ROBOT, "robot.yaml")
    template = quito.solve(problem, steps=900, control="piecewise-constant")
    wrong = bang_off_bang(build(problem), template, 100)
    assert wrong.cost < 7.9102
    found = certify(build(problem), wrong)
    assert set(failing(found.certificate)) == {
        "sign of dH/du on arcs of u3 at its bounds",
        "sign of dH/du on arcs of u4 at its bounds",
    }
    first = row(found.certificate, "sign of dH/du on arcs of u3 at its bounds")
    assert first.residual == pytest.approx(4e-4, rel=0.1)
    assert 1.05 < first.time < 1.2


MODIFIED = [
    ("van_der_pol", "mu*(1", "1.01*mu*(1", "state equation"),
    ("rayleigh", "x1^2 + u^2", "x1^2 + 1.01*u^2", "dH/du = 0 on interior arcs of u"),
    ("rayleigh", "x1^2 + u^2", "1.02*x1^2 + u^2", "costate equation"),
    ("rayleigh", "upper: 1}", "upper: 1.01}", "feasibility"),
    ("rayleigh", "final: 4.5}", "final: 4.55}", "feasibility"),
]


@pytest.mark.parametrize(("name", "old", "new", "condition"), MODIFIED)
def test_the_answer_to_another_problem_fails(
    name: str, old: str, new: str, condition: str, model: Build
) -> None:
    text = quito.load(name).text
    assert old in text
    other = quito.solve(load_text(text.replace(old, new), "other.yaml"), mesh="adaptive")
    assert failing(other.certificate) == {}
    found = failing(certify(model(name), other).certificate)
    assert condition in found
    assert "t = " in found[condition]


SLACK = """
title: Down to where a constraint lets it
time: {initial: 0, final: 1}
states: {x: {initial: 1}}
controls: {u: {lower: -5, upper: 5}}
dynamics: {x: u}
cost: {lagrange: u^2}
constraints:
"""


@pytest.mark.parametrize(
    "constraint",
    [
        "  boundary: {held: final(x) <= LIMIT}",
        "  boundary: {held: -1 <= final(x) <= LIMIT}",
        "  integral: {held: x <= LIMIT}",
        "  integral: {held: 0 <= x <= LIMIT}",
        "  point: {held: {at: 0.5, holds: x <= LIMIT}}",
        "  point: {held: {at: 0.5, holds: -1 <= x <= LIMIT}}",
    ],
)
def test_a_multiplier_of_a_constraint_that_is_not_active_fails(constraint: str) -> None:
    """The answer under a tighter constraint has a multiplier where the other has none."""
    tight, loose = (
        load_text(SLACK + constraint.replace("LIMIT", limit), "slack.yaml")
        for limit in ("0.5", "0.6")
    )
    solution = quito.solve(tight, steps=40)
    assert failing(solution.certificate) == {}
    found = failing(certify(build(loose), solution).certificate)
    assert list(found) == ["multipliers of held: sign and complementarity"]


@pytest.mark.parametrize("scheme", ["rk4", "lgr", "trapezoidal"])
def test_an_integral_whose_parts_cancel_is_judged_by_its_parts(scheme: str) -> None:
    problem = load_text(SLACK.replace("u^2", "(x - t)^2 + u^2") + "  integral: {net: u == 0}", "s")
    solution = quito.solve(problem, steps=40, discretization=scheme)
    assert failing(solution.certificate) == {}


@pytest.mark.parametrize("scheme", ["rk4", "lgr"])
@pytest.mark.parametrize(
    ("name", "old", "new"),
    [("bryson_denham", "l: 1/9", "l: 0.12"), ("van_der_pol_state", "lower: -0.4", "lower: -0.45")],
)
def test_costates_that_a_bound_never_reached_bends_fail(
    name: str, old: str, new: str, scheme: str, model: Build
) -> None:
    """The answer under a tighter bound of a state: nothing explains its costates, nor their jumps.

    In a collocation the points of a cell are unevenly far apart, which bends no line.
    """
    solution = quito.solve(name, steps=60, discretization=scheme)
    assert failing(certify(model(name), solution).certificate) == {}
    text = quito.load(name).text
    assert old in text
    looser = build(load_text(text.replace(old, new), "looser.yaml"))
    assert "costate equation" in failing(certify(looser, solution).certificate)


def test_polynomials_of_degree_two_are_not_blamed_for_their_slopes(solve: Solve) -> None:
    solution = solve("container_crane", steps=40, discretization="lgr", degree=2)
    assert failing(solution.certificate) == {}


def test_a_control_without_bounds_has_no_arc_there_for_that_reason(solve: Solve) -> None:
    free = row(solve(FREE_TIME, steps=20).certificate, "sign of dH/du on arcs of u at its bounds")
    assert (free.verdict, free.reason) == ("not applicable", "u has no bounds")


def test_multipliers_of_the_wrong_sign_fail(solve: Solve, model: Build) -> None:
    solution = solve("rayleigh_mixed", steps=60)
    name = "path constraint mixed"
    turned = dict(solution.multipliers) | {name: -solution.multipliers[name]}
    found = certify(model("rayleigh_mixed"), replace(solution, multipliers=turned))
    assert "multipliers of mixed: sign and complementarity" in failing(found.certificate)


def test_costates_that_miss_the_end_fail(solve: Solve, model: Build) -> None:
    """Those of x(t_f) given a weight of its own in the cost, at a free end."""
    solution = solve("van_der_pol", steps=60)
    wrong = replace(solution, costates=solution.costates + 0.05)
    found = failing(certify(model("van_der_pol"), wrong).certificate)
    assert {"transversality: final", "costate equation"} <= set(found)


FREE_TIME = """
title: Least time and effort
time: {initial: 0, final: {lower: 0.5, upper: 10, guess: 3}}
states: {x: {initial: 0, final: 1}}
controls: {u: {}}
dynamics: {x: u}
cost: {lagrange: 1 + u^2}
"""
"""H = 1 + u² + λu = 0 with u = −λ/2: u = 1, t_f = 1, λ = −2."""


def test_free_times_and_parameters(solve: Solve, model: Build) -> None:
    solution = solve(FREE_TIME, steps=20)
    assert solution.times[-1] == pytest.approx(1, abs=1e-6)
    assert row(solution.certificate, "transversality: final time").verdict.startswith("holds")
    slow = FREE_TIME.replace("1 + u^2", "1.2 + u^2")
    found = certify(model(slow), solution).certificate
    assert "transversality: final time" in failing(found)


KINKED = """
title: Least fuel
time: {initial: 0, final: 3}
states: {x: {initial: 1, final: 0}, v: {initial: 0, final: 0}}
controls: {u: {lower: -1, upper: 1}}
dynamics: {x: v, v: u}
cost: {lagrange: abs(u)}
"""


def test_a_kink_of_the_hamiltonian_is_where_the_control_rests(solve: Solve, model: Build) -> None:
    """Bang-off-bang: at u = 0 zero lies between the one-sided derivatives λ − 1 and λ + 1.

    The answer is that of u = a − b, which has no kink.
    """
    halves = "{a: {lower: 0, upper: 1}, b: {lower: 0, upper: 1}}"
    parts = KINKED.replace("{u: {lower: -1, upper: 1}}", halves)
    parts = parts.replace("v: u}", "v: a - b}").replace("abs(u)", "a + b")
    split = solve(parts, steps=100, control="piecewise-constant")
    like = solve(KINKED.replace("abs(u)", "u^2"), steps=100, control="piecewise-constant")
    answer = replace(
        split,
        origin=like.origin,
        evidence=like.evidence,
        junctions=like.junctions,
        coefficients=split.coefficients[:, :1] - split.coefficients[:, 1:],
        extremal=None,
    )
    found = certify(model(KINKED), answer)
    assert kinds(found.arcs, "u") == "lower kink upper"
    assert failing(found.certificate) == {}
    wrong = certify(model(KINKED), replace(answer, costates=1.5 * answer.costates))
    assert "sign of dH/du on arcs of u⁻ at its bounds" in failing(wrong.certificate)


@pytest.mark.parametrize("scheme", ["euler", "trapezoidal", "rk4"])
def test_a_single_cell_has_a_certificate(scheme: str, solve: Solve) -> None:
    assert solve(DECAY, steps=1, discretization=scheme).certificate


def test_problems_without_controls_or_states_to_speak_of(solve: Solve) -> None:
    text = """
title: A free initial value
time: {initial: 0, final: 1}
states: {x: {}}
dynamics: {x: -x}
cost: {mayer: (x - 1)^2}
"""
    solution = solve(text, steps=4)
    assert solution.success
    assert solution.arcs == ()
    assert failing(solution.certificate) == {}


def test_an_answer_without_a_certificate_still_has_junctions(solve: Solve) -> None:
    solution = replace(solve("bang_bang", **ADAPTIVE), extremal=None)
    assert solution.arcs == ()
    assert solution.certificate == ()
    assert len(solution.switching_times) == 2


def test_a_hamiltonian_too_long_says_so(
    solve: Solve, model: Build, monkeypatch: pytest.MonkeyPatch, lq: str
) -> None:
    monkeypatch.setattr("quito_cli.optimality.symbols.probes.MOST_OPERATIONS", 1)
    found: Extremal = certify(model(lq), solve(lq, steps=40))
    assert [r.verdict for r in found.certificate] == ["not applicable"]
    assert "too long" in found.certificate[0].reason


@pytest.mark.parametrize("options", [{"steps": 20}, {"discretization": "lgr", "steps": 10}])
@pytest.mark.parametrize(("at", "held", "end"), [(0, "final", "initial"), (1, "initial", "final")])
def test_a_point_constraint_at_an_end_of_the_horizon(
    at: int, held: str, end: str, options: dict[str, Any], model: Build, solve: Solve
) -> None:
    """At least 1 away from where x is held: |u| = 1, λ = −u, and ρ = −1 makes up for it."""
    text = f"""
time: {{initial: 0, final: 1}}
states: {{x: {{{held}: 0}}}}
controls: {{u: {{}}}}
dynamics: {{x: u}}
cost: {{lagrange: 0.5*u^2}}
constraints:
  point: {{there: {{at: {at}, holds: "x >= 1"}}}}
"""
    solution = solve(text, **options)
    assert solution.multipliers["point constraint there"] == pytest.approx(-1, abs=1e-8)
    assert failing(solution.certificate) == {}
    wrong = {**solution.multipliers, "point constraint there": np.array([[-1.1]])}
    found = certify(model(text), replace(solution, multipliers=wrong))
    assert set(failing(found.certificate)) == {f"transversality: {end}"}
