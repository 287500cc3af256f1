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
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.marks import determined_by_rows
from quito_cli.optimality.polish.setting import Setting
from quito_cli.problem.model import labels
from quito_cli.solution.optimal import Arc
from quito_cli.solution.solution import Solution

Kind = Literal["lower", "upper", "free", "singular"]
Held = tuple[int, bool]
"""A row of Pontryagin's system, and whether it is held at its upper bound."""

MISALIGNED = 0.02
"""Part of the horizon by which a control's junction and that of the constraint that causes it may
be apart in a direct answer."""


BRIEF = 4
"""Cells that a jump takes at most."""
TOUCHES = 1e-3
"""Impulse of a state constraint, over the size of costates, that is a touch."""
Array = NDArray[np.float64]
Pressed = Callable[[int], tuple[Array, Array]]


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

    def span(self, first: int, last: int) -> tuple[float, float]:
        """Return the times of phases first … last."""
        return self.times[first], self.times[last + 1]

    def at(self, times: Iterable[float]) -> Structure:
        """Return the same structure at other times."""
        return replace(self, times=tuple(float(t) for t in times))

    def phase_at(self, time: float) -> int:
        """Return the phase that a time is in."""
        k = int(np.searchsorted(self.times, time, side="right")) - 1
        return min(max(k, 0), len(self.phases) - 1)

    def named(self, junction: int) -> bool:
        """Whether a touch or a point constraint is at a junction."""
        return any(at == junction for at, _ in (*self.touches, *self.points))

    def merged(self) -> Structure:
        """Return it with equal phases beside each other made one, unless something is between."""
        for k, (before, after) in enumerate(pairwise(self.phases), start=1):
            if before == after and not self.named(k):
                return self.without(k, self.phases[:k] + self.phases[k + 1 :]).merged()
        return self

    def without(self, junction: int, phases: tuple[Phase, ...]) -> Structure:
        """Return it without a junction, with these phases."""

        def moved(named: tuple[tuple[int, object], ...]) -> tuple[tuple[int, object], ...]:
            return tuple((at - (at > junction), what) for at, what in named if at != junction)

        times = self.times[:junction] + self.times[junction + 1 :]
        return Structure(phases, times, moved(self.touches), moved(self.points))  # type: ignore[arg-type]

    def cut(self, time: float) -> tuple[Structure, int]:
        """Return it with a junction at a time, and the index of that junction."""
        k = int(np.searchsorted(self.times, time))
        k = min(max(k, 1), len(self.phases))

        def moved(named: tuple[tuple[int, object], ...]) -> tuple[tuple[int, object], ...]:
            return tuple((at + (at >= k), what) for at, what in named)

        times = (*self.times[:k], time, *self.times[k:])
        phases = (*self.phases[:k], self.phases[k - 1], *self.phases[k:])
        touches, points = moved(self.touches), moved(self.points)
        return Structure(phases, times, touches, points), k  # type: ignore[arg-type]

    def _junction(self, time: float) -> tuple[Structure, int]:
        """Return it with a junction at a time, and its index; the one that is there, if one is."""
        return (self, self.times.index(time)) if time in self.times else self.cut(time)

    def changed(self, start: float, end: float, **parts: object) -> Structure:
        """Return it with a phase of its own between two times, with parts of it replaced."""
        wide, first = self._junction(start)
        wide, last = wide._junction(end)
        phases = tuple(
            replace(phase, **parts) if first <= k < last else phase  # type: ignore[arg-type]
            for k, phase in enumerate(wide.phases)
        )
        return replace(wide, phases=phases)


def assumed(setting: Setting, direct: Solution, pressed: Pressed, reach: float | None) -> Structure:
    """Return the structure that an answer shows: its arcs, and where it touches constraints.

    Args:
        setting: the problem.
        direct: the answer.
        pressed: row ↦ ∫ μ dt of its panels, as times (P+1,) and impulses (P,).
        reach: part of its range within which a control counts as at a bound, however briefly; None
            reads the arcs of the answer instead, from which transitions are gone.
    """
    m, rows = setting.system.model, setting.system.rows
    start, end = float(direct.times[0]), float(direct.times[-1])
    names = labels(m.controls)
    controls = [[a for a in direct.arcs if a.of == name] for name in names]
    if reach is not None:
        controls = [_read(setting, direct, i, reach) for i in range(m.n_u)]
    own = [_row_arcs(direct, setting, i) for i in range(len(rows))]
    own = _aligned(setting, controls, own, (end - start) * MISALIGNED)
    fractions = [c.at for c in m.constraints.point if c.at is not None]
    at_points = [start + f * (end - start) for f in fractions]
    inner = {a.end for arcs in (*controls, *own) for a in arcs if start < a.end < end}
    grid = np.diff(direct.times)
    inner = {t for t in inner if all(abs(t - p) > 2 * grid.max() for p in at_points)}
    times = sorted({start, end, *inner, *at_points})
    phases = []
    for a, b in pairwise(times):
        middle = (a + b) / 2
        held = frozenset(
            (i, _upper(setting, direct, i, arc))
            for i, arcs in enumerate(own)
            for arc in arcs
            if arc.kind == "active" and arc.start <= middle < arc.end
        )
        kinds = tuple(_kind(arcs, middle) for arcs in controls)
        phases.append(setting.consistent(Phase(kinds, held)))
    points = tuple((times.index(t), k) for k, t in enumerate(at_points))
    found = Structure(tuple(phases), tuple(times), (), points).merged()
    for i in range(len(rows)):
        for time, touched in _touched(setting, direct, i, own[i], *pressed(i)):
            found, k = found.cut(time)
            found = replace(found, touches=(*found.touches, (k, touched)))
    return found


def _touched(
    setting: Setting, direct: Solution, i: int, arcs: list[Arc], times: Array, impulses: Array
) -> Iterable[tuple[float, Held]]:
    """Give where a state constraint is pressed on without an arc: a touch, at its centre."""
    near = 2 * float(np.diff(direct.times).max())
    middles = (times[1:] + times[:-1]) / 2
    for arc in arcs:
        if arc.kind == "active":
            inside = (middles > arc.start - near) & (middles < arc.end + near)
            impulses = np.where(inside, 0.0, impulses)
    there = np.abs(impulses) > TOUCHES * np.abs(direct.costates).max()
    edges = np.flatnonzero(np.diff(np.concatenate([[0], there.astype(int), [0]])))
    for a, b in zip(edges[::2], edges[1::2], strict=True):
        held = i, bool(impulses[a:b].sum() > 0)
        if (setting.active(held).order or 0) >= 2:
            weights = np.abs(impulses[a:b])
            yield float((times[a:b] * weights).sum() / weights.sum()), held


def _read(setting: Setting, direct: Solution, i: int, reach: float) -> list[Arc]:
    """Return the arcs of a control by its nearness to bounds alone.

    What is between bounds for no longer than a few cells, from one bound to the other, is a jump.
    """
    start, end, cells = float(direct.times[0]), float(direct.times[-1]), len(direct.times) - 1
    t = np.linspace(start, end, 8 * cells + 1)
    u = direct.control(t)[:, i]
    low, high = (float(side[i]) for side in setting.system.model.control_bounds)
    span = high - low if np.isfinite(high - low) else float(np.ptp(u))
    marks = np.where(u <= low + reach * span, -1, np.where(u >= high - reach * span, 1, 0))
    edges = [0, *(np.flatnonzero(np.diff(marks)) + 1).tolist(), len(t)]
    runs = [(int(marks[a]), a, b) for a, b in pairwise(edges)]
    kept = [
        run
        for k, run in enumerate(runs)
        if run[0]
        or not 0 < k < len(runs) - 1
        or runs[k - 1][0] == runs[k + 1][0]
        or run[2] - run[1] > 8 * BRIEF
    ]
    label, found, begin = setting.name(i), [], start
    for k, (mark, _, b) in enumerate(kept):
        last = end if k == len(kept) - 1 else float((t[b - 1] + t[kept[k + 1][1]]) / 2)
        kind = "lower" if mark < 0 else "upper" if mark > 0 else "interior"
        found.append(Arc(label, kind, begin, last, 0.0, 0.0))  # type: ignore[arg-type]
        begin = last
    return found


def _kind(arcs: list[Arc], time: float) -> Kind:
    for arc in arcs:
        if arc.start <= time < arc.end:
            if arc.kind in ("lower", "upper", "singular"):
                return arc.kind
            return "free"
    return "free"


def _row_arcs(direct: Solution, setting: Setting, i: int) -> list[Arc]:
    """Return the arcs of a row; an equality is active all the time."""
    row = setting.system.rows[i]
    start, end = float(direct.times[0]), float(direct.times[-1])
    if row.lower == row.upper:
        return [Arc(row.label, "active", start, end, 0.0, 0.0)]
    return [a for a in direct.arcs[setting.first_row_arc(direct) :] if a.of == row.label]


def _upper(setting: Setting, direct: Solution, i: int, arc: Arc) -> bool:
    """Whether an active row is at its upper bound."""
    row = setting.system.rows[i]
    if not np.isfinite(row.lower) or not np.isfinite(row.upper):
        return bool(np.isfinite(row.upper))
    t = np.linspace(arc.start, arc.end, 9)[1:-1]
    value = float(
        np.median(setting.rows(t, direct.state(t), direct.control(t), direct.parameters)[:, i])
    )
    return value > (row.lower + row.upper) / 2


def _aligned(
    setting: Setting, controls: list[list[Arc]], rows: list[list[Arc]], reach: float
) -> list[list[Arc]]:
    """Put ends of arcs of rows where a control that they determine has a junction near by."""
    determined = determined_by_rows(setting.system)
    found = []
    for i, arcs in enumerate(rows):
        ends = [a.end for j in np.flatnonzero(determined[i]) for a in controls[j][:-1]]

        def near(time: float, doubt: float, ends: list[float] = ends) -> float:
            best = min(ends, key=lambda t: abs(t - time), default=time)
            return best if abs(best - time) <= max(reach, doubt) else time

        placed = [
            replace(a, start=near(a.start, a.start_uncertainty), end=near(a.end, a.end_uncertainty))
            if k not in (0, len(arcs) - 1) or len(arcs) > 1
            else a
            for k, a in enumerate(arcs)
        ]
        if placed:
            placed[0] = replace(placed[0], start=arcs[0].start)
            placed[-1] = replace(placed[-1], end=arcs[-1].end)
        found.append([a for a in placed if a.end > a.start])
    return found
