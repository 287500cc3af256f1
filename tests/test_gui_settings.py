"""The form of a solve: its fields, what is idle, what is asked for, and the command line for it."""

from __future__ import annotations

import shlex
from dataclasses import replace
from typing import Any

import pytest
import typer

from quito_cli.cli.app import app
from quito_cli.errors import UsageError
from quito_cli.gui.settings import Setting, command, given, idle, settings
from quito_cli.options import ADAPTIVE_ONLY, QUASI_INTERPOLANT_ONLY, Options
from quito_cli.problem.options import COLLOCATION_ONLY, SHOOTING_ONLY, FileOptions, RequestedOptions
from quito_cli.solvers.table import SOLVERS

ADAPTIVE = set(ADAPTIVE_ONLY)


def fields(**file: Any) -> dict[str, Setting]:
    return {setting.name: setting for setting in settings(file)}


# Fields


def test_every_option_has_a_field_with_help() -> None:
    left_out = {"solver_options", "warm_start"}
    form = fields()
    assert set(form) == set(RequestedOptions.model_fields) - left_out
    assert all(setting.help and setting.help[-1] == "." for setting in form.values())
    assert not [setting for setting in form.values() if "`" in setting.help or "\n" in setting.help]


def test_the_usual_ones_come_first() -> None:
    usual = [setting.name for setting in settings({}) if not setting.advanced]
    assert usual[:4] == ["steps", "variance", "generating_function", "discretization"]
    assert {"control", "mesh", "solver", "tolerance"} < set(usual)
    whether = [setting.advanced for setting in settings({})]
    assert whether == sorted(whether)


def test_defaults_are_the_files_and_else_ours() -> None:
    form = fields(steps=300, solver="auto")
    assert (form["steps"].default, form["steps"].from_file) == (300, True)
    assert (form["variance"].default, form["variance"].from_file) == (Options.variance, False)
    assert form["solver"].default == "auto"
    assert form["mesh_limit"].default is None


def test_kinds_and_ranges_are_those_of_a_file() -> None:
    form = fields()
    steps, variance, normalised = form["steps"], form["variance"], form["normalised"]
    assert (steps.kind, steps.least, steps.above, steps.most) == ("integer", 1, None, 20_000)
    assert (variance.kind, variance.least, variance.above, variance.most) == (
        "number",
        None,
        0,
        100,
    )
    assert (normalised.kind, normalised.choices) == ("switch", ())
    assert [choice.value for choice in form["mesh"].choices] == ["uniform", "adaptive"]
    assert form["mesh"].kind == "choice"
    assert [c.value for c in form["generating_function"].choices][:2] == ["gaussian", "laguerre4"]


def test_every_choice_says_what_it_is() -> None:
    for setting in settings({}):
        assert all(choice.help for choice in setting.choices), setting.name


def test_solvers_that_are_not_here_say_where_they_are_from() -> None:
    (solver,) = [s for s in settings({}, ("auto", "ipopt")) if s.name == "solver"]
    found = {choice.value: choice for choice in solver.choices}
    assert set(found) == {"auto", *SOLVERS}
    assert {name for name, choice in found.items() if choice.available} == {"auto", "ipopt"}
    assert found["highs"].help == f"not here: from {SOLVERS['highs'].provides}"
    assert all(choice.available for choice in fields()["solver"].choices)
    words = {choice.value: choice.help for choice in fields()["solver"].choices}
    assert {name for name, help in words.items() if "quadratic programs only" in help} == {
        name for name, row in SOLVERS.items() if row.takes == "QP"
    }


# What is idle


@pytest.mark.parametrize(
    ("chosen", "unused"),
    [
        ({}, {*ADAPTIVE, *COLLOCATION_ONLY}),
        ({"mesh": "adaptive"}, {*COLLOCATION_ONLY}),
        ({"mesh": "adaptive", "steps": 50}, {"mesh_steps", *COLLOCATION_ONLY}),
        ({"mesh": "adaptive", "mesh_steps": 50}, {"steps", *COLLOCATION_ONLY}),
        ({"polish": True}, {*COLLOCATION_ONLY}),
        ({"polish": True, "mesh": "uniform"}, {*ADAPTIVE, *COLLOCATION_ONLY}),
        ({"discretization": "lgr"}, {*ADAPTIVE, *SHOOTING_ONLY}),
        (
            {"control": "piecewise-constant"},
            {*ADAPTIVE, *QUASI_INTERPOLANT_ONLY, *COLLOCATION_ONLY},
        ),
        ({"variance": -1.0, "degree": 3}, {*ADAPTIVE, *COLLOCATION_ONLY}),
    ],
)
def test_what_means_nothing_is_idle(chosen: dict[str, Any], unused: set[str]) -> None:
    assert idle(chosen, {}) == unused


def test_a_leading_choice_makes_what_is_set_already_idle() -> None:
    chosen = {"variance": 3.0, "mesh": "adaptive", "mesh_tolerance": 0.01, "discretization": "lgr"}
    assert {"variance", "mesh", "mesh_tolerance", "substeps"} < idle(chosen, {})
    assert given(chosen, {}) == {"discretization": "lgr"}
    both = {"control": "piecewise-constant", "discretization": "lgr"}
    assert "control" in idle(both, {})
    assert given(both, {}) == {"discretization": "lgr"}


def test_what_the_file_chose_counts() -> None:
    file = {"discretization": "lgr", "degree": 3}
    assert "degree" not in idle({}, file)
    assert {"degree"} <= idle({"discretization": "rk4"}, file)
    assert "variance" in idle({}, file)


# What is asked for


@pytest.mark.parametrize(
    ("chosen", "file", "asked"),
    [
        ({}, {"steps": 300}, {}),
        ({"steps": 300}, {"steps": 300}, {}),
        ({"steps": 100}, {"steps": 300}, {"steps": 100}),
        ({"steps": 100, "variance": 2.0}, {}, {}),
        ({"variance": 3.0, "solver": None}, {}, {"variance": 3.0}),
        ({"degree": 4, "discretization": "lgr"}, {}, {"discretization": "lgr"}),
        ({"mesh": "adaptive", "mesh_steps": 100}, {}, {"mesh": "adaptive"}),
        ({"mesh": "adaptive", "steps": 300}, {"steps": 300}, {"mesh": "adaptive", "steps": 300}),
        ({"normalised": False}, {}, {"normalised": False}),
    ],
)
def test_only_what_makes_a_difference_is_asked_for(
    chosen: dict[str, Any], file: dict[str, Any], asked: dict[str, Any]
) -> None:
    assert given(chosen, file) == asked


@pytest.mark.parametrize(
    ("chosen", "said"),
    [
        ({"steps": 0}, "steps: expected at least 1, got 0"),
        ({"steps": 10**9}, "at most 20000"),
        ({"steps": 1.5}, "steps: "),
        ({"variance": float("nan")}, "variance: "),
        ({"solver": "/bin/sh"}, "solver: "),
        ({"tolerance": 1.0}, "tolerance: "),
        ({"guess": "/etc/passwd"}, "there is no option 'guess'"),
        ({"solver_options": {"hsllib": "x.so"}}, "there is no option 'solver_options'"),
        ({"__class__": 1}, "there is no option"),
        ({"mesh": "adaptive", "mesh_limit": 5}, "mesh-limit of 5 cells"),
    ],
)
def test_what_may_not_be_asked_for_is_refused(chosen: dict[str, Any], said: str) -> None:
    with pytest.raises(UsageError) as refused:
        given(chosen, {})
    assert said in str(refused.value)


# The command line


def parsed(line: str) -> dict[str, Any]:
    """Return what `quito solve` takes from a command line."""
    program, name, *words = shlex.split(line)
    assert (program, name) == ("quito", "solve")
    group = typer.main.get_command(app)
    with group.make_context("quito", [name, *words], resilient_parsing=False) as outer:
        solve = group.get_command(outer, name)  # type: ignore[attr-defined]
        with solve.make_context(name, list(words), parent=outer) as context:
            return dict(context.params)


SAMPLES: dict[str, Any] = {
    "steps": 30,
    "variance": 0.1 + 0.2,
    "generating_function": "sech",
    "normalised": False,
    "control": "piecewise-linear",
    "discretization": "hermite-simpson",
    "substeps": 3,
    "degree": 7,
    "mesh": "adaptive",
    "mesh_steps": 20,
    "mesh_tolerance": 1e-4,
    "mesh_iterations": 3,
    "mesh_limit": 400,
    "tolerance": 1e-12,
    "max_iterations": 7,
    "solver": "auto",
    "path_points": "nodes",
    "objective_scale": 1e-3,
    "polish": True,
}
BESIDE: dict[str, dict[str, Any]] = {name: {"mesh": "adaptive"} for name in (*ADAPTIVE_ONLY,)} | {
    "degree": {"discretization": "lgr"}
}


@pytest.mark.parametrize("name", [setting.name for setting in settings({})])
def test_the_command_line_asks_for_the_same(name: str) -> None:
    asked = given(BESIDE.get(name, {}) | {name: SAMPLES[name]}, {})
    assert name in asked
    found = parsed(command("alychan", asked))
    assert found.pop("problem") == "alychan"
    plain = parsed("quito solve alychan")
    different = {key: value for key, value in found.items() if value != plain.get(key)}
    assert different == asked
    file = FileOptions.model_validate({})
    assert Options.resolve(file, different) == Options.resolve(file, asked)
    assert replace(Options.resolve(file, asked)) != Options()


@pytest.mark.parametrize("name", ["-x.yaml", "my file.yaml", "$(reboot).yaml", "a'b;c.yaml"])
def test_names_are_quoted_for_the_shell(name: str) -> None:
    found = parsed(command(name, {}))["problem"]
    assert found in (name, f"./{name}")
    assert not found.startswith("-")


def test_the_shortest_command_line_is_that_of_the_defaults() -> None:
    assert command("alychan", given({"steps": 100, "variance": 2.0}, {})) == "quito solve alychan"
    line = command("alychan", {"steps": 30, "normalised": False, "tolerance": 1e-8})
    assert line == "quito solve alychan -N 30 --as-printed --tolerance 1e-08"
