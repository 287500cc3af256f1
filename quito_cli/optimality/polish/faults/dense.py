"""A solved boundary value problem as functions of time.

In a segment the collocation polynomial goes through its start, its Gauss points and its end; the
controls and multipliers are those that the law gives there, evaluated again wherever they are asked
for.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.hamiltonian import sampled as along
from quito_cli.optimality.polish.equations.system import System
from quito_cli.optimality.polish.equations.unknowns import Part, Unknowns
from quito_cli.optimality.polish.solving.flow import inputs

if TYPE_CHECKING:
    import casadi as ca

Array = NDArray[np.float64]


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


@dataclass(frozen=True, eq=False)
class Dense:
    """A solved boundary value problem."""

    system: System
    at: Unknowns

    def shared(self, part: Part) -> Array:
        """Return a part of g."""
        return np.asarray(self.at.shared[self.system.layout.place(part)])

    @property
    def times(self) -> Array:
        """Initial time, junctions, final time, (phases + 1,)."""
        return self.shared("times")

    @property
    def lengths(self) -> Array:
        """(phases,)."""
        return np.diff(self.times)

    @property
    def horizon(self) -> float:
        """Final minus initial time."""
        return float(self.times[-1] - self.times[0])

    @cached_property
    def known(self) -> tuple[Piece, ...]:
        """All phases at the points that the polynomials go through, `Gauss.known`."""
        return self.sampled(self.system.method.known.points)

    def sampled(self, offsets: Array) -> tuple[Piece, ...]:
        """Return all phases at offsets of every segment; at 0 and 1 as inside the segment."""
        return tuple(self.piece(k, offsets) for k in range(len(self.at.phases)))

    def piece(self, k: int, offsets: Array) -> Piece:
        """Return a phase at offsets of every segment."""
        segments, law, method = self.at.phases[k], self.system.laws[k], self.system.method
        t = self.system.inside(k, segments.times(offsets, self.times[k], self.times[k + 1]))
        y = np.einsum("mj,kjy->kmy", method.known.weights(offsets), segments.known)
        nearest = np.abs(offsets[:, None] - method.points).argmin(axis=1)
        estimate = segments.inner[:, nearest]
        v = inputs(t.ravel(), y.reshape(t.size, -1), self.at.shared, self.system.layout)
        z = law.settled(v, estimate.reshape(t.size, estimate.shape[2])).z
        u = law.controls(z)
        return Piece(t, y, z.reshape(estimate.shape), u.reshape(*t.shape, u.shape[1]))

    def along(self, function: ca.Function, k: int, piece: Piece) -> list[Array]:
        """Evaluate a function of Pontryagin's arguments along a phase, η in the place of μ.

        Its outputs are (points, entries) each, entries of a matrix row by row.
        """
        n, law, (t, y, z, u) = self.system.layout.states, self.system.laws[k], piece.flat()
        mu = np.zeros((len(t), len(self.system.setting.system.rows)))
        for j, (row, _) in enumerate(law.held):
            mu[:, row] = z[:, len(law.between) + j]
        p, nu = self.shared("parameters"), self.shared("integral")
        return along(function, (t, y[:, :n], y[:, n:], u, p, mu, nu))
