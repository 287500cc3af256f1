"""IPOPT, with exact derivatives assembled by the transcription."""

from __future__ import annotations

import io
import sys
import time
from collections.abc import Sequence
from contextlib import redirect_stderr, redirect_stdout
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from quito_cli.errors import UnavailableError, UsageError
from quito_cli.solvers.interruption import Interruption, interruptible
from quito_cli.solvers.outcome import Listener, Outcome, Progress, Status
from quito_cli.transcription.transcribe import Nlp

Array = NDArray[np.float64]

STATUSES = {
    "Solve_Succeeded": Status.SOLVED,
    "Solved_To_Acceptable_Level": Status.ACCEPTABLE,
    "Feasible_Point_Found": Status.ACCEPTABLE,
    "Infeasible_Problem_Detected": Status.INFEASIBLE,
    "Restoration_Failed": Status.STUCK,
    "Search_Direction_Becomes_Too_Small": Status.STUCK,
    "Error_In_Step_Computation": Status.STUCK,
    "Diverging_Iterates": Status.DIVERGED,
    "Maximum_Iterations_Exceeded": Status.ITERATION_LIMIT,
    "Maximum_CpuTime_Exceeded": Status.TIME_LIMIT,
    "Maximum_WallTime_Exceeded": Status.TIME_LIMIT,
    "Not_Enough_Degrees_Of_Freedom": Status.TOO_FEW_FREEDOMS,
    "Invalid_Number_Detected": Status.NOT_FINITE,
    "User_Requested_Stop": Status.INTERRUPTED,
}
HISTORY = {
    "objective": "obj",
    "primal_infeasibility": "inf_pr",
    "dual_infeasibility": "inf_du",
    "barrier_parameter": "mu",
}
LINEAR_SOLVERS = ("mumps", "spral")
"""Of IPOPT as CasADi ships it; others load libraries that it does not bring."""
FEASIBLE = 1e-6
"""Violation under which the better of two iterates is the cheaper one."""


class _Watch(ca.Callback):
    """Told of every iteration: reports it, keeps the best, stops on request."""

    def __init__(self, nlp: Nlp, listener: Listener | None, interruption: Interruption) -> None:
        ca.Callback.__init__(self)
        self._nlp, self._listener, self._interruption = nlp, listener, interruption
        self._sizes = {
            "x": len(nlp.guess),
            "f": 1,
            "g": len(nlp.row_lower),
            "lam_x": len(nlp.guess),
            "lam_g": len(nlp.row_lower),
            "lam_p": 0,
        }
        self._iteration = 0
        self.best: tuple[bool, float, dict[str, ca.DM]] | None = None
        self.construct("watch", {})

    def get_n_in(self) -> int:
        return int(ca.nlpsol_n_out())

    def get_n_out(self) -> int:
        return 1

    def get_name_in(self, i: int) -> str:
        return str(ca.nlpsol_out(i))

    def get_name_out(self, i: int) -> str:
        return "stop"

    def get_sparsity_in(self, i: int) -> ca.Sparsity:
        return ca.Sparsity.dense(self._sizes[ca.nlpsol_out(i)], 1)

    def eval(self, arguments: Sequence[ca.DM]) -> list[int]:
        """Look at one iterate; a one asks the solver to stop."""
        point = dict(zip(self._sizes, arguments, strict=True))
        g, f = np.array(point["g"]).ravel(), float(point["f"])
        rows = np.maximum(self._nlp.row_lower - g, g - self._nlp.row_upper)
        violation = float(np.max(rows, initial=0.0))
        # The latest iterate is the best, but for a feasible and cheaper one before it.
        feasible = violation <= FEASIBLE
        if self.best is None or not self.best[0] or (feasible and f <= self.best[1]):
            self.best = feasible, f, point
        if self._listener is not None:
            cost = f / self._nlp.objective_scale * self._nlp.transcription.model.sense
            self._listener(Progress(self._iteration, cost, violation))
        self._iteration += 1
        return [int(self._interruption.requested)]


def _settings(
    nlp: Nlp, watch: _Watch, tolerance: float, max_iterations: int, options: dict[str, Any]
) -> dict[str, Any]:
    """Return the options of `nlpsol`: quiet, exact derivatives, bounds kept, no early stop."""
    ipopt = {
        "print_level": 0,
        "sb": "yes",
        "tol": tolerance,
        "max_iter": max_iterations,
        "acceptable_iter": 0,  # nearly optimal is no reason to stop: singular arcs settle last
        "bound_relax_factor": 0.0,  # else every bound is overshot by 1e-8
        "nlp_scaling_method": "none",  # ours is in the program; a second one loosens the tolerance
        **options,
    }
    return {
        "print_time": False,
        "show_eval_warnings": False,
        "error_on_fail": False,
        "inputs_check": False,  # it only prints about problems with too many conditions
        "iteration_callback": watch,
        "grad_f": nlp.assembled.gradient,
        "jac_g": nlp.assembled.jacobian,
        "hess_lag": nlp.assembled.hessian,
        "ipopt": ipopt,
    }


def solve(
    nlp: Nlp,
    tolerance: float,
    max_iterations: int,
    options: dict[str, Any],
    listener: Listener | None,
) -> Outcome:
    """Minimise `nlp`.

    Raises:
        UsageError: IPOPT does not know an option, or its value.
        UnavailableError: a linear solver that is not in this installation.
    """
    assembled = nlp.assembled
    with interruptible() as interruption:
        started = time.perf_counter()
        watch = _Watch(nlp, listener, interruption)
        settings = _settings(nlp, watch, tolerance, max_iterations, options)
        program = {"x": assembled.unknowns, "f": assembled.objective, "g": assembled.constraints}
        solver = _built(program, settings)
        built = time.perf_counter()
        with redirect_stdout(sys.stderr):  # our stdout is for the answer
            point = solver(
                x0=nlp.guess,
                lbx=nlp.lower,
                ubx=nlp.upper,
                lbg=nlp.row_lower,
                ubg=nlp.row_upper,
            )
        solved = time.perf_counter()
    statistics = solver.stats()
    said = str(statistics.get("return_status", "unknown"))
    if said == "Invalid_Option" and options.get("linear_solver") not in (None, *LINEAR_SOLVERS):
        raise UnavailableError(
            f"the linear solver {options['linear_solver']} is not in this installation of IPOPT; "
            f"{' and '.join(LINEAR_SOLVERS)} are"
        )
    if said == "Invalid_Option":
        raise UsageError(
            "IPOPT refuses an option: a linear solver that is not there, or a value out of range"
        )
    status = STATUSES.get(said, Status.FAILED)
    if status is Status.INTERRUPTED and watch.best is not None:
        point = watch.best[2]
    found = {name: np.array(point[name]).ravel() for name in ("x", "lam_x", "lam_g")}
    return Outcome(
        status,
        found["x"],
        found["lam_g"],
        found["lam_x"],
        statistics.get("iter_count"),
        _history(
            statistics.get("iterations", {}),
            nlp.objective_scale * nlp.transcription.model.sense,
        ),
        built - started,
        solved - built,
        said,
        float(point["f"]) / nlp.objective_scale,
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


def _built(program: dict[str, ca.MX], settings: dict[str, Any]) -> ca.Function:
    """Return the solver; what IPOPT prints about a wrong option becomes the message."""
    printed = io.StringIO()
    try:
        with redirect_stdout(printed), redirect_stderr(printed):
            return ca.nlpsol("quito", "ipopt", program, settings)
    except RuntimeError as error:
        lines = [line.strip() for line in printed.getvalue().splitlines() if line.strip()]
        reason = lines[0] if lines else str(error).strip().splitlines()[-1].rpartition("cpp:")[2]
        raise UsageError(f"IPOPT refuses an option: {reason.lstrip('0123456789: ')}") from None
