"""States, controls and parameters, stacked in the order of the file; their bounds; the two times.

A value of all states is a vector x (n_x), of all controls u (n_u), of all parameters p (n_p).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Variable:
    """A state, control or parameter of the file; a vector has `size` above 1."""

    name: str
    size: int
    first: int
    """Where it starts in the stacked vector."""
    unit: str = ""
    vector: bool = False
    """Declared with a size: entries are written name[0], name[1], …"""

    @property
    def entries(self) -> slice:
        """Its place in the stacked vector."""
        return slice(self.first, self.first + self.size)

    @property
    def labels(self) -> tuple[str, ...]:
        """A name for each entry."""
        return tuple(f"{self.name}[{i}]" for i in range(self.size)) if self.vector else (self.name,)


def labels(variables: tuple[Variable, ...]) -> tuple[str, ...]:
    """Return the names of all entries of the stacked vector."""
    return tuple(label for variable in variables for label in variable.labels)


def units(variables: tuple[Variable, ...]) -> tuple[str, ...]:
    """Return the units of all entries of the stacked vector."""
    return tuple(variable.unit for variable in variables for _ in range(variable.size))


@dataclass(frozen=True)
class Bounds:
    """lower ≤ value ≤ upper, entry by entry; ±inf where there is none."""

    lower: Array
    upper: Array

    def __iter__(self) -> Iterator[Array]:
        return iter((self.lower, self.upper))

    @property
    def present(self) -> NDArray[np.bool_]:
        """Entries that have a bound at all."""
        return np.asarray(np.isfinite(self.lower) | np.isfinite(self.upper))

    @property
    def fixed(self) -> NDArray[np.bool_]:
        """Entries that leave no choice."""
        return np.asarray(self.lower == self.upper)

    @property
    def unbounded(self) -> NDArray[np.bool_]:
        """Entries that may grow without end on a side."""
        return ~(np.isfinite(self.lower) & np.isfinite(self.upper))

    def within(self, other: Bounds) -> Bounds:
        """Return the intersection."""
        return Bounds(np.maximum(self.lower, other.lower), np.minimum(self.upper, other.upper))


@dataclass(frozen=True)
class Instant:
    """The initial or the final time."""

    lower: float
    upper: float
    guess: float

    @property
    def present(self) -> NDArray[np.bool_]:
        """Entries that have a bound at all."""
        return np.asarray(np.isfinite(self.lower) | np.isfinite(self.upper))

    @property
    def fixed(self) -> bool:
        """Whether it is a number rather than an unknown."""
        return self.lower == self.upper
