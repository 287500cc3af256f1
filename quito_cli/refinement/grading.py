"""Wanted lengths -> mesh: not too short, growing no faster than neighbours may, through points.

The length wanted at t is the least of all that cells want at their places and may grow to on the
way to t: h(t) = min_k (h_k + a · |t − cell k|). Cells of that length are ∫ dt / h(t) in number;
where that is more than allowed, all are longer by the same factor.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from quito_cli.transcription.mesh import Mesh

Array = NDArray[np.float64]

GROWTH = 0.25
"""a: lengths of neighbouring cells differ by about this part of them at most."""
_PARTS = 8
"""Places in a cell at which a length is asked for."""
_BISECTIONS = 40


def graded(mesh: Mesh, wanted: Array, shortest: float, most: int, points: Array) -> Mesh:
    """Return a mesh with the wanted lengths.

    Args:
        mesh: the cells that `wanted` is of.
        wanted: (N,) lengths, as fractions of the horizon.
        shortest: least length, as a fraction of the horizon.
        most: largest number of cells.
        points: (k,) fractions at which there are to be nodes.
    """
    first, last = mesh.fractions[:-1], mesh.fractions[1:]
    places = first[:, None] + mesh.steps[:, None] * (np.arange(_PARTS) + 0.5) / _PARTS
    t, dt = places.ravel(), np.repeat(mesh.steps / _PARTS, _PARTS)
    way = np.maximum(np.maximum(first - t[:, None], t[:, None] - last), 0.0)

    def cells(factor: float) -> Array:
        lengths = np.maximum(factor * wanted, shortest) + GROWTH * way
        return np.asarray(dt / lengths.min(axis=1))

    counted = cells(1.0)
    if counted.sum() > most:
        low, high = 1.0, 1.0 / shortest
        for _ in range(_BISECTIONS):
            factor = float(np.sqrt(low * high))
            low, high = (factor, high) if cells(factor).sum() > most else (low, factor)
        counted = cells(high)
    edges = np.append(
        (first[:, None] + mesh.steps[:, None] * np.arange(_PARTS) / _PARTS).ravel(), 1
    )
    reached = np.append(0.0, np.cumsum(counted))
    number = max(min(round(reached[-1]), most), len(points) + 1, 2)
    nodes = np.interp(np.linspace(0.0, reached[-1], number + 1), reached, edges)
    nodes[0], nodes[-1] = 0.0, 1.0
    return Mesh(_through(nodes, points))


def _through(nodes: Array, points: Array) -> Array:
    """Return the nodes with the nearest inner one moved to each of the points, each to one."""
    moved = nodes.copy()
    free = np.ones(len(nodes), dtype=bool)
    free[[0, -1]] = False
    for point in points[(points > 0) & (points < 1)]:
        nearest = int(np.argmin(np.where(free, np.abs(nodes - point), np.inf)))
        moved[nearest], free[nearest] = point, False
    return np.sort(moved)
