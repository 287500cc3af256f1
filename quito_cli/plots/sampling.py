"""Times at which an answer is drawn: so many that a line shows it, and jumps stand upright."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from quito_cli.solution.solution import Solution

Array = NDArray[np.float64]

_BEFORE = 64
"""Units in the last place before a node at which the limit from the left is taken."""


def drawn_times(solution: Solution) -> Array:
    """Return the dense grid, with both sides of every node of a polished answer.

    The controls and costates of that jump at nodes, where one arc ends and another begins. Other
    controls take a part of a cell for a jump, and the grid shows it.
    """
    dense = solution.dense_times
    if not solution.polished:
        return dense
    nodes, ulp = solution.times[1:-1], np.spacing(np.abs(solution.times).max())
    return np.unique(np.concatenate([dense, nodes, nodes - _BEFORE * ulp]))
