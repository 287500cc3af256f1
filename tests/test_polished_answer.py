"""Exact extremals as answers: right ones to the last digits, wrong ones found out.

The extremals are known by formulas or by an integrator that is not quito's (`extremals_known`).
"""

from __future__ import annotations

from dataclasses import fields, replace
from functools import cache
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray
from documents import run
from extremals import POLISHED, Extremal, polished
from extremals_known import KNOWN, bang_bang, bressan
from numpy.typing import NDArray
from test_store import equal

import quito_cli as quito
from quito_cli.optimality.certificate.certificate import certify
from quito_cli.optimality.polish.answer.exact import Atom, Exact
from quito_cli.plots.figure import figure
from quito_cli.solution.optimal import Condition, Kind
from quito_cli.solution.optimal import Extremal as Extremality
from quito_cli.solvers import Status

Array = NDArray[np.float64]


@cache
def extremal(name: str) -> tuple[Extremal, Exact, quito.Solution]:
    """A known extremal, its values, and its answer."""
    made = KNOWN[name]()
    exact = made.exact()
    return made, exact, polished(made, exact, direct(made.problem))


@cache
def _direct(text: str, name: str) -> quito.Solution:
    return quito.solve(PROBLEMS[name, text], steps=20)


PROBLEMS: dict[tuple[str, str], quito.Problem] = {}


def direct(problem: quito.Problem) -> quito.Solution:
    """An answer that is far from exact."""
    key = problem.name, problem.text + str(problem.changes)
    PROBLEMS.setdefault(key, problem)
    return _direct(key[1], key[0])


def failing(solution: quito.Solution) -> dict[str, Condition]:
    return {row.condition: row for row in solution.certificate if row.verdict == "fails"}


def worst(solution: quito.Solution) -> float:
    """The largest relative residual of a certificate."""
    return max(r.residual / r.scale for r in solution.certificate if np.isfinite(r.residual))


def last(time: float) -> float:
    """The number just before another one."""
    return float(np.nextafter(time, -np.inf))


# Right ones


@pytest.mark.parametrize("name", KNOWN)
def test_the_evidence_is_that_of_an_exact_answer(name: str) -> None:
    made, exact, solution = extremal(name)
    assert solution.success
    cost = made.model.sense * made.cost
    assert solution.cost == pytest.approx(cost, rel=1e-12)
    found = solution.evidence
    assert max(found.stationarity, found.feasibility, found.complementarity) < 5e-9
    assert found.resimulated_cost == pytest.approx(cost, rel=1e-10)
    assert max(found.resimulation_gap, found.terminal_gap) < 1e-10
    assert found.maximum_violation < 1e-11
    assert found.warnings == ()
    assert max(found.ringing) < 10
    assert len(solution.times) == len(exact.nodes)
    assert solution.polishing == POLISHED


@pytest.mark.parametrize("name", KNOWN)
def test_the_certificate_holds_sharply(name: str) -> None:
    solution = extremal(name)[2]
    applied = [row for row in solution.certificate if row.verdict != "not applicable"]
    assert {row.verdict for row in applied} == {"holds"}
    assert len(applied) >= 7
    assert worst(solution) < 1e-9
    assert solution.warnings == ()


@pytest.mark.parametrize("name", KNOWN)
def test_it_says_what_the_extremal_says_at_every_time(name: str) -> None:
    made, exact, solution = extremal(name)
    given = exact.values
    for k in range(len(exact.nodes) - 1):
        t = given.t[k].copy()
        t[0], t[-1] = exact.nodes[k], last(exact.nodes[k + 1])
        for ours, theirs in (
            (solution.state(t), given.states[k]),
            (solution.costate(t), given.costates[k]),
            (solution.control(t), given.controls[k]),
        ):
            size = max(1.0, float(np.abs(theirs).max()))
            np.testing.assert_allclose(ours, theirs, rtol=0, atol=2e-12 * size)
    for phase, start in zip(made.phases, made.times[:-1], strict=True):
        t = np.sort(np.random.default_rng(0).uniform(start, phase.end, 50))
        law = phase.control(t, solution.state(t), solution.costate(t))
        np.testing.assert_allclose(solution.control(t), law, rtol=1e-10, atol=1e-11)


@pytest.mark.parametrize("name", KNOWN)
def test_structure_and_switching_times_are_those_of_its_arcs(name: str) -> None:
    _, exact, solution = extremal(name)
    assert solution.arcs == exact.arcs
    ends = {arc.end for arc in exact.arcs if arc.end < exact.nodes[-1]}
    jumps = {0.5} if name == "point constraint" else set()
    assert set(solution.switching_times) == ends | jumps
    of_u = [arc for arc in exact.arcs if arc.of == "u"][:-1]
    assert {arc.end for arc in of_u} | jumps == {j.time for j in solution.junctions}


def test_a_control_switches_at_the_junction_to_the_last_digit() -> None:
    made, _, solution = extremal("bang-bang")
    t1 = made.phases[0].end
    assert t1 in solution.times
    assert solution.control([last(t1), t1]).ravel() == pytest.approx([-1, 1], abs=1e-12)
    (jump, _) = solution.junctions
    assert (jump.kind, jump.time, jump.blur) == ("jump", t1, 0.0)
    assert (jump.before, jump.after) == pytest.approx((-1, 1))


def test_a_kink_is_told_from_a_jump() -> None:
    solution = extremal("state constraint of order one")[2]
    assert [junction.kind for junction in solution.junctions] == ["kink", "kink"]


def test_costates_jump_and_nothing_is_smeared() -> None:
    ceiling = 1 / 9
    solution = extremal("state constraint of order two")[2]
    t1, t2 = 3 * ceiling, 1 - 3 * ceiling
    first = solution.costate([last(t1), t1, (t1 + t2) / 2, last(t2), t2, 1.0])[:, 0]
    high = 2 / (9 * ceiling**2)
    assert first == pytest.approx([high, 0, 0, 0, -high, -high], abs=1e-11)
    assert solution.costates[:, 0] == pytest.approx(solution.costate(solution.times)[:, 0])


def test_what_the_direct_solve_was_asked_for_stays_known() -> None:
    made, _, solution = extremal("bang and singular")
    before = direct(made.problem)
    assert solution.options == {**before.options, "polish": True}
    assert solution.statistics.iterations == before.statistics.iterations
    assert solution.statistics.solver == before.statistics.solver
    assert solution.statistics.solver_said == "polished"
    assert solution.statistics.solve_seconds == pytest.approx(before.statistics.solve_seconds + 0.5)
    assert solution.statistics.build_seconds > before.statistics.build_seconds


def test_segments_may_be_as_short_as_a_billionth_of_the_horizon() -> None:
    made = bang_bang()
    first, rest = made.phases[0], made.phases[1:]
    short = replace(first, end=first.end - 1e-9)
    exact = replace(made, phases=(short, first, *rest), arcs={"u": "lower lower upper lower"})
    solution = polished(made, exact.exact(), direct(made.problem))
    assert solution.success
    assert failing(solution) == {}
    t = first.end
    assert solution.switching_times == extremal("bang-bang")[2].switching_times
    assert solution.control([t - 5e-10, last(t), t]).ravel() == pytest.approx([-1, -1, 1])


# The result file


@pytest.mark.parametrize("name", KNOWN)
def test_a_file_gives_back_all_of_it(name: str, tmp_path: Path) -> None:
    made, _, solution = extremal(name)
    solution.save(tmp_path / "a.h5")
    loaded = quito.Solution.load(tmp_path / "a.h5")
    for one in fields(quito.Solution):
        assert equal(getattr(solution, one.name), getattr(loaded, one.name)), one.name
    assert equal(certify(made.model, loaded), solution.extremal)


@pytest.mark.parametrize("name", ["touch", "bang-bang"])
def test_multipliers_by_time_are_labelled(name: str, tmp_path: Path) -> None:
    solution = extremal(name)[2]
    solution.save(tmp_path / "a.h5")
    with xarray.open_dataset(tmp_path / "a.h5", group="densities", engine="h5netcdf") as data:
        assert data["density"].dims == ("time", "row")
        assert data["density_before"].dims == ("cell", "row")
        assert data["row"].values.tolist() == (["x1"] if name == "touch" else [])
        assert data["size"].dims == ("impulse",)
        assert len(data["size"]) == (name == "touch")
    with xarray.open_dataset(tmp_path / "a.h5", group="interpolation", engine="h5netcdf") as data:
        assert data["costate_before"].dims == ("cell", "state_name")


@pytest.mark.parametrize(("what", "value"), [("node", 99), ("of_row", 1), ("node", -1)])
def test_an_impulse_where_nothing_is_is_refused(what: str, value: int, tmp_path: Path) -> None:
    extremal("touch")[2].save(tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        file["densities"][what][0] = value
    with pytest.raises(quito.ResultFileError, match="impulse"):
        quito.Solution.load(tmp_path / "a.h5")


@pytest.mark.parametrize("options", [[], ["--certificate"], ["--json"]])
def test_it_is_shown(
    options: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    extremal("state constraint of order two")[2].save(tmp_path / "a.h5")
    assert run(["show", str(tmp_path / "a.h5"), *options], monkeypatch) == 0
    shown = capsys.readouterr()
    assert "0.333333" in shown.out or "costate equation" in shown.out
    assert shown.err == ""


@pytest.mark.parametrize("name", ["state constraint of order two", "bang-bang"])
def test_it_is_drawn(name: str) -> None:
    solution = extremal(name)[2]
    assert figure(solution, ("states", "controls", "costates", "switching", "mesh")).axes


# Wrong ones


def found_out(made: Extremal, exact: Exact) -> set[str]:
    """What the certificate of an extremal that is none says, whatever the residuals do."""
    solution = polished(made, exact, direct(made.problem))
    assert not solution.success or failing(solution)
    claimed = Extremality(exact.arcs, (), np.zeros(0), {})
    solved = replace(solution, status=Status.SOLVED, extremal=claimed)
    rows = certify(made.model, solved).certificate
    return {row.condition for row in rows if row.verdict == "fails"}


SIGN = "sign of dH/du on arcs of u at its bounds"
KEPT = "controls and constraints are what their arcs say"


@pytest.mark.parametrize("late", [1e-4, -1e-4, 3e-6])
def test_a_singular_arc_that_begins_at_the_wrong_time(late: float) -> None:
    made = bressan(late)
    assert "dH/du = 0 on singular arcs of u" in found_out(made, made.exact())


@pytest.mark.parametrize("late", [1e-4, -1e-4])
def test_a_switch_at_the_wrong_time(late: float) -> None:
    """The control, and the states that follow it, switch late; the costate is what it was."""
    made = bang_bang()
    first, *rest = made.phases
    shifted = replace(made, phases=(replace(first, end=first.end + late), *rest))
    failed = found_out(shifted, shifted.exact())
    assert {SIGN, "feasibility"} <= failed


@pytest.mark.parametrize("late", [1e-4, -1e-4])
def test_a_switch_at_the_wrong_time_of_an_affine_control(late: float) -> None:
    made = KNOWN["free horizon"]()
    first, last = made.phases
    shifted = replace(made, phases=(replace(first, end=first.end + late), last))
    assert "dH/du = 0 where u switches" in found_out(shifted, shifted.exact())


def test_an_arc_at_the_wrong_bound() -> None:
    made = bang_bang()
    first, second, third = made.phases
    turned = replace(
        made,
        phases=(replace(first, control=second.control), second, third),
        arcs={"u": "upper upper lower"},
    )
    assert SIGN in found_out(turned, turned.exact())


def test_arcs_that_are_not_those_of_the_control() -> None:
    made = bang_bang()
    claimed = replace(made, arcs={"u": "upper lower upper"})
    assert found_out(made, claimed.exact()) == {KEPT}


def test_arcs_that_leave_something_out() -> None:
    """A constraint that presses is not inactive, nor a control at its bound between them."""
    claims: dict[str, Kind] = {
        "state constraint of order one": "inactive",
        "bang-bang": "interior",
    }
    for name, kind in claims.items():
        made, exact, _ = extremal(name)
        arcs = tuple(
            replace(arc, kind=kind) if arc.kind in ("active", "upper") else arc
            for arc in exact.arcs
        )
        assert found_out(made, replace(exact, arcs=arcs)) == {KEPT}


def test_arcs_that_end_between_nodes() -> None:
    """By so little that no control that is looked at is elsewhere than its arc says."""
    made, exact, _ = extremal("bang-bang and singular")
    first, second, third = exact.arcs
    off = first.end + 1e-5
    moved = (replace(first, end=off), replace(second, start=off), third)
    assert found_out(made, replace(exact, arcs=moved)) == {KEPT}


def test_an_arc_that_is_missing() -> None:
    made = bang_bang()
    first, second, _ = made.phases
    fewer = replace(made, phases=(first, replace(second, end=1.0)), arcs={"u": "lower upper"})
    assert SIGN in found_out(fewer, fewer.exact())


@pytest.mark.parametrize("name", KNOWN)
@pytest.mark.parametrize("factor", [1.001, 1.00001])
def test_costates_of_the_wrong_size(name: str, factor: float) -> None:
    made, exact, _ = extremal(name)
    values = replace(exact.values, costates=factor * exact.values.costates)
    assert found_out(made, replace(exact, values=values))


def test_a_costate_that_jumps_where_nothing_presses() -> None:
    made, exact, _ = extremal("state constraint of order two")
    assert "costate equation" in found_out(made, replace(exact, atoms=exact.atoms[:1]))


def test_impulses_of_the_wrong_sign() -> None:
    """At another ceiling the cubic would have to be pulled down to touch it."""
    made, exact, _ = extremal("touch")
    failed = found_out(made, replace(exact, atoms=(Atom(2, 0, -exact.atoms[0].size),)))
    assert {"costate equation", "multipliers of bounds on states: sign"} <= failed


@pytest.mark.parametrize("which", ["end", "start"])
def test_impulses_of_the_wrong_size_at_the_ends(which: str) -> None:
    made, exact, _ = extremal(f"impulse at the {which}")
    (one,) = exact.atoms
    failed = found_out(made, replace(exact, atoms=(replace(one, size=1.0001 * one.size),)))
    assert failed == {f"transversality: {'final' if which == 'end' else 'initial'}"}


def test_densities_of_the_wrong_sign_or_size() -> None:
    made, exact, _ = extremal("state constraint of order one")
    for factor, expected in (
        (-1.0, {"costate equation", "multipliers of bounds on states: sign"}),
        (1.0001, {"costate equation"}),
    ):
        values = replace(exact.values, mu=factor * exact.values.mu)
        assert expected <= found_out(made, replace(exact, values=values))


def test_a_multiplier_of_a_mixed_constraint_of_the_wrong_size() -> None:
    made, exact, _ = extremal("mixed constraint")
    values = replace(exact.values, mu=1.0001 * exact.values.mu)
    failed = found_out(made, replace(exact, values=values))
    assert {"dH/du = 0 on interior arcs of u", "dH/dt = partial H / partial t"} <= failed


@pytest.mark.parametrize(
    ("name", "field", "expected"),
    [
        ("boundary constraint", "boundary", "transversality: final"),
        ("integral constraint", "integral", "dH/du = 0 on interior arcs of u"),
        ("parameter", "parameters", "transversality: parameter"),
    ],
)
def test_other_unknowns_of_the_wrong_size(name: str, field: str, expected: str) -> None:
    made, exact, _ = extremal(name)
    changed = replace(exact, **{field: 1.0001 * getattr(exact, field)})
    assert expected in found_out(made, changed)


def test_a_multiplier_of_a_point_that_does_not_fit_the_jump() -> None:
    made, exact, _ = extremal("point constraint")
    changed = replace(exact, points=(1.0001 * exact.points[0],))
    assert "costate equation" in found_out(made, changed)
