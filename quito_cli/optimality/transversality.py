"""What holds at the ends of an extremal: transversality of costates, H, parameters.

With M = Mayer cost + ωᵀb of the boundary constraints b(x₀, t₀, x_f, t_f, p),

    λ(t₀) = −M_x₀,   λ(t_f) = M_x_f,   H(t₀) = M_t₀,   H(t_f) = −M_t_f,   M_p + ∫ H_p dt = 0

for whatever is free (Bryson and Ho 1975, sections 2.7 and 2.8). The residuals are the derivatives
of the cost by these unknowns, M_x₀ + λ(t₀), M_x_f − λ(t_f), M_t₀ − H(t₀), M_t_f + H(t_f) and
M_p + ∫ H_p dt. What is fixed has no condition. What has a range has residual 0 within it, ≤ 0 at
its upper end and ≥ 0 at its lower one. ω and ν have the signs that the package states.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.hamiltonian import Pontryagin
from quito_cli.problem.model import Bounds, Instant

if TYPE_CHECKING:
    import casadi as ca

Array = NDArray[np.float64]
Freedom = Literal["free", "fixed", "range"]


@dataclass(frozen=True, eq=False)
class Transversality:
    """The conditions at the ends."""

    system: Pontryagin
    boundary_multipliers: ca.SX
    """ω of the rows of all boundary constraints, stacked, (rows, 1)."""
    initial: tuple[Freedom, ...]
    """By entry of x, at the initial time: `range` includes bounds on the state."""
    final: tuple[Freedom, ...]
    initial_time: Freedom
    final_time: Freedom
    parameters: tuple[Freedom, ...]
    """(n_p,)."""

    @cached_property
    def end_function(self) -> ca.SX:
        """M = Mayer cost + ωᵀb, scalar."""
        import casadi as ca

        boundary = ca.vertcat(*(c.value for c in self.system.model.constraints.boundary))
        mayer = self.system.model.mayer
        return mayer + ca.dot(self.boundary_multipliers, boundary) if boundary.numel() else mayer

    @cached_property
    def residuals(self) -> ca.Function:
        """(x₀, t₀, x_f, t_f, p, λ₀, λ_f, H₀, H_f, ∫H_p dt, ω) ↦ residuals.

        Of x₀ (n_x), x_f (n_x), t₀, t_f and p (n_p); of no meaning where the Freedom is `fixed`.
        """
        import casadi as ca

        m, ends, end = self.system.model, self.system.model.ends, self.end_function
        sym = ca.SX.sym
        first, last = sym("l0", m.n_x), sym("lf", m.n_x)
        before, after, integral = sym("h0"), sym("hf"), sym("hp", m.n_p)
        inputs = [ends.x0, ends.t0, ends.xf, ends.tf, m.p, first, last, before, after, integral]
        outputs = [
            first + ca.gradient(end, ends.x0),
            ca.gradient(end, ends.xf) - last,
            ca.gradient(end, ends.t0) - before,
            after + ca.gradient(end, ends.tf),
            ca.gradient(end, m.p) + integral,
        ]
        k = self.system.constants
        whole = ca.Function("ends", [*inputs, self.boundary_multipliers, k.symbols], outputs)
        given = [*inputs, self.boundary_multipliers]
        return ca.Function("transversality", given, whole.call([*given, ca.SX(k.values)]))

    @cached_property
    def parameter_terms(self) -> ca.Function:
        """(x₀, t₀, x_f, t_f, p, ω) ↦ Σ |M_pz| |z| over all ends and parameters z, (n_p, 1).

        Which is what M_p is made of: it may be zero itself.
        """
        import casadi as ca

        m, ends, k = self.system.model, self.system.model.ends, self.system.constants
        symbols = [ends.x0, ends.t0, ends.xf, ends.tf, m.p]
        z, slope = ca.vertcat(*symbols), ca.gradient(self.end_function, m.p)
        terms = ca.densify(ca.fabs(ca.jacobian(slope, z)) @ ca.fabs(z))
        inputs = [*symbols, self.boundary_multipliers]
        whole = ca.Function("terms", [*inputs, k.symbols], [terms])
        return ca.Function("terms", inputs, whole.call([*inputs, ca.SX(k.values)]))


def point_jumps(system: Pontryagin) -> tuple[ca.Function, ...]:
    """Return arguments ↦ value (rows, 1) and gradients (n_x, rows), for each point constraint.

    At its time λ⁺ = λ⁻ − ρ · gradients, with multipliers ρ of the signs that the package states.
    """
    import casadi as ca

    return tuple(
        system.function("point", [c.value, ca.densify(ca.jacobian(c.value, system.model.x).T)])
        for c in system.model.constraints.point
    )


def transversality(system: Pontryagin) -> Transversality:
    """Return the conditions at the ends of a system."""
    import casadi as ca

    m = system.model
    rows = sum(len(c.bounds.lower) for c in m.constraints.boundary)
    return Transversality(
        system,
        ca.SX.sym("omega", rows),
        _freedoms(m.initial),
        _freedoms(m.final),
        _freedom(m.initial_time),
        _freedom(m.final_time),
        _freedoms(m.parameter_bounds),
    )


def _freedoms(bounds: Bounds) -> tuple[Freedom, ...]:
    return tuple(
        "fixed" if low == high else "range" if np.isfinite(low) or np.isfinite(high) else "free"
        for low, high in zip(*bounds, strict=True)
    )


def _freedom(instant: Instant) -> Freedom:
    (found,) = _freedoms(Bounds(np.array([instant.lower]), np.array([instant.upper])))
    return found
