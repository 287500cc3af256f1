"""The answer's own control, integrated again by other means.

The state is carried from its initial value over the whole horizon with û(t) and the method of
Dormand and Prince of order 5 (*J. Comput. Appl. Math.* 6, 1980), with steps that are a fraction of
the substeps, or of the distances of collocation points, and are halved until the result stands
still. It knows nothing of the nonlinear program: where the two differ, the answer's trajectory is
not the one that its control produces.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.problem.model import Model
from quito_cli.transcription.control import Basis
from quito_cli.transcription.mesh import Mesh

if TYPE_CHECKING:
    import casadi as ca

Array = NDArray[np.float64]

_C = np.array([0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1])
_A = (
    (),
    (1 / 5,),
    (3 / 40, 9 / 40),
    (44 / 45, -56 / 15, 32 / 9),
    (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
    (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
)
_B = (35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84)

STANDS_STILL = 1e-9
"""Relative change under which halving the steps stops."""
MOST_STEPS = 32
"""Steps between two breaks at most."""
MOST_IN_ALL = 400_000
"""Steps over the horizon at most, as long as that is two between breaks."""


_AT_A_TIME = 2048
"""Steps taken in one call; a longer chain takes long to build."""


@dataclass(frozen=True)
class Control:
    """û(t) of an answer, cell by cell."""

    basis: Basis
    mesh: Mesh
    coefficients: Array
    """(count, n_u)."""


@dataclass(frozen=True)
class Resimulation:
    """What the control produces when integrated anew."""

    states: Array
    """(M+1, n_x) at the breaks."""
    integrals: Array
    """(n_q,): the Lagrange cost, then the integral constraints'."""
    cost: float
    """Lagrange and Mayer, of the minimisation."""
    accuracy: float
    """Relative change of states and cost when the steps were last halved."""


def resimulate(
    model: Model,
    control: Control,
    breaks: Array,
    times: tuple[float, float],
    start: Array,
    parameters: Array,
) -> Resimulation:
    """Integrate from `start` (n_x,) over `times`.

    Args:
        model: the problem.
        control: û.
        breaks: offsets in a cell, from 0 to 1, at which results are given: ends of substeps,
            collocation points.
        times: initial and final time.
        start: state at the initial time.
        parameters: p.
    """
    one = _step(model)
    finer = 2
    before = _integrate(one, control, breaks, finer, times, start, parameters)
    while True:
        finer *= 2
        after = _integrate(one, control, breaks, finer, times, start, parameters)
        change = _relative_change(before, after)
        many = 2 * finer * (len(breaks) - 1) * control.mesh.cells > MOST_IN_ALL
        if change <= STANDS_STILL or finer >= MOST_STEPS or many:
            break
        before = after
    states, integrals = after[:, : model.n_x], after[-1, model.n_x :]
    mayer = float(model.end_cost(start, times[0], states[-1], times[1], parameters))
    return Resimulation(states, integrals, float(integrals[0]) + mayer, change)


def _relative_change(before: Array, after: Array) -> float:
    with np.errstate(all="ignore"):  # an unstable system may overflow; that is told as inf
        scale = np.maximum(np.abs(after).max(axis=0), 1e-300)
        change = float((np.abs(after - before) / np.where(scale > 1e-12, scale, 1.0)).max())
    return change if np.isfinite(change) else np.inf


def _step(model: Model) -> ca.Function:
    """Return ([x; integrals], û at the stages, [t; h], p) ↦ [x; integrals] one step later."""
    import casadi as ca

    n = model.n_x
    y, times = ca.SX.sym("y", n + model.n_q), ca.SX.sym("times", 2)
    u, p = ca.SX.sym("u", model.n_u, len(_C)), ca.SX.sym("p", model.n_p)
    t, h = times[0], times[1]
    slopes: list[ca.SX] = []
    for i, row in enumerate(_A):
        at = y[:n]
        for a, slope in zip(row, slopes, strict=True):
            at += h * a * slope[:n]
        xdot, integrands = model.right_hand_side(at, u[:, i], p, t + _C[i] * h)
        slopes.append(ca.vertcat(xdot, integrands))
    after = y
    for b, slope in zip(_B, slopes, strict=True):
        after += h * b * slope
    return ca.Function("step", [y, u, times, p], [ca.cse(after)])


def _integrate(
    step: ca.Function,
    control: Control,
    breaks: Array,
    finer: int,
    times: tuple[float, float],
    start: Array,
    parameters: Array,
) -> Array:
    """Return [x; integrals] at the breaks, (M+1, n_x + n_q)."""
    mesh, lengths = control.mesh, np.repeat(np.diff(breaks) / finer, finer)
    begins = np.repeat(breaks[:-1], finer) + lengths * np.tile(np.arange(finer), len(breaks) - 1)
    offsets = (begins[:, None] + _C * lengths[:, None]).ravel()
    u = control.basis.evaluate(control.coefficients, *mesh.points(np.minimum(offsets, 1.0)))
    count = mesh.cells * len(begins)
    horizon = times[1] - times[0]
    h = (mesh.steps[:, None] * lengths).ravel() * horizon
    t = times[0] + horizon * mesh.at(*mesh.points(begins))
    stages = u.reshape(count * len(_C), u.shape[1]).T
    p = np.tile(parameters[:, None], (1, count))
    y = np.append(start, np.zeros(step.size1_in(0) - len(start)))
    found, many = [y[:, None]], step.mapaccum(min(count, _AT_A_TIME))
    for first in range(0, count, _AT_A_TIME):
        part = slice(first, first + _AT_A_TIME)
        size = len(t[part])
        run = many if size == min(count, _AT_A_TIME) else step.mapaccum(size)
        columns = slice(first * len(_C), (first + size) * len(_C))
        found.append(np.array(run(y, stages[:, columns], np.vstack([t, h])[:, part], p[:, part])))
        y = found[-1][:, -1]
    return np.hstack(found).T[::finer]
