"""The local function of a control cell: R substeps of a scheme, its inputs and offsets.

    z = [ shared | x_k | x_{k+1} | own unknowns of the cell | û at the offsets, one after another ]
    θ = [ τ_k | τ_{k+1} − τ_k ]
    y = [ residuals | integrals: Lagrange cost, integral constraints | path constraints, by offset ]

Explicit schemes compose their substeps inside, so that the NLP does not grow; implicit ones have
the states between substeps, and their stages, as unknowns of the cell. Path constraints at offsets
inside a substep take the state there from the cubic through its ends and their slopes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from quito_cli.problem.model import Constraint, Model
from quito_cli.problem.options import PathPointsName
from quito_cli.transcription.control import ControlBasis
from quito_cli.transcription.guess import Guess
from quito_cli.transcription.hermite import hermite
from quito_cli.transcription.layout import Layout
from quito_cli.transcription.mesh import Mesh
from quito_cli.transcription.program import Program, shared_symbols
from quito_cli.transcription.schemes import Scheme, Step
from quito_cli.transcription.shooting import Shooting, add_cells

if TYPE_CHECKING:
    import casadi as ca

Array = NDArray[np.float64]
PathPoints = PathPointsName

DENSE_POINTS = 10
"""Points a cell on the grid that violations and variation are looked for on."""


@dataclass(frozen=True)
class Discretization:
    """Multiple shooting: in every cell R steps of a scheme, the control a sum of functions."""

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
        return _offsets(self.scheme, self.substeps)

    @property
    def breaks(self) -> Array:
        """Ends of the substeps, j/R."""
        return np.arange(self.substeps + 1) / self.substeps

    @property
    def interpolation(self) -> Literal["linear", "cubic"]:
        """How states go on between the ends of the substeps."""
        return self.scheme.interpolation

    @property
    def fine(self) -> Array:
        """Offsets of a grid much finer than the cells."""
        return np.arange(DENSE_POINTS) / DENSE_POINTS

    @property
    def resolved(self) -> tuple[Array, int]:
        """The offsets at which û is looked at, and how many they are.

        A staircase is no ringing: of a cellwise control the values count, not the steps.
        """
        inside = self.offsets[self.offsets < 1]
        offsets = np.array([0.5]) if self.basis.function.cellwise else inside
        return offsets, len(offsets)

    @property
    def own_are_states(self) -> bool:
        """Bounds of states hold at the nodes."""
        return False

    @property
    def sampled(self) -> Mesh:
        """Guesses are asked for at the nodes."""
        return self.mesh

    @property
    def order(self) -> int:
        """That of the scheme."""
        return self.scheme.order

    @property
    def finer(self) -> str:
        """The options that refine it."""
        return "--steps or --substeps"

    @property
    def calmer(self) -> str:
        """What is known to help where the control rings."""
        return (
            "try --path-points substeps where a constraint of states is active, more --substeps, "
            "a tighter --tolerance or a larger --variance"
        )

    def layout(self, model: Model) -> Layout:
        """Return where the unknowns of `model` stand."""
        return Layout.of(model, self.mesh.cells, self.own_vectors, self.basis.count)

    def start(self, guess: Guess, layout: Layout) -> Array:
        """Return the unknowns of a guess at the nodes: own ones start as the cell does."""
        own = np.repeat(guess.states[:-1], layout.own, axis=0)
        nodes = np.arange(len(guess.fractions))
        centres = self.basis.centres
        coefficients = [np.interp(centres, nodes, column) for column in guess.controls.T]
        table = np.array(coefficients).reshape(len(coefficients), self.basis.count).T
        return guess.stacked(layout, guess.states, own, table)

    def add_dynamics(self, program: Program, path_points: PathPoints | None) -> Shooting:
        """Add the cells to a program."""
        return add_cells(program, self, cell_functions(program.model, self, path_points))


def _offsets(scheme: Scheme, substeps: int) -> Array:
    places = [(j + c) / substeps for j in range(substeps) for c in scheme.offsets]
    return np.array(sorted(set(np.round(places, 14).tolist())))


def points_seen(scheme: Scheme, substeps: int, cells: int) -> int:
    """Return in how many points of the horizon a scheme looks at û."""
    offsets = _offsets(scheme, substeps)
    return cells * int((offsets < 1).sum()) + int(offsets[-1] == 1)


@dataclass(frozen=True)
class PathOutput:
    """A path constraint and the offsets (indices) at which a cell imposes it."""

    constraint: Constraint
    places: tuple[int, ...]


@dataclass(frozen=True)
class CellFunctions:
    """What happens in one cell, symbolically."""

    terms: ca.Function
    """(z, θ) ↦ y."""
    inner: ca.Function
    """(z, θ) ↦ states at the ends of the substeps, (n_x, R+1)."""
    residuals: int
    """Length of the residuals in y."""
    path: tuple[PathOutput, ...]
    """What follows residuals and integrals in y: by constraint, by place, by entry."""


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


def _symbols(model: Model, layout: Layout, offsets: int) -> _Symbols:
    import casadi as ca

    shared, t0, tf, p = shared_symbols(model, layout)
    x0, x1 = ca.SX.sym("x0", model.n_x), ca.SX.sym("x1", model.n_x)
    own = [ca.SX.sym(f"own{i}", model.n_x) for i in range(layout.own)]
    controls = [ca.SX.sym(f"u{i}", model.n_u) for i in range(offsets)]
    z = ca.vertcat(shared, x0, x1, *own, *controls)
    return _Symbols(z, ca.SX.sym("theta", 2), t0, tf, p, x0, x1, own, controls)


def cell_functions(
    model: Model, method: Discretization, path_points: PathPoints | None
) -> CellFunctions:
    """Return the functions of a cell.

    Args:
        model: the problem.
        method: mesh, control and scheme.
        path_points: where path constraints hold: at the nodes or at all offsets; None takes the
            offsets for inequalities with a control, the nodes for constraints of states alone, and
            for equalities with a control as many points as determine it.
    """
    import casadi as ca

    offsets = method.offsets
    s = _symbols(model, method.layout(model), len(offsets))
    ends, residuals, integrals = _integrated(model, method, s)
    path = tuple(
        PathOutput(constraint, _places(constraint, offsets, path_points))
        for constraint in model.constraints.path
    )
    values = [
        model.function(output.constraint)(*_point(model, method, s, ends, place))
        for output in path
        for place in output.places
    ]
    stacked = ca.vertcat(*residuals)
    return CellFunctions(
        ca.Function("cell", [s.z, s.theta], [ca.cse(ca.vertcat(stacked, integrals, *values))]),
        ca.Function("inner", [s.z, s.theta], [ca.horzcat(*ends)]),
        stacked.numel(),
        path,
    )


def _times(s: _Symbols, substeps: int) -> tuple[ca.SX, ca.SX]:
    """Return the start of the cell and the length of a substep."""
    horizon = s.tf - s.t0
    return s.t0 + horizon * s.theta[0], horizon * s.theta[1] / substeps


def _integrated(
    model: Model, method: Discretization, s: _Symbols
) -> tuple[list[ca.SX], list[ca.SX], ca.SX]:
    """Return the states at the ends of the substeps, the residuals, and the integrals."""
    import casadi as ca

    scheme, substeps, offsets = method.scheme, method.substeps, method.offsets
    start, h = _times(s, substeps)

    def f(x: ca.SX, u: ca.SX, t: ca.SX) -> Any:
        return model.right_hand_side(x, u, s.p, t)

    x, integrals = s.x0, ca.SX.zeros(model.n_q)
    ends, residuals = [x], []
    for j in range(substeps):
        u = [s.controls[_index(offsets, (j + c) / substeps)] for c in scheme.offsets]
        if scheme.explicit:
            x, q = scheme.residual(Step(f, x, ca.SX.zeros(model.n_x), (), u, start + j * h, h))
        else:
            after = s.x1 if j == substeps - 1 else s.own[j]
            first = substeps - 1 + j * scheme.own
            stages = s.own[first : first + scheme.own]
            residual, q = scheme.residual(Step(f, x, after, stages, u, start + j * h, h))
            residuals.append(residual)
            x = after
        integrals += q
        ends.append(x)
    if scheme.explicit:
        residuals.append(x - s.x1)
    return ends, residuals, integrals


def _index(offsets: Array, offset: float) -> int:
    return int(np.argmin(np.abs(offsets - offset)))


def _places(
    constraint: Constraint, offsets: Array, path_points: PathPoints | None
) -> tuple[int, ...]:
    """Return the offsets at which a cell may impose a constraint; its end belongs to the next.

    An equality with a control determines û: it holds at as many points as there are coefficients,
    the nodes and, for the ghosts, the middle of the first and last cells.
    """
    inside = [i for i, offset in enumerate(offsets) if offset < 1]
    if constraint.determines_control:
        middle = [i for i in inside if offsets[i] > 0]
        return (0, min(middle, key=lambda i: abs(offsets[i] - 0.5))) if middle else (0,)
    everywhere = constraint.uses_control if path_points is None else path_points == "substeps"
    return tuple(inside) if everywhere else (0,)


def _point(
    model: Model, method: Discretization, s: _Symbols, ends: list[ca.SX], place: int
) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
    """Return x, u, p, t at an offset of the cell."""
    offsets, substeps = method.offsets, method.substeps
    start, h = _times(s, substeps)
    j, u = int(offsets[place] * substeps + 1e-9), s.controls[place]
    fraction = offsets[place] * substeps - j
    t = start + (j + fraction) * h
    if fraction < 1e-9:
        return ends[j], u, s.p, t
    before, after = (s.controls[_index(offsets, (j + c) / substeps)] for c in (0, 1))
    slope0 = model.right_hand_side(ends[j], before, s.p, start + j * h)[0]
    slope1 = model.right_hand_side(ends[j + 1], after, s.p, start + (j + 1) * h)[0]
    return hermite(ends[j], ends[j + 1], slope0, slope1, h, fraction), u, s.p, t
