"""Options that several commands take, each with its help; those of a solve as a table.

    @of_a_solve
    def command(problem: str, *, options: dict[str, Any]) -> None: ...

has every option of the table on its command line, and gets those that were given as `options`.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable
from functools import wraps
from typing import Annotated, Any, Final

import typer

from quito_cli.options import Options

GeneratingFunction = Annotated[
    str | None,
    typer.Option(
        "--generating-function",
        help="gaussian, laguerre4, laguerre6, hermite10, trigonometric or sech; or the paper's "
        f"number, 1 to 6. [default: {Options.generating_function}]",
        show_default=False,
    ),
]
Steps = Annotated[
    int | None,
    typer.Option("-N", "--steps", help=f"Control cells. [default: {Options.steps}]"),
]
Substeps = Annotated[
    int | None,
    typer.Option(help=f"Integration steps in each cell. [default: {Options.substeps}]"),
]
Tolerance = Annotated[
    float | None, typer.Option(help=f"Of the solver. [default: {Options.tolerance:g}]")
]
MaxIterations = Annotated[
    int | None, typer.Option(help=f"Of the solver. [default: {Options.max_iterations}]")
]
Polish = Annotated[
    bool | None,
    typer.Option(
        "--polish/--no-polish",
        help="Solve Pontryagin's conditions with the structure that the answer shows, to near "
        "machine precision; the direct answer stands where that comes to nothing. Takes an "
        "adaptive mesh unless one is asked for. [default: no-polish]",
        show_default=False,
    ),
]
Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="NAME=VALUE",
        help="Set a constant, or a value by its path (states.x1.upper=2); may be repeated.",
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object, and nothing else.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only.")]
Variance = Annotated[
    float | None,
    typer.Option(
        help=f"Shape parameter D of the generating function. [default: {Options.variance:g}]"
    ),
]
Control = Annotated[
    str | None,
    typer.Option(
        help="quasi-interpolant, piecewise-constant or piecewise-linear. "
        f"[default: {Options.control}]"
    ),
]
Discretization = Annotated[
    str | None,
    typer.Option(
        help="euler, trapezoidal, rk4, hermite-simpson or radau; or lgr, collocation. "
        f"[default: {Options.discretization}]"
    ),
]
Degree = Annotated[
    int | None,
    typer.Option(
        help=f"With lgr: degree of the polynomials in each cell. [default: {Options.degree}]"
    ),
]
Mesh = Annotated[
    str | None,
    typer.Option(
        help="uniform, or adaptive: cells that follow the control, small at its jumps and "
        f"kinks. [default: {Options.mesh}]"
    ),
]
Solver = Annotated[
    str | None,
    typer.Option(
        help="One of `quito solvers`, or auto: a quadratic program's own solver where it is "
        f"one. [default: {Options.solver}]"
    ),
]
Cluster = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS",
        help="A Dask scheduler, such as tcp://head-node:8786, whose workers solve the cases.",
    ),
]
Normalised = Annotated[
    bool | None,
    typer.Option(
        "--normalised/--as-printed",
        help="Divide by the sum of weights, or take the paper's sum as printed. "
        "[default: normalised]",
        show_default=False,
    ),
]
MeshSteps = Annotated[
    int | None,
    typer.Option(
        help="With adaptive: cells to start from, unless -N says so. "
        f"[default: {Options.mesh_steps}]"
    ),
]
MeshTolerance = Annotated[
    float | None,
    typer.Option(
        help="With adaptive: change of the controls from mesh to mesh, outside jumps and "
        f"relative to their range, at which to end. [default: {Options.mesh_tolerance:g}]"
    ),
]
MeshIterations = Annotated[
    int | None,
    typer.Option(help=f"With adaptive: meshes at most. [default: {Options.mesh_iterations}]"),
]
MeshLimit = Annotated[
    int | None,
    typer.Option(
        help="With adaptive: cells at most. [default: twice those to start from]",
        show_default=False,
    ),
]
ObjectiveScale = Annotated[
    float | None,
    typer.Option(help="Factor of the cost in the solver. [default: by the cost's size]"),
]
PathPoints = Annotated[
    str | None,
    typer.Option(
        help="Where path constraints hold: nodes or substeps. [default: substeps for those "
        "with a control, nodes for those of states alone]",
        show_default=False,
    ),
]
SolverOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="KEY=VALUE", help="An option of the solver by its own name; may be repeated."
    ),
]
_OF_A_SOLVE: Final = {
    "steps": Steps,
    "variance": Variance,
    "generating_function": GeneratingFunction,
    "normalised": Normalised,
    "control": Control,
    "discretization": Discretization,
    "substeps": Substeps,
    "degree": Degree,
    "mesh": Mesh,
    "mesh_steps": MeshSteps,
    "mesh_tolerance": MeshTolerance,
    "mesh_iterations": MeshIterations,
    "mesh_limit": MeshLimit,
    "polish": Polish,
    "tolerance": Tolerance,
    "max_iterations": MaxIterations,
    "solver": Solver,
    "objective_scale": ObjectiveScale,
    "path_points": PathPoints,
    "solver_option": SolverOption,
}
"""By name of the parameter: a field of Options, or `solver_option`, which becomes one."""


def of_a_solve(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command the options of a solve in the place of its parameter `options`.

    It gets a dictionary of those that were given, as `quito_cli.solve.solve` takes them.
    """
    parameters: list[inspect.Parameter] = []
    for one in inspect.signature(command, eval_str=True).parameters.values():
        if one.name != "options":
            parameters.append(one.replace(kind=one.KEYWORD_ONLY))
            continue
        parameters += [
            inspect.Parameter(name, one.KEYWORD_ONLY, default=None, annotation=kind)
            for name, kind in _OF_A_SOLVE.items()
        ]

    @wraps(command)
    def called(**given: Any) -> None:
        options = {name: given.pop(name, None) for name in _OF_A_SOLVE}
        options["solver_options"] = _solver_options(options.pop("solver_option") or ()) or None
        known = {name: value for name, value in options.items() if value is not None}
        command(options=known, **given)

    called.__annotations__ = {one.name: one.annotation for one in parameters}
    called.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    return called


def _solver_options(given: Iterable[str]) -> dict[str, int | float | str]:
    """Return texts of the command line as the numbers they look like."""
    from quito_cli.problem.load import parse_settings

    def read(text: str) -> int | float | str:
        for kind in (int, float):
            try:
                return kind(text)
            except ValueError:
                pass
        return text

    return {name: read(text) for name, text in parse_settings(given, "--solver-option").items()}
