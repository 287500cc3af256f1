"""The structure that is assumed: phases between junctions, with what every control does in each.

A phase says of each control whether it is at its lower or upper bound, singular, or free: then
H_u = 0 determines it, or a constraint that the phase holds at its bound. Junctions lie between
phases. What happens at one follows from the phases beside it; touches of state constraints, and
point constraints, are named besides.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal, TypeVar

import numpy as np

Kind = Literal["lower", "upper", "free", "singular"]
Held = tuple[int, bool]
"""A row of Pontryagin's system, and whether it is held at its upper bound."""
Named = TypeVar("Named")


@dataclass(frozen=True)
class Phase:
    """What holds between two junctions."""

    kinds: tuple[Kind, ...]
    """By control."""
    held: frozenset[Held]
    """Rows at their bounds."""


@dataclass(frozen=True)
class Structure:
    """Phases and the times about which they change."""

    phases: tuple[Phase, ...]
    times: tuple[float, ...]
    """One more than phases: the initial time, the junctions, the final time."""
    touches: tuple[tuple[int, Held], ...] = ()
    """Junction (index of `times`) at which a state constraint is touched, without an arc."""
    points: tuple[tuple[int, int], ...] = ()
    """Junction at which a point constraint is, and which."""
    breaks: tuple[tuple[int, float], ...] = ()
    """Junction at which formulas of the problem jump, and when: its time is known."""

    def span(self, first: int, last: int) -> tuple[float, float]:
        """Return the times of phases first … last."""
        return self.times[first], self.times[last + 1]

    def arc(self, phase: int, held: Held) -> tuple[float, float]:
        """Return from when to when a row is held about a phase that holds it."""
        first = last = phase
        while first > 0 and held in self.phases[first - 1].held:
            first -= 1
        while last + 1 < len(self.phases) and held in self.phases[last + 1].held:
            last += 1
        return self.span(first, last)

    def at(self, times: Iterable[float]) -> Structure:
        """Return the same structure at other times."""
        return replace(self, times=tuple(float(t) for t in times))

    def phase_at(self, time: float) -> int:
        """Return the phase that a time is in."""
        k = int(np.searchsorted(self.times, time, side="right")) - 1
        return min(max(k, 0), len(self.phases) - 1)

    def named(self, junction: int) -> bool:
        """Whether a touch, a point constraint or a break is at a junction."""
        return any(at == junction for at, _ in (*self.touches, *self.points, *self.breaks))

    def known(self, junction: int) -> bool:
        """Whether the time of a junction is: of a point constraint or a break."""
        return any(at == junction for at, _ in (*self.points, *self.breaks))

    def merged(self) -> Structure:
        """Return it with equal phases beside each other made one, unless something is between."""
        for k, (before, after) in enumerate(pairwise(self.phases), start=1):
            if before == after and not self.named(k):
                return self.without(k, self.phases[:k] + self.phases[k + 1 :]).merged()
        return self

    def without(self, junction: int, phases: tuple[Phase, ...]) -> Structure:
        """Return it without a junction, with these phases."""
        times = self.times[:junction] + self.times[junction + 1 :]
        touches = tuple(named for named in self.touches if named[0] != junction)
        points = tuple(named for named in self.points if named[0] != junction)
        breaks = tuple(named for named in self.breaks if named[0] != junction)
        later = junction + 1
        moved = _moved(touches, later, -1), _moved(points, later, -1), _moved(breaks, later, -1)
        return Structure(phases, times, *moved)

    def cut(self, time: float) -> tuple[Structure, int]:
        """Return it with a junction at a time, and the index of that junction."""
        k = min(max(int(np.searchsorted(self.times, time)), 1), len(self.phases))
        times = (*self.times[:k], time, *self.times[k:])
        phases = (*self.phases[:k], self.phases[k - 1], *self.phases[k:])
        moved = _moved(self.touches, k, 1), _moved(self.points, k, 1), _moved(self.breaks, k, 1)
        return Structure(phases, times, *moved), k

    def touched(self, time: float, held: Held) -> Structure:
        """Return it with a touch of a row at a time."""
        found, k = self.cut(time)
        return replace(found, touches=(*found.touches, (k, held)))

    def _junction(self, time: float) -> tuple[Structure, int]:
        """Return it with a junction at a time, and its index; the one that is there, if one is."""
        return (self, self.times.index(time)) if time in self.times else self.cut(time)

    def changed(self, start: float, end: float, change: Callable[[Phase], Phase]) -> Structure:
        """Return it with what is between two times changed."""
        wide, first = self._junction(start)
        wide, last = wide._junction(end)
        phases = tuple(
            change(phase) if first <= k < last else phase for k, phase in enumerate(wide.phases)
        )
        return replace(wide, phases=phases)


def _moved(
    named: tuple[tuple[int, Named], ...], first: int, by: int
) -> tuple[tuple[int, Named], ...]:
    """Return what is named with junctions from `first` on counted anew."""
    return tuple((at + by * (at >= first), what) for at, what in named)
