"""`quito solve --mesh adaptive`: what is printed, kept and said where it breaks off."""

from __future__ import annotations

import json
import os
import re
import signal
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import quito_cli as quito
from quito_cli import solvers
from quito_cli.plots.figure import figure
from quito_cli.problem.load import load_text
from quito_cli.solution.rounds import Account
from quito_cli.solvers.interruption import interruptible
from quito_cli.solvers.outcome import Status

FIRST, SECOND = 0.19496562441559956, 0.5168613161702115
"""Where the control of `bang_bang` jumps, as its file knows."""
QUICK = ("solve", "bang_bang", "--mesh", "adaptive", "-N", "40")
SMOOTH = """
title: Push to one
time: {initial: 0, final: 1}
states: {x: {initial: 0, final: 1}}
controls: {u: {lower: -3, upper: 3}, v: {lower: -1, upper: 1}}
dynamics: {x: u}
cost: {lagrange: u^2 + v^2}
options: {mesh: adaptive, mesh_steps: 20}
"""
BANG = """
time: {initial: 0, final: 1}
states: {x: {initial: 0}}
controls: {u: {lower: -1, upper: 1}}
dynamics: {x: u}
cost: {lagrange: x*cos(20*pi*t)}
"""
"""The costate of x is −sin(20πt)/20π: u jumps at every twentieth."""


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


Quito = Callable[..., tuple[int, str, str]]


def row(printed: str, label: str) -> list[str]:
    """The lines of a labelled row of the summary."""
    found = re.search(rf"^  {re.escape(label)} +(.*\n(?:   {{15,}}.*\n)*)", printed, re.MULTILINE)
    assert found, label
    return [line.strip() for line in found[1].splitlines()]


# What is printed


def test_adaptive_needs_no_other_option(quito_: Quito, here: Path) -> None:
    code, out, err = quito_("solve", "bang_bang", "--mesh", "adaptive")
    assert (code, err) == (0, "")
    jumps = [
        re.fullmatch(r"(\S+) ± (\S+)  u jumps (\S+) → (\S+)", line)
        for line in row(out, "switching times")
    ]
    for jump, known, sides in zip(jumps, (FIRST, SECOND), (("-1", "1"), ("1", "-1")), strict=True):
        assert jump
        assert jump.group(3, 4) == sides
        assert float(jump[1]) == pytest.approx(known, abs=2 * float(jump[2]))
        assert float(jump[2]) < 1e-3
    solution = quito.Solution.load(here / "results" / "bang_bang.h5")
    how = solution.refinement
    assert how is not None
    assert how.account is not None
    first, *sentence = row(out, "mesh")
    told = re.fullmatch(
        r"adaptive: (\d+) meshes(?:, number \d+ kept)?, (\d+) to (\d+) cells, "
        r"shortest (\S+) of the horizon",
        first,
    )
    assert told
    cells = [len(one.nodes) - 1 for one in how.rounds]
    assert [int(told[i]) for i in (1, 2, 3)] == [len(cells), min(cells), max(cells)]
    assert float(told[4]) == pytest.approx(np.diff(solution.times).min(), rel=0.1)
    assert " ".join(sentence) == how.outcome
    error = row(out, "error of u")
    about = re.match(
        r"about (\S+) of its range outside jumps \((\S+) % of the horizon\)$", error[0]
    )
    assert about
    assert float(about[1]) == pytest.approx(how.account.control, rel=0.5)
    width = sum(end - start for start, end in how.account.left_out)
    assert float(about[2]) == pytest.approx(100 * width, rel=0.1)
    assert error[1].startswith("an estimate: other mesh ")
    for word in ("twice the substeps", "at bounds", "saturation", "approximation", "integration"):
        assert word in " ".join(error)
    assert re.search(r"states \S+ the jumps themselves: \S+ in L²$", " ".join(error))
    assert f"{len(solution.times) - 1} cells of 2 rk4 steps" in out


def test_what_is_printed_of_the_error_is_about_what_it_is(quito_: Quito, here: Path) -> None:
    """Within its jump zones û may be anything; outside it is at one bound or the other."""
    quito_(*QUICK, "--no-plot", "-q")
    solution = quito.Solution.load(here / "results" / "bang_bang.h5")
    assert solution.refinement is not None
    account = solution.refinement.account
    assert account is not None
    t = np.linspace(0, 1, 5001)
    for start, end in account.left_out:
        t = t[(t < start) | (t > end)]
    assert len(t) > 4000
    truth = np.where((t > FIRST) & (t < SECOND), 1.0, -1.0)
    error = np.abs(solution.control(t)[:, 0] - truth).max() / 2
    assert error <= 3 * max(account.control, account.approximation)


def test_a_file_may_ask_for_it_and_a_smooth_control_has_no_jumps(quito_: Quito, here: Path) -> None:
    (here / "push.yaml").write_text(SMOOTH, encoding="utf-8")
    code, out, _ = quito_("solve", "push.yaml", "--no-plot")
    assert code == 0
    assert "switching times" not in out
    assert row(out, "mesh")[0] == "adaptive: 1 mesh, 20 cells, shortest 5.0e-02 of the horizon"
    error = row(out, "error of controls")
    assert re.match(r"about \S+ of their range at all times$", error[0])
    assert "L²" not in " ".join(error)
    code, out, _ = quito_("solve", "push.yaml", "--no-plot", "--mesh", "uniform")
    assert code == 0
    assert "adaptive" not in out
    assert "error of" not in out


def test_a_uniform_mesh_has_its_junctions_too(quito_: Quito) -> None:
    code, out, _ = quito_("solve", "bang_bang", "-N", "100", "--no-plot")
    assert code == 0
    times = [line.split()[0] for line in row(out, "switching times")]
    assert [float(t) for t in times] == pytest.approx([FIRST, SECOND], abs=0.01)
    assert not re.search("^  mesh ", out, re.MULTILINE)


def test_many_junctions_are_cut_with_a_count(quito_: Quito, here: Path) -> None:
    (here / "bang.yaml").write_text(BANG, encoding="utf-8")
    code, out, _ = quito_("solve", "bang.yaml", "-N", "300", "--no-plot")
    assert code == 0
    lines = row(out, "switching times")
    found = quito.Solution.load(here / "results" / "bang.h5").junctions
    assert [one.time for one in found] == pytest.approx(np.arange(1, 20) / 20, abs=3e-3)
    assert len(lines) == 9
    assert lines[-1] == "and 11 more"


def test_verbose_has_a_table_of_the_meshes_and_show_too(quito_: Quito, here: Path) -> None:
    code, out, _ = quito_(*QUICK, "--no-plot", "--verbose")
    assert code == 0
    how = quito.Solution.load(here / "results" / "bang_bang.h5").refinement
    assert how is not None
    head = re.search(r"^  mesh +cells +substeps .*\n((?:  \d+ .*\n)+)", out, re.MULTILINE)
    assert head
    lines = head[1].splitlines()
    assert len(lines) == len(how.rounds)
    for i, (line, one) in enumerate(zip(lines, how.rounds, strict=True)):
        words = line.replace(" *", "").split()
        assert words[:2] == [str(i + 1), str(len(one.nodes) - 1)]
        assert (" * " in line) == (i == how.kept)
    assert " - " in lines[0], "the first has no change"
    code, shown, _ = quito_("show", "results/bang_bang.h5")
    assert code == 0
    assert out.startswith(shown.rstrip())


def test_json_has_all_of_it(quito_: Quito, here: Path) -> None:
    code, out, _ = quito_(*QUICK, "--no-plot", "--json")
    assert code == 0
    found = json.loads(out)
    assert found["switching_times"] == pytest.approx([FIRST, SECOND], abs=1e-2)
    first = found["junctions"][0]
    assert first.keys() == {*("control", "kind", "time", "uncertainty", "before", "after", "blur")}
    assert (first["control"], first["kind"]) == ("u", "jump")
    how = found["refinement"]
    assert how.keys() == {"rounds", "kept", "outcome", "account"}
    assert how["rounds"][0]["cells"] == 40
    assert how["rounds"][0]["change"] is None
    assert how["rounds"][how["kept"]]["cells"] == found["steps"]
    assert how["account"].keys() == {field.name for field in fields(Account)} | {
        *("control", "time_left_out")
    }
    assert found["options"]["mesh_steps"] == 40
    code, shown, _ = quito_("show", "results/bang_bang.h5", "--json")
    assert json.loads(shown) == found
    code, out, _ = quito_("solve", "bang_bang", "-N", "20", "--no-plot", "--json")
    assert json.loads(out)["refinement"] is None


# What breaks off


def breaking(
    monkeypatch: pytest.MonkeyPatch, at: int, status: Status | type[KeyboardInterrupt]
) -> None:
    """Let one of the solves end otherwise, its point where it started."""
    minimise, calls = solvers.minimise, 0

    def counted(nlp: Any, *rest: Any) -> Any:
        nonlocal calls
        calls += 1
        if calls == at and not isinstance(status, Status):
            raise status
        outcome, residuals = minimise(nlp, *rest)
        if calls != at or not isinstance(status, Status):
            return outcome, residuals
        largest = replace(residuals, feasibility=1.0)
        return replace(outcome, status=status, w=nlp.guess, said="broken"), largest

    monkeypatch.setattr(solvers, "minimise", counted)


def test_a_solve_that_fails_half_way_leaves_the_best_before(
    quito_: Quito, here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    breaking(monkeypatch, 3, Status.STUCK)
    code, out, err = quito_(*QUICK, "--no-plot")
    assert (code, err) == (0, "")
    assert "\nSolved." in out
    said = r"The solve on mesh 3, of \d+ cells, ended: The solver could not make further progress\."
    assert re.fullmatch(said, " ".join(row(out, "mesh")[1:]))
    assert re.search(rf"^Warning: the mesh was not refined to the end: t{said[1:]}$", out, re.M)
    assert row(out, "error of u") == ["not estimated: refinement did not get so far"]
    solution = quito.Solution.load(here / "results" / "bang_bang.h5")
    assert solution.success
    assert solution.refinement is not None
    assert len(solution.refinement.rounds) == 2
    assert solution.refinement.account is None
    kept = solution.refinement.rounds[solution.refinement.kept]
    np.testing.assert_array_equal(kept.nodes, solution.times)
    assert quito_("show", "results/bang_bang.h5")[0] == 0
    assert quito_("plot", "results/bang_bang.h5", "--mesh")[0] == 0


@pytest.mark.parametrize("how", [Status.INTERRUPTED, KeyboardInterrupt])
def test_an_interruption_half_way_keeps_the_best_before(
    how: Any, quito_: Quito, here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    breaking(monkeypatch, 3, how)
    code, out, err = quito_(*QUICK)
    assert (code, err) == (130, "")
    assert "Not solved. Interrupted" in out
    assert re.search(r"^Warning: the mesh was not refined to the end: .*mesh 3", out, re.M)
    assert out.endswith("Saved results/bang_bang.h5 and results/bang_bang.png\n")
    solution = quito.Solution.load(here / "results" / "bang_bang.h5")
    assert solution.status is Status.INTERRUPTED
    assert solution.refinement is not None
    assert len(solution.refinement.rounds) == 2
    assert solution.cost == pytest.approx(-0.18305968077629106, abs=1e-3)


def test_ctrl_c_between_two_solves_stops_before_the_next(
    quito_: Quito, here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The second solve is over, and is kept."""
    minimise, calls = solvers.minimise, 0

    def pressed(*given: Any) -> Any:
        nonlocal calls
        found, calls = minimise(*given), calls + 1
        if calls == 2:
            os.kill(os.getpid(), signal.SIGINT)
        return found

    monkeypatch.setattr(solvers, "minimise", pressed)
    code, out, _ = quito_(*QUICK, "--no-plot")
    assert (code, calls) == (130, 2)
    assert "Warning: the mesh was not refined to the end" in out
    how = quito.Solution.load(here / "results" / "bang_bang.h5").refinement
    assert how is not None
    assert len(how.rounds) == 2


def test_a_check_that_was_not_begun_is_not_counted(
    quito_: Quito, here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (here / "push.yaml").write_text(SMOOTH, encoding="utf-8")
    minimise = solvers.minimise

    def pressed(*given: Any) -> Any:
        found = minimise(*given)
        os.kill(os.getpid(), signal.SIGINT)
        return found

    monkeypatch.setattr(solvers, "minimise", pressed)
    assert quito_("solve", "push.yaml", "--no-plot")[0] == 130
    solution = quito.Solution.load(here / "results" / "push.h5")
    assert solution.refinement is not None
    (only,) = solution.refinement.rounds
    assert solution.statistics.iterations == only.iterations


def test_a_solve_that_failed_is_counted(
    quito_: Quito, here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    breaking(monkeypatch, 2, Status.STUCK)
    assert quito_(*QUICK, "--no-plot")[0] == 0
    solution = quito.Solution.load(here / "results" / "bang_bang.h5")
    assert solution.refinement is not None
    (only,) = solution.refinement.rounds
    assert solution.statistics.iterations is not None
    assert solution.statistics.iterations > only.iterations


def test_blocks_within_one_another_share_a_request() -> None:
    with interruptible() as outer:
        with interruptible() as inner:
            assert inner is outer
            os.kill(os.getpid(), signal.SIGINT)
        assert outer.requested
        with interruptible() as later:
            assert later.requested
    with interruptible() as another:
        assert not another.requested


def test_a_first_solve_that_fails_is_told_as_such(
    quito_: Quito, here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    breaking(monkeypatch, 1, Status.STUCK)
    code, out, _ = quito_(*QUICK, "--no-plot")
    assert code == 1
    assert row(out, "mesh") == ["not refined: the solve on the first mesh did not end well"]
    solution = quito.Solution.load(here / "results" / "bang_bang.h5")
    assert (solution.success, solution.refinement) == (False, None)


def test_a_check_that_fails_is_no_failure_of_the_answer(
    quito_: Quito, monkeypatch: pytest.MonkeyPatch, here: Path
) -> None:
    (here / "push.yaml").write_text(SMOOTH, encoding="utf-8")
    breaking(monkeypatch, 2, Status.STUCK)
    code, out, _ = quito_("solve", "push.yaml", "--no-plot")
    assert code == 0
    assert "The check with twice the substeps did not end well" in " ".join(row(out, "mesh"))
    assert row(out, "error of controls") == ["not estimated: refinement did not get so far"]


def test_points_need_cells(quito_: Quito, here: Path) -> None:
    points = "".join(f"    p{i}: {{at: {i}/10, holds: x <= {i}}}\n" for i in range(1, 9))
    text = SMOOTH.replace("mesh_steps: 20", "mesh_steps: 6, mesh_limit: 7")
    (here / "push.yaml").write_text(f"{text}constraints:\n  point:\n{points}", encoding="utf-8")
    code, out, err = quito_("solve", "push.yaml")
    assert (code, out) == (2, "")
    assert err == "quito: 6 cells cannot have nodes at 8 inner points: take more --steps\n"
    code, out, _ = quito_("solve", "push.yaml", "-N", "20", "--mesh-limit", "24", "--no-plot")
    assert code == 0
    nodes = quito.Solution.load(here / "results" / "push.h5").times
    assert np.abs(nodes[:, None] - np.arange(1, 9) / 10).min(axis=0).max() < 1e-12


# Progress


def test_who_listens_is_told_which_mesh_it_is() -> None:
    heard: list[str] = []
    solution = quito.solve(
        "bang_bang", mesh="adaptive", steps=40, listener=lambda told: heard.append(told.stage)
    )
    stages = list(dict.fromkeys(heard))
    assert solution.refinement is not None
    cells = [len(one.nodes) - 1 for one in solution.refinement.rounds]
    assert stages == [
        *(f"mesh {i}, {count} cells" for i, count in enumerate(cells, start=1)),
        "check of 4 substeps",
    ]
    heard.clear()
    quito.solve("bang_bang", steps=20, listener=lambda told: heard.append(told.stage))
    assert set(heard) == {""}


# Pictures


def test_jumps_are_marked_on_their_controls() -> None:
    text = SMOOTH.replace("lagrange: u^2 + v^2", "lagrange: u^2 + v*sin(8*t)")
    solution = quito.solve(load_text(text, "push.yaml"), mesh="uniform", steps=80)
    drawn = {axes.get_ylabel(): axes for axes in figure(solution, ("states", "controls")).axes}

    def marks(name: str) -> list[float]:
        lines = (line for line in drawn[name].get_lines() if line.get_label() == "jump or kink")
        return sorted(float(np.asarray(line.get_xdata())[0]) for line in lines)

    assert marks("x") == marks("u") == []
    assert marks("v") == pytest.approx([np.pi / 8, np.pi / 4], abs=0.01)
    texts = [t.get_text() for t in figure(solution, ("controls",)).legends[0].get_texts()]
    assert texts.count("jump or kink") == 1


def test_the_meshes_as_a_picture() -> None:
    solution = quito.solve("bang_bang", mesh="adaptive", steps=40)
    how = solution.refinement
    assert how is not None
    lengths, costs, estimates = figure(solution, ("mesh",)).axes
    assert lengths.get_ylabel() == "length of the cells"
    curves = lengths.get_lines()
    assert len(curves) == len(how.rounds)
    for curve, one in zip(curves, how.rounds, strict=True):
        np.testing.assert_allclose(np.asarray(curve.get_ydata())[:-1], np.diff(one.nodes))
        assert f"{len(one.nodes) - 1} cells" in str(curve.get_label())
    opacity = [
        float(curve.get_alpha() or 1) for curve in curves if "kept" not in str(curve.get_label())
    ]
    assert opacity == sorted(opacity)
    for axes in (lengths, costs, estimates):
        assert axes.get_yscale() == "log"
        assert axes.get_legend() is not None
    changes = estimates.get_lines()[0]
    np.testing.assert_allclose(
        np.asarray(changes.get_ydata(), dtype=float)[1:], [one.change for one in how.rounds][1:]
    )
