"""What holds at the ends of the horizon, once it is decided which bounds hold there.

What is fixed, or at an end of its range, has its value; what is free has its transversality
condition (`quito_cli.optimality.transversality`). With point constraints at t_j = t₀ + f_j (t_f −
t₀), whose times move with the horizon, the conditions of free times read

    M_t₀ − H(t₀) + Σ (1 − f_j) e_j = 0,   M_t_f + H(t_f) + Σ f_j e_j = 0,   e_j = H⁻ + ρᵀc_t − H⁺.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.transversality import Transversality, transversality

if TYPE_CHECKING:
    import casadi as ca

    from quito_cli.optimality.hamiltonian import Pontryagin

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Ends:
    """Values that hold, NaN where none does."""

    system: Pontryagin
    initial: Array
    """(n_x,)."""
    final: Array
    """(n_x,)."""
    initial_time: float
    final_time: float
    parameters: Array
    """(n_p,)."""
    integrals: Array
    """(integrals,)."""
    boundary: Array
    """(rows,)."""
    points: tuple[Array, ...]
    """Of each point constraint (rows,)."""

    @cached_property
    def conditions(self) -> Transversality:
        """Transversality."""
        return transversality(self.system)

    @cached_property
    def function(self) -> ca.Function:
        """e ↦ residuals and their derivatives in e.

        With e = (x₀, λ₀, x_f, λ_f, w_f, t₀, t_f, p, ν, ω, H₀, H_f), in the order of x₀, x_f, t₀,
        t_f, p, ν and ω; without the terms of point constraints.
        """
        import casadi as ca

        m, conditions = self.system.model, self.conditions
        n, integrals = m.n_x, self.system.integrals
        x0, l0, xf, lf = (ca.SX.sym(name, n) for name in ("x0", "l0", "xf", "lf"))
        w = ca.SX.sym("w", integrals + m.n_p)
        t0, tf, h0, hf = (ca.SX.sym(name) for name in ("t0", "tf", "h0", "hf"))
        p, nu = ca.SX.sym("p", m.n_p), ca.SX.sym("nu", integrals)
        omega = ca.SX.sym("omega", len(self.boundary))
        e = ca.vertcat(x0, l0, xf, lf, w, t0, tf, p, nu, omega, h0, hf)
        inputs = [x0, t0, xf, tf, p, l0, lf, h0, hf, w[integrals:], omega]
        initial, final, at_t0, at_tf, by_p = conditions.residuals.call(inputs)
        values = ca.vertcat(
            _chosen(self.initial, x0, initial),
            _chosen(self.final, xf, final),
            _chosen(np.array([self.initial_time]), t0, at_t0),
            _chosen(np.array([self.final_time]), tf, at_tf),
            _chosen(self.parameters, p, by_p),
            _chosen(self.integrals, w[:integrals], nu),
            _chosen(self.boundary, self._boundary(x0, t0, xf, tf, p), omega),
        )
        return ca.Function("ends", [e], [values, ca.densify(ca.jacobian(values, e))])

    def _boundary(self, x0: ca.SX, t0: ca.SX, xf: ca.SX, tf: ca.SX, p: ca.SX) -> ca.SX:
        import casadi as ca

        if not len(self.boundary):
            return ca.SX(0, 1)
        m, k = self.system.model, self.system.constants
        ends, given = m.ends, ca.vertcat(*(c.value for c in m.constraints.boundary))
        inputs = [ends.x0, ends.t0, ends.xf, ends.tf, m.p, k.symbols]
        value = ca.Function("boundary", inputs, [given])
        return value.call([x0, t0, xf, tf, p, ca.SX(k.values)])[0]


def _chosen(value: Array, unknown: ca.SX, condition: ca.SX) -> ca.SX:
    """Return unknown − value where there is one, else the condition, entry by entry."""
    import casadi as ca

    rows = [
        condition[i] if np.isnan(value[i]) else unknown[i] - float(value[i])
        for i in range(len(value))
    ]
    return ca.vertcat(*rows) if rows else ca.SX(0, 1)
