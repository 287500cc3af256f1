"""Arcs on an active constraint: what holds there, the control that it leaves, its multiplier.

A row c(x, u, t) with a control in it (mixed) holds with equality; one without, S(x, t), is
differentiated along x' = f until u appears, S^(q) = 0 with u in it, and S^(q) plays the mixed
constraint (A. E. Bryson, W. F. Denham and S. E. Dreyfus, AIAA J. 1, 1963). Either way an equation
C(x, u, t) = 0 with C_u ≠ 0 determines one control v, in closed form where C is affine in it, and

    η = −H_v / C_v,        λ' = −H_x − η C_x;

other controls that are inside their bounds satisfy H_w + η C_w = 0. Where an arc on S begins, the
tangency conditions S = S' = … = S^(q−1) = 0 hold, and the costate of this, the indirect adjoining,
jumps by a combination of the ∇S^(i): λ⁺ = λ⁻ − Σ π_i ∇S^(i), H⁺ = H⁻ + Σ π_i ∂S^(i)/∂t. The
multiplier μ of S itself, as the solver has it, is (−1)^q times the q-th derivative of η.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from quito_cli.optimality.hamiltonian import Pontryagin
from quito_cli.optimality.symbols.probes import Probe, TooLargeError

if TYPE_CHECKING:
    import casadi as ca


@dataclass(frozen=True, eq=False)
class Active:
    """A row of Pontryagin's system held at a bound, as functions of Pontryagin's arguments."""

    system: Pontryagin
    row: int
    """Of `system.rows`."""
    upper: bool
    """It is held at its upper bound."""
    derivatives: tuple[ca.SX, ...]
    """S, S', … before a control appears, with the bound taken off; none of a mixed constraint."""
    equation: ca.SX | None
    """C = 0: the mixed constraint, or S^(q); None where no control ever appears in a derivative, or
    the derivatives are too long to be worked on."""
    controls: tuple[int, ...]
    """Entries of u that it can determine: C_u is not identically zero."""
    affine: tuple[bool, ...]
    """By control of `controls`: C is affine in it."""

    @property
    def order(self) -> int | None:
        """The order q: 0 of a mixed constraint, None where no derivative has a control in it."""
        return None if self.equation is None else len(self.derivatives)

    @property
    def held(self) -> ca.SX:
        """C.

        Raises:
            ValueError: no control ever appears.
        """
        if self.equation is None:
            raise ValueError(f"{self.system.rows[self.row].label} has no finite order")
        return self.equation

    @cached_property
    def slope(self) -> ca.SX:
        """C_u, (n_u, 1)."""
        import casadi as ca

        return ca.densify(ca.gradient(self.held, self.system.model.u))

    def control(self, entry: int) -> ca.SX | None:
        """Return the entry of u that C = 0 leaves, in terms of x, t and the other controls.

        None where C is not affine in it: then Newton's steps of `function` lead to it.
        """
        import casadi as ca

        if not self.affine[self.controls.index(entry)]:
            return None
        u = self.system.model.u[entry]
        offset, slope = ca.substitute([self.held, self.slope[entry]], [u], [ca.SX(0)])
        return -offset / slope

    def multiplier(self, entry: int) -> ca.SX:
        """Return η = −H_v/C_v in terms of x, λ, u, t, where `entry` is the control determined."""
        return -self.system.switching[entry] / self.slope[entry]

    def function(self, entry: int) -> ca.Function:
        """Return arguments ↦ step to the control, η, λ', and S, …, S^(q−1), C stacked.

        The step −C/C_v is zero on the arc; one is enough where C is affine in the control.
        """
        import casadi as ca

        multiplier = self.multiplier(entry)
        step = -self.held / self.slope[entry]
        pull = ca.gradient(self.held, self.system.model.x)
        adjoint = self.system.free_adjoint - multiplier * pull
        outputs = [step, multiplier, adjoint, ca.vertcat(*self.derivatives, self.held)]
        return self.system.function("active", outputs)

    @cached_property
    def jumps(self) -> ca.Function:
        """Arguments ↦ ∇S^(i) as columns, (n_x, q), and ∂S^(i)/∂t, (q, 1); of a state constraint."""
        import casadi as ca

        stacked = ca.vertcat(*self.derivatives)
        slopes = ca.jacobian(stacked, self.system.model.x).T
        rates = ca.jacobian(stacked, self.system.model.t)
        return self.system.function("jumps", [ca.densify(slopes), ca.densify(rates)])


def active(system: Pontryagin, probe: Probe, row: int, *, upper: bool) -> Active:
    """Return what holds where a row is at its upper or lower bound.

    Args:
        system: Pontryagin's system.
        probe: its random points.
        row: entry of `system.rows`; its bound on that side is finite.
        upper: whether it is at its upper bound, else at its lower one.
    """
    import casadi as ca

    given, m = system.rows[row], system.model
    value = given.value - (given.upper if upper else given.lower)
    found: list[ca.SX] = []
    symbols, rates = ca.vertcat(m.x, m.t), ca.vertcat(m.xdot, 1)
    try:
        for _ in range(m.n_x + 1):
            slope = ca.densify(ca.gradient(value, m.u))
            there = np.flatnonzero(~probe.zeros(slope))
            if there.size:
                controls = tuple(there.tolist())
                affine = tuple(not probe.depends(slope[i], m.u[i]) for i in controls)
                return Active(system, row, upper, tuple(found), value, controls, affine)
            # Coefficients that vanish identically are gone before they are differentiated.
            value = ca.substitute(value, m.u, ca.SX.zeros(m.n_u))
            found.append(value)
            value = ca.jtimes(value, symbols, rates)
            if probe.vanishes(value):
                break
    except TooLargeError:
        pass
    return Active(system, row, upper, tuple(found), None, (), ())
