"""An answer's states and costates carried over every panel anew, by an integrator of its own.

From the start of a panel

    x' = f(x, û(t)),      λ' = −H_x(x, λ, û(t)) − Σ μ c_x,

are integrated by Kutta's classical scheme in more steps than the answer took; what is missing at
its end is the defect. The multipliers of path constraints act where the nonlinear program has them,
as impulses λ⁺ = λ⁻ − m c_x; those of points in time likewise. A bound on a state has no multiplier
of its own in an answer: there the impulse is what the costate's defect says it is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.hamiltonian import Pontryagin, sampled
from quito_cli.optimality.looking.panels import Panels

if TYPE_CHECKING:
    import casadi as ca

    from quito_cli.solution.solution import Solution

Array = NDArray[np.float64]

LEAST_STEPS = 4
"""Steps that a panel is integrated in, at least."""
TOUCHES = 1e-3
"""Part of a state's size within which it is at a bound."""
PASSES = 3
"""Impulses of bounds are found to the cube of a panel's length."""


@dataclass(frozen=True, eq=False)
class Impulses:
    """Multipliers of everything but bounds of states, as an answer has them, unscaled."""

    path: Array
    """(P, S+1, rows) at the steps of each panel; the last of a panel only of a collocation."""
    last: Array
    """(rows,) at the final time."""
    points: tuple[tuple[int, Array], ...]
    """Of point constraints: the panel at whose start each is, and (rows,) multipliers."""
    integral: Array
    """(integrals,) ν."""
    boundary: Array
    """(rows,) ω."""


@dataclass(frozen=True, eq=False)
class Flow:
    """An answer carried over its panels."""

    x: Array
    """(P, n_x) at the middle of each panel."""
    costate: Array
    """(P, n_x) there: the mean of before and after an impulse."""
    t: Array
    """(P,)."""
    u: Array
    """(P, n_u)."""
    state_defects: Array
    """(P, n_x): integrated minus given, at the ends."""
    costate_defects: Array
    """(P, n_x)."""
    bounds: Array
    """(P, n_x): impulses of bounds on states, at the starts of panels; negative at lower ones."""
    integrals: Array
    """(n_q,): of the running cost and the integral constraints."""
    by_parameters: Array
    """(n_p,): ∫ H_p dt, impulses included."""


@dataclass(frozen=True, eq=False)
class Carrier:
    """The functions that carry an answer of one Model."""

    system: Pontryagin

    @cached_property
    def slopes(self) -> ca.Function:
        """Arguments ↦ f, −H_x, integrands, H_p."""
        import casadi as ca

        system, m = self.system, self.system.model
        integrands = ca.vertcat(m.lagrange, *(c.value for c in m.constraints.integral))
        outputs = [m.xdot, system.free_adjoint, integrands]
        outputs.append(ca.gradient(system.hamiltonian, m.p))
        return system.function("slopes", [ca.densify(ca.vertcat(*map(ca.densify, outputs)))])

    @cached_property
    def rows(self) -> ca.Function:
        """Arguments ↦ values of all rows, and their derivatives in x, u and p."""
        import casadi as ca

        m = self.system.model
        stacked = ca.vertcat(*(row.value for row in self.system.rows))
        outputs = [stacked, *(ca.jacobian(stacked, v) for v in (m.x, m.u, m.p))]
        return self.system.function("rows", [ca.densify(output) for output in outputs])

    def rows_at(self, t: Array, x: Array, u: Array, p: Array) -> tuple[Array, Array, Array, Array]:
        """Return values (points, rows) and derivatives (points, rows, n) in x, u, p."""
        m, count = self.system.model, len(self.system.rows)
        found = sampled(self.rows, (t, x, np.zeros(m.n_x), u, p, None, None))
        sizes = (m.n_x, m.n_u, m.n_p)
        slopes = [v.reshape(len(t), count, n) for v, n in zip(found[1:], sizes, strict=True)]
        return found[0], slopes[0], slopes[1], slopes[2]


Tableau = tuple[tuple[float, ...], tuple[float, ...]]
TABLEAUX: dict[int, Tableau] = {
    1: ((0.0,), (1.0,)),
    2: ((0.0, 1.0), (0.5, 0.5)),
    4: ((0.0, 0.5, 0.5, 1.0), (1 / 6, 1 / 3, 1 / 3, 1 / 6)),
}
"""By order: where the slopes are taken, each after a step with the one before, and their weights:
Euler's, Heun's and Kutta's methods."""


@dataclass(frozen=True, eq=False)
class Carried:
    """What one integration gives: x, λ, integrals and ∫H_p stacked."""

    middle: Array
    end: Array


def carried(
    carrier: Carrier,
    solution: Solution,
    given: Panels,
    impulses: Impulses,
    bounds: Array,
    steps: int,
    order: int,
) -> Carried:
    """Integrate over all panels at once.

    Args:
        carrier: the functions.
        solution: the answer.
        given: its panels.
        impulses: at `steps` steps.
        bounds: (P, n_x) impulses of bounds on states.
        steps: of each panel, even.
        order: 1, 2 or 4.
    """
    n, m = carrier.system.model.n_x, carrier.system.model
    u = given.controls(solution, np.arange(2 * steps + 1) / (2 * steps))
    h, p = given.lengths[:, None] / steps, solution.parameters
    y = np.hstack([given.states[:-1], given.costates[:-1]])
    y = np.hstack([y, np.zeros((len(h), m.n_q + m.n_p))])
    y[:, n : 2 * n] -= bounds
    _at_points(carrier, given, impulses, u[:, 0], p, y)
    middle = y

    def slope(y: Array, t: Array, u: Array) -> Array:
        values = (t, y[:, :n], y[:, n : 2 * n], u, p, None, impulses.integral)
        return sampled(carrier.slopes, values)[0]

    nodes, weights = TABLEAUX[order]
    for j in range(steps):
        t = given.times[:-1] + j * h[:, 0]
        before = y
        y = _struck(carrier, y, t, u[:, 2 * j], p, impulses.path[:, j])
        if j == steps // 2:
            middle = (before + y) / 2
        change, total = np.zeros_like(y), np.zeros_like(y)
        for c, b in zip(nodes, weights, strict=True):
            change = slope(y + c * h * change, t + c * h[:, 0], u[:, 2 * j + round(2 * c)])
            total += b * change
        y = y + h * total
    t = given.times[1:]
    return Carried(middle, _struck(carrier, y, t, u[:, -1], p, impulses.path[:, steps]))


def _struck(carrier: Carrier, y: Array, t: Array, u: Array, p: Array, given: Array) -> Array:
    """Return y after impulses (P, rows) of path constraints."""
    if not given.any():
        return y
    n, rows = carrier.system.model.n_x, given.shape[1]
    _, by_x, _, by_p = carrier.rows_at(t, y[:, :n], u, p)
    after = y.copy()
    after[:, n : 2 * n] -= np.einsum("pr,prx->px", given, by_x[:, :rows])
    if by_p.shape[2]:
        after[:, -by_p.shape[2] :] += np.einsum("pr,prx->px", given, by_p[:, :rows])
    return after


def _at_points(
    carrier: Carrier, given: Panels, impulses: Impulses, u: Array, p: Array, y: Array
) -> None:
    """Take impulses of point constraints from the costates at the starts of panels.

    Those at the ends of the horizon are matters of transversality: costates are those inside.
    """
    from quito_cli.optimality.transversality import point_jumps

    n = carrier.system.model.n_x
    if not impulses.points:
        return
    for (k, rho), f in zip(impulses.points, point_jumps(carrier.system), strict=True):
        if not 0 < k < len(y):
            continue
        at = (given.times[[k]], y[[k], :n], y[[k], n : 2 * n], u[[k]], p, None, None)
        slopes = sampled(f, at)[1].reshape(n, -1)
        y[k, n : 2 * n] -= slopes @ rho


def flow(
    carrier: Carrier, solution: Solution, given: Panels, impulses: Impulses, steps: int
) -> Flow:
    """Return an answer carried over its panels."""
    m = carrier.system.model
    n, near = m.n_x, _near_bounds(carrier, given)
    bounds = np.zeros((len(given.cells), n))
    for _ in range(PASSES if near.any() else 1):
        found = carried(carrier, solution, given, impulses, bounds, steps, 4)
        defects = found.end[:, n : 2 * n] - given.costates[1:]
        step = np.where(near[:-1], defects, 0.0)
        bounds = bounds + step
    defects = np.where(near[:-1], 0.0, defects)
    rest = found.end[:, 2 * n :].sum(axis=0)
    middle = (given.times[1:] + given.times[:-1]) / 2
    return Flow(
        found.middle[:, :n],
        found.middle[:, n : 2 * n],
        middle,
        given.controls(solution, np.array([0.5]))[:, 0],
        found.end[:, :n] - given.states[1:],
        defects,
        bounds,
        rest[: m.n_q],
        rest[m.n_q :],
    )


def explained(
    carrier: Carrier, solution: Solution, given: Panels, impulses: Impulses, order: int, steps: int
) -> tuple[Array, Array]:
    """Return how much a scheme of that order, with so many steps, errs in x and λ, (P, n_x) each.

    It is compared with one of twice the steps, without impulses: 1 − 2^(−order) of the error.
    """
    n, none = carrier.system.model.n_x, np.zeros((len(given.cells), given.states.shape[1]))
    ends = []
    for count in (steps, 2 * steps):
        calm = replace(impulses, path=np.zeros((len(given.cells), count + 1, 0)), points=())
        ends.append(carried(carrier, solution, given, calm, none, count, order).end)
    change = np.abs(ends[1] - ends[0]) / (1 - 0.5**order)
    return change[:, :n], change[:, n : 2 * n]


def _near_bounds(carrier: Carrier, given: Panels) -> NDArray[np.bool_]:
    """Return where states are at bounds of their own, (P+1, n_x)."""
    lower, upper = carrier.system.model.state_bounds
    x = given.states
    size = np.maximum(np.ptp(x, axis=0), TOUCHES * np.abs(x).max(axis=0)) * TOUCHES
    return np.asarray((x - lower <= size) | (upper - x <= size))
