"""`--polish` as a user meets it: options, summary, page, JSON, warnings, comparisons, pictures.

What polishes is a stand-in here, so that what is told is known: the exact answer is a collocation
with a node at the jump, the accounts are made by hand. Answers of the real one: `test_polish.py`.
"""

from __future__ import annotations

import json
import math
import re
import signal
import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import quito_cli as quito
from quito_cli.cli.polishing import account
from quito_cli.comparison.table import called, tables
from quito_cli.plots import comparison as comparison_plots
from quito_cli.plots.figure import figure
from quito_cli.problem.load import load_text
from quito_cli.solution.densities import Densities
from quito_cli.solution.optimal import Arc
from quito_cli.solution.polishing import Polishing, PolishStatus, PolishStep
from quito_cli.solution.trajectory import Polynomials
from quito_cli.solvers.outcome import Progress, Status
from quito_cli.solving import on_answer
from quito_cli.summary.polishing import polish_rows

Quito = Callable[..., tuple[int, str, str]]
Array = Any

JUMP = """\
title: One jump
time: {initial: 0, final: 1}
states: {x: {initial: 0}}
controls: {u: {lower: -1, upper: 1}}
dynamics: {x: u}
cost: {lagrange: x*cos(2*pi*t)}
"""
"""The costate of x is −sin(2πt)/2π: u is 1 before 1/2, and −1 after it.

J = ∫ x cos(2πt) dt = −∫ u sin(2πt)/2π dt = −1/π².
"""
COST = -1 / math.pi**2
KNOWN = (
    JUMP
    + """\
reference:
  cost: -1/pi^2
  switching_times: [1/2]
  control: {u: [{until: 1/2, value: 1}, {value: -1}]}
"""
)
STEPS = (
    PolishStep("assume", "u: upper until 0.49981, lower from there on"),
    PolishStep("solve", "12 unknowns in 2 segments", (0.25, 3.1e-3, 4.4e-7, 8.1e-15)),
    PolishStep("check", "all signs and bounds hold"),
    PolishStep("accept", "the certificate improves"),
)
DONE = Polishing(PolishStatus.POLISHED, "", STEPS, 8.1e-15, 0.03, COST + 1.2e-7, 2, 3)
WHY = "dH/du of u has the wrong sign at t = 0.3, by 2e-2"
UNDONE = Polishing(PolishStatus.REFUSED, WHY, STEPS[:2], 3e-12, 0.05, COST, 0, 7)

Polish = Callable[[Any, Any, Any, quito.Solution], quito.Solution]


class Engine:
    """Takes the place of what polishes, and remembers what it was given."""

    def __init__(self) -> None:
        self.given: list[quito.Solution] = []
        self.does: Polish = exact

    def __call__(
        self, problem: Any, model: Any, options: Any, direct: quito.Solution
    ) -> quito.Solution:
        self.given.append(direct)
        return self.does(problem, model, options, direct)


def exact(problem: Any, model: Any, options: Any, direct: quito.Solution) -> quito.Solution:
    """Make a collocation of one point in each of two cells, with a node at the jump, exact."""
    found = quito.solve(
        problem, discretization="lgr", steps=2, degree=1, mesh="uniform", polish=False
    )
    upper, lower = Arc("u", "upper", 0, 0.5, 0, 1e-15), Arc("u", "lower", 0.5, 1, 1e-15, 0)
    assert found.extremal is not None
    return replace(
        found,
        options=direct.options,
        statistics=direct.statistics,
        cost=COST,
        evidence=replace(found.evidence, warnings=(), ringing=(0.0,), total_variation=(2.0,)),
        coefficients=np.array([[1.0], [-1.0]]),
        trajectory=Polynomials(np.array([0, 0.5, 1]), np.array([[0], [0.5], [0]]), 1),
        junctions=(),
        refinement=direct.refinement,
        extremal=replace(found.extremal, arcs=(upper, lower), certificate=()),
        polishing=replace(DONE, cost_before=direct.cost),
        densities=Densities((), Polynomials(np.array([0, 0.5, 1]), np.zeros((3, 0)), 1), ()),
    )


def in_vain(problem: Any, model: Any, options: Any, direct: quito.Solution) -> quito.Solution:
    """Find an extremal that violates a sign."""
    return replace(direct, polishing=replace(UNDONE, cost_before=direct.cost))


@pytest.fixture
def engine(monkeypatch: pytest.MonkeyPatch) -> Engine:
    """The stand-in."""
    found = Engine()
    name = "quito_cli.optimality.polish.polish"
    monkeypatch.setitem(sys.modules, name, SimpleNamespace(polish=found))
    return found


@pytest.fixture
def quito_(engine: Engine, quito_: Quito) -> Quito:
    """Run a command where there is `jump.yaml`; return its exit code and what it printed."""
    Path("jump.yaml").write_text(JUMP, encoding="utf-8")
    Path("known.yaml").write_text(KNOWN, encoding="utf-8")
    assert engine.does is exact
    return quito_


def row(printed: str, label: str) -> str:
    """A labelled row of the summary, its lines as one."""
    found = re.search(rf"^  {re.escape(label)} +(.*\n(?:   {{10,}}.*\n)*)", printed, re.MULTILINE)
    assert found, label
    return " ".join(found[1].split())


QUICK = ("--polish", "-N", "20", "--no-plot")


# Asked for


def test_nothing_is_polished_that_was_not_to_be(engine: Engine) -> None:
    problem = load_text(JUMP, "jump.yaml")
    solution = quito.solve(problem, steps=20)
    assert engine.given == []
    assert (solution.polishing, solution.polished, solution.interrupted) == (None, False, False)
    quito.solve(load_text(JUMP + "options: {polish: true}\n", "jump.yaml"), polish=False, steps=9)
    assert engine.given == []


def test_what_is_polished_is_the_certified_answer_on_an_adaptive_mesh(engine: Engine) -> None:
    solution = quito.solve(load_text(JUMP, "jump.yaml"), polish=True, steps=20)
    (direct,) = engine.given
    assert direct.success
    assert direct.certificate
    assert direct.refinement is not None
    assert direct.cost == pytest.approx(COST, abs=1e-3)
    assert solution.polished
    assert solution.options["polish"] is True
    assert solution.options["mesh"] == "adaptive"


@pytest.mark.parametrize(
    "options",
    [
        {"mesh": "uniform"},
        {"discretization": "lgr"},
        {"control": "piecewise-constant", "mesh": "uniform"},
        {"control": "piecewise-linear", "mesh": "uniform", "discretization": "hermite-simpson"},
        {"solver": "sqp-piqp", "mesh": "uniform"},
    ],
)
def test_any_answer_may_be_polished(options: dict[str, Any], engine: Engine) -> None:
    quito.solve(load_text(JUMP, "jump.yaml"), polish=True, steps=20, **options)
    (direct,) = engine.given
    assert direct.options["polish"] is True
    assert {name: direct.options[name] for name in options} == options
    assert direct.refinement is None


def test_a_file_may_ask_for_it(engine: Engine) -> None:
    problem = load_text(JUMP + "options: {polish: true, mesh_steps: 20}\n", "jump.yaml")
    assert quito.solve(problem).polished
    assert engine.given[0].options["mesh_steps"] == 20


# The summary


def test_a_line_says_what_it_came_to(quito_: Quito) -> None:
    code, out, err = quito_("solve", "jump.yaml", *QUICK)
    assert (code, err) == (0, "")
    moved = re.fullmatch(
        r"Pontryagin's system solved: 1 junction, residual 8e-15, 3 Newton steps, 0\.03 s "
        r"cost moved by (\S+) from the direct answer's",
        row(out, "polished"),
    )
    assert moved
    solution = quito.Solution.load("results/jump.h5")
    assert solution.polishing is not None
    before = solution.polishing.cost_before
    assert float(moved[1]) == pytest.approx(solution.cost - before, rel=0.1)
    assert solution.cost == pytest.approx(COST, abs=1e-12)
    assert "not polished" not in out
    assert not re.search(r"^  error of u", out, re.MULTILINE), "that was the direct one's"
    assert row(out, "method").endswith("variance 2, polished")
    assert row(out, "mesh").startswith("adaptive: ")
    code, shown, _ = quito_("show", "results/jump.h5")
    assert code == 0
    assert row(shown, "polished") == row(out, "polished")


def test_one_that_comes_to_nothing_is_a_warning_and_no_error(quito_: Quito, engine: Engine) -> None:
    engine.does = in_vain
    code, out, err = quito_("solve", "jump.yaml", *QUICK)
    assert (code, err) == (0, "")
    assert "\nSolved." in out
    why = f"An extremal was found that violates a condition: {WHY}"
    assert row(out, "not polished") == f"{why}; the direct answer stands"
    assert f"\nWarning: the answer is not polished, the direct one stands: {why}\n" in out
    assert not re.search(r"^  polished", out, re.MULTILINE)
    assert re.search(r"^  error of u", out, re.MULTILINE)
    assert "polished" not in row(out, "method")
    solution = quito.Solution.load("results/jump.h5")
    assert solution.success
    assert solution.warnings == (f"the answer is not polished, the direct one stands: {why}",)
    code, shown, _ = quito_("show", "results/jump.h5")
    assert code == 0
    assert out.partition("\n\nSaved")[0].splitlines()[-1] in shown


def test_what_is_not_said_is_nothing(engine: Engine) -> None:
    direct = quito.solve(load_text(JUMP, "jump.yaml"), steps=10)
    assert polish_rows(direct) == []
    bare = Polishing(PolishStatus.NO_ANSWER, "", (), math.nan, 0.0, 0.0, 0, 0)
    rows = polish_rows(replace(direct, polishing=bare))
    assert rows == [
        ("not polished", "There is no answer to polish; the direct answer stands"),
    ]


def test_json_has_the_account(quito_: Quito, engine: Engine) -> None:
    found = json.loads(quito_("solve", "jump.yaml", *QUICK, "--json")[1])
    polish = found["polish"]
    wanted = {"status", "polished", "reason", "residual", "newton_steps", "segments", "seconds"}
    assert wanted | {"message", "steps", "cost_before"} == polish.keys()
    assert (polish["status"], polish["polished"], polish["reason"]) == ("polished", True, "")
    assert (polish["segments"], polish["newton_steps"], polish["residual"]) == (2, 3, 8.1e-15)
    assert polish["steps"][1] == {
        "action": "solve",
        "sentence": STEPS[1].sentence,
        "residuals": list(STEPS[1].residuals),
    }
    assert found["switching_times"] == pytest.approx([0.5])
    assert found["warnings"] == []
    assert json.loads(quito_("show", "results/jump.h5", "--json")[1]) == found
    engine.does = in_vain
    found = json.loads(quito_("solve", "jump.yaml", *QUICK, "--json")[1])
    assert (found["polish"]["status"], found["polish"]["polished"]) == ("refused", False)
    assert found["polish"]["reason"] == WHY
    assert len(found["warnings"]) == 1
    found = json.loads(quito_("solve", "jump.yaml", "-N", "9", "--no-plot", "--json")[1])
    assert found["polish"] is None


# Step by step


def test_the_page_says_step_by_step_what_was_done(quito_: Quito) -> None:
    code, out, _ = quito_("solve", "jump.yaml", *QUICK, "--explain")
    assert code == 0
    page = out.partition("The polish, step by step\n")[2]
    assert out.index("Solved.") < out.index("The polish, step by step") < out.index("Saved ")
    lines = page.splitlines()
    assert lines[0] == "   1  assumed   u: upper until 0.49981, lower from there on"
    assert lines[1] == "   2  solved    12 unknowns in 2 segments"
    assert lines[2].split() == ["Newton", "step", "0", "1", "2", "3"]
    assert lines[3].split() == ["residual", "2.5e-01", "3.1e-03", "4.4e-07", "8.1e-15"]
    assert lines[4] == "   3  checked   all signs and bounds hold"
    assert lines[5] == "   4  accepted  the certificate improves"
    assert "  solved: Newton's method on states, costates, junction times" in page
    code, shown, _ = quito_("show", "results/jump.h5", "--explain")
    assert code == 0
    assert shown.startswith("One jump\n\nThe polish, step by step\n")
    assert "\n".join(lines[:6]) in shown
    for label in ("polished", "arcs", "Pontryagin"):
        assert row(shown, label)
    assert shown.endswith("It certifies an extremal, not a global optimum.\n")


def test_the_page_of_one_that_came_to_nothing(quito_: Quito, engine: Engine) -> None:
    engine.does = in_vain
    code, out, _ = quito_("solve", "jump.yaml", *QUICK, "--explain")
    assert code == 0
    assert "   2  solved   12 unknowns" in out
    shown = quito_("show", "results/jump.h5", "--explain")[1]
    assert row(shown, "not polished").endswith(f"{WHY}; the direct answer stands")


def test_every_action_has_its_word_and_many_residuals_are_broken() -> None:
    from typing import get_args

    from quito_cli.solution.polishing import Action

    steps = tuple(PolishStep(action, f"what {action} did") for action in get_args(Action))
    many = PolishStep("solve", "a long one", (*(2.0**-k for k in range(19)), math.nan))
    text = account(replace(DONE, steps=(*steps, many)))
    assert re.search(r"^ +residual .* none$", text, re.MULTILINE)
    for action in get_args(Action):
        assert re.search(rf"^ +\d+  {action.rstrip('e')}\w+ +what {action} did$", text, re.M)
    numbers = re.findall(r"^ +Newton step +(.*)$", text, re.MULTILINE)
    assert [int(n) for line in numbers for n in line.split()] == list(range(20))
    assert max(map(len, text.splitlines())) < 110
    assert account(replace(DONE, steps=())).endswith("none was taken")


def test_a_sentence_cannot_steer_the_terminal() -> None:
    text = account(replace(DONE, steps=(PolishStep("assume", "\x1b]0;owned\x07"),)))
    assert "\x1b]" not in text
    assert "\x07" not in text


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("solve", "jump.yaml", "--explain"), "--explain tells what a polish did: add --polish"),
        (("solve", "jump.yaml", "--explain", "--no-polish"), "add --polish"),
        (("solve", "jump.yaml", *QUICK, "--explain", "--json"), "--explain prints a page"),
        (("solve", "jump.yaml", *QUICK, "--explain", "--quiet"), "--explain prints a page"),
        (("show", "jump.yaml", "--explain"), "is no result: --explain takes the file of one"),
        (("show", "results/jump.h5", "--explain"), "was not to be polished"),
        (("show", "results/jump.h5", "--explain", "--json"), "--explain goes with no other"),
        (("show", "results/jump.h5", "--explain", "--certificate"), "goes with no other option"),
    ],
)
def test_what_is_refused(arguments: tuple[str, ...], said: str, quito_: Quito) -> None:
    assert quito_("solve", "jump.yaml", "-N", "9", "--no-plot", "-q")[0] == 0
    code, out, err = quito_(*arguments)
    assert (code, out) == (2, "")
    assert err.startswith("quito: ")
    assert said in err


# What breaks off


def test_ctrl_c_during_the_polish_leaves_the_direct_answer(quito_: Quito, engine: Engine) -> None:
    def pressed(problem: Any, model: Any, options: Any, direct: quito.Solution) -> quito.Solution:
        signal.raise_signal(signal.SIGINT)
        raise AssertionError("it went on")

    engine.does = pressed
    code, out, err = quito_("solve", "jump.yaml", *QUICK)
    assert (code, err) == (130, "")
    assert "\nSolved." in out
    assert row(out, "not polished") == "The polish was interrupted; the direct answer stands"
    assert "Saved results/jump.h5" in out
    solution = quito.Solution.load("results/jump.h5")
    assert (solution.success, solution.polished, solution.interrupted) == (True, False, True)
    assert solution.polishing is not None
    assert solution.polishing.status is PolishStatus.INTERRUPTED
    assert solution.polishing.cost_before == solution.cost


def test_ctrl_c_before_it_begins_is_heeded(engine: Engine, monkeypatch: pytest.MonkeyPatch) -> None:
    """While the answer on the last mesh is certified, what stops a solve is a flag."""
    certified = on_answer.certified

    def pressed(model: Any, solution: quito.Solution) -> quito.Solution:
        signal.raise_signal(signal.SIGINT)
        return certified(model, solution)

    monkeypatch.setattr(on_answer, "certified", pressed)
    solution = quito.solve(load_text(JUMP, "jump.yaml"), polish=True, steps=20)
    assert engine.given == []
    assert solution.polishing is not None
    assert solution.polishing.interrupted


def test_an_answer_that_is_none_is_not_called_interrupted(engine: Engine) -> None:
    def none(problem: Any, model: Any, options: Any, direct: quito.Solution) -> quito.Solution:
        assert direct.status is Status.ITERATION_LIMIT
        return replace(direct, polishing=replace(UNDONE, status=PolishStatus.NO_ANSWER, reason=""))

    engine.does = none
    solution = quito.solve(
        load_text(JUMP, "jump.yaml"), polish=True, mesh="uniform", steps=20, max_iterations=1
    )
    assert not solution.success
    assert not solution.interrupted


def test_who_listens_is_told_that_it_begins(engine: Engine) -> None:
    heard: list[Progress] = []
    quito.solve(load_text(JUMP, "jump.yaml"), polish=True, steps=20, listener=heard.append)
    assert heard[-1].stage == "polish"
    assert [one.stage for one in heard].count("polish") == 1
    assert heard[-1].cost == engine.given[0].cost


# Comparisons


def test_it_is_a_method(quito_: Quito) -> None:
    code, out, err = quito_(
        *("compare", "known.yaml", "-N", "20", "--against", "adaptive,polished", "--json"),
        "--no-plot",
    )
    assert (code, err) == (0, "")
    rows = json.loads(out)["rows"]
    assert [one["method"] for one in rows] == ["quasi-interpolant:gaussian", "adaptive", "polished"]
    assert [one["polished"] for one in rows] == [None, None, True]
    exactly = rows[2]
    assert exactly["error_l2"] < 1e-9
    assert exactly["error_sup"] < 1e-9
    assert exactly["switching_error"] < 1e-12
    assert exactly["cost_error"] == pytest.approx(0, abs=1e-12)
    assert exactly["polish_seconds"] == 0.03
    assert exactly["options"]["polish"] is True
    assert rows[1]["options"]["polish"] is False
    whole = exactly["build_seconds"] + exactly["solve_seconds"]
    assert exactly["seconds"] == pytest.approx(whole), "its seconds are of solving"


def test_ours_may_be_polished_and_others_are_not(quito_: Quito, engine: Engine) -> None:
    more = ("--polish", "--against", "laguerre4,polished", "--no-plot", "--json")
    found = json.loads(quito_("compare", "known.yaml", "-N", "20", *more)[1])
    assert [one["method"] for one in found["rows"]] == ["polished", "laguerre4"]
    assert [one["polished"] for one in found["rows"]] == [True, None]
    assert len(engine.given) == 1
    engine.given.clear()
    Path("asks.yaml").write_text(KNOWN + "options: {polish: true}\n", encoding="utf-8")
    others = ("--against", "adaptive,lgr", "--no-plot", "--json")
    found = json.loads(quito_("compare", "asks.yaml", "-N", "20", *others)[1])
    assert [one["polished"] for one in found["rows"]] == [True, None, None]
    assert len(engine.given) == 1


def test_a_row_that_could_not_be_polished_says_so(quito_: Quito, engine: Engine) -> None:
    engine.does = in_vain
    found = quito.compare(load_text(KNOWN, "known.yaml"), "polished", steps=20)
    assert [called(one) for one in found.rows] == [
        "quasi-interpolant:gaussian",
        "polished (not polished)",
    ]
    said = "polished is the direct answer: An extremal was found that violates a condition: "
    assert found.notes == (f"{said}{WHY}",)
    more = ("-N", "20", "--against", "polished", "--no-plot")
    code, out, _ = quito_("compare", "known.yaml", *more)
    assert code == 0
    assert f"P{said[1:]}{WHY}.\n" in out
    assert re.search(r"^  polished \(not polished\) ", out, re.MULTILINE)
    for format in ("--markdown", "--latex"):
        assert "(not polished)" in quito_("compare", "known.yaml", *more, format)[1]
    row_ = json.loads(quito_("compare", "known.yaml", *more, "--json")[1])["rows"][1]
    assert (row_["success"], row_["polished"]) == (True, False)


def test_the_truth_of_a_polished_answer_is_polished(engine: Engine) -> None:
    """Where the file knows none: against equal cells the answer would be the better of both."""
    found = quito.compare(load_text(JUMP, "jump.yaml"), "adaptive", steps=20, polish=True)
    assert len(engine.given) == 2
    assert engine.given[1].options["mesh"] == "uniform"
    assert engine.given[1].options["steps"] == 80
    assert found.truth is not None
    assert found.truth.title == "a solve on 2 segments, polished"
    assert found.truth.switching_times == pytest.approx([0.5])
    ours, adaptive = found.rows
    assert ours.errors is not None
    assert adaptive.errors is not None
    assert ours.errors.sup < 1e-9
    assert adaptive.errors.sup > 0.5
    assert adaptive.switching_errors == pytest.approx([0], abs=1e-3)
    assert all(math.isfinite(error) for error in ours.switching_errors)


def test_a_truth_that_could_not_be_polished_is_said(engine: Engine) -> None:
    engine.does = in_vain
    found = quito.compare(load_text(JUMP, "jump.yaml"), steps=20, polish=True)
    assert found.truth is not None
    assert found.truth.title == "a solve on 80 cells"
    assert [note.partition(" is the direct")[0] for note in found.notes if WHY in note] == [
        "what it is held against",
        "polished",
    ]


def test_a_saved_polished_result_is_our_row(quito_: Quito, engine: Engine) -> None:
    assert quito_("solve", "known.yaml", *QUICK, "-q")[0] == 0
    engine.given.clear()
    more = ("--result", "results/known.h5", "--no-plot")
    found = json.loads(quito_("compare", "known.yaml", *more, "--json")[1])
    assert [one["method"] for one in found["rows"]] == ["polished"]
    assert engine.given == []
    code, _, err = quito_("compare", "known.yaml", *more, "--polish")
    assert code == 2
    assert err.startswith("quito: polish belongs to a solve, and --result is solved already")


def test_ctrl_c_during_a_polish_ends_a_comparison(quito_: Quito) -> None:
    def listener(name: str, progress: Progress) -> None:
        if progress.stage == "polish":
            signal.raise_signal(signal.SIGINT)

    found = quito.compare(
        load_text(KNOWN, "known.yaml"), "polished,laguerre4", steps=20, listener=listener
    )
    assert [one.method for one in found.rows] == ["quasi-interpolant:gaussian", "polished"]
    assert found.interrupted


def test_tables_have_its_time_where_there_was_one(engine: Engine) -> None:
    found = quito.compare(load_text(KNOWN, "known.yaml"), "polished", steps=20)
    keys = {column.key for table in tables(found) for column in table.columns}
    assert "polish_seconds" in keys
    for name in comparison_plots.FIGURES:
        drawn = comparison_plots.figure(found, name)
        assert drawn is None or drawn.axes


# Pictures


def drawn_line(axes: Any, label: str) -> tuple[Array, Array]:
    (curve,) = [line for line in axes.get_lines() if line.get_label() == label]
    t, y = (np.asarray(data, dtype=float) for data in curve.get_data())
    return t, y


def test_a_jump_is_drawn_upright(engine: Engine) -> None:
    solution = quito.solve(load_text(KNOWN, "known.yaml"), polish=True, steps=20)
    (axes,) = figure(solution, ("controls",)).axes
    t, u = drawn_line(axes, "quito")
    assert (np.diff(t) > 0).all()
    at = int(np.flatnonzero(np.diff(u) < -1)[0])
    assert u[at] == pytest.approx(1, abs=1e-12)
    assert u[at + 1] == pytest.approx(-1, abs=1e-12)
    assert t[at + 1] - t[at] < 1e-12, "no slanted line"
    assert (np.abs(np.abs(u) - 1) < 1e-12).all()
    known, reference = drawn_line(axes, "reference")
    assert len(known) == len(reference) == len(solution.dense_times)
    heading = figure(solution, ("controls",)).get_suptitle()
    assert "polished, 2 segments" in heading


def test_an_answer_that_is_not_polished_is_drawn_as_ever(engine: Engine) -> None:
    engine.does = in_vain
    solution = quito.solve(load_text(JUMP, "jump.yaml"), polish=True, steps=20)
    (axes,) = figure(solution, ("controls",)).axes
    np.testing.assert_array_equal(drawn_line(axes, "quito")[0], solution.dense_times)
    assert "cells" in figure(solution, ("controls",)).get_suptitle()


def test_costates_states_and_meshes_are_drawn(quito_: Quito) -> None:
    assert quito_("solve", "jump.yaml", "--polish", "-N", "20", "-q")[0] == 0
    assert Path("results/jump.png").is_file()
    for panels in (["--costates"], ["--mesh"], ["--states", "--controls"]):
        assert quito_("plot", "results/jump.h5", *panels, "-q")[0] == 0


def saved(solution: quito.Solution) -> Mapping[str, Any]:
    solution.save("a.h5")
    return vars(quito.Solution.load("a.h5"))


def test_a_result_file_keeps_the_account(
    engine: Engine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    problem = load_text(JUMP, "jump.yaml")
    done = quito.solve(problem, polish=True, steps=20)
    assert saved(done)["polishing"] == done.polishing
    engine.does = in_vain
    undone = quito.solve(problem, polish=True, steps=20)
    assert saved(undone)["polishing"] == undone.polishing
    assert saved(quito.solve(problem, steps=9))["polishing"] is None
