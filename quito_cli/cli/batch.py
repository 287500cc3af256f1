"""`quito batch`: many cases in, a verdict out."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from quito_cli.cli.options import Cluster, Settings, of_a_solve
from quito_cli.cli.output import check_folder
from quito_cli.cli.reports import (
    BaselineFile,
    Html,
    Junit,
    Markdown,
    Plots,
    UpdateBaseline,
    Wanted,
)
from quito_cli.cli.stopping import Stopping

if TYPE_CHECKING:
    from quito_cli.batch.report import Report


@of_a_solve
def batch(
    targets: Annotated[
        list[str],
        typer.Argument(
            metavar="SUITE.yaml|FILE...",
            help="A suite, or problem files; or names of bundled ones.",
        ),
    ],
    *,
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
    options: dict[str, Any],
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
    with Stopping(output) as stopping:
        from quito_cli.batch.running import gathered, known, run_suite
        from quito_cli.cli.cases import print_cases
        from quito_cli.cli.live import Live
        from quito_cli.problem.load import parse_settings

        wanted = Wanted(baseline, update_baseline, junit, markdown, html, plots)
        check_folder(output)
        kept = known(keep)
        wanted.check(keep)
        suite = gathered(
            targets,
            options=options,
            constants=dict(parse_settings(settings or [], "--set")),
            only=only or (),
            time_limit=time_limit,
            memory_limit=memory_limit,
        )
        if listed:
            print_cases(suite, as_json=as_json)
            return
        live = Live(len(suite.cases), silent=as_json, quiet=quiet, verbose=verbose)
        with live:
            stopping.live = live
            report = run_suite(
                suite,
                jobs=jobs,
                cluster=cluster,
                output=output,
                keep=kept,
                resume=resume,
                fail_fast=fail_fast,
                baseline=baseline,
                update_baseline=update_baseline,
                watcher=live,
            )
        files = wanted.write(report)
        files += tuple(report.save_sweeps()) if sweeps else ()
        _report(report, files, as_json=as_json, quiet=quiet, verbose=verbose)
        if update_baseline and not report.recorded:
            typer.echo(f"{baseline} is as it was: the run stopped before its end.", err=True)
        if report.interrupted:
            stopping.leave()
    if report.exit_code:
        raise typer.Exit(report.exit_code)


def _report(
    report: Report,
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
        print_summary(report, report.folder, verbose=verbose)
    if not quiet and files:
        typer.echo(f"Saved {', '.join(map(str, files))}")
