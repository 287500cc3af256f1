"""Switching times with what changes at each, for who marks them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

from quito_cli.solution.structure import by_quantity
from quito_cli.summary.meshes import change_of
from quito_cli.summary.times import instant

if TYPE_CHECKING:
    from quito_cli.solution.optimal import Arc
    from quito_cli.solution.solution import Solution

_WORDS = {
    "lower": "at lower bound",
    "upper": "at upper bound",
    "active": "on a constraint",
}
"""Of a control's arcs, where the kind itself is none."""


@dataclass(frozen=True)
class Switch:
    """A switching time."""

    time: float
    uncertainty: float
    controls: tuple[str, ...]
    """Those that change."""
    said: str
    """`1.36674 ± 1e-05  u jumps -1 → 1; floor becomes active`."""
    height: float
    """Of the largest jump or kink there; 0 where there is none."""


def switches(solution: Solution) -> tuple[Switch, ...]:
    """Return the switching times of an answer, in order."""
    names = [quantity.name for quantity in solution.origin.controls]
    controls, constraints = by_quantity(solution.arcs, names)
    return tuple(
        _switch(solution, time, names, controls, constraints) for time in solution.switching_times
    )


def _switch(
    solution: Solution,
    time: float,
    names: Sequence[str],
    controls: Mapping[str, Sequence[Arc]],
    constraints: Mapping[str, Sequence[Arc]],
) -> Switch:
    doubts = [a.end_uncertainty for a in solution.arcs if a.end == time]
    doubts += [j.uncertainty for j in solution.junctions if j.time == time]
    doubt = min(doubts, default=0.0)
    there = [j for j in solution.junctions if abs(j.time - time) <= j.uncertainty + doubt]
    changing = {names[j.control]: change_of(solution, j) for j in there}
    for name, arcs in controls.items():
        for before, after in _ends(arcs, time, doubt):
            kinds = (_WORDS.get(arc.kind, arc.kind) for arc in (before, after))
            changing.setdefault(name, f"{name} {' → '.join(kinds)}")
    said = [changing[name] for name in names if name in changing]
    for name, arcs in constraints.items():
        for _, after in _ends(arcs, time, doubt):
            begins = after.kind == "active"
            said.append(f"{name} {'becomes active' if begins else 'is left'}")
    height = max((abs(j.after - j.before) for j in there), default=0.0)
    when = instant(time, doubt)
    return Switch(time, doubt, tuple(changing), f"{when}  {'; '.join(said)}", height)


def _ends(arcs: Sequence[Arc], time: float, doubt: float) -> Iterator[tuple[Arc, Arc]]:
    """Yield the arcs that meet at a time, as far as it is known."""
    for before, after in pairwise(arcs):
        if abs(before.end - time) <= before.end_uncertainty + doubt:
            yield before, after
