"""Legendre-Gauss-Radau points, their quadrature, and polynomials by values at given points.

The D points of the standard rule are −1 and the other roots of P_{D−1} + P_D; with the weights

    w_0 = 2/D²,   w_i = (1 − τ_i) / (D P_{D−1}(τ_i))²

the sum Σ w_i f(τ_i) is exact for polynomials of degree 2D − 2 (Abramowitz and Stegun, 25.4.31).
The roots are eigenvalues of the Jacobi matrix of the weight 1 + τ (Golub and Welsch, *Math. Comp.*
23, 1969), polished by a Newton step. Everything here is on [0, 1], the offsets in a cell:
c = (1 + τ)/2.

A polynomial is kept by its values at any points and evaluated by the barycentric formula; with the
weights b_j = 1/Π_{k≠j}(c_j − c_k), its derivative at a point is (Berrut and Trefethen, *SIAM
Review* 46, 2004)

    D_ij = (b_j/b_i) / (c_i − c_j),   D_ii = −Σ_{j≠i} D_ij.

The products are formed as sums of logarithms of 4 |c_j − c_k|, which stay small for hundreds of
points: 1/4 is the capacity of [0, 1].
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Nodes:
    """Points of [0, 1] at which polynomials are known by their values."""

    points: Array
    """(n,) increasing."""

    @cached_property
    def barycentric(self) -> Array:
        """Barycentric weights, (n,), the largest of size one."""
        apart = self.points[:, None] - self.points
        np.fill_diagonal(apart, 0.25)
        logs = -np.log(4 * np.abs(apart)).sum(axis=1)
        signs = (-1.0) ** np.arange(len(self.points) - 1, -1, -1)
        return np.asarray(signs * np.exp(logs - logs.max()))

    @cached_property
    def differentiation(self) -> Array:
        """Derivatives at the points by values there, (n, n)."""
        apart = self.points[:, None] - self.points
        np.fill_diagonal(apart, 1.0)
        matrix = self.barycentric / self.barycentric[:, None] / apart
        np.fill_diagonal(matrix, 0.0)
        np.fill_diagonal(matrix, -matrix.sum(axis=1))
        return np.asarray(matrix)

    def weights(self, offsets: Array) -> Array:
        """Return the weights of the values in the polynomial at `offsets`, (len(offsets), n)."""
        apart = offsets[:, None] - self.points
        hit = apart == 0.0
        shares = np.where(hit, 0.0, self.barycentric / np.where(hit, 1.0, apart))
        on_point = hit.any(axis=1)
        shares[on_point] = hit[on_point]
        shares /= shares.sum(axis=1, keepdims=True)
        return np.asarray(shares)


@dataclass(frozen=True, eq=False)
class Radau:
    """The rule of D points on [0, 1], and the polynomials that go with it."""

    points: Array
    """c_i, (D,): 0 and D − 1 points inside."""
    weights: Array
    """w_i, (D,): their sum is one."""

    @cached_property
    def control(self) -> Nodes:
        """Polynomials of degree D − 1, by the values at the points."""
        return Nodes(self.points)

    @cached_property
    def state(self) -> Nodes:
        """Polynomials of degree D, by the values at the points and at the end."""
        return Nodes(np.append(self.points, 1.0))


@lru_cache(maxsize=16)
def radau(degree: int) -> Radau:
    """Return the Legendre-Gauss-Radau rule of `degree` points."""
    n = np.arange(degree - 1.0)
    diagonal = 1 / ((2 * n + 1) * (2 * n + 3))
    beside = np.sqrt(n[1:] * (n[1:] + 1)) / (2 * n[1:] + 1)
    jacobi = np.diag(diagonal) + np.diag(beside, 1) + np.diag(beside, -1)
    x = np.asarray(np.linalg.eigvalsh(jacobi), dtype=np.float64)
    before, last = _legendre(degree, x)
    slopes = degree * ((before - x * last) + (x * before - last)) / (1 - x**2)
    x = x - (before + last) / slopes
    before, _ = _legendre(degree, x)
    inner = (1 - x) / (degree * before) ** 2
    points = np.append(0.0, (1 + x) / 2)
    return Radau(points, np.append(2 / degree**2, inner) / 2)


def _legendre(degree: int, x: Array) -> tuple[Array, Array]:
    """Return P_{D−1} and P_D at x by Bonnet's recurrence.

    With them (1 − x²) P'_D = D (P_{D−1} − x P_D) and (1 − x²) P'_{D−1} = D (x P_{D−1} − P_D).
    """
    before, last = np.ones_like(x), x
    for n in range(1, degree):
        before, last = last, ((2 * n + 1) * x * last - n * before) / (n + 1)
    return before, last
