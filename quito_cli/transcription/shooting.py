"""The terms of multiple shooting: one for all cells, and path constraints at the final time.

The cells' function is made in `cells`. Its rows are the defects, F(x_k, …) − x_{k+1} and what an
implicit scheme has besides; then come the integrals' and the path constraints'.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.problem.model import labels
from quito_cli.transcription.blocks import add_point
from quito_cli.transcription.layout import Layout
from quito_cli.transcription.program import Program
from quito_cli.transcription.rows import Rows
from quito_cli.transcription.terms import NOWHERE, Gather, Term

if TYPE_CHECKING:
    from quito_cli.transcription.cells import CellFunctions, Discretization, PathOutput

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Shooting:
    """The cells in a program, and what an answer says by them."""

    cell: CellFunctions
    cells: Term
    layout: Layout

    @property
    def terms(self) -> tuple[Term, ...]:
        """Along the horizon, the cost unscaled."""
        return (self.cells,)

    def states(self, w: Array) -> tuple[Array, Array]:
        """Return the states just after and just before the ends of the substeps, (M, n_x) each."""
        N, n = self.cells.count, self.layout.n_x
        z = np.array(self.cells.gather @ w).reshape(N, -1).T
        inner = np.array(self.cell.inner.map(N)(z, self.cells.parameters)).T.reshape(N, -1, n)
        return inner[:, :-1].reshape(-1, n), inner[:, 1:].reshape(-1, n)

    def costates(self, w: Array, multipliers: Array) -> Array:
        """Return λ at the nodes: what the cost that remains gains by a change of the state.

        At the end of a cell that is −∂/∂x_{k+1} of the cell's part of the Lagrangian, for an
        explicit scheme the multiplier of its defect; at the start of the horizon +∂/∂x_0 of the
        first cell's. Where a condition holds at the node itself it is the value just before it.
        """
        cells = self.cells
        nu = np.where(cells.rows >= 0, multipliers[cells.rows], 0.0) + cells.weights
        z = np.array(cells.gather @ w).reshape(cells.count, -1).T
        gradient = np.array(cells.local.gradient.map(cells.count)(z, cells.parameters, nu))
        first, n = self.layout.shared, self.layout.n_x
        return np.vstack(
            [gradient[first : first + n, :1].T, -gradient[first + n : first + 2 * n].T]
        )


def add_cells(program: Program, method: Discretization, cell: CellFunctions) -> Shooting:
    """Add defects, integrals and path constraints."""
    model, mesh = program.model, method.mesh
    vectors = cell.residuals // model.n_x
    ends = np.arange(1, vectors + 1) / vectors
    fractions = (mesh.fractions[:-1, None] + mesh.steps[:, None] * ends).ravel()
    zero = np.zeros(model.n_x)
    names = labels(model.states)
    defects = program.book.add("dynamics", names, fractions, (zero, zero), 1 / program.state_unit)
    rows = [defects.indices.reshape(mesh.cells, cell.residuals)]
    rows.append(np.full((mesh.cells, 1), NOWHERE))
    rows += [np.full((mesh.cells, 1), row) for row in program.add_integrals()]
    path = [_path_rows(program, method, output) for output in cell.path]
    rows += [block.indices[:-1].reshape(mesh.cells, -1) for block in path]
    stacked = np.hstack(rows).T
    weights = np.zeros(stacked.shape)
    weights[cell.residuals] = 0.0 if model.lagrange.is_zero() else 1.0
    parameters = np.vstack([mesh.fractions[:-1], mesh.steps])
    S = _cell_gather(program, method).matrix(program.unit)
    term = Term(cell.terms, S, parameters, stacked, weights)
    program.terms.append(term)
    if path:
        last = [block.indices[-1] for block in path]
        add_point(program, model.constraints.path, mesh.cells, np.concatenate(last))
    return Shooting(cell, term, program.layout)


def _path_rows(program: Program, method: Discretization, output: PathOutput) -> Rows:
    """Return the rows of a path constraint: its places in every cell, and the final time."""
    constraint = output.constraint
    offsets = method.offsets[list(output.places)]
    cells, places = method.mesh.points(offsets)
    inside = method.mesh.at(cells, places)
    released = np.zeros(len(inside) + 1, dtype=bool)
    if constraint.determines_control:
        ghosts = method.basis.ghosts
        end_cells = (cells < ghosts) | (cells >= method.mesh.cells - ghosts)
        released[:-1] = (places > 0) & ~end_cells
        released[-1] = method.basis.function.cellwise  # the last cell has held to it already
    released[[0, -1]] |= program.settled(constraint)
    return program.book.add(
        f"path constraint {constraint.name}",
        constraint.labels,
        np.append(inside, 1.0),
        (constraint.bounds.lower, constraint.bounds.upper),
        program.scale_of(constraint),
        released,
    )


def _cell_gather(program: Program, method: Discretization) -> Gather:
    """Return S of the cells: see `cells` for the order of z."""
    layout = program.layout
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
    program.gather_control(gather, at, *mesh.points(offsets))
    return gather
