"""A solved boundary value problem as the start of one with another structure."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.polish.equations.junctions import Jump
from quito_cli.optimality.polish.equations.law import Law
from quito_cli.optimality.polish.equations.system import System
from quito_cli.optimality.polish.equations.unknowns import Part
from quito_cli.optimality.polish.faults.dense import Dense
from quito_cli.optimality.polish.reading.direct import Direct
from quito_cli.optimality.polish.solving.flow import inputs

Array = NDArray[np.float64]

KEPT: tuple[Part, ...] = ("state", "costate", "parameters", "integral", "boundary")
"""Parts of g that are the same in every structure."""
NEAR = 0.1
"""Part of the horizon within which a jump of another structure is the same jump."""


@dataclass(frozen=True, eq=False)
class Again:
    """A solved boundary value problem; what another structure has besides is zero."""

    direct: Direct
    dense: Dense

    def shared(self, system: System) -> Array:
        """Return g of a structure."""
        g, layout, structure = np.zeros(system.layout.count), system.layout, system.structure
        for part in KEPT:
            g[layout.place(part)] = self.dense.shared(part)
        g[layout.place("times")] = structure.times
        reach = NEAR * (structure.times[-1] - structure.times[0])
        for leap in system.leaps:
            for jump, place in leap.parts(layout) if leap else ():
                time = structure.times[leap.junction] if leap else 0.0
                near = (
                    values
                    for at, own, values in self._jumps()
                    if (own.held, own.point, own.count) == (jump.held, jump.point, jump.count)
                    and abs(at - time) < reach
                )
                g[place] = next(near, np.zeros(jump.count))
        return g

    def _jumps(self) -> Iterator[tuple[float, Jump, Array]]:
        """Give when, what and how much jumps in what was solved."""
        for leap in self.dense.system.leaps:
            if leap:
                for jump, place in leap.parts(self.dense.system.layout):
                    time = float(self.dense.times[leap.junction])
                    yield time, jump, self.dense.at.shared[place]

    def segments(self, system: System, k: int) -> int:
        """Return as many segments as a direct answer asks for, and no fewer than there were."""
        start, end = system.structure.span(k, k)
        there = 0
        for j, segments in enumerate(self.dense.at.phases):
            middles = segments.times(np.array([0.5]), *self.dense.times[j : j + 2])
            there += int(((middles > start) & (middles < end)).sum())
        return max(self.direct.segments(system, k), there)

    def along(self, system: System, k: int, t: Array) -> tuple[Array, Array]:
        """Return (x, λ) and z in phase k of a structure, (len(t), …)."""
        given, times = self.dense.system, self.dense.times
        y = np.zeros((len(t), 2 * given.layout.states))
        u = np.zeros((len(t), given.setting.system.model.n_u))
        eta = np.zeros((len(t), len(given.setting.system.rows)))
        inside = np.clip(np.searchsorted(times, t, side="right") - 1, 0, len(times) - 2)
        for j, old in enumerate(given.laws):
            own = np.flatnonzero(inside == j)
            if len(own):
                y[own], z = self._inside(j, old, t[own])
                u[own] = old.controls(z)
                eta[own[:, None], [row for row, _ in old.held]] = z[:, len(old.between) :]
        law = system.laws[k]
        return y, np.hstack([u[:, list(law.between)], eta[:, [row for row, _ in law.held]]])

    def _inside(self, j: int, law: Law, t: Array) -> tuple[Array, Array]:
        """Return (x, λ) and z at times of a phase that was solved."""
        dense, segments = self.dense, self.dense.at.phases[j]
        start, end = dense.times[j : j + 2]
        place = np.clip((t - start) / (end - start), 0.0, 1.0)
        at = np.searchsorted(segments.fractions, place, side="right") - 1
        at = np.minimum(at, segments.count - 1)
        offsets = (place - segments.fractions[at]) / np.diff(segments.fractions)[at]
        weights = dense.system.method.known.weights(offsets)
        y = np.einsum("pm,pmy->py", weights, segments.known[at])
        nearest = np.abs(offsets[:, None] - dense.system.method.points).argmin(axis=1)
        v = inputs(t, y, dense.at.shared, dense.system.layout)
        return y, law.settled(v, segments.inner[at, nearest]).z
