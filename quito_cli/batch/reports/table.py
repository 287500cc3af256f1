"""Report -> rows and columns of text that terminal, Markdown and page share, said once.

A column is a row of `COLUMNS`; one that no case fills is left out. The differences from a baseline
make a table of their own.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from quito_cli.batch.judging.baseline import ANSWERED, known
from quito_cli.batch.judging.comparing import ENDING, Difference, Verdict
from quito_cli.batch.reports.report import WORDS, Report
from quito_cli.batch.suite.case import Ending, Figure, Finished

MISSING: Final = "-"
"""In the place of a figure that is not known."""
GONE: Final = "in the baseline, and not in the suite any more"
"""What is wrong with a case that is missing."""


@dataclass(frozen=True)
class Column:
    """A figure of every case."""

    figure: str
    heading: str
    format: str
    """As Python formats numbers."""
    help: str


COLUMNS: Final = (
    Column("cost", "cost", ".8g", "as solved"),
    Column("iterations", "iterations", "d", "of the solver"),
    Column("cost_error", "cost error", ".1e", "distance from the cost of the reference"),
    Column("error_l2", "L2 error", ".2g", "of the control against the reference"),
    Column("violation", "violation", ".1e", "of any condition, between the nodes too"),
    Column("ringing", "ringing", ".2g", "ringing index; to about 1 it is none"),
)


@dataclass(frozen=True)
class Row:
    """A case as text."""

    case: Finished
    result: str
    """In a word or two."""
    failed: bool
    cells: tuple[str, ...]
    """By column."""
    values: tuple[float | None, ...]
    """By column, to sort by."""
    reasons: tuple[str, ...]
    """Why it failed, in sentences."""

    @property
    def name(self) -> str:
        """Name of the case."""
        return self.case.case.name

    @property
    def seconds(self) -> str:
        """How long it took."""
        return seconds(self.case.seconds)


@dataclass(frozen=True)
class Table:
    """The cases of a run."""

    columns: tuple[Column, ...]
    rows: tuple[Row, ...]
    """In the order of the run."""

    @property
    def failed(self) -> tuple[Row, ...]:
        """The rows that failed."""
        return tuple(row for row in self.rows if row.failed)

    @property
    def passed(self) -> tuple[Row, ...]:
        """The rows that did not."""
        return tuple(row for row in self.rows if not row.failed)


def table(report: Report) -> Table:
    """Return the table of a run."""
    columns = tuple(
        column
        for column in COLUMNS
        if any(known(case.figures.get(column.figure)) for case in report.finished)
    )
    return Table(columns, tuple(_row(report, case, columns) for case in report.finished))


def _row(report: Report, case: Finished, columns: Sequence[Column]) -> Row:
    found = [case.figures.get(column.figure) for column in columns]
    result = WORDS[case.ending]
    if case.ending is Ending.PASSED and report.failed(case):
        result = "worse"
    return Row(
        case,
        result,
        report.failed(case),
        tuple(text(f, column.format) for f, column in zip(found, columns, strict=True)),
        tuple(map(_number, found)),
        tuple(_reasons(report, case)),
    )


def _reasons(report: Report, case: Finished) -> Iterator[str]:
    yield from (check.sentence for check in case.checks if not check.passed)
    if case.message and case.ending not in ANSWERED:
        yield case.message
    for row in report.failing.get(case.case.name, ()):
        if row.figure != ENDING:
            yield in_a_sentence(row)


def in_a_sentence(row: Difference) -> str:
    """Return a difference as a sentence."""
    before, after = figure(row.recorded), figure(row.found)
    what = "" if row.figure == ENDING else f"{row.figure.replace('_', ' ')} "
    within = "" if row.allowed is None else f" ± {row.allowed:.2g}"
    said = f"{what}is {after}, baseline {before}{within}"
    if row.verdict is Verdict.MISSING:
        said = f"{what}is not known any more, baseline {before}"
    elif row.verdict is Verdict.NEW:
        said = f"{what}is {after}, not in the baseline"
    return f"{said}: {row.note}" if row.note else said


DIFFERENCES: Final = ("verdict", "case", "figure", "baseline", "now", "change", "allowed", "note")
"""Headings of the table of differences."""


def differences(report: Report) -> tuple[tuple[str, ...], ...]:
    """Return the differences from the baseline that are not the same, the worst first."""
    order = list(Verdict)
    rows = [row for row in report.differences if row.verdict is not Verdict.SAME]
    rows.sort(key=lambda row: order.index(row.verdict))
    return tuple(
        (
            row.verdict.value,
            row.case,
            "" if row.figure == ENDING else row.figure.replace("_", " "),
            figure(row.recorded),
            figure(row.found),
            _change(row.recorded, row.found),
            "" if row.allowed is None else f"{row.allowed:.2g}",
            row.note,
        )
        for row in rows
    )


def _change(before: Figure, after: Figure) -> str:
    """Return by how much a figure has changed; of what is no finite number, nothing."""
    a, b = _number(before), _number(after)
    if a is None or b is None or not (math.isfinite(a) and math.isfinite(b)):
        return ""
    percent = 100 * (b - a) / abs(a) if a else math.inf
    if abs(percent) > 1000:
        return f"{b - a:+.2g}"
    part = f" ({percent:{'+.0f' if abs(percent) >= 10 else '+.2g'}} %)"
    return f"{b - a:+.2g}{part}"


def figure(value: Figure) -> str:
    """Return a figure of any kind as text."""
    if isinstance(value, tuple):
        return f"[{', '.join(text(entry, '.7g') for entry in value)}]"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return value if isinstance(value, str) else text(value, ".8g")


def text(value: Figure, format: str) -> str:
    """Return a number as text."""
    number = _number(value)
    if number is None:
        return MISSING if not known(value) else figure(value)
    if number == 0:
        return "0"
    whole = format == "d" and number == int(number) if math.isfinite(number) else False
    return f"{int(number):d}" if whole else f"{number:{'g' if format == 'd' else format}}"


def _number(value: Figure) -> float | None:
    if isinstance(value, bool | str | tuple) or not known(value):
        return None
    assert value is not None
    return float(value)


def seconds(value: float) -> str:
    """Return a time for people."""
    if not math.isfinite(value):
        return MISSING
    if value < 100:
        return f"{value:.2g} s" if value < 10 else f"{value:.0f} s"
    minutes, rest = divmod(round(value), 60)
    return f"{minutes} min {rest} s"


def shown(text: str) -> str:
    """Return text without what does not print, so that XML can hold it and no reader is misled.

    Line breaks stay; other space becomes a blank, and what else does not print the sign for that.
    """
    return "".join(
        c if c.isprintable() or c == "\n" else " " if c.isspace() else "\N{REPLACEMENT CHARACTER}"
        for c in text
    )
