"""Least squares of a chain: unknowns that are linked each to the next, and to some that all share.

    minimise Σ_a |A_a y_a + G_a g − r_a|² + Σ_a |y_{a+1} − B_a y_a − H_a g − s_a|²

over y_0 … y_K and g. Node by node the rows that speak of y_a are triangularised by Householder's
reflections; what is left speaks of y_{a+1} and g and is carried on. Rotations do not mind modes
that grow and others that decay, as elimination without them would (S. J. Wright, SIAM J. Numer.
Anal. 30, 1993); there may be more rows than unknowns, and the last, small system is solved by its
singular values, which tell what the rows leave open.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

RANK = 1e-13
"""Singular values below this, over the largest, are none."""


@dataclass(frozen=True, eq=False)
class Rows:
    """A_a y_a + G_a g = r_a: rows of one node."""

    here: Array
    """A_a, (rows, n)."""
    shared: Array
    """G_a, (rows, m)."""
    right: Array
    """r_a, (rows,)."""


@dataclass(frozen=True, eq=False)
class Links:
    """y_{a+1} = B_a y_a + H_a g + s_a: links of K + 1 nodes."""

    matrix: Array
    """B, (K, n, n)."""
    shared: Array
    """H, (K, n, m)."""
    right: Array
    """s, (K, n)."""


@dataclass(frozen=True, eq=False)
class Chain:
    """All rows."""

    own: Sequence[Rows]
    """By node."""
    links: Links


@dataclass(frozen=True, eq=False)
class Found:
    """The least-squares solution."""

    nodes: Array
    """(K+1, n)."""
    shared: Array
    """(m,)."""
    singular_values: Array
    """Of the last system, each column scaled to length one; decreasing."""
    weakest: Array
    """(m,) how the shared unknowns move where the rows say least."""


def solved(chain: Chain) -> Found:
    """Solve a chain by orthogonal elimination."""
    links = chain.links
    count, n, m = links.shared.shape
    # Columns: y_a, y_{a+1}, g, right-hand side.
    linking = np.concatenate(
        [
            -links.matrix,
            np.tile(np.eye(n), (count, 1, 1)),
            -links.shared,
            links.right[..., None],
        ],
        axis=2,
    )
    tops = np.empty((count, n, 2 * n + m + 1))
    carried = np.zeros((0, n + m + 1))
    for a in range(count):
        known = _known(carried, chain.own[a])
        wide = np.zeros((len(known), 2 * n + m + 1))
        wide[:, :n], wide[:, 2 * n :] = known[:, :n], known[:, n:]
        triangle = np.asarray(np.linalg.qr(np.vstack([wide, linking[a]]), mode="r"))
        tops[a], carried = triangle[:n], triangle[n:, n:]
    last, values, weakest = _last(_known(carried, chain.own[-1]))
    nodes, g = np.empty((count + 1, n)), last[n:]
    nodes[-1] = last[:n]
    following = np.linalg.solve(tops[..., :n], tops[..., n:])
    constant = following[..., -1] - following[..., n:-1] @ g
    for a in reversed(range(count)):
        nodes[a] = constant[a] - following[a, :, :n] @ nodes[a + 1]
    return Found(nodes, g, values, weakest[n:])


def _known(carried: Array, own: Rows) -> Array:
    """Return what is known of a node, over columns y_a, g and the right-hand side."""
    return np.vstack([carried, np.hstack([own.here, own.shared, own.right[:, None]])])


def _last(known: Array) -> tuple[Array, Array, Array]:
    """Return the solution of the last system, its singular values, and its weakest direction."""
    rows, columns = len(known), known.shape[1] - 1
    if rows < columns:  # what no row speaks of has a singular value of zero
        known = np.vstack([known, np.zeros((columns - rows, columns + 1))])
    matrix = known[:, :-1]
    lengths = np.linalg.norm(matrix, axis=0)
    lengths[lengths == 0] = 1.0
    left, values, right = np.linalg.svd(matrix / lengths, full_matrices=False)
    kept = values > RANK * values[0]
    inverse = np.where(kept, 1 / np.where(kept, values, 1.0), 0.0)
    found = right.T @ (inverse * (left.T @ known[:, -1])) / lengths
    return found, values, right[-1] / lengths
