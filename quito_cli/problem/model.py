"""The Model: a problem as CasADi expressions and arrays of bounds, with no text left in it.

Vectors are stacked in the order of the problem file: x (n_x), u (n_u), p (n_p). Every cost is that
of a minimisation; `sense` is −1 where the file maximises, and only reports look at it.

The stages after `problem` import from here all that a Model is made of.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.problem.known import Known, Piece
from quito_cli.problem.variables import Array, Bounds, Instant, Variable, labels, units

if TYPE_CHECKING:
    import casadi as ca

    from quito_cli.problem.shapes import View

__all__ = [
    "Bounds",
    "Constraint",
    "Constraints",
    "Endpoints",
    "GuessFunction",
    "Hints",
    "Instant",
    "Known",
    "Lookup",
    "Model",
    "Piece",
    "Variable",
    "labels",
    "units",
]

GuessFunction = Callable[[Array], Array]
"""times (points,) ↦ values (points, size)."""


@dataclass(frozen=True)
class Endpoints:
    """Symbols of what the Mayer cost may speak of."""

    x0: ca.SX
    t0: ca.SX
    xf: ca.SX
    tf: ca.SX


@dataclass(frozen=True, eq=False)
class Constraint:
    """lower ≤ value ≤ upper, entry by entry."""

    name: str
    text: str
    """As the file has it."""
    value: ca.SX
    """(rows, 1)."""
    bounds: Bounds
    """(rows,) each."""
    size: ca.SX
    """How large its sides are, (rows, 1): what a violation is judged by."""
    uses_control: bool = False
    at: float | None = None
    """Of a point constraint: when, as a fraction of the horizon."""

    @property
    def determines_control(self) -> bool:
        """Whether it is an equality with a control in it."""
        return self.uses_control and bool(self.bounds.fixed.any())

    @property
    def labels(self) -> tuple[str, ...]:
        """A name for each row."""
        rows = len(self.bounds.lower)
        return tuple(f"{self.name}[{i}]" for i in range(rows)) if rows > 1 else (self.name,)


@dataclass(frozen=True)
class Constraints:
    """Everything that must hold beside dynamics, bounds and end values."""

    path: tuple[Constraint, ...]
    """In terms of x, u, p, t."""
    boundary: tuple[Constraint, ...]
    """In terms of the ends and p."""
    integral: tuple[Constraint, ...]
    """The integrands, in terms of x, u, p, t; bounds are those of the integrals."""
    point: tuple[Constraint, ...]
    """In terms of x, u, p, t."""


@dataclass(frozen=True, eq=False)
class Lookup:
    """Where a formula along the horizon reads a table."""

    table: str
    first: float
    """Its least argument."""
    last: float
    """Its largest."""
    argument: ca.SX
    """What it is read at, (entries, 1), in terms of x, u, p, t."""


@dataclass(frozen=True)
class Hints:
    """Where the file says the solver is to start, and how large things are."""

    states: tuple[GuessFunction | None, ...]
    """By state variable."""
    controls: tuple[GuessFunction | None, ...]
    """By control variable."""
    parameters: Array
    """(n_p,); NaN where nothing is said."""
    state_scale: Array
    """(n_x,); NaN where nothing is said."""
    control_scale: Array
    """(n_u,); NaN where nothing is said."""
    parameter_scale: Array
    """(n_p,); NaN where nothing is said."""


@dataclass(frozen=True)
class Model:
    """What transcription and the checks of an answer need to know of a problem."""

    name: str
    states: tuple[Variable, ...]
    controls: tuple[Variable, ...]
    parameters: tuple[Variable, ...]
    x: ca.SX
    u: ca.SX
    p: ca.SX
    t: ca.SX
    xdot: ca.SX
    """Dynamics, (n_x, 1)."""
    lagrange: ca.SX
    """Running cost of the minimisation, scalar."""
    ends: Endpoints
    mayer: ca.SX
    """End cost of the minimisation in terms of `ends` and `p`, scalar."""
    state_bounds: Bounds
    control_bounds: Bounds
    parameter_bounds: Bounds
    initial: Bounds
    """Of the state at the initial time, within `state_bounds`."""
    final: Bounds
    """Of the state at the final time, within `state_bounds`."""
    initial_time: Instant
    final_time: Instant
    constraints: Constraints
    hints: Hints
    sense: int
    """+1 where the file minimises, −1 where it maximises."""
    known: Known | None
    """The file's reference, where it applies."""
    views: tuple[View, ...]
    """The plots it asks for."""
    lookups: tuple[Lookup, ...]
    """Where its formulas read tables."""

    @property
    def n_x(self) -> int:
        """Number of states."""
        return len(self.state_bounds.lower)

    @property
    def n_u(self) -> int:
        """Number of controls."""
        return len(self.control_bounds.lower)

    @property
    def n_p(self) -> int:
        """Number of parameters."""
        return len(self.parameter_bounds.lower)

    @cached_property
    def right_hand_side(self) -> ca.Function:
        """(x, u, p, t) ↦ (ẋ, integrands): the running cost, then the integral constraints'."""
        import casadi as ca

        integrands = [self.lagrange, *(c.value for c in self.constraints.integral)]
        return ca.Function(
            "right_hand_side",
            [self.x, self.u, self.p, self.t],
            [self.xdot, ca.vertcat(*integrands)],
        )

    @cached_property
    def determined_controls(self) -> NDArray[np.bool_]:
        """(n_u,): controls that an equality along the path speaks of."""
        import casadi as ca

        found = np.zeros(self.n_u, dtype=bool)
        for constraint in self.constraints.path:
            if constraint.determines_control:
                pattern = ca.jacobian_sparsity(constraint.value, self.u)
                found[pattern.get_triplet()[1]] = True
        return found

    @property
    def n_q(self) -> int:
        """Number of integrals: the running cost and the integral constraints."""
        return 1 + len(self.constraints.integral)

    def function(self, constraint: Constraint) -> ca.Function:
        """Return (x, u, p, t) ↦ value of a path or point constraint."""
        import casadi as ca

        return ca.Function("constraint", [self.x, self.u, self.p, self.t], [constraint.value])

    def size(self, constraint: Constraint) -> ca.Function:
        """Return (x, u, p, t) ↦ size of a path or point constraint."""
        import casadi as ca

        return ca.Function("size", [self.x, self.u, self.p, self.t], [constraint.size])

    def argument(self, lookup: Lookup) -> ca.Function:
        """Return (x, u, p, t) ↦ what a table is read at."""
        import casadi as ca

        return ca.Function("argument", [self.x, self.u, self.p, self.t], [lookup.argument])

    @cached_property
    def boundary_values(self) -> ca.Function:
        """(x₀, t₀, x_f, t_f, p) ↦ values and sizes of all boundary constraints, stacked."""
        import casadi as ca

        ends, given = self.ends, self.constraints.boundary
        arguments = [ends.x0, ends.t0, ends.xf, ends.tf, self.p]
        values = ca.vertcat(*(c.value for c in given))
        return ca.Function("boundary", arguments, [values, ca.vertcat(*(c.size for c in given))])

    @cached_property
    def end_cost(self) -> ca.Function:
        """(x₀, t₀, x_f, t_f, p) ↦ Mayer cost."""
        import casadi as ca

        ends = self.ends
        return ca.Function("end_cost", [ends.x0, ends.t0, ends.xf, ends.tf, self.p], [self.mayer])
