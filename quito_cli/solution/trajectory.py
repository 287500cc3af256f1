"""States between the points at which they are known: an interpolation of the method's order.

Of shooting through the ends of the substeps, x_j at t_j: piecewise linear for a scheme of order
one, cubic Hermite for higher ones, with slopes f(x, û, t) taken at both ends of each substep
separately, for the control, and so the slope, may jump at a node. Of a collocation the polynomials
that it is made of, by the barycentric formula; its costates likewise. Where costates are known on
both sides of a node, as those of a polished answer are, they may jump there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from quito_cli.transcription.hermite import hermite
from quito_cli.transcription.legendre import radau

Array = NDArray[np.float64]

_AT_A_TIME = 500_000
"""Weights of polynomials formed at a time: bounds the memory."""


class Curve(Protocol):
    """States, or costates, as functions of time."""

    @property
    def times(self) -> Array:
        """(M+1,) at which they are known."""

    @property
    def states(self) -> Array:
        """(M+1, n_x)."""

    @property
    def interpolation(self) -> Literal["linear", "cubic", "polynomial"]:
        """How they go on in between."""

    def __call__(self, times: Array) -> Array:
        """Return the values at `times`, (len(times), n_x); beyond the ends, those of the ends."""


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


@dataclass(frozen=True)
class Polynomials:
    """In every cell the polynomial of degree D through its LGR points and its end."""

    times: Array
    """(N D + 1,) of the points, the first of a cell its node, and the final time."""
    states: Array
    """(N D + 1, n_x)."""
    degree: int
    """D."""
    before: Array | None = None
    """(N, n_x) just before the end of each cell, where they may jump; None where they do not."""

    @property
    def interpolation(self) -> Literal["polynomial"]:
        """How they go on between the points."""
        return "polynomial"

    @property
    def cells(self) -> int:
        """N."""
        return (len(self.times) - 1) // self.degree

    @property
    def in_cells(self) -> Array:
        """(N, D+1, n_x) at the points of each cell and its end, before a jump there."""
        starts = self.states[:-1].reshape(self.cells, self.degree, self.states.shape[1])
        ends = self.states[self.degree :: self.degree] if self.before is None else self.before
        return np.concatenate([starts, ends[:, None]], axis=1)

    def __call__(self, times: Array) -> Array:
        """Return the values at `times`, (len(times), n_x); beyond the ends, those of the ends.

        They are continuous from the right, and at the final time from the left.
        """
        nodes = self.times[:: self.degree]
        times = np.clip(times, nodes[0], nodes[-1])
        cells = np.clip(np.searchsorted(nodes, times, side="right") - 1, 0, len(nodes) - 2)
        offsets = (times - nodes[cells]) / (nodes[cells + 1] - nodes[cells])
        values, known = np.empty((len(times), self.states.shape[1])), self.in_cells
        size = max(_AT_A_TIME // (self.degree + 1), 1)
        for start in range(0, len(times), size):
            part = slice(start, start + size)
            weights = radau(self.degree).state.weights(offsets[part])
            with np.errstate(invalid="ignore"):  # of a failed solve: not finite, and told so
                values[part] = np.einsum("pw,pwx->px", weights, known[cells[part]])
        return values
