"""Multipliers of constraints as functions of time, where an answer knows them: a polished one.

Of every row lower ≤ c ≤ upper that holds at all times, those of path constraints in the order of
the file, then bounded states: a density μ(t), ≥ 0 at upper bounds, and impulses where a row of a
state begins or ends to be active or touches its bound: λ⁺ = λ⁻ − size · ∇c.
"""

from __future__ import annotations

from dataclasses import dataclass

from quito_cli.solution.trajectory import Polynomials


@dataclass(frozen=True)
class Impulse:
    """An impulse of the multiplier of a row."""

    node: int
    """It is at this node of the mesh."""
    row: int
    size: float
    """Its integral: ≥ 0 at an upper bound."""


@dataclass(frozen=True)
class Densities:
    """Multipliers of all rows."""

    labels: tuple[str, ...]
    """Of the rows: constraints with the row each is, states."""
    curve: Polynomials
    """(…, rows) μ, with both limits at nodes."""
    impulses: tuple[Impulse, ...]
    """By node."""
