"""The local function of a control cell: R substeps of a scheme, its inputs and offsets.

    z = [ shared | x_k | x_{k+1} | own unknowns of the cell | û at the offsets, one after another ]
    θ = [ τ_k | τ_{k+1} − τ_k ]
    y = [ residuals, the defect first for explicit schemes | quadrature of the Lagrange cost ]

Explicit schemes compose their substeps inside, so that the NLP does not grow; implicit ones have
the states between substeps, and their stages, as unknowns of the cell.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.problem.model import Model
from quito_cli.transcription.control import ControlBasis
from quito_cli.transcription.layout import Layout
from quito_cli.transcription.mesh import Mesh
from quito_cli.transcription.schemes import Scheme

if TYPE_CHECKING:
    import casadi as ca

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Discretization:
    """What a continuous problem is made finite with."""

    mesh: Mesh
    basis: ControlBasis
    scheme: Scheme
    substeps: int
    """R: steps of the scheme in each cell."""

    @property
    def own_vectors(self) -> int:
        """Vectors of the state's size that a cell adds to the unknowns."""
        own = self.substeps - 1 + self.substeps * self.scheme.own
        return 0 if self.scheme.explicit else own

    @property
    def offsets(self) -> Array:
        """Offsets in the cell at which û is needed, increasing: (j + c_i)/R."""
        steps = range(self.substeps)
        places = [(j + c) / self.substeps for j in steps for c in self.scheme.offsets]
        return np.unique(np.round(places, 14))

    def layout(self, model: Model) -> Layout:
        """Return where the unknowns of `model` stand."""
        return Layout.of(model, self.mesh.cells, self.own_vectors, self.basis.count)


@dataclass(frozen=True)
class CellFunctions:
    """What happens in one cell, symbolically."""

    terms: ca.Function
    """(z, θ) ↦ y."""
    inner: ca.Function
    """(z, θ) ↦ states at the ends of the substeps, (n_x, R+1)."""
    residuals: int
    """Length of y without the quadrature."""


@dataclass(frozen=True)
class _Symbols:
    """The parts of z and θ, by name."""

    z: ca.SX
    theta: ca.SX
    t0: ca.SX
    tf: ca.SX
    p: ca.SX
    x0: ca.SX
    x1: ca.SX
    own: list[ca.SX]
    controls: list[ca.SX]


def shared_symbols(model: Model, layout: Layout) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
    """Return the shared part of z, and t₀, t_f (numbers where fixed) and p in terms of it."""
    import casadi as ca

    shared = ca.SX.sym("shared", layout.shared)
    free = iter(range(layout.shared))
    t0 = shared[next(free)] if layout.free_initial_time else ca.SX(model.initial_time.lower)
    tf = shared[next(free)] if layout.free_final_time else ca.SX(model.final_time.lower)
    return shared, t0, tf, shared[layout.shared - layout.n_p :]


def _symbols(model: Model, layout: Layout, offsets: int) -> _Symbols:
    import casadi as ca

    shared, t0, tf, p = shared_symbols(model, layout)
    x0, x1 = ca.SX.sym("x0", model.n_x), ca.SX.sym("x1", model.n_x)
    own = [ca.SX.sym(f"own{i}", model.n_x) for i in range(layout.own)]
    controls = [ca.SX.sym(f"u{i}", model.n_u) for i in range(offsets)]
    z = ca.vertcat(shared, x0, x1, *own, *controls)
    return _Symbols(z, ca.SX.sym("theta", 2), t0, tf, p, x0, x1, own, controls)


def cell_functions(model: Model, method: Discretization) -> CellFunctions:
    """Return the functions of a cell."""
    import casadi as ca

    scheme, substeps, offsets = method.scheme, method.substeps, method.offsets
    s = _symbols(model, method.layout(model), len(offsets))
    horizon = s.tf - s.t0
    h = horizon * s.theta[1] / substeps
    start = s.t0 + horizon * s.theta[0]

    def f(x: ca.SX, u: ca.SX, t: ca.SX) -> tuple[ca.SX, ca.SX]:
        xdot, cost = model.right_hand_side(x, u, s.p, t)
        return xdot, cost

    x, cost = s.x0, ca.SX(0)
    ends, residuals = [x], []
    for j in range(substeps):
        u = [s.controls[int(np.argmin(abs(offsets - (j + c) / substeps)))] for c in scheme.offsets]
        if scheme.explicit:
            x, q = scheme.residual(f, x, ca.SX.zeros(model.n_x), [], u, start + j * h, h)
        else:
            after = s.x1 if j == substeps - 1 else s.own[j]
            first = substeps - 1 + j * scheme.own
            stages = s.own[first : first + scheme.own]
            residual, q = scheme.residual(f, x, after, stages, u, start + j * h, h)
            residuals.append(residual)
            x = after
        cost += q
        ends.append(x)
    if scheme.explicit:
        residuals.append(x - s.x1)
    stacked = ca.vertcat(*residuals)
    return CellFunctions(
        ca.Function("cell", [s.z, s.theta], [ca.cse(ca.vertcat(stacked, cost))]),
        ca.Function("inner", [s.z, s.theta], [ca.horzcat(*ends)]),
        stacked.numel(),
    )
