"""The control as a quasi-interpolant in index space (DESIGN of quito: section 3.1).

A mesh is any increasing t_0 < … < t_N; s(t) is a map with s(t_k) = k, and

    û(t) = Σ_m c_m w_m(s(t)),   w_m(s) = ψ((s−m)/√D) / Σ_j ψ((s−j)/√D),   m = −p … N+p.

Because s is an index, the weights know nothing of the step sizes: they are the same on every mesh,
and the partition of unity holds on graded ones too. The ghost nodes p beyond each end keep the sum
full at the edges. On equal steps s(t) is linear; on a graded mesh it is the monotone cubic of
`Mesh.index_slopes`, for a piecewise linear s would put a corner into û wherever the step changes. A
point is named by its cell and its offset in [0, 1] within it, so that both
limits at a node can be asked for: (k, 1) is the limit from the left, (k+1, 0) the one from the
right; they differ for cellwise functions only. `normalised=False` gives the paper's sum as printed,
D^(−1/2) Σ_m c_m ψ((s−m)/√D).

Only numpy is needed here: the transcription and a loaded result use the very same weights.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from quito_cli.transcription.generating import GHOST_REACH, GeneratingFunction, reach
from quito_cli.transcription.mesh import Mesh

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

_CHUNK = 50_000
"""Points evaluated at a time: bounds the memory of dense evaluations."""


class Basis(Protocol):
    """Functions w_m on N cells: what turns coefficients into û."""

    @property
    def cells(self) -> int:
        """N."""

    @property
    def count(self) -> int:
        """Coefficients a control has."""

    @property
    def pieces(self) -> int:
        """Values that a control takes one after another: cells, or points of a collocation."""

    @property
    def centres(self) -> Array:
        """The s of each coefficient, (count,)."""

    @property
    def attributes(self) -> Mapping[str, str | float | bool]:
        """What tells these functions from others, by name."""

    def bounded(self, determined: NDArray[np.bool_], fixed: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return which controls are bounded by bounding their coefficients, (n_u,).

        Args:
            determined: (n_u,) those that an equality determines.
            fixed: (n_u,) those whose bounds are equal.
        """

    def weights(self, cells: Indices, offsets: Array) -> tuple[Indices, Array]:
        """Return the coefficients that points depend on, and how much, (points, width) each."""

    def evaluate(self, coefficients: Array, cells: Indices, offsets: Array) -> Array:
        """Return û at points, (points, n_u), from coefficients (count, n_u)."""


def evaluated(
    basis: Basis, coefficients: Array, cells: Indices, offsets: Array, chunk: int
) -> Array:
    """Return û at points, (points, n_u), `chunk` of them at a time."""
    values = np.empty((len(cells), coefficients.shape[1]))
    for start in range(0, len(cells), chunk):
        part = slice(start, start + chunk)
        indices, weights = basis.weights(cells[part], offsets[part])
        values[part] = np.einsum("pw,pwu->pu", weights, coefficients[indices])
    return values


@dataclass(frozen=True)
class ControlBasis:
    """The functions w_m on N cells: what turns coefficients into û."""

    function: GeneratingFunction
    cells: int
    variance: float
    normalised: bool
    most_ghosts: int | None = None
    """Ghosts at most; None where û is looked at more often than it has coefficients. At −1 the end
    nodes have none either: explicit Euler never looks at the end."""
    index_slopes: Array | None = field(default=None, compare=False, repr=False)
    """(N, 2) slopes of s(t) at both ends of each cell, in cells; None where s is linear in each."""

    def on(self, mesh: Mesh) -> ControlBasis:
        """Return the same functions on the cells of a mesh: smooth ones follow its grading."""
        slopes = mesh.index_slopes if self.function.scaled else None
        return replace(self, cells=mesh.cells, index_slopes=slopes)

    @property
    def ghosts(self) -> int:
        """Nodes p beyond each end."""
        wanted = math.ceil(GHOST_REACH * math.sqrt(self.variance)) if self.function.scaled else 0
        return wanted if self.most_ghosts is None else min(wanted, self.most_ghosts)

    @property
    def count(self) -> int:
        """Coefficients a control has."""
        return self.cells + (0 if self.function.cellwise else 1) + 2 * self.ghosts

    @property
    def pieces(self) -> int:
        """Values that a control takes one after another."""
        return self.cells

    @property
    def attributes(self) -> Mapping[str, str | float | bool]:
        """What tells these functions from others, by name."""
        found: dict[str, str | float | bool] = {
            "generating_function": self.function.name,
            "variance": self.variance,
            "normalised": self.normalised,
        }
        return found if self.most_ghosts is None else found | {"most_ghosts": self.most_ghosts}

    @property
    def convex(self) -> bool:
        """û is a convex combination of the coefficients, so that their bounds are û's."""
        return self.function.positive and self.normalised

    def bounded(self, determined: NDArray[np.bool_], fixed: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return which controls are bounded by bounding their coefficients, (n_u,).

        Those of a convex basis, but for one that an equality determines: it may have to leave its
        bound at once, which coefficients within bounds cannot follow. Of any normalised basis,
        those that are fixed.
        """
        return np.asarray((self.convex & ~determined) | (self.normalised & fixed))

    @property
    def centres(self) -> Array:
        """The s of each coefficient, (count,): its node, or the middle of its cell."""
        middle = 0.5 if self.function.cellwise else 0.0
        return np.arange(self.count, dtype=float) - self.ghosts + middle

    @property
    def _spread(self) -> float:
        return self.variance if self.function.scaled else 1.0

    def weights(self, cells: Indices, offsets: Array) -> tuple[Indices, Array]:
        """Return the coefficients that a point depends on, and how much.

        Args:
            cells: (points,) the cell of each point, 0 … N−1.
            offsets: (points,) its place in the cell, 0 … 1.

        Returns:
            Indices into the coefficients and weights, both (points, width). Entries outside the
            coefficients have weight zero and an index clipped to the valid range.
        """
        root = math.sqrt(self._spread)
        if self.function.cellwise:
            distance, m = np.zeros((len(cells), 1)), cells[:, None]
        else:  # cut by cell: within one, û is as smooth as ψ, and integrators see no jump
            half = math.ceil(reach(self.function.name) * root)
            window = np.arange(1 - half, half + 1)
            places = self._index_offsets(cells, offsets)
            distance, m = places[:, None] - window, cells[:, None] + window
        first = -self.ghosts
        known = (m >= first) & (m < first + self.count)
        weights = np.where(known, self.function.value(distance / root), 0.0)
        weights /= weights.sum(axis=1, keepdims=True) if self.normalised else root
        return np.clip(m - first, 0, self.count - 1), weights

    def _index_offsets(self, cells: Indices, offsets: Array) -> Array:
        """Return s − k at points of cells k: the cubic from 0 to 1 with their slopes."""
        if self.index_slopes is None:
            return offsets
        first, last = self.index_slopes[cells].T
        rest = 1 - offsets
        return np.asarray(
            offsets**2 * (3 - 2 * offsets) + offsets * rest * (first * rest - last * offsets)
        )

    def evaluate(self, coefficients: Array, cells: Indices, offsets: Array) -> Array:
        """Return û at points, (points, n_u), from coefficients (count, n_u)."""
        return evaluated(self, coefficients, cells, offsets, _CHUNK)
