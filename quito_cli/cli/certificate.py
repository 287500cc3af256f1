"""Arcs and the certificate of Pontryagin's conditions, for people and for programs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import typer

from quito_cli.cli.text import columns, instant, labelled, plain
from quito_cli.solution.structure import by_quantity
from quito_cli.solution.tally import CAVEAT, applying, verdict

if TYPE_CHECKING:
    from quito_cli.solution.optimal import Arc, Condition
    from quito_cli.solution.solution import Solution

_MOST_ARCS, _MOST_LISTS = 8, 6
"""Arcs of a control, and controls and constraints, in a summary; all are in the result."""
_WIDTH = 90
"""Of a line of arcs."""
_WORDS = {"active": "on a constraint"}
"""Of the kinds of a control's arcs, where the kind itself is none."""
_HEADS = ("condition", "residual", "scale", "worst at t", "verdict")
_BELOW = "      "
"""Before the reason of a failure."""
_NARROW_CONDITION, _NARROW_VERDICT = 16, 14
"""Widths of columns that their longest words need."""


def arc_rows(
    solution: Solution, most_arcs: int = _MOST_ARCS, most_lists: int = _MOST_LISTS
) -> list[tuple[str, str]]:
    """Return the arcs of each control, and when each constraint is active."""
    names = [quantity.name for quantity in solution.origin.controls]
    controls, constraints = by_quantity(solution.arcs, names)
    lists = [_control(name, arcs, most_arcs) for name, arcs in controls.items()]
    lists += [_constraint(name, arcs, most_arcs) for name, arcs in constraints.items()]
    lists = [lines for lines in lists if lines]
    shown = [line for lines in lists[:most_lists] for line in lines]
    if len(lists) > most_lists:
        shown.append(f"and those of {len(lists) - most_lists} more controls or constraints")
    return [("arcs" if i == 0 else "", line) for i, line in enumerate(shown)]


def _control(name: str, arcs: list[Arc], most: int) -> list[str]:
    """Return the arcs of a control in as few lines as hold them."""
    kinds = [_WORDS.get(arc.kind, arc.kind) for arc in arcs]
    if len(arcs) == 1:
        return [f"{name}: {kinds[0]} throughout"]
    ends = [f" to {instant(arc.end, arc.end_uncertainty)}" for arc in arcs[:-1]]
    parts = [kind + end for kind, end in zip(kinds, [*ends, ""], strict=True)]
    return _lines(f"{name}: ", parts, most)


def _constraint(name: str, arcs: list[Arc], most: int) -> list[str]:
    """Return when a constraint is active; nothing of one that never is."""
    start, end = arcs[0].start, arcs[-1].end
    parts = [_stretch(arc, start, end) for arc in arcs if arc.kind == "active"]
    return _lines(f"{name}: active ", parts, most) if parts else []


def _stretch(arc: Arc, start: float, end: float) -> str:
    """Return when a constraint is active."""
    if arc.start <= start and arc.end >= end:
        return "throughout"
    begins = instant(arc.start, arc.start_uncertainty)
    if arc.end <= arc.start:
        return f"at {begins}"
    if arc.start <= start:
        return f"to {instant(arc.end, arc.end_uncertainty)}"
    if arc.end >= end:
        return f"from {begins}"
    return f"from {begins} to {instant(arc.end, arc.end_uncertainty)}"


def _lines(start: str, parts: Sequence[str], most: int) -> list[str]:
    """Return parts with commas between them, broken between parts, aligned below the first."""
    if len(parts) > most:
        parts = [*parts[:most], f"and {len(parts) - most} more"]
    lines = [start + parts[0]]
    for part in parts[1:]:
        if len(lines[-1]) + len(part) + 3 <= _WIDTH:
            lines[-1] += f", {part}"
        else:
            lines[-1] += ","
            lines.append(" " * len(start) + part)
    return lines


def pontryagin_rows(solution: Solution, *, verbose: bool) -> list[tuple[str, str]]:
    """Return the certificate in a line; with `verbose` also what it does not say."""
    if solution.extremal is None:
        return []
    rows = [("Pontryagin", verdict(solution.certificate))]
    return [*rows, ("", CAVEAT)] if verbose else rows


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


def arcs_as_list(solution: Solution) -> list[dict[str, Any]] | None:
    """Return every arc; None where there is no certificate."""
    return None if solution.extremal is None else [asdict(arc) for arc in solution.arcs]


def certificate_as_list(solution: Solution) -> list[dict[str, Any]] | None:
    """Return every condition; None where they were not looked at."""
    return None if solution.extremal is None else [asdict(one) for one in solution.certificate]
