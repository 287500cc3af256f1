"""Legendre-Gauss-Radau collocation: the method of GPOPS-II and ICLOCS2.

Garg, Patterson, Hager, Rao, Benson and Huntington, *Automatica* 46 (2010); Garg, Patterson,
Francolin and others, *Comput. Optim. Appl.* 49 (2011). In each of N cells the state is a polynomial
of degree D through the D LGR points, c_0 = 0 < … < c_{D−1} < 1, and the end; the control one of
degree D − 1 through the D points. The unknowns of cell k are

    x_k | x at c_1, …, c_{D−1}: its own | x_{k+1},    û at c_0, …, c_{D−1}: coefficients.

At every point the polynomial has the slope that the dynamics ask for, and the integrals are sums:

    w_i (h T f(x_i, u_i, t_i) − Σ_j D_ij x_j) = 0,    J = Mayer + Σ_k Σ_i w_i h T L(x_i, u_i, t_i).

Multiplied by the quadrature weights w_i, the rows have entries of size one for any D, and their
multipliers are the costates λ = ∂V/∂x at the points: those of the rows as the papers print them,
over w_i. At the end of a cell λ = −∂/∂x_{k+1} of its part of the Lagrangian, Σ_j w_j D_{j,D} λ_j:
the polynomial through the λ_j there.

Two terms do it: the function of one point, z = [shared | x_i | u_i], and −w_i D X, which is linear.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from quito_cli.problem.model import Constraint, Model, labels
from quito_cli.transcription.blocks import add_point
from quito_cli.transcription.guess import Guess
from quito_cli.transcription.layout import Layout
from quito_cli.transcription.legendre import Radau, radau
from quito_cli.transcription.mesh import Mesh
from quito_cli.transcription.polynomial import PolynomialBasis
from quito_cli.transcription.program import Program, shared_symbols
from quito_cli.transcription.rows import Rows
from quito_cli.transcription.terms import NOWHERE, Gather, Term

if TYPE_CHECKING:
    import casadi as ca

    from quito_cli.transcription.cells import PathPoints

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

FINE_POINTS = 4
"""Points from a collocation point to the next on the grid that violations are looked for on."""
FINE_IN_A_CELL = 10
"""Points a cell on that grid, at least."""
JUST_BEFORE = 1e-9
"""How far before a node it is looked at what comes to an end there, in cells."""


@dataclass(frozen=True)
class Collocation:
    """LGR collocation of degree D in every cell of a mesh."""

    mesh: Mesh
    degree: int
    """D."""

    @property
    def rule(self) -> Radau:
        """Points and weights."""
        return radau(self.degree)

    @property
    def basis(self) -> PolynomialBasis:
        """The polynomials of the control."""
        return PolynomialBasis(self.mesh.cells, self.degree)

    @property
    def offsets(self) -> Array:
        """The points."""
        return self.rule.points

    @property
    def breaks(self) -> Array:
        """The points and the end."""
        return self.rule.state.points

    @property
    def interpolation(self) -> Literal["polynomial"]:
        """How states go on between the points."""
        return "polynomial"

    @property
    def fine(self) -> Array:
        """As many offsets from every point to the next, and the end, where the control may jump."""
        many = max(FINE_POINTS, -(-FINE_IN_A_CELL // self.degree))
        parts = np.arange(many) / many
        gaps = self.breaks[:-1, None] + np.diff(self.breaks)[:, None] * parts
        return np.append(gaps, 1 - JUST_BEFORE)

    @property
    def resolved(self) -> tuple[Array, int]:
        """As many even offsets as there are points; each is what a cell is to the ringing index.

        On the points themselves, which crowd at the ends of a cell, second differences of a smooth
        control would be those of the points.
        """
        return np.arange(self.degree) / self.degree, 1

    @property
    def own_are_states(self) -> bool:
        """Bounds of states hold at all points."""
        return True

    @property
    def sampled(self) -> Mesh:
        """Guesses are asked for at all points: one cell may be the whole horizon."""
        return Mesh(np.append(self.mesh.at(*self.mesh.points(self.offsets)), 1.0))

    @property
    def order(self) -> int:
        """That of Gauss-Radau quadrature at the ends of the cells."""
        return 2 * self.degree - 1

    @property
    def finer(self) -> str:
        """The options that refine it."""
        return "--steps, or a higher --degree where the answer is smooth"

    @property
    def calmer(self) -> str:
        """What is known to help where the control rings."""
        return (
            "collocation does at jumps and on singular arcs; try another --discretization, such as "
            "the default, or more --steps of a lower --degree"
        )

    def layout(self, model: Model) -> Layout:
        """Return where the unknowns of `model` stand."""
        return Layout.of(model, self.mesh.cells, self.degree - 1, self.basis.count)

    def start(self, guess: Guess, layout: Layout) -> Array:
        """Return the unknowns of a guess at all points."""
        nodes, own = guess.states[:: self.degree], guess.states[:-1]
        own = own.reshape(self.mesh.cells, self.degree, layout.n_x)[:, 1:]
        return guess.stacked(layout, nodes, own, guess.controls[:-1])

    def add_dynamics(self, program: Program, path_points: PathPoints | None) -> Collocated:
        """Add the points to a program."""
        function = _point_function(program.model, program.layout)
        fractions = self.mesh.at(*self.mesh.points(self.offsets))
        zero = np.zeros(program.layout.n_x)
        names, scale = labels(program.model.states), 1 / program.state_unit
        rows = program.book.add("dynamics", names, fractions, (zero, zero), scale)
        places = _places(program.layout, self.degree)
        points = _add_points(program, self, function, rows, places, path_points)
        _add_differences(program, self.rule, rows, places)
        return Collocated(self.rule, points, rows, places, program.layout, program.unit)


@dataclass(frozen=True)
class Collocated:
    """The points in a program, and what an answer says by them."""

    rule: Radau
    points: Term
    rows: Rows
    """Of the dynamics."""
    places: Indices
    """(N, D+1, n_x) the unknowns that are states, cell by cell."""
    layout: Layout
    unit: Array
    """(n_w,)."""

    @property
    def terms(self) -> tuple[Term, ...]:
        """Along the horizon, the cost unscaled."""
        return (self.points,)

    def states(self, w: Array) -> tuple[Array, Array]:
        """Return the states at the points and after each, up to the end, (N D, n_x) each."""
        x, n = (w * self.unit)[self.places], self.layout.n_x
        return x[:, :-1].reshape(-1, n), x[:, 1:].reshape(-1, n)

    def costates(self, w: Array, multipliers: Array) -> Array:
        """Return λ at all breaks, (N D + 1, n_x); at a node the value just before it.

        At the initial time it is the slope of the optimal cost, +∂/∂x_0 of the first cell's part
        of the Lagrangian, which is as exact as the cost; the multiplier there is not.
        """
        n, points = self.layout.n_x, self.points
        D, weights = self.rule.state.differentiation[:-1], self.rule.weights
        found = multipliers[self.rows.indices].reshape(-1, len(weights), n)
        ends = np.einsum("j,kjx->kx", weights * D[:, -1], found)
        own = points.rows[:, 0]
        nu = np.where(own >= 0, multipliers[own], 0.0) + points.weights[:, 0]
        z = np.array(points.gather[: points.function.size1_in(0), :] @ w)
        gradient = np.array(points.local.gradient(z, points.parameters[:, 0], nu)).ravel()
        start = gradient[self.layout.shared :][:n] - (weights * D[:, 0]) @ found[0]
        found[:, 0] = np.vstack([start, ends[:-1]])
        return np.vstack([found.reshape(-1, n), ends[-1:]])


def _places(layout: Layout, degree: int) -> Indices:
    """Return the unknowns that are states at the points and the end, (N, D+1, n_x)."""
    k = np.arange(layout.cells)
    own = layout.cell(k).reshape(layout.cells, degree - 1, layout.n_x)
    return np.concatenate([layout.node(k)[:, None], own, layout.node(k + 1)[:, None]], axis=1)


def _point_function(model: Model, layout: Layout) -> ca.Function:
    """Return what happens in one point: (z, [τ; w h]) ↦ w h T [f; integrands] and path values."""
    import casadi as ca

    shared, t0, tf, p = shared_symbols(model, layout)
    x, u = ca.SX.sym("x", model.n_x), ca.SX.sym("u", model.n_u)
    theta = ca.SX.sym("theta", 2)
    t = t0 + (tf - t0) * theta[0]
    xdot, integrands = model.right_hand_side(x, u, p, t)
    share = (tf - t0) * theta[1]
    values = [model.function(constraint)(x, u, p, t) for constraint in model.constraints.path]
    y = ca.vertcat(share * xdot, share * integrands, *values)
    return ca.Function("point", [ca.vertcat(shared, x, u), theta], [ca.cse(y)])


def _add_points(
    program: Program,
    method: Collocation,
    function: ca.Function,
    dynamics: Rows,
    places: Indices,
    path_points: PathPoints | None,
) -> Term:
    """Add what is nonlinear: slopes, integrals, path constraints."""
    model, layout, mesh = program.model, program.layout, method.mesh
    count, n_x = mesh.cells * method.degree, layout.n_x
    rows = [dynamics.indices, np.full((count, 1), NOWHERE)]
    rows += [np.full((count, 1), row) for row in program.add_integrals()]
    rows += [_path_rows(program, method, c, path_points) for c in model.constraints.path]
    stacked = np.hstack(rows).T
    weights = np.zeros(stacked.shape)
    weights[n_x] = 0.0 if model.lagrange.is_zero() else 1.0
    shares = (mesh.steps[:, None] * method.rule.weights).ravel()
    gather = Gather(layout.shared + n_x + layout.n_u, count)
    gather.take(np.arange(layout.shared), np.tile(np.arange(layout.shared), (count, 1)))
    gather.take(layout.shared + np.arange(n_x), places[:, :-1].reshape(count, n_x))
    coefficients = layout.coefficient(np.arange(count)[:, None], np.arange(layout.n_u))
    gather.take(layout.shared + n_x + np.arange(layout.n_u), coefficients)
    parameters = np.vstack([dynamics.fractions, shares])
    term = Term(function, gather.matrix(program.unit), parameters, stacked, weights)
    program.terms.append(term)
    return term


def _path_rows(
    program: Program, method: Collocation, constraint: Constraint, path_points: PathPoints | None
) -> Indices:
    """Add the rows of a path constraint; return them, (N D, rows), or nowhere.

    At the final time there is no control: only constraints of states alone hold there.
    """
    everywhere = path_points != "nodes" or constraint.determines_control
    offsets = method.offsets if everywhere else method.offsets[:1]
    at_end = not constraint.uses_control
    fractions = method.mesh.at(*method.mesh.points(offsets))
    released = np.zeros(len(fractions) + at_end, dtype=bool)
    settled = program.settled(constraint)
    released[0] = settled[0]
    released[-1] |= at_end and settled[1]
    block = program.book.add(
        f"path constraint {constraint.name}",
        constraint.labels,
        np.append(fractions, [1.0] * at_end),
        (constraint.bounds.lower, constraint.bounds.upper),
        program.scale_of(constraint),
        released,
    )
    if at_end:
        add_point(program, (constraint,), method.mesh.cells, block.indices[-1])
    rows = np.full((method.mesh.cells, method.degree, len(constraint.labels)), NOWHERE)
    rows[:, : len(offsets)] = block.indices[: len(fractions)].reshape(
        method.mesh.cells, len(offsets), -1
    )
    return rows.reshape(-1, len(constraint.labels))


def _add_differences(program: Program, rule: Radau, rows: Rows, places: Indices) -> None:
    """Add −w_i Σ_j D_ij x_j to the rows of the dynamics."""
    import casadi as ca

    cells, points, n_x = places.shape[0], places.shape[1] - 1, places.shape[2]
    weights = -rule.weights[:, None] * rule.state.differentiation[:-1]
    columns = np.repeat(places.transpose(0, 2, 1), points, axis=0)
    entries = np.tile(np.repeat(weights[:, None, :], n_x, axis=1), (cells, 1, 1))
    gather = Gather(n_x, cells * points)
    gather.combine(np.arange(n_x), columns, entries)
    z = ca.SX.sym("z", n_x)
    function = ca.Function("differences", [z, ca.SX.sym("theta", 0)], [z])
    nothing = np.zeros((n_x, cells * points))
    S = gather.matrix(program.unit)
    term = Term(function, S, np.zeros((0, cells * points)), rows.indices.T, nothing)
    program.terms.append(term)
