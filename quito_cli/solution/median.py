"""The median by sorting: numpy's imports masked arrays, a tenth of the time of a short solve."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def median(values: NDArray[np.float64]) -> Any:
    """Return the medians along the last axis, which is not empty."""
    ordered, count = np.sort(values, axis=-1), values.shape[-1]
    return (ordered[..., (count - 1) // 2] + ordered[..., count // 2]) / 2
