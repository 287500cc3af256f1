"""`quito compare`: an answer held against what is known, and against other methods; or results."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from quito_cli.cli.options import (
    AsJson,
    GeneratingFunction,
    MaxIterations,
    Quiet,
    Settings,
    Steps,
    Substeps,
    Tolerance,
)
from quito_cli.cli.output import Picture, check_folder, check_picture
from quito_cli.cli.solve import INTERRUPTED
from quito_cli.errors import UsageError
from quito_cli.options import Options

if TYPE_CHECKING:
    from quito_cli.cli.progress import ProgressLine
    from quito_cli.comparison.comparison import Comparison
    from quito_cli.solvers.outcome import Progress

_RESULTS = (".h5", ".hdf5")


def _limit(name: str, what: str) -> Any:
    return typer.Option(f"--max-{name}", metavar="LIMIT", help=f"Gate: {what}.")


def compare(
    targets: Annotated[
        list[str],
        typer.Argument(
            metavar="PROBLEM|RESULT.h5...",
            help="A problem file, or the name of a bundled one; or two results or more.",
        ),
    ],
    against: Annotated[
        list[str] | None,
        typer.Option(
            metavar="METHOD,...",
            help="Methods to solve it by, too: lgr (N/4 intervals of degree 4), lgr:KxD (K "
            "intervals of degree D), hermite-simpson (piecewise linear controls, as DIRCOL), "
            "piecewise-constant (as MISER and ACADO), adaptive (ours on a mesh that follows the "
            "control), polished (that, and Pontryagin's conditions solved with its structure), or "
            "a generating function: gaussian, "
            "laguerre4, laguerre6, hermite10, trigonometric, sech. And self: a finer solve, of "
            "four times the cells, as the truth; so it is where the file has no reference. May be "
            "repeated.",
        ),
    ] = None,
    result: Annotated[
        Path | None,
        typer.Option(help="A saved answer of this very problem, in the place of our solve."),
    ] = None,
    samples: Annotated[
        int | None,
        typer.Option(help="n of the sampled norms. [default: four for each of our cells]"),
    ] = None,
    zone: Annotated[
        float | None,
        typer.Option(
            help="Half the width of the jump zones around the known switching times, as a fraction "
            "of the horizon. [default: 0.01]",
        ),
    ] = None,
    steps: Steps = None,
    variance: Annotated[
        float | None,
        typer.Option(help=f"Shape parameter D. [default: {Options.variance:g}]"),
    ] = None,
    generating_function: GeneratingFunction = None,
    discretization: Annotated[
        str | None, typer.Option(help=f"As in solve. [default: {Options.discretization}]")
    ] = None,
    substeps: Substeps = None,
    mesh: Annotated[
        str | None,
        typer.Option(help=f"Of our row: uniform or adaptive. [default: {Options.mesh}]"),
    ] = None,
    polish: Annotated[
        bool | None,
        typer.Option(
            "--polish/--no-polish",
            help="Of our row: as in solve. [default: no-polish]",
            show_default=False,
        ),
    ] = None,
    tolerance: Tolerance = None,
    max_iterations: MaxIterations = None,
    solver: Annotated[
        str | None, typer.Option(help=f"One of `quito solvers`. [default: {Options.solver}]")
    ] = None,
    settings: Settings = None,
    max_error_l2: Annotated[
        float | None, _limit("error-l2", "the true L2 norm of the control error, at most")
    ] = None,
    max_error_l1: Annotated[float | None, _limit("error-l1", "its L1 norm")] = None,
    max_error_sup: Annotated[float | None, _limit("error-sup", "its largest value")] = None,
    max_error_sup_outside: Annotated[
        float | None, _limit("error-sup-outside", "its largest value outside of the jump zones")
    ] = None,
    max_error_norm: Annotated[
        float | None, _limit("error-norm", "the 2-norm of the vector of its samples")
    ] = None,
    max_cost_error: Annotated[
        float | None, _limit("cost-error", "the size of the cost error")
    ] = None,
    max_state_error: Annotated[
        float | None, _limit("state-error", "error of a state over the size of that state")
    ] = None,
    max_switching_error: Annotated[
        float | None, _limit("switching-error", "error of the switching times")
    ] = None,
    max_total_variation: Annotated[
        float | None, _limit("total-variation", "of all controls together")
    ] = None,
    max_ringing: Annotated[float | None, _limit("ringing", "the ringing index")] = None,
    max_violation: Annotated[
        float | None, _limit("violation", "of any constraint, between the nodes too")
    ] = None,
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for the pictures.")] = Path(
        "results"
    ),
    picture: Picture = "png",
    no_plot: Annotated[bool, typer.Option("--no-plot", help="Draw no pictures.")] = False,
    as_json: AsJson = False,
    markdown: Annotated[
        bool, typer.Option("--markdown", help="Print the tables as Markdown.")
    ] = False,
    latex: Annotated[bool, typer.Option("--latex", help="Print the tables as LaTeX.")] = False,
    quiet: Quiet = False,
    verbose: Annotated[
        bool,
        typer.Option(
            "--verbose",
            "-v",
            help="Say what the columns mean, and show each of several controls by itself.",
        ),
    ] = False,
) -> None:
    """Compare an answer with what is known of it, and with what other methods find.

    The first row is ours, and the gates are limits of that row alone, or of the others where the
    first of saved results is what they are held against: exit code 3 where one is not kept.
    Tolerance, iterations, solver and --set hold for all methods; -N for all but lgr:KxD; variance,
    discretization and substeps for ours and those that differ from it by their control alone, the
    generating functions and piecewise-constant. Where the final time is free, all are compared on
    the time that they have in common.

    Results are held against the reference of their file where they all state the same problem and
    the file knows the control, and against the first of them otherwise. They must have the same
    states and controls.
    """
    limits = {
        "error-l2": max_error_l2,
        "error-l1": max_error_l1,
        "error-sup": max_error_sup,
        "error-sup-outside": max_error_sup_outside,
        "error-norm": max_error_norm,
        "cost-error": max_cost_error,
        "state-error": max_state_error,
        "switching-error": max_switching_error,
        "total-variation": max_total_variation,
        "ringing": max_ringing,
        "violation": max_violation,
    }
    options = {
        "steps": steps,
        "variance": variance,
        "generating_function": generating_function,
        "discretization": discretization,
        "substeps": substeps,
        "mesh": mesh,
        "polish": polish,
        "tolerance": tolerance,
        "max_iterations": max_iterations,
        "solver": solver,
    }
    measures = {name: v for name, v in (("samples", samples), ("zone", zone)) if v is not None}
    _one_format(as_json, markdown, latex)
    check_picture(picture)
    if not no_plot:
        check_folder(output)
    from quito_cli.cli.progress import ProgressLine
    from quito_cli.comparison.gates import check_gates, check_limits

    check_limits(limits)
    with ProgressLine(quiet=quiet, every_line=False) as progress:
        found = _compared(targets, against, result, settings, options, measures, progress)
    drawn = () if no_plot else _draw(found, output, picture)
    if as_json:
        _print_json(found, drawn)
    elif markdown or latex:
        _print_table(found, latex=latex)
    elif not quiet:
        from quito_cli.cli.comparison import print_comparison

        print_comparison(found, drawn, verbose=verbose)
    if found.interrupted:
        raise typer.Exit(INTERRUPTED)
    if found.truth is None or not found.rows[0].solution.success:
        raise typer.Exit(1)
    check_gates(found, limits)
    if not all(row.solution.success for row in found.rows):
        raise typer.Exit(1)


def _one_format(*wanted: bool) -> None:
    """Refuse two formats on one stdout."""
    if sum(wanted) > 1:
        raise UsageError("--json, --markdown and --latex exclude each other")


def _compared(
    targets: list[str],
    against: list[str] | None,
    result: Path | None,
    settings: list[str] | None,
    options: dict[str, Any],
    measures: dict[str, Any],
    progress: ProgressLine,
) -> Comparison:
    """Return the comparison of a problem, or of results: told apart by content."""
    from quito_cli.comparison.compare import compare as of_problem
    from quito_cli.comparison.results import compare_results
    from quito_cli.problem.load import parse_settings
    from quito_cli.solution.store import is_result

    def result_given(target: str) -> bool:
        return Path(target).suffix in _RESULTS or is_result(Path(target))

    if any(map(result_given, targets)):
        given = {"--against": against, "--result": result, "--set": settings}
        given |= {f"--{name.replace('_', '-')}": value for name, value in options.items()}
        for option, value in given.items():
            if value not in (None, []):
                raise UsageError(f"{option} belongs to a problem, not to saved results")
        return compare_results(targets, **measures)
    if len(targets) > 1:
        raise UsageError(f"one problem at a time: {', '.join(targets)} are {len(targets)}")

    def show(method: str, reached: Progress) -> None:
        progress.heading = f"{method}   "
        if progress.listener is not None:
            progress.listener(reached)

    return of_problem(
        targets[0],
        against or (),
        result=result,
        constants=parse_settings(settings or [], "--set"),
        listener=show if progress.listener is not None else None,
        **measures,
        **options,
    )


def _draw(found: Comparison, output: Path, picture: str) -> tuple[Path, ...]:
    from quito_cli.plots.comparison import draw_all

    return draw_all(found, output, picture)


def _print_json(found: Comparison, drawn: tuple[Path, ...]) -> None:
    from quito_cli.comparison.dictionary import as_dictionary
    from quito_cli.summary.dictionary import finite

    said = as_dictionary(found) | {"plots": [str(path) for path in drawn]}
    typer.echo(json.dumps(finite(said), ensure_ascii=False))


def _print_table(found: Comparison, *, latex: bool) -> None:
    from quito_cli.cli.text import plain
    from quito_cli.comparison import writing

    typer.echo(plain(writing.latex(found) if latex else writing.markdown(found)))
