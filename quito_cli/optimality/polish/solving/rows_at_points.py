"""Equations at point constraints: their values or multipliers, their times, H on both sides.

A point constraint at t_j = t₀ + f_j (t_f − t₀) moves with the horizon. The unknowns e are H at the
initial time and H⁻ + ρᵀc_t, H⁺ beside every point; the steps between the two enter the conditions
of free times (see `ends`). At an end of the horizon there is one side: ρᵀc_t is left of the step.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from quito_cli.optimality.polish.equations.leaps import Leap
from quito_cli.optimality.polish.equations.system import System
from quito_cli.optimality.polish.solving.rows import Linear, Point, none


def energies(point: Point) -> Iterator[tuple[int, Linear]]:
    """Give the node of each entry of e, and that entry minus what it is."""
    first = point.system.layout.place("energies").start
    last = len(point.system.laws) - 1
    sides: list[tuple[int, bool, int | None]] = [(0, True, None)]
    for k, _ in point.system.instants:
        sides += [(max(k - 1, 0), k == 0, k), (min(k, last), k <= last, None)]
    for entry, (phase, at_start, junction) in enumerate(sides, start=first):
        yield point.node(phase, at_start), _energy(point, phase, at_start, entry, junction)


def _energy(point: Point, phase: int, at_start: bool, entry: int, junction: int | None) -> Linear:
    """Return e − H, before the point constraints of a junction e − H − ρᵀc_t."""
    layout, g = point.system.layout, point.at.shared
    energy = point.energy(phase, at_start)
    value, by_node, by_shared = -energy.value, -energy.by_node, -energy.by_shared
    leap = None if junction is None else point.system.leaps[junction]
    if leap is not None:
        pull = leap.pull(point.end(phase, at_start).y[: layout.states], g, layout)
        value -= pull.value[-1]
        by_node[0, : layout.states] -= pull.by_x[-1]
        by_shared[0, layout.time(leap.junction)] -= pull.by_t[-1, 0]
        by_shared[0, layout.place("parameters")] -= pull.by_p[-1]
        by_shared[0, leap.place(layout)] -= pull.by_m[-1]
    by_shared[:, entry] += 1.0
    return Linear(value + g[entry], by_node, by_shared)


def add_steps(point: Point, final: Linear) -> None:
    """Add what H steps by at point constraints to the conditions of free times."""
    system, g = point.system, point.at.shared
    first, n = system.layout.place("energies").start + 1, system.layout.states
    for j, (_, f) in enumerate(system.instants):
        before, after = first + 2 * j, first + 1 + 2 * j
        for row, time, share in (
            (2 * n, system.ends.initial_time, 1 - f),
            (2 * n + 1, system.ends.final_time, f),
        ):
            if np.isnan(time):
                final.value[row] += share * (g[before] - g[after])
                final.by_shared[row, before] += share
                final.by_shared[row, after] -= share


def constraints(point: Point) -> Iterator[tuple[int, Linear]]:
    """Give the nodes after point constraints and breaks, and what holds there."""
    system = point.system
    for k, f in system.instants:
        yield point.node(*_side(system, k)), _time(point, k, f)
    for k, which in system.structure.points:
        leap = system.leaps[k]
        assert leap is not None, "a point constraint has multipliers"
        yield point.node(*_side(system, k)), _values(point, leap, which)
    points = {k for k, _ in system.instants}
    for k, time in system.structure.breaks:
        if k in points:  # its time is known already
            continue
        found = none(1, system.layout)
        found.by_shared[0, system.layout.time(k)] = 1.0
        found.value[0] = point.at.shared[system.layout.time(k)] - time
        yield point.node(k, at_start=True), found


def _side(system: System, k: int) -> tuple[int, bool]:
    """Return the phase that starts at a junction and that it starts; at the last the one before."""
    return (k, True) if k < len(system.laws) else (k - 1, False)


def _time(point: Point, k: int, f: float) -> Linear:
    """Return t_j − t₀ − f (t_f − t₀)."""
    layout = point.system.layout
    found = none(1, layout)
    found.by_shared[0, layout.time(k)] = 1.0
    found.by_shared[0, layout.time(0)] -= 1 - f
    found.by_shared[0, layout.place("times").stop - 1] -= f
    found.value[:] = found.by_shared @ point.at.shared
    return found


def _values(point: Point, leap: Leap, which: int) -> Linear:
    """Return c − its bound where it is at one, ρ where it is at none."""
    layout, g, n = point.system.layout, point.at.shared, point.system.layout.states
    y = point.end(*_side(point.system, leap.junction)).y
    values = leap.values(y[:n], g, layout)
    bounds, own = next(
        (point.system.ends.points[which], place)
        for jump, place in leap.parts(layout)
        if jump.point == which
    )
    found = none(len(bounds), layout)
    for i, (bound, multiplier) in enumerate(zip(bounds, range(own.start, own.stop), strict=True)):
        if np.isnan(bound):
            found.value[i], found.by_shared[i, multiplier] = g[multiplier], 1.0
            continue
        row = multiplier - leap.place(layout).start
        found.value[i] = values.value[row] - bound
        found.by_node[i, :n] = values.by_x[row]
        found.by_shared[i, layout.time(leap.junction)] = values.by_t[row, 0]
        found.by_shared[i, layout.place("parameters")] = values.by_p[row]
    return found
