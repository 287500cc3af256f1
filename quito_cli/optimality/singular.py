"""Singular controls: the switching function differentiated along the flow until u appears.

For controls that enter H as σᵀu, the flow (x' = f, λ' = −H_x) gives

    dσ/dt = σ_x f − σ_λ H_x + σ_t  (+ σ_w w' for other controls w that are regular and inside their
                                      bounds: w' = −H_ww⁻¹ d(H_w)/dt; on bounds they are constant),

repeated until B + A u appears with A not identically zero, tested by numbers. Then u = −B/A is the
singular feedback. For one control this is an even derivative, of degree 2q, and a minimum needs
(−1)^q A ≥ 0, the generalised Legendre-Clebsch condition (H. J. Kelley, R. E. Kopp and H. G. Moyer,
in Topics in Optimization, 1967; H. M. Robbins, IBM J. Res. Dev. 11, 1967). One of several controls
that appears at an odd derivative violates Goh's condition unless its coefficient is zero there;
where H has products of them they are in σ itself, of degree 0, and A is their H_uu.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal

from quito_cli.optimality.hamiltonian import Pontryagin
from quito_cli.optimality.symbols.probes import MOST_OPERATIONS, Probe, TooLargeError

if TYPE_CHECKING:
    import casadi as ca

    from quito_cli.optimality.constraints import Active

Reason = Literal["", "constant", "no finite order", "too large", "not determined"]
"""Why there is no feedback: σ never changes; no derivative up to 2 n_x + 2 has u in it; the
derivatives grow beyond what is worked on; A cannot be inverted."""


@dataclass(frozen=True, eq=False)
class Singular:
    """Controls that are singular together, as functions of Pontryagin's arguments."""

    system: Pontryagin
    controls: tuple[int, ...]
    """Entries of u."""
    derivatives: tuple[tuple[ca.SX, ...], ...]
    """By control: σ, σ', …, those before u appears; all are zero on the arc."""
    degrees: tuple[int, ...]
    """By control: the derivative in which singular controls appear."""
    coefficient: ca.SX | None
    """A, (controls, controls); None where there is no feedback."""
    remainder: ca.SX | None
    """B, (controls, 1)."""
    reason: Reason = ""

    @property
    def order(self) -> int | None:
        """The order q of the arc, where one derivative of even degree 2q serves all controls."""
        degrees = set(self.degrees)
        degree = degrees.pop() if len(degrees) == 1 else 1
        return degree // 2 if self.coefficient is not None and degree % 2 == 0 else None

    @cached_property
    def feedback(self) -> ca.SX | None:
        """u = −A⁻¹B in terms of x, λ, t, … and the other controls, (controls, 1)."""
        import casadi as ca

        if self.coefficient is None or self.remainder is None:
            return None
        if len(self.controls) == 1:
            return -self.remainder / self.coefficient
        return -ca.solve(self.coefficient, self.remainder)

    @cached_property
    def clebsch(self) -> ca.SX | None:
        """(−1)^q A, (controls, controls): positive semidefinite at a minimum."""
        if self.order is None or self.coefficient is None:
            return None
        return self.coefficient if self.order % 2 == 0 else -self.coefficient

    @cached_property
    def functions(self) -> ca.Function:
        """Arguments ↦ u, A, B, and all of `derivatives` stacked; only where there is a feedback."""
        import casadi as ca

        surface = ca.vertcat(*(value for row in self.derivatives for value in row))
        outputs = (self.feedback, self.coefficient, self.remainder, surface)
        return self.system.function("singular", outputs)


def singular(
    system: Pontryagin,
    probe: Probe,
    controls: tuple[int, ...],
    interior: tuple[int, ...] = (),
    held: tuple[Active, ...] = (),
) -> Singular:
    """Return the arc on which these affine controls are singular together.

    Args:
        system: Pontryagin's system.
        probe: its random points.
        controls: entries of u that are singular.
        interior: entries that are inside their bounds there, and regular or determined by a row
            that is held; all others are constant.
        held: rows at their bounds there, each with the multiplier η at its place of μ.
    """
    import casadi as ca

    u = system.model.u[list(controls)]
    flow = _Flow.of(system, interior, held)
    switching = ca.gradient(flow.adjoined, system.model.u) if held else system.switching
    rows: list[tuple[ca.SX, ...]] = []
    last: list[ca.SX] = []
    for i in controls:
        found, reached, reason = _differentiated(flow, probe, switching[i], u)
        rows.append(found)
        if reached is None:
            return _none(system, controls, rows, reason)
        last.append(reached)
    try:
        stacked = ca.vertcat(*last)
        coefficient = ca.densify(ca.jacobian(stacked, u))
        coefficient = _cleared(probe, coefficient)
        if len(controls) > 1 and probe.vanishes(ca.det(coefficient)):
            return _none(system, controls, rows, "not determined")
    except TooLargeError:
        return _none(system, controls, rows, "too large")
    remainder = ca.substitute(stacked, u, ca.SX.zeros(len(controls)))
    degrees = tuple(len(row) for row in rows)
    return Singular(system, controls, tuple(rows), degrees, coefficient, remainder)


def _none(
    system: Pontryagin,
    controls: tuple[int, ...],
    rows: list[tuple[ca.SX, ...]],
    reason: Reason,
) -> Singular:
    return Singular(
        system, controls, tuple(rows), tuple(len(row) for row in rows), None, None, reason
    )


def _cleared(probe: Probe, matrix: ca.SX) -> ca.SX:
    """Put zeros where entries vanish identically."""
    cleared, zeros = matrix[:, :], probe.zeros(matrix)
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            if zeros[i, j]:
                cleared[i, j] = 0
    return cleared


@dataclass(frozen=True, eq=False)
class _Flow:
    """Everything that moves along an arc, and how fast."""

    symbols: ca.SX
    rates: ca.SX
    adjoined: ca.SX
    """H + ηᵀC of the rows that are held."""

    @staticmethod
    def of(system: Pontryagin, interior: tuple[int, ...], held: tuple[Active, ...]) -> _Flow:
        """Return the flow of (x, λ, t), and of controls and multipliers that follow it."""
        import casadi as ca

        m, adjoined = system.model, system.hamiltonian
        eta = ca.vertcat(*(system.multipliers[row.row] for row in held))
        equations = ca.vertcat(*(row.held for row in held))
        if held:
            adjoined = adjoined + ca.dot(eta, equations)
        symbols = ca.vertcat(m.x, system.costate, m.t)
        rates = ca.vertcat(m.xdot, -ca.gradient(adjoined, m.x), 1)
        if not interior and not held:
            return _Flow(symbols, rates, adjoined)
        followers = ca.vertcat(m.u[list(interior)], eta)
        held_to = ca.vertcat(ca.gradient(adjoined, m.u)[list(interior)], equations)
        moved = ca.jtimes(held_to, symbols, rates)
        slopes = ca.densify(ca.jacobian(held_to, followers))
        follow = -moved / slopes if slopes.numel() == 1 else -ca.solve(slopes, moved)
        return _Flow(ca.vertcat(symbols, followers), ca.vertcat(rates, follow), adjoined)

    def derivative(self, value: ca.SX) -> ca.SX:
        """Return the total time derivative of a scalar."""
        import casadi as ca

        return ca.jtimes(value, self.symbols, self.rates)


def _differentiated(
    flow: _Flow, probe: Probe, value: ca.SX, u: ca.SX
) -> tuple[tuple[ca.SX, ...], ca.SX | None, Reason]:
    """Return the derivatives before u appears, the one in which it does, or why none does."""
    import casadi as ca

    found, left = [value], MOST_OPERATIONS
    try:
        # A product of two controls that are both singular: H_uu itself determines them.
        if probe.depends(value, u):
            return (), value, ""
        for _ in range(2 * probe.system.model.n_x + 2):
            value = flow.derivative(value)
            left -= ca.n_nodes(value)
            if left < 0:
                return tuple(found), None, "too large"
            if probe.vanishes(value):
                return tuple(found), None, "constant" if len(found) == 1 else "no finite order"
            if ca.depends_on(value, u):
                if not probe.vanishes(ca.jacobian(value, u)):
                    return tuple(found), value, ""
                value = ca.substitute(value, u, ca.SX.zeros(*u.shape))
            found.append(value)
    except TooLargeError:
        return tuple(found), None, "too large"
    return tuple(found), None, "no finite order"
