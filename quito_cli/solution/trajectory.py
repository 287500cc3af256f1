"""States between the nodes: an interpolation of the scheme's order.

Through the ends of the substeps, x_j at t_j: piecewise linear for a scheme of order one, cubic
Hermite for higher ones, with slopes f(x, û, t) taken at both ends of each substep separately, for
the control, and so the slope, may jump at a node.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from quito_cli.transcription.hermite import hermite

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Trajectory:
    """States at the ends of M substeps and what is needed in between."""

    times: Array
    """(M+1,)."""
    states: Array
    """(M+1, n_x)."""
    start_slopes: Array
    """(M, n_x): ẋ just after the start of each substep."""
    end_slopes: Array
    """(M, n_x): ẋ just before the end of each substep."""
    interpolation: Literal["linear", "cubic"]

    def __call__(self, times: Array) -> Array:
        """Return the states at `times`, (len(times), n_x); beyond the ends, those of the ends."""
        times = np.clip(times, self.times[0], self.times[-1])
        j = np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, len(self.times) - 2)
        h = (self.times[j + 1] - self.times[j])[:, None]
        s = (times - self.times[j])[:, None] / h
        before, after = self.states[j], self.states[j + 1]
        if self.interpolation == "linear":
            return before + s * (after - before)
        slopes = self.start_slopes[j], self.end_slopes[j]
        with np.errstate(invalid="ignore", over="ignore"):
            cubic = hermite(before, after, *slopes, h, s)
            linear = before + s * (after - before)
        known = np.isfinite(slopes[0]) & np.isfinite(slopes[1])  # undefined dynamics have none
        inner = np.where(known, cubic, linear)
        return np.where(s == 0, before, np.where(s == 1, after, inner))
