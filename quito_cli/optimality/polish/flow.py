"""The collocation equations of a phase, linearised, with the Gauss points eliminated.

In every segment of length h = φ L, L the length of the phase, the values at the Gauss points follow
from those at its start and from what is shared,

    Y_i − y − h Σ_j a_ij F(Y_j, t_j) = 0,

and with them what is at its end. The linear systems of all segments are solved at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.polish.gauss import Gauss
from quito_cli.optimality.polish.law import Law
from quito_cli.optimality.polish.unknowns import Segments, Shared

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Linearised:
    """A phase about a point."""

    ends: Array
    """(K, n_y) at the ends of segments, were the stages what their equations say to first order."""
    by_start: Array
    """(K, n_y, n_y)."""
    by_shared: Array
    """(K, n_y, n_g)."""
    stages_by_start: Array
    """(K, s · 2 n_x, 2 n_x)."""
    stages_by_shared: Array
    """(K, s · 2 n_x, n_g)."""
    stage_steps: Array
    """(K, s · 2 n_x): Newton's steps of the stages for themselves."""
    inner: Array
    """(K, s, n_z), settled."""
    residuals: Array
    """(K, s, 2 n_x) of the stages."""
    gaps: Array
    """(K, n_y): ends by the stages as they are, minus the next nodes."""


def inputs(times: Array, y: Array, shared: Array, layout: Shared) -> Array:
    """Return v = (x, λ, t, p, ν) at points: times (n,), y (n, at least 2 n_x)."""
    tail = [np.tile(shared[layout.place(name)], (len(times), 1)) for name in ("p", "nu")]
    return np.hstack([y[:, : 2 * layout.states], times[:, None], *tail])


def points_of(segments: Segments, method: Gauss) -> Array:
    """Return where the Gauss points are in a phase, (K, s), 0 … 1."""
    steps = np.diff(segments.fractions)[:, None]
    return np.asarray(segments.fractions[:-1, None] + steps * method.points)


def linearised(
    law: Law, segments: Segments, shared: Array, layout: Shared, phase: int, method: Gauss
) -> Linearised:
    """Linearise the equations of a phase; NaN where its law has no value."""
    two, count, s = 2 * layout.states, len(segments.stages), len(method.points)
    n_y = segments.nodes.shape[1]
    time = layout.place("T").start + phase
    start, length = shared[time], shared[time + 1] - shared[time]
    place = points_of(segments, method)
    v = inputs((start + place * length).ravel(), segments.stages.reshape(-1, two), shared, layout)
    found = law.values(v, segments.inner.reshape(count * s, -1))
    rates = found.rates.reshape(count, s, n_y)
    slopes = found.slopes.reshape(count, s, n_y, -1)
    steps = np.diff(segments.fractions)[:, None]
    h = steps * length

    # F as it moves with the shared unknowns, through t, p, ν; and h with the phase's ends.
    by_shared = np.zeros((count, s, n_y, layout.count))
    by_shared[..., time] += slopes[..., two] * (1 - place)[..., None]
    by_shared[..., time + 1] += slopes[..., two] * place[..., None]
    at = two + 1
    for name in ("p", "nu"):
        own = layout.place(name)
        width = own.stop - own.start
        by_shared[..., own] += slopes[..., at : at + width]
        at += width
    h_by_shared = np.zeros((count, layout.count))
    h_by_shared[:, time], h_by_shared[:, time + 1] = -steps[:, 0], steps[:, 0]

    a, b = method.matrix, method.weights
    sums = np.einsum("ij,kjy->kiy", a, rates[..., :two])
    residuals = segments.stages - segments.nodes[:-1, None, :two] - h[..., None] * sums
    matrix = -np.einsum("k,ij,kjxy->kixjy", h[:, 0], a, slopes[..., :two, :two])
    matrix = matrix.reshape(count, s * two, s * two)
    matrix[:, np.arange(s * two), np.arange(s * two)] += 1.0
    right = np.einsum("k,ij,kjxg->kixg", h[:, 0], a, by_shared[..., :two, :])
    right += np.einsum("kix,kg->kixg", sums, h_by_shared)
    columns = np.concatenate(
        [
            np.tile(np.tile(np.eye(two), (s, 1)), (count, 1, 1)),
            right.reshape(count, s * two, -1),
            -residuals.reshape(count, s * two, 1),
        ],
        axis=2,
    )
    moved = _solved(matrix, columns)
    stages_by_start, stages_by_shared = moved[..., :two], moved[..., two:-1]

    total = np.einsum("i,kiy->ky", b, rates)
    ends = segments.nodes[:-1] + h * total
    weighted = np.einsum("k,i,kixy->kxiy", h[:, 0], b, slopes[..., :two])
    weighted = weighted.reshape(count, n_y, s * two)
    by_start = np.tile(np.eye(n_y), (count, 1, 1))
    by_start[:, :, :two] += weighted @ stages_by_start
    ends_by_shared = weighted @ stages_by_shared
    ends_by_shared += np.einsum("k,i,kixg->kxg", h[:, 0], b, by_shared)
    ends_by_shared += np.einsum("kx,kg->kxg", total, h_by_shared)
    return Linearised(
        ends + (weighted @ moved[..., -1:])[..., 0],
        by_start,
        ends_by_shared,
        stages_by_start,
        stages_by_shared,
        moved[..., -1],
        found.z.reshape(count, s, -1),
        residuals,
        ends - segments.nodes[1:],
    )


def _solved(matrix: Array, right: Array) -> Array:
    """Solve for every segment; NaN where the law has no value or the matrix no inverse."""
    if not np.isfinite(matrix).all():
        return np.full(right.shape, np.nan)
    try:
        return np.linalg.solve(matrix, right)
    except np.linalg.LinAlgError:
        return np.full(right.shape, np.nan)
