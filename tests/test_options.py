"""What may be asked of a solve, by whom, and who wins."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import Any, get_args

import pytest

import quito_cli as quito
from quito_cli.options import ADAPTIVE_ONLY, QUASI_INTERPOLANT_ONLY, Options
from quito_cli.problem import options as requested
from quito_cli.problem.load import load_text
from quito_cli.problem.options import (
    SHOOTING_ONLY,
    FileOptions,
    RequestedOptions,
    refuse_solver_option,
)
from quito_cli.solvers import AUTOMATIC, SOLVERS
from quito_cli.solving.on_mesh import CLASSICAL_CONTROLS
from quito_cli.transcription.generating import GENERATING_FUNCTIONS, generating_function
from quito_cli.transcription.schemes import SCHEMES

PAPER = ("gaussian", "laguerre4", "laguerre6", "hermite10", "trigonometric", "sech")
PUSH = """\
time: {initial: 0, final: 1}
states: {x: {initial: 0, final: 1}}
controls: {u: {}}
dynamics: {x: u}
cost: {lagrange: u^2}
"""


def resolve(file: dict[str, Any] | None = None, **given: Any) -> Options:
    return Options.resolve(FileOptions.model_validate(file or {}), given)


# The same names in every place


def test_fields_are_the_same_everywhere() -> None:
    names = [field.name for field in fields(Options)]
    names.remove("guess")  # a path, and so never asked for by a file
    assert set(RequestedOptions.model_fields) == set(names)
    names.remove("objective_scale")  # too small a one could buy a success
    names.remove("warm_start")  # without a guess it means nothing
    assert set(FileOptions.model_fields) == set(names)


def test_a_file_asks_for_no_more_than_a_call_and_defaults_are_in_one_place() -> None:
    for model in (RequestedOptions, FileOptions):
        assert all(field.default is None for field in model.model_fields.values())


def test_names_are_those_of_the_tables() -> None:
    classical = set(CLASSICAL_CONTROLS.values())
    assert get_args(requested.GeneratingFunctionName) == PAPER
    assert set(PAPER) == set(GENERATING_FUNCTIONS) - classical
    assert set(get_args(requested.DiscretizationName)) == {*SCHEMES, requested.COLLOCATION}
    assert set(get_args(requested.SolverName)) == {AUTOMATIC, *SOLVERS}
    assert set(get_args(requested.ControlName)) == {"quasi-interpolant", *CLASSICAL_CONTROLS}
    assert set(QUASI_INTERPOLANT_ONLY) < {field.name for field in fields(Options)}


@pytest.mark.parametrize(("number", "name"), [*enumerate(PAPER, start=1)])
def test_numbers_are_those_of_the_paper(number: int, name: str) -> None:
    assert resolve(generating_function=number).generating_function == name
    assert resolve(generating_function=str(number)).generating_function == name
    assert resolve({"generating_function": number}).generating_function == name
    assert generating_function(name).name == name


# Who wins


def test_defaults_are_those_of_the_design() -> None:
    assert resolve() == Options(
        steps=100,
        variance=2.0,
        generating_function="gaussian",
        normalised=True,
        control="quasi-interpolant",
        discretization="rk4",
        substeps=2,
        degree=4,
        mesh="uniform",
        mesh_steps=100,
        mesh_tolerance=1e-3,
        mesh_iterations=8,
        mesh_limit=None,
        polish=False,
        tolerance=1e-9,
        max_iterations=1000,
        solver="ipopt",
        objective_scale=None,
        warm_start=False,
        solver_options={},
    )


GIVEN: dict[str, tuple[Any, Any]] = {
    "steps": (30, 40),
    "variance": (3.0, 4.0),
    "generating_function": ("sech", "laguerre4"),
    "normalised": (False, True),
    "control": ("piecewise-linear", "piecewise-constant"),
    "discretization": ("euler", "rk4"),
    "substeps": (3, 1),
    "degree": (3, 8),
    "mesh": ("adaptive", "uniform"),
    "mesh_steps": (40, 50),
    "mesh_tolerance": (1e-2, 1e-4),
    "mesh_iterations": (3, 5),
    "mesh_limit": (150, 180),
    "polish": (True, False),
    "tolerance": (1e-5, 1e-6),
    "max_iterations": (3, 4),
    "path_points": ("nodes", "substeps"),
    "solver": ("uno", "auto"),
}

BESIDE = {"degree": {"discretization": "lgr"}} | {
    name: {"mesh": "adaptive"} for name in ADAPTIVE_ONLY
}
"""What an option needs beside it."""


@pytest.mark.parametrize("name", GIVEN)
def test_the_call_wins_over_the_file_and_the_file_over_the_default(name: str) -> None:
    in_file, in_call = GIVEN[name]
    beside = BESIDE.get(name, {})
    file, call = beside | {name: in_file}, beside | {name: in_call}
    assert getattr(resolve(file), name) == in_file
    assert getattr(resolve(file, **{name: in_call}), name) == in_call
    assert getattr(resolve(file, **{name: None}), name) == in_file
    assert getattr(resolve(**call), name) == in_call


def test_solver_options_are_merged_one_by_one() -> None:
    file = {"solver_options": {"mu_init": 0.1, "max_soc": 2}}
    merged = resolve(file, solver_options={"mu_init": 0.2, "linear_solver": "mumps"})
    assert merged.solver_options == {"mu_init": 0.2, "max_soc": 2, "linear_solver": "mumps"}


def test_options_of_the_files_solver_are_not_for_another_one() -> None:
    file = {"solver_options": {"mu_init": 0.1}}
    assert resolve(file, solver="uno").solver_options == {}
    assert resolve(file, solver="ipopt").solver_options == {"mu_init": 0.1}
    assert resolve(file | {"solver": "ipopt"}, steps=3).solver_options == {"mu_init": 0.1}


def test_every_option_has_its_row_here() -> None:
    assert set(GIVEN) | {"solver_options", "guess", "objective_scale", "warm_start"} == {
        field.name for field in fields(Options)
    }


@pytest.mark.parametrize("control", CLASSICAL_CONTROLS)
@pytest.mark.parametrize(
    ("name", "value"),
    [("variance", 2.0), ("generating_function", "gaussian"), ("normalised", True)],
)
def test_a_classical_control_has_no_shape(control: str, name: str, value: Any) -> None:
    with pytest.raises(quito.UsageError, match=f"^{name.replace('_', '-')} .*{control}"):
        resolve(control=control, **{name: value})
    with pytest.raises(quito.UsageError, match=name.replace("_", "-")):
        resolve({"control": control, name: value})
    with pytest.raises(quito.UsageError, match=name.replace("_", "-")):
        resolve({"control": control}, **{name: value})
    assert resolve({name: value}, control=control).control == control


SHOOTS = {name: GIVEN[name][0] for name in SHOOTING_ONLY}


@pytest.mark.parametrize(("name", "value"), SHOOTS.items())
def test_options_of_shooting_mean_nothing_to_collocation(name: str, value: Any) -> None:
    said = f"^{name.replace('_', '-')} means nothing to lgr"
    for file, given in (
        ({}, {"discretization": "lgr", name: value}),
        ({"discretization": "lgr", name: value}, {}),
        ({"discretization": "lgr"}, {name: value}),
        ({name: value}, {"discretization": "lgr", name: value}),
    ):
        with pytest.raises(quito.UsageError, match=said):
            resolve(file, **given)
    chosen = resolve({name: value}, discretization="lgr")
    assert chosen.discretization == "lgr"
    assert name not in chosen.record


def test_a_degree_belongs_to_collocation() -> None:
    for file, given in (
        ({}, {"degree": 3}),
        ({"degree": 3}, {}),
        ({"discretization": "lgr"}, {"discretization": "rk4", "degree": 3}),
    ):
        with pytest.raises(quito.UsageError, match=r"^degree belongs to collocation: add "):
            resolve(file, **given)
    own: dict[str, Any] = {"discretization": "lgr", "degree": 7}
    assert resolve(own).degree == 7
    assert resolve(own, discretization="lgr").degree == 7
    assert resolve(own, steps=3).degree == 7
    assert resolve(own).record["degree"] == 7
    chosen = resolve(own, discretization="euler", variance=3)
    assert (chosen.discretization, chosen.variance) == ("euler", 3)
    assert "degree" not in chosen.record


# Adaptive meshes


@pytest.mark.parametrize("name", ADAPTIVE_ONLY)
def test_what_belongs_to_adaptive_meshes_is_refused_of_a_uniform_one(name: str) -> None:
    value = GIVEN[name][0]
    said = rf"^{name.replace('_', '-')} belongs to adaptive meshes: add --mesh adaptive$"
    for file in ({}, {"mesh": "uniform"}):
        with pytest.raises(quito.UsageError, match=said):
            resolve(file, **{name: value})
    with pytest.raises(quito.UsageError, match=said):
        resolve({"mesh": "adaptive"}, mesh="uniform", **{name: value})
    file_alone = resolve({name: value})  # for when --mesh adaptive is asked for
    assert file_alone.mesh == "uniform"
    assert name not in file_alone.record
    assert resolve({name: value}, mesh="adaptive").record[name] == value


def test_what_an_adaptive_mesh_starts_from() -> None:
    """A file's steps are for uniform meshes; those of a call are for the one it asks for."""
    assert resolve(mesh="adaptive").steps == 100
    assert resolve({"steps": 300}, mesh="adaptive").steps == 100
    assert resolve({"steps": 300, "mesh": "adaptive"}).steps == 100
    assert resolve({"steps": 300, "mesh_steps": 60}, mesh="adaptive").steps == 60
    assert resolve({"steps": 300, "mesh_steps": 60}, mesh="adaptive", steps=30).steps == 30
    assert resolve(mesh="adaptive", steps=30).record["mesh_steps"] == 30
    assert resolve({"steps": 300, "mesh": "adaptive"}, mesh="uniform").steps == 300
    with pytest.raises(quito.UsageError, match=r"^steps and mesh-steps both say how many"):
        resolve(mesh="adaptive", steps=30, mesh_steps=40)


def test_an_adaptive_mesh_starts_from_some_cells() -> None:
    assert resolve(mesh="adaptive", steps=4).steps == 4
    with pytest.raises(quito.UsageError, match=r"^steps: .* from 4 cells at least, got 3$"):
        resolve(mesh="adaptive", steps=3)


def test_a_collocation_has_no_adaptive_mesh() -> None:
    for file, given in (
        ({}, {"mesh": "adaptive", "discretization": "lgr"}),
        ({"mesh": "adaptive", "discretization": "lgr"}, {}),
        ({"discretization": "lgr"}, {"mesh": "adaptive"}),
        ({"mesh": "adaptive"}, {"mesh": "adaptive", "discretization": "lgr"}),
    ):
        with pytest.raises(quito.UsageError, match=r"^an adaptive mesh follows .* lgr is none"):
            resolve(file, **given)
    assert resolve({"mesh": "adaptive"}, discretization="lgr").mesh == "uniform"
    assert resolve({"discretization": "lgr"}, mesh="adaptive", discretization="rk4").mesh == (
        "adaptive"
    )


def test_the_most_cells_an_adaptive_mesh_may_come_to() -> None:
    assert resolve(mesh="adaptive").most_cells == 200
    assert resolve(mesh="adaptive", steps=30).most_cells == 60
    assert resolve(mesh="adaptive", steps=30, mesh_limit=30).most_cells == 30
    refused: tuple[tuple[dict[str, Any], str], ...] = (
        ({"mesh_limit": 99}, "99 cells does not hold the 100 .* take fewer --mesh-steps"),
        ({"mesh_limit": 29, "steps": 30}, "29 cells does not hold the 30 .* take fewer --steps"),
    )
    for given, said in refused:
        with pytest.raises(quito.UsageError, match=rf"^a mesh-limit of {said}"):
            resolve(mesh="adaptive", **given)
        with pytest.raises(quito.UsageError, match=rf"^a mesh-limit of {said}"):
            resolve({"mesh": "adaptive"}, **given)


# Polish


def test_a_polish_takes_an_adaptive_mesh_unless_one_is_asked_for() -> None:
    assert resolve(polish=True).mesh == "adaptive"
    assert resolve({"polish": True}).mesh == "adaptive"
    assert resolve({"polish": True}, polish=False).mesh == "uniform"
    for file, given in (
        ({"mesh": "uniform"}, {"polish": True}),
        ({"polish": True}, {"mesh": "uniform"}),
        ({"polish": True, "mesh": "uniform"}, {}),
    ):
        chosen = resolve(file, **given)
        assert (chosen.polish, chosen.mesh) == (True, "uniform")
    assert resolve(polish=True, control="piecewise-constant").mesh == "adaptive"
    chosen = resolve({"steps": 300}, polish=True)
    assert (chosen.steps, chosen.record["mesh_steps"]) == (100, 100), "as --mesh adaptive has it"
    assert resolve({"steps": 300}, polish=True, steps=40).steps == 40
    assert resolve(polish=True, mesh_limit=150).most_cells == 150


def test_a_collocation_may_be_polished_on_its_equal_cells() -> None:
    for file in ({}, {"discretization": "lgr"}, {"mesh": "adaptive"}):
        chosen = resolve(file, polish=True, discretization="lgr")
        assert (chosen.polish, chosen.mesh) == (True, "uniform")
    assert resolve({"discretization": "lgr", "polish": True}).mesh == "uniform"
    assert resolve({"discretization": "lgr", "polish": True}, discretization="rk4").mesh == (
        "adaptive"
    )


# What is refused


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("steps", 0),
        ("steps", 2.5),
        ("steps", True),
        ("steps", "10"),
        ("variance", 0),
        ("variance", math.nan),
        ("variance", math.inf),
        ("generating_function", 0),
        ("generating_function", 7),
        ("generating_function", True),
        ("generating_function", "box"),
        ("control", "hat"),
        ("discretization", "rk5"),
        ("substeps", 0),
        ("degree", 0),
        ("degree", 2.5),
        ("mesh", "moving"),
        ("mesh", True),
        ("mesh_steps", 3),
        ("mesh_steps", 201),
        ("mesh_tolerance", 0),
        ("mesh_tolerance", -1e-3),
        ("mesh_tolerance", 0.5),
        ("mesh_tolerance", math.nan),
        ("mesh_iterations", 0),
        ("mesh_iterations", 100),
        ("mesh_iterations", 2.5),
        ("mesh_limit", 3),
        ("mesh_limit", 1e6),
        ("polish", "perhaps"),
        ("polish", 2),
        ("tolerance", 0),
        ("tolerance", 1),
        ("max_iterations", -1),
        ("solver", "ipop"),
        ("objective_scale", -1),
        ("objective_scale", math.inf),
        ("solver_options", [1]),
        ("normalised", 2),
    ],
)
def test_wrong_values(name: str, value: Any) -> None:
    with pytest.raises(quito.UsageError, match=f"^{name.replace('_', '-')}: "):
        resolve(**{name: value})
    with pytest.raises(ValueError, match=name):
        FileOptions.model_validate({name: value})


def test_all_wrong_values_are_told_at_once() -> None:
    with pytest.raises(quito.UsageError) as caught:
        resolve(steps=0, tolerance=2)
    assert [line.split(":")[0] for line in str(caught.value).splitlines()] == ["steps", "tolerance"]


def test_an_unknown_option() -> None:
    with pytest.raises(quito.UsageError, match=r"no option 'step'; did you mean 'steps'"):
        resolve(step=3)
    with pytest.raises(quito.UsageError, match=r"no option 'N'; did you mean 'steps'\?$"):
        resolve(N=100)
    with pytest.raises(quito.UsageError, match=r"no option 'D'; did you mean 'variance'\?$"):
        resolve(D=2)
    with pytest.raises(quito.UsageError, match=r"no option 'colour'$"):
        quito.solve(load_text(PUSH, "push.yaml"), colour="red")


@pytest.mark.parametrize(
    ("name", "most"),
    [
        ("steps", 20_000),
        ("variance", 100),
        ("substeps", 20),
        ("degree", 200),
        ("mesh_limit", 20_000),
        ("max_iterations", 10_000),
    ],
)
def test_a_file_may_not_ask_for_endless_work_but_a_call_may(name: str, most: int) -> None:
    assert FileOptions.model_validate({name: most})
    with pytest.raises(ValueError, match=name):
        FileOptions.model_validate({name: most + 1})
    asked = BESIDE.get(name, {}) | {name: most + 1}
    assert getattr(resolve(None, **asked), name) == most + 1


HARMFUL = (
    *("hsllib", "pardisolib", "output_file", "option_file_name", "linear_solver", "jac_c_constant"),
    *("print_level", "file_print_level", "print_user_options", "replace_bounds", "sb", "library"),
    *("hessian_approximation", "jit", "plugin", "", "MU_INIT", "mu_init "),
)


@pytest.mark.parametrize("name", HARMFUL)
def test_a_file_may_set_only_what_is_known_to_be_harmless(name: str) -> None:
    said = refuse_solver_option(name, 1)
    assert said is not None
    assert f"'{name}'" in said
    with pytest.raises(ValueError, match="may not set"):
        FileOptions.model_validate({"solver_options": {name: 1}})


def test_a_call_may_set_any_option_of_the_solver() -> None:
    chosen = {"print_level": 0, "linear_solver": "mumps"}
    assert resolve(solver_options=chosen).solver_options == chosen
    assert quito.solve(load_text(PUSH, "p.yaml"), steps=5, solver_options=chosen).success


def test_nothing_on_the_list_takes_a_free_text() -> None:
    """Whatever a file may set is a number or one of a few words, so that no path gets through."""
    for name, choices in requested._ALLOWED.items():
        assert refuse_solver_option(name, "/etc/passwd") is not None
        assert refuse_solver_option(name, math.nan) is not None
        if choices is None:
            assert refuse_solver_option(name, True) is not None
            assert refuse_solver_option(name, 1) is None
        else:
            assert all(refuse_solver_option(name, choice) is None for choice in choices)
        assert not any(word in name for word in ("file", "lib", "path", "solver", "print"))


def test_everything_on_the_list_is_an_option_of_ipopt() -> None:
    """Each with a value that IPOPT takes; a name that it does not know would be refused."""
    one = {
        "watchdog_shortened_iter_trigger": 1,
        "max_cpu_time": 60.0,
        "max_wall_time": 60.0,
        "acceptable_iter": 0,
        "mu_init": 1e-2,
        "mu_max": 1e3,
        "mu_min": 1e-12,
        "mu_target": 0.0,
        "bound_relax_factor": 0.0,
        "kappa_sigma": 1e10,
        "max_soc": 4,
        "max_refinement_steps": 10,
        "mu_superlinear_decrease_power": 1.5,
        "mu_linear_decrease_factor": 0.2,
        "tau_min": 0.99,
        "kappa_d": 1e-5,
    }
    problem = load_text(PUSH, "push.yaml")
    for name, choices in requested._ALLOWED.items():
        value: Any = choices[0] if choices else one.get(name, 1e-2)
        if name in {"start_with_resto", "accept_every_trial_step", "mehrotra_algorithm"}:
            value = "no"
        solution = quito.solve(problem, steps=3, max_iterations=2, solver_options={name: value})
        assert solution.options["solver_options"] == {name: value}


@pytest.mark.parametrize(
    ("short", "row"),
    [("sqpmethod", "sqp-qrqp"), ("scipy", "scipy-trust-constr"), ("fmincon", "scipy-trust-constr")],
)
def test_families_of_solvers_by_their_own_names(short: str, row: str) -> None:
    assert Options.resolve(FileOptions(), {"solver": short}).solver == row
    assert Options.resolve(FileOptions.model_validate({"solver": short}), {}).solver == row
