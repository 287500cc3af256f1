"""The unknowns of the boundary value problem, and where each is.

y = (x, λ, w)     at the nodes of every phase, w what is integrated beside: the integral
                  constraints and ∫ (H + ηᵀC)_p, from zero;
Y = (x, λ)        at the s Gauss points of every segment;
z                 at those points and at both ends of a phase: see `law`; always settled;
g = (x₀, λ₀, t_0 … t_f, p, ν, ω, π, e)
                  shared by all: the ends where the horizon begins, the times of all junctions,
                  parameters, multipliers of integral and boundary constraints, jumps, and what
                  H is beside the initial time and point constraints.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Part = Literal[
    "state", "costate", "times", "parameters", "integral", "boundary", "jumps", "energies"
]
"""Of g, in order."""


@dataclass(frozen=True)
class Layout:
    """Where the parts of g are."""

    states: int
    """n_x."""
    times: int
    parameters: int
    integrals: int
    boundary: int
    jumps: int
    """All multipliers of jumps."""
    energies: int
    """Values of H: at the initial time, and on both sides of point constraints."""

    @cached_property
    def places(self) -> dict[Part, slice]:
        """Slices of g."""
        sizes: dict[Part, int] = {
            "state": self.states,
            "costate": self.states,
            "times": self.times,
            "parameters": self.parameters,
            "integral": self.integrals,
            "boundary": self.boundary,
            "jumps": self.jumps,
            "energies": self.energies,
        }
        ends = accumulate(sizes.values())
        return {
            part: slice(end - size, end)
            for (part, size), end in zip(sizes.items(), ends, strict=True)
        }

    @property
    def count(self) -> int:
        """Length of g."""
        return int(self.places["energies"].stop)

    @property
    def beside(self) -> int:
        """Length of w."""
        return self.integrals + self.parameters

    @property
    def size(self) -> int:
        """Length of y."""
        return 2 * self.states + self.beside

    def place(self, part: Part) -> slice:
        """Return where a part is."""
        return self.places[part]

    def entries(self, part: Part) -> NDArray[np.int_]:
        """Return the entries of g that are a part."""
        return np.arange(self.places[part].start, self.places[part].stop)

    def time(self, junction: int) -> int:
        """Return the entry of g that is the time of a junction."""
        return int(self.places["times"].start) + junction


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

    @property
    def count(self) -> int:
        """K."""
        return len(self.stages)

    @property
    def known(self) -> Array:
        """(K, s + 2, 2 n_x): (x, λ) at start, Gauss points and end of every segment."""
        two = self.stages.shape[2]
        starts, ends = self.nodes[:-1, None, :two], self.nodes[1:, None, :two]
        return np.concatenate([starts, self.stages, ends], axis=1)

    def times(self, offsets: Array, start: float, end: float) -> Array:
        """Return times, (K, m), of offsets (m,) of every segment of a phase from start to end."""
        steps = np.diff(self.fractions)[:, None]
        return np.asarray(start + (self.fractions[:-1, None] + steps * offsets) * (end - start))


@dataclass(frozen=True, eq=False)
class Unknowns:
    """A point of the iteration."""

    phases: tuple[Segments, ...]
    shared: Array
    """g."""

    @property
    def segments(self) -> int:
        """How many segments all phases have."""
        return sum(phase.count for phase in self.phases)

    @property
    def firsts(self) -> NDArray[np.int_]:
        """(phases + 1,) nodes at which phases begin, all counted through; then their number."""
        return np.cumsum([0, *(len(phase.nodes) for phase in self.phases)])
