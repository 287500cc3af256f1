"""What a solver is given: plain functions and numbers, without what they mean.

An `Nlp` knows its problem; a `Program` is what is left of it for a solver, and travels to another
process. Every derivative that a plug-in may ask for is one of a few expressions, by CasADi's names
for them, so that a plug-in's row only says which of its functions returns which.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import casadi as ca

    from quito_cli.transcription.transcribe import Nlp

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Start:
    """Multipliers to start from, positive at upper bounds."""

    lam_g: Array
    """(n_g,) of the rows."""
    lam_w: Array
    """(n_w,) of the bounds."""


@dataclass(frozen=True)
class Program:
    """Minimise f subject to lower ≤ w ≤ upper and row_lower ≤ g ≤ row_upper."""

    values: ca.Function
    """(x, p) ↦ (f, g); p is empty."""
    gradient: ca.Function
    """(x, p) ↦ (f, ∇f)."""
    jacobian: ca.Function
    """(x, p) ↦ (g, ∂g)."""
    hessian: ca.Function
    """(x, p, σ, λ) ↦ upper triangle of ∇²(σf + λᵀg)."""
    lower: Array
    upper: Array
    guess: Array
    row_lower: Array
    row_upper: Array
    cost_scale: float
    """f = cost_scale · cost, in the file's sense."""
    start: Start | None
    """None starts cold."""

    def finite(self, w: Array) -> bool:
        """Whether cost, rows and their first derivatives are finite at `w`."""
        values = (*self.gradient(w, []), *self.jacobian(w, []))
        return all(np.isfinite(value.nonzeros()).all() for value in values)

    @classmethod
    def of(cls, nlp: Nlp, start: Start | None) -> Program:
        """Return what a solver needs of `nlp`."""
        import casadi as ca

        assembled, none = nlp.assembled, ca.MX.sym("p", 0, 1)
        outputs = [assembled.objective, assembled.constraints]
        return cls(
            ca.Function("nlp", [assembled.unknowns, none], outputs, ["x", "p"], ["f", "g"]),
            assembled.gradient,
            assembled.jacobian,
            assembled.hessian,
            nlp.lower,
            nlp.upper,
            nlp.guess,
            nlp.row_lower,
            nlp.row_upper,
            nlp.objective_scale * nlp.transcription.model.sense,
            start,
        )

    @property
    def free(self) -> NDArray[np.bool_]:
        """Unknowns that are not fixed by their bounds."""
        return np.asarray(self.lower < self.upper)

    def of_free_unknowns(self) -> Program:
        """Return the program of the unknowns that are free, the others being their bounds.

        A solver that takes a fixed unknown for two active bounds may stall on them.
        """
        import casadi as ca

        (free,) = np.nonzero(self.free)
        x, p = ca.MX.sym("x", len(free)), ca.MX.sym("p", 0, 1)
        sigma, lam = ca.MX.sym("sigma"), ca.MX.sym("lam", len(self.row_lower))
        spread = ca.DM(
            ca.Sparsity.triplet(len(self.lower), len(free), free, np.arange(len(free))), 1.0
        )
        w = ca.DM(np.where(self.free, 0.0, self.lower)) + spread @ x
        f, gradient = self.gradient(w, p)
        g, jacobian = self.jacobian(w, p)
        hessian = spread.T @ ca.triu2symm(self.hessian(w, p, sigma, lam)) @ spread
        start = self.start and replace(self.start, lam_w=self.start.lam_w[free])
        return replace(
            self,
            values=ca.Function("nlp", [x, p], list(self.values(w, p)), ["x", "p"], ["f", "g"]),
            gradient=ca.Function("grad_f", [x, p], [f, ca.densify(spread.T @ gradient)]),
            jacobian=ca.Function("jac_g", [x, p], [g, jacobian @ spread]),
            hessian=ca.Function("hess_lag", [x, p, sigma, lam], [ca.triu(hessian)]),
            lower=self.lower[free],
            upper=self.upper[free],
            guess=self.guess[free],
            start=start,
        )

    def derivatives(self, wanted: Mapping[str, tuple[str, ...]]) -> dict[str, ca.Function]:
        """Return functions by name, each with the outputs that it is wanted for.

        The outputs are `f`, `g`, `grad_f_x`, `jac_g_x` and, with γ = σf + λᵀg, `grad_gamma_x`,
        `hess_gamma_x_x` and its upper triangle `triu_hess_gamma_x_x`.
        """
        import casadi as ca

        x, p = ca.MX.sym("x", len(self.guess)), ca.MX.sym("p", 0, 1)
        sigma, lam = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", len(self.row_lower))
        f, gradient = self.gradient(x, p)
        g, jacobian = self.jacobian(x, p)
        upper = self.hessian(x, p, sigma, lam)
        known = {
            "f": f,
            "g": g,
            "grad_f_x": gradient,
            "jac_g_x": jacobian,
            "grad_gamma_x": sigma * gradient + jacobian.T @ lam,
            "triu_hess_gamma_x_x": upper,
            "hess_gamma_x_x": ca.triu2symm(upper),
        }
        names, symbols = ["x", "p", "lam_f", "lam_g"], [x, p, sigma, lam]
        made = {}
        for name, outputs in wanted.items():
            count = 4 if any("gamma" in output for output in outputs) else 2
            made[name] = ca.Function(
                name,
                symbols[:count],
                [known[output] for output in outputs],
                names[:count],
                list(outputs),
            )
        return made


def start_at(nlp: Nlp, lam_g: Array) -> Start:
    """Return multipliers to start from: those of the bounds follow from stationarity at the guess.

    λ_w = −(∇f + (∂g)ᵀ λ_g) where the point is at the bound that its sign speaks of, zero elsewhere.
    """
    from quito_cli.solvers.residuals import at_its_bound

    w = nlp.guess
    gradient = np.array(nlp.assembled.gradient(w, [])[1]).ravel()
    jacobian = nlp.assembled.jacobian(w, [])[1]
    lam_w = -(gradient + np.array(jacobian.T @ lam_g).ravel())
    return Start(lam_g, np.where(at_its_bound(w, nlp.lower, nlp.upper, lam_w), lam_w, 0.0))
