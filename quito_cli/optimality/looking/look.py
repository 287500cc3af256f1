"""An answer looked at through Pontryagin's system: all that its conditions are judged by.

Conditions hold along arcs. Around a junction û is the answer's blur of a jump or kink, so that as
many cells as a jump takes are left out on either side, and so is where û bends too much for its
cells. What is small is so beside the terms that it is made of: H_u beside |L_u| + Σ|λ_j f_j,u|, and
likewise H_x and H.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.hamiltonian import Point, Pontryagin, sampled
from quito_cli.optimality.looking.arcs import arcs
from quito_cli.optimality.looking.breaks import breaks
from quito_cli.optimality.looking.controls import Controls, controls
from quito_cli.optimality.looking.crossings import sharpened
from quito_cli.optimality.looking.dilation import dilated
from quito_cli.optimality.looking.explained import Explained
from quito_cli.optimality.looking.flow import LEAST_STEPS, Carrier, Flow, Impulses, flow
from quito_cli.optimality.looking.impulses import impulses, row_rates
from quito_cli.optimality.looking.marks import AT_BOUND, Looked, at_bounds, marked
from quito_cli.optimality.looking.panels import Panels, panels, substeps
from quito_cli.optimality.looking.pressing import pressed_gradient, pressing_rows
from quito_cli.optimality.symbols.probes import Probe
from quito_cli.problem.model import labels
from quito_cli.solution.junctions import ranges, width
from quito_cli.solution.optimal import Arc
from quito_cli.solution.variation import largest_bounds

if TYPE_CHECKING:
    from quito_cli.solution.solution import Solution

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

STEEP = 0.02
"""Second differences of û over its range, above which the cells do not show what it does."""
NOTHING = 1e-5
"""Part of the cost that is none: solvers are asked for less than a thousandth of that."""
ROUNDING = 1e-12
"""Part of the largest size that counts as one, whatever is zero."""
LOCAL = 1e-3
"""Part of the largest size that is one everywhere."""
SLIGHT = 0.01
"""Part of what a costate could move by over the horizon that counts as its size."""
_GRID = 4
"""Points a panel that labels are given on."""


@dataclass(frozen=True, eq=False)
class Look:
    """An answer, its panels, and Pontryagin's system of its Model."""

    system: Pontryagin
    solution: Solution
    panels: Panels
    impulses: Impulses
    carrier: Carrier
    """The functions that carry an answer."""
    flow: Flow
    probe: Probe
    controls: Controls

    @classmethod
    def at(cls, system: Pontryagin, solution: Solution) -> Look:
        """Look at an answer.

        Raises:
            TooLargeError: the Hamiltonian is too long to be worked on.
        """
        given, probe, carrier = panels(solution), Probe(system), Carrier(system)
        steps = 2 if given.collocated else max(LEAST_STEPS, 2 * substeps(solution))
        struck = impulses(system, solution, given, steps)
        carried = flow(carrier, solution, given, struck, steps)
        found = controls(system, probe)
        return cls(system, solution, given, struck, carrier, carried, probe, found)

    @property
    def names(self) -> tuple[str, ...]:
        """Labels of the controls."""
        return labels(self.system.model.controls)

    @cached_property
    def breaks(self) -> tuple[float, ...]:
        """Known times at which formulas jump."""
        start, end = (float(t) for t in self.solution.times[[0, -1]])
        return breaks(self.system, self.probe, start, end)

    @cached_property
    def point(self) -> Point:
        """Pontryagin's system at the middles of panels, without multipliers of rows."""
        f = self.flow
        nu = self.impulses.integral
        return self.system.along(f.t, f.x, f.costate, f.u, self.solution.parameters, nu=nu)

    @cached_property
    def rows(self) -> tuple[Array, Array, Array, Array]:
        """Values of rows at the middles, and derivatives in x, u, p; (P, rows, …)."""
        f = self.flow
        return self.carrier.rows_at(f.t, f.x, f.u, self.solution.parameters)

    @cached_property
    def sizes(self) -> tuple[Array, Array, Array, Array]:
        """Sizes of the terms of H (P,), H_x (P, n_x), H_u (P, n_u) and H_p (P, n_p)."""
        f, m = self.flow, self.system.model
        values = (f.t, f.x, f.costate, f.u, self.solution.parameters, None, self.impulses.integral)
        found = sampled(self.system.sizes, values)[0]
        by_x, by_u, by_p = np.split(found[:, 1:], [m.n_x, m.n_x + m.n_u], axis=1)
        return found[:, 0], by_x, by_u, by_p

    @cached_property
    def switching_sizes(self) -> Array:
        """Sizes of the terms of H_u, (P, n_u): costates may become small along the horizon.

        One that is zero on an arc has the size that it would move to in a part of the horizon.
        """
        horizon = self.panels.times[-1] - self.panels.times[0]
        moved = np.maximum(SLIGHT * horizon * self.sizes[1], self.least_costates)
        local = np.maximum(self.sizes[2], self.pulled(moved))
        return np.asarray(np.maximum(local, LOCAL * local.max(axis=0, initial=0.0)))

    def pulled(self, moved: Array) -> Array:
        """Return what changes of costates (P, n_x) do to H_u at most, (P, n_u)."""
        f, p, nu = self.flow, self.solution.parameters, self.impulses.integral
        with_, without = (
            sampled(self.system.sizes, (f.t, f.x, costate, f.u, p, None, nu))[0]
            for costate in (moved, np.zeros_like(moved))
        )
        m = self.system.model
        return np.asarray((with_ - without)[:, 1 + m.n_x : 1 + m.n_x + m.n_u])

    @cached_property
    def spans(self) -> Array:
        """Ranges of the controls: between their bounds, or what they move by; (n_u,)."""
        lower, upper = self.system.model.control_bounds
        with np.errstate(invalid="ignore"):
            wide = upper - lower
        moved = ranges(self.flow.u, largest_bounds(lower, upper))
        return np.where(np.isfinite(wide) & (wide > 0), wide, moved)

    @property
    def reach(self) -> Array:
        """How far controls may be from where they are said to be, (n_u,)."""
        return np.asarray(AT_BOUND * self.spans)

    @cached_property
    def seen(self) -> Looked:
        """The answer on the grid that labels are given on."""
        given, solution, rows = self.panels, self.solution, len(self.system.rows)
        offsets = np.arange(_GRID + 1) / _GRID
        u = given.controls(solution, offsets).reshape(len(given.cells) * len(offsets), -1)
        t = (given.times[:-1, None] + given.lengths[:, None] * offsets).ravel()
        values, pressed = np.zeros((len(t), 0)), np.zeros((len(t), 0), dtype=bool)
        if rows:
            x, p = solution.state(t), solution.parameters
            values = self.carrier.rows_at(t, x, u, p)[0]
            pressed = np.repeat(pressing_rows(self), _GRID + 1, axis=0)
        return Looked(solution, t, u, values, pressed, _GRID + 1)

    @cached_property
    def arcs(self) -> tuple[Arc, ...]:
        """The structure."""
        affine = np.array([kind in ("affine", "absent") for kind in self.controls.kinds], bool)
        found = arcs(self.system, affine, self.seen)
        return sharpened(self, found)

    @cached_property
    def active(self) -> NDArray[np.int_]:
        """−1 or +1 where a row is at its lower or upper bound, at the middles; (P, rows)."""
        grid = at_bounds(self.system, self.seen)
        return grid.reshape(len(self.flow.t), _GRID + 1, -1)[:, _GRID // 2]

    def labels_of(self, i: int) -> Array:
        """Return −1, 0 or +1 of control i at its lower bound, between, at its upper; (P,)."""
        found = np.zeros(len(self.flow.t))
        for arc in self.arcs:
            if arc.of == self.names[i] and arc.kind in ("lower", "upper"):
                inside = (self.flow.t >= arc.start) & (self.flow.t <= arc.end)
                found[inside] = -1.0 if arc.kind == "lower" else 1.0
        return found

    @cached_property
    def labels(self) -> Array:
        """`labels_of` all controls, (P, n_u)."""
        found = [self.labels_of(i) for i in range(len(self.names))]
        return np.array(found).reshape(len(found), len(self.flow.t)).T

    @cached_property
    def clear(self) -> Flags:
        """Middles away from junctions of each control, and of constraints; (P, n_u)."""
        found = np.ones((len(self.flow.t), len(self.names)), dtype=bool)
        end = self.solution.times[-1]
        for arc in self.arcs:
            if arc.end < end:
                own = [arc.of] if arc.of in self.names else list(self.names)
                for name in own:
                    found[self.near(arc.end, arc.end_uncertainty), self.names.index(name)] = False
        for j in self.solution.junctions:
            found[self.near(j.time, j.uncertainty), j.control] = False
        return found & ~self.unresolved & (self.bends <= STEEP)

    @cached_property
    def unresolved(self) -> Flags:
        """Middles in and beside what is too short for these cells to be an arc, (P, n_u)."""
        marks = marked(self.system, self.seen).reshape(len(self.flow.t), _GRID + 1, -1)
        off = (marks[:, _GRID // 2] != self.labels).astype(float)
        return dilated(off, width(self.solution.basis)) > 0

    def near(self, time: float, uncertainty: float) -> Flags:
        """Return middles so near to a time that a jump there would blur û, (P,)."""
        nodes, cells = self.solution.times, self.panels.cells
        at = [np.searchsorted(nodes, time + s * uncertainty, side="right") - 1 for s in (-1, 1)]
        most = width(self.solution.basis)
        return np.asarray((cells >= at[0] - most) & (cells <= at[1] + most))

    @cached_property
    def gradient(self) -> Array:
        """What is left of H_u, (P, n_u): by the best multipliers of active rows with controls."""
        return pressed_gradient(self)

    @property
    def spells(self) -> Array:
        """What the defect of a panel is divided by to be one of rates, (P, 1): its length."""
        return self.panels.lengths[:, None]

    @cached_property
    def moved(self) -> Array:
        """∫ (H + μᵀc)_t dt from the first of the middles to each, (P,)."""
        rate, t = self.point.rate + row_rates(self), self.flow.t
        return np.append(0.0, np.cumsum(np.diff(t) * (rate[1:] + rate[:-1]) / 2))

    def switched(self, i: int, times: Array) -> Array:
        """Return H_u of control i at times at which it switches, (len(times),)."""
        return np.interp(times, self.flow.t, self.point.gradient[:, i])

    @cached_property
    def bends(self) -> Array:
        """Second differences of û over its range, the largest of the neighbourhood; (P, n_u)."""
        return dilated(self.differences(2), width(self.solution.basis))

    def differences(self, order: int) -> Array:
        """Differences of û over its range from panel to panel, of even order, (P, n_u)."""
        u = self.flow.u / self.spans
        if len(u) <= order:
            return np.ones_like(u)
        change = np.abs(np.diff(u, order, axis=0))
        return np.pad(change, ((order // 2, order // 2), (0, 0)), mode="edge")

    @cached_property
    def explained(self) -> Explained:
        """Errors that it may have, by what made it."""
        return Explained(self)

    @cached_property
    def state_rates(self) -> Array:
        """How fast states move at most, (n_x,)."""
        f = np.abs(np.diff(self.panels.states, axis=0)) / self.panels.lengths[:, None]
        horizon = self.panels.times[-1] - self.panels.times[0]
        own = np.maximum(f.max(axis=0), np.abs(self.panels.states).max(axis=0) / horizon)
        # A state that is always zero has the rate of rounding.
        return np.asarray(np.maximum(own, ROUNDING * own.max(initial=0.0)))

    @property
    def least_costates(self) -> Array:
        """Costates smaller than this are nothing beside the cost: (n_x,)."""
        size = np.maximum(np.abs(self.panels.states).max(axis=0), 1.0)
        return np.asarray(NOTHING * max(1.0, abs(self.solution.cost)) / size)

    @cached_property
    def power(self) -> float:
        """Size of the terms of H, over the horizon."""
        horizon = float(self.panels.times[-1] - self.panels.times[0])
        least = NOTHING * max(1.0, abs(self.solution.cost)) / horizon
        return max(float(self.sizes[0].max()), least)

    @cached_property
    def costate_rates(self) -> Array:
        """How fast costates could move by the terms of H_x, (n_x,)."""
        horizon = self.panels.times[-1] - self.panels.times[0]
        size = np.maximum(np.abs(self.panels.costates).max(axis=0), self.least_costates)
        return np.asarray(np.maximum(self.sizes[1].max(axis=0), size / horizon))
