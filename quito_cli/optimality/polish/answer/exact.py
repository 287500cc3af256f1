"""An exact extremal: states, costates and controls as polynomials in each segment of its arcs.

Segments end at junctions, so that everything is smooth inside one. Costates and multipliers are
those of the package, λ = ∂V/∂x and μ ≥ 0 at upper bounds, λ' = −(H + μᵀc)_x: of a state constraint
too (direct adjoining). Where one begins or ends to be active, at a touch, and at a point constraint
the costate may jump: λ⁺ = λ⁻ − atom · ∇c.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from quito_cli.solution.optimal import Arc
from quito_cli.transcription.legendre import Nodes

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Sampled:
    """Values at the same offsets in each of K segments; m offsets."""

    t: Array
    """(K, m)."""
    states: Array
    """(K, m, n_x)."""
    costates: Array
    """(K, m, n_x); at offset 0 after a jump at the segment's start, at 1 before one at its end."""
    controls: Array
    """(K, m, n_u); at the ends likewise."""
    mu: Array
    """(K, m, rows): densities of the multipliers of `Pontryagin.rows`, without atoms."""


@dataclass(frozen=True, eq=False)
class Atom:
    """An impulse of the multiplier of a row."""

    node: int
    """It is at the start of segment `node`; K is the end of the last."""
    row: int
    """Of `Pontryagin.rows`."""
    size: float


@dataclass(frozen=True, eq=False)
class Exact:
    """An extremal by its values at points of K segments."""

    nodes: Array
    """(K+1,) times at which segments meet, increasing: the initial time, …, the final time."""
    offsets: Nodes
    """Points of [0, 1] at which every segment is known, both ends among them."""
    values: Sampled
    """At `offsets`: polynomials through them are right to rounding."""
    parameters: Array
    """(n_p,)."""
    boundary: Array
    """(rows,) ω of the boundary constraints, stacked."""
    integral: Array
    """(integrals,) ν."""
    points: tuple[Array, ...]
    """Multipliers of each point constraint."""
    atoms: tuple[Atom, ...]
    """Of rows."""
    arcs: tuple[Arc, ...]
    """By control, then by row, with uncertainties that are those of the boundary value problem."""
    cost: float
    """Of the minimisation."""

    def at(self, offsets: Array) -> Sampled:
        """Return all at other offsets of [0, 1] in each segment."""
        weights, v = self.offsets.weights(np.asarray(offsets, dtype=float)), self.values
        steps = np.diff(self.nodes)[:, None]
        t = self.nodes[:-1, None] + steps * offsets
        parts = (v.states, v.costates, v.controls, v.mu)
        return Sampled(t, *(np.einsum("mj,kjx->kmx", weights, part) for part in parts))
