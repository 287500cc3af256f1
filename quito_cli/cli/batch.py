"""`quito batch`: many cases in, a verdict out."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from quito_cli.cli.options import (
    Cluster,
    GeneratingFunction,
    MaxIterations,
    Settings,
    Steps,
    Substeps,
    Tolerance,
)
from quito_cli.cli.output import check_folder, check_jobs
from quito_cli.cli.reports import (
    BaselineFile,
    Html,
    Junit,
    Markdown,
    Plots,
    UpdateBaseline,
    Wanted,
)
from quito_cli.cli.solve import INTERRUPTED
from quito_cli.errors import UsageError
from quito_cli.solve import Options

if TYPE_CHECKING:
    from quito_cli.batch.case import Finished
    from quito_cli.batch.report import Report
    from quito_cli.batch.run import Setting
    from quito_cli.batch.solving import Keep
    from quito_cli.batch.suite import Suite
    from quito_cli.cli.live import Live

_KEEPS: tuple[Keep, ...] = ("all", "failed", "none")


def batch(
    targets: Annotated[
        list[str],
        typer.Argument(
            metavar="SUITE.yaml|FILE...",
            help="A suite, or problem files; or names of bundled ones.",
        ),
    ],
    jobs: Annotated[
        int | None,
        typer.Option("-j", "--jobs", help="Cases at once. [default: as many as processors]"),
    ] = None,
    cluster: Cluster = None,
    output: Annotated[
        Path, typer.Option("-o", "--output", help="Folder for results and the journal.")
    ] = Path("results"),
    time_limit: Annotated[
        float | None,
        typer.Option(metavar="SECONDS", help="Of each case; wins over the suite's."),
    ] = None,
    memory_limit: Annotated[
        str | None,
        typer.Option(metavar="SIZE", help="Of each case, such as 2GB; wins over the suite's."),
    ] = None,
    keep: Annotated[
        str,
        typer.Option(help="Result files that stay: all, failed (of cases that do not pass), none."),
    ] = "all",
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on where a run of these cases stopped.")
    ] = False,
    only: Annotated[
        list[str] | None,
        typer.Option(
            "--filter",
            metavar="PATTERN",
            help="Cases whose name has this in it, or is it, with * and ?; may be repeated.",
        ),
    ] = None,
    fail_fast: Annotated[
        bool, typer.Option("--fail-fast", help="Stop at the first case that does not pass.")
    ] = False,
    sweeps: Annotated[
        bool,
        typer.Option(
            "--sweeps", help="Write an HDF5 and pictures of each sweep and matrix of the suite."
        ),
    ] = False,
    listed: Annotated[bool, typer.Option("--list", help="Show the cases, and solve none.")] = False,
    steps: Steps = None,
    variance: Annotated[
        float | None,
        typer.Option(
            help=f"Shape parameter D of the generating function. [default: {Options.variance:g}]"
        ),
    ] = None,
    generating_function: GeneratingFunction = None,
    discretization: Annotated[
        str | None,
        typer.Option(help=f"As in `quito solve`. [default: {Options.discretization}]"),
    ] = None,
    substeps: Substeps = None,
    mesh: Annotated[
        str | None, typer.Option(help=f"uniform or adaptive. [default: {Options.mesh}]")
    ] = None,
    tolerance: Tolerance = None,
    max_iterations: MaxIterations = None,
    solver: Annotated[
        str | None, typer.Option(help=f"One of `quito solvers`. [default: {Options.solver}]")
    ] = None,
    settings: Settings = None,
    baseline: BaselineFile = None,
    update_baseline: UpdateBaseline = False,
    junit: Junit = None,
    markdown: Markdown = None,
    html: Html = None,
    plots: Plots = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object, and nothing else.")
    ] = False,
    quiet: Annotated[
        bool, typer.Option("--quiet", "-q", help="Print cases that do not pass, and no others.")
    ] = False,
    verbose: Annotated[
        bool, typer.Option("--verbose", "-v", help="Print every check, and a table at the end.")
    ] = False,
) -> None:
    """Solve the cases of a suite, each in a process that may fail alone; hold them to what is
    expected.

    Options of the solves are for problem files: a suite says its own.

    Exit codes: 0 all as expected, 3 something outside its tolerance or worse than the baseline, 1
    something did not solve, 2 a wrong suite or a case that was refused, 130 interrupted.
    """
    from quito_cli.batch.gathering import gather, selected
    from quito_cli.batch.holding import report_of
    from quito_cli.batch.recorded import limited
    from quito_cli.batch.run import Setting, available
    from quito_cli.problem.load import parse_settings

    options = {
        "steps": steps,
        "variance": variance,
        "generating_function": generating_function,
        "discretization": discretization,
        "substeps": substeps,
        "mesh": mesh,
        "tolerance": tolerance,
        "max_iterations": max_iterations,
        "solver": solver,
    }
    given = {name: value for name, value in options.items() if value is not None}
    wanted = Wanted(baseline, update_baseline, junit, markdown, html, plots)
    check_folder(output)
    kept = _checked(keep)
    check_jobs(jobs, cluster)
    wanted.check(keep)
    suite = gather(targets, given, parse_settings(settings or [], "--set"))
    suite = limited(selected(suite, only or []), time_limit, memory_limit)
    if listed:
        from quito_cli.cli.cases import print_cases

        print_cases(suite, as_json=as_json)
        return
    from quito_cli.cli.live import Live

    workers = jobs or available()
    holding = wanted.prepare(min(workers, len(suite.cases)) if cluster is None else None)
    record = holding.baseline.costly if holding else ()
    live = Live(len(suite.cases), silent=as_json, quiet=quiet, verbose=verbose)
    setting = Setting(workers, output, kept, suite.limits, record, cluster=cluster)
    began = time.perf_counter()
    finished, interrupted = _run(suite, setting, live, resume=resume, fail_fast=fail_fast)
    seconds = time.perf_counter() - began
    report = report_of(suite, finished, seconds, holding, whole=not only)
    files = wanted.write(report)
    if sweeps:
        files += _write_sweeps(suite, finished, output)
    _report(report, output, files, as_json=as_json, quiet=quiet, verbose=verbose)
    if update_baseline and not report.recorded:
        typer.echo(f"{baseline} is as it was: the run stopped before its end.", err=True)
    _leave(report, interrupted)


def _checked(keep: str) -> Keep:
    """Return which result files stay; refuse what means nothing."""
    for known in _KEEPS:
        if keep == known:
            return known
    raise UsageError(f"keep: expected {', '.join(_KEEPS[:-1])} or {_KEEPS[-1]}, got {keep!r}")


def _run(
    suite: Suite, setting: Setting, live: Live, *, resume: bool, fail_fast: bool
) -> tuple[tuple[Finished, ...], bool]:
    """Return what became of the cases, in their order, and whether the user stopped it."""
    from dataclasses import replace

    from quito_cli.batch.case import Ending
    from quito_cli.batch.recorded import in_order, recorded
    from quito_cli.solvers.interruption import interruptible

    finished: list[Finished] = []
    with interruptible() as interruption, live:

        def stop() -> bool:
            live.draw()
            failed = fail_fast and any(one.ending is not Ending.PASSED for one in finished)
            return interruption.requested or failed

        setting = replace(setting, stop=stop, watch=live.watch if live.moving else None)
        for one in recorded(suite, setting, resume=resume):
            finished.append(one)
            live.show(one)
        return in_order(suite, finished), interruption.requested


def _report(
    report: Report,
    folder: Path,
    files: tuple[Path, ...],
    *,
    as_json: bool,
    quiet: bool,
    verbose: bool,
) -> None:
    """Say what became of the cases."""
    from quito_cli.cli.cases import print_differences, print_json, print_summary

    if as_json:
        print_json(report)
        return
    print_differences(report, quiet=quiet)
    if not quiet:
        print_summary(report, folder, verbose=verbose)
    if not quiet and files:
        typer.echo(f"Saved {', '.join(map(str, files))}")


def _write_sweeps(suite: Suite, finished: tuple[Finished, ...], folder: Path) -> tuple[Path, ...]:
    """Write and draw the grids of a suite; return the paths."""
    from quito_cli.batch.dataset import save
    from quito_cli.batch.sweep import collected
    from quito_cli.batch.sweeping import SHOWN, SUFFIX, grids
    from quito_cli.plots.sweep import draw_all

    written: list[Path] = []
    for grid in grids(suite):
        swept = collected(grid, finished)
        path = folder / f"{grid.name}{SUFFIX}.h5"
        save(swept, path)
        written += (path, *draw_all(swept, SHOWN, folder, "png"))
    return tuple(written)


def _leave(report: Report, interrupted: bool) -> None:
    """Exit with what the run came to."""
    if interrupted:
        begun = f"{len(report.finished)} of {report.cases} cases"
        typer.echo(f"Interrupted; {begun} had begun: --resume goes on.", err=True)
        raise typer.Exit(INTERRUPTED)
    if report.exit_code:
        raise typer.Exit(report.exit_code)
