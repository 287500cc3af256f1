"""The arcs of an answer, quantity by quantity."""

from __future__ import annotations

from collections.abc import Sequence

from quito_cli.solution.optimal import Arc


def by_quantity(
    arcs: Sequence[Arc], controls: Sequence[str]
) -> tuple[dict[str, list[Arc]], dict[str, list[Arc]]]:
    """Return the arcs of each control, and of each constraint, by name.

    Args:
        arcs: those of controls first; each quantity's in the order of time, so that where time goes
            back the next one begins: a constraint may be called as a control is.
        controls: labels of the controls.
    """
    found: list[list[Arc]] = []
    for arc in arcs:
        if not found or arc.of != found[-1][-1].of or arc.start < found[-1][-1].start:
            found.append([])
        found[-1].append(arc)
    of_controls: dict[str, list[Arc]] = {}
    of_constraints: dict[str, list[Arc]] = {}
    for group in found:
        name = group[0].of
        first = name in controls and name not in of_controls
        (of_controls if first else of_constraints).setdefault(name, []).extend(group)
    return of_controls, of_constraints
