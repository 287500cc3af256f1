"""The unknowns of the boundary value problem, and where each is.

y = (x, λ, w)     at the nodes of every phase, w what is integrated beside: the integral
                  constraints and ∫ (H + ηᵀC)_p, from zero;
Y = (x, λ)        at the s Gauss points of every segment;
z                 at those points and at both ends of a phase: see `law`; always settled;
g = (x₀, λ₀, T, p, ν, ω, π, e)
                  shared by all: the ends where the horizon begins, the times of all junctions,
                  parameters, multipliers of integral and boundary constraints, jumps, and what
                  H jumps by at point constraints.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Shared:
    """Where the parts of g are."""

    states: int
    """n_x."""
    times: int
    parameters: int
    integrals: int
    boundary: int
    jumps: int
    """All multipliers of jumps."""
    steps: int
    """Jumps of H at point constraints."""

    @property
    def sizes(self) -> dict[str, int]:
        """In order."""
        return {
            "x0": self.states,
            "l0": self.states,
            "T": self.times,
            "p": self.parameters,
            "nu": self.integrals,
            "omega": self.boundary,
            "pi": self.jumps,
            "e": self.steps,
        }

    @property
    def count(self) -> int:
        """Length of g."""
        return sum(self.sizes.values())

    def place(self, name: str) -> slice:
        """Return where a part is."""
        at = 0
        for part, size in self.sizes.items():
            if part == name:
                return slice(at, at + size)
            at += size
        raise KeyError(name)


@dataclass(frozen=True, eq=False)
class Segments:
    """A phase's part of the unknowns."""

    fractions: Array
    """(K+1,) of the phase, 0 … 1, at which its segments meet."""
    nodes: Array
    """(K+1, n_y): after what happens at the junction before, before what happens at the next."""
    stages: Array
    """(K, s, 2 n_x)."""
    inner: Array
    """(K, s, n_z)."""
    first: Array
    """(n_z,) at the start."""
    last: Array
    """(n_z,) at the end."""


@dataclass(frozen=True, eq=False)
class Unknowns:
    """A point of the iteration."""

    phases: tuple[Segments, ...]
    shared: Array
    """g."""
