"""Solvers of nonlinear programs that are plug-ins of CasADi's `nlpsol`.

Each gets our exact derivatives, as options or, where it has none for them, by filling the cache in
which it would look for those it has made itself.
"""

from __future__ import annotations

import io
import time
from contextlib import redirect_stderr, redirect_stdout
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from quito_cli.errors import UnavailableError, UsageError
from quito_cli.solvers.asking import (
    Request,
    count_of,
    heard,
    last_line,
    quiet,
    refusal,
    refuse_unknown,
    settings,
    status_of,
)
from quito_cli.solvers.backend import Backend
from quito_cli.solvers.interruption import interruptible
from quito_cli.solvers.outcome import Outcome, Status
from quito_cli.solvers.program import Program
from quito_cli.solvers.watch import Watch

Array = NDArray[np.float64]

HISTORY = {
    "objective": "obj",
    "primal_infeasibility": "inf_pr",
    "dual_infeasibility": "inf_du",
    "barrier_parameter": "mu",
}
LINEAR_SOLVERS = ("mumps", "spral")
"""Of IPOPT as CasADi ships it; others load libraries that it does not bring."""
OURS = ("hess_lag", "jac_fg", "qpsol", "qpsol_options")
"""Options of the plug-ins that the rows give."""
QUIET = {
    "print_time": False,
    "show_eval_warnings": False,
    "error_on_fail": False,
    "inputs_check": False,  # it only prints about problems with too many conditions
}


def solve(program: Program, request: Request) -> Outcome:
    """Minimise.

    Raises:
        UsageError: the solver does not know an option, or its value.
        UnavailableError: a linear solver that is not in this installation.
    """
    row = request.backend
    with interruptible() as interruption:
        started = time.perf_counter()
        watch = Watch(program, heard(request.listener), interruption) if row.callback else None
        solver = _built(program, request, watch)
        built = time.perf_counter()
        point, failure = _called(solver, program, request)
        solved = time.perf_counter()
    statistics = _statistics(solver)
    status, said = status_of(row, statistics)
    if failure is not None:
        status, said, statistics = Status.FAILED, failure, {}
    _refuse_invalid(request, said)
    if status in (Status.FAILED, Status.STUCK) and _at_limit(request, statistics):
        status = Status.ITERATION_LIMIT
    if watch is not None and interruption.requested and status is not Status.SOLVED:
        status = Status.INTERRUPTED
    lost = status is Status.INTERRUPTED or failure is not None
    if lost and watch is not None and watch.best is not None:
        point = watch.best[2]
    found = {name: np.array(point[name]).ravel() for name in ("x", "lam_x", "lam_g")}
    return Outcome(
        status=status,
        w=found["x"],
        lam_g=found["lam_g"],
        lam_w=found["lam_x"],
        iterations=count_of(row, statistics),
        history=_history(statistics.get("iterations", {}), program.cost_scale),
        build_seconds=built - started,
        solve_seconds=solved - built,
        said=said,
        solver=row.name,
    )


def _built(program: Program, request: Request, watch: Watch | None) -> ca.Function:
    """Return the solver; what it prints about a wrong option becomes the message."""
    row = request.backend
    if known := row.known or _names(row):
        refuse_unknown(row, request.options, known)
    made = program.derivatives(row.derivatives)
    cached = {name: function for name, function in made.items() if name.startswith("nlp_")}
    options = {
        **QUIET,
        **settings(request, warm=program.start is not None),
        **{name: function for name, function in made.items() if name not in cached},
    }
    if cached:
        options["cache"] = cached
    if watch is not None:
        options["iteration_callback"] = watch
    printed = io.StringIO()
    try:
        with redirect_stdout(printed), redirect_stderr(printed):
            return ca.nlpsol("quito", row.plugin, program.values, options)
    except RuntimeError as error:
        lines = [line.strip() for line in printed.getvalue().splitlines() if line.strip()]
        raise refusal(row, lines[0] if lines else last_line(error)) from None


def _names(row: Backend) -> tuple[str, ...]:
    """Return the options of a plug-in that has them itself; nothing where it refuses by itself."""
    if row.group is not None:
        return ()
    return tuple(name for name in ca.nlpsol_options(row.plugin) if name not in OURS)


def _called(
    solver: ca.Function, program: Program, request: Request
) -> tuple[dict[str, Any], str | None]:
    """Return the point, or the guess and what the solver raised."""
    arguments: dict[str, Any] = {
        "x0": program.guess,
        "lbx": program.lower,
        "ubx": program.upper,
        "lbg": program.row_lower,
        "ubg": program.row_upper,
    }
    if program.start is not None:
        arguments |= {"lam_x0": program.start.lam_w, "lam_g0": program.start.lam_g}
    try:
        with quiet(request):
            return solver(**arguments), None
    except RuntimeError as error:
        if "option" in last_line(error).lower():
            raise refusal(request.backend, last_line(error)) from None
        zeros = np.zeros(len(program.guess)), np.zeros(len(program.row_lower))
        return {"x": program.guess, "lam_x": zeros[0], "lam_g": zeros[1]}, last_line(error)


def _statistics(solver: ca.Function) -> dict[str, Any]:
    """Return the solver's statistics; after a failure, some have none."""
    try:
        return dict(solver.stats())
    except RuntimeError:
        return {}


def _at_limit(request: Request, statistics: dict[str, Any]) -> bool:
    count = count_of(request.backend, statistics)
    return count is not None and count >= request.max_iterations


def _refuse_invalid(request: Request, said: str) -> None:
    """Refuse options that IPOPT takes when it is built, and finds wrong when it runs."""
    if said != "Invalid_Option":
        return
    linear_solver = request.options.get("linear_solver")
    if linear_solver not in (None, *LINEAR_SOLVERS):
        raise UnavailableError(
            f"the linear solver {linear_solver} is not in this installation of IPOPT; "
            f"{' and '.join(LINEAR_SOLVERS)} are"
        )
    raise UsageError(
        "IPOPT refuses an option: a linear solver that is not there, or a value out of range"
    )


def _history(recorded: dict[str, Any], scale: float) -> dict[str, Array]:
    """Return the iterations under our names, with the cost unscaled."""
    history = {
        ours: np.array(recorded[theirs], dtype=float)
        for ours, theirs in HISTORY.items()
        if theirs in recorded
    }
    if "objective" in history:
        history["objective"] = history["objective"] / scale
    return history
