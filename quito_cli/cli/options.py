"""Options that several commands take, each with its help."""

from __future__ import annotations

from typing import Annotated

import typer

from quito_cli.solve import Options

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
