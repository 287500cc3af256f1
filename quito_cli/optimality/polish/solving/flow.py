"""The collocation equations of a phase, linearised, with the Gauss points eliminated.

In every segment of length h = φ L, L the length of the phase, the values at the Gauss points follow
from those at its start and from what is shared,

    Y_i − y − h Σ_j a_ij F(Y_j, t_j) = 0,      y₁ = y + h Σ_j b_j F(Y_j, t_j),

and with them what is at its end. The linear systems of all segments are solved at once. Of what is
shared the times of the phase's ends, p and ν enter here, and are called local.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.polish.equations.gauss import Gauss
from quito_cli.optimality.polish.equations.law import Law
from quito_cli.optimality.polish.equations.unknowns import Layout, Segments
from quito_cli.optimality.polish.solving.pointwise import solved

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


@dataclass(frozen=True, eq=False)
class _Rates:
    """F at the Gauss points, and its derivatives."""

    value: Array
    """(K, s, n_y)."""
    by_stage: Array
    """(K, s, n_y, 2 n_x)."""
    by_local: Array
    """(K, s, n_y, local)."""
    lengths: Array
    """(K,) h."""
    lengths_by_local: Array
    """(K, local)."""
    inner: Array
    """(K, s, n_z)."""


def inputs(times: Array, y: Array, shared: Array, layout: Layout) -> Array:
    """Return v = (x, λ, t, p, ν) at points: times (n,), y (n, at least 2 n_x)."""
    constant = np.concatenate(
        [shared[layout.place("parameters")], shared[layout.place("integral")]]
    )
    tail = np.tile(constant, (len(times), 1))
    return np.hstack([y[:, : 2 * layout.states], times[:, None], tail])


def linearised(
    law: Law, segments: Segments, shared: Array, layout: Layout, phase: int, method: Gauss
) -> Linearised:
    """Linearise the equations of a phase; NaN where its law has no value."""
    rates = _rates(law, segments, shared, layout, phase, method)
    count, s, n_y, two = rates.by_stage.shape
    residuals, moved = _stages(rates, segments, method)
    by_start, by_local, own = moved[..., :two], moved[..., two:-1], moved[..., -1]

    h, b = rates.lengths[:, None], method.weights
    total = np.tensordot(rates.value, b, axes=([1], [0]))
    ends = segments.nodes[:-1] + h * total
    by_stages = (h[..., None, None] * b[:, None, None] * rates.by_stage).transpose(0, 2, 1, 3)
    by_stages = by_stages.reshape(count, n_y, s * two)
    ends_by_start = np.tile(np.eye(n_y), (count, 1, 1))
    ends_by_start[:, :, :two] += by_stages @ by_start
    ends_by_local = by_stages @ by_local
    ends_by_local += h[..., None] * np.tensordot(rates.by_local, b, axes=([1], [0]))
    ends_by_local += total[..., None] * rates.lengths_by_local[:, None]
    local = _local(layout, phase)
    return Linearised(
        ends + (by_stages @ own[..., None])[..., 0],
        ends_by_start,
        _spread(ends_by_local, local, layout),
        by_start,
        _spread(by_local, local, layout),
        own,
        rates.inner,
        residuals,
        ends - segments.nodes[1:],
    )


def _local(layout: Layout, phase: int) -> NDArray[np.int_]:
    """Return the entries of g that a phase depends on: its times, p, ν."""
    time = layout.time(phase)
    entries = [layout.entries("parameters"), layout.entries("integral")]
    return np.concatenate([[time, time + 1], *entries])


def _spread(by_local: Array, local: NDArray[np.int_], layout: Layout) -> Array:
    """Return derivatives in local entries as derivatives in g."""
    found = np.zeros((*by_local.shape[:2], layout.count))
    found[..., local] = by_local
    return found


def _rates(
    law: Law, segments: Segments, shared: Array, layout: Layout, phase: int, method: Gauss
) -> _Rates:
    two, (count, s) = 2 * layout.states, segments.stages.shape[:2]
    start, end = (float(shared[layout.time(k)]) for k in (phase, phase + 1))
    v = inputs(
        segments.times(method.points, start, end).ravel(),
        segments.stages.reshape(-1, two),
        shared,
        layout,
    )
    found = law.values(v, segments.inner.reshape(count * s, -1))
    slopes = found.slopes.reshape(count, s, layout.size, -1)
    place = segments.times(method.points, 0.0, 1.0)[..., None, None]
    by_t = slopes[..., two : two + 1]
    by_local = np.concatenate([by_t * (1 - place), by_t * place, slopes[..., two + 1 :]], axis=3)
    steps = np.diff(segments.fractions)
    lengths_by_local = np.zeros((count, by_local.shape[3]))
    lengths_by_local[:, 0], lengths_by_local[:, 1] = -steps, steps
    return _Rates(
        found.rates.reshape(count, s, layout.size),
        slopes[..., :two],
        by_local,
        steps * (end - start),
        lengths_by_local,
        found.z.reshape(count, s, found.z.shape[1]),
    )


def _stages(rates: _Rates, segments: Segments, method: Gauss) -> tuple[Array, Array]:
    """Return residuals of the stages, (K, s, 2 n_x), and how they move, (K, s · 2 n_x, …).

    By the start (2 n_x), by local entries, and last by Newton's step for themselves.
    """
    count, s, _, two = rates.by_stage.shape
    a, h = method.matrix, rates.lengths[:, None, None]
    sums = a @ rates.value[..., :two]
    residuals = segments.stages - segments.nodes[:-1, None, :two] - h * sums
    slopes = (h[..., None] * rates.by_stage[..., :two, :])[:, None]
    matrix = -(a[None, :, :, None, None] * slopes).transpose(0, 1, 3, 2, 4)
    matrix = matrix.reshape(count, s * two, s * two)
    matrix[:, np.arange(s * two), np.arange(s * two)] += 1.0
    by_local = np.tensordot(rates.by_local[..., :two, :], a, axes=([1], [1]))
    by_local = h[..., None] * by_local.transpose(0, 3, 1, 2)
    by_local += sums[..., None] * rates.lengths_by_local[:, None, None]
    columns = [
        np.tile(np.eye(two), (count, s, 1)),
        by_local.reshape(count, s * two, -1),
        -residuals.reshape(count, s * two, 1),
    ]
    return residuals, solved(matrix, np.concatenate(columns, axis=2))
