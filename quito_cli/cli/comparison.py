"""A Comparison for people: the tables on a terminal."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from quito_cli.cli.text import columns, labelled, plain
from quito_cli.comparison.table import Table, by_control, tables
from quito_cli.comparison.writing import heading, sentences

if TYPE_CHECKING:
    from quito_cli.comparison.comparison import Comparison


def print_comparison(found: Comparison, drawn: tuple[Path, ...], *, verbose: bool) -> None:
    """Print the tables, what they are held against, and what went wrong."""
    title = typer.style(plain(heading(found)), bold=True)
    paragraphs = ["\n".join([title, *(plain(said) for said in sentences(found))])]
    for table in tables(found):
        text = f"{table.title}\n{_aligned(table)}"
        if verbose:
            text += f"\n{labelled([(c.heading, c.help) for c in table.columns], indent='    ')}"
        paragraphs.append(text)
    apart = by_control(found) if verbose else None
    if apart:
        paragraphs.append(f"{apart.title}\n{_aligned(apart)}")
    failed = [row for row in found.rows if not row.solution.success]
    if failed:
        mark = typer.style("Not solved:", bold=True, fg="red")
        paragraphs.append(
            "\n".join(f"{mark} {plain(r.method)}: {r.solution.status.value}" for r in failed)
        )
    if drawn:
        paragraphs.append(f"Saved {', '.join(map(str, drawn))}")
    typer.echo("\n\n".join(paragraphs))


def _aligned(table: Table) -> str:
    """Return the rows with the figures right-aligned below their headings.

    On a terminal too narrow for that, the names stand above their figures.
    """
    rows = [("method", *(c.heading for c in table.columns)), *table.rows, *table.published]
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    cells = [
        (row[0], *(cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True)))
        for row in rows
    ]
    needed = sum(widths) + 2 * len(widths)
    if not sys.stdout.isatty() or needed <= shutil.get_terminal_size().columns:
        return columns(cells, header=True)
    head, *figures = columns([row[1:] for row in cells], indent="    ", header=True).splitlines()
    below = [f"  {plain(row[0])}\n{line}" for row, line in zip(cells[1:], figures, strict=True)]
    return "\n".join([head, *below])
