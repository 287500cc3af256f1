"""Equations to first order at the nodes of the boundary value problem.

A function of (v, z) at an end of a phase is one of y there and of what is shared: v has x and λ
from y, the time of the junction, p and ν from g, and z follows v by the law.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.polish.equations.law import Settled
from quito_cli.optimality.polish.equations.system import System
from quito_cli.optimality.polish.equations.unknowns import Layout, Unknowns
from quito_cli.optimality.polish.solving.chain import Rows
from quito_cli.optimality.polish.solving.flow import inputs
from quito_cli.optimality.polish.solving.pointwise import evaluated

if TYPE_CHECKING:
    import casadi as ca

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Linear:
    """What is to vanish, and its derivatives."""

    value: Array
    """(rows,)."""
    by_node: Array
    """(rows, n_y)."""
    by_shared: Array
    """(rows, n_g)."""

    @property
    def rows(self) -> Rows:
        """As equations for a step."""
        return Rows(self.by_node, self.by_shared, -self.value)


def none(rows: int, layout: Layout) -> Linear:
    """Return rows that say nothing yet, to be filled."""
    return Linear(np.zeros(rows), np.zeros((rows, layout.size)), np.zeros((rows, layout.count)))


@dataclass(frozen=True, eq=False)
class PhaseEnd:
    """One end of a phase."""

    layout: Layout
    time: int
    """Entry of g."""
    y: Array
    """(n_y,)."""
    v: Array
    """(1, n_v)."""
    settled: Settled
    given: bool
    """Its time is the problem's: nothing moves with it."""

    @property
    def z(self) -> Array:
        """(n_z,)."""
        return np.asarray(self.settled.z[0])

    def linear(self, function: ca.Function) -> Linear:
        """Return a compiled function of the phase's law here."""
        value, by_v, by_z = (v[0] for v in evaluated(function, self.v, self.settled.z))
        slopes = by_v + by_z @ self.settled.by_v[0]
        two, layout = 2 * self.layout.states, self.layout
        found = none(len(value), layout)
        found.value[:] = value[:, 0]
        found.by_node[:, :two] = slopes[:, :two]
        if not self.given:  # else it may be without a derivative, as sqrt(t) where time begins
            found.by_shared[:, self.time] = slopes[:, two]
        split = two + 1 + layout.parameters
        found.by_shared[:, layout.place("parameters")] = slopes[:, two + 1 : split]
        found.by_shared[:, layout.place("integral")] = slopes[:, split:]
        return found


@dataclass(frozen=True, eq=False)
class Point:
    """A point of the iteration with what its laws say at the ends of phases."""

    system: System
    at: Unknowns
    starts: tuple[PhaseEnd, ...]
    """By phase."""
    lasts: tuple[PhaseEnd, ...]

    def end(self, phase: int, at_start: bool) -> PhaseEnd:
        """Return an end of a phase."""
        return (self.starts if at_start else self.lasts)[phase]

    def node(self, phase: int, at_start: bool) -> int:
        """Return the node that is at an end of a phase, all counted through."""
        firsts = self.at.firsts
        return int(firsts[phase] if at_start else firsts[phase + 1] - 1)

    def energy(self, phase: int, at_start: bool) -> Linear:
        """Return H at an end of a phase."""
        return self.end(phase, at_start).linear(self.system.laws[phase].energy)


def pointed(system: System, at: Unknowns) -> Point:
    """Return a point with its laws settled at the ends of phases."""
    pairs = list(enumerate(zip(system.laws, at.phases, strict=True)))
    return Point(
        system,
        at,
        tuple(_end(system, k, True, s.nodes[0], s.first, at.shared) for k, (_, s) in pairs),
        tuple(_end(system, k, False, s.nodes[-1], s.last, at.shared) for k, (_, s) in pairs),
    )


def _end(system: System, k: int, at_start: bool, y: Array, z: Array, g: Array) -> PhaseEnd:
    law, layout, junction = system.laws[k], system.layout, k if at_start else k + 1
    time = layout.time(junction)
    v = inputs(system.inside(k, g[[time]]), y[None], g, layout)
    ends = {0: system.ends.initial_time, layout.times - 1: system.ends.final_time}
    given = bool(np.isfinite(ends.get(junction, np.nan)))
    return PhaseEnd(layout, time, y, v, law.settled(v, z[None]), given)
