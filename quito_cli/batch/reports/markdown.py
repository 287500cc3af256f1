"""Report -> Markdown, as GitHub and GitLab show it on the page of a job.

The verdict, the cases that failed with what is wrong with them, the differences from the baseline,
and folded away, the rest. Whatever comes from a file is escaped: it is text there and nothing else.
GitHub refuses a summary of more than a mebibyte, so that long tables end with how much they leave
out.
"""

from __future__ import annotations

import html
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Final

from quito_cli.batch.judging.comparing import Verdict
from quito_cli.batch.reports.report import Report
from quito_cli.batch.reports.table import (
    DIFFERENCES,
    GONE,
    Row,
    Table,
    differences,
    seconds,
    shown,
    table,
)
from quito_cli.solution.store import write_content

MOST: Final = 1024 * 1024
"""Bytes of a summary that GitHub takes."""
_ROOM: Final = (MOST // 2, MOST // 4, MOST // 8)
"""Bytes for each of the tables: of the failed, of the differences, of the rest."""
_LONGEST: Final = 400
"""Characters of a cell."""
_MARKS: Final = re.compile(r"[\\`*_\[\]|~$@]|:(?=//)|(?<=www)\.", re.IGNORECASE)
"""What has a meaning within a line of Markdown, and what GitHub makes links of."""


def write(report: Report, path: Path) -> None:
    """Write the summary of a run; an older file is replaced only when all is written.

    Raises:
        ResultFileError: the file cannot be written.
    """
    write_content(path, markdown(report))


def markdown(report: Report) -> str:
    """Return the summary of a run as Markdown."""
    made = table(report)
    sign = "✅" if report.exit_code == 0 else "❌"
    parts = [
        f"## {sign} {escaped(report.heading)}",
        f"{escaped(report.verdict)} The run took {seconds(report.seconds)}.",
    ]
    if made.failed or report.gone:
        rows = [*map(_failed, made.failed), *map(_gone, report.gone)]
        parts.append(_lines(("case", "result", "why"), rows, _ROOM[0]))
    if changed := differences(report):
        told = [tuple(map(escaped, row)) for row in changed]
        parts += ["### Against the baseline", _lines(DIFFERENCES, told, _ROOM[1])]
    if made.passed:
        parts.append(_folded(made))
    return "\n\n".join(parts) + "\n"


def _failed(row: Row) -> tuple[str, ...]:
    reasons = row.reasons or (row.case.ending.value,)
    return escaped(row.name), row.result, "<br>".join(map(escaped, reasons))


def _gone(name: str) -> tuple[str, ...]:
    return escaped(name), Verdict.MISSING.value, GONE


def _folded(made: Table) -> str:
    """Return the cases that passed, folded away."""
    headings = ("case", *(column.heading for column in made.columns), "time")
    rows = [(escaped(row.name), *map(escaped, row.cells), row.seconds) for row in made.passed]
    count = len(rows)
    title = f"{count} case{'' if count == 1 else 's'} passed"
    body = _lines(headings, rows, _ROOM[2], right=True)
    return f"<details><summary>{title}</summary>\n\n{body}\n\n</details>"


def _lines(
    headings: Sequence[str], rows: Iterable[Sequence[str]], room: int, *, right: bool = False
) -> str:
    """Return a table of at most `room` bytes; figures to the right, but for the first column."""
    rest = "---:" if right else "---"
    lines = [_line(headings), _line(["---", *[rest] * (len(headings) - 1)])]
    rows, left = list(rows), room
    for i, row in enumerate(rows):
        line = _line(row)
        left -= len(line.encode()) + 1
        if left < 0:
            return "\n".join([*lines, "", f"... and {len(rows) - i} more, left out for their size"])
        lines.append(line)
    return "\n".join(lines)


def _line(cells: Iterable[str]) -> str:
    return f"| {' | '.join(cells)} |"


def escaped(text: str) -> str:
    """Return text that Markdown shows as it is, on one line; long text is cut."""
    words = " ".join(shown(text[: 4 * _LONGEST]).split())
    words = words if len(words) <= _LONGEST else f"{words[: _LONGEST - 3]}..."
    return _MARKS.sub(r"\\\g<0>", html.escape(words, quote=False))
