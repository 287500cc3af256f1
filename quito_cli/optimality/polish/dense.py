"""A solved boundary value problem as functions of time, and whether its segments are short enough.

In a segment the collocation polynomial goes through its start, its Gauss points and its end; the
controls and multipliers are those that the law gives there, evaluated again wherever they are asked
for. The last Legendre coefficients of all of them say how far polynomials of this degree carry.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.polish.flow import inputs
from quito_cli.optimality.polish.newton import Scales
from quito_cli.optimality.polish.system import System
from quito_cli.optimality.polish.unknowns import Segments, Unknowns

Array = NDArray[np.float64]

RESOLVED = 1e-12
"""Last coefficients, over the size of what they are of, of a segment that is short enough."""
MOST = 400
"""Segments in all."""


@dataclass(frozen=True, eq=False)
class Piece:
    """A phase at the same offsets of each of its K segments; m offsets."""

    t: Array
    """(K, m)."""
    y: Array
    """(K, m, 2 n_x): x, λ of indirect adjoining."""
    z: Array
    """(K, m, n_z)."""
    u: Array
    """(K, m, n_u)."""

    def flat(self) -> tuple[Array, Array, Array, Array]:
        """Return t, y, z and u with one leading axis."""
        n = self.t.size
        y, z, u = (v.reshape(n, v.shape[2]) for v in (self.y, self.z, self.u))
        return self.t.ravel(), y, z, u


def lengths(system: System, at: Unknowns) -> Array:
    """Return the lengths of phases."""
    return np.diff(at.shared[system.layout.place("T")])


def sampled(system: System, at: Unknowns, offsets: Array) -> tuple[Piece, ...]:
    """Return all phases at offsets of every segment; at 0 and 1 as inside the segment."""
    return tuple(_piece(system, at, k, offsets) for k in range(len(at.phases)))


def _piece(system: System, at: Unknowns, k: int, offsets: Array) -> Piece:
    segments, layout, law = at.phases[k], system.layout, system.laws[k]
    two, time = 2 * layout.states, layout.place("T").start + k
    start, end = at.shared[time], at.shared[time + 1]
    steps = np.diff(segments.fractions)[:, None]
    t = start + (segments.fractions[:-1, None] + steps * offsets) * (end - start)
    known = np.concatenate(
        [segments.nodes[:-1, None, :two], segments.stages, segments.nodes[1:, None, :two]], axis=1
    )
    y = np.einsum("mj,kjy->kmy", system.method.known.weights(offsets), known)
    inner = system.method.points
    nearest = np.abs(offsets[:, None] - inner).argmin(axis=1)
    z = segments.inner[:, nearest]
    count = t.size
    settled, _ = law.settled(
        inputs(t.ravel(), y.reshape(count, -1), at.shared, layout), z.reshape(count, -1)
    )
    u = law.controls(settled)
    shape = t.shape
    return Piece(
        t,
        y,
        settled.reshape(*shape, -1) if settled.shape[1] else np.zeros((*shape, 0)),
        u.reshape(*shape, -1),
    )


def refined(system: System, at: Unknowns, scales: Scales) -> Unknowns | None:
    """Return the unknowns with segments halved that are too long; None where none is.

    Of a segment of a phase that has no length, nothing is asked.
    """
    pieces = sampled(system, at, system.method.known.points)
    tails, two = system.method.tails, 2 * system.layout.states
    phases, halved = [], False
    for k, (segments, piece) in enumerate(zip(at.phases, pieces, strict=True)):
        size = np.maximum(scales.nodes[:two], np.abs(piece.y).max(axis=(0, 1)))
        rest = np.abs(np.einsum("cj,kjy->kcy", tails, piece.y)) / size
        spans = np.maximum(np.ptp(piece.u, axis=(0, 1)), 1e-3 * (1 + np.abs(piece.u).max()))
        of_u = np.abs(np.einsum("cj,kjy->kcy", tails, piece.u)) / spans
        worst = np.concatenate([rest, of_u], axis=2).max(axis=(1, 2), initial=0.0)
        long = ~(worst <= RESOLVED)
        halve = bool(long.any()) and sum(len(p.stages) for p in at.phases) < MOST
        halved |= halve
        phases.append(_halved(system, at, k, segments, long) if halve else segments)
    return Unknowns(tuple(phases), at.shared) if halved else None


def _halved(
    system: System, at: Unknowns, k: int, segments: Segments, long: NDArray[np.bool_]
) -> Segments:
    """Return a phase with some of its segments in two halves each."""
    c, f = system.method.points, segments.fractions
    (both,) = (_piece(system, at, k, np.concatenate([c / 2, (1 + c) / 2, [0.5]])),)
    s = len(c)
    fractions, nodes, stages, inner = [f[0]], [segments.nodes[0]], [], []
    weights = (1 - 0.5), 0.5
    for j in range(len(segments.stages)):
        if long[j]:
            middle = weights[0] * segments.nodes[j] + weights[1] * segments.nodes[j + 1]
            middle[: both.y.shape[2]] = both.y[j, -1]
            fractions += [(f[j] + f[j + 1]) / 2, f[j + 1]]
            nodes += [middle, segments.nodes[j + 1]]
            stages += [both.y[j, :s], both.y[j, s : 2 * s]]
            inner += [both.z[j, :s], both.z[j, s : 2 * s]]
        else:
            fractions.append(f[j + 1])
            nodes.append(segments.nodes[j + 1])
            stages.append(segments.stages[j])
            inner.append(segments.inner[j])
    return replace(
        segments,
        fractions=np.array(fractions),
        nodes=np.array(nodes),
        stages=np.array(stages),
        inner=np.array(inner),
    )
