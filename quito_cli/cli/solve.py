"""`quito solve`: a problem file in, a result file, a picture and a summary out."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from quito_cli.cli.options import Settings, of_a_solve
from quito_cli.cli.output import Picture, check_folder, check_picture
from quito_cli.errors import UsageError
from quito_cli.solve import solve as run

INTERRUPTED = 130


@of_a_solve
def solve(
    problem: Annotated[str, typer.Argument(help="A problem file, or the name of a bundled one.")],
    *,
    options: dict[str, Any],
    explain: Annotated[
        bool,
        typer.Option(
            "--explain", help="Of a polish, say step by step what was assumed, tried and found."
        ),
    ] = False,
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
    check_picture(picture)
    check_folder(output)
    loaded = load(problem, constants)
    if explain:
        polish = options.get("polish", loaded.options.polish)
        _refuse_unexplained(polish, as_json or quiet)
    with ProgressLine(quiet=quiet, every_line=verbose and not as_json) as progress:
        solution = run(
            loaded,
            listener=progress.listener,
            guess=guess,
            warm_start=warm_start or None,
            **options,
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
