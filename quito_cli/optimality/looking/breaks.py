"""Known times at which formulas of a problem jump or have kinks, whatever states and controls are.

A table of straight lines over time, a reference that steps, abs(t − 2): their corners are where an
argument that depends on time alone is zero. There x', λ' or the controls may jump, H does, and
nothing is to be asked of the time.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.hamiltonian import Pontryagin
from quito_cli.optimality.symbols.probes import MOST_OPERATIONS, Probe
from quito_cli.solution.kinks import corners

if TYPE_CHECKING:
    import casadi as ca

Array = NDArray[np.float64]

GRID = 2001
"""Times between which an argument changes its sign once at most."""
BESIDE = 1e-9
"""Part of the horizon on either side of a corner at which formulas are compared."""
JUMPS = 1e-6
"""Part of its size by which a formula, or its slope, jumps at least."""
OFF = 1e-14
"""Part of the largest time that is beside a break, and not on it."""


def breaks(system: Pontryagin, probe: Probe, start: float, end: float) -> tuple[float, ...]:
    """Return the times of breaks inside a horizon; on each, what holds after it holds already.

    Args:
        system: Pontryagin's system of the problem.
        probe: its random points, at which formulas are compared.
        start: the initial time.
        end: the final time.
    """
    import casadi as ca

    m = system.model
    integrands = [c.value for c in m.constraints.integral]
    given = [m.lagrange, m.xdot, *integrands, *(row.value for row in system.rows)]
    formulas = ca.densify(ca.vertcat(*given))
    if not ca.depends_on(formulas, m.t):
        return ()
    function = system.function("formulas", [formulas])
    if function.n_instructions() > MOST_OPERATIONS:
        return ()
    edge = BESIDE * (end - start)
    found = {t for t in _zeros(function, start, end) if start + edge < t < end - edge}
    slopes = system.function("slopes", [formulas, ca.densify(ca.jacobian(formulas, m.t))])
    return tuple(t for t in sorted(found) if _jumps(slopes, probe, t, end - start))


def _zeros(function: ca.Function, start: float, end: float) -> Iterator[float]:
    """Give the first times after which arguments of corners have another sign."""
    import casadi as ca

    inputs = function.sx_in()
    t, others = inputs[4], ca.vertcat(*inputs[:4], *inputs[5:])
    arguments = [
        value
        for _, value in corners(function)
        if ca.depends_on(value, t) and not ca.depends_on(value, others)
    ]
    if not arguments:
        return
    of_time = ca.Function("corners", [t], [ca.vertcat(*arguments)])
    grid = np.linspace(start, end, GRID)
    # In abs(t − 1) < 1e-5 the corner of abs is where the comparison has another sign.
    grid = np.unique([*grid, *_changes(of_time, grid)])
    yield from _changes(of_time, grid)


def _changes(of_time: ca.Function, grid: Array) -> Iterator[float]:
    """Give the first times after which an argument has another sign than at the time before."""
    values = np.sign(np.array(of_time.map(len(grid))(grid)))
    for row, signs in enumerate(values):
        for a, b in pairwise(np.flatnonzero(signs)):
            if signs[a] != signs[b]:
                yield _bisected(of_time, row, float(grid[a]), float(grid[b]))


def _bisected(of_time: ca.Function, row: int, low: float, high: float) -> float:
    """Return the first number at which an argument has the sign that it has at `high`."""
    sign = np.sign(float(of_time(high)[row]))
    while (middle := (low + high) / 2) not in (low, high):
        if np.sign(float(of_time(middle)[row])) == sign:
            high = middle
        else:
            low = middle
    return high


def _jumps(slopes: ca.Function, probe: Probe, time: float, horizon: float) -> bool:
    """Whether a formula, or its derivative in time, jumps at a time."""
    points = probe.points[:-1]
    count = points[4].shape[1]
    sides = []
    for step in (-BESIDE * horizon, BESIDE * horizon):
        given = [*points[:4], np.full((1, count), time + step), *points[5:]]
        sides.append([np.array(v) for v in slopes.map(count)(*given)])
    (value, slope), (after, slope_after) = sides
    size = np.abs(value).max(initial=0.0) + np.abs(after).max(initial=0.0)
    steep = np.abs(slope).max(initial=0.0) + np.abs(slope_after).max(initial=0.0) + size / horizon
    return bool(
        np.abs(after - value).max(initial=0.0) > JUMPS * size
        or np.abs(slope_after - slope).max(initial=0.0) > JUMPS * steep
    )
