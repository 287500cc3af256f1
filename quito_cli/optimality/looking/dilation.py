"""Small helpers of arrays along time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def dilated(values: Array, most: int) -> Array:
    """Return the largest value within `most` points, along the first axis."""
    padded = np.pad(values, ((most, most), (0, 0)), mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * most + 1, axis=0)
    return np.asarray(windows.max(axis=-1))


def positive(values: Array) -> Array:
    """Return values, and one where they are not positive: what may be divided by."""
    return np.where(values > 0, values, 1.0)
