"""Where the boundary value problem is started from: a direct answer, with its multipliers.

On an arc of a state constraint S of order q the costates of indirect adjoining are asked for. With
ζ_0(t) = ∫_t μ dt to the end of the arc and ζ_i = ∫_t ζ_{i−1} dt they are λ − Σ_i ζ_i ∇S^(i), the
multiplier is η = ζ_{q−1}, and the jump where the arc begins has the multipliers π_i = ζ_i.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.hamiltonian import sampled
from quito_cli.optimality.look import Look, bounded_states
from quito_cli.optimality.polish.ends import Ends
from quito_cli.optimality.polish.flow import inputs
from quito_cli.optimality.polish.newton import Scales
from quito_cli.optimality.polish.setting import Setting
from quito_cli.optimality.polish.structure import Held, Phase, Structure
from quito_cli.optimality.polish.system import System
from quito_cli.optimality.polish.unknowns import Segments, Unknowns
from quito_cli.problem.model import Bounds, Instant
from quito_cli.solution.solution import Solution

Array = NDArray[np.float64]

AT_END = 1e-5
"""Part of its size by which a value is at an end of its range."""
PRESSED = 1e-7
"""Size of a multiplier, times that of what it multiplies, over the cost's, that is not nothing."""
MOST_SEGMENTS = 64
"""Of a phase to start with."""


@dataclass(frozen=True, eq=False)
class Direct:
    """A direct answer as the polish reads it."""

    setting: Setting
    solution: Solution
    look: Look

    def density(self, row: int) -> tuple[Array, Array]:
        """Return times (P+1,) and ∫ μ dt from each to the final time, (P+1,), of a row."""
        given, system = self.look.panels, self.setting.system
        paths = sum(not r.state for r in system.rows)
        if row < paths:
            each = self.look.impulses.path[:, :, row].sum(axis=1)
        else:
            place = np.flatnonzero(bounded_states(system))[row - paths]
            each = self.look.flow.bounds[:, place]
        total = np.concatenate([np.cumsum(each[::-1])[::-1], [0.0]])
        if row < paths:
            total = total + self.look.impulses.last[row]
        return given.times, total

    def impulses(self, row: int) -> tuple[Array, Array]:
        """Return times (P+1,) and ∫ μ dt over each panel, (P,), of a row."""
        times, total = self.density(row)
        return times, -np.diff(total)

    def adjoined(self, held: Held, start: float, end: float, t: Array) -> Array:
        """Return ζ_0 … ζ_{q−1} of a row at times of an arc, (len(t), q)."""
        order = self.setting.active(held).order or 0
        times, total = self.density(held[0])
        grid = np.linspace(start, end, 201)
        slack = 2 * float(np.diff(self.solution.times).max())
        zeta = np.interp(grid, times, total) - np.interp(end + slack, times, total)
        found = []
        for _ in range(order):
            found.append(np.interp(t, grid, zeta))
            steps = np.diff(grid) * (zeta[1:] + zeta[:-1]) / 2
            zeta = np.append(np.cumsum(steps[::-1])[::-1], 0.0)
        return np.array(found).reshape(order, len(t)).T


def ends_of(direct: Direct, structure: Structure) -> Ends:
    """Decide which ends of ranges hold.

    A state that is held at its bound at an end already has no end of a range besides.
    """
    system, solution = direct.setting.system, direct.solution
    m, x = system.model, solution.state(solution.times[[0, -1]])
    start, end = float(solution.times[0]), float(solution.times[-1])
    size = np.maximum(np.abs(solution.trajectory.states).max(axis=0), 1e-8)
    horizon = end - start
    multipliers = direct.look.impulses
    names = [c.bounds for c in m.constraints.boundary]
    values = (
        np.array(m.boundary_values(x[0], start, x[-1], end, solution.parameters)[0])[:, 0]
        if names
        else np.zeros(0)
    )
    boundary = _rows_at(names, values, multipliers.boundary, solution.cost)
    integrals = [c.bounds for c in m.constraints.integral]
    totals = direct.look.flow.integrals[1:]
    point_values = []
    for k, constraint in enumerate(m.constraints.point):
        rho = next((r for i, (_, r) in enumerate(multipliers.points) if i == k), None)
        count = len(constraint.bounds.lower)
        t = start + (constraint.at or 0.0) * horizon
        value = np.array(
            m.function(constraint)(
                solution.state([t])[0], solution.control([t])[0], solution.parameters, t
            )
        )[:, 0]
        rho = np.zeros(count) if rho is None else rho
        point_values.append(_rows_at([constraint.bounds], value, rho, solution.cost))
    p_size = np.maximum(np.abs(solution.parameters), 1.0)
    return Ends(
        system,
        _unheld(direct, structure.phases[0], m.initial, _at_ends(m.initial, x[0], size)),
        _unheld(direct, structure.phases[-1], m.final, _at_ends(m.final, x[-1], size)),
        float(_at_ends(_range(m.initial_time), np.array([start]), np.array([horizon]))[0]),
        float(_at_ends(_range(m.final_time), np.array([end]), np.array([horizon]))[0]),
        _at_ends(m.parameter_bounds, solution.parameters, p_size),
        _rows_at(integrals, totals, multipliers.integral, solution.cost),
        boundary,
        tuple(point_values),
    )


def _unheld(direct: Direct, phase: Phase, bounds: Bounds, found: Array) -> Array:
    """Return values at an end without those of states that the phase there holds."""
    system, bounded = direct.setting.system, bounded_states(direct.setting.system)
    paths = sum(not row.state for row in system.rows)
    states = np.flatnonzero(bounded)
    for row, _ in phase.held:
        if row >= paths and not bounds.fixed[states[row - paths]]:
            found[states[row - paths]] = np.nan
    return found


def _range(instant: Instant) -> Bounds:
    return Bounds(np.array([instant.lower]), np.array([instant.upper]))


def _at_ends(bounds: Bounds, value: Array, size: Array) -> Array:
    """Return the bound that a value is at, NaN where it is at none."""
    found = np.full(len(value), np.nan)
    for side in bounds:
        near = np.isfinite(side) & (np.abs(value - side) <= AT_END * size)
        found = np.where(near, side, found)
    return np.where(bounds.fixed, bounds.lower, found)


def _rows_at(bounds: list[Bounds], values: Array, multipliers: Array, cost: float) -> Array:
    """Return the bound that each row is at and presses on, NaN where it is at none."""
    if not bounds:
        return np.zeros(0)
    whole = Bounds(*(np.concatenate(sides) for sides in zip(*bounds, strict=True)))
    size = np.maximum(np.abs(values), 1e-3)
    found = _at_ends(whole, values, 10 * size)
    slight = np.abs(multipliers) * size <= PRESSED * max(1.0, abs(cost))
    return np.where(slight & ~whole.fixed, np.nan, found)


def scales_of(direct: Direct, system: System) -> Scales:
    """Return sizes of the unknowns."""
    solution, layout = direct.solution, system.layout
    x = np.abs(solution.trajectory.states).max(axis=0)
    costates = np.abs(solution.costates).max(axis=0)
    x = np.maximum(x, 1e-6 * max(float(x.max(initial=0.0)), 1e-6))
    costates = np.maximum(costates, 1e-6 * max(float(costates.max(initial=0.0)), 1e-6))
    horizon = float(solution.times[-1] - solution.times[0])
    beside = np.ones(system.beside)
    totals = np.abs(direct.look.flow.integrals[1:])
    beside[: len(totals)] = np.maximum(totals, 1e-3)
    shared = np.ones(layout.count)
    shared[layout.place("x0")], shared[layout.place("l0")] = x, costates
    shared[layout.place("T")] = horizon
    shared[layout.place("p")] = np.maximum(np.abs(solution.parameters), 1e-3)
    return Scales(np.concatenate([x, costates, beside]), shared)


def started(direct: Direct, system: System) -> Unknowns:
    """Return unknowns of a structure from a direct answer."""
    structure, layout = system.structure, system.layout
    solution, look = direct.solution, direct.look
    g = np.zeros(layout.count)
    times = np.array(structure.times)
    g[layout.place("T")] = times
    g[layout.place("p")] = solution.parameters
    g[layout.place("nu")] = look.impulses.integral
    g[layout.place("omega")] = look.impulses.boundary
    g[layout.place("x0")] = solution.state(times[:1])[0]
    g[layout.place("l0")] = solution.costate(times[:1])[0]
    at = layout.place("pi").start
    for leap in system.leaps:
        for jump in leap.jumps if leap else ():
            count = jump.values.numel()
            if jump.point is not None:
                rho = [r for i, (_, r) in enumerate(look.impulses.points) if i == jump.point]
                g[at : at + count] = rho[0] if rho else 0.0
            at += count
    phases = []
    for k in range(len(structure.phases)):
        phases.append(_phase(direct, system, k, g))
    at = layout.place("pi").start
    for k, leap in enumerate(system.leaps):
        for jump in leap.jumps if leap else ():
            count = jump.values.numel()
            if (k, jump.held) in structure.touches:
                assert jump.held is not None
                times_of, own = direct.impulses(jump.held[0])
                near = np.abs(times_of[:-1] - structure.times[k]) < 0.05 * np.ptp(times)
                g[at] = own[near].sum()
            elif jump.held is not None:
                start, end = _arc(structure, k, jump.held)
                g[at : at + count] = direct.adjoined(jump.held, start, end, np.array([start]))[0]
            at += count
    return Unknowns(tuple(phases), g)


def _arc(structure: Structure, phase: int, held: Held) -> tuple[float, float]:
    """Return from when to when a row is held about a phase."""
    first = last = phase
    while first > 0 and held in structure.phases[first - 1].held:
        first -= 1
    while last + 1 < len(structure.phases) and held in structure.phases[last + 1].held:
        last += 1
    return structure.span(first, last)


def _phase(direct: Direct, system: System, k: int, g: Array) -> Segments:
    structure, method, law = system.structure, system.method, system.laws[k]
    start, end = structure.times[k], structure.times[k + 1]
    fractions = np.linspace(0.0, 1.0, _segments(direct, system, k) + 1)
    inner = (fractions[:-1, None] + np.diff(fractions)[:, None] * method.points).ravel()
    at = np.concatenate([fractions, inner])
    t = start + at * (end - start)
    y = estimate(direct, system, k, t)
    nodes = np.hstack([y[: len(fractions)], np.zeros((len(fractions), system.beside))])
    stages = y[len(fractions) :].reshape(len(fractions) - 1, len(method.points), -1)
    z = multiplied(direct, system, k, t, y, g)
    count = len(fractions)
    shape = (*stages.shape[:2], -1) if z.shape[1] else (*stages.shape[:2], 0)
    del law
    return Segments(fractions, nodes, stages, z[count:].reshape(shape), z[0], z[count - 1])


def estimate(direct: Direct, system: System, k: int, t: Array) -> Array:
    """Return (x, λ) of the direct answer in phase k, with costates of indirect adjoining."""
    solution, structure = direct.solution, system.structure
    x, costates = solution.state(t), solution.costate(t).copy()
    u = solution.control(t)
    for held in structure.phases[k].held:
        known = direct.setting.active(held)
        if not known.order:
            continue
        zeta = direct.adjoined(held, *_arc(structure, k, held), t)
        values = (t, x, costates, u, solution.parameters, None, None)
        slopes = sampled(known.jumps, values)[0].reshape(len(t), -1, known.order)
        costates -= np.einsum("pxi,pi->px", slopes, zeta)
    return np.hstack([x, costates])


def multiplied(direct: Direct, system: System, k: int, t: Array, y: Array, g: Array) -> Array:
    """Return estimates of z: controls of the direct answer, multipliers that they leave."""
    law, solution = system.laws[k], direct.solution
    u = solution.control(t)[:, list(law.between)]
    if not law.held:
        return u
    eta = []
    for held in law.held:
        known = direct.setting.active(held)
        if known.order:
            zeta = direct.adjoined(held, *_arc(system.structure, k, held), t)
            eta.append(zeta[:, -1])
        else:
            times, total = direct.density(held[0])
            steps = np.diff(times)
            rates = -np.diff(total) / steps
            eta.append(np.interp(t, (times[1:] + times[:-1]) / 2, rates))
    return np.hstack([u, np.array(eta).T])


def _segments(direct: Direct, system: System, k: int) -> int:
    """Return how many segments a phase is to have: by how fast its flow moves."""
    structure, law = system.structure, system.laws[k]
    start, end = structure.times[k], structure.times[k + 1]
    horizon = structure.times[-1] - structure.times[0]
    t = np.linspace(start, end, 22)[1:-1]
    g = np.zeros(system.layout.count)
    g[system.layout.place("p")] = direct.solution.parameters
    g[system.layout.place("nu")] = direct.look.impulses.integral
    y = estimate(direct, system, k, t)
    with np.errstate(all="ignore"):
        found = law.values(inputs(t, y, g, system.layout), multiplied(direct, system, k, t, y, g))
    two = 2 * system.layout.states
    scale = scales_of(direct, system).nodes[:two]
    matrix = np.nan_to_num(found.slopes[:, :two, :two]) * scale / scale[:, None]
    rate = float(np.abs(np.linalg.eigvals(matrix)).max(initial=0.0))
    wanted = max(rate * (end - start) / 2, 6 * (end - start) / horizon)
    return int(np.clip(np.ceil(wanted), 1, MOST_SEGMENTS))


@dataclass(frozen=True, eq=False)
class Again:
    """A solved boundary value problem, as the start of one with another structure."""

    direct: Direct
    system: System
    unknowns: Unknowns

    def unknowns_of(self, system: System) -> Unknowns:
        """Return unknowns of another structure; what it has besides is zero."""
        old, new, given = self.system.layout, system.layout, self.unknowns.shared
        g = np.zeros(new.count)
        for name in ("x0", "l0", "p", "nu", "omega"):
            g[new.place(name)] = given[old.place(name)]
        g[new.place("T")] = system.structure.times
        jumps = self._jumps()
        at = new.place("pi").start
        for k, leap in enumerate(system.leaps):
            for jump in leap.jumps if leap else ():
                count = jump.values.numel()
                key = (jump.held, jump.point)
                near = [
                    v
                    for t, h, v in jumps
                    if h == key
                    and len(v) == count
                    and abs(t - system.structure.times[k]) < 0.1 * np.ptp(system.structure.times)
                ]
                if near:
                    g[at : at + count] = near[0]
                at += count
        phases = tuple(self._phase(system, k, g) for k in range(len(system.structure.phases)))
        return Unknowns(phases, g)

    def _jumps(self) -> list[tuple[float, tuple[Held | None, int | None], Array]]:
        found, at = [], self.system.layout.place("pi").start
        times = self.unknowns.shared[self.system.layout.place("T")]
        for k, leap in enumerate(self.system.leaps):
            for jump in leap.jumps if leap else ():
                count = jump.values.numel()
                found.append(
                    (
                        float(times[k]),
                        (jump.held, jump.point),
                        self.unknowns.shared[at : at + count],
                    )
                )
                at += count
        return found

    def _phase(self, system: System, k: int, g: Array) -> Segments:
        start, end = system.structure.times[k], system.structure.times[k + 1]
        count = max(_segments(self.direct, system, k), self._density(start, end))
        fractions = np.linspace(0.0, 1.0, count + 1)
        inner = (fractions[:-1, None] + np.diff(fractions)[:, None] * system.method.points).ravel()
        t = start + np.concatenate([fractions, inner]) * (end - start)
        y, u, eta = self._at(t)
        law, n = system.laws[k], len(fractions)
        z = np.hstack([u[:, list(law.between)], *(eta[:, [row]] for row, _ in law.held)])
        stages = y[n:].reshape(count, len(system.method.points), -1)
        nodes = np.hstack([y[:n], np.zeros((n, system.beside))])
        inner_z = z[n:].reshape(count, len(system.method.points), z.shape[1])
        return Segments(fractions, nodes, stages, inner_z, z[0], z[n - 1])

    def _density(self, start: float, end: float) -> int:
        """Return how many segments there were between two times."""
        count, times = 0, self.unknowns.shared[self.system.layout.place("T")]
        for k, segments in enumerate(self.unknowns.phases):
            nodes = times[k] + segments.fractions * (times[k + 1] - times[k])
            middles = (nodes[1:] + nodes[:-1]) / 2
            count += int(((middles > start) & (middles < end)).sum())
        return count

    def _at(self, t: Array) -> tuple[Array, Array, Array]:
        """Return y, u and η of all rows at times."""
        layout, rows = self.system.layout, len(self.system.setting.system.rows)
        times = self.unknowns.shared[layout.place("T")]
        inside = np.clip(np.searchsorted(times, t, side="right") - 1, 0, len(times) - 2)
        y = np.zeros((len(t), 2 * layout.states))
        u, eta = np.zeros((len(t), self.system.setting.system.model.n_u)), np.zeros((len(t), rows))
        for k, segments in enumerate(self.unknowns.phases):
            own = np.flatnonzero(inside == k)
            if not len(own):
                continue
            place = np.clip((t[own] - times[k]) / (times[k + 1] - times[k]), 0.0, 1.0)
            j = np.clip(
                np.searchsorted(segments.fractions, place, side="right") - 1,
                0,
                len(segments.stages) - 1,
            )
            offsets = (place - segments.fractions[j]) / np.diff(segments.fractions)[j]
            known = np.concatenate(
                [
                    segments.nodes[:-1, None, : y.shape[1]],
                    segments.stages,
                    segments.nodes[1:, None, : y.shape[1]],
                ],
                axis=1,
            )
            weights = self.system.method.known.weights(offsets)
            y[own] = np.einsum("pm,pmy->py", weights, known[j])
            law = self.system.laws[k]
            nearest = np.abs(offsets[:, None] - self.system.method.points).argmin(axis=1)
            v = inputs(t[own], y[own], self.unknowns.shared, layout)
            z, _ = law.settled(v, segments.inner[j, nearest])
            u[own] = law.controls(z)
            for i, (row, _) in enumerate(law.held):
                eta[own, row] = z[:, len(law.between) + i]
        return y, u, eta
