"""An answer's multipliers of the nonlinear program as those of Pontryagin's conditions.

A path constraint is imposed at places; its multipliers there are ∫ μ dt over what each place stands
for. In shooting they strike the costate where they are. In a collocation costates are those of the
points, and μ is taken as linear between them, half of a panel's share at either end.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.hamiltonian import Pontryagin
from quito_cli.optimality.looking.flow import Impulses
from quito_cli.optimality.looking.panels import Panels

if TYPE_CHECKING:
    from quito_cli.optimality.looking.look import Look
    from quito_cli.solution.solution import Solution

Array = NDArray[np.float64]


def impulses(system: Pontryagin, solution: Solution, given: Panels, steps: int) -> Impulses:
    """Return the multipliers of an answer, struck at the steps of its panels."""
    constraints = system.model.constraints
    rows = sum(not row.state for row in system.rows)
    path, last = np.zeros((len(given.cells), steps + 1, rows)), np.zeros(rows)
    at = 0
    for constraint in constraints.path:
        own = slice(at, at + len(constraint.labels))
        at = own.stop
        name = f"path constraint {constraint.name}"
        values = solution.multipliers.get(name)
        if values is None:
            continue
        times = solution.multiplier_axes[name].times
        ends = times >= given.times[-1] - 1e-12 * (given.times[-1] - given.times[0])
        place = _densities if given.collocated else _places
        path[:, :, own] = place(given, times[~ends], values[~ends], steps)
        last[own] = values[ends].sum(axis=0)
    points = []
    for point in constraints.point:
        name = f"point constraint {point.name}"
        values = solution.multipliers.get(name)
        if values is not None:
            k = int(np.argmin(np.abs(given.times - solution.multiplier_axes[name].times[0])))
            points.append((k, values[0]))
    return Impulses(
        path,
        last,
        tuple(points),
        stacked(solution, "integral", [c.name for c in constraints.integral]),
        stacked(solution, "boundary", [c.name for c in constraints.boundary]),
    )


def stacked(solution: Solution, kind: str, names: list[str]) -> Array:
    """Return the multipliers of constraints of a kind one after another."""
    found = [solution.multipliers[f"{kind} constraint {name}"].ravel() for name in names]
    return np.concatenate([np.zeros(0), *found])


def _places(given: Panels, times: Array, values: Array, steps: int) -> Array:
    """Put each multiplier at the step of a panel that is nearest to its place."""
    found = np.zeros((len(given.cells), steps + 1, values.shape[1]))
    k = np.clip(np.searchsorted(given.times, times, side="right") - 1, 0, len(given.cells) - 1)
    j = np.round((times - given.times[k]) / given.lengths[k] * steps).astype(int)
    over = j >= steps  # rounding, just before the next node
    k, j = np.where(over, np.minimum(k + 1, len(given.cells) - 1), k), np.where(over, 0, j)
    np.add.at(found, (k, j), values)
    return found


def _densities(given: Panels, times: Array, values: Array, steps: int) -> Array:
    """Spread multipliers of points over the panels: the points are the panels' starts."""
    found = np.zeros((len(given.cells), steps + 1, values.shape[1]))
    if not len(times):
        return found
    shares = np.gradient(np.append(times, given.times[-1]))[:-1] if len(times) > 1 else np.ones(1)
    density = values / shares[:, None]
    at = np.array([np.interp(given.times, times, column) for column in density.T]).T
    half = given.lengths[:, None] / 2
    found[:, 0], found[:, -1] = at[:-1] * half, at[1:] * half
    return found


def row_rates(look: Look) -> Array:
    """Return μᵀ c_t at the middles, (P,), from impulses over lengths of panels."""
    import casadi as ca

    path = look.impulses.path.sum(axis=1)
    if not path.any():
        return np.zeros(len(look.flow.t))
    m = look.system.model
    stacked = ca.vertcat(*(row.value for row in look.system.rows if not row.state))
    slope = ca.Function("rates", [m.x, m.u, m.p, m.t], [ca.densify(ca.jacobian(stacked, m.t))])
    f, p = look.flow, look.solution.parameters
    n = len(f.t)
    by_t = np.array(slope.map(n)(f.x.T, f.u.T, np.tile(p[:, None], (1, n)), f.t)).reshape(-1, n)
    return np.asarray((path / look.panels.lengths[:, None] * by_t.T).sum(axis=1))
