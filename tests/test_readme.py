"""The README is true: its example, its commands, its tables."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from documents import COMMANDS, code_spans, run

import quito_cli as quito
from quito_cli.batch.suite.schema_expect import Expect
from quito_cli.cli.solve import INTERRUPTED
from quito_cli.comparison.table import COLUMNS
from quito_cli.errors import GateError, QuitoError
from quito_cli.options import Options
from quito_cli.problem.language.functions import FUNCTIONS
from quito_cli.problem.options import FileOptions
from quito_cli.problem.schema import Problem

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")


def marked(mark: str) -> str:
    """The fenced block after an HTML comment."""
    found = re.search(rf"<!-- {re.escape(mark)} -->\n```\w+\n(.*?)```", README, re.DOTALL)
    assert found, mark
    return found[1]


def section(title: str) -> str:
    found = re.search(
        rf"^## {re.escape(title)}\n(.*?)(?=^## |\Z)", README, re.DOTALL | re.MULTILINE
    )
    assert found, title
    return found[1]


# The example


@pytest.fixture
def cart(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> quito.Solution:
    """The answer to the example, by its own command; what it printed is in the file `printed`."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cart.yaml").write_text(marked("file: cart.yaml"), encoding="utf-8")
    command, *arguments = marked("command: example").split()
    assert command == "quito"
    assert run(arguments, monkeypatch) == 0
    (tmp_path / "printed").write_text(capsys.readouterr().out, encoding="utf-8")
    assert (tmp_path / "results" / "cart.png").is_file()
    return quito.Solution.load(tmp_path / "results" / "cart.h5")


def test_the_cart_moves_as_theory_says(cart: quito.Solution) -> None:
    """Without the bound v = 3 t (2 - t)/4 would reach 0.75 > c = 0.7.

    So v is a parabola that touches c at t1, stays there until 2 - t1 and falls as it rose:
    u = a (1 - t/t1) with a t1/2 = c. The way is 2 c - 2 c t1/3 = 1, and J = 8 c²/(3 t1).
    """
    c = 0.7
    t1 = 1.5 * (2 - 1 / c)
    cost = 8 * c**2 / (3 * t1)
    assert cost == pytest.approx(1.5244444444)
    assert cart.success
    assert cart.evidence.warnings == ()
    assert cart.cost == pytest.approx(cost, rel=1e-4)
    t = np.linspace(0, 1, 201)
    v = np.where(t < t1, 2 * c / t1 * (t - t**2 / (2 * t1)), c)
    np.testing.assert_allclose(cart.state(t)[:, 1], v, atol=2e-3)
    np.testing.assert_allclose(cart.state(2 - t)[:, 1], v, atol=2e-3)
    assert cart.state(2.0)[0] == pytest.approx([1, 0], abs=1e-7)
    assert cart.state(np.linspace(0, 2, 1001))[:, 1].max() <= c + 1e-4
    # ∂J/∂(way) is the constant costate of x: J = 8 c²/(3 t1), way = 2 c - 2 c t1/3.
    np.testing.assert_allclose(cart.costates[:, 0], -4 * c / t1**2, rtol=2e-2)


@pytest.mark.usefixtures("cart")
def test_the_summary_has_what_the_readme_explains(tmp_path: Path) -> None:
    printed = (tmp_path / "printed").read_text(encoding="utf-8")
    assert printed.startswith("Move a cart by one metre\nSolved.")
    said = re.findall(r"^- \*\*(.+?)\*\*", section("Sixty seconds"), re.MULTILINE)
    figures = ["residuals", "re-simulated", "violation", "total variation", "switching times"]
    assert said == [*figures, "arcs"]
    for word in [*said, "ringing index", "Pontryagin"]:
        assert re.search(rf"^  {word} ", printed, re.MULTILINE), word
    assert "judged at 1e-08" in printed, "within ten times the tolerance"


# Commands


def test_set_up_is_one_command_each_and_the_first_is_the_main_job() -> None:
    for mark in ("main job", "tests"):
        assert len(marked(f"command: {mark}").splitlines()) == 1
    main_job = "quito solve problems/alychan.yaml -N 100 --variance 2\n"
    assert marked("command: main job").endswith(main_job)
    assert (ROOT / "problems" / "alychan.yaml").is_file()
    assert "requirements.lock" in marked("command: main job")
    assert (ROOT / "requirements.lock").is_file()


@pytest.fixture(scope="module")
def helps() -> dict[str, str]:
    """What every command says of itself."""
    import contextlib
    import io

    texts = {}
    for command in COMMANDS:
        with (
            pytest.MonkeyPatch.context() as patch,
            contextlib.redirect_stdout(io.StringIO()) as out,
        ):
            assert run([command, "--help"], patch) == 0
        texts[command] = out.getvalue()
    return texts


def test_every_command_and_its_flags_are_there(helps: dict[str, str]) -> None:
    lines = marked("command: example").splitlines() + [
        span for span in code_spans(README) if span.startswith("quito ")
    ]
    found = set()
    for line in lines:
        words = line.replace("[", " ").replace("]", " ").split()[1:]
        if words[0] in ("COMMAND", "--version"):
            continue
        found.add(words[0])
        assert words[0] in COMMANDS, line
        for flag in (word for word in words if word.startswith("-")):
            assert re.search(rf"(?<![\w-]){re.escape(flag)}(?![\w-])", helps[words[0]]), line
    assert found == set(COMMANDS)


def test_the_options_it_explains_are_those_of_solve(helps: dict[str, str]) -> None:
    text = section("Commands")
    flags = {span.split()[0] for span in re.findall(r"`(-[^`]+)`", text)}
    assert len(flags) > 12
    for flag in flags:
        home = "check" if flag == "--latex" else "solve"
        assert re.search(rf"(?<![\w-]){re.escape(flag)}(?![\w-])", helps[home]), flag


SENTENCES: list[tuple[str, dict[str, Any]]] = [
    ("-N 300", {"steps": 300}),
    ("--variance 2", {"variance": 2.0}),
    ("--generating-function laguerre6", {"generating_function": "laguerre6"}),
    ("--control piecewise-constant", {"control": "piecewise-constant"}),
    ("--discretization rk4", {"discretization": "rk4"}),
    ("--mesh adaptive", {"mesh": "adaptive"}),
    ("--solver-option mu_strategy=adaptive", {"solver_options": {"mu_strategy": "adaptive"}}),
]


@pytest.mark.parametrize(("words", "options"), SENTENCES, ids=[words for words, _ in SENTENCES])
def test_what_it_says_of_options_runs(
    words: str, options: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert words in code_spans(README)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cart.yaml").write_text(marked("file: cart.yaml"), encoding="utf-8")
    few = [] if "-N" in words else ["-N", "6"]
    assert run(["solve", "cart.yaml", "-q", "--no-plot", *few, *words.split()], monkeypatch) == 0
    solution = quito.Solution.load(tmp_path / "results" / "cart.h5")
    assert {name: solution.options[name] for name in options} == options


SETTINGS = [
    span.split()[1] for span in code_spans(README) if span.startswith("--set ") and "=" in span
]


@pytest.mark.parametrize("setting", [s for s in SETTINGS if s != "NAME=VALUE"])
def test_what_it_says_of_settings_runs(
    setting: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert len(SETTINGS) >= 2
    monkeypatch.chdir(tmp_path)
    arguments = ["solve", "van_der_pol", "-q", "--no-plot", "-N", "5", "--set", setting]
    assert run(arguments, monkeypatch) == 0


def test_exit_codes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    said = re.search(r"\*\*Exit codes\*\*: (.*?)\n\n", README, re.DOTALL)
    assert said
    assert re.findall(r"(?:^|[;\s])(\d+) ", said[1]) == ["0", "1", "2", "3", "130"]
    assert INTERRUPTED == 130
    assert quito.UsageError.exit_code == quito.ProblemError.exit_code == 2
    assert GateError.exit_code == 3
    assert issubclass(quito.ProblemError, quito.UsageError)
    assert issubclass(quito.UsageError, QuitoError)
    monkeypatch.chdir(tmp_path)
    few = ["-q", "--no-plot", "-N", "5"]
    assert run(["solve", "bang_bang", *few], monkeypatch) == 0
    assert run(["solve", "bang_bang", *few, "--max-iterations", "1"], monkeypatch) == 1
    assert run(["solve", "no_such_problem", *few], monkeypatch) == 2


def test_the_comparisons_of_the_paper_run(
    helps: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On few cells."""
    lines = marked("command: comparisons").splitlines()
    assert len(lines) == 3
    monkeypatch.chdir(tmp_path)
    for line in lines:
        _, command, problem, *options = line.split()
        assert command == "compare"
        assert (ROOT / problem).is_file()
        few = re.sub(r"\d+x", "3x", " ".join(options)).replace("x400", "x9").split()
        arguments = [str(ROOT / problem), *few, "-N", "12", "--no-plot", "-q"]
        assert run(["compare", *arguments], monkeypatch) == 0
    text = section("Held against the truth, and against others")
    for flag in {span.split()[0] for span in re.findall(r"`(--[^`]+)`", text)}:
        assert re.search(rf"(?<![\w-]){re.escape(flag)}(?![\w-])", helps["compare"]), flag


def test_the_adaptive_solve_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    _, *arguments = marked("command: adaptive").split()
    assert run([*arguments, "-q", "--no-plot"], monkeypatch) == 0
    solution = quito.Solution.load(tmp_path / "results" / "van_der_pol.h5")
    assert solution.refinement is not None
    assert (ROOT / "problems" / "mesh.svg").is_file()


def test_the_polish_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    _, *arguments = marked("command: polish").split()
    assert run([*arguments, "--no-plot"], monkeypatch) == 0
    assert "The polish, step by step" in capsys.readouterr().out
    solution = quito.Solution.load(tmp_path / "results" / "van_der_pol.h5")
    assert solution.polished
    known = solution.reference
    assert known is not None
    assert solution.switching_times == pytest.approx(known.switching_times, abs=1e-8)
    assert solution.cost == pytest.approx(known.cost, rel=1e-8)


def test_the_suite_passes(
    helps: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("cart.yaml", "nightly.yaml"):
        (tmp_path / name).write_text(marked(f"file: {name}"), encoding="utf-8")
    _, *arguments = marked("command: batch").split()
    assert run([*arguments, "-q"], monkeypatch) == 0
    assert len(list((tmp_path / "results").glob("*.h5"))) == 4
    text = section("Many at once")
    for flag in {span.split()[0] for span in re.findall(r"`(--[^`]+)`", text)}:
        assert re.search(rf"(?<![\w-]){re.escape(flag)}(?![\w-])", helps["batch"]), flag
    named = re.findall(r"`(\w+)`", text.split("Figures are")[1].split("the\nschema")[0])
    assert len(named) > 8
    assert set(named) <= set(Expect.model_fields)


@pytest.mark.parametrize("form", ["0.75 ± 1e-6", "0.75 ± 0.1 %", "<= 0.01", "'>= 2'"])
def test_the_forms_of_an_expectation(form: str) -> None:
    assert f"`{form}`" in section("Many at once")
    Expect.model_validate({"cost": form.strip("'")})


def test_the_columns_of_a_comparison() -> None:
    text = section("Held against the truth, and against others")
    rows = re.findall(r"^\| (`.+?) \|", text.split("| column |")[1].split("| option |")[0], re.M)
    known = {column.heading for given in COLUMNS.values() for column in given}
    said = {name for row in rows for name in re.findall(r"`([\w -]+)`", row)}
    assert said <= known
    every = {"unknowns", "iterations", "build s", "solve s", "polish s", "in all s"}
    assert known - said == every | {"error", "its error", "states"}


# Tables and Python


def test_the_keys_of_a_problem_file() -> None:
    rows = re.findall(r"^\| (`.+?) \|", section("The problem file"), re.MULTILINE)
    keys = [key for row in rows for key in re.findall(r"`(\w+)`", row)]
    assert sorted(keys) == sorted(Problem.model_fields)


def test_the_functions_of_expressions() -> None:
    said = re.search(r"and\s+the functions\s+`([^`]+)`", section("The problem file"))
    assert said
    assert set(said[1].split()) == set(FUNCTIONS)


def test_defaults_it_states() -> None:
    text = " ".join(README.split())
    assert Options.discretization == "rk4"
    assert "`--discretization rk4` (default)" in text
    assert f"`--substeps` steps a cell (default {Options.substeps})" in text
    assert f"`--mesh-steps` cells (default {Options.mesh_steps})" in text
    assert f"outside jumps (default {Options.mesh_tolerance:g})" in text
    assert f"`--mesh-iterations` meshes (default {Options.mesh_iterations})" in text
    assert "(default twice those it starts from)" in text
    assert Options.resolve(FileOptions(mesh="adaptive"), {}).most_cells == 2 * Options.mesh_steps


def test_the_python_example_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    code = re.search(r"```python\n(.*?)```", section("From Python"), re.DOTALL)
    assert code
    (tmp_path / "problems").mkdir()
    (tmp_path / "problems" / "alychan.yaml").write_bytes(
        (ROOT / "problems" / "alychan.yaml").read_bytes()
    )
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    exec(compile(code[1], "README.md", "exec"), names)
    solution, again = names["solution"], names["again"]
    assert solution.success
    assert solution.control([0.1, 0.2]).shape == (2, 1)
    assert solution.state([0.1, 0.2]).shape == solution.costate([0.1, 0.2]).shape == (2, 3)
    assert solution.evidence.resimulation_gap < 1e-4
    assert again.cost == solution.cost
    for name in re.findall(r"`quito\.(\w+)`", section("From Python")):
        assert name in quito.__all__
        assert hasattr(quito, name)


def test_the_result_file_opens_as_it_says(cart: quito.Solution, tmp_path: Path) -> None:
    assert 'xarray.open_dataset("results/alychan.h5", group="trajectory", engine="h5netcdf")' in (
        " ".join(README.split())
    )
    file = tmp_path / "results" / "cart.h5"
    with xarray.open_dataset(file, group="trajectory", engine="h5netcdf") as trajectory:
        assert trajectory["state"].dims == ("time", "state_name")
        assert trajectory["state_name"].values.tolist() == ["x", "v"]
        np.testing.assert_allclose(trajectory["time"].values, cart.times)
    groups = section("The result file")
    named = re.findall(r"`(\w+)`", groups.split("The groups are")[1].split("The costates")[0])
    with xarray.open_datatree(file, engine="h5netcdf") as tree:
        assert sorted(tree.children) == sorted(named)
