"""Arcs and the certificate of Pontryagin's conditions, for people and for programs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from quito_cli.solution.structure import by_quantity
from quito_cli.solution.tally import CAVEAT, verdict
from quito_cli.summary.times import instant

if TYPE_CHECKING:
    from quito_cli.solution.optimal import Arc
    from quito_cli.solution.solution import Solution

_MOST_ARCS, _MOST_LISTS = 8, 6
"""Arcs of a control, and controls and constraints, in a summary; all are in the result."""
_WIDTH = 90
"""Of a line of arcs."""
_WORDS = {"active": "on a constraint", "kink": "at a kink"}
"""Of the kinds of a control's arcs, where the kind itself is none."""


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


def arcs_as_list(solution: Solution) -> list[dict[str, Any]] | None:
    """Return every arc; None where there is no certificate."""
    return None if solution.extremal is None else [asdict(arc) for arc in solution.arcs]


def certificate_as_list(solution: Solution) -> list[dict[str, Any]] | None:
    """Return every condition; None where they were not looked at."""
    return None if solution.extremal is None else [asdict(one) for one in solution.certificate]
