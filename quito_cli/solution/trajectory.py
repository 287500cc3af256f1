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
        linear = before + s * (after - before)
        if self.interpolation == "linear":
            return linear
        rise = after - before
        bend = (1 - s) * (h * self.start_slopes[j] - rise) - s * (h * self.end_slopes[j] - rise)
        return np.asarray(linear + s * (1 - s) * bend)
