"""What can be taken away of a comparison: its figures as a table, its plots as the sheet of them.

Both are made of its Answer alone, with what `quito compare` computes, writes and draws.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from quito_cli.gui.answer import Answer
from quito_cli.gui.charts import panel_of

if TYPE_CHECKING:
    from quito_cli.plots.comparison import Rows

_VIEWS: Final = ("error", "magnified", "logarithmic", "spectrum")
"""Of the error of a control, side by side."""


def write_table(answer: Answer, path: Path) -> None:
    """Write a row a method, in full precision; columns are those of `quito compare --json`."""
    rows = [dict(_flat(row)) for row in answer.figures["rows"]]
    heads = list(dict.fromkeys(name for row in rows for name in row))
    with path.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow(heads)
        table.writerows([_cell(row.get(name)) for name in heads] for row in rows)


def _flat(given: Mapping[str, Any], under: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the figures; those of a control, a state or an option are named after it."""
    for name, value in given.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{under}{name}.")
        elif isinstance(value, list | tuple):
            for i, each in enumerate(value, 1):
                yield from _flat(each, f"{under}{name}.{i}.")
        else:
            yield f"{under}{name}", value


def _cell(value: Any) -> str:
    return "" if value is None else repr(value) if isinstance(value, float) else str(value)


def draw_sheet(answer: Answer, path: Path) -> None:
    """Draw trajectories, errors and spectra; the ending of `path` is its format.

    Raises:
        ResultFileError: the file cannot be written.
    """
    from quito_cli.plots.comparison import FIGURES, arranged, drawn_rows
    from quito_cli.plots.figure import write

    of = {
        kind: [panel_of(chart) for chart in answer.charts if chart.kind == kind]
        for kind in ("controls", "states", *_VIEWS)
    }
    by_control = zip_longest(*(of[kind] for kind in _VIEWS))
    errors: Rows = [[panel for panel in row if panel is not None] for row in by_control]
    rows = arranged(of["controls"], of["states"], errors)
    figures = answer.figures
    methods = [(row["method"], row["success"]) for row in figures["rows"]]
    title = figures["title"] or answer.name
    kind = FIGURES["sheet"] if errors else FIGURES["trajectories"]
    write(drawn_rows(rows, kind, title, methods, figures["against"] or ""), path)
