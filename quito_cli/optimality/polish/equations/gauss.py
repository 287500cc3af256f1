"""Gauss-Legendre collocation: the points, and the matrices of its implicit Runge-Kutta method.

With the s roots c_i of the shifted Legendre polynomial, the polynomial of degree s that starts at
y₀ and satisfies y' = F at t₀ + c_i h is

    Y_i = y₀ + h Σ_j a_ij F(Y_j),      y₁ = y₀ + h Σ_j b_j F(Y_j),

of order 2s at the end and s + 1 in between, A-stable and symmetric (J. C. Butcher, Math. Comp. 18,
1964; U. M. Ascher, R. M. M. Mattheij and R. D. Russell, Numerical Solution of Boundary Value
Problems, 1988, chapter 5).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from quito_cli.transcription.legendre import Nodes

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Gauss:
    """The method of s stages on [0, 1]."""

    points: Array
    """c_i, (s,)."""
    weights: Array
    """b_i, (s,)."""
    matrix: Array
    """a_ij, (s, s)."""

    @cached_property
    def known(self) -> Nodes:
        """Where a segment is kept: start, points and end."""
        return Nodes(np.concatenate([[0.0], self.points, [1.0]]))

    @cached_property
    def tails(self) -> Array:
        """Values at `known` ↦ their last three Legendre coefficients, (3, s+2)."""
        degree = len(self.points) + 1
        basis = np.polynomial.legendre.legvander(2 * self.known.points - 1, degree)
        return np.asarray(np.linalg.inv(basis)[-3:])


@lru_cache(maxsize=4)
def gauss(stages: int) -> Gauss:
    """Return the method of so many stages."""
    x, w = np.polynomial.legendre.leggauss(stages)
    points, weights = (1 + x) / 2, w / 2
    # a_ij = ∫_0^{c_i} of the j-th Lagrange polynomial, by the rule itself: exact to degree 2s − 1.
    inner = points[:, None] * points
    lagrange = Nodes(points).weights(inner.ravel()).reshape(stages, stages, stages)
    matrix = points[:, None] * np.einsum("q,iqj->ij", weights, lagrange)
    return Gauss(points, weights, matrix)
