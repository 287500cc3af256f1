"""Wanted lengths -> mesh: not too short, growing no faster than neighbours may, through points.

The length wanted at t is the least of all that cells want at their places and may grow to on the
way to t: h(t) = min_k (h_k + a · |t − cell k|), found by one pass from either end. Cells of that
length are ∫ dt / h(t) in number; where that is more than allowed, all are longer by the same
factor.
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
_LEVEL = 1e-9
"""A slope of the length below which it counts as level."""


def graded(mesh: Mesh, wanted: Array, shortest: float, most: int, points: Array) -> Mesh:
    """Return a mesh with the wanted lengths.

    Args:
        mesh: the cells that `wanted` is of.
        wanted: (N,) lengths, as fractions of the horizon.
        shortest: least length, as a fraction of the horizon.
        most: largest number of cells.
        points: (k,) fractions at which there are to be nodes.
    """
    parts = mesh.fractions[:-1, None] + mesh.steps[:, None] * np.arange(_PARTS) / _PARTS
    edges = np.append(parts.ravel(), 1.0)
    wanted = np.repeat(np.minimum(wanted, _between(mesh, points)), _PARTS)
    here = np.minimum(np.append(wanted, wanted[-1]), np.append(wanted[0], wanted))
    rise = GROWTH * edges

    def lengths(factor: float) -> Array:
        wide = np.maximum(factor * here, shortest)
        after = np.minimum.accumulate(wide - rise) + rise
        before = np.minimum.accumulate((wide + rise)[::-1])[::-1] - rise
        return np.asarray(np.minimum(after, before))

    found = lengths(1.0)
    if _counted(edges, found).sum() > most:
        low, high = 1.0, 1.0 / shortest
        for _ in range(_BISECTIONS):
            factor = float(np.sqrt(low * high))
            fits = _counted(edges, lengths(factor)).sum() <= most
            low, high = (low, factor) if fits else (factor, high)
        found = lengths(high)
    reached = np.append(0.0, np.cumsum(_counted(edges, found)))
    number = max(min(round(reached[-1]), most), len(points) + 1, 2)
    nodes = _placed(np.linspace(0.0, reached[-1], number + 1), reached, edges, found)
    return Mesh(_through(nodes, points))


def _between(mesh: Mesh, points: Array) -> Array:
    """Return the lengths that points close to each other want at the cells they are in, (N,)."""
    found = np.full(mesh.cells, np.inf)
    inner = np.unique(np.concatenate([[0.0], points, [1.0]]))
    near = np.minimum(np.append(np.inf, np.diff(inner)), np.append(np.diff(inner), np.inf))
    cells, _ = mesh.locate(inner)
    np.minimum.at(found, cells, near)
    return found


def _slopes(edges: Array, lengths: Array) -> Array:
    """Return dh/dt between the edges, none of them quite zero."""
    slopes = np.diff(lengths) / np.diff(edges)
    return np.where(np.abs(slopes) > _LEVEL, slopes, _LEVEL)


def _counted(edges: Array, lengths: Array) -> Array:
    """Return ∫ dt / h between the edges, h linear in between."""
    slopes = _slopes(edges, lengths)
    return np.asarray(np.log1p(slopes * np.diff(edges) / lengths[:-1]) / slopes)


def _placed(counts: Array, reached: Array, edges: Array, lengths: Array) -> Array:
    """Return the times at which so many cells have been counted."""
    part = np.clip(np.searchsorted(reached, counts, side="right") - 1, 0, len(edges) - 2)
    slopes = _slopes(edges, lengths)[part]
    nodes = edges[part] + lengths[part] * np.expm1(slopes * (counts - reached[part])) / slopes
    nodes[0], nodes[-1] = 0.0, 1.0
    return np.asarray(nodes)


def _through(nodes: Array, points: Array) -> Array:
    """Return the nodes with the nearest inner one moved to each of the points, each to one."""
    moved = nodes.copy()
    free = np.ones(len(nodes), dtype=bool)
    free[[0, -1]] = False
    for point in points[(points > 0) & (points < 1)]:
        nearest = int(np.argmin(np.where(free, np.abs(nodes - point), np.inf)))
        moved[nearest], free[nearest] = point, False
    return np.sort(moved)
