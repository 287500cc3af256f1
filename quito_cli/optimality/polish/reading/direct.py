"""A direct answer as the polish reads it: trajectories, and multipliers of indirect adjoining.

On an arc of a state constraint S of order q the costates of indirect adjoining are asked for. With
ζ_0(t) = ∫_t μ dt to the end of the arc and ζ_i = ∫_t ζ_{i−1} dt they are λ − Σ_i ζ_i ∇S^(i), the
multiplier is η = ζ_{q−1}, and the jump where the arc begins has the multipliers π_i = ζ_i.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.hamiltonian import sampled
from quito_cli.optimality.looking.look import Look
from quito_cli.optimality.polish.equations.leaps import Leap
from quito_cli.optimality.polish.equations.setting import Setting
from quito_cli.optimality.polish.equations.structure import Held
from quito_cli.optimality.polish.equations.system import System
from quito_cli.optimality.polish.equations.unknowns import Layout
from quito_cli.optimality.polish.solving.flow import inputs
from quito_cli.optimality.polish.solving.newton import Scales
from quito_cli.solution.solution import Solution

Array = NDArray[np.float64]

MOST_SEGMENTS = 64
"""Of a phase to start with."""
PLACES = 20
"""Points of a phase at which its rates are looked at."""
GRID = 201
"""Points of an arc that multipliers are integrated on."""
NEAR = 0.05
"""Part of the horizon within which impulses are those of a touch."""
LEAST = 1e-6
"""Part of the largest size that every size has."""


@dataclass(frozen=True, eq=False)
class Direct:
    """A direct answer, as a start of the boundary value problem of a structure."""

    setting: Setting
    solution: Solution
    look: Look

    @cached_property
    def _paths(self) -> int:
        """How many rows are of path constraints; those of states follow."""
        return sum(not row.state for row in self.setting.system.rows)

    def pull(self, row: int) -> tuple[Array, Array]:
        """Return times (P+1,) and ∫ μ dt from each to the final time, (P+1,), of a row."""
        if row < self._paths:
            each = self.look.impulses.path[:, :, row].sum(axis=1)
            last = self.look.impulses.last[row]
        else:
            bounded = np.flatnonzero(self.setting.system.model.state_bounds.present)
            place = bounded[row - self._paths]
            each, last = self.look.flow.bounds[:, place], 0.0
        total = np.concatenate([np.cumsum(each[::-1])[::-1], [0.0]])
        return self.look.panels.times, total + last

    def impulses(self, row: int) -> tuple[Array, Array]:
        """Return times (P+1,) and ∫ μ dt over each panel, (P,), of a row."""
        times, total = self.pull(row)
        return times, -np.diff(total)

    def zeta(self, held: Held, arc: tuple[float, float], t: Array) -> Array:
        """Return ζ_0 … ζ_{q−1} of a row at times of an arc of it, (len(t), q)."""
        order = self.setting.active(held).order or 0
        times, total = self.pull(held[0])
        grid = np.linspace(*arc, GRID)
        slack = 2 * float(np.diff(self.solution.times).max())
        zeta = np.interp(grid, times, total) - np.interp(arc[1] + slack, times, total)
        found = []
        for _ in range(order):
            found.append(np.interp(t, grid, zeta))
            steps = np.diff(grid) * (zeta[1:] + zeta[:-1]) / 2
            zeta = np.append(np.cumsum(steps[::-1])[::-1], 0.0)
        return np.array(found).reshape(order, len(t)).T

    def _rate(self, row: int, t: Array) -> Array:
        """Return μ of a row at times, (len(t),)."""
        times, impulses = self.impulses(row)
        middles = (times[1:] + times[:-1]) / 2
        return np.asarray(np.interp(t, middles, impulses / np.diff(times)))

    def shared(self, system: System) -> Array:
        """Return g of a structure."""
        solution, look, layout = self.solution, self.look, system.layout
        g = np.zeros(layout.count)
        times = np.array(system.structure.times)
        g[layout.place("state")] = solution.state(times[:1])[0]
        g[layout.place("costate")] = solution.costate(times[:1])[0]
        g[layout.place("times")] = times
        g[layout.place("parameters")] = solution.parameters
        g[layout.place("integral")] = look.impulses.integral
        g[layout.place("boundary")] = look.impulses.boundary
        for leap in system.leaps:
            if leap:
                self._jumps(system, leap, g)
        return g

    def _jumps(self, system: System, leap: Leap, g: Array) -> None:
        """Put the multipliers of a junction into g."""
        structure, k = system.structure, leap.junction
        time = structure.times[k]
        for jump, place in leap.parts(system.layout):
            if jump.held is None:
                found = [rho for i, (_, rho) in enumerate(self.look.impulses.points)
                         if i == jump.point]  # fmt: skip
                g[place] = found[0] if found else 0.0
            elif (k, jump.held) in structure.touches:
                times, own = self.impulses(jump.held[0])
                near = np.abs(times[:-1] - time) < NEAR * (structure.times[-1] - structure.times[0])
                g[place] = own[near].sum()
            else:
                arc = structure.arc(k, jump.held)
                g[place] = self.zeta(jump.held, arc, np.array([time]))[0]

    def along(self, system: System, k: int, t: Array) -> tuple[Array, Array]:
        """Return (x, λ) of indirect adjoining and z in phase k, (len(t), …)."""
        law, solution = system.laws[k], self.solution
        x, costates, u = solution.state(t), solution.costate(t).copy(), solution.control(t)
        values = (t, x, costates.copy(), u, solution.parameters, None, None)
        eta = []
        for held in law.held:
            known = self.setting.active(held)
            if known.order:
                zeta = self.zeta(held, system.structure.arc(k, held), t)
                slopes = sampled(known.jumps, values)[0].reshape(len(t), -1, known.order)
                costates -= np.einsum("pxi,pi->px", slopes, zeta)
                eta.append(zeta[:, -1])
            else:
                eta.append(self._rate(held[0], t))
        return np.hstack([x, costates]), np.column_stack([u[:, list(law.between)], *eta])

    def segments(self, system: System, k: int) -> int:
        """Return how many segments a phase is to have: by how fast its flow moves."""
        structure, layout = system.structure, system.layout
        start, end = structure.span(k, k)
        t = np.linspace(start, end, PLACES + 2)[1:-1]
        g = np.zeros(layout.count)
        g[layout.place("parameters")] = self.solution.parameters
        g[layout.place("integral")] = self.look.impulses.integral
        y, z = self.along(system, k, t)
        two = 2 * layout.states
        with np.errstate(all="ignore"):
            slopes = system.laws[k].values(inputs(t, y, g, layout), z).slopes[:, :two, :two]
        scale = self.scales(layout).nodes[:two]
        matrix = np.nan_to_num(slopes) * scale / scale[:, None]
        rate = float(np.abs(np.linalg.eigvals(matrix)).max(initial=0.0))
        horizon = structure.times[-1] - structure.times[0]
        wanted = max(rate * (end - start) / 2, 6 * (end - start) / horizon)
        return int(np.clip(np.ceil(wanted), 1, MOST_SEGMENTS))

    def scales(self, layout: Layout) -> Scales:
        """Return sizes of the unknowns."""
        solution = self.solution
        x, costates = _sizes(solution.trajectory.states), _sizes(solution.costates)
        totals = np.abs(self.look.flow.integrals[1:])
        beside = np.ones(layout.beside)
        beside[: len(totals)] = np.maximum(totals, 1e-3)
        shared = np.ones(layout.count)
        shared[layout.place("state")], shared[layout.place("costate")] = x, costates
        shared[layout.place("times")] = float(solution.times[-1] - solution.times[0])
        shared[layout.place("parameters")] = np.maximum(np.abs(solution.parameters), 1e-3)
        return Scales(np.concatenate([x, costates, beside]), shared)


def _sizes(values: Array) -> Array:
    """Return the sizes of columns, (n, size) ↦ (size,), none of them nothing."""
    found = np.abs(values).max(axis=0)
    return np.asarray(np.maximum(found, LEAST * max(float(found.max(initial=0.0)), LEAST)))
