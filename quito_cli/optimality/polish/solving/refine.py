"""Whether segments are short enough for their polynomials, and halves of those that are not.

The last Legendre coefficients of states, costates and controls say how far polynomials of a degree
carry (L. N. Trefethen, Approximation Theory and Approximation Practice, 2013, chapters 8 and 17).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.polish.equations.system import System
from quito_cli.optimality.polish.equations.unknowns import Segments, Unknowns
from quito_cli.optimality.polish.faults.dense import Dense, Piece
from quito_cli.optimality.polish.solving.newton import Scales

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

RESOLVED = 1e-12
"""Last coefficients, over the size of what they are of, of a segment that is short enough."""
CARRIED = 1e-8
"""The same, of a segment in which something is smooth at all."""
MOST = 400
"""Segments in all."""
LEAST_SPAN = 1e-3
"""Part of its size that a control moves by at least, for what its coefficients are held against."""


def refined(dense: Dense, scales: Scales) -> Unknowns | None:
    """Return the unknowns with segments halved that are too long; None where none is."""
    at = dense.at
    if at.segments >= MOST:
        return None
    long = [_long(dense.system, piece, scales) for piece in dense.known]
    if not any(own.any() for own in long):
        return None
    phases = tuple(
        _halved(dense, k, own) if own.any() else at.phases[k] for k, own in enumerate(long)
    )
    return Unknowns(phases, at.shared)


def rough(dense: Dense, scales: Scales) -> float | None:
    """Return the time about which polynomials carry least, None where they carry everywhere."""
    tails = [_tails(dense.system, piece, scales) for piece in dense.known]
    k = int(np.argmax([own.max() for own in tails]))
    if tails[k].max() <= CARRIED:
        return None
    return float(dense.known[k].t[int(np.argmax(tails[k]))].mean())


def _long(system: System, piece: Piece, scales: Scales) -> Flags:
    """Return which segments of a phase, (K,), are too long for their polynomials."""
    return np.asarray(~(_tails(system, piece, scales) <= RESOLVED))


def _tails(system: System, piece: Piece, scales: Scales) -> Array:
    """Return the last coefficients over the sizes of what they are of, by segment, (K,)."""
    sizes = np.maximum(scales.nodes[: 2 * system.layout.states], np.abs(piece.y).max(axis=(0, 1)))
    least = LEAST_SPAN * (1 + np.abs(piece.u).max(initial=0.0))
    spans = np.maximum(np.ptp(piece.u, axis=(0, 1)), least)
    values = np.concatenate([piece.y / sizes, piece.u / spans], axis=2)
    tails = np.abs(np.einsum("cj,kjy->kcy", system.method.tails, values))
    return np.asarray(tails.max(axis=(1, 2), initial=0.0))


def _halved(dense: Dense, k: int, long: Flags) -> Segments:
    """Return a phase with some of its segments in two halves each."""
    segments, c, s = dense.at.phases[k], dense.system.method.points, len(dense.system.method.points)
    both = dense.piece(k, np.concatenate([c / 2, (1 + c) / 2, [0.5]]))
    f, (nodes, stages, inner) = (
        segments.fractions,
        (segments.nodes, segments.stages, segments.inner),
    )
    middles = (nodes[:-1] + nodes[1:]) / 2
    middles[:, : both.y.shape[2]] = both.y[:, -1]
    cut = np.flatnonzero(long)
    # Every segment where it is, the halves of those that are cut in their places.
    parts = np.repeat(np.arange(len(long)), 1 + long)
    second = np.flatnonzero(np.diff(parts, prepend=-1) == 0)
    new_stages, new_inner = stages[parts], inner[parts]
    new_stages[second - 1], new_stages[second] = both.y[cut, :s], both.y[cut, s:-1]
    new_inner[second - 1], new_inner[second] = both.z[cut, :s], both.z[cut, s:-1]
    return replace(
        segments,
        fractions=np.insert(f, cut + 1, (f[cut] + f[cut + 1]) / 2),
        nodes=np.insert(nodes, cut + 1, middles[cut], axis=0),
        stages=new_stages,
        inner=new_inner,
    )
