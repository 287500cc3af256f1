"""How much a control moves, and whether it rings.

Total variation is that of samples on a grid much finer than the cells. The ringing index is one
formula for every method: the energy of the second differences of the samples, jump zones of twelve
cells left out, relative to that of the reference where there is one, else of the control's own
running mean over four cells; never relative to less than second differences of `FLOOR` of the
control's span, which for a constant is `STILL` of its size: else its noise would be all there is.
An index up to about one is a control without ringing.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from quito_cli.solution.median import median

Array = NDArray[np.float64]

JUMP = 0.05
"""A change within two cells above this fraction of the control's span may be a jump."""
ZONE = 12
"""Cells on either side of a jump that a quasi-interpolant may need to get over it."""
STEEPER = 4.0
"""A jump is this much steeper than what is usual within sixteen cells of it."""
FLOOR = 3e-4
"""Second differences of this fraction of the span are seen by nobody."""
STILL = 0.1
"""Of its size: a control that moves by less is judged as if it moved by as much."""
NOTHING = 1e-3
"""Of its bounds: a control is judged as if it moved by as much, where it is zero but for noise."""


def largest_bounds(lower: Array, upper: Array) -> Array:
    """Return the larger size of the finite bounds of each control, (n_u,); zero without any."""
    bounds = np.abs([lower, upper])
    return np.asarray(np.where(np.isfinite(bounds), bounds, 0.0).max(axis=0))


def total_variation(samples: Array) -> Array:
    """Return Σ|û_{i+1} − û_i| by control, from samples (points, n_u)."""
    return np.asarray(np.abs(np.diff(samples, axis=0)).sum(axis=0))


def ringing_index(
    samples: Array, width: int, reference: Array | None = None, bound: float = 0.0
) -> float:
    """Return the ringing index of one control.

    Args:
        samples: (points,) û on a uniform grid, `width` points a cell.
        width: points a cell.
        reference: (points,) the known control on the same grid.
        bound: size of the larger of its finite bounds; zero where there is none.
    """
    size = float(np.abs(samples).max())
    own = float(np.ptp(samples))
    span = max(own, STILL * size, NOTHING * bound)
    if span == 0.0:
        return 0.0
    smooth = _running_mean(samples, 4 * width) if reference is None else reference
    calm = ~_jump_zones(smooth, width, JUMP * own)[1:-1]
    energy = float(np.sum(np.diff(samples, 2)[calm] ** 2))
    expected = float(np.sum(np.diff(smooth, 2)[calm] ** 2))
    return energy / max(
        expected, float(calm.sum()) * (FLOOR * span) ** 2, float(np.finfo(float).tiny)
    )


def _running_mean(samples: Array, width: int) -> Array:
    padded = np.pad(samples, (width // 2, width - 1 - width // 2), mode="edge")
    return np.asarray(np.convolve(padded, np.full(width, 1 / width), mode="valid"))


def _jump_zones(samples: Array, width: int, limit: float) -> NDArray[np.bool_]:
    """Return the points within `ZONE` cells of a jump, with `width` points a cell."""
    zones = np.zeros(len(samples), dtype=bool)
    nodes = samples[::width]
    if len(nodes) < 3:
        return zones
    change = np.abs(nodes[2:] - nodes[:-2])
    around = np.pad(change, 16, mode="reflect") if len(change) > 16 else change[None, :]
    windows = sliding_window_view(around, 33) if len(change) > 16 else around
    usual = median(windows)
    for cell in np.nonzero((change > limit) & (change > STEEPER * usual))[0] + 1:
        zones[max((cell - ZONE) * width, 0) : (cell + ZONE) * width + 1] = True
    return zones
