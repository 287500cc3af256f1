"""The structure that a direct answer shows: its arcs, and where it touches constraints.

Arcs of controls and rows are laid over each other; a junction of a row is put where the control
that the row determines has one near by, and every phase is made consistent.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.looking.marks import determined_by_rows
from quito_cli.optimality.polish.equations.setting import Setting
from quito_cli.optimality.polish.equations.structure import Held, Kind, Phase, Structure
from quito_cli.problem.model import labels
from quito_cli.solution.optimal import Arc
from quito_cli.solution.optimal import Kind as Seen
from quito_cli.solution.solution import Solution

Array = NDArray[np.float64]
Pressed = Callable[[int], tuple[Array, Array]]
"""Row ↦ times (P+1,) of panels and ∫ μ dt over each, (P,)."""

TIED = 0.1
"""Part of a cell within which junctions of several controls and rows may be one."""
MISALIGNED = 0.02
"""Part of the horizon by which a control's junction and that of the constraint that causes it may
be apart in a direct answer."""
SAME = 1e-12
"""Times that differ by less are one."""
BRIEF = 4
"""Cells that a jump takes at most."""
TOUCHES = 1e-3
"""Impulse of a state constraint, over the size of costates, that is a touch."""
FINE = 8
"""Points a cell that a control is read at."""


def shown(
    setting: Setting, direct: Solution, pressed: Pressed, reach: float | None, tied: bool
) -> Structure:
    """Return the structure that an answer shows: its arcs, and where it touches constraints.

    Args:
        setting: the problem.
        direct: the answer.
        pressed: what its rows press with.
        reach: part of its range within which a control counts as at a bound, however briefly; None
            reads the arcs of the answer instead, from which transitions are gone.
        tied: junctions that are no further apart than `TIED` are one.
    """
    names = labels(setting.system.model.controls)
    if reach is None:
        controls = [[arc for arc in direct.arcs if arc.of == name] for name in names]
    else:
        controls = [_read(setting, direct, i, reach) for i in range(len(names))]
    rows = [_row_arcs(direct, setting, i) for i in range(len(setting.system.rows))]
    rows = _aligned(setting, controls, rows, float(np.ptp(direct.times)) * MISALIGNED)
    least = 0.0 if not tied else TIED * float(np.diff(direct.times).min())
    found = _laid(setting, direct, controls, rows, least)
    for i, arcs in enumerate(rows):
        for time, held in _touched(setting, direct, i, arcs, *pressed(i)):
            found = found.touched(time, held)
    return found


def _laid(
    setting: Setting,
    direct: Solution,
    controls: list[list[Arc]],
    rows: list[list[Arc]],
    least: float,
) -> Structure:
    """Lay arcs of controls and rows over each other, with point constraints at their times.

    Junctions that are no further apart than `least` are one.
    """
    start, end = float(direct.times[0]), float(direct.times[-1])
    fractions = [c.at for c in setting.system.model.constraints.point if c.at is not None]
    points = [end if f == 1 else start + f * (end - start) for f in fractions]
    near = 2 * float(np.diff(direct.times).max())
    ends = {arc.end for arcs in (*controls, *rows) for arc in arcs if start < arc.end < end}
    breaks = setting.breaks(start, end)
    known = {*points, *(t for t in breaks if all(abs(t - at) > SAME for at in points))}
    inner = {t for t in ends if all(abs(t - point) > near for point in known - {start, end})}
    times = _apart({start, end, *known}, inner, least)
    phases = []
    for a, b in pairwise(times):
        middle = (a + b) / 2
        held = frozenset(
            (i, _upper(setting, direct, i, arc))
            for i, arcs in enumerate(rows)
            for arc in arcs
            if arc.kind == "active" and arc.start <= middle < arc.end
        )
        kinds = tuple(_kind(arcs, middle) for arcs in controls)
        phases.append(setting.consistent(Phase(kinds, held)))
    named = tuple((times.index(t), k) for k, t in enumerate(points))
    broken = tuple((int(np.abs(np.array(times) - t).argmin()), t) for t in breaks)
    return Structure(tuple(phases), tuple(times), (), named, broken).merged()


def _apart(given: set[float], found: set[float], least: float) -> list[float]:
    """Return times in order; of those found only ones that are further apart than `least`."""
    times = set(given)
    for time in sorted(found):
        if all(abs(time - other) > least for other in times):
            times.add(time)
    return sorted(times)


def _touched(
    setting: Setting, direct: Solution, i: int, arcs: list[Arc], times: Array, impulses: Array
) -> Iterator[tuple[float, Held]]:
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
    t = np.linspace(start, end, FINE * cells + 1)
    kept = _without_jumps(_runs(_near_bounds(setting, direct.control(t)[:, i], i, reach)))
    ends = [float(t[b - 1] + t[a]) / 2 for (_, _, b), (_, a, _) in pairwise(kept)]
    return [
        Arc(setting.name(i), kind, a, b, 0.0, 0.0)
        for (kind, _, _), (a, b) in zip(kept, pairwise([start, *ends, end]), strict=True)
    ]


def _near_bounds(setting: Setting, u: Array, i: int, reach: float) -> list[Seen]:
    """Return what a control is at every point, `lower`, `upper` or `interior`."""
    low, high = (float(side[i]) for side in setting.system.model.control_bounds)
    span = high - low if np.isfinite(high - low) else float(np.ptp(u))
    kinds: tuple[Seen, ...] = ("interior", "lower", "upper")
    marks = np.where(u <= low + reach * span, 1, np.where(u >= high - reach * span, 2, 0))
    return [kinds[mark] for mark in marks]


def _runs(kinds: list[Seen]) -> list[tuple[Seen, int, int]]:
    """Return runs of one kind, each with its first entry and the one after its last."""
    edges = [0, *(k for k in range(1, len(kinds)) if kinds[k] != kinds[k - 1]), len(kinds)]
    return [(kinds[a], a, b) for a, b in pairwise(edges)]


def _without_jumps(runs: list[tuple[Seen, int, int]]) -> list[tuple[Seen, int, int]]:
    """Return runs without brief ones from bound to bound."""
    return [
        run
        for k, run in enumerate(runs)
        if run[0] != "interior"
        or not 0 < k < len(runs) - 1
        or runs[k - 1][0] == runs[k + 1][0]
        or run[2] - run[1] > FINE * BRIEF
    ]


def _kind(arcs: list[Arc], time: float) -> Kind:
    """Return what a control does at a time; what is between its bounds is free for now."""
    for arc in arcs:
        if arc.start <= time < arc.end and arc.kind in ("lower", "upper", "singular"):
            return arc.kind
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
        ends = [arc.end for j in np.flatnonzero(determined[i]) for arc in controls[j][:-1]]
        starts = [_nearest(arc.start, arc.start_uncertainty, ends, reach) for arc in arcs[1:]]
        stops = [_nearest(arc.end, arc.end_uncertainty, ends, reach) for arc in arcs[:-1]]
        placed = [
            replace(arc, start=start, end=end)
            for arc, start, end in zip(
                arcs,
                [*(arc.start for arc in arcs[:1]), *starts],
                [*stops, *(arc.end for arc in arcs[-1:])],
                strict=True,
            )
        ]
        found.append([arc for arc in placed if arc.end > arc.start])
    return found


def _nearest(time: float, doubt: float, ends: list[float], reach: float) -> float:
    """Return the end that is nearest to a time, if it is within reach or doubt; else the time."""
    best = min(ends, key=lambda t: abs(t - time), default=time)
    return best if abs(best - time) <= max(reach, doubt) else time
