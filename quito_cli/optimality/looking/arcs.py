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

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.hamiltonian import Pontryagin
from quito_cli.optimality.looking.marks import (
    AT_BOUND,
    INTERIOR,
    LOWER,
    UPPER,
    Looked,
    Run,
    at_bounds,
    brief,
    determined_by_rows,
    in_jumps,
    marked,
    merged,
    span,
)
from quito_cli.problem.model import labels
from quito_cli.solution.optimal import Arc, Kind

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

NEAR = 0.01
"""Part of the horizon within which a jump or kink is that of a change of labels."""
_KINDS: dict[int, Kind] = {LOWER: "lower", INTERIOR: "interior", UPPER: "upper"}


def arcs(system: Pontryagin, affine: Flags, seen: Looked) -> tuple[Arc, ...]:
    """Return the arcs of all controls, then of all rows of constraints and bounded states.

    Args:
        system: Pontryagin's system.
        affine: (n_u,) controls that H is affine in.
        seen: the answer.
    """
    active = at_bounds(system, seen) != 0
    rows = [a for i in range(len(system.rows)) for a in _row_arcs(system, i, active[:, i], seen)]
    determined = determined_by_rows(system)
    found: list[Arc] = []
    for i, label in enumerate(labels(system.model.controls)):
        own = active[:, determined[:, i]].any(axis=1)
        found += _control_arcs(system, i, label, bool(affine[i]), own, seen)
    return (*found, *rows)


def _control_arcs(
    system: Pontryagin, i: int, label: str, affine: bool, active: Flags, seen: Looked
) -> list[Arc]:
    low, high = (float(side[i]) for side in system.model.control_bounds)
    tolerance = AT_BOUND * span(system, i, seen)
    runs = merged(marked(system, seen)[:, i], seen.t, in_jumps(i, brief(seen), seen))
    ends = [(float(seen.t[0]), 0.0)]
    for before, after in pairwise(runs):
        ends.append(_junction(i, before, after, (low, high), tolerance, ends[-1][0], seen))
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
    runs = merged(active[inside].astype(int), seen.t[inside], brief(seen)[inside])
    ends = [
        start,
        *(_change(first + b.last, first + a.first, seen) for b, a in pairwise(runs)),
        end,
    ]
    return [
        Arc(label, "active" if run.label else plain, a[0], b[0], a[1], b[1])
        for run, a, b in zip(runs, ends[:-1], ends[1:], strict=True)
    ]


def _row_arcs(system: Pontryagin, i: int, active: Flags, seen: Looked) -> list[Arc]:
    label = system.rows[i].label
    runs = merged(active.astype(int), seen.t, brief(seen))
    ends = [(float(seen.t[0]), 0.0)]
    ends += [_change(before.last, after.first, seen) for before, after in pairwise(runs)]
    ends.append((float(seen.t[-1]), 0.0))
    return [
        Arc(label, "active" if run.label else "inactive", a[0], b[0], a[1], b[1])
        for run, a, b in zip(runs, ends[:-1], ends[1:], strict=True)
    ]


def _junction(
    control: int,
    before: Run,
    after: Run,
    bounds: tuple[float, float],
    tolerance: float,
    last: float,
    seen: Looked,
) -> tuple[float, float]:
    """Return time and uncertainty of the change between two arcs of a control, after the last."""
    begin, end = float(seen.t[before.last]), float(seen.t[after.first])
    reach = NEAR * seen.horizon
    near = [
        j
        for j in seen.solution.junctions
        if j.control == control
        and j.time > last
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
    nodes = seen.solution.times
    cell = min(int(np.searchsorted(nodes, edge, side="right")) - 1, len(nodes) - 2)
    length = float(nodes[cell + 1] - nodes[cell])
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
