"""What a direct answer shows of its structure, and whether an extremal is isolated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from polish_parts import phase

import quito_cli as quito
from quito_cli.optimality.hamiltonian import pontryagin
from quito_cli.optimality.looking.look import Look
from quito_cli.optimality.polish.equations.setting import Setting
from quito_cli.optimality.polish.equations.structure import Structure
from quito_cli.optimality.polish.polish import sought
from quito_cli.optimality.polish.reading.direct import Direct
from quito_cli.optimality.polish.reading.shown import shown
from quito_cli.optimality.polish.search.attempts import Ending, Log
from quito_cli.problem.build import build
from quito_cli.problem.load import load_text
from quito_cli.solution.optimal import Arc
from quito_cli.solution.polishing import PolishStatus

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


def seen(direct: Direct, reach: float | None, *, tied: bool = False) -> Structure:
    return shown(direct.setting, direct.solution, direct.impulses, reach, tied=tied)


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


@pytest.mark.parametrize(("apart", "tied", "count"), [(1, True, 2), (1, False, 3), (4, True, 3)])
def test_junctions_of_two_controls_may_be_one(apart: int, tied: bool, count: int) -> None:
    """Within a tenth of a cell, 1/600 here; else u is switched first, and w after it."""
    text = RAMP.replace("upper: 1}}", "upper: 1}, w: {lower: 0, upper: 1}}")
    direct = direct_of(text.replace("(u - 2*t + 0.5)^2/2", "(0.4 - t)*(u + w)"))
    at = {"u": 0.4, "w": 0.4 + apart / 1000}
    low = [Arc(name, "lower", 0.0, t, 0.0, 0.0) for name, t in at.items()]
    high = [Arc(name, "upper", t, 1.0, 0.0, 0.0) for name, t in at.items()]
    arcs = (low[0], high[0], low[1], high[1])
    assert direct.solution.extremal is not None
    extremal = replace(direct.solution.extremal, arcs=arcs)
    known = replace(direct, solution=replace(direct.solution, extremal=extremal))
    found = seen(known, None, tied=tied)
    between = (phase("upper", "lower"),) * (count - 2)
    assert found.phases == (phase("lower", "lower"), *between, phase("upper", "upper"))
    assert found.times == (0.0, *sorted(at.values())[: count - 1], 1.0)


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
