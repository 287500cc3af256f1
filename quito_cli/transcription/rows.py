"""Constraint rows by block, with the names that people know them by."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


@dataclass(frozen=True)
class Rows:
    """A block of rows: `labels` vary fastest, then places."""

    name: str
    labels: tuple[str, ...]
    first: int
    fractions: Array
    """Where in the horizon each place is, (places,)."""
    lower: Array
    """(places, labels)."""
    upper: Array
    """(places, labels)."""
    scale: Array
    """What each label's row is multiplied by, (labels,)."""

    @property
    def count(self) -> int:
        """Number of rows."""
        return self.lower.size

    @property
    def rows(self) -> slice:
        """Its place among all rows."""
        return slice(self.first, self.first + self.count)

    @property
    def indices(self) -> Indices:
        """Index of each row, (places, labels)."""
        return (self.first + np.arange(self.count)).reshape(self.lower.shape)


class RowBook:
    """Hands out rows, block by block."""

    def __init__(self) -> None:
        self.blocks: list[Rows] = []

    @property
    def count(self) -> int:
        """Rows handed out."""
        return sum(block.count for block in self.blocks)

    def add(
        self,
        name: str,
        labels: tuple[str, ...],
        fractions: Array,
        bounds: tuple[Array, Array],
        scale: Array | None = None,
        released: NDArray[np.bool_] | None = None,
    ) -> Rows:
        """Return a new block with the same bounds (labels,) at every place.

        `released` places are no constraint: what they would say holds or fails already.
        """
        lower, upper = (np.tile(side, (len(fractions), 1)) for side in bounds)
        if released is not None:
            lower[released], upper[released] = -np.inf, np.inf
        ones = np.ones(len(labels))
        block = Rows(
            name, labels, self.count, fractions, lower, upper, ones if scale is None else scale
        )
        self.blocks.append(block)
        return block

    def gathered(self) -> tuple[Array, Array, Array]:
        """Return lower and upper bounds (scaled) and the scale of all rows."""
        scale = np.concatenate([np.tile(b.scale, len(b.fractions)) for b in self.blocks])
        lower = np.concatenate([b.lower.ravel() for b in self.blocks])
        upper = np.concatenate([b.upper.ravel() for b in self.blocks])
        return lower * scale, upper * scale, scale
