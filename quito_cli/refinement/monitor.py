"""How long the cells should be, from an answer on other cells.

The density of cells is N₀ times a mixture of three shares, each of integral one over the horizon:
equal cells, the variation of û, and the square root of its second differences in index space. The
second draws cells into jumps, where the error of û falls with their length, the third to kinks, and
where û bends: √|Δ²û| equal in all cells makes the error of a method of order two equal in all.
Where the local error of the states asks for more than that, there are more: a scheme of order p in
cells of length h makes an error of h^(p+1).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.problem.model import Model
from quito_cli.solution.solution import Solution
from quito_cli.transcription.schemes import SCHEMES, Step

if TYPE_CHECKING:
    import casadi as ca

Array = NDArray[np.float64]

VARIATION, CURVATURE = 0.35, 0.2
"""Shares of the cells that follow variation and second differences of û."""
NOISE = 1e-5
"""Second differences of û below this part of its range are not looked at."""
ENDS = 4
"""Cells at either end whose second differences count no more than those inside: on a singular arc
the last coefficients hardly matter, and are left to chance."""
LOCAL_ERROR = 1e-4
"""Local error of the states in a cell, over their size and the tolerance of the mesh."""
_FINER = 4
"""Times as many steps, of the classical Runge-Kutta method, that the local error is found with."""
_LEAST, _MOST = 1e-30, 1e3
"""Times more cells than there are that a local error may ask for."""


def wanted_steps(
    model: Model, solution: Solution, ranges: Array, cells: int, tolerance: float, order: int
) -> tuple[Array, Array]:
    """Return wanted lengths at the cells of an answer, and the local errors there, (N,) each.

    Args:
        model: the problem.
        solution: an answer.
        ranges: (n_u,) what the controls are judged by.
        cells: N₀.
        tolerance: of the mesh.
        order: of the scheme.
    """
    steps = solution.mesh.steps
    offsets = np.full(len(steps), 0.5)
    middle = solution.basis.evaluate(solution.coefficients, np.arange(len(steps)), offsets) / ranges
    follows = VARIATION * _variation(middle) + CURVATURE * _curvature(middle)
    density = cells * ((1 - VARIATION - CURVATURE) + follows / steps)
    errors = local_errors(model, solution)
    asked = (np.maximum(errors, _LEAST) / (LOCAL_ERROR * tolerance)) ** (1 / (order + 1))
    return 1 / np.maximum(density, np.minimum(asked, _MOST) / steps), errors


def _variation(middle: Array) -> Array:
    """Return each cell's share of the variation of û, from its values in the middle (N, n_u)."""
    change = np.abs(np.diff(middle, axis=0)).sum(axis=1)
    around = np.append(change, 0.0) + np.append(0.0, change)
    return _share(around)


def _curvature(middle: Array) -> Array:
    """Return each cell's share of the roots of second differences."""
    second = np.abs(np.diff(middle, 2, axis=0)).max(axis=1, initial=0.0)
    if len(second) > 2 * ENDS:
        second[:ENDS] = np.minimum(second[:ENDS], second[ENDS])
        second[-ENDS:] = np.minimum(second[-ENDS:], second[-ENDS - 1])
    if not second.size:
        return _share(np.zeros(len(middle)))
    wide = np.concatenate([second[:1], second, second[-1:]])
    wide = np.maximum(wide, np.maximum(np.append(wide[1:], 0.0), np.append(0.0, wide[:-1])))
    return _share(np.sqrt(np.maximum(wide, NOISE)))


def _share(values: Array) -> Array:
    total = float(values.sum())
    return values / total if total > 0 else np.full(len(values), 1 / len(values))


def local_errors(model: Model, solution: Solution) -> Array:
    """Return the largest local error of states and integrals in each cell, over their size, (N,).

    The states at the start of a cell are carried to its end in finer steps; the integrals with the
    answer's number of steps and with twice as many.
    """
    substeps = int(solution.options["substeps"])
    states = solution.state(solution.times)
    size = np.abs(states).max(axis=0)
    size = np.where(size > 0, size, 1.0)
    coarse = _carried(model, solution, substeps)[1]
    finer = _carried(model, solution, 2 * substeps)[1]
    ends = _carried(model, solution, _FINER * substeps)[0]
    with np.errstate(invalid="ignore", over="ignore"):
        state = (np.abs(ends - states[1:].T) / size[:, None]).max(axis=0, initial=0.0)
        whole = np.maximum(np.abs(finer.sum(axis=1)), abs(solution.cost))
        missed = np.abs(finer - coarse) / np.where(whole > 0, whole, 1.0)[:, None]
    found = np.maximum(state, missed.max(axis=0, initial=0.0))
    return np.where(np.isfinite(found), found, 1.0)


def _carried(model: Model, solution: Solution, steps: int) -> tuple[Array, Array]:
    """Return states (n_x, N) at the ends of the cells, and integrals (n_q, N) over them."""
    cells = np.arange(solution.mesh.cells)
    h, each = np.diff(solution.times) / steps, _step(model).map(len(cells))
    p = np.tile(solution.parameters[:, None], (1, len(cells)))
    u = [
        solution.basis.evaluate(
            solution.coefficients, cells, np.full(len(cells), i / (2 * steps))
        ).T
        for i in range(2 * steps + 1)
    ]
    x, q = solution.state(solution.times[:-1]).T, np.zeros((model.n_q, len(cells)))
    for j in range(steps):
        t = solution.times[:-1] + h * j
        x, integrals = map(np.array, each(x, *u[2 * j : 2 * j + 3], p, t, h))
        q = q + integrals
    return x, q


def _step(model: Model) -> ca.Function:
    """Return (x, û at start, middle and end, p, t, h) ↦ (x, integrals) a step of rk4 later."""
    import casadi as ca

    x, p, u = ca.SX.sym("x", model.n_x), ca.SX.sym("p", model.n_p), ca.SX.sym("u", model.n_u, 3)
    t, h = ca.SX.sym("t"), ca.SX.sym("h")

    def f(x: ca.SX, u: ca.SX, t: ca.SX) -> tuple[ca.SX, ca.SX]:
        xdot, integrands = model.right_hand_side(x, u, p, t)
        return xdot, integrands

    controls = ca.horzsplit(u)
    after, integrals = SCHEMES["rk4"].residual(
        Step(f, x, ca.SX.zeros(model.n_x), (), controls, t, h)
    )
    return ca.Function("step", [x, *controls, p, t, h], [after, integrals])
