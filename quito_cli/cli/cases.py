"""Cases of a suite for people and for programs: before a run, and after it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from quito_cli.cli.live import COLOURS, lines_of
from quito_cli.cli.text import columns, plain
from quito_cli.summary.dictionary import finite

if TYPE_CHECKING:
    from collections.abc import Sequence

    from quito_cli.batch.case import Case, Finished
    from quito_cli.batch.suite import Suite

_FIGURES = ("cost", "iterations", "cells", "violation", "ringing")
"""Of the table."""
_FEW = 30
"""Cases of which those that did not pass need not be shown again."""


def print_cases(suite: Suite, *, as_json: bool) -> None:
    """Print the cases of a suite."""
    if as_json:
        cases = [_as_data(case) for case in suite.cases]
        typer.echo(json.dumps({"suite": suite.name, "cases": cases}, ensure_ascii=False))
        return
    rows = [
        [
            case.name,
            Path(case.problem).name,
            " ".join(
                f"{key}={value}" for key, value in [*case.options.items(), *case.constants.items()]
            ),
            str(len(case.expectations)),
        ]
        for case in suite.cases
    ]
    typer.echo(columns([["case", "problem", "options", "checks"], *rows], indent="", header=True))


def print_json(suite: Suite, finished: Sequence[Finished]) -> None:
    """Print what became of the cases, as one JSON object."""
    from quito_cli.batch.journal import as_data
    from quito_cli.batch.recorded import counted, exit_code

    said = {
        "suite": suite.name,
        "title": suite.title,
        "exit_code": exit_code(finished),
        "counts": {ending.name.lower(): count for ending, count in counted(finished).items()},
        "not_begun": len(suite.cases) - len(finished),
        "cases": [
            {
                **as_data(one),
                "ending": one.ending.name.lower(),
                "result": None if one.result is None else str(one.result),
                **_as_data(one.case),
            }
            for one in finished
        ],
    }
    typer.echo(json.dumps(finite(said), ensure_ascii=False))


def print_summary(
    suite: Suite, finished: Sequence[Finished], folder: Path, *, verbose: bool
) -> None:
    """Print how many cases ended how, and again those that did not pass where they are far up."""
    from quito_cli.batch.recorded import counted, exit_code

    failed = [one for one in finished if one.ending.exit_code]
    if len(finished) > _FEW and failed and not verbose:
        typer.echo("")
        for one in failed:
            typer.echo("\n".join(lines_of(one, every_check=False)))
    if verbose:
        typer.echo(f"\n{_table(finished)}")
    counts = [
        f"{count} {ending.name.lower().replace('_', ' ')}"
        for ending, count in counted(finished).items()
    ]
    left = len(suite.cases) - len(finished)
    counts += [f"{left} not begun"] if left else []
    verdict = f"{suite.name}: {', '.join(counts) or 'no cases'}"
    colour = COLOURS.get(exit_code(finished), "red")
    typer.echo(f"\n{typer.style(plain(verdict), fg=colour, bold=True)}   in {folder}")


def _table(finished: Sequence[Finished]) -> str:
    rows = [
        [
            one.case.name,
            one.ending.name.lower().replace("_", " "),
            *(_figure(one.figures.get(name)) for name in _FIGURES),
            f"{one.seconds:.2f}",
        ]
        for one in finished
    ]
    return columns([["case", "ended", *_FIGURES, "seconds"], *rows], indent="", header=True)


def _figure(value: Any) -> str:
    if value is None:
        return "-"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _as_data(case: Case) -> dict[str, Any]:
    """Return what a case is, for programs."""
    return {
        "case": case.name,
        "problem": case.problem,
        "options": dict(case.options),
        "set": dict(case.constants),
        "axes": dict(case.axes),
        "follows": case.follows,
        "expect": [
            {key: value for key, value in vars(one).items() if value is not None}
            for one in case.expectations
        ],
    }
