"""Where the boundary value problem of a structure is started from.

Whatever knows a trajectory near by can start it: a direct answer (`direct`), or a solved problem
of another structure (`again`). Both are asked the same.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.polish.equations.system import System
from quito_cli.optimality.polish.equations.unknowns import Segments, Unknowns

Array = NDArray[np.float64]


class Near(Protocol):
    """What knows a trajectory near by."""

    def shared(self, system: System) -> Array:
        """Return g of a structure."""

    def along(self, system: System, k: int, t: Array) -> tuple[Array, Array]:
        """Return (x, λ) and z in phase k of a structure, (len(t), …)."""

    def segments(self, system: System, k: int) -> int:
        """Return how many segments phase k is to have."""


def started(near: Near, system: System) -> Unknowns:
    """Return the unknowns to start from."""
    phases = tuple(_phase(near, system, k) for k in range(len(system.structure.phases)))
    return Unknowns(phases, near.shared(system))


def _phase(near: Near, system: System, k: int) -> Segments:
    start, end = system.structure.span(k, k)
    count, points = near.segments(system, k), system.method.points
    fractions = np.linspace(0.0, 1.0, count + 1)
    inner = (fractions[:-1, None] + np.diff(fractions)[:, None] * points).ravel()
    y, z = near.along(system, k, start + np.concatenate([fractions, inner]) * (end - start))
    nodes = np.hstack([y[: count + 1], np.zeros((count + 1, system.layout.beside))])
    stages, inner_z = (v[count + 1 :].reshape(count, len(points), v.shape[1]) for v in (y, z))
    return Segments(fractions, nodes, stages, inner_z, z[0], z[count])
