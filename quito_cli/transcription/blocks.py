"""The terms of the nonlinear program that are the same for every method: ends, points in time,
bounds on û.

Each gathers its inputs z from the unknowns and says which row, or the objective, an output adds to.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from quito_cli.problem.model import Constraint, Model, labels
from quito_cli.transcription.control import Basis
from quito_cli.transcription.program import Program, shared_symbols
from quito_cli.transcription.terms import NOWHERE, Gather, Term

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

SHORTEST = 1e-6
"""Least length of a free horizon, as a fraction of the guessed one."""


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
        add_point(program, (constraint,), node, block.indices.ravel())


def add_point(
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
    program.gather_control(gather, layout.shared + model.n_x, np.array([cell]), place)
    function = ca.Function("point", [z, theta], [ca.vertcat(*values)])
    weights = np.zeros((len(rows), 1))
    S = gather.matrix(program.unit)
    program.terms.append(Term(function, S, mesh.fractions[[[node]]], rows[:, None], weights))


def bounded_by_coefficients(model: Model, basis: Basis) -> NDArray[np.bool_]:
    """Return which controls are bounded by bounding their coefficients, (n_u,)."""
    return basis.bounded(model.determined_controls, model.control_bounds.fixed)


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
    fractions = mesh.at(cells, places)
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
