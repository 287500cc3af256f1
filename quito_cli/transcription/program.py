"""A nonlinear program being put together: what its terms are made with."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.problem.model import Bounds, Constraint, Instant, Model
from quito_cli.transcription.guess import Guess
from quito_cli.transcription.layout import Layout
from quito_cli.transcription.method import Method
from quito_cli.transcription.rows import RowBook
from quito_cli.transcription.scaling import constraint_scale
from quito_cli.transcription.terms import Gather, Term

if TYPE_CHECKING:
    import casadi as ca

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


class Program:
    """A nonlinear program being put together."""

    def __init__(
        self,
        model: Model,
        method: Method,
        layout: Layout,
        guess: Guess,
        units: tuple[Array, Array],
    ) -> None:
        self.model, self.method, self.layout, self.guess = model, method, layout, guess
        self.unit, self.state_unit = units
        self.terms: list[Term] = []
        self.book = RowBook()

    def scale_of(self, constraint: Constraint) -> Array:
        """Return what the rows of a constraint are multiplied by."""
        return constraint_scale(self.model, constraint, self.guess)

    def add_integrals(self) -> list[int]:
        """Add a row for each integral constraint; return which."""
        blocks = [
            self.book.add(
                f"integral constraint {constraint.name}",
                constraint.labels,
                np.array([1.0]),
                (constraint.bounds.lower, constraint.bounds.upper),
                self.scale_of(constraint),
            )
            for constraint in self.model.constraints.integral
        ]
        return [block.first for block in blocks]

    def gather_control(self, gather: Gather, at: int, cells: Indices, offsets: Array) -> None:
        """Let û at points, `len(cells) / gather.count` of them a place, be entries from `at`."""
        layout, each = self.layout, len(cells) // gather.count
        indices, weights = self.method.basis.weights(cells, offsets)
        shape = (gather.count, each, indices.shape[1])
        for i in range(layout.n_u):
            columns = layout.coefficient(indices, i).reshape(shape)
            inputs = at + np.arange(each) * layout.n_u + i
            gather.combine(inputs, columns, weights.reshape(shape))

    def settled(self, constraint: Constraint) -> tuple[bool, bool]:
        """Whether a constraint holds at the start, at the end, by what is fixed there.

        Then it says nothing to the solver but that it is singular.
        """
        model = self.model
        return (
            _settled(model, constraint, model.initial, model.initial_time),
            _settled(model, constraint, model.final, model.final_time),
        )


def shared_symbols(model: Model, layout: Layout) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
    """Return the shared part of z, and t₀, t_f (numbers where fixed) and p in terms of it."""
    import casadi as ca

    shared = ca.SX.sym("shared", layout.shared)
    free = iter(range(layout.shared))
    t0 = shared[next(free)] if layout.free_initial_time else ca.SX(model.initial_time.lower)
    tf = shared[next(free)] if layout.free_final_time else ca.SX(model.final_time.lower)
    return shared, t0, tf, shared[layout.shared - layout.n_p :]


def _settled(model: Model, constraint: Constraint, fixed: Bounds, instant: Instant) -> bool:
    """Whether a constraint holds at an end because all that it speaks of is fixed there."""
    import casadi as ca

    unknowns = [model.u, model.p] + ([] if instant.fixed else [model.t])
    if ca.depends_on(constraint.value, ca.vertcat(*unknowns)):
        return False
    pattern = ca.jacobian_sparsity(constraint.value, model.x)
    used = sorted(set(pattern.get_triplet()[1]))
    if not fixed.fixed[used].all():
        return False
    x = np.where(fixed.fixed, fixed.lower, 0.0)
    zeros = np.zeros(model.n_u), np.zeros(model.n_p)
    value = np.array(model.function(constraint)(x, *zeros, instant.guess)).ravel()
    lower, upper = constraint.bounds
    room = 1e-12 * (1 + np.abs(value))
    return bool(np.all((value >= lower - room) & (value <= upper + room)))
