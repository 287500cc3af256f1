"""Least squares of a chain: unknowns that are linked each to the next, and to some that all share.

    minimise Σ_a |A_a y_a + G_a g − r_a|² + Σ_a |B_a y_a + C_a y_{a+1} + H_a g − s_a|²

over y_0 … y_K and g. Node by node the rows that speak of y_a are triangularised by Householder's
reflections; what is left speaks of y_{a+1} and g and is carried on. Rotations do not mind modes
that grow and others that decay, as elimination without them would (S. J. Wright, SIAM J. Numer.
Anal. 30, 1993); there may be more rows than unknowns, and the last, small system is solved by its
singular values, which tell what the rows leave open.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

RANK = 1e-13
"""Singular values below this, over the largest, are none."""


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of one node, or of one link to the next node."""

    here: Array
    """(rows, n): in y_a."""
    there: Array | None
    """(rows, n): in y_{a+1}; None of a node's own rows."""
    shared: Array
    """(rows, m): in g."""
    right: Array
    """(rows,)."""
    norms: Array | None = None
    """(rows,) that they were divided by; None where they were not."""


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


def solved(nodes: list[list[Rows]], size: int, shared: int, damping: float = 0.0) -> Found:
    """Solve a chain.

    Args:
        nodes: for each node its rows; the one with `there` links it to the next.
        size: n.
        shared: m.
        damping: weight of rows that keep all unknowns small.
    """
    carried = np.zeros((0, size + shared + 1))
    if damping:
        carried = _damped(damping, size, shared)
    tops: list[Array] = []
    for own in nodes[:-1]:
        stacked = _stacked(carried, own, size, shared)
        triangle = np.asarray(np.linalg.qr(stacked, mode="r"))
        tops.append(triangle[:size])
        carried = triangle[size:, size:]
        if damping:
            more = np.zeros((size, carried.shape[1]))
            more[:, :size] = damping * np.eye(size)
            carried = np.vstack([carried, more])
    last = _stacked(carried, nodes[-1], size, shared)
    matrix = np.hstack([last[:, :size], last[:, 2 * size : -1]])
    lengths = np.linalg.norm(matrix, axis=0)
    lengths[lengths == 0] = 1.0
    left, values, right = np.linalg.svd(matrix / lengths, full_matrices=False)
    kept = values > RANK * values[0]
    inverse = np.where(kept, 1 / np.where(kept, values, 1.0), 0.0)
    end = right.T @ (inverse * (left.T @ last[:, -1])) / lengths
    found, g = [end[:size]], end[size:]
    for top in reversed(tops):
        known = top[:, -1] - top[:, size : 2 * size] @ found[-1] - top[:, 2 * size : -1] @ g
        found.append(np.linalg.lstsq(top[:, :size], known, rcond=None)[0])
    return Found(np.array(found[::-1]), g, values, right[-1, size:] / lengths[size:])


def _stacked(carried: Array, own: list[Rows], size: int, shared: int) -> Array:
    """Return rows over columns y_a, y_{a+1}, g and the right-hand side."""
    gap = np.zeros((len(carried), size))
    parts = [np.hstack([carried[:, :size], gap, carried[:, size:]])]
    for rows in own:
        there = np.zeros_like(rows.here) if rows.there is None else rows.there
        parts.append(np.hstack([rows.here, there, rows.shared, rows.right[:, None]]))
    stacked = np.vstack(parts)
    least = 2 * size + shared + 1
    if len(stacked) < least:  # so that there is a row for every column
        stacked = np.vstack([stacked, np.zeros((least - len(stacked), least))])
    return stacked


def _damped(damping: float, size: int, shared: int) -> Array:
    rows = np.zeros((size + shared, size + shared + 1))
    rows[:, :-1] = damping * np.eye(size + shared)
    return rows
