"""SciPy's solvers, given exact derivatives: sparse ones and Hessians where they take them.

`trust-constr` hands back its multipliers. SLSQP's are those of its last quadratic program; better
ones follow from stationarity on what is active at the answer, ∇f + (∂g)ᵀ λ_g + λ_w = 0, by least
squares, leaving out again what comes back with the wrong sign.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from quito_cli.solvers.asking import Request, refuse_unknown, settings
from quito_cli.solvers.interruption import Interruption, interruptible
from quito_cli.solvers.outcome import Listener, Outcome, Progress, Status
from quito_cli.solvers.program import Program
from quito_cli.solvers.residuals import at_its_bound

Array = NDArray[np.float64]

SIGNS = 5
"""Times that multipliers of the wrong sign are left out and the others found again."""


class _StopRequested(Exception):  # noqa: N818 - it is no error
    """The user has asked to stop."""


class _Evaluated:
    """The program at one point, evaluated once for all that SciPy asks there."""

    def __init__(
        self, program: Program, listener: Listener | None, interruption: Interruption
    ) -> None:
        self._program, self._listener, self._interruption = program, listener, interruption
        self._of_cost: tuple[bytes, float, Array] | None = None
        self._of_rows: tuple[bytes, Array, Any] | None = None
        self.iterations = 0
        self.latest = program.guess

    def cost(self, w: Array) -> tuple[float, Array]:
        """Return f and ∇f."""
        key = w.tobytes()
        if self._of_cost is None or self._of_cost[0] != key:
            f, gradient = self._program.gradient(w, [])
            self._of_cost = key, float(f), np.array(gradient).ravel()
        return self._of_cost[1:]

    def rows(self, w: Array) -> tuple[Array, Any]:
        """Return g and ∂g, sparse."""
        key = w.tobytes()
        if self._of_rows is None or self._of_rows[0] != key:
            g, jacobian = self._program.jacobian(w, [])
            self._of_rows = key, np.array(g).ravel(), _sparse(jacobian)
        return self._of_rows[1:]

    def hessian(self, w: Array, sigma: float, lam: Array) -> Any:
        """Return ∇²(σf + λᵀg), sparse and whole."""
        return _sparse(ca.triu2symm(self._program.hessian(w, [], sigma, lam)))

    def tell(self, w: Array) -> None:
        """Report an iterate."""
        self.iterations, self.latest = self.iterations + 1, w.copy()
        if self._listener is not None:
            (f, _), (g, _), program = self.cost(w), self.rows(w), self._program
            outside = np.maximum(program.row_lower - g, g - program.row_upper)
            violation = max(0.0, float(outside.max(initial=0.0)))
            self._listener(Progress(self.iterations, f / program.cost_scale, violation))
        if self._interruption.requested:
            raise _StopRequested


def _sparse(matrix: ca.DM) -> Any:
    from scipy.sparse import csc_array

    pattern = matrix.sparsity()
    parts = matrix.nonzeros(), pattern.row(), pattern.colind()
    return csc_array(parts, shape=matrix.shape)


def solve(program: Program, request: Request) -> Outcome:
    """Minimise.

    Raises:
        UsageError: the solver does not know an option.
    """
    row = request.backend
    refuse_unknown(row, request.options, row.known)
    started = time.perf_counter()
    with interruptible() as interruption, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of steps that were not taken
        at = _Evaluated(program, request.listener, interruption)
        try:
            found = _METHODS[row.plugin](program, at, settings(request, warm=False))
            w, said = np.asarray(found.x), str(found.message)
            status = row.statuses.get(str(found.status), Status.FAILED)
            multipliers = _multipliers(program, at, w, found)
            iterations = int(found.nit)
        except _StopRequested:
            w, said, status, iterations = at.latest, "stopped", Status.INTERRUPTED, at.iterations
            multipliers = _recovered(program, at, w)
        except (ValueError, ArithmeticError, np.linalg.LinAlgError) as error:
            w, said, iterations = at.latest, str(error), at.iterations
            status = Status.FAILED if program.finite(w) else Status.NOT_FINITE
            multipliers = np.zeros(len(program.row_lower)), np.zeros(len(w))
    seconds = time.perf_counter() - started
    return Outcome(status, w, *multipliers, iterations, {}, 0.0, seconds, said, row.name)


def _slsqp(program: Program, at: _Evaluated, options: dict[str, Any]) -> Any:
    from scipy.optimize import Bounds, minimize

    lower, upper = program.row_lower, program.row_upper
    equal = lower == upper
    above, below = np.isfinite(lower) & ~equal, np.isfinite(upper) & ~equal
    constraints = [
        {
            "type": "eq",
            "fun": lambda w: (at.rows(w)[0] - lower)[equal],
            "jac": lambda w: at.rows(w)[1].toarray()[equal],
        }
    ]
    if above.any() or below.any():
        constraints.append(
            {
                "type": "ineq",
                "fun": lambda w: np.concatenate(
                    [(at.rows(w)[0] - lower)[above], (upper - at.rows(w)[0])[below]]
                ),
                "jac": lambda w: np.vstack(
                    [at.rows(w)[1].toarray()[above], -at.rows(w)[1].toarray()[below]]
                ),
            }
        )
    return minimize(
        lambda w: at.cost(w)[0],
        program.guess,
        jac=lambda w: at.cost(w)[1],
        bounds=Bounds(program.lower, program.upper),
        constraints=constraints,
        method="SLSQP",
        callback=at.tell,
        options=options,
    )


def _trust_constr(program: Program, at: _Evaluated, options: dict[str, Any]) -> Any:
    from scipy.optimize import Bounds, NonlinearConstraint, minimize

    none = np.zeros(len(program.row_lower))
    rows = NonlinearConstraint(
        lambda w: at.rows(w)[0],
        program.row_lower,
        program.row_upper,
        jac=lambda w: at.rows(w)[1],
        hess=lambda w, lam: at.hessian(w, 0.0, lam),
    )
    return minimize(
        lambda w: at.cost(w)[0],
        program.guess,
        jac=lambda w: at.cost(w)[1],
        hess=lambda w: at.hessian(w, 1.0, none),
        bounds=Bounds(program.lower, program.upper),
        constraints=[rows],
        method="trust-constr",
        callback=lambda w, _: at.tell(w),
        options={"sparse_jacobian": True, **options},
    )


_METHODS: dict[str, Callable[[Program, _Evaluated, dict[str, Any]], Any]] = {
    "SLSQP": _slsqp,
    "trust-constr": _trust_constr,
}


def _multipliers(program: Program, at: _Evaluated, w: Array, found: Any) -> tuple[Array, Array]:
    """Return multipliers of rows and bounds: SciPy's, where it has some for both."""
    if "v" not in found:
        return _recovered(program, at, w)
    return np.asarray(found.v[0]), np.asarray(found.v[1])


def _recovered(program: Program, at: _Evaluated, w: Array) -> tuple[Array, Array]:
    """Return the multipliers that make `w` as stationary as can be."""
    g, jacobian = at.rows(w)
    values = np.concatenate([g, w])
    lower = np.concatenate([program.row_lower, program.lower])
    upper = np.concatenate([program.row_upper, program.upper])
    of_rows = jacobian.toarray().T
    columns = np.hstack([of_rows, np.eye(len(w))])
    fixed, signs = lower == upper, np.ones(len(values))
    touching = [at_its_bound(values, lower, upper, sign * signs) for sign in (-1, 1)]
    active, multipliers = touching[0] | touching[1], np.zeros(len(values))
    for _ in range(SIGNS):
        multipliers[:] = 0.0
        solution = np.linalg.lstsq(columns[:, active], -at.cost(w)[1], rcond=None)[0]
        multipliers[active] = solution
        wrong = active & ~fixed & ~at_its_bound(values, lower, upper, multipliers)
        if not wrong.any():
            break
        active &= ~wrong
    multipliers[~fixed & ~at_its_bound(values, lower, upper, multipliers)] = 0.0
    return multipliers[: len(g)], multipliers[len(g) :]
