"""`quito solve`: a problem file in, a result file, a picture and a summary out."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from quito_cli.cli.options import (
    Control,
    Degree,
    Discretization,
    GeneratingFunction,
    MaxIterations,
    Mesh,
    Polish,
    Settings,
    Solver,
    Steps,
    Substeps,
    Tolerance,
    Variance,
)
from quito_cli.cli.output import Picture, check_folder, check_picture
from quito_cli.errors import UsageError
from quito_cli.solve import Options
from quito_cli.solve import solve as run

INTERRUPTED = 130


def solve(
    problem: Annotated[str, typer.Argument(help="A problem file, or the name of a bundled one.")],
    steps: Steps = None,
    variance: Variance = None,
    generating_function: GeneratingFunction = None,
    normalised: Annotated[
        bool | None,
        typer.Option(
            "--normalised/--as-printed",
            help="Divide by the sum of weights, or take the paper's sum as printed. "
            "[default: normalised]",
            show_default=False,
        ),
    ] = None,
    control: Control = None,
    discretization: Discretization = None,
    substeps: Substeps = None,
    degree: Degree = None,
    mesh: Mesh = None,
    mesh_steps: Annotated[
        int | None,
        typer.Option(
            help="With adaptive: cells to start from, unless -N says so. "
            f"[default: {Options.mesh_steps}]"
        ),
    ] = None,
    mesh_tolerance: Annotated[
        float | None,
        typer.Option(
            help="With adaptive: change of the controls from mesh to mesh, outside jumps and "
            f"relative to their range, at which to end. [default: {Options.mesh_tolerance:g}]"
        ),
    ] = None,
    mesh_iterations: Annotated[
        int | None,
        typer.Option(help=f"With adaptive: meshes at most. [default: {Options.mesh_iterations}]"),
    ] = None,
    mesh_limit: Annotated[
        int | None,
        typer.Option(
            help="With adaptive: cells at most. [default: twice those to start from]",
            show_default=False,
        ),
    ] = None,
    polish: Polish = None,
    explain: Annotated[
        bool,
        typer.Option(
            "--explain", help="Of a polish, say step by step what was assumed, tried and found."
        ),
    ] = False,
    tolerance: Tolerance = None,
    max_iterations: MaxIterations = None,
    solver: Solver = None,
    objective_scale: Annotated[
        float | None,
        typer.Option(help="Factor of the cost in the solver. [default: by the cost's size]"),
    ] = None,
    path_points: Annotated[
        str | None,
        typer.Option(
            help="Where path constraints hold: nodes or substeps. [default: substeps for those "
            "with a control, nodes for those of states alone]",
            show_default=False,
        ),
    ] = None,
    guess: Annotated[
        Path | None,
        typer.Option(help="An earlier result to start from, whatever its mesh."),
    ] = None,
    warm_start: Annotated[
        bool,
        typer.Option(
            "--warm-start", help="With --guess: start from its multipliers and bounds, too."
        ),
    ] = False,
    solver_option: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KEY=VALUE", help="An option of the solver by its own name; may be repeated."
        ),
    ] = None,
    settings: Settings = None,
    output: Annotated[
        Path, typer.Option("-o", "--output", help="Folder for the result and the picture.")
    ] = Path("results"),
    picture: Picture = "png",
    no_plot: Annotated[bool, typer.Option("--no-plot", help="Draw no picture.")] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object, and nothing else.")
    ] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only.")] = False,
    verbose: Annotated[
        bool, typer.Option("--verbose", "-v", help="Print every iteration and all evidence.")
    ] = False,
) -> None:
    """Solve a problem: save trajectory and picture."""
    from quito_cli.cli.progress import ProgressLine
    from quito_cli.cli.report import print_solution
    from quito_cli.problem.load import load, parse_settings
    from quito_cli.summary.dictionary import as_dictionary

    constants = parse_settings(settings or [], "--set")
    solver_options = _solver_options(parse_settings(solver_option or [], "--solver-option"))
    check_picture(picture)
    check_folder(output)
    loaded = load(problem, constants)
    if explain:
        _refuse_unexplained(loaded.options.polish if polish is None else polish, as_json or quiet)
    with ProgressLine(quiet=quiet, every_line=verbose and not as_json) as progress:
        solution = run(
            loaded,
            listener=progress.listener,
            steps=steps,
            variance=variance,
            generating_function=generating_function,
            normalised=normalised,
            control=control,
            discretization=discretization,
            substeps=substeps,
            degree=degree,
            mesh=mesh,
            mesh_steps=mesh_steps,
            mesh_tolerance=mesh_tolerance,
            mesh_iterations=mesh_iterations,
            mesh_limit=mesh_limit,
            polish=polish,
            tolerance=tolerance,
            max_iterations=max_iterations,
            solver=solver,
            objective_scale=objective_scale,
            path_points=path_points,
            guess=guess,
            warm_start=warm_start or None,
            solver_options=solver_options or None,
        )
    result = output / f"{loaded.name}.h5"
    solution.save(result)
    plotted = None
    if not no_plot:
        from quito_cli.plots.figure import DEFAULT, draw

        plotted = output / f"{loaded.name}.{picture}"
        draw(solution, DEFAULT, plotted)
    if as_json:
        typer.echo(json.dumps(as_dictionary(solution, result, plotted), ensure_ascii=False))
    elif not quiet:
        print_solution(solution, verbose=verbose, files=(result, plotted), explain=explain)
    if solution.interrupted:
        raise typer.Exit(INTERRUPTED)
    if not solution.success:
        raise typer.Exit(1)


def _refuse_unexplained(polish: bool | None, silent: bool) -> None:
    """Refuse to explain a polish that is not asked for, or where nothing is printed.

    Raises:
        UsageError: saying what to do instead.
    """
    if not polish:
        raise UsageError("--explain tells what a polish did: add --polish")
    if silent:
        raise UsageError(
            "--explain prints a page: leave --json and --quiet out; --json has the account of a "
            "polish in any case, and quito show RESULT.h5 --explain prints it later"
        )


def _solver_options(given: dict[str, str]) -> dict[str, Any]:
    """Return texts of the command line as the numbers they look like."""

    def read(text: str) -> int | float | str:
        for kind in (int, float):
            try:
                return kind(text)
            except ValueError:
                pass
        return text

    return {name: read(text) for name, text in given.items()}
