"""Runs of many cases: what becomes of each, whatever its neighbours do."""

from __future__ import annotations

import json
import math
import os
import pty
import re
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import hostile
import numpy as np
import pytest
from documents import Ran, run

import quito_cli as quito
from quito_cli.batch.judging.checks import check
from quito_cli.batch.judging.figures import COSTLY, FIGURES, TIMES, figures
from quito_cli.batch.running import Nobody
from quito_cli.batch.suite.case import Case, Ending, Expectation, Figure, Finished
from quito_cli.batch.suite.limits import Limits
from quito_cli.batch.workers.recorded import exit_code
from quito_cli.batch.workers.run import Setting
from quito_cli.batch.workers.run import run as run_cases
from quito_cli.batch.workers.solving import file_stem
from quito_cli.comparison.table import COLUMNS
from quito_cli.errors import UsageError

ROOT = Path(__file__).parent.parent
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
Solve = Callable[..., quito.Solution]

PUSH = """\
title: Push to one
constants: {way: 1}
time: {initial: 0, final: 1}
states: {x: {initial: 0, final: way}}
controls: {u: {lower: -3, upper: 3}}
dynamics: {x: u}
cost: {lagrange: u^2}
reference: {cost: 1, accuracy: 1e-12}
options: {steps: 5}
"""
"""u = way and J = way²; with |u| <= 3, x ends at 3 at most."""


def setting(folder: Path, **changes: Any) -> Setting:
    return replace(Setting(2, folder, "none", job=hostile.job), **changes)


def cases(*kinds: str) -> list[Case]:
    return [Case(f"{i}-{kind}", "none", axes={"kind": kind}) for i, kind in enumerate(kinds)]


def ended(given: list[Case], how: Setting) -> dict[str, Finished]:
    found = {one.case.name: one for one in run_cases(given, how)}
    return {case.name: found[case.name] for case in given if case.name in found}


# Whatever a case does


def test_a_case_takes_only_itself_down(tmp_path: Path) -> None:
    given = cases("good", "crash", "good", "leave", "bug", "unsolved", "good", "hang", "hoard")
    limits = {
        "7-hang": Limits(0.5, None),
        "8-hoard": Limits(None, 300_000_000),
        "0-good": Limits(60.0, 10**9),
    }
    found = ended(given, setting(tmp_path, limits=limits))
    assert {name: one.ending for name, one in found.items()} == {
        "0-good": Ending.PASSED,
        "1-crash": Ending.CRASHED,
        "2-good": Ending.PASSED,
        "3-leave": Ending.CRASHED,
        "4-bug": Ending.CRASHED,
        "5-unsolved": Ending.UNSOLVED,
        "6-good": Ending.PASSED,
        "7-hang": Ending.TIMED_OUT,
        "8-hoard": Ending.OUT_OF_MEMORY,
    }
    assert found["1-crash"].message == (
        "its process ended by SIGABRT; its last words: double free or corruption"
    )
    assert found["3-leave"].message == "its process ended with code 5"
    assert found["4-bug"].message.startswith("a bug in quito: KeyError: 'nobody expected this'")
    assert found["7-hang"].message == "it took more than its limit of 0.5 s"
    assert 0.5 <= found["7-hang"].seconds < hostile.LONG / 2
    assert re.fullmatch(r"it held [\d.]+ MB, and the limit is 300 MB", found["8-hoard"].message)
    assert all(one.result is None for one in found.values() if one.ending is not Ending.PASSED)


def test_a_worker_goes_from_case_to_case(tmp_path: Path) -> None:
    found = ended(cases(*["good"] * 20), setting(tmp_path))
    assert len({one.figures["process"] for one in found.values()}) <= 2


def test_cases_wait_for_those_that_they_follow(tmp_path: Path) -> None:
    """And start from the nearest answer on that way; a chain is walked whatever its order here."""
    kinds = ["slow", "good", "crash", "unsolved", "good"]
    chain = [
        Case(f"{i}", "none", axes={"kind": kind}, follows=f"{i - 1}" if i else None)
        for i, kind in enumerate(kinds)
    ]
    free = Case("free", "none", axes={"kind": "good"})
    for jobs in (1, 3):
        found = ended([*reversed(chain), free], setting(tmp_path, jobs=jobs))
        assert [found[f"{i}"].figures.get("guess") for i in (0, 1, 4)] == [None, "0", "1"]
        assert found["free"].figures["guess"] is None
        assert found["2"].ending is Ending.CRASHED


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ([Case("a", "x", follows="b"), Case("b", "x", follows="a")], "the case a follows itself"),
        ([Case("a", "x", follows="b")], "the case a follows b, and there is no such case"),
        ([Case("a[k=1]", "x"), Case("A-k=1", "x")], "would have the same result file"),
        ([Case("a", "x"), Case("a", "x")], "would have the same result file"),
    ],
)
def test_tangles_are_refused(given: list[Case], said: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=re.escape(said)):
        list(run_cases(given, setting(tmp_path)))


def test_stopping_keeps_what_is_done_and_begins_nothing(tmp_path: Path) -> None:
    found: list[Finished] = []
    given = cases("good", "hang", "good", "good")
    for one in run_cases(given, setting(tmp_path, jobs=1, stop=lambda: len(found) == 1)):
        found.append(one)
    assert [one.case.name for one in found] == ["0-good"]


def stopped_at_work(folder: Path, kind: str) -> list[Finished]:
    """A good case and another one, stopped when the first is done and the other one has begun."""
    found: list[Finished] = []
    words: list[Any] = []
    how = setting(
        folder,
        stop=lambda: bool(found) and "here" in words,
        watch=lambda name, word: words.append(word),
    )
    for one in run_cases(cases(kind, "good"), how):
        found.append(one)
    return found


def test_a_case_that_has_not_begun_is_stopped_at_once(tmp_path: Path) -> None:
    """While its interpreter starts nobody would hear; nor is there anything to keep."""
    began = time.perf_counter()
    (one,) = run_cases(cases("hang"), setting(tmp_path, stop=Stops(1)))
    assert (one.ending, one.message) == (Ending.INTERRUPTED, "it was stopped before it began")
    assert time.perf_counter() - began < 15  # of 20 s that a case has to stop


class Stops:
    """Asked whether to stop: yes, after some times."""

    def __init__(self, after: int) -> None:
        self.left = after

    def __call__(self) -> bool:
        self.left -= 1
        return self.left < 0


def test_a_case_that_does_not_stop_is_ended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("quito_cli.batch.workers.run._GRACE", 0.3)
    found = stopped_at_work(tmp_path, "deaf")
    assert [one.ending for one in found] == [Ending.PASSED, Ending.INTERRUPTED]
    assert found[1].message == "it did not stop when it was asked to"


def test_a_worker_that_dies_of_being_stopped_has_not_crashed(tmp_path: Path) -> None:
    """A resumed run solves its case."""
    found = stopped_at_work(tmp_path, "frail")
    assert [one.ending for one in found] == [Ending.PASSED, Ending.INTERRUPTED]
    assert found[1].message == "it ended when it was asked to stop"


def test_interrupted_solves_keep_their_best_iterate(tmp_path: Path) -> None:
    """Stopped at the first word of the solver's."""
    words: list[Any] = []
    how = Setting(
        1,
        tmp_path,
        "all",
        stop=lambda: any(word is not None for word in words),
        watch=lambda name, word: words.append(word),
    )
    (only,) = run_cases([Case("a", "rayleigh", {"tolerance": 1e-15})], how)
    assert only.ending is Ending.INTERRUPTED
    assert only.result is not None
    assert quito.Solution.load(only.result).status.name == "INTERRUPTED"


def test_one_who_stops_reading_leaves_nobody_behind(tmp_path: Path) -> None:
    running = run_cases(cases(*["good"] * 3, "hang"), setting(tmp_path))
    process = next(running).figures["process"]
    running.close()  # type: ignore[attr-defined]
    for _ in range(600):
        if not Path(f"/proc/{process}").exists():
            break
        time.sleep(0.05)
    assert not Path(f"/proc/{process}").exists()


# Solves


def of_push(name: str, way: float, **given: Any) -> Case:
    return Case(name, "push.yaml", {}, {"way": way}, text=PUSH, **given)


def test_solved_outside_unsolved_refused(tmp_path: Path) -> None:
    near = Expectation("cost", 1.0, absolute=1e-6)
    given = [
        of_push("within", 1, expectations=(near,)),
        of_push("outside", 2, expectations=(near,)),
        of_push("unsolved", 5),
        of_push("foreseen", 5, expectations=(Expectation("status", "infeasible"),)),
        of_push("surprise", 1, expectations=(Expectation("status", "infeasible"),)),
        replace(of_push("refused", 1), constants={"wai": 1}),
        replace(of_push("refused too", 1), options={"variance": 2, "control": "piecewise-linear"}),
        Case("missing", str(tmp_path / "gone.yaml")),
    ]
    found = ended(given, Setting(2, tmp_path, "failed"))
    assert {name: one.ending for name, one in found.items()} == {
        "within": Ending.PASSED,
        "outside": Ending.OUTSIDE,
        "unsolved": Ending.UNSOLVED,
        "foreseen": Ending.PASSED,
        "surprise": Ending.OUTSIDE,
        "refused": Ending.REFUSED,
        "refused too": Ending.REFUSED,
        "missing": Ending.REFUSED,
    }
    assert found["within"].figures["cost"] == pytest.approx(1)
    assert found["outside"].checks[0].sentence == "cost is 4, expected 1 ± 1e-06"
    assert "no constant 'wai'; did you mean 'way'?" in found["refused"].message
    assert found["missing"].message.startswith(f"there is no file {tmp_path / 'gone.yaml'}")
    assert "violates the constraints" in found["unsolved"].message
    kept = {path.stem for path in tmp_path.glob("*.h5")}
    assert kept == {"outside", "unsolved", "surprise"}
    assert found["within"].result is None
    assert found["outside"].result == tmp_path / "outside.h5"


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> dict[int, dict[str, Finished]]:
    """The same cases, some by continuation, by one worker and by three."""
    given = [
        Case(f"{name}[{steps}]", name, {"steps": steps})
        for name in ("van_der_pol", "bang_bang")
        for steps in (11, 17)
    ]
    chain = [Case(f"mu{i}", "van_der_pol", {"steps": 13}, {"mu": 1 + i / 4}) for i in range(4)]
    given += [replace(case, follows=f"mu{i - 1}" if i else None) for i, case in enumerate(chain)]
    return {
        jobs: ended(given, Setting(jobs, tmp_path_factory.mktemp(f"jobs{jobs}"), "all"))
        for jobs in (1, 3)
    }


def test_results_do_not_depend_on_the_number_of_jobs(
    whole: dict[int, dict[str, Finished]],
) -> None:
    one, three = whole[1], whole[3]
    assert len(one) == 8
    for name, finished in one.items():
        there = three[name]
        assert finished.ending is there.ending is Ending.PASSED
        for figure in finished.figures.keys() - TIMES:
            assert finished.figures[figure] == there.figures[figure], (name, figure)
        assert finished.result is not None
        assert there.result is not None
        here, other = map(quito.Solution.load, (finished.result, there.result))
        assert (here.coefficients == other.coefficients).all()
        assert (here.costates == other.costates).all()


def _exact(dataset: Any) -> Any:
    """Return the bytes of numbers, or texts as a list."""
    if dataset.dtype == object:
        return np.asarray(dataset.asstr()[()]).tolist()
    return dataset[()].tobytes()


def content(path: Path) -> dict[str, Any]:
    """Return all that a result file has, recorded times apart."""
    import h5py

    found: dict[str, Any] = {}

    def take(name: str, one: Any) -> None:
        for key, value in one.attrs.items():
            if not (key.endswith("seconds") or key in ("DIMENSION_LIST", "REFERENCE_LIST")):
                found[f"{name}@{key}"] = repr(value)
        if isinstance(one, h5py.Dataset):
            found[name] = _exact(one)

    with h5py.File(path) as file:
        take("", file)
        file.visititems(take)
    return found


def test_what_a_worker_did_before_does_not_show(tmp_path: Path) -> None:
    """A problem that it has derived the formulas of is solved as by a process of its own."""
    for name in ("bryson_denham", "rayleigh"):
        given = [Case(f"{name}{steps}", name, {"steps": steps}) for steps in (13, 10, 16)]
        last = ended(given, Setting(1, tmp_path, "all"))[f"{name}16"]
        (alone,) = run_cases([replace(given[2], name="alone")], Setting(1, tmp_path, "all"))
        assert last.result is not None
        assert alone.result is not None
        found = content(last.result)
        assert len(found) > 100
        assert found == content(alone.result)


def test_constants_that_are_equal_are_not_the_same(tmp_path: Path) -> None:
    """A worker keeps problems that it has read: 1 and 1.0 are recorded as they were given."""
    given = [of_push("int", 1), replace(of_push("float", 1), constants={"way": 1.0})]
    found = ended(given, Setting(1, tmp_path, "all"))
    for name, said in (("int", "1"), ("float", "1.0")):
        result = found[name].result
        assert result is not None
        assert quito.Solution.load(result).origin.changes == (("way", said),)


def test_a_continued_case_starts_from_the_answer_before(
    whole: dict[int, dict[str, Finished]],
) -> None:
    result = whole[1]["mu1"].result
    assert result is not None
    guess = quito.Solution.load(result).options["guess"]
    assert guess == str(whole[1]["mu0"].result)


def test_what_others_start_from_is_kept(tmp_path: Path) -> None:
    given = [of_push("a", 1), of_push("b", 1.5, follows="a")]
    found = ended(given, Setting(1, tmp_path, "none"))
    assert found["a"].result == tmp_path / "a.h5"
    assert found["b"].result is None
    assert {path.name for path in tmp_path.iterdir()} == {"a.h5"}


def test_leftovers_of_killed_runs_are_removed(tmp_path: Path) -> None:
    ours, others = tmp_path / ".0-good.123.h5", tmp_path / ".other.123.h5"
    for path in (ours, others):
        path.write_bytes(b"half a file")
    ended(cases("good"), setting(tmp_path))
    assert not ours.exists()
    assert others.exists(), "it may be of a solve that is at work"


def test_a_file_of_an_earlier_run_does_not_outlive_its_answer(tmp_path: Path) -> None:
    (tmp_path / "a.h5").write_bytes(b"of an earlier run")
    ended([of_push("a", 1)], Setting(1, tmp_path, "none"))
    assert not (tmp_path / "a.h5").exists()


@pytest.mark.parametrize(
    ("name", "stem"),
    [
        ("van_der_pol[steps=100,mu=0.1]", "van_der_pol-steps=100-mu=0.1"),
        ("suite/a", "suite-a"),
        ("../../etc/x", "etc-x"),
        ("a[k=1/3]", "a-k=1-3"),
        ("x" * 500, "x" * 150),
    ],
)
def test_names_of_files(name: str, stem: str) -> None:
    assert file_stem(name) == stem


# Figures and checks


@pytest.fixture(scope="module")
def of_van_der_pol(solve: Solve) -> tuple[quito.Solution, dict[str, Figure]]:
    solution = solve("van_der_pol", steps=40)
    return solution, figures(solution, quito.load("van_der_pol"), 0.5, FIGURES)


def test_figures_are_those_of_the_comparison(
    of_van_der_pol: tuple[quito.Solution, dict[str, Figure]],
) -> None:
    solution, found = of_van_der_pol
    row = quito.compare("van_der_pol", result=solution).rows[0]
    columns = {column.key: column for given in COLUMNS.values() for column in given}
    assert len(COSTLY) == 8
    for name in COSTLY | {"iterations", "violation", "ringing", "cost"}:
        assert found[name] == columns[name].value(row), name
    total = columns["total_variation"].value(row)
    assert total is not None
    assert found["total_variation"] == pytest.approx(total, rel=1e-3), "sampled otherwise"
    assert row.cost_error is not None
    assert found["cost_error"] == abs(row.cost_error)
    assert found["relative_cost_error"] == pytest.approx(abs(row.cost_error) / 0.757617928659)
    assert row.resimulated_cost_error is not None
    assert found["resimulated_cost_error"] == abs(row.resimulated_cost_error)


def test_figures_of_the_solution(
    of_van_der_pol: tuple[quito.Solution, dict[str, Figure]],
) -> None:
    solution, found = of_van_der_pol
    assert found["switching_times"] == solution.switching_times
    assert (found["initial_time"], found["final_time"], found["cells"]) == (0.0, 4.0, 40)
    assert (found["status"], found["success"]) == ("solved", True)
    assert found["estimated_error"] is None, "of adaptive meshes only"
    assert found["warnings"] == len(solution.warnings)
    assert found["processor_seconds"] == 0.5
    assert set(found) > TIMES


def test_costly_figures_are_found_on_request(
    of_van_der_pol: tuple[quito.Solution, dict[str, Figure]], monkeypatch: pytest.MonkeyPatch
) -> None:
    solution, _ = of_van_der_pol
    few = figures(solution, quito.load("van_der_pol"), 0.5, ["error_l2"])
    assert set(few) == set(FIGURES) - COSTLY | {"error_l2"}
    monkeypatch.setattr("quito_cli.comparison.measure.measured", None)
    assert set(figures(solution, quito.load("van_der_pol"), 0.5, [])) == set(FIGURES) - COSTLY


def test_a_problem_without_reference_has_no_such_figures(solve: Solve, lq: str) -> None:
    solution = solve(lq, steps=10)
    from quito_cli.problem.load import load_text

    found = figures(solution, load_text(lq, "lq.yaml"), 0.5, COSTLY)
    for name in COSTLY | {"cost_error", "relative_cost_error", "resimulated_cost_error"}:
        assert found[name] is None


CHECKS: list[tuple[Expectation, Figure, bool, str]] = [
    (Expectation("cost", 2.0, absolute=0.1), 2.05, True, "cost is 2.05, expected 2 ± 0.1"),
    (Expectation("cost", 2.0, absolute=0.1), 2.2, False, "cost is 2.2, expected 2 ± 0.1"),
    (
        Expectation("cost", -100.0, absolute=0.1, relative=0.01),
        -100.9,
        True,
        "cost is -100.9, expected -100 ± 0.1 or 1 %",
    ),
    (Expectation("error_l2", most=0.01), 0.01, True, "error_l2 is 0.01, expected at most 0.01"),
    (Expectation("error_l2", most=0.01), 0.02, False, "error_l2 is 0.02, expected at most 0.01"),
    (
        Expectation("cells", least=5, most=9),
        3,
        False,
        "cells is 3, expected at least 5 and at most 9",
    ),
    (
        Expectation("switching_error", most=1.0),
        math.inf,
        False,
        "switching_error is inf, expected at most 1",
    ),
    (Expectation("iterations", 14), 15, False, "iterations is 15, expected 14"),
    (Expectation("iterations", 14), 14, True, "iterations is 14, expected 14"),
    (Expectation("status", "solved"), "stuck", False, "status is stuck, expected solved"),
    (Expectation("success", False), False, True, "success is false, expected false"),
    (
        Expectation("certificate", "passed"),
        "costate equation",
        False,
        "certificate is costate equation, expected passed",
    ),
    (
        Expectation("switching_times", (1.0, 2.5), absolute=0.1),
        (1.05, 2.45),
        True,
        "switching_times is (1.05, 2.45), expected (1, 2.5) ± 0.1",
    ),
    (
        Expectation("switching_times", (1.0, 2.5), absolute=0.1),
        (1.05,),
        False,
        "switching_times is (1.05), expected (1, 2.5) ± 0.1",
    ),
    (
        Expectation("switching_times", (1.0, 2.5), relative=0.1),
        (1.0, 2.76),
        False,
        "switching_times is (1, 2.76), expected (1, 2.5) ± 10 %",
    ),
]


@pytest.mark.parametrize(("expected", "found", "passed", "sentence"), CHECKS)
def test_checks(expected: Expectation, found: Figure, passed: bool, sentence: str) -> None:
    made = check(expected, found)
    assert (made.passed, made.sentence) == (passed, sentence)


def test_what_is_not_known_is_not_as_expected() -> None:
    made = check(Expectation("error_l2", most=1.0), None)
    assert not made.passed
    assert made.sentence.startswith("error_l2 is not known (")


# The command


SUITE = """\
defaults: {limits: {seconds: 60, memory: 2 GB}}
cases:
  - problem: push.yaml
    matrix: {way: [1, 2]}
    expect: {cost: 1 ± 1e-6}
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a problem and a suite, which is the working one."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "push.yaml").write_text(PUSH, encoding="utf-8")
    (tmp_path / "suite.yaml").write_text(SUITE, encoding="utf-8")
    return tmp_path


@pytest.fixture
def quito_(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> Callable[..., Ran]:
    def ran(*arguments: str) -> Ran:
        capfd.readouterr()
        code = run(["batch", *arguments], monkeypatch)
        printed = capfd.readouterr()
        assert "Traceback" not in printed.err
        return Ran(code, printed.out, printed.err)

    return ran


def test_a_suite_in_a_verdict_out(quito_: Callable[..., Ran], folder: Path) -> None:
    ran = quito_("suite.yaml", "-j", "1")
    assert ran.code == 3
    lines = [re.sub(r"\d+\.\d\d s", "# s", line) for line in ran.out.splitlines()]
    assert lines == [
        "passed        push[way=1]   # s   cost 1",
        "outside       push[way=2]   # s   cost 4",
        "              cost is 4, expected 1 ± 1e-06",
        "",
        "suite: 1 passed, 1 outside   in results",
    ]
    assert ran.err == ""
    results = {path.name for path in (folder / "results").iterdir()}
    assert results == {"push-way=1.h5", "push-way=2.h5", "suite.batch.jsonl"}


def test_batch_and_sweep_take_what_solve_takes() -> None:
    """All but what is of a single problem; with the same words of help."""
    import typer

    from quito_cli.cli.app import app

    commands: Any = typer.main.get_command(app)
    helps = {
        name: {one.name: getattr(one, "help", None) for one in commands.commands[name].params}
        for name in ("solve", "batch", "sweep")
    }
    single = {"problem", "explain", "guess", "warm_start", "picture", "no_plot", "verbose"}
    of_a_solve = helps["solve"].keys() - single - {"output", "as_json", "quiet"}
    fields = set(quito.Options.__dataclass_fields__) - {"guess", "warm_start", "solver_options"}
    assert of_a_solve == fields | {"solver_option", "settings"}
    for name in of_a_solve:
        assert helps["batch"][name] == helps["sweep"][name] == helps["solve"][name]


def test_options_of_the_solves_reach_every_case(quito_: Callable[..., Ran]) -> None:
    given = ["--mesh", "adaptive", "--mesh-tolerance", "0.01", "--control", "piecewise-linear"]
    given += ["--solver-option", "mu_init=0.1", "--no-polish", "--path-points", "nodes"]
    for one in quito_("push.yaml", "bang_bang", *given, "--list", "--json").json["cases"]:
        assert one["options"] == {
            "mesh": "adaptive",
            "mesh_tolerance": 0.01,
            "control": "piecewise-linear",
            "solver_options": {"mu_init": 0.1},
            "polish": False,
            "path_points": "nodes",
        }
    ran = quito_("push.yaml", "--control", "piecewise-constant", "--as-printed", "--json")
    assert "normalised belongs to quasi-interpolants" in ran.json["cases"][0]["message"]


@pytest.mark.parametrize(
    ("arguments", "code", "endings"),
    [
        (["suite.yaml", "--filter", "way=1"], 0, {"passed": 1}),
        (["push.yaml"], 0, {"passed": 1}),
        (["push.yaml", "--set", "way=5"], 1, {"unsolved": 1}),
        (["push.yaml", "--set", "wai=5"], 2, {"refused": 1}),
        (["push.yaml", "--solver", "knitro"], 2, {"refused": 1}),
        (["suite.yaml", "--time-limit", "0.001"], 1, {"timed_out": 2}),
        (["rayleigh", "-N", "5000", "--memory-limit", "100MB"], 1, {"out_of_memory": 1}),
    ],
)
def test_exit_codes(
    arguments: list[str], code: int, endings: dict[str, int], quito_: Callable[..., Ran]
) -> None:
    ran = quito_(*arguments, "--json", "-j", "1")
    assert ran.err == ""
    assert ran.json["counts"] == endings
    assert ran.code == ran.json["exit_code"] == code


def test_the_worst_ending_decides() -> None:
    def code(*endings: Ending) -> int:
        return exit_code(
            Finished(Case("a", "x"), ending, "", {}, (), 0.0, None) for ending in endings
        )

    assert code() == code(Ending.PASSED) == 0
    assert code(Ending.PASSED, Ending.OUTSIDE) == 3
    assert code(Ending.OUTSIDE, Ending.CRASHED) == code(Ending.UNSOLVED) == 1
    assert code(Ending.TIMED_OUT) == code(Ending.OUT_OF_MEMORY, Ending.PASSED) == 1
    assert code(Ending.OUTSIDE, Ending.CRASHED, Ending.REFUSED) == 2


def test_json_has_every_case(quito_: Callable[..., Ran]) -> None:
    said = quito_("suite.yaml", "--json").json
    assert said["suite"] == "suite"
    assert said["not_begun"] == 0
    first, second = said["cases"]
    assert (first["case"], second["case"]) == ("push[way=1]", "push[way=2]")
    assert (first["ending"], second["ending"]) == ("passed", "outside")
    assert first["set"] == first["axes"] == {"way": 1}
    assert second["expect"] == [{"figure": "cost", "target": 1.0, "absolute": 1e-6}]
    assert second["checks"][0]["passed"] is False
    assert first["figures"]["cost"] == pytest.approx(1)
    assert first["result"] == str(Path("results") / "push-way=1.h5")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["gone.yaml"], "there is no file gone.yaml"),
        (["suite.yaml", "-N", "5"], "steps: options and constants are for problems"),
        (["suite.yaml", "--filter", "x"], "no case is called x"),
        (["suite.yaml", "-j", "0"], "jobs: a number from 1 to 1000 is expected, got 0"),
        (["suite.yaml", "--keep", "some"], "keep: expected all, failed or none, got 'some'"),
        (["suite.yaml", "--time-limit", "0"], "time-limit: a number of seconds above 0"),
        (["suite.yaml", "--memory-limit", "much"], "expected a size such as 500 MB or 2 GB"),
        (["suite.yaml", "--resume"], "there is nothing to resume"),
        (["suite.yaml", "-o", "push.yaml"], "-o names a folder"),
        (["push.yaml", "push.yaml"], "the cases push and push would have the same result file"),
    ],
)
def test_a_wrong_command_line(arguments: list[str], said: str, quito_: Callable[..., Ran]) -> None:
    ran = quito_(*arguments)
    assert ran.code == 2
    assert said in ran.err
    assert ran.out == ""


def test_a_wrong_suite(quito_: Callable[..., Ran], folder: Path) -> None:
    (folder / "suite.yaml").write_text("cases: [{problem: push.yml}]", encoding="utf-8")
    ran = quito_("suite.yaml")
    assert ran.code == 2
    assert ran.err.startswith("suite.yaml:1:19: there is no file push.yml beside the suite")


def test_a_list_of_cases_solves_none(quito_: Callable[..., Ran], folder: Path) -> None:
    ran = quito_("suite.yaml", "--list")
    assert ran.code == 0
    assert [line.split() for line in ran.out.splitlines()] == [
        ["case", "problem", "options", "checks"],
        ["push[way=1]", "push.yaml", "way=1", "1"],
        ["push[way=2]", "push.yaml", "way=2", "1"],
    ]
    assert not (folder / "results").exists()
    (folder / "other.yaml").write_text(
        "cases: [{problem: push.yaml, options: {polish: true}, over: {way: '1:2:2'}}]",
        encoding="utf-8",
    )
    assert [line.split() for line in quito_("other.yaml", "--list").out.splitlines()[1:]] == [
        ["push[way=1]", "push.yaml", "polish=true", "way=1", "0"],
        ["push[way=2]", "push.yaml", "polish=true", "way=2", "0"],
    ]
    listed = quito_("suite.yaml", "--list", "--json").json
    assert [case["case"] for case in listed["cases"]] == ["push[way=1]", "push[way=2]"]


def test_quiet_and_verbose(quito_: Callable[..., Ran]) -> None:
    quiet = quito_("suite.yaml", "-q", "-j", "1").out.splitlines()
    assert [line.split()[0] for line in quiet] == ["outside", "cost"]
    assert quito_("push.yaml", "-q").out == ""
    verbose = quito_("suite.yaml", "-v", "-j", "1").out
    assert "cost is 1, expected 1 ± 1e-06" in verbose
    assert re.search(r"^case +ended +cost +iterations", verbose, re.MULTILINE)


def test_fail_fast_stops_at_the_first(quito_: Callable[..., Ran], folder: Path) -> None:
    text = SUITE.replace("[1, 2]", "[2, 1, 1.5]")
    (folder / "suite.yaml").write_text(text, encoding="utf-8")
    ran = quito_("suite.yaml", "--fail-fast", "-j", "1", "--json")
    assert ran.code == 3
    assert [case["case"] for case in ran.json["cases"]] == ["push[way=2]"]
    assert ran.json["not_begun"] == 2


def test_resuming_solves_what_is_left(quito_: Callable[..., Ran], folder: Path) -> None:
    first = quito_("suite.yaml", "--fail-fast", "-j", "1")
    assert first.code == 3
    journal = folder / "results" / "suite.batch.jsonl"
    head, one, two = journal.read_text(encoding="utf-8").splitlines(keepends=True)
    journal.write_text(head + two, encoding="utf-8")
    kept = (folder / "results" / "push-way=2.h5").stat().st_mtime_ns
    (folder / "results" / "push-way=1.h5").unlink()
    assert one
    ran = quito_("suite.yaml", "--resume", "--json")
    assert ran.code == 3
    assert [case["ending"] for case in ran.json["cases"]] == ["passed", "outside"]
    assert (folder / "results" / "push-way=2.h5").stat().st_mtime_ns == kept
    assert (folder / "results" / "push-way=1.h5").exists()


def test_the_parent_needs_no_casadi(folder: Path) -> None:
    code = (
        "import sys\nfrom quito_cli.cli.app import main\nsys.argv = ['quito', 'batch', "
        "'suite.yaml', '-q', '-j', '1']\ntry: main()\nexcept SystemExit: pass\n"
        "print(sorted({'casadi', 'h5py', 'matplotlib'} & set(sys.modules)))"
    )
    ran = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        env=ENVIRONMENT,
        cwd=folder,
    )
    assert ran.stdout.splitlines()[-1] == "[]"


@pytest.mark.parametrize("solver", ["ipopt", "highs"])
def test_nothing_in_the_working_folder_is_imported(
    solver: str, quito_: Callable[..., Ran], folder: Path
) -> None:
    """Neither by a worker, nor by a solver in a process of its own."""
    for name in ("numpy", "casadi", "quito_cli", "h5py", "json"):
        (folder / f"{name}.py").write_text("open('evil', 'w')\nraise SystemExit", encoding="utf-8")
    ran = quito_("push.yaml", "--solver", solver)
    assert ran.code == 0
    assert not (folder / "evil").exists()


HANGING = """\
cases:
  - push.yaml
  - problem: rayleigh
    options: {tolerance: 1e-15, steps: 2000}
"""


def test_ctrl_c_keeps_what_is_done(folder: Path) -> None:
    (folder / "suite.yaml").write_text(HANGING, encoding="utf-8")
    command = [sys.executable, "-m", "quito_cli", "batch", "suite.yaml", "-j", "1"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=ENVIRONMENT
    ) as child:
        assert child.stdout is not None
        assert child.stdout.readline().startswith("passed        push ")
        time.sleep(0.3)
        child.send_signal(signal.SIGINT)
        out, err = child.communicate(timeout=120)
        assert child.returncode == 130
    assert err == (
        "Interrupted; 1 of 2 cases are done and kept in results: the same command with --resume "
        "goes on.\n"
    )
    assert "suite: 1 passed, 1 interrupted" in out
    assert (folder / "results" / "push.h5").exists()
    journal = (folder / "results" / "suite.batch.jsonl").read_text(encoding="utf-8")
    assert [json.loads(line).get("case") for line in journal.splitlines()] == [None, "push"]


def interrupt(*_: Any, **__: Any) -> Any:
    raise KeyboardInterrupt


@pytest.mark.parametrize(
    ("where", "said"),
    [
        ("batch.running.gathered", "no case had begun, and nothing is written"),
        ("batch.judging.holding.prepare", "none of 2 cases was done: the same command begins anew"),
        ("batch.reports.report.Report.write_html", "all 2 cases are done and kept in results"),
        ("plots.sweep.draw_all", "all 2 cases are done and kept in results"),
        ("cli.cases.print_summary", "all 2 cases are done and kept in results"),
    ],
)
def test_ctrl_c_says_at_any_time_what_is_kept(
    where: str, said: str, quito_: Callable[..., Ran], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before the first case, and while reports and pictures are made of the cases."""
    reports = ["--html", "page.html", "--sweeps", "--baseline", "base.yaml", "--update-baseline"]
    with monkeypatch.context() as patched:
        patched.setattr(f"quito_cli.{where}", interrupt)
        ran = quito_("suite.yaml", *reports)
    assert ran.code == 130
    assert f"Interrupted; {said}" in ran.err
    if "all 2" in said:
        assert "the same command with --resume writes the rest" in ran.err
        again = quito_("suite.yaml", *reports, "--resume")
        assert again.code == 3
        assert "Saved page.html, results/push-sweep.h5, results/push-sweep.png" in again.out


@pytest.mark.parametrize("where", ["batch.sweeps.sweeping.plan", "batch.sweeps.dataset.save"])
def test_ctrl_c_in_a_sweep(
    where: str, folder: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    arguments = ["sweep", "push.yaml", "--over", "way=1,2", "-j", "1"]
    with monkeypatch.context() as patched:
        patched.setattr(f"quito_cli.{where}", interrupt)
        assert run(arguments, patched) == 130
    said = "no case had begun" if "plan" in where else "all 2 cases are done and kept in results"
    assert f"Interrupted; {said}" in capfd.readouterr().err


def test_a_terminal_shows_the_cases_at_work(folder: Path) -> None:
    text = "cases: [{problem: van_der_pol, options: {steps: 400}}, push.yaml]"
    (folder / "suite.yaml").write_text(text, encoding="utf-8")
    command = [sys.executable, "-m", "quito_cli", "batch", "suite.yaml", "-j", "1"]
    shown = b"".join(on_a_terminal(command, folder)).decode()
    assert re.search(r"at work +van_der_pol   \d+ s", shown)
    assert "0 of 2 done, 0 not passed, 2 to go" in shown
    assert re.search(r"iteration \d+ +cost", shown)
    last = shown.rpartition("\x1b[J")[2]
    assert "suite: 2 passed" in last
    assert "at work" not in last, "nothing is left of the table"


def on_a_terminal(command: list[str], folder: Path) -> Iterator[bytes]:
    """Yield what a command prints on a terminal."""
    ours, theirs = pty.openpty()
    with subprocess.Popen(
        command, stdout=theirs, stderr=theirs, stdin=theirs, env=ENVIRONMENT, cwd=folder
    ) as child:
        os.close(theirs)
        while child.poll() is None or select.select([ours], [], [], 0)[0]:
            if select.select([ours], [], [], 0.1)[0]:
                try:
                    yield os.read(ours, 65536)
                except OSError:
                    break
    os.close(ours)


def test_from_python(folder: Path) -> None:
    first, second = quito.run_suite("suite.yaml", jobs=1, output=folder / "out", keep="failed")
    assert (first.ending, second.ending) == (Ending.PASSED, Ending.OUTSIDE)
    assert first.result is None
    assert second.result == folder / "out" / "push-way=2.h5"
    again = quito.run_suite("suite.yaml", output=folder / "out", keep="failed", resume=True)
    assert tuple(again) == (first, second)


def test_all_that_the_command_has_is_there_from_python(folder: Path) -> None:
    """The options, a choice of cases, a baseline in and out, every report, the sweeps."""
    base = folder / "base.yaml"
    first = quito.run_suite("suite.yaml", baseline=base, update_baseline=True, jobs=1)
    assert (first.recorded, first.exit_code, len(first)) == (True, 3, 2)
    held = quito.run_suite("suite.yaml", baseline=base, only=["way=1"], jobs=1)
    assert [one.case.name for one in held] == ["push[way=1]"]
    assert held.exit_code == 0, "what was left out is not missing"
    assert {row.verdict.value for row in held.differences} == {"same"}

    first.write_junit(folder / "out" / "j.xml")
    first.write_markdown(str(folder / "out" / "m.md"))
    first.write_html(folder / "out" / "p.html", plots="none")
    assert "<testsuites" in (folder / "out" / "j.xml").read_text(encoding="utf-8")
    assert "cost is 4, expected 1" in (folder / "out" / "m.md").read_text(encoding="utf-8")
    assert "cost is 4, expected 1" in (folder / "out" / "p.html").read_text(encoding="utf-8")
    assert first.as_dictionary()["counts"] == {"passed": 1, "outside": 1}
    with pytest.raises(UsageError, match="plots: expected failed, all or none"):
        first.write_html(folder / "p.html", plots="some")

    (swept,) = first.sweeps()
    assert [axis.values for axis in swept.sweep.axes] == [(1, 2)]
    assert swept.solved == (True, True)
    saved = first.save_sweeps(folder / "out")
    assert [path.name for path in saved] == [
        "push-sweep.h5",
        "push-sweep.png",
        "push-sweep-trajectories.png",
    ]


def test_problems_with_options_from_python(folder: Path) -> None:
    shown: list[str] = []

    class Watching(Nobody):
        def show(self, finished: Finished) -> None:
            shown.append(finished.case.name)

    (one,) = quito.run_suite(
        ["push.yaml"], options={"steps": 7}, constants={"way": 2}, jobs=1, watcher=Watching()
    )
    assert shown == ["push"]
    assert one.result is not None
    assert quito.Solution.load(one.result).options["steps"] == 7
    assert one.figures["cost"] == pytest.approx(4)
    stopped = quito.run_suite("suite.yaml", jobs=1, fail_fast=True, only=["2"])
    assert (len(stopped), stopped.interrupted) == (1, False)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"jobs": 0}, "jobs: a number from 1 to 1000"),
        ({"jobs": 10_000}, "jobs: a number from 1 to 1000"),
        ({"jobs": 1, "cluster": "tcp://a:1"}, "a cluster has its own"),
        ({"keep": "some"}, "keep: expected all, failed or none"),
        ({"update_baseline": True}, "update_baseline needs a baseline"),
        ({"baseline": "gone.yaml"}, "gone.yaml"),
        ({"options": {"steps": 3}}, "options and constants are for problems"),
        ({"time_limit": math.nan}, "time-limit: a number of seconds above 0"),
    ],
)
def test_what_python_asks_for_is_checked(given: Any, said: str, folder: Path) -> None:
    with pytest.raises(UsageError, match=re.escape(said)):
        quito.run_suite("suite.yaml", **given)
    assert not (folder / "results").exists()
