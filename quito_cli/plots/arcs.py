"""Arcs in plots: a bar on the axis of time below a control, shades behind what comes with it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from quito_cli.plots.palette import COLOURS
from quito_cli.solution.optimal import Arc, Kind
from quito_cli.solution.solution import Solution
from quito_cli.solution.structure import by_quantity

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes

_KINDS: dict[Kind, tuple[str, str]] = {
    "lower": ("at lower bound", COLOURS[5]),
    "upper": ("at upper bound", COLOURS[4]),
    "interior": ("interior", "#BBBBBB"),
    "singular": ("singular", COLOURS[3]),
    "kink": ("at a kink", COLOURS[2]),
    "active": ("on a constraint", "#444444"),
}
"""Name and colour of each kind; a constraint that is not active is not drawn."""
KIND_NAMES = {kind: name for kind, (name, _) in _KINDS.items()}
ARC_NAMES = tuple(KIND_NAMES.values())
"""As a legend has them."""
_THICK = 0.03
"""Of a bar, as a part of the plot's height: less than the margin below the curves."""
_PALE = 0.14


def bar(axes: Axes, arcs: Sequence[Arc]) -> None:
    """Draw the arcs along the axis of time."""
    for arc in arcs:
        if arc.kind in _KINDS:
            name, colour = _KINDS[arc.kind]
            axes.axvspan(arc.start, arc.end, ymax=_THICK, color=colour, linewidth=0, label=name)


def shade(axes: Axes, arcs: Sequence[Arc]) -> None:
    """Shade the arcs from bottom to top."""
    for arc in arcs:
        if arc.kind in _KINDS:
            name, colour = _KINDS[arc.kind]
            axes.axvspan(
                arc.start, arc.end, color=colour, alpha=_PALE, linewidth=0, zorder=0.5, label=name
            )


def of_control(solution: Solution, name: str) -> tuple[Arc, ...]:
    """Return the arcs of a control."""
    controls = [quantity.name for quantity in solution.origin.controls]
    return tuple(by_quantity(solution.arcs, controls)[0].get(name, ()))


def on_constraints(solution: Solution) -> tuple[Arc, ...]:
    """Return when any constraint is active, stretches that overlap as one."""
    controls = [quantity.name for quantity in solution.origin.controls]
    constraints = by_quantity(solution.arcs, controls)[1].values()
    active = [arc for arcs in constraints for arc in arcs if arc.kind == "active"]
    found: list[Arc] = []
    for arc in sorted(active, key=lambda one: one.start):
        if found and arc.start <= found[-1].end:
            found[-1] = replace(found[-1], end=max(arc.end, found[-1].end))
        else:
            found.append(arc)
    return tuple(found)
