"""Labels of an answer on a fine grid: controls at their bounds, constraints that are active.

Labels come in runs. A run too short to be an arc is taken out, the shortest first; the gap closes
where it is between two runs of one label.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.hamiltonian import Pontryagin
from quito_cli.solution.junctions import ranges, width
from quito_cli.solution.variation import largest_bounds

if TYPE_CHECKING:
    import casadi as ca

    from quito_cli.solution.solution import Solution

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

AT_BOUND = 0.004
"""Part of a control's range within which it is at a bound."""
TRANSITION = 0.015
"""Part of the horizon that a transition takes at most, on equal cells."""
TOUCHES, LIES = 1e-3, 1e-4
"""Parts of its range within which a constraint is at its bound: somewhere in a panel, with a
multiplier that says so, and where that is nothing, as it may be in the middle of an arc."""

LOWER, INTERIOR, UPPER = -1, 0, 1


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
            for run in runs_of(there.astype(int)):
                span = slice(run.first, run.last + 1)
                if run.label and pressed[span].any():
                    found[span, i] = sign
    return found


def marked(system: Pontryagin, seen: Looked) -> NDArray[np.int_]:
    """Return the labels of û before transitions are merged, (points, n_u)."""
    lower, upper = system.model.control_bounds
    reach = AT_BOUND * np.array([span(system, i, seen) for i in range(len(lower))])
    at_upper = np.where(seen.u >= upper - reach, UPPER, INTERIOR)
    return np.asarray(np.where(seen.u <= lower + reach, LOWER, at_upper))


def span(system: Pontryagin, i: int, seen: Looked) -> float:
    """Return the range of a control: between its bounds, or what it moves by."""
    low, high = (float(side[i]) for side in system.model.control_bounds)
    return (
        high - low
        if np.isfinite(high - low) and high > low
        else float(ranges(seen.u, largest_bounds(*system.model.control_bounds))[i])
    )


def determined_by_rows(system: Pontryagin) -> Flags:
    """Return which controls a row determines when it is active, (rows, n_u), by what enters what.

    Those that enter it, else those that enter its first derivative that has any.
    """
    m = system.model
    pattern = [_pattern(m.xdot, v) for v in (m.x, m.u)]
    found = np.zeros((len(system.rows), m.n_u), dtype=bool)
    for i, row in enumerate(system.rows):
        by_x, by_u = _pattern(row.value, m.x)[0], _pattern(row.value, m.u)[0]
        for _ in range(m.n_x):
            if by_u.any():
                break
            by_u, by_x = pattern[1][by_x].any(axis=0), pattern[0][by_x].any(axis=0)
        found[i] = by_u
    return found


def _pattern(value: ca.SX, by: ca.SX) -> Flags:
    """Return what depends on what, (values, symbols)."""
    import casadi as ca

    sparsity = ca.jacobian_sparsity(value, by)
    dense = np.zeros(sparsity.shape, dtype=bool)
    dense[sparsity.get_triplet()] = True
    return dense


def brief(seen: Looked) -> Array:
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


def in_jumps(control: int, brief: Array, seen: Looked) -> Array:
    """Return `brief`, and within a jump what the jump takes."""
    found = brief.copy()
    for j in seen.solution.junctions:
        if j.control == control and j.kind == "jump":
            inside = np.abs(seen.t - j.time) <= j.uncertainty
            found[inside] = np.maximum(found[inside], 2 * j.uncertainty)
    return found


def runs_of(marks: NDArray[np.int_]) -> list[Run]:
    """Return neighbouring points of one label."""
    starts = np.append(0, np.flatnonzero(np.diff(marks)) + 1)
    ends = np.append(starts[1:] - 1, len(marks) - 1)
    return [Run(int(marks[a]), int(a), int(b)) for a, b in zip(starts, ends, strict=True)]


def merged(marks: NDArray[np.int_], t: Array, brief: Array) -> list[Run]:
    """Return runs without those that are too short to be arcs, the shortest taken out first.

    A gap between two runs of one label closes; else it is left open, and the junction is in it.
    """
    runs = runs_of(marks)
    kinds, first, last = (
        np.array([getattr(run, name) for run in runs]) for name in ("label", "first", "last")
    )
    while len(kinds) > 1:
        sizes = (t[last] - t[first]) / brief[(first + last) // 2]
        k = int(np.argmin(sizes))
        if sizes[k] > 1:
            break
        inner = 0 < k < len(kinds) - 1
        closes = inner and kinds[k - 1] == kinds[k + 1]
        if closes:
            last[k - 1] = last[k + 1]
        gone = [k, k + 1] if closes else [k]
        kinds, first, last = (np.delete(part, gone) for part in (kinds, first, last))
    ends = zip(kinds.tolist(), first.tolist(), last.tolist(), strict=True)
    return [Run(*run) for run in ends]
