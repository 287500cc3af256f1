"""Rows of the table: SciPy's solvers, in the place of MATLAB's fmincon."""

from __future__ import annotations

from quito_cli.solvers.backend import Backend
from quito_cli.solvers.outcome import Status

ROWS = (
    Backend(
        "scipy-slsqp",
        "sequential least squares programming (D. Kraft)",
        "NLP",
        "scipy",
        "SLSQP",
        "dense; quasi-Newton",
        "SciPy (pip install 'quito[scipy]')",
        accuracy=1e-6,
        sharper=1e-8,  # ftol is of the change of f
        tolerances=("ftol",),
        iterations="maxiter",
        known=("ftol", "maxiter", "eps", "disp", "iprint", "finite_diff_rel_step"),
        statuses={
            "0": Status.SOLVED,
            "3": Status.STUCK,
            "4": Status.INFEASIBLE,
            "8": Status.STUCK,
            "9": Status.ITERATION_LIMIT,
        },
        callback=True,
        only_free=True,
        most_unknowns=1000,
    ),
    Backend(
        "scipy-trust-constr",
        "trust-region interior point (Byrd, Hribar and Nocedal), the method of fmincon",
        "NLP",
        "scipy",
        "trust-constr",
        "sparse LU; exact Hessians",
        "SciPy (pip install 'quito[scipy]')",
        accuracy=1e-6,
        tolerances=("gtol", "barrier_tol"),
        iterations="maxiter",
        fixed={"xtol": 1e-14},
        known=(
            *("gtol", "xtol", "barrier_tol", "maxiter", "initial_tr_radius", "verbose"),
            *("initial_constr_penalty", "initial_barrier_parameter", "factorization_method"),
            *("initial_barrier_tolerance", "disp"),
        ),
        statuses={
            "0": Status.ITERATION_LIMIT,
            "1": Status.SOLVED,
            "2": Status.STUCK,
            "3": Status.INTERRUPTED,
        },
        callback=True,
        only_free=True,
        most_unknowns=3000,
    ),
)
