"""The terms of the nonlinear program: cells, ends, points in time, bounds on û.

Each gathers its inputs z from the unknowns and says which row, or the objective, an output adds to.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from quito_cli.problem.model import Bounds, Constraint, Instant, Model, labels
from quito_cli.transcription.cells import (
    CellFunctions,
    Discretization,
    PathOutput,
    shared_symbols,
)
from quito_cli.transcription.control import ControlBasis
from quito_cli.transcription.guess import Guess
from quito_cli.transcription.layout import Layout
from quito_cli.transcription.rows import RowBook, Rows
from quito_cli.transcription.scaling import constraint_scale
from quito_cli.transcription.terms import NOWHERE, Gather, Term

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

SHORTEST = 1e-6
"""Least length of a free horizon, as a fraction of the guessed one."""


class Program:
    """A nonlinear program being put together."""

    def __init__(
        self,
        model: Model,
        method: Discretization,
        layout: Layout,
        guess: Guess,
        unit: Array,
    ) -> None:
        self.model, self.method, self.layout = model, method, layout
        self.guess, self.unit = guess, unit
        self.terms: list[Term] = []
        self.book = RowBook()

    def scale_of(self, constraint: Constraint) -> Array:
        """Return what the rows of a constraint are multiplied by."""
        return constraint_scale(self.model, constraint, self.guess)


def add_cells(program: Program, cell: CellFunctions, defect_scale: Array) -> Term:
    """Add defects, integrals and path constraints; return the term of the cells."""
    model, mesh = program.model, program.method.mesh
    vectors = cell.residuals // model.n_x
    ends = np.arange(1, vectors + 1) / vectors
    fractions = (mesh.fractions[:-1, None] + mesh.steps[:, None] * ends).ravel()
    zero = np.zeros(model.n_x)
    names = labels(model.states)
    defects = program.book.add("dynamics", names, fractions, (zero, zero), defect_scale)
    rows = [defects.indices.reshape(mesh.cells, cell.residuals)]
    rows.append(np.full((mesh.cells, 1), NOWHERE))
    for constraint in model.constraints.integral:
        where = np.array([1.0])
        block = program.book.add(
            f"integral constraint {constraint.name}",
            constraint.labels,
            where,
            (constraint.bounds.lower, constraint.bounds.upper),
            program.scale_of(constraint),
        )
        rows.append(np.full((mesh.cells, 1), block.first))
    path = [_path_rows(program, output) for output in cell.path]
    rows += [block.indices[:-1].reshape(mesh.cells, -1) for block in path]
    stacked = np.hstack(rows).T
    weights = np.zeros(stacked.shape)
    weights[cell.residuals] = 0.0 if model.lagrange.is_zero() else 1.0
    parameters = np.vstack([mesh.fractions[:-1], mesh.steps])
    S = _cell_gather(program).matrix(program.unit)
    term = Term(cell.terms, S, parameters, stacked, weights)
    program.terms.append(term)
    if path:
        last = [block.indices[-1] for block in path]
        _add_point(program, model.constraints.path, mesh.cells, np.concatenate(last))
    return term


def _path_rows(program: Program, output: PathOutput) -> Rows:
    """Return the rows of a path constraint: its places in every cell, and the final time."""
    constraint, model, method = output.constraint, program.model, program.method
    offsets = method.offsets[list(output.places)]
    cells, places = method.mesh.points(offsets)
    inside = method.mesh.fractions[cells] + places * method.mesh.steps[cells]
    released = np.zeros(len(inside) + 1, dtype=bool)
    if constraint.determines_control:
        ghosts = method.basis.ghosts
        end_cells = (cells < ghosts) | (cells >= method.mesh.cells - ghosts)
        released[:-1] = (places > 0) & ~end_cells
        released[-1] = method.basis.function.cellwise  # the last cell has held to it already
    released[0] |= _settled(model, constraint, model.initial, model.initial_time)
    released[-1] |= _settled(model, constraint, model.final, model.final_time)
    return program.book.add(
        f"path constraint {constraint.name}",
        constraint.labels,
        np.append(inside, 1.0),
        (constraint.bounds.lower, constraint.bounds.upper),
        program.scale_of(constraint),
        released,
    )


def _settled(model: Model, constraint: Constraint, fixed: Bounds, instant: Instant) -> bool:
    """Whether a constraint holds at an end because all that it speaks of is fixed there.

    Then it says nothing to the solver but that it is singular.
    """
    import casadi as ca

    unknowns = [model.u, model.p] + ([] if instant.fixed else [model.t])
    if ca.depends_on(constraint.value, ca.vertcat(*unknowns)):
        return False
    pattern = ca.jacobian_sparsity(constraint.value, model.x)
    used = np.unique(np.array(pattern.get_triplet()[1], dtype=np.int64))
    if not fixed.fixed[used].all():
        return False
    x = np.where(fixed.fixed, fixed.lower, 0.0)
    zeros = np.zeros(model.n_u), np.zeros(model.n_p)
    value = np.array(model.function(constraint)(x, *zeros, instant.guess)).ravel()
    lower, upper = constraint.bounds
    room = 1e-12 * (1 + np.abs(value))
    return bool(np.all((value >= lower - room) & (value <= upper + room)))


def _cell_gather(program: Program) -> Gather:
    """Return S of the cells: see `cells` for the order of z."""
    method, layout = program.method, program.layout
    mesh, offsets, n_u = method.mesh, method.offsets, layout.n_u
    k, shared = np.arange(mesh.cells), layout.shared
    own = layout.own * layout.n_x
    gather = Gather(shared + 2 * layout.n_x + own + len(offsets) * n_u, mesh.cells)
    at = 0
    for columns in (
        np.tile(np.arange(shared), (mesh.cells, 1)),
        layout.node(k),
        layout.node(k + 1),
        layout.cell(k),
    ):
        gather.take(at + np.arange(columns.shape[1]), columns)
        at += columns.shape[1]
    _gather_control(program, gather, at, *mesh.points(offsets))
    return gather


def _gather_control(
    program: Program, gather: Gather, at: int, cells: Indices, offsets: Array
) -> None:
    """Let û at points, `len(cells) / gather.count` of them a place, be entries of z from `at`."""
    layout, each = program.layout, len(cells) // gather.count
    indices, weights = program.method.basis.weights(cells, offsets)
    shape = (gather.count, each, indices.shape[1])
    for i in range(layout.n_u):
        columns = layout.coefficient(indices, i).reshape(shape)
        inputs = at + np.arange(each) * layout.n_u + i
        gather.combine(inputs, columns, weights.reshape(shape))


def add_ends(program: Program) -> None:
    """Add Mayer cost, boundary constraints, the order of free times: z = [shared, x_0, x_N]."""
    import casadi as ca

    model, layout = program.model, program.layout
    shared, t0, tf, p = shared_symbols(model, layout)
    x0, xf = ca.SX.sym("x0", model.n_x), ca.SX.sym("xf", model.n_x)
    values = [model.end_cost(x0, t0, xf, tf, p), model.boundary_values(x0, t0, xf, tf, p)[0]]
    rows: list[Indices] = [np.array([NOWHERE])]
    for constraint in model.constraints.boundary:
        bounds = constraint.bounds.lower, constraint.bounds.upper
        block = program.book.add(
            f"boundary constraint {constraint.name}",
            constraint.labels,
            np.array([1.0]),
            bounds,
            program.scale_of(constraint),
        )
        rows.append(block.indices.ravel())
    first, last = model.initial_time, model.final_time
    if last.lower <= first.upper and not (first.fixed and last.fixed):
        least = np.array([SHORTEST * (last.guess - first.guess)])
        bounds = least, np.array([np.inf])
        values.append(tf - t0)
        rows.append(
            program.book.add("horizon", ("its length",), np.array([1.0]), bounds).indices[0]
        )
    stacked = np.concatenate(rows)[:, None]
    if model.mayer.is_zero() and len(stacked) == 1:
        return
    z = ca.vertcat(shared, x0, xf)
    gather = Gather(z.numel(), 1)
    gather.take(np.arange(layout.shared), np.arange(layout.shared)[None, :])
    ends = np.array([[0, layout.cells]])
    gather.take(layout.shared + np.arange(2 * model.n_x), layout.node(ends).reshape(1, -1))
    function = ca.Function("ends", [z, ca.SX.sym("theta", 0)], [ca.cse(ca.vertcat(*values))])
    weights = np.zeros(stacked.shape)
    weights[0] = 0.0 if model.mayer.is_zero() else 1.0
    S = gather.matrix(program.unit)
    program.terms.append(Term(function, S, np.zeros((0, 1)), stacked, weights))


def add_points(program: Program) -> None:
    """Add the constraints at given times; the mesh has a node at each."""
    mesh = program.method.mesh
    for constraint in program.model.constraints.point:
        assert constraint.at is not None
        node = int(np.argmin(np.abs(mesh.fractions - constraint.at)))
        block = program.book.add(
            f"point constraint {constraint.name}",
            constraint.labels,
            mesh.fractions[[node]],
            (constraint.bounds.lower, constraint.bounds.upper),
            program.scale_of(constraint),
        )
        _add_point(program, (constraint,), node, block.indices.ravel())


def _add_point(
    program: Program, constraints: Sequence[Constraint], node: int, rows: Indices
) -> None:
    """Add constraints at one node: z = [shared, x, û]."""
    import casadi as ca

    model, layout, mesh = program.model, program.layout, program.method.mesh
    shared, t0, tf, p = shared_symbols(model, layout)
    x, u = ca.SX.sym("x", model.n_x), ca.SX.sym("u", model.n_u)
    theta = ca.SX.sym("theta", 1)
    t = t0 + (tf - t0) * theta
    values = [model.function(constraint)(x, u, p, t) for constraint in constraints]
    z = ca.vertcat(shared, x, u)
    gather = Gather(z.numel(), 1)
    gather.take(np.arange(layout.shared), np.arange(layout.shared)[None, :])
    gather.take(layout.shared + np.arange(model.n_x), layout.node(np.array([node])))
    cell = min(node, mesh.cells - 1)
    place = np.array([float(node - cell)])
    _gather_control(program, gather, layout.shared + model.n_x, np.array([cell]), place)
    function = ca.Function("point", [z, theta], [ca.vertcat(*values)])
    weights = np.zeros((len(rows), 1))
    S = gather.matrix(program.unit)
    program.terms.append(Term(function, S, mesh.fractions[[[node]]], rows[:, None], weights))


def bounded_by_coefficients(model: Model, basis: ControlBasis) -> NDArray[np.bool_]:
    """Return which controls are bounded by bounding their coefficients, (n_u,).

    Those of a convex basis, but for one that an equality determines: it may have to leave its bound
    at once, which coefficients within bounds cannot follow. Of any normalised basis, those that
    are fixed.
    """
    convex = basis.convex & ~model.determined_controls
    return np.asarray(convex | (basis.normalised & model.control_bounds.fixed))


def add_control_rows(program: Program) -> None:
    """Bound û itself at the nodes and all offsets, for bases whose coefficients bound nothing."""
    import casadi as ca

    model, mesh, offsets = program.model, program.method.mesh, program.method.offsets
    lower, upper = model.control_bounds
    limited = np.isfinite(lower) | np.isfinite(upper)
    (bounded,) = np.nonzero(limited & ~bounded_by_coefficients(model, program.method.basis))
    if not bounded.size:
        return
    cells, places = mesh.points(offsets[offsets < 1])
    cells, places = np.append(cells, mesh.cells - 1), np.append(places, 1.0)
    names = tuple(labels(model.controls)[i] for i in bounded)
    fractions = mesh.fractions[cells] + places * mesh.steps[cells]
    block = program.book.add("control bounds", names, fractions, (lower[bounded], upper[bounded]))
    indices, weights = program.method.basis.weights(cells, places)
    gather = Gather(len(names), len(cells))
    for i, control in enumerate(bounded):
        columns = program.layout.coefficient(indices, int(control))
        gather.combine(np.array([i]), columns[:, None, :], weights[:, None, :])
    z = ca.SX.sym("z", len(names))
    function = ca.Function("control", [z, ca.SX.sym("theta", 0)], [z])
    none = np.zeros((len(names), len(cells)))
    S = gather.matrix(program.unit)
    program.terms.append(Term(function, S, np.zeros((0, len(cells))), block.indices.T, none))
