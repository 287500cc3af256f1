"""All of the certificate of Pontryagin's conditions, as a page for people."""

from __future__ import annotations

import math
from collections.abc import Sequence
from textwrap import wrap
from typing import TYPE_CHECKING

import typer

from quito_cli.cli.text import columns, labelled, plain
from quito_cli.solution.tally import CAVEAT, applying
from quito_cli.summary.arcs import arc_rows, pontryagin_rows

if TYPE_CHECKING:
    from quito_cli.solution.optimal import Condition
    from quito_cli.solution.solution import Solution

_HEADS = ("condition", "residual", "scale", "worst at t", "verdict")
_BELOW = "      "
"""Before the reason of a failure."""
_NARROW_CONDITION, _NARROW_VERDICT = 16, 14
"""Widths of columns that their longest words need."""


def certificate_page(solution: Solution, room: int | None) -> str:
    """Return all arcs, the conditions that apply as a table, those that do not, and a foot.

    Args:
        solution: one with an extremal.
        room: columns of the terminal, for which long cells are broken; None leaves them whole.
    """
    title = typer.style(plain(solution.origin.title or solution.origin.name), bold=True)
    everything = len(solution.arcs)
    rows = [*pontryagin_rows(solution, verbose=False), *arc_rows(solution, everything, everything)]
    foot = f"{CAVEAT}\nquito show PROBLEM --pontryagin derives the conditions."
    judged = applying(solution.certificate)
    others = [one for one in solution.certificate if one not in judged]
    tables = _table(judged, room), _left_out(others, room)
    return "\n\n".join(part for part in (title, labelled(rows), *tables, foot) if part)


def _table(certificate: Sequence[Condition], room: int | None) -> str:
    """Return a row for each condition that applies, with the reason of a failure below it."""
    rows = [_row(one) for one in certificate]
    if not rows:
        return ""
    head, *blocks = _aligned([_HEADS, *rows], _widths([_HEADS, *rows], room))
    text = [typer.style(line, dim=True) for line in head]
    for condition, lines in zip(certificate, blocks, strict=True):
        reason = _broken(plain(condition.reason), room and room - len(_BELOW))
        colour = "red" if condition.verdict == "fails" else None
        below = [_BELOW + line for line in reason if line]
        text += [typer.style(line, fg=colour) for line in (*lines, *below)]
    return "\n".join(text)


def _left_out(certificate: Sequence[Condition], room: int | None) -> str:
    """Return the conditions that do not apply, each with the reason."""
    rows = [("not applicable", "because")]
    rows += [(one.condition, one.reason) for one in certificate]
    if len(rows) == 1:
        return ""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    if room is not None:
        widths[0] = min(widths[0], max(_NARROW_CONDITION, 3 * room // 5))
        widths[1] = min(widths[1], max(_NARROW_VERDICT, room - 4 - widths[0]))
    lines = [line for block in _aligned(rows, widths) for line in block]
    return "\n".join(typer.style(line, dim=True) for line in lines)


def _aligned(rows: Sequence[Sequence[str]], widths: Sequence[int]) -> list[list[str]]:
    """Return the lines of each row, its cells broken to the widths of the columns."""
    blocks: list[list[Sequence[str]]] = []
    for row in rows:
        cells = [_broken(plain(cell), width) for cell, width in zip(row, widths, strict=True)]
        height = max(map(len, cells))
        padded = (cell + [""] * (height - len(cell)) for cell in cells)
        blocks.append(list(zip(*padded, strict=True)))
    lines = iter(columns([line for block in blocks for line in block]).split("\n"))
    return [[next(lines) for _ in block] for block in blocks]


def _row(one: Condition) -> tuple[str, ...]:
    time = "-" if math.isnan(one.time) else f"{one.time:.6g}"
    return one.condition, _small(one.residual), _small(one.scale), time, one.verdict


def _small(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.1e}"


def _widths(rows: Sequence[Sequence[str]], room: int | None) -> list[int]:
    """Return the widths of the columns; conditions and verdicts are broken to fit."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    if room is not None:
        left = room - 2 * len(widths) - sum(widths[1:-1])
        widths[-1] = min(widths[-1], max(_NARROW_VERDICT, left - widths[0], left // 3))
        widths[0] = min(widths[0], max(_NARROW_CONDITION, left - widths[-1]))
    return widths


def _broken(cell: str, width: int | None) -> list[str]:
    return wrap(cell, width or len(cell) + 1, break_long_words=False, break_on_hyphens=False) or [
        ""
    ]
