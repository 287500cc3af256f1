"""Which ends of ranges hold in a direct answer: those that it is at and presses on."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.polish.equations.ends import Ends
from quito_cli.optimality.polish.equations.structure import Phase, Structure
from quito_cli.optimality.polish.reading.direct import Direct
from quito_cli.problem.model import Bounds, Instant

Array = NDArray[np.float64]

AT_END = 1e-5
"""Part of its size by which a value is at an end of its range."""
PRESSED = 1e-7
"""Size of a multiplier, times that of what it multiplies, over the cost's, that is not nothing."""
LEAST = 1e-3
"""Size that values of constraints have at least."""


def ends_held(direct: Direct, structure: Structure) -> Ends:
    """Return what holds at the ends.

    A state that is held at its bound at an end already has no end of a range besides.
    """
    solution, look, m = direct.solution, direct.look, direct.setting.system.model
    start, end = (float(t) for t in solution.times[[0, -1]])
    x, p, horizon = solution.state(solution.times[[0, -1]]), solution.parameters, end - start
    size = np.maximum(np.abs(solution.trajectory.states).max(axis=0), 1e-8)
    first, last = structure.phases[0], structure.phases[-1]
    cost, boundary = max(1.0, abs(solution.cost)), m.constraints.boundary
    values = (
        np.array(m.boundary_values(x[0], start, x[-1], end, p)[0]).ravel()
        if boundary
        else np.zeros(0)
    )
    return Ends(
        direct.setting.system,
        _unheld(direct, first, m.initial, _at_ends(m.initial, x[0], size)),
        _unheld(direct, last, m.final, _at_ends(m.final, x[-1], size)),
        float(_at_ends(_bounds(m.initial_time), np.array([start]), np.array([horizon]))[0]),
        float(_at_ends(_bounds(m.final_time), np.array([end]), np.array([horizon]))[0]),
        _at_ends(m.parameter_bounds, p, np.maximum(np.abs(p), 1.0)),
        _pressed(
            [c.bounds for c in m.constraints.integral],
            look.flow.integrals[1:],
            look.impulses.integral,
            cost,
        ),
        _pressed([c.bounds for c in boundary], values, look.impulses.boundary, cost),
        tuple(_points(direct, cost)),
    )


def _points(direct: Direct, cost: float) -> Iterator[Array]:
    """Give the bounds that each point constraint is at."""
    solution, m = direct.solution, direct.setting.system.model
    start, end = (float(t) for t in solution.times[[0, -1]])
    multipliers = dict(enumerate(rho for _, rho in direct.look.impulses.points))
    for k, constraint in enumerate(m.constraints.point):
        t = start + (constraint.at or 0.0) * (end - start)
        given = solution.state([t])[0], solution.control([t])[0], solution.parameters, t
        value = np.array(m.function(constraint)(*given))[:, 0]
        yield _pressed([constraint.bounds], value, multipliers.get(k, np.zeros(len(value))), cost)


def _unheld(direct: Direct, phase: Phase, bounds: Bounds, found: Array) -> Array:
    """Return values at an end without those of states that the phase there holds."""
    system = direct.setting.system
    paths = sum(not row.state for row in system.rows)
    states = np.flatnonzero(system.model.state_bounds.present)
    for row, _ in phase.held:
        if row >= paths and not bounds.fixed[states[row - paths]]:
            found[states[row - paths]] = np.nan
    return found


def _bounds(instant: Instant) -> Bounds:
    return Bounds(np.array([instant.lower]), np.array([instant.upper]))


def _at_ends(bounds: Bounds, value: Array, size: Array) -> Array:
    """Return the bound that a value is at, NaN where it is at none."""
    found = np.full(len(value), np.nan)
    for side in bounds:
        near = np.isfinite(side) & (np.abs(value - side) <= AT_END * size)
        found = np.where(near, side, found)
    return np.where(bounds.fixed, bounds.lower, found)


def _pressed(bounds: Sequence[Bounds], values: Array, multipliers: Array, cost: float) -> Array:
    """Return the bound that each row is at and presses on, NaN where it is at none."""
    if not bounds:
        return np.zeros(0)
    whole = Bounds(*(np.concatenate(sides) for sides in zip(*bounds, strict=True)))
    size = np.maximum(np.abs(values), LEAST)
    found = _at_ends(whole, values, 10 * size)
    slight = np.abs(multipliers) * size <= PRESSED * cost
    return np.where(slight & ~whole.fixed, np.nan, found)
