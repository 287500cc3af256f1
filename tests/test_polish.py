"""Polished answers against what is known of them: references, closed forms, other methods.

Nothing here is told of the structure: problems are the bundled files as they stand, and some of
this file whose answers are known in closed form.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import quito_cli as quito
from quito_cli.problem.build import build
from quito_cli.problem.library import bundled
from quito_cli.problem.load import load_text
from quito_cli.problem.model import Known
from quito_cli.solution.polishing import PolishStatus
from quito_cli.solution.tally import failing

Array = NDArray[np.float64]
Polished = Callable[..., quito.Solution]
Reference = Callable[[str], tuple[dict[str, Any], dict[str, Array]]]


@dataclass(frozen=True)
class Wanted:
    """How near the references a polished answer is to be."""

    junctions: float
    """Absolute, of the switching times."""
    cost: float
    """Relative."""
    control: float
    """Over the span of the control, further than `CLOSE` from the junctions."""


EXACT, FINE = Wanted(1e-8, 1e-9, 1e-6), Wanted(1e-6, 1e-6, 1e-6)
ISSUE = {
    **dict.fromkeys(("van_der_pol", "bressan", "catalyst_mixing", "bang_bang", "rayleigh"), EXACT),
    **dict.fromkeys(("siri", "inverted_pendulum", "double_integrator_tracking"), FINE),
    **dict.fromkeys(("rayleigh_mixed", "van_der_pol_state", "bryson_denham"), FINE),
}
WITH_CONTROL = (
    *("van_der_pol", "bressan", "catalyst_mixing", "bang_bang"),
    *("siri", "bryson_denham", "double_integrator_tracking"),
)
"""Those whose files know the control as a function of time."""
CLOSE = 1e-6
"""Times from a junction at which a control is not compared."""
UNSTABLE = ("inverted_pendulum", "hypersensitive")
"""An error of the last digit grows along the horizon: integrated anew they are another answer."""
DEGENERATE = "alychan"


@pytest.fixture(scope="module")
def polished() -> Polished:
    """Solve with a polish, by name or the text of a problem; the same call is done once."""

    @cache
    def solved(problem: str, options: tuple[tuple[str, Any], ...]) -> quito.Solution:
        given = load_text(problem, "test.yaml") if "\n" in problem else problem
        return quito.solve(given, polish=True, **dict(options))

    return lambda problem, **options: solved(problem, tuple(sorted(options.items())))


def account(solution: quito.Solution) -> str:
    """What is to be read where a test fails."""
    how = solution.polishing
    assert how is not None
    steps = [f"{step.action}: {step.sentence} {step.residuals}" for step in how.steps]
    return "\n".join([how.outcome, *steps])


def assert_exact(solution: quito.Solution) -> None:
    """A polished answer solves its system, and nothing speaks against it."""
    how = solution.polishing
    assert how is not None
    assert solution.polished, account(solution)
    assert solution.success
    assert how.residual < 1e-10
    assert how.segments >= 1
    assert solution.certificate
    assert failing(solution.certificate) == [], account(solution)
    if solution.origin.name not in UNSTABLE:
        assert solution.warnings == ()


def away(times: Array, junctions: tuple[float, ...]) -> Array:
    """Return those times that are not close to a junction."""
    far = np.ones(len(times), dtype=bool)
    for junction in junctions:
        far &= np.abs(times - junction) > CLOSE
    return times[far]


def dense(solution: quito.Solution) -> Array:
    """Times all over the horizon, and close to either side of its junctions."""
    start, end = solution.times[[0, -1]]
    beside = [t + s * 1.01 * CLOSE for t in solution.switching_times for s in (-1, 1)]
    return np.unique(np.clip(np.append(np.linspace(start, end, 20_001), beside), start, end))


def control_error(solution: quito.Solution) -> float:
    """Return the largest error of a control over its span, by the functions of the file."""
    model = build(quito.load(solution.origin.name))
    assert model.known is not None
    t = away(dense(solution), model.known.switching_times)
    known = Known.sample(model.known.controls, model.controls, t)
    span = np.ptp(known, axis=0)
    error = np.abs(solution.control(t) - known).max(axis=0) / np.where(span > 0, span, 1.0)
    assert np.isfinite(error).all()
    return float(error.max())


# What must be reached


@pytest.mark.parametrize("name", ISSUE)
def test_a_polished_answer_solves_pontryagins_system(name: str, polished: Polished) -> None:
    assert_exact(polished(name))


@pytest.mark.parametrize("name", ISSUE)
def test_its_junctions_are_the_known_ones(
    name: str, polished: Polished, reference: Reference
) -> None:
    found, known = polished(name).switching_times, reference(name)[0]["switching_times"]
    assert len(found) == len(known), found
    assert found == pytest.approx(known, abs=ISSUE[name].junctions, rel=0)


@pytest.mark.parametrize("name", ISSUE)
def test_its_cost_is_the_known_one(name: str, polished: Polished, reference: Reference) -> None:
    solution, known = polished(name), reference(name)[0]["cost"]
    assert solution.cost == pytest.approx(known, rel=ISSUE[name].cost, abs=0)
    if name not in UNSTABLE:
        assert solution.evidence.resimulated_cost == pytest.approx(known, rel=1e-7)


@pytest.mark.parametrize("name", WITH_CONTROL)
def test_its_control_is_the_known_one_up_to_the_junctions(name: str, polished: Polished) -> None:
    assert control_error(polished(name)) < ISSUE[name].control


@pytest.mark.parametrize("name", ISSUE)
def test_controls_and_states_are_those_of_the_verified_samples(
    name: str, polished: Polished, reference: Reference
) -> None:
    facts, samples = reference(name)
    t, solution = samples["t"], polished(name)
    far = np.isin(t, away(t, tuple(facts["switching_times"])))
    for found, known in (
        (solution.control(t[far]), samples["u"][far]),
        (solution.state(t), samples["x"]),
    ):
        span = np.ptp(known, axis=0)
        error = np.abs(found - known).max(axis=0) / np.where(span > 0, span, 1.0)
        assert error.max() < ISSUE[name].control


COSTATES = (
    *("van_der_pol", "rayleigh", "rayleigh_mixed"),
    *("van_der_pol_state", "siri", "inverted_pendulum"),
)


@pytest.mark.parametrize("name", COSTATES)
def test_its_costates_are_the_verified_ones(
    name: str, polished: Polished, reference: Reference
) -> None:
    solution, known = polished(name), np.array(reference(name)[0]["p0"])
    assert solution.costate(solution.times[0])[0] == pytest.approx(known, rel=1e-7, abs=1e-7)


@pytest.mark.parametrize("name", ["van_der_pol", "siri", "bryson_denham"])
def test_a_saved_one_is_the_same(name: str, polished: Polished, tmp_path: Path) -> None:
    solution = polished(name)
    solution.save(tmp_path / "a.h5")
    again = quito.Solution.load(tmp_path / "a.h5")
    t = dense(solution)
    for function in ("control", "state", "costate"):
        ours, theirs = getattr(solution, function)(t), getattr(again, function)(t)
        np.testing.assert_array_equal(ours, theirs)
    assert again.arcs == solution.arcs
    assert repr(again.certificate) == repr(solution.certificate)  # NaN is as good as NaN
    assert again.polishing == solution.polishing
    assert again.polished


def test_the_costate_of_bryson_and_denham_jumps(polished: Polished) -> None:
    """18 before the arc and −18 after it (Bryson and Ho 1975, section 3.11), from side to side."""
    t = np.array([1 / 3 - 1e-9, 2 / 3 + 1e-9])
    found = polished("bryson_denham").costate(t)[:, 0]
    assert found == pytest.approx([18, -18], abs=1e-5)


def test_what_is_degenerate_is_reported_and_not_forced(polished: Polished) -> None:
    solution = polished(DEGENERATE)
    assert solution.polishing is not None
    assert solution.polishing.status is PolishStatus.DEGENERATE, account(solution)
    assert solution.polishing.reason
    assert solution.success
    assert any("not polished" in warning for warning in solution.warnings)
    direct = quito.solve(DEGENERATE, mesh="adaptive")
    assert solution.cost == direct.cost
    np.testing.assert_array_equal(solution.coefficients, direct.coefficients)


# From a coarse answer

BEST_KNOWN = ("auv_fleet", "robot_path")
"""Problems whose files have no reference."""


SLOW = pytest.mark.benchmark
"""Eighteen states and controls among obstacles: its solve alone takes as long as all others'."""


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=SLOW if name == "auv_fleet" else ()) for name in bundled()]
)
def test_from_fifty_equal_cells_it_is_right_or_says_that_it_could_not(
    name: str, polished: Polished
) -> None:
    solution = polished(name, steps=50, mesh="uniform")
    how = solution.polishing
    assert how is not None
    if not solution.polished:
        assert how.status is not PolishStatus.POLISHED
        assert len(solution.times) == 51, "the direct answer stands"
        assert how.reason or how.status is PolishStatus.NO_ANSWER
        assert any("not polished" in warning for warning in solution.warnings)
        return
    assert_exact(solution)
    if name in BEST_KNOWN:
        fine = quito.solve(name, discretization="lgr", steps=50, degree=4)
        assert fine.success
        assert solution.cost == pytest.approx(fine.cost, rel=1e-3)
        return
    known = build(quito.load(name)).known
    assert known is not None
    assert known.cost is not None
    assert known.accuracy is not None
    near = max(10 * known.accuracy, 1e-8 * (abs(known.cost) or 1.0))
    assert solution.cost == pytest.approx(known.cost, abs=near, rel=0), account(solution)
    if known.switching_times:
        assert solution.switching_times == pytest.approx(known.switching_times, abs=1e-6)
    if known.controls:
        assert control_error(solution) < 1e-6


@pytest.mark.parametrize("name", ["van_der_pol", "bressan", "bang_bang", "rayleigh", "siri"])
def test_from_fifty_equal_cells_the_simplest_are_reached(name: str, polished: Polished) -> None:
    """A test of what may be refused must not pass by refusing all."""
    assert polished(name, steps=50, mesh="uniform").polished


# Answers in closed form


@pytest.mark.parametrize(
    ("ceiling", "cost", "junctions"),
    [
        (0.1, 4 / 0.9, (0.3, 0.7)),  # followed
        (0.2, 2 + 6 * (1 - 0.8) ** 2, (0.5,)),  # touched
        (0.3, 2.0, ()),  # never met
    ],
)
def test_a_ceiling_that_is_followed_touched_or_never_met(
    ceiling: float, cost: float, junctions: tuple[float, ...]
) -> None:
    """Bryson, Denham and Dreyfus 1963: 4/(9 l), 2 + 6 (1 − 4 l)², 2."""
    solution = quito.solve("bryson_denham", constants={"l": ceiling}, polish=True)
    assert_exact(solution)
    assert solution.cost == pytest.approx(cost, rel=1e-9)
    assert solution.switching_times == pytest.approx(junctions, abs=1e-6)


@pytest.mark.parametrize("horizon", [1.5, 4.0])
def test_bressan_on_other_horizons(horizon: float) -> None:
    """J = −T³/18 with its junction at T/3."""
    solution = quito.solve("bressan", constants={"T": horizon}, polish=True)
    assert_exact(solution)
    assert solution.cost == pytest.approx(-(horizon**3) / 18, rel=1e-9)
    assert solution.switching_times == pytest.approx([horizon / 3], abs=1e-8)


TWO = """\
title: Two controls that switch each at its own time
time: {initial: 0, final: 1}
states: {x: {initial: 0}, y: {initial: 0}}
controls: {u: {lower: -1, upper: 1}, v: {lower: -2, upper: 3}}
dynamics: {x: u, y: v}
cost: {lagrange: x*(t - 0.3) + y*(0.4 - t)}
"""


def test_controls_that_stay_at_their_bounds() -> None:
    """λ_x = (1 − t)(t + 0.4)/2 > 0 and λ_y = −(1 − t)(t + 0.2)/2 < 0: u = −1, v = 3 throughout."""
    solution = quito.solve(load_text(TWO, "two.yaml"), polish=True, steps=30)
    assert_exact(solution)
    assert solution.switching_times == ()
    t = np.linspace(0, 1, 101)
    np.testing.assert_allclose(solution.control(t), np.tile([-1.0, 3.0], (101, 1)), atol=1e-12)
    cost = -(1 / 3 - 0.15) + 3 * (0.2 - 1 / 3)
    assert solution.cost == pytest.approx(cost, abs=1e-12)


BANGS = """\
title: Jumps of two controls at times of their own
time: {initial: 0, final: 1}
states: {x: {initial: 0}, y: {initial: 0}}
controls: {u: {lower: -1, upper: 1}, v: {lower: -2, upper: 3}}
dynamics: {x: u, y: v}
cost: {lagrange: x*cos(2*pi*t) + y*(2*t - 1.3)}
"""


def test_jumps_of_two_controls() -> None:
    """λ_x = −sin(2πt)/2π and λ_y = ∫_t^1 (2s − 1.3) ds = (1 − t)(t − 0.3)."""
    solution = quito.solve(load_text(BANGS, "bangs.yaml"), polish=True)
    assert_exact(solution)
    assert solution.switching_times == pytest.approx([0.3, 0.5], abs=1e-8)
    arcs = [(arc.of, arc.kind) for arc in solution.arcs]
    assert arcs == [("u", "upper"), ("u", "lower"), ("v", "upper"), ("v", "lower")]


PUSH = """\
title: The dearest push that a budget allows
sense: maximize
time: {initial: 0, final: 1}
states: {x: {initial: 0, final: 0}, v: {initial: 0}}
controls: {u: {}}
dynamics: {x: v, v: u}
cost: {mayer: v}
constraints:
  integral: {budget: u^2 <= 4}
"""


def test_an_integral_constraint_and_a_maximum() -> None:
    """u = c (3t − 1) with ∫ u (1 − t) = 0 and c² ∫ (3t − 1)² = c² = 4: v = c/2 = 1."""
    solution = quito.solve(load_text(PUSH, "push.yaml"), polish=True, steps=30)
    assert_exact(solution)
    assert solution.cost == pytest.approx(1, abs=1e-9)
    t = np.linspace(0, 1, 101)
    np.testing.assert_allclose(solution.control(t)[:, 0], 2 * (3 * t - 1), atol=1e-7)


SLIDE = """\
title: A parameter and a free end
time: {initial: 0, final: {lower: 0.5, upper: 9, guess: 2}}
states: {x: {initial: 0, final: 1}}
controls: {u: {}}
parameters: {p: {lower: -5, upper: 5}}
dynamics: {x: u + p}
cost: {lagrange: 1 + u^2/2, mayer: p^2/2}
"""


def test_a_free_time_and_a_parameter() -> None:
    """H = 1 + u²/2 + λ(u + p) = 0 and u = −λ const., p = −λT = uT, (u + p) T = 1.

    With p = uT: 1 − u²/2 − u²T = 0 and uT (1 + T) = 1, so T²(1 + T)² = 1/2 + T.
    """
    roots = np.roots([1, 2, 1, -1, -0.5])
    (end,) = [r.real for r in roots if abs(r.imag) < 1e-12 and r.real > 0]
    u = 1 / (end * (1 + end))
    solution = quito.solve(load_text(SLIDE, "slide.yaml"), polish=True, steps=30)
    assert_exact(solution)
    assert solution.times[-1] == pytest.approx(end, abs=1e-9)
    assert solution.parameters == pytest.approx([u * end], abs=1e-9)
    assert solution.control([0.1 * end])[0] == pytest.approx([u], abs=1e-9)
    cost = end * (1 + u**2 / 2) + (u * end) ** 2 / 2
    assert solution.cost == pytest.approx(cost, rel=1e-10)


GATE = """\
title: Through a gate
time: {initial: 0, final: 1}
states: {x: {initial: 0, final: 0}, v: {initial: 0, final: 0}}
controls: {u: {}}
dynamics: {x: v, v: u}
cost: {lagrange: u^2/2}
constraints:
  point: {gate: {at: 0.5, holds: x >= 1}}
"""


def test_a_gate_at_a_time() -> None:
    """Two cubics that meet at 1: on each half u = 24 (1 − 4t), J = 96; by symmetry."""
    solution = quito.solve(load_text(GATE, "gate.yaml"), polish=True)
    assert_exact(solution)
    assert solution.cost == pytest.approx(96, rel=1e-9)
    t = np.linspace(0, 0.5, 51)[:-1]
    np.testing.assert_allclose(solution.control(t)[:, 0], 24 * (1 - 4 * t), atol=1e-5)
    before, after = solution.costate([0.5 - 1e-9, 0.5 + 1e-9])[:, 0]
    assert before == pytest.approx(-after, rel=1e-6)
    assert abs(before) == pytest.approx(96, rel=1e-6)


def test_a_polish_of_other_methods_is_the_same() -> None:
    """Whatever the direct answer was made by."""
    linear = {"discretization": "hermite-simpson", "control": "piecewise-linear"}
    methods: list[dict[str, Any]] = [
        {"discretization": "lgr", "steps": 25},
        {"control": "piecewise-constant", "mesh": "uniform", "steps": 100},
        {"mesh": "uniform"} | linear,
    ]
    for options in methods:
        solution = quito.solve("bressan", polish=True, **options)
        assert solution.polished, (options, account(solution))
        assert solution.switching_times == pytest.approx([10 / 3], abs=1e-8)
        assert solution.cost == pytest.approx(-500 / 9, rel=1e-9)


def test_a_reference_knows_what_is_compared() -> None:
    """The closed forms above agree with quadrature."""
    t = np.linspace(0, 1, 200_001)
    u = 2 * (3 * t - 1)
    assert np.trapezoid(u**2, t) == pytest.approx(4, abs=1e-6)
    assert np.trapezoid(u * (1 - t), t) == pytest.approx(0, abs=1e-6)
    assert np.trapezoid(u, t) == pytest.approx(1, abs=1e-6)
    half = t / 2
    assert np.trapezoid((24 * (1 - 4 * half)) ** 2, half) == pytest.approx(96, abs=1e-4)
    x = np.cumsum(np.cumsum(24 * (1 - 4 * half))) * (half[1]) ** 2
    assert x[-1] == pytest.approx(1, abs=1e-3)
