"""The mesh: any increasing sequence of nodes, kept as fractions of the horizon.

Fractions 0 = τ_0 < … < τ_N = 1 say the same for fixed and free times: t_k = t_0 + (t_f − t_0) τ_k.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from quito_cli.errors import UsageError

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


@dataclass(frozen=True)
class Mesh:
    """N control cells between N+1 nodes."""

    fractions: Array
    """(N+1,) increasing, from 0 to 1."""

    @classmethod
    def uniform(cls, cells: int) -> Mesh:
        """Return N cells of equal length."""
        return cls(np.linspace(0.0, 1.0, cells + 1))

    @classmethod
    def through(cls, cells: int, points: Array) -> Mesh:
        """Return N cells, as equal as can be, with a node at each of `points` (fractions).

        Raises:
            UsageError: there are more pieces than cells.
        """
        ends = np.array(sorted({0.0, 1.0, *points.tolist()}))
        pieces = len(ends) - 1
        if pieces > cells:
            raise UsageError(
                f"{cells} cells cannot have nodes at {pieces - 1} inner points: take more --steps"
            )
        shares = np.maximum(np.round(np.diff(ends) * cells), 1).astype(int)
        while shares.sum() != cells:  # rounding: take from, or give to, where cells are smallest
            step = 1 if shares.sum() < cells else -1
            lengths = np.diff(ends) / shares
            candidates = np.where((shares > 1) | (step > 0), lengths * step, -np.inf)
            shares[int(np.argmax(candidates))] += step
        parts = [
            np.linspace(a, b, n, endpoint=False)
            for a, b, n in zip(ends[:-1], ends[1:], shares, strict=True)
        ]
        return cls(np.append(np.concatenate(parts), 1.0))

    @property
    def cells(self) -> int:
        """N."""
        return len(self.fractions) - 1

    @property
    def steps(self) -> Array:
        """(N,) lengths of the cells as fractions of the horizon."""
        return np.diff(self.fractions)

    @property
    def index_slopes(self) -> Array | None:
        """(N, 2) slopes ds/dt at both ends of each cell times its length; None for equal steps.

        s(t) is the monotone cubic interpolant of Fritsch and Butland (*SIAM J. Sci. Stat. Comput.*
        5, 1984): the slope at a node is a harmonic mean of those of its cells, with the weights of
        Brodlie; at the ends it is that of the end cell.
        """
        h = self.steps
        if np.allclose(h, 1 / self.cells, rtol=1e-6, atol=0):
            return None
        left, right = h[:-1], h[1:]
        inner = 3 * (left + right) / ((2 * right + left) * left + (right + 2 * left) * right)
        slopes = np.concatenate([[1 / h[0]], inner, [1 / h[-1]]])
        return np.column_stack([slopes[:-1] * h, slopes[1:] * h])

    def locate(self, fractions: Array) -> tuple[Indices, Array]:
        """Return cell and offset of points, (points,) each; nodes belong to the cell they open."""
        cells = np.searchsorted(self.fractions, fractions, side="right") - 1
        cells = np.clip(cells, 0, self.cells - 1)
        offsets = (fractions - self.fractions[cells]) / self.steps[cells]
        return cells, np.clip(offsets, 0.0, 1.0)

    def points(self, offsets: Array) -> tuple[Indices, Array]:
        """Return cell and offset of the same offsets in every cell, cell by cell."""
        cells = np.repeat(np.arange(self.cells), len(offsets))
        return cells, np.tile(offsets, self.cells)

    def at(self, cells: Indices, offsets: Array) -> Array:
        """Return the fractions of points, (points,) each, from their cells and offsets."""
        return np.asarray(self.fractions[cells] + offsets * self.steps[cells])
