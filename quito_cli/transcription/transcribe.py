"""Model -> Nlp: which terms there are, and the bounds and guess of every unknown."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.problem.model import Model, labels
from quito_cli.transcription.cells import (
    CellFunctions,
    Discretization,
    cell_functions,
    shared_symbols,
)
from quito_cli.transcription.guess import initial_guess
from quito_cli.transcription.layout import Layout
from quito_cli.transcription.terms import NOWHERE, Assembled, Gather, Term, assemble

if TYPE_CHECKING:
    import casadi as ca

Array = NDArray[np.float64]

COST_SIZE = 100.0
"""What the objective is scaled to: at size one singular problems end with an unresolved control."""


@dataclass(frozen=True)
class Rows:
    """A block of constraint rows, for people: `labels` vary fastest, then places."""

    name: str
    labels: tuple[str, ...]
    first: int
    fractions: Array
    """Where in the horizon each place is, (places,)."""
    lower: Array
    """Of each label, (labels,)."""
    upper: Array
    """Of each label, (labels,)."""

    @property
    def count(self) -> int:
        """Number of rows."""
        return len(self.labels) * len(self.fractions)

    @property
    def rows(self) -> slice:
        """Its place among all rows."""
        return slice(self.first, self.first + self.count)

    @property
    def indices(self) -> NDArray[np.int64]:
        """Index of each row, (labels, places)."""
        indices = self.first + np.arange(self.count)
        return indices.reshape(len(self.fractions), len(self.labels)).T


@dataclass(frozen=True)
class Transcription:
    """How a Model was made finite; what reads an answer back from the unknowns."""

    model: Model
    method: Discretization
    layout: Layout
    cell: CellFunctions
    cell_gather: ca.DM
    """S of the cell term."""
    cell_parameters: Array
    """θ of the cell term, (2, N)."""


@dataclass(frozen=True)
class Nlp:
    """Minimise objective subject to bounds on unknowns and rows."""

    assembled: Assembled
    lower: Array
    upper: Array
    guess: Array
    row_lower: Array
    row_upper: Array
    blocks: tuple[Rows, ...]
    objective_scale: float
    """objective = scale · cost (of the minimisation)."""
    transcription: Transcription


def transcribe(model: Model, method: Discretization, objective_scale: float | None) -> Nlp:
    """Return the nonlinear program of `model`.

    Args:
        model: the problem.
        method: mesh, control and scheme.
        objective_scale: factor of the cost; None scales by its size at the guess.
    """
    layout, cell = method.layout(model), cell_functions(model, method)
    lower, upper = _bounds(model, method, layout)
    guess = np.clip(initial_guess(model, method.mesh, method.basis, layout), lower, upper)
    cells, dynamics = _cell_term(model, method, layout, cell)
    terms, blocks = [cells], [dynamics]
    if not model.mayer.is_zero():
        terms.append(_end_term(model, layout))
    bounded = np.isfinite(model.control_bounds.lower) | np.isfinite(model.control_bounds.upper)
    if bounded.any() and not method.basis.convex:
        term, block = _control_rows(model, method, layout, bounded, dynamics.count)
        terms.append(term)
        blocks.append(block)
    scale = objective_scale or COST_SIZE / max(1.0, _cost_at(terms, guess))
    terms = [replace(term, weights=scale * term.weights) for term in terms]
    return Nlp(
        assemble(tuple(terms), layout.size, sum(block.count for block in blocks)),
        lower,
        upper,
        guess,
        np.concatenate([np.tile(block.lower, len(block.fractions)) for block in blocks]),
        np.concatenate([np.tile(block.upper, len(block.fractions)) for block in blocks]),
        tuple(blocks),
        scale,
        Transcription(model, method, layout, cell, cells.gather, cells.parameters),
    )


def _cell_term(
    model: Model, method: Discretization, layout: Layout, cell: CellFunctions
) -> tuple[Term, Rows]:
    """Return defects and Lagrange cost."""
    mesh, n_x = method.mesh, model.n_x
    vectors = cell.residuals // n_x
    ends = np.arange(1, vectors + 1) / vectors
    fractions = (mesh.fractions[:-1, None] + mesh.steps[:, None] * ends).ravel()
    block = Rows("dynamics", labels(model.states), 0, fractions, np.zeros(n_x), np.zeros(n_x))
    rows = block.indices.T.reshape(mesh.cells, cell.residuals).T
    in_cost = np.zeros((cell.residuals + 1, mesh.cells))
    in_cost[-1] = 0.0 if model.lagrange.is_zero() else 1.0
    term = Term(
        cell.terms,
        _cell_gather(model, method, layout).matrix(layout.size),
        np.vstack([mesh.fractions[:-1], mesh.steps]),
        np.vstack([rows, np.full((1, mesh.cells), NOWHERE)]),
        in_cost,
    )
    return term, block


def _cell_gather(model: Model, method: Discretization, layout: Layout) -> Gather:
    """Return S of the cells: see `cells` for the order of z."""
    mesh, offsets, n_x, n_u = method.mesh, method.offsets, model.n_x, model.n_u
    k, own, shared = np.arange(mesh.cells), layout.own * n_x, layout.shared
    gather = Gather(shared + 2 * n_x + own + len(offsets) * n_u, mesh.cells)
    at = 0
    for columns in (
        np.tile(np.arange(shared), (mesh.cells, 1)),
        layout.node(k),
        layout.node(k + 1),
        layout.cell(k),
    ):
        gather.take(at + np.arange(columns.shape[1]), columns)
        at += columns.shape[1]
    indices, weights = method.basis.weights(*mesh.points(offsets))
    shape = (mesh.cells, len(offsets), -1)
    for i in range(n_u):
        columns = layout.coefficient(indices, i).reshape(shape)
        gather.combine(at + np.arange(len(offsets)) * n_u + i, columns, weights.reshape(shape))
    return gather


def _end_term(model: Model, layout: Layout) -> Term:
    """Return the Mayer cost: z = [shared | x_0 | x_N]."""
    import casadi as ca

    shared, t0, tf, p = shared_symbols(model, layout)
    x0, xf = ca.SX.sym("x0", model.n_x), ca.SX.sym("xf", model.n_x)
    cost = model.end_cost(x0, t0, xf, tf, p)
    z = ca.vertcat(shared, x0, xf)
    gather = Gather(z.numel(), 1)
    gather.take(np.arange(layout.shared), np.arange(layout.shared)[None, :])
    ends = np.array([[0, layout.cells]])
    gather.take(layout.shared + np.arange(2 * model.n_x), layout.node(ends).reshape(1, -1))
    function = ca.Function("end", [z, ca.SX.sym("theta", 0)], [cost])
    S = gather.matrix(layout.size)
    return Term(function, S, np.zeros((0, 1)), np.array([[NOWHERE]]), np.array([[1.0]]))


def _control_rows(
    model: Model,
    method: Discretization,
    layout: Layout,
    bounded: NDArray[np.bool_],
    first: int,
) -> tuple[Term, Rows]:
    """Return û itself at the nodes and all offsets, for bases whose coefficients bound nothing."""
    import casadi as ca

    mesh, offsets = method.mesh, method.offsets
    cells, places = mesh.points(offsets[offsets < 1])
    cells, places = np.append(cells, mesh.cells - 1), np.append(places, 1.0)
    names = tuple(np.array(labels(model.controls))[bounded].tolist())
    fractions = mesh.fractions[cells] + places * mesh.steps[cells]
    lower, upper = model.control_bounds
    block = Rows("control bounds", names, first, fractions, lower[bounded], upper[bounded])
    indices, weights = method.basis.weights(cells, places)
    gather = Gather(len(names), len(cells))
    for i, control in enumerate(np.nonzero(bounded)[0]):
        columns = layout.coefficient(indices, int(control))
        gather.combine(np.array([i]), columns[:, None, :], weights[:, None, :])
    z = ca.SX.sym("z", len(names))
    function = ca.Function("control", [z, ca.SX.sym("theta", 0)], [z])
    weights_in_cost = np.zeros((len(names), len(cells)))
    S = gather.matrix(layout.size)
    return Term(function, S, np.zeros((0, len(cells))), block.indices, weights_in_cost), block


def _bounds(model: Model, method: Discretization, layout: Layout) -> tuple[Array, Array]:
    """Return bounds of all unknowns."""
    basis, sides = method.basis, []
    for side, infinity in enumerate((-np.inf, np.inf)):
        instants = (model.initial_time, model.final_time)
        shared = [(i.lower, i.upper)[side] for i in instants if not i.fixed]
        nodes = np.tile(list(model.state_bounds)[side], (layout.cells + 1, 1))
        nodes[0], nodes[-1] = list(model.initial)[side], list(model.final)[side]
        inner = np.full(layout.cells * layout.own * layout.n_x, infinity)
        control = list(model.control_bounds)[side]
        coefficient = control if basis.convex else np.full(layout.n_u, infinity)
        parts = [shared, list(model.parameter_bounds)[side], nodes.ravel(), inner]
        sides.append(np.concatenate([*parts, np.tile(coefficient, basis.count)]))
    return sides[0], sides[1]


def _cost_at(terms: list[Term], w: Array) -> float:
    """Return the size of the cost at `w`; 0 where it is not finite."""
    total = 0.0
    for term in terms:
        if term.in_objective:
            z = np.array(term.gather @ w).reshape(term.count, -1).T
            y = np.array(term.function.map(term.count)(z, term.parameters))
            total += float((term.weights * y).sum())
    return abs(total) if np.isfinite(total) else 0.0
