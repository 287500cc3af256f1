"""Aligned and styled text for the terminal; plain where it is none.

Two helpers rather than a library of tables: a summary must not cost more to print than the problem
to solve.
"""

from __future__ import annotations

from collections.abc import Sequence

import typer


def plain(text: str) -> str:
    """Return text of a file without what would steer or colour the terminal."""
    return "".join(c if c.isprintable() or c == "\n" else "\N{REPLACEMENT CHARACTER}" for c in text)


def columns(rows: Sequence[Sequence[str]], *, indent: str = "  ", header: bool = False) -> str:
    """Return rows with their columns aligned; a header is dimmed."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))] if rows else []
    rows = [[plain(cell) for cell in row] for row in rows]
    lines = [
        indent + "  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]
    if header and lines:
        lines[0] = typer.style(lines[0], dim=True)
    return "\n".join(lines)


def labelled(rows: Sequence[tuple[str, str]], *, indent: str = "  ") -> str:
    """Return `label  value` lines with the labels dimmed and aligned."""
    width = max((len(label) for label, _ in rows), default=0)
    return "\n".join(
        f"{indent}{typer.style(label.ljust(width), dim=True)}  {plain(value)}"
        for label, value in rows
    )
