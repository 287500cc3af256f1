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

    # What is shared enters through the phase's ends, p and ν: these are the columns of `local`.
    p, nu = layout.place("p"), layout.place("nu")
    local = np.r_[time, time + 1, p.start : p.stop, nu.start : nu.stop]
    by_local = np.concatenate(
        [
            slopes[..., two : two + 1] * (1 - place)[..., None, None],
            slopes[..., two : two + 1] * place[..., None, None],
            slopes[..., two + 1 :],
        ],
        axis=3,
    )
    h_by_local = np.zeros((count, len(local)))
    h_by_local[:, 0], h_by_local[:, 1] = -steps[:, 0], steps[:, 0]

    a, b = method.matrix, method.weights
    sums = a @ rates[..., :two]
    residuals = segments.stages - segments.nodes[:-1, None, :two] - h[..., None] * sums
    weighted_slopes = (h[:, :1, None, None] * slopes[..., :two, :two])[:, None]
    matrix = -(a[None, :, :, None, None] * weighted_slopes).transpose(0, 1, 3, 2, 4)
    matrix = matrix.reshape(count, s * two, s * two)
    matrix[:, np.arange(s * two), np.arange(s * two)] += 1.0
    right = np.tensordot(by_local[..., :two, :], a, axes=([1], [1])).transpose(0, 3, 1, 2)
    right = h[:, :1, None, None] * right + sums[..., None] * h_by_local[:, None, None, :]
    columns = np.concatenate(
        [
            np.tile(np.tile(np.eye(two), (s, 1)), (count, 1, 1)),
            right.reshape(count, s * two, -1),
            -residuals.reshape(count, s * two, 1),
        ],
        axis=2,
    )
    moved = _solved(matrix, columns)
    stages_by_start = moved[..., :two]

    total = np.tensordot(rates, b, axes=([1], [0]))
    ends = segments.nodes[:-1] + h * total
    weighted = (h[:, :1, None, None] * b[:, None, None] * slopes[..., :two]).transpose(0, 2, 1, 3)
    weighted = weighted.reshape(count, n_y, s * two)
    by_start = np.tile(np.eye(n_y), (count, 1, 1))
    by_start[:, :, :two] += weighted @ stages_by_start
    ends_by_local = weighted @ moved[..., two:-1]
    ends_by_local += h[:, :1, None] * np.tensordot(by_local, b, axes=([1], [0]))
    ends_by_local += total[..., None] * h_by_local[:, None, :]
    ends_by_shared = np.zeros((count, n_y, layout.count))
    stages_by_shared = np.zeros((count, s * two, layout.count))
    ends_by_shared[..., local] = ends_by_local
    stages_by_shared[..., local] = moved[..., two:-1]
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
        return np.asarray(np.linalg.solve(matrix, right))
    except np.linalg.LinAlgError:
        return np.full(right.shape, np.nan)
