"""How far the control may be from the truth: differences of answers, and what theory says.

Two answers to one problem, on other meshes or with other substeps, differ by about as much as the
worse of them is wrong; where both err alike they say nothing, so that the known parts stand beside:
the saturation of the generating function, its approximation error on this mesh, the local errors of
the integration, and the distance to a bound that û is at. All of it is relative to the control's
range, in the uniform norm, outside the jumps of both answers; the jumps are judged in L².
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from quito_cli.solution.junctions import Junction, ranges
from quito_cli.solution.rounds import Account
from quito_cli.solution.solution import Solution
from quito_cli.solution.variation import largest_bounds
from quito_cli.transcription.control import ControlBasis
from quito_cli.transcription.qualities import leading_moment, saturation

Array = NDArray[np.float64]

AT_BOUND = 1e-4
"""û is at a bound that is no further than this part of its range."""
_FINE = 4
"""Points a cell at which answers are compared."""


def spread(solution: Solution) -> Array:
    """Return the range of each control, (n_u,): what its errors are relative to."""
    controls = solution.origin.controls
    lower, upper = (
        np.array([getattr(one, side) for one in controls]) for side in ("lower", "upper")
    )
    return ranges(solution.control(solution.dense_times), largest_bounds(lower, upper))


def account(
    solution: Solution, other_mesh: Solution, other_substeps: Solution, local_errors: Array
) -> Account:
    """Return the account of an answer's control.

    Args:
        solution: the answer.
        other_mesh: one on another mesh.
        other_substeps: one with more substeps.
        local_errors: (N,) of the answer's states, over their size.
    """
    size = spread(solution)
    zones = left_out(solution, other_mesh, other_substeps)
    times = np.unique(np.concatenate([sample_times(s) for s in (solution, other_mesh)]))
    times = times[~within(times, zones)]
    horizon = float(solution.times[-1] - solution.times[0])
    return Account(
        meshes=_difference(solution, other_mesh, times, size),
        substeps=_difference(solution, other_substeps, times, size),
        bounds=_from_bounds(solution, times, size),
        jumps=blur(solution.junctions, size, horizon),
        left_out=zones,
        saturation=_saturation(solution),
        approximation=_bends(solution, zones, size, 0),
        integration=float(local_errors.sum()),
        states=solution.evidence.resimulation_gap,
    )


def change(solution: Solution, before: Solution) -> float:
    """Return the largest change of û outside the jumps of both, over its range."""
    times = np.unique(np.concatenate([sample_times(s) for s in (solution, before)]))
    times = times[~within(times, left_out(solution, before))]
    return _difference(solution, before, times, spread(solution))


def sample_times(solution: Solution) -> Array:
    """Return times within all cells, a few in each."""
    steps = np.diff(solution.times)
    parts = (np.arange(_FINE) + 0.5) / _FINE
    return np.asarray((solution.times[:-1, None] + steps[:, None] * parts).ravel())


def left_out(*solutions: Solution) -> tuple[tuple[float, float], ...]:
    """Return the times that the jumps of all these answers take, joined where they overlap."""
    jumps = [j for s in solutions for j in s.junctions if j.kind == "jump"]
    spans = sorted((j.time - 2 * j.uncertainty, j.time + 2 * j.uncertainty) for j in jumps)
    joined: list[tuple[float, float]] = []
    for start, end in spans:
        if joined and start <= joined[-1][1]:
            joined[-1] = joined[-1][0], max(joined[-1][1], end)
        else:
            joined.append((start, end))
    first, last = solutions[0].times[0], solutions[0].times[-1]
    return tuple((max(start, float(first)), min(end, float(last))) for start, end in joined)


def within(times: Array, zones: tuple[tuple[float, float], ...]) -> NDArray[np.bool_]:
    """Return which times are in a zone."""
    found = np.zeros(len(times), dtype=bool)
    for start, end in zones:
        found |= (times >= start) & (times <= end)
    return found


def blur(junctions: tuple[Junction, ...], size: Array, horizon: float) -> float:
    """Return the L² norm of û minus a step over all jumps, over range and horizon."""
    squares = np.zeros(len(size))
    for junction in junctions:
        squares[junction.control] += (junction.blur / size[junction.control]) ** 2
    return float(np.sqrt(squares.max(initial=0.0) / horizon))


def _difference(one: Solution, other: Solution, times: Array, size: Array) -> float:
    """Return the largest difference of two controls, the horizon of the other one fitted."""
    if not times.size:
        return math.nan
    fractions = (times - one.times[0]) / (one.times[-1] - one.times[0])
    there = other.times[0] + fractions * (other.times[-1] - other.times[0])
    return float((np.abs(one.control(times) - other.control(there)) / size).max(initial=0.0))


def _from_bounds(solution: Solution, times: Array, size: Array) -> float:
    """Return the largest distance from a bound where û is at it, over its range."""
    if not times.size:
        return 0.0
    u, worst = solution.control(times), 0.0
    for i, quantity in enumerate(solution.origin.controls):
        for bound in (quantity.lower, quantity.upper):
            if np.isfinite(bound):
                distance = np.abs(u[:, i] - bound) / size[i]
                worst = max(worst, float(distance[distance < AT_BOUND].max(initial=0.0)))
    return worst


def _saturation(solution: Solution) -> float:
    basis = solution.basis
    if not isinstance(basis, ControlBasis):
        return 0.0
    return saturation(basis.function, basis.variance, basis.normalised)


def bends(solution: Solution, ends: int) -> float:
    """Return the first term of the approximation error outside jumps, `ends` nodes left out."""
    return _bends(solution, left_out(solution), spread(solution), ends)


def _bends(
    solution: Solution, zones: tuple[tuple[float, float], ...], size: Array, ends: int
) -> float:
    """Return the largest √D^q |M_q Δ^q û| / q! outside `zones`, û over its range.

    M_q is the first moment of the generating function that is not zero. Of a control that is
    constant in its cells it is half the difference of neighbours.
    """
    basis = solution.basis
    if not isinstance(basis, ControlBasis):
        return math.nan
    nodes = solution.control(solution.times) / size
    if basis.function.cellwise:
        q, factor = 1, 0.5
    else:
        q, moment = leading_moment(basis.function)
        spread = basis.variance if basis.function.scaled else 1.0
        factor = spread ** (q / 2) * abs(moment) / math.factorial(q)
    differences = np.abs(np.diff(nodes, q, axis=0))
    middle = solution.times[q // 2 : len(nodes) - q + q // 2]
    kept = ~within(middle, zones)
    kept[:ends] = kept[max(len(kept) - ends, 0) :] = False
    return factor * float(differences[kept].max(initial=0.0))
