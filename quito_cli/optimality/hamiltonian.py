"""The Hamiltonian of a Model, its adjoint equations and derivatives, as CasADi functions.

    H = L + λᵀf + νᵀq,      λ' = −(H + μᵀc)_x,      (H + μᵀc)_u,  (H + μᵀc)_uu,

in the convention that the package states. Everything is derived when it is first asked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from quito_cli.problem.model import Model, labels
from quito_cli.problem.named import NamedConstants

if TYPE_CHECKING:
    import casadi as ca

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Row:
    """lower ≤ value ≤ upper at every time: a row of a path constraint, or a bounded state."""

    label: str
    """The constraint with the row it is, or the state."""
    value: ca.SX
    """Scalar, in terms of x, u, p, t."""
    lower: float
    upper: float
    state: bool
    """It is a bound on a state, not a path constraint of the file."""
    mixed: bool
    """A control enters."""


class Point(NamedTuple):
    """Values along a trajectory; a leading axis of points."""

    hamiltonian: Array
    """H, (points,)."""
    adjoint: Array
    """λ' by the adjoint equations, (points, n_x)."""
    gradient: Array
    """(H + μᵀc)_u, (points, n_u); without μ the switching functions of affine controls."""
    curvature: Array
    """(H + μᵀc)_uu, (points, n_u, n_u)."""
    rate: Array
    """(H + μᵀc)_t, (points,): what H' is along an extremal."""
    parameters: Array
    """(H + μᵀc)_p, (points, n_p)."""


@dataclass(frozen=True, eq=False)
class Pontryagin:
    """Pontryagin's system of a Model; `arguments` are the inputs of all its functions."""

    model: Model
    costate: ca.SX
    """λ, (n_x, 1)."""
    multipliers: ca.SX
    """μ of `rows`, (rows, 1)."""
    integral_multipliers: ca.SX
    """ν of the integral constraints, in their order, (integrals, 1); constant in time."""
    rows: tuple[Row, ...]
    """Of the path constraints in their order, then of bounded states."""
    constants: NamedConstants
    """Constants of the file that the formulas carry as symbols; none but for a page to read."""

    @property
    def arguments(self) -> list[ca.SX]:
        """Symbols of x, λ, u, p, t, μ, ν."""
        m = self.model
        last = (self.multipliers, self.integral_multipliers)
        return [m.x, self.costate, m.u, m.p, m.t, *last]

    @cached_property
    def hamiltonian(self) -> ca.SX:
        """H = L + λᵀf + νᵀq, scalar."""
        import casadi as ca

        integrands = ca.vertcat(*(c.value for c in self.model.constraints.integral))
        value = self.model.lagrange + ca.dot(self.costate, self.model.xdot)
        return value + ca.dot(self.integral_multipliers, integrands) if self.integrals else value

    @property
    def integrals(self) -> int:
        """Number of integral constraints."""
        return len(self.model.constraints.integral)

    @cached_property
    def augmented(self) -> ca.SX:
        """H + μᵀc, scalar."""
        import casadi as ca

        if not self.rows:
            return self.hamiltonian
        return self.hamiltonian + ca.dot(
            self.multipliers, ca.vertcat(*(r.value for r in self.rows))
        )

    @cached_property
    def adjoint(self) -> ca.SX:
        """λ' = −(H + μᵀc)_x, (n_x, 1)."""
        import casadi as ca

        return -ca.gradient(self.augmented, self.model.x)

    @cached_property
    def free_adjoint(self) -> ca.SX:
        """λ' = −H_x where no row is active, (n_x, 1)."""
        import casadi as ca

        return -ca.gradient(self.hamiltonian, self.model.x)

    @cached_property
    def switching(self) -> ca.SX:
        """H_u, (n_u, 1): the switching functions of controls that are affine in H."""
        import casadi as ca

        return ca.densify(ca.gradient(self.hamiltonian, self.model.u))

    @cached_property
    def curvature(self) -> ca.SX:
        """H_uu, (n_u, n_u)."""
        import casadi as ca

        return ca.jacobian(self.switching, self.model.u)

    def function(self, name: str, outputs: Sequence[ca.SX | None]) -> ca.Function:
        """Return the function of `arguments` with these outputs, constants at their values.

        An output that there is not, None, is left out.
        """
        import casadi as ca

        k, given = self.constants, [output for output in outputs if output is not None]
        if not k.names:
            return ca.Function(name, self.arguments, given)
        whole = ca.Function(name, [*self.arguments, k.symbols], given)
        return ca.Function(name, self.arguments, whole.call([*self.arguments, ca.SX(k.values)]))

    @cached_property
    def functions(self) -> ca.Function:
        """(x, λ, u, p, t, μ, ν) ↦ H, λ', gradient and curvature in u, rate, gradient in p."""
        import casadi as ca

        m, augmented = self.model, self.augmented
        gradient = ca.densify(ca.gradient(augmented, m.u))
        outputs = [self.hamiltonian, self.adjoint, gradient, ca.jacobian(gradient, m.u)]
        outputs += [ca.gradient(augmented, m.t), ca.gradient(augmented, m.p)]
        return self.function("pontryagin", [ca.densify(output) for output in outputs])

    @cached_property
    def sizes(self) -> ca.Function:
        """Arguments ↦ sizes of the terms of H, H_x, H_u and H_p, stacked: Σ|λ_j f_j| and so on."""
        import casadi as ca

        m = self.model
        integrands = ca.vertcat(*(c.value for c in m.constraints.integral))
        terms = ca.vertcat(m.lagrange, m.xdot, integrands)
        weights = ca.vertcat(1, ca.fabs(self.costate), ca.fabs(self.integral_multipliers))
        whole = [ca.dot(weights, ca.fabs(terms))]
        for by in (m.x, m.u, m.p):
            whole.append(ca.fabs(ca.densify(ca.jacobian(terms, by))).T @ weights)
        return self.function("sizes", [ca.densify(ca.vertcat(*whole))])

    def along(
        self,
        t: Array,
        x: Array,
        costate: Array,
        u: Array,
        p: Array,
        *,
        mu: Array | None = None,
        nu: Array | None = None,
    ) -> Point:
        """Evaluate at many points.

        Args:
            t: (points,).
            x: (points, n_x).
            costate: (points, n_x).
            u: (points, n_u).
            p: (n_p,).
            mu: (points, rows); zero if left out.
            nu: (integrals,); zero if left out.
        """
        values = sampled(self.functions, (t, x, costate, u, p, mu, nu))
        n, m = len(np.atleast_1d(t)), self.model
        h, adjoint, gradient, curvature, rate, by_p = (
            v.reshape(n, *shape)
            for v, shape in zip(
                values, [(), (m.n_x,), (m.n_u,), (m.n_u, m.n_u), (), (m.n_p,)], strict=True
            )
        )
        return Point(h, adjoint, gradient, curvature, rate, by_p)


def sampled(
    function: ca.Function,
    values: tuple[Array, Array, Array, Array, Array, Array | None, Array | None],
) -> list[Array]:
    """Evaluate a function of Pontryagin's arguments along a trajectory.

    Args:
        function: of x, λ, u, p, t, μ, ν.
        values: t (points,), x, λ, u (points, size each), p (n_p,), μ (points, rows) and
            ν (integrals,); the last two are zero where they are None.

    Returns:
        Its outputs, (points, rows · columns) each, entries of a matrix row by row.
    """
    t, x, costate, u, p, mu, nu = values
    n = len(np.atleast_1d(t))
    shapes = [function.size1_in(i) for i in range(7)]
    given = [x, costate, u, p, t, mu, nu]
    columns = []
    for value, rows in zip(given, shapes, strict=True):
        array = np.zeros(rows) if value is None else np.asarray(value, float)
        columns.append(np.broadcast_to(array.reshape(-1, rows) if rows else (), (n, rows)).T)
    found = _mapped(function, n).call(columns)
    results = []
    for i, output in enumerate(found):
        shape = function.size_out(i)
        stacked = np.array(output).reshape(shape[0], n, shape[1])
        results.append(np.moveaxis(stacked, 1, 0).reshape(n, shape[0] * shape[1]))
    return results


@lru_cache(maxsize=16)
def _mapped(function: ca.Function, points: int) -> ca.Function:
    """Return a function over so many points: making it takes as long as calling it."""
    return function.map(points)


def pontryagin(model: Model, constants: NamedConstants | None = None) -> Pontryagin:
    """Return Pontryagin's system of a Model; nothing is differentiated yet.

    `constants` are those of `with_named_constants`, whose Model keeps them as symbols.
    """
    import casadi as ca

    rows = (*_path_rows(model), *_state_rows(model))
    return Pontryagin(
        model,
        ca.SX.sym("costate", model.n_x),
        ca.SX.sym("mu", len(rows)),
        ca.SX.sym("nu", len(model.constraints.integral)),
        rows,
        constants or NamedConstants((), ca.SX(0, 1), np.zeros(0)),
    )


def _path_rows(model: Model) -> list[Row]:
    import casadi as ca

    found = []
    for constraint in model.constraints.path:
        for i, label in enumerate(constraint.labels):
            value = constraint.value[i]
            mixed = bool(model.n_u) and bool(ca.depends_on(value, model.u))
            low, high = constraint.bounds.lower[i], constraint.bounds.upper[i]
            found.append(Row(label, value, float(low), float(high), False, mixed))
    return found


def _state_rows(model: Model) -> list[Row]:
    pairs = enumerate(zip(labels(model.states), *model.state_bounds, strict=True))
    return [
        Row(label, model.x[i], float(low), float(high), True, False)
        for i, (label, low, high) in pairs
        if np.isfinite(low) or np.isfinite(high)
    ]
