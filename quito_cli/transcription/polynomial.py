"""The control of a collocation: in each cell a polynomial through its values at the LGR points.

Of degree D − 1, since the control has no value at the end of a cell; from one cell to the next it
may jump. The coefficients are the values at the points, D a cell, so that bounding them bounds the
control there, and nowhere else.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from quito_cli.transcription.control import evaluated
from quito_cli.transcription.legendre import radau

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

_CHUNK = 500_000
"""Weights formed at a time: bounds the memory of dense evaluations."""


@dataclass(frozen=True)
class PolynomialBasis:
    """Lagrange polynomials through D points in each of N cells."""

    cells: int
    degree: int
    """D."""

    @property
    def count(self) -> int:
        """Coefficients a control has."""
        return self.cells * self.degree

    @property
    def pieces(self) -> int:
        """Values that a control takes one after another."""
        return self.count

    @property
    def centres(self) -> Array:
        """The s of each coefficient, (count,): its point."""
        return np.asarray((np.arange(self.cells)[:, None] + radau(self.degree).points).ravel())

    @property
    def attributes(self) -> Mapping[str, str | float | bool]:
        """What tells these functions from others, by name."""
        return {"degree": self.degree}

    def bounded(self, determined: NDArray[np.bool_], fixed: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return which controls bounds on coefficients hold within bounds where it is looked."""
        return np.ones(len(determined | fixed), dtype=bool)

    def weights(self, cells: Indices, offsets: Array) -> tuple[Indices, Array]:
        """Return the coefficients that a point depends on, and how much.

        Args:
            cells: (points,) the cell of each point, 0 … N−1.
            offsets: (points,) its place in the cell, 0 … 1.

        Returns:
            Indices into the coefficients and weights, both (points, D).
        """
        indices = cells[:, None] * self.degree + np.arange(self.degree)
        return indices, radau(self.degree).control.weights(offsets)

    def evaluate(self, coefficients: Array, cells: Indices, offsets: Array) -> Array:
        """Return û at points, (points, n_u), from coefficients (count, n_u)."""
        return evaluated(self, coefficients, cells, offsets, max(_CHUNK // self.degree, 1))
