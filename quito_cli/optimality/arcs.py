"""The structure of an answer: arcs of every control, active and inactive stretches of constraints.

û is labelled on a grid within the panels: lower or upper within `AT_BOUND` of its range, interior
else. A jump of the control takes a few cells however small they are (`solution.junctions`), and so
long is what may be a transition rather than an arc: on equal cells up to `TRANSITION` of the
horizon besides, on a mesh that follows the control no more than the cells that a jump takes. Where
an arc begins is the time of the jump or kink there; where there is none, the labels say it, as far
as they can: where û leaves the neighbourhood of its bound, drawn on to the bound along its slope.

An interior control is singular where H is affine in it, and active where a constraint that is at
its bound determines it. A constraint is active where it is at its bound, and where its multiplier,
or for a state what stands in its place, is somewhere not nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.hamiltonian import Pontryagin
from quito_cli.problem.model import labels
from quito_cli.solution.junctions import ranges, width
from quito_cli.solution.optimal import Arc, Kind

if TYPE_CHECKING:
    from quito_cli.solution.solution import Solution

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

AT_BOUND = 0.004
"""Part of a control's range within which it is at a bound."""
TRANSITION = 0.015
"""Part of the horizon that a transition takes at most, on equal cells."""
NEAR = 0.01
"""Part of the horizon within which a jump or kink is that of a change of labels."""
TOUCHES, LIES = 1e-3, 1e-4
"""Parts of its range within which a constraint is at its bound: somewhere in a panel, with a
multiplier that says so, and where that is nothing, as it may be in the middle of an arc."""

LOWER, INTERIOR, UPPER = -1, 0, 1
_KINDS: dict[int, Kind] = {LOWER: "lower", INTERIOR: "interior", UPPER: "upper"}


@dataclass(frozen=True)
class Run:
    """Neighbouring points of one label."""

    label: int
    first: int
    """Its first point."""
    last: int
    """Its last one."""


@dataclass(frozen=True, eq=False)
class Looked:
    """An answer on the grid that its labels are given on."""

    solution: Solution
    t: Array
    """(points,) increasing; where cells meet twice, from either side."""
    u: Array
    """(points, n_u)."""
    rows: Array
    """(points, rows) values of the rows of Pontryagin's system."""
    pressed: Flags
    """(points, rows): the multiplier is not nothing."""
    each: int
    """Points of a panel."""

    @property
    def horizon(self) -> float:
        """From the initial to the final time."""
        return float(self.t[-1] - self.t[0])


def arcs(system: Pontryagin, affine: Flags, seen: Looked) -> tuple[Arc, ...]:
    """Return the arcs of all controls, then of all rows of constraints and bounded states.

    Args:
        system: Pontryagin's system.
        affine: (n_u,) controls that H is affine in.
        seen: the answer.
    """
    active = at_bounds(system, seen) != 0
    rows = [a for i in range(len(system.rows)) for a in _row_arcs(system, i, active[:, i], seen)]
    determined = _determined(system)
    found: list[Arc] = []
    for i, label in enumerate(labels(system.model.controls)):
        own = active[:, determined[:, i]].any(axis=1)
        found += _control_arcs(system, i, label, bool(affine[i]), own, seen)
    return (*found, *rows)


def at_bounds(system: Pontryagin, seen: Looked) -> NDArray[np.int_]:
    """Return −1 where a row is active at its lower bound, +1 at its upper one, (points, rows)."""
    found = np.zeros(seen.rows.shape, dtype=int)
    for i, row in enumerate(system.rows):
        v = seen.rows[:, i]
        size = max(float(np.ptp(v)), 1e-3 * float(np.abs(v).max()), 1e-12)
        pressed = seen.pressed[:, i] | (row.lower == row.upper)
        for sign, side in ((-1, row.lower), (1, row.upper)):
            distance = np.abs(v - side)
            touched = (distance <= TOUCHES * size).reshape(-1, seen.each).any(axis=1)
            there = np.repeat(touched, seen.each) & pressed | (distance <= LIES * size)
            for run in _runs(there.astype(int)):
                span = slice(run.first, run.last + 1)
                if run.label and pressed[span].any():
                    found[span, i] = sign
    return found


def marked(system: Pontryagin, seen: Looked) -> NDArray[np.int_]:
    """Return the labels of û before transitions are merged, (points, n_u)."""
    lower, upper = system.model.control_bounds
    reach = AT_BOUND * np.array([_span(system, i, seen) for i in range(len(lower))])
    at_upper = np.where(seen.u >= upper - reach, UPPER, INTERIOR)
    return np.asarray(np.where(seen.u <= lower + reach, LOWER, at_upper))


def _span(system: Pontryagin, i: int, seen: Looked) -> float:
    """Return the range of a control: between its bounds, or what it moves by."""
    low, high = (float(side[i]) for side in system.model.control_bounds)
    return high - low if np.isfinite(high - low) and high > low else float(ranges(seen.u)[i])


def _determined(system: Pontryagin) -> Flags:
    """Return which controls a row determines when it is active, (rows, n_u), by what enters what.

    Those that enter it, else those that enter its first derivative that has any.
    """
    import casadi as ca

    m = system.model
    pattern = [_pattern(m.xdot, v) for v in (m.x, m.u)]
    found = np.zeros((len(system.rows), m.n_u), dtype=bool)
    for i, row in enumerate(system.rows):
        by_x, by_u = _pattern(row.value, m.x)[0], _pattern(ca.SX(row.value), m.u)[0]
        for _ in range(m.n_x):
            if by_u.any():
                break
            by_u, by_x = pattern[1][by_x].any(axis=0), pattern[0][by_x].any(axis=0)
        found[i] = by_u
    return found


def _pattern(value: object, by: object) -> Flags:
    """Return what depends on what, (values, symbols)."""
    import casadi as ca

    sparsity = ca.jacobian_sparsity(value, by)
    dense = np.zeros(sparsity.shape, dtype=bool)
    dense[sparsity.get_triplet()] = True
    return dense


def _control_arcs(
    system: Pontryagin, i: int, label: str, affine: bool, active: Flags, seen: Looked
) -> list[Arc]:
    low, high = (float(side[i]) for side in system.model.control_bounds)
    tolerance = AT_BOUND * _span(system, i, seen)
    runs = _merged(marked(system, seen)[:, i], seen.t, _in_jumps(i, _brief(seen), seen))
    ends = [(float(seen.t[0]), 0.0)]
    for before, after in pairwise(runs):
        ends.append(_junction(i, before, after, (low, high), tolerance, seen))
    ends.append((float(seen.t[-1]), 0.0))
    found: list[Arc] = []
    for run, start, end in zip(runs, ends[:-1], ends[1:], strict=True):
        kind = _KINDS[run.label]
        if run.label != INTERIOR:
            found.append(Arc(label, kind, start[0], end[0], start[1], end[1]))
            continue
        plain: Kind = "singular" if affine else "interior"
        found += _split(label, plain, active, start, end, seen)
    return found


def _split(
    label: str,
    plain: Kind,
    active: Flags,
    start: tuple[float, float],
    end: tuple[float, float],
    seen: Looked,
) -> list[Arc]:
    """Return an interior stretch in arcs that a constraint determines, and others."""
    inside = (seen.t >= start[0]) & (seen.t <= end[0])
    if not inside.any():
        return [Arc(label, plain, start[0], end[0], start[1], end[1])]
    first = int(np.flatnonzero(inside)[0])
    runs = _merged(active[inside].astype(int), seen.t[inside], _brief(seen)[inside])
    ends = [start, *(_change(first + b.last, first + a.first, seen) for b, a in pairwise(runs)), end]
    return [
        Arc(label, "active" if run.label else plain, a[0], b[0], a[1], b[1])
        for run, a, b in zip(runs, ends[:-1], ends[1:], strict=True)
    ]


def _row_arcs(system: Pontryagin, i: int, active: Flags, seen: Looked) -> list[Arc]:
    label = system.rows[i].label
    runs = _merged(active.astype(int), seen.t, _brief(seen))
    ends = [(float(seen.t[0]), 0.0)]
    ends += [_change(before.last, after.first, seen) for before, after in pairwise(runs)]
    ends.append((float(seen.t[-1]), 0.0))
    return [
        Arc(label, "active" if run.label else "inactive", a[0], b[0], a[1], b[1])
        for run, a, b in zip(runs, ends[:-1], ends[1:], strict=True)
    ]


def _brief(seen: Looked) -> Array:
    """Return how long a transition may be around each point, (points,)."""
    solution = seen.solution
    steps = np.diff(solution.times)
    most = width(solution.basis)
    sums = np.convolve(steps, np.ones(most), mode="same") if len(steps) >= most else steps
    cells = np.clip(np.searchsorted(solution.times, seen.t, side="right") - 1, 0, len(steps) - 1)
    found = np.asarray(sums[cells])
    if np.ptp(steps) <= 1e-6 * steps.max():
        return np.maximum(found, TRANSITION * seen.horizon)
    return found


def _in_jumps(control: int, brief: Array, seen: Looked) -> Array:
    """Return `brief`, and within a jump what the jump takes."""
    found = brief.copy()
    for j in seen.solution.junctions:
        if j.control == control and j.kind == "jump":
            inside = np.abs(seen.t - j.time) <= j.uncertainty
            found[inside] = np.maximum(found[inside], 2 * j.uncertainty)
    return found


def _runs(marks: NDArray[np.int_]) -> list[Run]:
    starts = np.append(0, np.flatnonzero(np.diff(marks)) + 1)
    ends = np.append(starts[1:] - 1, len(marks) - 1)
    return [Run(int(marks[a]), int(a), int(b)) for a, b in zip(starts, ends, strict=True)]


def _merged(marks: NDArray[np.int_], t: Array, brief: Array) -> list[Run]:
    """Return runs without those that are too short to be arcs, the shortest taken out first.

    A gap between two runs of one label closes; else it is left open, and the junction is in it.
    """
    runs = _runs(marks)
    while len(runs) > 1:
        sizes = [
            (t[run.last] - t[run.first]) / brief[(run.first + run.last) // 2] for run in runs
        ]
        shortest = int(np.argmin(sizes))
        if sizes[shortest] > 1:
            break
        del runs[shortest]
        closed: list[Run] = []
        for run in runs:
            if closed and closed[-1].label == run.label:
                closed[-1] = Run(run.label, closed[-1].first, run.last)
            else:
                closed.append(run)
        runs = closed
    return runs


def _junction(
    control: int,
    before: Run,
    after: Run,
    bounds: tuple[float, float],
    tolerance: float,
    seen: Looked,
) -> tuple[float, float]:
    """Return time and uncertainty of the change between two arcs of a control."""
    begin, end = float(seen.t[before.last]), float(seen.t[after.first])
    reach = NEAR * seen.horizon
    near = [
        j
        for j in seen.solution.junctions
        if j.control == control
        and begin - max(reach, j.uncertainty) <= j.time <= end + max(reach, j.uncertainty)
    ]
    best = min(near, key=lambda j: abs(j.time - (begin + end) / 2), default=None)
    if best is not None and best.kind == "jump":
        return best.time, best.uncertainty
    if INTERIOR not in (before.label, after.label):
        return (begin + end) / 2, (end - begin) / 2
    inner = before if before.label == INTERIOR else after
    outer = after if inner is before else before
    bound = bounds[0] if outer.label == LOWER else bounds[1]
    drawn = _drawn(inner, inner is before, np.abs(seen.u[:, control] - bound) / tolerance, seen)
    if best is not None and best.uncertainty < drawn[1]:
        return best.time, best.uncertainty
    return drawn


def _drawn(inner: Run, before: bool, off: Array, seen: Looked) -> tuple[float, float]:
    """Draw û on to its bound, along the chord from four tolerances off to one."""
    points = np.arange(inner.first, inner.last + 1)
    points = points[::-1] if before else points
    far = np.flatnonzero(off[points] >= 4)
    edge = float(seen.t[points[0]])
    if not far.size:
        return edge, NEAR * seen.horizon
    away = int(points[far[0]])
    way = float(seen.t[away] - edge) / 3
    cells = np.searchsorted(seen.solution.times, edge, side="right") - 1
    cells = min(cells, len(seen.solution.times) - 2)
    length = float(seen.solution.times[cells + 1] - seen.solution.times[cells])
    return edge - way, abs(way) + length


def _change(last: int, first: int, seen: Looked) -> tuple[float, float]:
    """Return time and uncertainty of a change of a constraint, between two points."""
    begin, end = float(seen.t[last]), float(seen.t[first])
    cells = np.searchsorted(seen.solution.times, [begin, end])
    cells = np.clip(cells, 1, len(seen.solution.times) - 1)
    length = float(np.diff(seen.solution.times)[cells - 1].max())
    reach = max(2 * length + (end - begin), NEAR * seen.horizon)
    near = [
        j
        for j in seen.solution.junctions
        if begin - reach - j.uncertainty <= j.time <= end + reach + j.uncertainty
    ]
    if near:
        best = min(near, key=lambda j: abs(j.time - (begin + end) / 2))
        return best.time, best.uncertainty
    return (begin + end) / 2, (end - begin) / 2 + length
