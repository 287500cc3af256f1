"""Structures: what a fault makes of one, and what a direct answer shows."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from polish_parts import phase, setting_of

import quito_cli as quito
from quito_cli.optimality.hamiltonian import pontryagin
from quito_cli.optimality.look import Look
from quito_cli.optimality.polish.direct import Direct
from quito_cli.optimality.polish.fault import Fault
from quito_cli.optimality.polish.polish import sought
from quito_cli.optimality.polish.revise import dropped, revised
from quito_cli.optimality.polish.search import Ending, Log
from quito_cli.optimality.polish.setting import Setting
from quito_cli.optimality.polish.shown import shown
from quito_cli.optimality.polish.structure import Phase, Structure
from quito_cli.problem.build import build
from quito_cli.problem.load import load_text
from quito_cli.solution.optimal import Arc
from quito_cli.solution.polishing import Action, PolishStatus

Array = NDArray[np.float64]

MANY = """\
title: Controls and rows of every kind
time: {initial: 0, final: 1}
states: {x: {upper: 1}, v: {upper: 1}, y: {}}
controls: {u: {lower: -1, upper: 1}, r: {lower: -1, upper: 1}, w: {lower: 0}}
dynamics: {x: v, v: u + r, y: w + u*y}
cost: {lagrange: r^2 + y^2}
constraints:
  path: {cap: u + x <= 1}
"""
CAP, X, V = (0, True), (1, True), (2, True)
"""A mixed row, one of order two, one of order one."""


@cache
def many() -> Setting:
    return setting_of(MANY)


def one(given: Phase) -> Structure:
    return Structure((given,), (0.0, 1.0))


def fault(what: str, start: float, end: float, **more: object) -> Fault:
    made = Fault("sign", start, end, 0.5, "It is so", 0)
    return replace(made, what=what, **more)  # type: ignore[arg-type]


PLAIN = phase("upper", "free", "lower")
HIGH = phase("upper", "upper", "lower")
ARC = phase("upper", "free", "lower", held=[X])
CAPPED = phase("free", "free", "lower", held=[CAP])


@dataclass(frozen=True)
class Case:
    """A structure with a fault, and what it is to become."""

    given: Structure
    fault: Fault
    phases: tuple[Phase, ...]
    times: tuple[float, ...]
    action: Action
    touches: tuple[tuple[int, tuple[int, bool]], ...] = ()


LOW = phase("lower", "free", "lower")
IN_THREE = (0.0, 0.2, 0.5, 1.0)
RESTS = Structure((PLAIN,) * 3, (0.0, 0.4, 0.6, 1.0), ((1, X), (2, X)))
REVISIONS = {
    "a wrong sign of an affine control": Case(
        one(PLAIN), fault("sign", 0.2, 0.5, control=0, upper=True), (PLAIN, LOW, PLAIN), IN_THREE,
        "insert",
    ),
    "a wrong sign from the start": Case(
        one(PLAIN), fault("sign", 1e-8, 0.5, control=0, upper=True), (LOW, PLAIN), (0, 0.5, 1),
        "insert",
    ),
    "a wrong sign where there is no other bound": Case(
        one(PLAIN), fault("sign", 0.2, 0.5, control=2),
        (PLAIN, phase("upper", "free", "singular"), PLAIN), IN_THREE, "insert",
    ),
    "a wrong sign of a regular control": Case(
        one(HIGH), fault("sign", 0.2, 0.5, control=1, upper=True), (HIGH, PLAIN, HIGH), IN_THREE,
        "insert",
    ),
    "a control beyond its bound": Case(
        one(PLAIN), fault("beyond", 0.2, 0.5, control=1, upper=True), (PLAIN, HIGH, PLAIN),
        IN_THREE, "insert",
    ),
    "a mixed row violated": Case(
        one(PLAIN), fault("violated", 0.2, 0.5, held=CAP), (PLAIN, CAPPED, PLAIN), IN_THREE,
        "insert",
    ),
    "a state row of order one violated": Case(
        one(PLAIN), fault("violated", 0.2, 0.5, held=V),
        (PLAIN, phase("upper", "free", "lower", held=[V]), PLAIN), IN_THREE, "insert",
    ),
    "a state row of order two violated": Case(
        one(PLAIN), fault("violated", 0.2, 0.5, held=X), (PLAIN, PLAIN), (0, 0.35, 1), "insert",
        ((1, X),),
    ),
    "rest between touches": Case(
        RESTS, fault("violated", 0.4, 0.6, phase=1, held=X), (PLAIN, ARC, PLAIN),
        (0, 0.4, 0.6, 1), "insert",
    ),
    "a pull of a mixed row in the middle": Case(
        one(CAPPED), fault("pull", 0.2, 0.5, held=CAP), (CAPPED, LOW, CAPPED), IN_THREE, "release",
    ),
    "a pull of a state row of order one": Case(
        Structure((PLAIN, phase("upper", "free", "lower", held=[V]), PLAIN), (0, 0.3, 0.7, 1)),
        fault("pull", 0.4, 0.5, phase=1, held=V), (PLAIN,), (0, 1), "release",
    ),
    "a pull of a state row of order two": Case(
        Structure((PLAIN, ARC, PLAIN), (0, 0.3, 0.7, 1)),
        fault("pull", 0.3, 0.3, phase=1, held=X), (PLAIN, PLAIN), (0, 0.5, 1), "release",
        ((1, X),),
    ),
    "an arc of a control that vanished": Case(
        Structure((PLAIN, LOW, HIGH), (0, 0.5, 0.5, 1)), fault("vanished", 0, 0, phase=1),
        (PLAIN, HIGH), (0, 0.5, 1), "drop",
    ),
    "an arc between equal ones that vanished": Case(
        Structure((PLAIN, LOW, PLAIN), (0, 0.5, 0.5, 1)), fault("vanished", 0, 0, phase=1),
        (PLAIN,), (0, 1), "drop",
    ),
    "a first arc that vanished": Case(
        Structure((LOW, PLAIN), (0, -0.1, 1)), fault("vanished", 0, 0), (PLAIN,), (0, 1), "drop",
    ),
    "a last arc that vanished": Case(
        Structure((LOW, PLAIN), (0, 1.1, 1)), fault("vanished", 0, 0, phase=1), (LOW,), (0, 1),
        "drop",
    ),
    "an arc of order two that vanished": Case(
        Structure((PLAIN, ARC, PLAIN), (0, 0.5, 0.5, 1)), fault("vanished", 0, 0, phase=1),
        (PLAIN, PLAIN), (0, 0.5, 1), "drop", ((1, X),),
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", REVISIONS.values(), ids=REVISIONS)
def test_a_fault_leads_to_the_structure_that_it_asks_for(case: Case) -> None:
    found = revised(many(), case.given, case.fault)
    assert found is not None
    assert found.structure.phases == case.phases
    assert found.structure.times == pytest.approx(case.times)
    assert found.structure.touches == case.touches
    assert found.action == case.action
    assert found.sentence


NOTHING = {
    "of second order": (one(PLAIN), fault("curvature", 0.2, 0.5)),
    "at an end": (one(PLAIN), fault("end", 0, 0)),
    "what the phase does already": (one(HIGH), fault("beyond", 0, 1, control=1, upper=True)),
    "a junction moved": (
        Structure((LOW, PLAIN), (0, 0.4, 1)),
        fault("sign", 0.4, 0.5, phase=1, control=0, upper=True),
    ),
}


@pytest.mark.parametrize(("given", "wrong"), NOTHING.values(), ids=NOTHING)
def test_where_nothing_helps_there_is_no_other_structure(given: Structure, wrong: Fault) -> None:
    assert revised(many(), given, wrong) is None


def test_junctions_of_two_controls_met_in_the_wrong_order_are_put_right() -> None:
    first, second = phase("upper", "lower", "lower"), phase("upper", "upper", "lower")
    start = phase("lower", "lower", "lower")
    crossed = Structure((start, first, second), (0, 0.6, 0.5, 1))
    found = dropped(crossed, 1)
    assert found.phases == (start, phase("lower", "upper", "lower"), second)
    assert found.times == (0, 0.5, 0.6, 1)
    assert dropped(found.at((0, 0.6, 0.5, 1)), 1).phases == crossed.phases


def test_a_row_and_a_control_met_in_the_wrong_order_are_put_right() -> None:
    crossed = Structure((PLAIN, ARC, replace(ARC, kinds=LOW.kinds)), (0, 0.6, 0.5, 1))
    found = dropped(crossed, 1)
    assert found.phases == (PLAIN, LOW, crossed.phases[2])
    assert found.times == (0, 0.5, 0.6, 1)


def test_what_vanishes_beside_a_touch_leaves_the_touch_where_it_is() -> None:
    given = Structure((LOW, PLAIN, HIGH), (0, 0.4, 0.5, 1), ((2, X),))
    found = dropped(given, 1)
    assert found == Structure((LOW, HIGH), (0, 0.5, 1), ((1, X),))
    given = replace(given, touches=((1, X),))
    assert dropped(given, 1) == Structure((LOW, HIGH), (0, 0.4, 1), ((1, X),))


# What an answer shows

RAMP = """\
title: A control that follows a ramp between its bounds
time: {initial: 0, final: 1}
states: {x: {initial: 0}}
controls: {u: {lower: 0, upper: 1}}
dynamics: {x: u}
cost: {lagrange: (u - 2*t + 0.5)^2/2}
"""
FILLED = """\
title: As much as a row lets in
time: {initial: 0, final: 1}
states: {x: {initial: 0}}
controls: {u: {lower: 0, upper: 1}}
dynamics: {x: u}
cost: {mayer: -final(x)}
constraints: {path: {cap: u + x <= 1.5}}
"""


def direct_of(text: str, steps: int = 60) -> Direct:
    given = load_text(text, "test.yaml")
    solution = quito.solve(given, steps=steps)
    setting = Setting(pontryagin(build(given)))
    return Direct(setting, solution, Look.at(setting.system, solution))


def seen(direct: Direct, reach: float | None) -> Structure:
    return shown(direct.setting, direct.solution, direct.impulses, reach, tied=False)


@pytest.fixture(scope="module")
def ramp() -> Direct:
    return direct_of(RAMP)


@pytest.fixture(scope="module")
def filled() -> Direct:
    return direct_of(FILLED)


@pytest.mark.parametrize("reach", [None, 0.05, 0.2])
def test_a_ramp_is_read_by_its_nearness_to_bounds(reach: float | None, ramp: Direct) -> None:
    """u = 2 t − 1/2 is within a part r of its range of zero until (1/2 + r)/2."""
    found = seen(ramp, reach)
    assert found.phases == (phase("lower"), phase("free"), phase("upper"))
    off = (0.5 + (reach or 0.0)) / 2
    assert found.times[1:-1] == pytest.approx((off, 1 - off), abs=1 / 60)


@pytest.mark.parametrize("reach", [None, 0.05, 0.2])
def test_a_jump_between_bounds_is_no_arc(reach: float | None) -> None:
    text = RAMP.replace("(u - 2*t + 0.5)^2/2", "(0.4 - t)*u")
    found = seen(direct_of(text), reach)
    assert found.phases == (phase("lower"), phase("upper"))
    assert found.times[1] == pytest.approx(0.4, abs=1 / 60)


@pytest.mark.parametrize("reach", [None, 0.05, 0.2])
def test_the_arc_of_a_row_begins_where_its_control_leaves_the_bound(
    reach: float | None, filled: Direct
) -> None:
    """u = 1 to t = 1/2, then 1.5 − x, or e^(1/2 − t): one junction of both, not one of each."""
    found = seen(filled, reach)
    assert found.phases == (phase("upper"), phase("free", held=[(0, True)]))
    assert found.times[1] == pytest.approx(0.5 - np.log(1 - (reach or 0.0)), abs=1 / 60)


@pytest.mark.parametrize(("late", "doubt"), [(0.015, 0.0), (-0.015, 0.0), (0.05, 0.06)])
def test_an_arc_of_a_row_that_begins_near_by_is_put_there(
    late: float, doubt: float, filled: Direct
) -> None:
    """Within a fiftieth of the horizon, or within its own doubt."""
    found = seen(replace(filled, solution=with_arcs(filled, 0.5, 0.5 + late, doubt)), None)
    assert found == Structure((phase("upper"), phase("free", held=[(0, True)])), (0.0, 0.5, 1.0))


def test_an_arc_of_a_row_that_begins_elsewhere_stays_there(filled: Direct) -> None:
    """Between the bound and the row u is affine with nothing to hold it."""
    found = seen(replace(filled, solution=with_arcs(filled, 0.5, 0.6, 0.0)), None)
    between, held = phase("singular"), phase("free", held=[(0, True)])
    assert found == Structure((phase("upper"), between, held), (0.0, 0.5, 0.6, 1.0))


def with_arcs(direct: Direct, own: float, row: float, doubt: float) -> quito.Solution:
    """The answer with arcs of u until one time and of its row from another, in doubt by so much."""
    (u,), (cap,) = direct.setting.system.model.controls, direct.setting.system.rows
    made = (
        Arc(u.name, "upper", 0.0, own, 0.0, 0.0),
        Arc(u.name, "singular", own, 1.0, 0.0, 0.0),
        Arc(cap.label, "inactive", 0.0, row, 0.0, doubt),
        Arc(cap.label, "active", row, 1.0, doubt, 0.0),
    )
    assert direct.solution.extremal is not None
    return replace(direct.solution, extremal=replace(direct.solution.extremal, arcs=made))


@pytest.mark.parametrize("ceiling", [0.18, 0.2, 0.22])
def test_a_touch_is_seen_at_its_centre(ceiling: float) -> None:
    """For 1/6 < l < 1/4 there is no arc (Bryson and Ho 1975, section 3.11)."""
    given = quito.load("bryson_denham").text.split("reference:")[0]
    found = seen(direct_of(given.replace("l: 1/9", f"l: {ceiling}")), None)
    assert found.phases == (phase("free"), phase("free"))
    assert found.touches == ((1, (0, True)),)
    assert found.times[1] == pytest.approx(0.5, abs=1 / 60)


# Focal points

ALY_CHAN = quito.load("alychan").text.split("reference:")[0]


def ended(text: str) -> Ending:
    given = load_text(text, "test.yaml")
    return sought(build(given), quito.solve(given, steps=60), Log())


def test_at_its_focal_point_aly_and_chans_problem_is_degenerate() -> None:
    found = ended(ALY_CHAN)
    assert found.status is PolishStatus.DEGENERATE
    assert found.extremal is None
    assert "focal point" in found.reason


def test_before_its_focal_point_it_is_not() -> None:
    """Where x₁ ends at sin 1.2, u = −sin t: λ₁ is free there, and the second variation positive."""
    text = ALY_CHAN.replace("final: pi/2", "final: 1.2").replace(
        "x1: {initial: 0}", "x1: {initial: 0, final: sin(1.2)}"
    )
    found = ended(text)
    assert found.status is PolishStatus.POLISHED, found.reason
    assert found.extremal is not None
    assert found.extremal.system.structure.phases == (phase("singular"),)
    (piece,) = found.extremal.sampled(np.linspace(0, 1, 9))
    assert piece.u[..., 0] == pytest.approx(-np.sin(piece.t), abs=1e-10)


def test_with_a_free_end_before_its_focal_point_a_bound_comes_first() -> None:
    """On the singular surface λ₁ = −x₂, and it is zero at the end: x₁ = c cos(1.2 − t).

    From x = (0, 1) a bound leads there: u = −1 until (1 − τ) = (τ − τ²/2) tan(1.2 − τ).
    """
    found = ended(ALY_CHAN.replace("final: pi/2", "final: 1.2"))
    assert found.status is PolishStatus.POLISHED, found.reason
    assert found.extremal is not None
    assert found.extremal.system.structure.phases == (phase("lower"), phase("singular"))
    tau = float(found.extremal.times[1])
    assert 1 - tau == pytest.approx((tau - tau**2 / 2) * np.tan(1.2 - tau), abs=1e-10)
    late = found.extremal.sampled(np.linspace(0, 1, 9))[1]
    expected = -(tau - tau**2 / 2) * np.cos(1.2 - late.t) / np.cos(1.2 - tau)
    assert late.u[..., 0] == pytest.approx(expected, abs=1e-10)
