"""The command line: what each command prints, writes and exits with."""

from __future__ import annotations

import contextlib
import io
import os
import pty
import re
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import pytest
from documents import COMMANDS, PUSH, Ran
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from processor import within

import quito_cli as quito
from quito_cli.cli.app import main
from quito_cli.errors import QuitoError
from quito_cli.problem.build import build
from quito_cli.problem.library import bundled
from quito_cli.problem.load import load_text
from quito_cli.solvers.outcome import Status

ROOT = Path(__file__).parent.parent
ACCEPTED = ROOT / "tests" / "problems" / "accepted"
BUNDLED = sorted(bundled())
MAGIC = {"png": b"\x89PNG\r\n\x1a\n", "pdf": b"%PDF-", "svg": b"<?xml"}
HEAVY = ("casadi", "h5py", "matplotlib", "numpy", "pydantic", "yaml")
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}

TOO_FAR = PUSH.replace("final: 1}}", "final: 5}}")
"""With |u| <= 3, x ends at 3 at most: 2 are missing."""


Quito = Callable[..., Ran]


@pytest.fixture
def quito_(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], tmp_path: Path
) -> Quito:
    """Run a command in this process, in an empty folder."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments: str | Path) -> Ran:
        monkeypatch.setattr(sys, "argv", ["quito", *map(str, arguments)])
        capfd.readouterr()
        code = 0
        try:
            main()
        except SystemExit as left:
            code = left.code if isinstance(left.code, int) else int(left.code is not None)
        printed = capfd.readouterr()
        assert "Traceback" not in printed.err
        return Ran(code, printed.out, printed.err)

    return run


def process(*arguments: str, folder: Path, **environment: str) -> Ran:
    """Run a command in a process of its own, its output in pipes."""
    done = subprocess.run(
        [sys.executable, "-W", "error", "-m", "quito_cli", *arguments],
        cwd=folder,
        env={**ENVIRONMENT, **environment},
        capture_output=True,
        encoding="utf-8",
        timeout=60,
        check=False,
    )
    return Ran(done.returncode, done.stdout, done.stderr)


def written(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}


def problem(folder: Path, text: str = PUSH, name: str = "push.yaml") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


# solve: files and figures


def test_the_command_of_the_readme(quito_: Quito, tmp_path: Path) -> None:
    ran = quito_("solve", ROOT / "problems" / "alychan.yaml", "-N", "100", "--variance", "2")
    assert (ran.code, ran.err) == (0, "")
    assert written(tmp_path) == {"results/alychan.h5", "results/alychan.png"}
    solution = quito.Solution.load(tmp_path / "results" / "alychan.h5")
    assert solution.success
    assert solution.cost == pytest.approx(0, abs=1e-8)
    lines = ran.out.splitlines()
    assert lines[0] == "Aly-Chan problem, singular on the whole horizon"
    assert lines[1].startswith("Solved.")
    for word in ("cost", "iterations", "residuals", "re-simulated", "violation", "ringing"):
        assert re.search(rf"^  {word}", ran.out, re.MULTILINE), word
    assert lines[-1] == "Saved results/alychan.h5 and results/alychan.png"
    assert all(line == line.rstrip() for line in lines)


OPTIONS: list[tuple[tuple[str, ...], str, Any]] = [
    (("-N", "7"), "steps", 7),
    (("--steps", "7"), "steps", 7),
    (("--variance", "1.5"), "variance", 1.5),
    *(
        (("--generating-function", given), "generating_function", name)
        for i, name in enumerate(
            ("gaussian", "laguerre4", "laguerre6", "hermite10", "trigonometric", "sech"), start=1
        )
        for given in (name, str(i))
    ),
    (("--as-printed",), "normalised", False),
    (("--normalised",), "normalised", True),
    (("--control", "piecewise-constant"), "control", "piecewise-constant"),
    (("--control", "piecewise-linear"), "control", "piecewise-linear"),
    (("--control", "quasi-interpolant"), "control", "quasi-interpolant"),
    (("--discretization", "euler"), "discretization", "euler"),
    (("--discretization", "lgr"), "discretization", "lgr"),
    (("--discretization", "lgr", "--degree", "3"), "degree", 3),
    (("--substeps", "1"), "substeps", 1),
    (("--mesh", "uniform"), "mesh", "uniform"),
    (("--mesh", "adaptive"), "mesh", "adaptive"),
    (("--mesh", "adaptive", "--mesh-tolerance", "1e-2"), "mesh_tolerance", 1e-2),
    (("--mesh", "adaptive", "--mesh-iterations", "2"), "mesh_iterations", 2),
    (("--mesh", "adaptive", "--mesh-limit", "9"), "mesh_limit", 9),
    (("--mesh", "adaptive", "--mesh-steps", "5"), "mesh_steps", 5),
    (("--no-polish",), "polish", False),
    (("--tolerance", "1e-6"), "tolerance", 1e-6),
    (("--max-iterations", "77"), "max_iterations", 77),
    (("--objective-scale", "3"), "objective_scale", 3.0),
    (("--solver", "piqp"), "solver", "piqp"),
    (("--solver", "uno"), "solver", "uno"),
    (
        ("--solver-option", "mu_strategy=adaptive", "--solver-option", "mu_init=1e-3"),
        "solver_options",
        {"mu_strategy": "adaptive", "mu_init": 1e-3},
    ),
]


@pytest.mark.parametrize(("arguments", "name", "value"), OPTIONS)
def test_option(
    quito_: Quito, tmp_path: Path, arguments: tuple[str, ...], name: str, value: Any
) -> None:
    few = () if name in ("steps", "mesh_steps") else ("-N", "6")
    ran = quito_("solve", problem(tmp_path), *few, *arguments, "--no-plot", "--json")
    assert (ran.code, ran.err) == (0, "")
    assert ran.json["options"][name] == value
    solution = quito.Solution.load(tmp_path / "results" / "push.h5")
    assert solution.options[name] == value
    assert solution.cost == pytest.approx(1, abs=1e-6)


def test_options_reach_the_solution(quito_: Quito, tmp_path: Path) -> None:
    file = problem(tmp_path)
    quito_("solve", file, "-N", "9", "--generating-function", "5", "--variance", "1.5", "-q")
    solution = quito.Solution.load(tmp_path / "results" / "push.h5")
    assert len(solution.times) == 10
    expected = {"generating_function": "trigonometric", "variance": 1.5, "normalised": True}
    assert solution.basis.attributes == expected
    quito_("solve", file, "-N", "9", "--control", "piecewise-constant", "-q")
    solution = quito.Solution.load(tmp_path / "results" / "push.h5")
    assert solution.basis.attributes["generating_function"] == "box"


def test_solver_options_reach_the_solver(quito_: Quito, tmp_path: Path) -> None:
    ran = quito_("solve", problem(tmp_path), "--solver-option", "max_iter=1", "--json", "-N", "6")
    assert (ran.code, ran.json["status"], ran.json["iterations"]) == (1, "iteration_limit", 1)


@pytest.mark.parametrize("picture", MAGIC)
def test_formats(quito_: Quito, tmp_path: Path, picture: str) -> None:
    ran = quito_("solve", problem(tmp_path), "-N", "5", "--format", picture)
    assert ran.code == 0
    assert written(tmp_path) == {"push.yaml", "results/push.h5", f"results/push.{picture}"}
    drawn = (tmp_path / "results" / f"push.{picture}").read_bytes()
    assert drawn.startswith(MAGIC[picture])
    assert len(drawn) > 5000


def test_output_folder_is_made_with_its_parents(quito_: Quito, tmp_path: Path) -> None:
    for folder in ("a/b", str(tmp_path / "c")):
        ran = quito_("solve", problem(tmp_path), "-N", "5", "-o", folder, "--no-plot")
        assert ran.code == 0
        assert ran.out.endswith(f"Saved {folder}/push.h5\n")
    assert written(tmp_path) == {"push.yaml", "a/b/push.h5", "c/push.h5"}


def test_a_bundled_problem_by_name(quito_: Quito, tmp_path: Path) -> None:
    ran = quito_("solve", "bang_bang", "-N", "8", "--no-plot", "--json")
    assert (ran.code, ran.json["problem"]) == (0, "bang_bang")
    assert written(tmp_path) == {"results/bang_bang.h5"}


def test_a_file_here_comes_before_a_bundled_problem(quito_: Quito, tmp_path: Path) -> None:
    problem(tmp_path, name="alychan")
    assert quito_("solve", "alychan", "-N", "5", "--json").json["cost"] == pytest.approx(1)


# solve: what is printed


def test_json_is_one_object_and_nothing_else(quito_: Quito, tmp_path: Path) -> None:
    ran = quito_("solve", problem(tmp_path), "-N", "8", "--json", "--verbose")
    assert (ran.code, ran.err) == (0, "")
    assert ran.out.count("\n") == 1
    found = ran.json
    assert set(found) >= {
        *("problem", "status", "success", "cost", "iterations", "steps", "build_seconds"),
        *("solve_seconds", "maximum_violation", "resimulation_gap", "total_variation"),
        *("warnings", "hdf5", "plot"),
    }
    assert (found["problem"], found["status"], found["success"]) == ("push", "solved", True)
    assert found["cost"] == pytest.approx(1)
    assert found["steps"] == 8
    assert found["total_variation"] == {"u": pytest.approx(0, abs=1e-3)}
    assert found["maximum_violation"] <= 1e-8
    assert found["resimulation_gap"] <= 1e-8
    assert found["warnings"] == []
    assert (found["hdf5"], found["plot"]) == ("results/push.h5", "results/push.png")
    assert min(found["build_seconds"], found["solve_seconds"], found["iterations"]) > 0


def test_json_has_no_plot_where_none_is_drawn(quito_: Quito, tmp_path: Path) -> None:
    ran = quito_("solve", problem(tmp_path), "-N", "5", "--json", "--no-plot")
    assert ran.json["plot"] is None


def test_json_stays_json_where_nothing_is_finite(quito_: Quito, tmp_path: Path) -> None:
    ran = quito_(
        "solve", problem(tmp_path, PUSH.replace("lagrange: u^2", "lagrange: log(x - 9)")), "--json"
    )
    assert ran.code == 1
    assert "NaN" not in ran.out
    assert ran.json["cost"] is None
    assert not ran.json["success"]


def test_quiet_prints_nothing(quito_: Quito, tmp_path: Path) -> None:
    assert quito_("solve", problem(tmp_path), "-N", "5", "--quiet") == Ran(0, "", "")
    assert written(tmp_path) == {"push.yaml", "results/push.h5", "results/push.png"}
    assert quito_("solve", problem(tmp_path, TOO_FAR), "-N", "5", "-q") == Ran(1, "", "")


def test_verbose_prints_iterations_conditions_and_options(quito_: Quito, tmp_path: Path) -> None:
    ran = quito_("solve", problem(tmp_path), "-N", "5", "--verbose", "--no-plot")
    steps = [re.match(r"iteration +(\d+)   cost", line) for line in ran.err.splitlines()]
    assert [int(step[1]) for step in steps if step] == list(range(len(steps)))
    assert len(steps) > 2
    for condition in ("u >= -3", "u <= 3", "initial(x) = 0", "final(x) = 1"):
        assert condition in ran.out
    assert re.search(r"^  generating-function +gaussian$", ran.out, re.MULTILINE)
    assert re.search(r"^  solver +ipopt", ran.out, re.MULTILINE)


def test_the_reference_is_compared_with(quito_: Quito, tmp_path: Path) -> None:
    text = PUSH + "reference: {cost: 1}\n"
    ran = quito_("solve", problem(tmp_path, text), "-N", "5", "--no-plot")
    assert re.search(r"^  cost +1(\.0+1|), reference 1, difference [+-]", ran.out, re.MULTILINE)


@pytest.mark.parametrize("encoding", ["ascii", "latin-1"])
def test_narrow_terminals_are_no_crash(tmp_path: Path, encoding: str) -> None:
    file = ACCEPTED / "text_of_all_kinds.yaml"
    narrow = {"PYTHONIOENCODING": encoding, "LC_ALL": "C"}
    ran = subprocess.run(
        [sys.executable, "-m", "quito_cli", "solve", str(file), "-N", "5", "--no-plot"],
        cwd=tmp_path,
        env={**ENVIRONMENT, **narrow},
        capture_output=True,
        timeout=60,
        check=False,
    )
    assert ran.returncode == 0
    assert b"Murmeltier: gr" in ran.stdout
    assert ran.stderr == b""


def test_letters_that_no_font_has_are_no_warning(tmp_path: Path) -> None:
    file = ACCEPTED / "text_of_all_kinds.yaml"
    assert process("solve", str(file), "-N", "5", "-q", folder=tmp_path) == Ran(0, "", "")
    assert written(tmp_path) == {"results/text_of_all_kinds.h5", "results/text_of_all_kinds.png"}


# --set


def test_set_a_constant(quito_: Quito, tmp_path: Path) -> None:
    """J = 4/(9 l) for the Bryson-Denham problem, in a reference that holds for every l."""
    ran = quito_("solve", "bryson_denham", "--set", "l=1/8", "-N", "40", "--no-plot")
    assert ran.code == 0
    assert re.search(r"^  cost .* reference 3\.55555555", ran.out, re.MULTILINE)
    assert re.search(r"^  set +l = 1/8$", ran.out, re.MULTILINE)
    solution = quito.Solution.load(tmp_path / "results" / "bryson_denham.h5")
    assert solution.cost == pytest.approx(32 / 9, rel=1e-2)
    assert solution.origin.changes == (("l", "1/8"),)


def test_set_drops_a_reference_that_does_not_follow(quito_: Quito) -> None:
    whole = quito_("solve", "van_der_pol", "-N", "5", "--json", "--no-plot").json
    ran = quito_("solve", "van_der_pol", "-N", "5", "--set", "mu=0.5", "--json", "--no-plot").json
    assert whole["reference_cost"] == pytest.approx(0.7576179286593919)
    assert ran["reference_cost"] is None
    assert abs(ran["cost"] - whole["cost"]) > 0.01


def test_set_a_value_by_its_path(quito_: Quito, tmp_path: Path) -> None:
    """From 0 to 2 in a unit of time costs 4, from 1/2 to 2 in two of them 9/8."""
    file = problem(tmp_path)
    ran = quito_("solve", file, "-N", "5", "--set", "states.x.final=2", "--json", "--no-plot")
    assert ran.json["cost"] == pytest.approx(4)
    more = ("--set", "time.final=4/2", "--set", "states.x.initial=0.5")
    ran = quito_(
        "solve", file, "-N", "5", "--set", "states.x.final=2", *more, "--json", "--no-plot"
    )
    assert ran.json["cost"] == pytest.approx(9 / 8)


REFUSED_SETTINGS = {
    "nu=1": "did you mean 'mu'?",
    "mu": "write NAME=VALUE",
    "mu=": "write NAME=VALUE",
    "=1": "write NAME=VALUE",
    "states.x9.upper=1": "there is no 'states.x9'; did you mean 'x1'?",
    "options.steps=4": "only time, states, controls, parameters, tables, constants can be set",
    "states.x1.initial.lower=1": "'states.x1.initial' is a single value",
    "mu=wrong": "unknown name 'wrong'",
    "mu=1e999": "not",
    "mu=__import__('os')": "'__import__' is no name",
    "states.x1.uper=1": "unknown key 'uper'; did you mean 'upper'?",
    "time.final=-1": "the final time -1 is not after the initial time 0",
    "controls.u.lower=2": "the upper bound 1 is below the lower bound 2",
}


@pytest.mark.parametrize("setting", REFUSED_SETTINGS)
def test_refused_settings(quito_: Quito, tmp_path: Path, setting: str) -> None:
    ran = quito_("solve", "van_der_pol", "--set", setting)
    assert (ran.code, ran.out) == (2, "")
    assert REFUSED_SETTINGS[setting] in ran.err
    assert setting.partition("=")[0] in ran.err
    assert written(tmp_path) == set()


# Precedence


def test_the_command_line_wins_over_the_file_and_the_file_over_defaults(
    quito_: Quito, tmp_path: Path
) -> None:
    file = ACCEPTED / "options_of_a_file.yaml"
    ran = quito_("solve", file, "--json", "--no-plot")
    asked = {
        "steps": 12,
        "variance": 3.0,
        "generating_function": "laguerre6",
        "discretization": "euler",
        "substeps": 1,
        "tolerance": 1e-8,
        "max_iterations": 50,
        "solver_options": {"mu_strategy": "adaptive", "mu_init": 1e-2, "acceptable_iter": 0},
    }
    unasked = {"path_points": None, "guess": None, "objective_scale": None}
    usual = {"normalised": True, "control": "quasi-interpolant"}
    usual |= {"solver": "ipopt", "warm_start": False, "mesh": "uniform", "polish": False}
    assert ran.json["options"] == unasked | asked | usual
    given = ("-N", "6", "--discretization", "rk4", "--solver-option", "mu_init=0.5")
    ran = quito_("solve", file, *given, "--json", "--no-plot")
    changed = {"steps": 6, "discretization": "rk4"}
    merged = {"mu_strategy": "adaptive", "mu_init": 0.5, "acceptable_iter": 0}
    assert {key: ran.json["options"][key] for key in asked} == asked | changed | {
        "solver_options": merged
    }
    ran = quito_("solve", problem(tmp_path), "--json", "--no-plot")
    defaults = {
        "steps": 100,
        "variance": 2.0,
        "generating_function": "gaussian",
        "normalised": True,
        "control": "quasi-interpolant",
        "discretization": "rk4",
        "substeps": 2,
        "tolerance": 1e-9,
    }
    assert {key: ran.json["options"][key] for key in defaults} == defaults


def test_a_classical_control_drops_the_variance_of_the_file_but_not_one_given(
    quito_: Quito,
) -> None:
    file = ACCEPTED / "options_of_a_file.yaml"
    chosen = ("--control", "piecewise-constant", "--discretization", "rk4", "--no-plot")
    assert quito_("solve", file, *chosen, "--json").json["success"]
    ran = quito_("solve", file, *chosen, "--variance", "2")
    assert (ran.code, ran.out) == (2, "")
    assert "variance" in ran.err
    assert "piecewise-constant" in ran.err


# Other commands


def test_list(quito_: Quito) -> None:
    ran = quito_("list")
    assert (ran.code, ran.err) == (0, "")
    head, *rows = ran.out.splitlines()
    names = ["name", "states", "controls", "constraints", "singular", "known optimum", "title"]
    assert re.split(" {2,}", head) == names
    assert [row.split()[0] for row in rows] == BUNDLED
    assert any("Van der Pol oscillator with bounded control" in row for row in rows)


def test_list_as_json(quito_: Quito) -> None:
    ran = quito_("list", "--json")
    assert ran.out.count("\n") == 1
    rows = {row["name"]: row for row in ran.json["problems"]}
    assert sorted(rows) == BUNDLED
    assert rows["alychan"]["states"] == 3
    assert rows["alychan"]["controls"] == 1
    assert rows["alychan"]["title"] == "Aly-Chan problem, singular on the whole horizon"


def test_show_a_result_as_it_was_printed(quito_: Quito, tmp_path: Path) -> None:
    solved = quito_("solve", problem(tmp_path), "-N", "6", "--verbose", "--no-plot")
    shown = quito_("show", "results/push.h5")
    assert shown.code == 0
    printed = solved.out[: solved.out.index("\n\nSaved")]
    assert sorted(shown.out.splitlines()) == sorted(printed.splitlines())


def test_show_a_result_as_json(quito_: Quito, tmp_path: Path) -> None:
    solved = quito_("solve", problem(tmp_path), "-N", "6", "--json").json
    shown = quito_("show", "results/push.h5", "--json").json
    assert shown == solved | {"plot": None}


def test_show_tells_a_result_by_its_content(quito_: Quito, tmp_path: Path) -> None:
    quito_("solve", problem(tmp_path), "-N", "6", "-q", "--no-plot")
    shutil.move(tmp_path / "results" / "push.h5", tmp_path / "kept.yaml")
    assert quito_("show", "kept.yaml").out.startswith("Push to one\nSolved.")


def test_show_a_result_that_is_no_success(quito_: Quito, tmp_path: Path) -> None:
    quito_("solve", problem(tmp_path, TOO_FAR), "-N", "6", "-q", "--no-plot")
    ran = quito_("show", "results/push.h5")
    assert ran.code == 0
    assert "\nNot solved." in ran.out


def test_show_a_problem(quito_: Quito, tmp_path: Path) -> None:
    ran = quito_("show", problem(tmp_path))
    assert (ran.code, ran.err) == (0, "")
    assert ran.out.startswith("Push to one\n\nminimise   ∫₀¹ u² dt    (over u)\n")
    assert quito_("show", "push.yaml", "--yaml").out == PUSH
    ran = quito_("show", "alychan", "--json")
    assert ran.json["states"]["x2"] == {"initial": 1.0}
    assert ran.json["time"]["final"] == "pi/2"


def test_show_nothing_that_is_there(quito_: Quito) -> None:
    ran = quito_("show", "results/bresan.h5")
    assert (ran.code, ran.out, ran.err) == (2, "", "quito: there is no file results/bresan.h5\n")
    ran = quito_("show", "bresan")
    assert ran.code == 2
    assert "did you mean 'bressan'?" in ran.err


@pytest.mark.parametrize(
    ("flags", "name"),
    [
        ((), "push.png"),
        (("--states",), "push-states.png"),
        (("--controls",), "push-controls.png"),
        (("--costates",), "push-costates.png"),
        (("--mesh",), "push-mesh.png"),
        (("--mesh", "--costates"), "push-costates-mesh.png"),
        (("--format", "svg", "--states", "--controls"), "push-states-controls.svg"),
        (("--format", "pdf", "-o", "elsewhere"), "../elsewhere/push.pdf"),
    ],
)
def test_plot(quito_: Quito, tmp_path: Path, flags: tuple[str, ...], name: str) -> None:
    quito_("solve", problem(tmp_path), "-N", "6", "-q", "--no-plot")
    before = written(tmp_path)
    ran = quito_("plot", "results/push.h5", *flags)
    assert (ran.code, ran.err) == (0, "")
    drawn = tmp_path / "results" / name
    (new,) = written(tmp_path) - before
    assert tmp_path / new == drawn.resolve()
    assert ran.out == f"Saved {new}\n"
    assert drawn.read_bytes().startswith(MAGIC[drawn.suffix[1:]])
    assert quito_("plot", "results/push.h5", *flags, "--quiet") == Ran(0, "", "")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("push.yaml",), "push.yaml is a problem file: solve it first, then plot results/push.h5"),
        (
            ("push",),
            "there is no file push; push.yaml is a problem file: "
            "solve it first, then plot results/push.h5",
        ),
        (("a.h5", "--format", "jpg"), "format: expected png, pdf or svg, got 'jpg'"),
        (
            ("a.h5", "-o", "b.png"),
            "-o names a folder, and b.png looks like a file; "
            "the files in it are named after the problem",
        ),
    ],
)
def test_plot_of_what_is_no_result(
    quito_: Quito, tmp_path: Path, arguments: tuple[str, ...], said: str
) -> None:
    problem(tmp_path)
    assert quito_("plot", *arguments) == Ran(2, "", f"quito: {said}\n")
    assert written(tmp_path) == {"push.yaml"}


def test_a_folder_that_is_named_like_a_file(quito_: Quito, tmp_path: Path) -> None:
    (tmp_path / "runs.h5").mkdir()
    ran = quito_("solve", problem(tmp_path), "-N", "5", "-q", "--no-plot", "-o", "runs.h5")
    assert ran == Ran(0, "", "")
    assert written(tmp_path) == {"push.yaml", "runs.h5/push.h5"}


def test_plot_where_there_is_nothing_to_draw(quito_: Quito) -> None:
    quito_("solve", ACCEPTED / "no_controls.yaml", "-N", "6", "-q", "--no-plot")
    ran = quito_("plot", "results/no_controls.h5", "--controls")
    assert (ran.code, ran.out) == (2, "")
    assert ran.err == "quito: the problem has no controls to draw\n"


def test_schema(quito_: Quito) -> None:
    ran = quito_("schema")
    assert (ran.code, ran.err) == (0, "")
    assert ran.out == (ROOT / "schemas" / "problem.schema.json").read_text(encoding="utf-8")


def test_version(quito_: Quito) -> None:
    version = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert quito_("--version") == Ran(0, f"quito {version['version']}\n", "")
    assert quito.__version__ == version["version"]


def test_as_a_module(tmp_path: Path) -> None:
    problem(tmp_path)
    ran = process("solve", "push.yaml", "-N", "5", "--json", folder=tmp_path)
    assert (ran.code, ran.err) == (0, "")
    assert ran.json["cost"] == pytest.approx(1)
    assert written(tmp_path) == {"push.yaml", "results/push.h5", "results/push.png"}


# Help


def loads(folder: Path, *arguments: str) -> tuple[set[str], str]:
    """Return which modules a command has loaded in a process of its own, and what it printed."""
    code = (
        "import sys\n"
        "from quito_cli.cli.app import main\n"
        "try:\n    main()\n"
        "except SystemExit as left:\n    assert not left.code\n"
        "print(*sys.modules, file=sys.stderr)\n"
    )
    ran = subprocess.run(
        [sys.executable, "-c", code, *arguments],
        cwd=folder,
        env=ENVIRONMENT,
        capture_output=True,
        encoding="utf-8",
        timeout=60,
        check=True,
    )
    return set(ran.stderr.split()), ran.stdout


@pytest.mark.parametrize("command", ["", *COMMANDS])
def test_help_says_what_there_is_and_loads_nothing_heavy(command: str, tmp_path: Path) -> None:
    """Recent typer reads its own types by pydantic to help with a command; quito itself does not.

    What of quito is loaded then must not be what needs pydantic.
    """
    arguments = [command] if command else []
    loaded, printed = loads(tmp_path, *arguments, "--help")
    assert "quito_cli.cli.app" in loaded
    allowed = {"pydantic"} if command else set()
    assert loaded.isdisjoint(set(HEAVY) - allowed)
    assert not any(name.startswith("quito_cli.problem") for name in loaded)
    if command:
        assert f"quito_cli {command}" in printed or f"-c {command}" in printed
    else:
        assert all(re.search(rf"^  {name} ", printed, re.MULTILINE) for name in COMMANDS)
        assert "130 interrupted" in " ".join(printed.split())


def test_a_short_solve_loads_what_it_takes(tmp_path: Path) -> None:
    """Not the way to answers of other kinds, nor parts of numpy that take as long as the solve."""
    loaded, _ = loads(tmp_path, "solve", "alychan", "--no-plot")
    assert {"casadi", "h5py", "quito_cli.optimality.certificate.certificate"} <= loaded
    others = {
        *("matplotlib", "scipy", "numpy.ma", "numpy.polynomial"),
        *("quito_cli.refinement.refine", "quito_cli.transcription.collocation"),
        *("quito_cli.optimality.looking.polished", "quito_cli.optimality.certificate.lesser"),
        *("quito_cli.solvers.child", "quito_cli.solvers.scipy"),
    }
    assert loaded.isdisjoint(others), loaded & others


def test_a_command_is_known_wherever_it_stands(quito_: Quito) -> None:
    """Alone where it comes first; what comes first and is none is told which there are."""
    assert "solve" not in quito_("check", "--help").out.split("Options")[0]
    assert quito_("--version").code == 0
    wrong = quito_("sovle", "alychan")
    assert wrong.code == 2
    assert "'solve'" in wrong.err


def test_help_names_every_option_with_its_default(quito_: Quito) -> None:
    ran = quito_("solve", "--help")
    text = " ".join(ran.out.split()).replace("quasi- ", "quasi-")
    for option in (
        *("--steps", "--variance", "--generating-function", "--discretization", "--substeps"),
        *(
            "--degree",
            "--control",
            "--solver-option",
            "--tolerance",
            "--max-iterations",
            "--set",
            "--output",
        ),
        *("--mesh", "--mesh-steps", "--mesh-tolerance", "--mesh-iterations", "--mesh-limit"),
        *("--polish", "--no-polish", "--explain"),
        *("--format", "--no-plot", "--json", "--quiet", "--verbose"),
    ):
        assert option in text
    for default in (
        *("uniform", "0.001", "8", "twice those to start from"),
        *("100", "2", "gaussian", "quasi-interpolant", "rk4", "1e-09", "1000", "results"),
    ):
        assert f"[default: {default}]" in text


def test_without_a_command_there_is_help(quito_: Quito) -> None:
    ran = quito_()
    assert ran.code == 2
    assert "Commands:" in ran.out + ran.err


@pytest.mark.parametrize(
    "arguments",
    [
        ("frobnicate",),
        ("solve",),
        ("solve", "alychan", "--stepps", "4"),
        ("solve", "alychan", "-N", "many"),
        ("plot",),
        ("show",),
        ("new",),
    ],
)
def test_a_wrong_command_line(quito_: Quito, tmp_path: Path, arguments: tuple[str, ...]) -> None:
    ran = quito_(*arguments)
    assert (ran.code, ran.out) == (2, "")
    assert "Error:" in ran.err
    assert written(tmp_path) == set()


REFUSED_OPTIONS = {
    ("-N", "0"): "steps: expected at least 1, got 0",
    ("--format", "jpg"): "format: expected png, pdf or svg, got 'jpg'",
    ("--path-points", "node"): (
        "path-points: expected nodes or substeps, got 'node'; did you mean 'nodes'?"
    ),
    ("-o", "figs/a.png"): (
        "-o names a folder, and figs/a.png looks like a file; the files in it are named after the "
        "problem"
    ),
    ("-o", "res.h5"): (
        "-o names a folder, and res.h5 looks like a file; the files in it are named after the "
        "problem"
    ),
    ("--guess", "bang_bang"): (
        "there is no file bang_bang; that is a bundled problem: solve it first, then start from "
        "results/bang_bang.h5"
    ),
    ("-N", "-5"): "steps: expected at least 1, got -5",
    ("--substeps", "0"): "substeps: expected at least 1, got 0",
    ("--discretization", "lgr", "--degree", "0"): "degree: expected at least 1, got 0",
    ("--degree", "3"): "degree belongs to collocation: add --discretization lgr",
    ("--discretization", "lgr", "--substeps", "3"): "substeps means nothing to lgr",
    ("--variance", "-1"): "variance: expected a number above 0, got -1",
    ("--variance", "nan"): "variance: expected a finite number, got nan",
    ("--variance", "0.01"): "variance 0.01 is too small for the generating function gaussian",
    ("--mesh", "moving"): "mesh: expected uniform or adaptive, got 'moving'",
    ("--mesh", "adaptve"): "did you mean 'adaptive'?",
    ("--mesh-tolerance", "1e-3"): "mesh-tolerance belongs to adaptive meshes: add --mesh adaptive",
    ("--mesh", "adaptive", "--mesh-tolerance", "0"): (
        "mesh-tolerance: expected at least 0.00001, got 0.0"
    ),
    ("--mesh", "adaptive", "--mesh-iterations", "100"): (
        "mesh-iterations: expected at most 30, got 100"
    ),
    ("--mesh", "adaptive", "--mesh-limit", "3"): "mesh-limit: expected at least 4, got 3",
    ("--mesh", "adaptive", "--mesh-limit", "4"): (
        "a mesh-limit of 4 cells does not hold the 5 that refinement starts from: raise it, or take"
    ),
    ("--mesh", "adaptive", "--mesh-steps", "50"): "steps and mesh-steps both say how many cells",
    ("--tolerance", "0"): "tolerance: expected a number above 0, got 0",
    ("--tolerance", "2"): "tolerance: expected at most 0.001, got 2",
    ("--max-iterations", "-1"): "max-iterations: expected at least 0, got -1",
    ("--objective-scale", "0"): "objective-scale: expected a number above 0, got 0",
    ("--generating-function", "gausian"): "did you mean 'gaussian'?",
    ("--generating-function", "7"): "generating-function: expected gaussian, laguerre4, "
    "laguerre6, hermite10, trigonometric or sech, or its number 1 to 6, got '7'",
    ("--generating-function", "²"): "or its number 1 to 6, got '²'",
    ("--control", "piecewise_constant"): "did you mean 'piecewise-constant'?",
    ("--control", "piecewise-linea"): "did you mean 'piecewise-linear'?",
    ("--discretization", "rk5"): "did you mean 'rk4'?",
    ("--solver-option", "tol"): "--solver-option 'tol': write NAME=VALUE",
    ("--solver-option", "no_such=1"): "no_such",
    ("--solver-option", "mu_strategy=fast"): "mu_strategy",
    ("--solver-option", "linear_solver=ma57"): "linear solver",
    ("--solver", "ipot"): "did you mean 'ipopt'?",
    ("--solver", "knitro"): "it needs an installation of Artelys Knitro with its licence",
    ("--solver", "qpoases"): "solves quadratic programs, and this is none: the dynamics of",
}


@pytest.mark.parametrize("arguments", REFUSED_OPTIONS)
def test_refused_options(quito_: Quito, tmp_path: Path, arguments: tuple[str, str]) -> None:
    steps = () if "-N" in arguments else ("-N", "5")
    ran = quito_("solve", "bang_bang", *steps, *arguments)
    assert (ran.code, ran.out) == (2, "")
    assert ran.err.startswith("quito: ")
    assert REFUSED_OPTIONS[arguments] in ran.err
    assert not (tmp_path / "results").exists()


# Exit codes


def test_an_infeasible_problem(quito_: Quito, tmp_path: Path) -> None:
    """The 2 that are missing are shared by the 10 cells: one of them misses 0.2 or more."""
    ran = quito_("solve", problem(tmp_path, TOO_FAR), "-N", "10")
    assert (ran.code, ran.err) == (1, "")
    assert ran.out.splitlines()[1].startswith("Not solved.")
    said = re.search(
        r"^  Most violated: the \w+ of x, by (?P<amount>\S+) at t = (?P<time>[\d.]+)\.$",
        ran.out,
        re.MULTILINE,
    )
    assert said
    assert 0.2 - 1e-3 <= float(said["amount"]) <= 2 + 1e-3
    assert 0 <= float(said["time"]) <= 1
    solution = quito.Solution.load(tmp_path / "results" / "push.h5")
    assert (solution.status, solution.success) == (Status.INFEASIBLE, False)
    assert (tmp_path / "results" / "push.png").is_file()
    ran = quito_("solve", problem(tmp_path, TOO_FAR), "-N", "10", "--json")
    assert (ran.code, ran.json["status"], ran.json["success"]) == (1, "infeasible", False)
    assert ran.json["diagnosis"]


def test_the_iteration_limit(quito_: Quito, tmp_path: Path) -> None:
    ran = quito_("solve", "van_der_pol", "-N", "20", "--max-iterations", "2", "--no-plot")
    assert (ran.code, ran.err) == (1, "")
    assert "Not solved. The iteration limit was reached" in ran.out
    assert "--max-iterations" in ran.out
    solution = quito.Solution.load(tmp_path / "results" / "van_der_pol.h5")
    assert solution.status is Status.ITERATION_LIMIT
    assert solution.statistics.iterations == 2


def test_an_expression_that_becomes_infinite_is_named(quito_: Quito, tmp_path: Path) -> None:
    text = PUSH.replace("lagrange: u^2", "lagrange: u^2 + log(x - 9)")
    ran = quito_("solve", problem(tmp_path, text), "-N", "5", "--no-plot")
    assert ran.code == 1
    assert "cost.lagrange is not finite at node 0, t = 0: x = 0" in ran.out


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("nothere.yaml", "there is no file nothere.yaml"),
        ("alychn", "did you mean 'alychan'?"),
        ("problems/van_der_pool.yaml", "did you mean 'van_der_pol'?"),
        (".", ". is a folder"),
        ("binary", "is not text in UTF-8"),
    ],
)
def test_no_such_problem(quito_: Quito, tmp_path: Path, given: str, said: str) -> None:
    (tmp_path / "binary").write_bytes(b"\xff\xfe\x00\x01")
    ran = quito_("solve", given)
    assert (ran.code, ran.out) == (2, "")
    assert ran.err.startswith("quito: ")
    assert said in ran.err
    assert len(ran.err.splitlines()) == 1
    assert written(tmp_path) == {"binary"}


@pytest.mark.parametrize("output", ["taken", "taken/below"])
def test_an_output_folder_that_cannot_be(quito_: Quito, tmp_path: Path, output: str) -> None:
    (tmp_path / "taken").write_text("a file")
    with within(10):  # it is said before the solve, not after
        ran = quito_("solve", "van_der_pol", "-N", "20000", "-o", output)
    assert (ran.code, ran.out) == (2, "")
    assert ran.err.startswith(f"quito: the output folder {output} cannot be ")
    assert (tmp_path / "taken").read_text() == "a file"


@pytest.mark.skipif(os.geteuid() == 0, reason="nothing is forbidden to root")
def test_an_output_folder_that_is_forbidden(quito_: Quito, tmp_path: Path) -> None:
    (tmp_path / "kept").mkdir(mode=0o500)
    ran = quito_("solve", "bang_bang", "-N", "5", "-o", "kept/new")
    assert (ran.code, ran.out) == (2, "")
    assert "cannot be written" in ran.err


def test_a_refused_run_leaves_results_as_they_are(quito_: Quito, tmp_path: Path) -> None:
    file = problem(tmp_path)
    quito_("solve", file, "-N", "5", "-q")
    kept = {name: (tmp_path / name).read_bytes() for name in written(tmp_path)}
    for arguments in (
        ("--set", "nothing=1"),
        ("--set", "states.x.initial=9", "--set", "states.x.upper=8"),
        ("--variance", "0.01"),
        ("--solver-option", "no_such=1"),
        ("--format", "jpg"),
    ):
        assert quito_("solve", file, *arguments).code == 2
    problem(tmp_path, PUSH.replace("u^2", "w^2"))
    assert quito_("solve", file).code == 2
    problem(tmp_path)
    assert {name: (tmp_path / name).read_bytes() for name in written(tmp_path)} == kept


def test_an_unforeseen_error_is_no_traceback(
    quito_: Quito, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object) -> None:
        raise RuntimeError("the very\nfoundations")

    monkeypatch.setattr("quito_cli.problem.load.load", broken)
    ran = quito_("solve", "alychan")
    assert (ran.code, ran.out) == (1, "")
    assert ran.err.startswith("quito: a bug in quito: RuntimeError: the very\n")
    monkeypatch.setenv("QUITO_DEBUG", "1")
    with pytest.raises(RuntimeError):
        quito_("solve", "alychan")


@pytest.mark.parametrize(
    ("error", "code", "said"),
    [(KeyboardInterrupt, 130, ""), (MemoryError, 1, "quito: out of memory")],
)
def test_what_ends_a_run_early(
    quito_: Quito,
    monkeypatch: pytest.MonkeyPatch,
    error: type[BaseException],
    code: int,
    said: str,
) -> None:
    def ended(*_: object) -> None:
        raise error

    monkeypatch.setattr("quito_cli.problem.load.load", ended)
    ran = quito_("solve", "alychan")
    assert (ran.code, ran.out) == (code, "")
    assert ran.err.startswith(said)


# On a terminal


@dataclass(frozen=True)
class Seen:
    """What a terminal and a pipe have seen of a run."""

    code: int
    terminal: str
    out: str


def on_a_terminal(
    *arguments: str, folder: Path, interrupt_at: str = "", stdout: bool = False
) -> Seen:
    """Run a command with stderr on a terminal; Ctrl-C as soon as a text is seen there."""
    mine, theirs = pty.openpty()
    with subprocess.Popen(
        [sys.executable, "-m", "quito_cli", *arguments],
        cwd=folder,
        env=ENVIRONMENT,
        stdin=theirs,
        stdout=theirs if stdout else subprocess.PIPE,
        stderr=theirs,
        start_new_session=True,
    ) as running:
        os.close(theirs)
        seen, sent, until = b"", not interrupt_at, time.monotonic() + 60
        while time.monotonic() < until:
            if not select.select([mine], [], [], 0.1)[0]:
                continue
            try:
                chunk = os.read(mine, 65536)
            except OSError:  # the other end is closed
                break
            seen += chunk
            if not sent and interrupt_at.encode() in seen:
                running.send_signal(signal.SIGINT)
                sent = True
            if not chunk:
                break
        out = running.stdout.read() if running.stdout else b""
        code = running.wait(30)
    os.close(mine)
    return Seen(code, seen.decode(), out.decode())


def test_compare_shows_which_method_is_solved(tmp_path: Path) -> None:
    few = ("-N", "12", "--no-plot", "--against", "piecewise-constant")
    seen = on_a_terminal("compare", "van_der_pol", *few, folder=tmp_path)
    assert seen.code == 0
    for method in ("quasi-interpolant:gaussian", "piecewise-constant"):
        assert f"{method}   iteration    0" in seen.terminal
        assert f"  {method} " in seen.out
    assert "iteration " not in seen.out
    lines = seen.terminal.replace("\x1b[K", "").split("\r")
    assert max(map(len, lines)) < 80, "longer ones would break, and stay on the terminal"
    assert "cost" in lines[1]


def test_compare_prints_what_there_is_when_interrupted(tmp_path: Path) -> None:
    many = ("-N", "3000", "--no-plot", "--against", "piecewise-constant,sech")
    seen = on_a_terminal(
        *("compare", "van_der_pol", *many),
        folder=tmp_path,
        interrupt_at="piecewise-constant   iteration    1",
    )
    assert seen.code == 130
    assert "piecewise-constant (not solved)" in seen.out
    assert "sech" not in seen.out
    assert "Interrupted: what was to follow was not solved." in seen.out


def test_progress_on_a_terminal_is_one_line_that_goes_away(tmp_path: Path) -> None:
    problem(tmp_path)
    seen = on_a_terminal("solve", "push.yaml", "-N", "5", "--no-plot", folder=tmp_path)
    assert seen.code == 0
    shown = seen.terminal.split("\r")
    assert shown[0] == ""
    assert [int(line.split()[1]) for line in shown[1:-1]] == list(range(len(shown) - 2))
    assert len(shown) > 3
    assert shown[-1] == "\x1b[K"
    assert "\n" not in seen.terminal
    assert "Push to one\nSolved." in seen.out


def test_no_progress_in_a_pipe_nor_where_quiet(tmp_path: Path) -> None:
    problem(tmp_path)
    piped = process("solve", "push.yaml", "-N", "5", "--no-plot", folder=tmp_path)
    assert (piped.code, piped.err) == (0, "")
    assert "\x1b" not in piped.out
    seen = on_a_terminal("solve", "push.yaml", "-N", "5", "--quiet", folder=tmp_path)
    assert seen == Seen(0, "", "")


def test_a_title_cannot_steer_the_terminal(tmp_path: Path) -> None:
    problem(tmp_path, PUSH.replace("title: Push to one", 'title: "a\\e]0;owned\\a b"'))
    seen = on_a_terminal("solve", "push.yaml", "-N", "5", "--no-plot", folder=tmp_path, stdout=True)
    assert "\x1b]" not in seen.terminal
    assert "\x07" not in seen.terminal


def test_ctrl_c_keeps_the_best_iterate(tmp_path: Path) -> None:
    seen = on_a_terminal(
        *("solve", "van_der_pol", "-N", "4000", "--no-plot"),
        folder=tmp_path,
        interrupt_at="iteration    2",
    )
    assert seen.code == 130
    assert "Not solved. Interrupted: this is the best iterate so far" in seen.out
    assert "Saved results/van_der_pol.h5" in seen.out
    assert "Traceback" not in seen.terminal + seen.out
    solution = quito.Solution.load(tmp_path / "results" / "van_der_pol.h5")
    assert (solution.status, solution.success) == (Status.INTERRUPTED, False)
    assert len(solution.times) == 4001
    assert written(tmp_path) == {"results/van_der_pol.h5"}


def test_ctrl_c_half_way_through_a_refinement_keeps_the_best_mesh(tmp_path: Path) -> None:
    seen = on_a_terminal(
        *("solve", "van_der_pol", "--mesh", "adaptive", "--no-plot"),
        folder=tmp_path,
        interrupt_at="mesh 3, ",
    )
    assert seen.code == 130
    assert "mesh 1, 100 cells  iteration    0   cost" in seen.terminal
    lines = seen.terminal.replace("\x1b[K", "").split("\r")
    assert max(len(line) for line in lines) < 80
    assert "Not solved. Interrupted" in seen.out
    assert "Warning: the mesh was not refined to the end" in seen.out
    solution = quito.Solution.load(tmp_path / "results" / "van_der_pol.h5")
    assert solution.status is Status.INTERRUPTED
    assert solution.refinement is not None
    assert len(solution.refinement.rounds) >= 2
    assert solution.cost == pytest.approx(0.7576179286593919, abs=1e-3)


def test_a_polish_is_a_stage_of_its_own_on_the_terminal(tmp_path: Path) -> None:
    seen = on_a_terminal("solve", "bang_bang", "--polish", "--no-plot", folder=tmp_path)
    assert seen.code == 0
    lines = seen.terminal.replace("\x1b[K", "").split("\r")
    assert max(map(len, lines)) < 80
    assert lines[-2].startswith("polish  iteration    0   cost -1.83060e-01")
    assert lines[-1] == ""
    assert "  polished " in seen.out


# Result files that are none


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("result") / "push.h5"
    quito.solve(load_text(PUSH, "push.yaml"), steps=5).save(path)
    return path


def _attribute(group: str, name: str, value: Any) -> Callable[[Path], None]:
    def change(path: Path) -> None:
        with h5py.File(path, "a") as file:
            file[group].attrs[name] = value

    return change


def _without(name: str) -> Callable[[Path], None]:
    def change(path: Path) -> None:
        with h5py.File(path, "a") as file:
            del file[name]

    return change


def _bytes(change: Callable[[bytes], bytes]) -> Callable[[Path], None]:
    return lambda path: (path.write_bytes(change(path.read_bytes())), None)[1]


DAMAGES: dict[str, tuple[Callable[[Path], None], str]] = {
    "text": (_bytes(lambda _: b"not HDF5 at all"), "no result of quito, or damaged"),
    "empty": (_bytes(lambda _: b""), "no result of quito, or damaged"),
    "half": (_bytes(lambda whole: whole[: len(whole) // 2]), "no result of quito, or damaged"),
    "noise": (
        _bytes(lambda whole: whole[:3000] + b"\xff" * 400 + whole[3400:]),
        "no result of quito, or damaged",
    ),
    "no control": (_without("control"), "no result of quito, or damaged"),
    "unknown status": (
        _attribute("statistics", "status", "WONDERFUL"),
        "no result of quito, or damaged",
    ),
    "broken options": (_attribute("problem", "options", '{"a":'), "no result of quito, or damaged"),
    "another program's": (_attribute("/", "format", "ICLOCS"), "but no result of quito"),
    "no version": (_attribute("/", "format_version", "two"), "no result of quito, or damaged"),
    "newer": (_attribute("/", "format_version", 99), "update quito"),
}


@pytest.mark.parametrize("damage", DAMAGES)
@pytest.mark.parametrize("command", ["show", "plot"])
def test_no_result(quito_: Quito, tmp_path: Path, result: Path, damage: str, command: str) -> None:
    change, said = DAMAGES[damage]
    shutil.copy(result, tmp_path / "r.h5")
    change(tmp_path / "r.h5")
    ran = quito_(command, "r.h5")
    assert (ran.code, ran.out) == (2, "")
    assert ran.err.startswith("quito: r.h5 ")
    assert said in ran.err
    assert len(ran.err.splitlines()) == 1
    assert written(tmp_path) == {"r.h5"}


def test_a_newer_format_says_which(quito_: Quito, tmp_path: Path, result: Path) -> None:
    shutil.copy(result, tmp_path / "r.h5")
    _attribute("/", "format_version", 99)(tmp_path / "r.h5")
    assert quito_("show", "r.h5").err == (
        "quito: r.h5 has format version 99; this quito reads up to 1: update quito to read it\n"
    )


# Whatever is done to a problem file

EVERY_KEY = """\
title: A loaded cart over measured ground
source: nobody
description: The load p pays, the ground drags.
constants: {A: [[0, 1], [0, -0.1]], B: [0, 1], most: 2, weight: 1e-3}
time:
  initial: 0
  final: {lower: 1, upper: 4, guess: 2}
states:
  x:
    size: 2
    initial: [0, 0]
    final: [1, {lower: -0.1, upper: 0.1}]
    lower: [-1, null]
    upper: 3
    guess: ["t/2", 0.4]
    scale: [1, 0.5]
    unit: m
    description: position and velocity
  w: {initial: 0, guess: {times: [0, 4], values: [0, 1]}, scale: 2}
controls:
  u: {lower: -most, upper: most, guess: "if_else(t < 1, 1, -1)", scale: 1, unit: N}
  v: {size: 2, lower: [-1, -1], upper: 1, guess: {times: [0, 4], values: [[0, 0], [0.1, -0.1]]}}
parameters:
  p: {lower: 0.1, upper: 2, guess: 1, scale: 1, unit: kg, description: load}
  q: {size: 2, guess: [0.1, 0.2]}
tables:
  ground: {x: [-1, 0, 0.5, 1, 3], y: [0, 0.1, 0.3, 0.2, 0.1], method: cubic}
  wind: {x: [0, 4], y: [0, 0.1], method: linear}
expressions:
  drag: interpolate(x[0], ground) + interpolate(t, wind)
  energy: dot(x, x)/2
dynamics:
  x: A @ x + B*(u - drag)/(1 + p)
  w: if_else(abs(u) < 1, u^2, 2*abs(u) - 1)
sense: maximize
cost:
  lagrange: -weight*(u^2 + dot(v, v)) - sum(q^2)
  mayer: sqrt(p) - t - 0.01*final(w) + initial(x)[0]
constraints:
  path:
    mixed: u + x[1] <= 2.5
    ring: -1 <= energy + 0*t <= 9
    disc: norm(v + 1e-3) <= 0.9
    shape: "[0.1, 0.2]*x[0:2] + v >= -3"
    tied: v[0] == q[0]*v[1]
    heavy: p + x[1] <= 5
  boundary:
    closed: final(energy) <= 1 + initial(energy)
    short: final(t) - initial(t) <= 3.5
    load: p >= 0.2
  integral:
    fuel: u^2 <= 8
    band: -1 <= x[1] <= 5
  point:
    gate: {at: 1/2, holds: "x[1] >= 0.1"}
published:
  - {tool: pencil, steps: 10, time: 1, iterations: 3, violation: 0.1, error_norm: 1, dft_norm: 2}
options: {steps: 10, variance: 2, path_points: substeps, tolerance: 1e-8}
"""
"""A file that uses the whole language, for what is made of its pieces."""
TEXTS = [
    *(
        path.read_text(encoding="utf-8")
        for path in [*bundled().values(), *sorted(ACCEPTED.glob("*.yaml"))]
    ),
    *[EVERY_KEY] * 12,
]
TOKENS = (
    *(
        "{",
        "}",
        "[",
        "]",
        "(",
        ")",
        ":",
        ": ",
        ",",
        "'",
        '"',
        "- ",
        "*",
        "^",
        "@",
        "\n",
        "  ",
        "\t",
    ),
    *("#", "&a ", "*a", "!x ", "|", ">", "? ", "%", "=", "x1", "u", "t", "x[0]", "size: 2", "-1"),
    *("size: 0", "1e999", ".nan", ".inf", "null", "true", "final(x1)", "if_else(", "lower: ", "é"),
    *("---\n", "<<: ", "9^9^9", "1/0", "[[1, 2], [3, 4]]", "{lower: 1, upper: 2}", "\\", "\u2028"),
    *("<=", ">=", "==", "<", "p", "q", "A", "x[0:2]", "initial(x)", "final(t)", "energy", "ground"),
    *("interpolate(t, wind)", "{at: 0.5, holds: u <= 1}", "{times: [0, 1], values: [0, 1]}"),
    *(
        "0",
        "1e-300",
        "-1e300",
        "sqrt(-1)",
        "0*x",
        "norm(x)",
        "inv(A)",
        "maximize",
        "null",
        "[]",
        "{}",
    ),
)
_WORDS = re.compile(r"\w[\w.]*|[<>=]=|[-+*/^@]")


@st.composite
def mutated(draw: st.DrawFn) -> str:
    """A problem file with pieces of it, or lines, left out, doubled, replaced or exchanged."""
    text = draw(st.sampled_from(TEXTS))
    for _ in range(draw(st.integers(1, 4))):
        start = draw(st.integers(0, len(text)))
        end = min(len(text), start + draw(st.sampled_from((0, 1, 2, 3, 8, 30, 200))))
        lines = text.split("\n")
        i, j = draw(st.integers(0, len(lines) - 1)), draw(st.integers(0, len(lines) - 1))
        match draw(st.integers(0, 9)):
            case 0:
                text = text[:start] + text[end:]
            case 1:
                text = text[:end] + text[start:end] + text[end:]
            case 2:
                text = text[:start] + draw(st.sampled_from(TOKENS)) + text[end:]
            case 3:
                text = "\n".join(lines[:i] + lines[i + 1 :])
            case 4:
                text = "\n".join([*lines[:i], lines[j], *lines[i:]])
            case 5:
                lines[i], lines[j] = lines[j], lines[i]
                text = "\n".join(lines)
            case _ if words := list(_WORDS.finditer(text)):  # what may well be read still
                old = draw(st.sampled_from(words))
                new = draw(st.sampled_from([*TOKENS, *(word[0] for word in words)]))
                text = text[: old.start()] + new + text[old.end() :]
    return text


@settings(max_examples=400, deadline=5000, suppress_health_check=[HealthCheck.too_slow])
@given(mutated())
def test_any_text_is_read_or_refused(text: str) -> None:
    try:
        build(load_text(text, "mutated.yaml"))
    except QuitoError as error:
        assert str(error)  # noqa: PT017 - that it can be said is the point
        assert error.exit_code == 2  # noqa: PT017


_WRITES = {"os.mkdir", "os.remove", "os.rename", "os.rmdir", "os.symlink", "os.link", "os.truncate"}
_STARTS = {"subprocess.Popen", "os.system", "os.exec", "os.fork", "socket.connect"}
_done: list[str] | None = None
"""What Python is seen to write or start, while that is looked at."""


def _see(event: str, arguments: tuple[Any, ...]) -> None:
    if _done is None:
        return
    flags = os.O_WRONLY | os.O_RDWR | os.O_CREAT
    if event in _STARTS:
        _done.append(event)
    elif event in _WRITES or (event == "open" and arguments[2] & flags):
        path = os.fsdecode(arguments[0]) if not isinstance(arguments[0], int) else ""
        if path and "__pycache__" not in path:
            _done.append(os.path.abspath(path))


sys.addaudithook(_see)


def _run_in(folder: Path, *arguments: str) -> tuple[Ran, list[str]]:
    """Run a command in this process with `folder` as its own, and say what it wrote or started."""
    global _done
    out, err, code = io.StringIO(), io.StringIO(), 0
    before, here = sys.argv, Path.cwd()
    try:
        os.chdir(folder)
        sys.argv, _done = ["quito", *arguments], []
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            main()
    except SystemExit as left:
        code = left.code if isinstance(left.code, int) else int(left.code is not None)
    finally:
        done, _done = _done or [], None
        sys.argv = before
        os.chdir(here)
    return Ran(code, out.getvalue(), err.getvalue()), done


@settings(
    max_examples=100,
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)
@given(mutated())
def test_any_file_is_checked_and_solved_or_refused(text: str) -> None:
    """Exit 0, 1 or 2 within seconds of work, no traceback, all it writes in its folder."""
    solve = ("-N", "5", "--max-iterations", "3", "--no-plot", "-o", "../out")
    with tempfile.TemporaryDirectory() as name:
        root = Path(name).resolve()
        (root / "here").mkdir()
        file, out = root / "here" / "mutated.yaml", root / "out"
        file.write_bytes(given_bytes := text.encode("utf-8", "surrogatepass"))
        for arguments in (("check", file.name), ("solve", file.name, *solve)):
            with within(60):
                ran, done = _run_in(root / "here", *arguments)
            assert ran.code in {0, 1, 2}
            assert "Traceback" not in ran.out + ran.err
            assert "bug in quito" not in ran.err
            assert ran.code or not ran.err
            assert all(Path(path).is_relative_to(out) for path in done)
            if ran.code == 2 or arguments[0] == "check":
                assert written(root) == {"here/mutated.yaml"}
            else:
                assert written(root) == {"here/mutated.yaml", "out/mutated.h5"}
        assert file.read_bytes() == given_bytes
