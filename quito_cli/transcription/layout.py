"""Where each unknown stands.

w = [ shared: free t_0, free t_f, parameters
    | states at nodes:        x_0, …, x_N            (N+1) · n_x
    | unknowns of the cells:  own_0, …, own_{N−1}     N · own · n_x, none for explicit schemes
    | coefficients:           c_{−p}, …, c_{N+p}      count · n_u ]
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from quito_cli.problem.model import Model

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


@dataclass(frozen=True)
class Layout:
    """Index arithmetic of the unknowns."""

    free_initial_time: bool
    free_final_time: bool
    n_p: int
    n_x: int
    n_u: int
    cells: int
    own: int
    """Vectors of the state's size that a cell adds."""
    coefficients: int

    @classmethod
    def of(cls, model: Model, cells: int, own: int, coefficients: int) -> Layout:
        """Return the layout of a model on N cells."""
        return cls(
            not model.initial_time.fixed,
            not model.final_time.fixed,
            model.n_p,
            model.n_x,
            model.n_u,
            cells,
            own,
            coefficients,
        )

    @property
    def shared(self) -> int:
        """Number of free times and parameters."""
        return self.free_initial_time + self.free_final_time + self.n_p

    @property
    def first_own(self) -> int:
        """Where the unknowns of the cells start."""
        return self.shared + (self.cells + 1) * self.n_x

    @property
    def first_coefficient(self) -> int:
        """Where the coefficients start."""
        return self.first_own + self.cells * self.own * self.n_x

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.first_coefficient + self.coefficients * self.n_u

    def node(self, k: Indices) -> Indices:
        """Return the indices of the states at nodes k (any shape), a last axis of n_x."""
        return np.asarray(self.shared + k[..., None] * self.n_x + np.arange(self.n_x))

    def cell(self, k: Indices) -> Indices:
        """Return the indices of the own unknowns of cells k, a last axis of own · n_x."""
        size = self.own * self.n_x
        return np.asarray(self.first_own + k[..., None] * size + np.arange(size))

    def coefficient(self, m: Indices, control: int | Indices) -> Indices:
        """Return the indices of coefficients m of a control."""
        return np.asarray(self.first_coefficient + m * self.n_u + control)

    def states(self, w: Array) -> Array:
        """Return the states at the nodes, (N+1, n_x)."""
        return w[self.shared : self.first_own].reshape(self.cells + 1, self.n_x)

    def coefficient_table(self, w: Array) -> Array:
        """Return the coefficients, (count, n_u)."""
        return w[self.first_coefficient :].reshape(self.coefficients, self.n_u)

    def times(self, w: Array, model: Model) -> tuple[float, float]:
        """Return initial and final time."""
        free = iter(w[: self.free_initial_time + self.free_final_time])
        initial = next(free) if self.free_initial_time else model.initial_time.lower
        final = next(free) if self.free_final_time else model.final_time.lower
        return float(initial), float(final)

    def parameters(self, w: Array) -> Array:
        """Return the parameters, (n_p,)."""
        return w[self.shared - self.n_p : self.shared]
