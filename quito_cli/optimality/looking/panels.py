"""The stretches of time that an answer is looked at in, and what it says at their ends.

A panel is what lies between two times at which both state and costate are known: a control cell, or
two neighbouring points of a collocation.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from quito_cli.solution.solution import Solution

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Panels:
    """Where an answer is looked at, and û there."""

    cells: Indices
    """(P,) the cell that a panel is in."""
    begins: Array
    """(P,) its offset there."""
    ends: Array
    """(P,)."""
    times: Array
    """(P+1,)."""
    states: Array
    """(P+1, n_x)."""
    costates: Array
    """(P+1, n_x)."""
    collocated: bool
    """Panels are between points of a collocation."""

    @property
    def lengths(self) -> Array:
        """(P,)."""
        return np.diff(self.times)

    def controls(self, solution: Solution, offsets: Array) -> Array:
        """Return û at offsets in each panel, (P, len(offsets), n_u)."""
        spans = (self.ends - self.begins)[:, None]
        places = np.minimum(self.begins[:, None] + spans * offsets, 1.0)
        cells = np.repeat(self.cells, len(offsets))
        u = solution.basis.evaluate(solution.coefficients, cells, places.ravel())
        return u.reshape(len(self.cells), len(offsets), -1)


def panels(solution: Solution) -> Panels:
    """Return the panels of an answer."""
    mesh, adjoint = solution.mesh, solution.adjoint
    if adjoint is None:
        cells = np.arange(mesh.cells)
        ones = np.ones(len(cells))
        t, x = solution.times, solution.state(solution.times)
        return Panels(cells, 0 * ones, ones, t, x, solution.costates, False)
    t = adjoint.times
    each = (len(t) - 1) // mesh.cells
    cells = np.repeat(np.arange(mesh.cells), each)
    starts, steps = solution.times[cells], np.diff(solution.times)[cells]
    begins, ends = (t[:-1] - starts) / steps, (t[1:] - starts) / steps
    return Panels(cells, begins, np.minimum(ends, 1.0), t, solution.state(t), adjoint.states, True)


def substeps(solution: Solution) -> int:
    """Return the steps of the scheme in a cell; one of a collocation of degree one."""
    return int(solution.options.get("substeps", 1))
