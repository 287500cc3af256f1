"""Cases of a suite for people and for programs: before a run, and after it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from quito_cli.cli.live import COLOURS, lines_of
from quito_cli.cli.text import columns, plain
from quito_cli.summary.dictionary import finite

if TYPE_CHECKING:
    from quito_cli.batch.reports.report import Report
    from quito_cli.batch.suite.case import Case
    from quito_cli.batch.suite.suite import Suite

_MOST = 40
"""Differences from a baseline that are shown."""
_FEW = 30
"""Cases of which those that did not pass need not be shown again."""


def print_cases(suite: Suite, *, as_json: bool) -> None:
    """Print the cases of a suite."""
    if as_json:
        from quito_cli.batch.reports.dictionary import of_case

        cases = [of_case(case) for case in suite.cases]
        typer.echo(json.dumps({"suite": suite.name, "cases": cases}, ensure_ascii=False))
        return
    rows = [
        [case.name, Path(case.problem).name, _given(case), str(len(case.expectations))]
        for case in suite.cases
    ]
    typer.echo(columns([["case", "problem", "options", "checks"], *rows], indent="", header=True))


def _given(case: Case) -> str:
    """Return options and constants of a case, as its name has them."""
    from quito_cli.batch.suite.axes import text_of

    both = [*case.options.items(), *case.constants.items()]
    return " ".join(f"{key}={text_of(value)}" for key, value in both)


def print_json(report: Report) -> None:
    """Print what became of the cases, as one JSON object."""
    from quito_cli.batch.reports.dictionary import as_dictionary

    typer.echo(json.dumps(finite(as_dictionary(report)), ensure_ascii=False))


def print_summary(report: Report, folder: Path, *, verbose: bool) -> None:
    """Print how many cases ended how, and again those that did not pass where they are far up."""
    failed = [one for one in report.finished if one.ending.exit_code]
    if len(report.finished) > _FEW and failed and not verbose:
        typer.echo("")
        for one in failed:
            typer.echo("\n".join(lines_of(one, every_check=False)))
    if verbose:
        typer.echo(f"\n{_table(report)}")
    counts = [
        f"{count} {ending.name.lower().replace('_', ' ')}"
        for ending, count in report.counts.items()
    ]
    gone = len(report.gone)
    worse = len(report.failing) - gone
    counts += [f"{worse} worse than the baseline"] if worse else []
    counts += [f"{gone} missing"] if gone else []
    left = report.cases - len(report.finished)
    counts += [f"{left} not begun"] if left else []
    verdict = f"{report.suite}: {', '.join(counts) or 'no cases'}"
    colour = COLOURS.get(report.exit_code, "red")
    typer.echo(f"\n{typer.style(plain(verdict), fg=colour, bold=True)}   in {folder}")


def print_differences(report: Report, *, quiet: bool) -> None:
    """Print how a run differs from its baseline; in quiet, only what is for the worse."""
    from quito_cli.batch.reports.table import DIFFERENCES, differences

    if report.baseline is None:
        return
    rows = [row for row in differences(report) if not quiet or row[0] in ("worse", "missing")]
    if rows:
        typer.echo(f"\n{columns([DIFFERENCES, *rows[:_MOST]], indent='', header=True)}")
    if len(rows) > _MOST:
        typer.echo(f"... and {len(rows) - _MOST} more; --json has them all")
    if not quiet or rows:
        typer.echo(f"\n{report.against} ({report.baseline})")


def _table(report: Report) -> str:
    from quito_cli.batch.reports.table import table

    made = table(report)
    head = ["case", "ended", *(column.heading for column in made.columns), "time"]
    rows = [[row.name, row.result, *row.cells, row.seconds] for row in made.rows]
    return columns([head, *rows], indent="", header=True)
