"""Rows of the table: solvers of nonlinear programs that come with CasADi."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from quito_cli.solvers.backend import QRQP_QUIET, WITH_CASADI, Backend
from quito_cli.solvers.outcome import Status

_IPOPT = {
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
_SQP = {**_IPOPT, "Non_Regular_Sensitivities": Status.NOT_FINITE}
_UNO = {
    "Converged with feasible KKT point": Status.SOLVED,
    "Converged with feasible FJ point": Status.STUCK,
    "Converged with infeasible stationary point": Status.INFEASIBLE,
    "Terminated with feasible small step": Status.STUCK,
    "Terminated with infeasible small step": Status.STUCK,
    "Terminated with unbounded problem": Status.DIVERGED,
}
_SLEQP = {
    "optimal": Status.SOLVED,
    "infeasible": Status.INFEASIBLE,
    "unbounded": Status.DIVERGED,
    "deadpoint": Status.STUCK,
    "iteration limit": Status.ITERATION_LIMIT,
    "time limit": Status.TIME_LIMIT,
    "manual abort": Status.INTERRUPTED,
}
_BY_OPTIONS = {
    "grad_f": ("f", "grad_f_x"),
    "jac_g": ("g", "jac_g_x"),
    "hess_lag": ("triu_hess_gamma_x_x",),
}
_SQP_DERIVATIVES = {
    "hess_lag": ("hess_gamma_x_x",),
    "jac_fg": ("f", "grad_f_x", "g", "jac_g_x"),
}
_PUSH = 1e-3
_WARM = {
    "warm_start_init_point": "yes",
    "warm_start_bound_push": _PUSH,
    "warm_start_bound_frac": _PUSH,
    "warm_start_slack_bound_push": _PUSH,
    "warm_start_slack_bound_frac": _PUSH,
    "warm_start_mult_bound_push": _PUSH,
    "mu_init": 1e-7,
}
"""Stay near the earlier answer, with its multipliers and all but no barrier. Nearer its bounds, the
same program takes 2 iterations in place of 4, but one of another mesh more than a cold start."""
_SQP_QUIET = {"print_header": False, "print_iteration": False, "print_status": False}
_SHARP = 1e-10
"""Tolerance of the quadratic programs inside an SQP method."""


def _sqp(
    name: str, quadratic: str, algebra: str, inside: Mapping[str, Any], **given: Any
) -> Backend:
    """Return CasADi's SQP method with one of the solvers of its quadratic programs."""
    return Backend(
        name,
        f"sequential quadratic programming, steps by {quadratic}",
        "NLP",
        "nlpsol",
        "sqpmethod",
        algebra,
        WITH_CASADI,
        tolerances=("tol_pr", "tol_du"),
        iterations="max_iter",
        fixed=_SQP_QUIET,
        plugin_options={
            "qpsol": quadratic,
            "qpsol_options": {"error_on_fail": False, "print_time": False, **inside},
        },
        derivatives=_SQP_DERIVATIVES,
        statuses=_SQP,
        callback=True,
        warm={},
        **given,
    )


_UNO_OPTIONS = (
    *("preset", "primal_tolerance", "dual_tolerance", "loose_primal_tolerance"),
    *("loose_dual_tolerance", "loose_tolerance_iteration_threshold", "max_iterations"),
    *("time_limit", "print_solution", "unbounded_objective_threshold", "logger", "hessian_model"),
    *("inertia_correction_strategy", "progress_norm", "residual_norm"),
    *("residual_scaling_threshold", "constraint_relaxation_strategy", "globalization_mechanism"),
    *("globalization_strategy", "inequality_handling_method", "QP_solver", "LP_solver"),
    *("linear_solver", "TR_radius", "TR_min_radius", "TR_increase_factor", "TR_decrease_factor"),
    *("filter_type", "filter_beta", "filter_gamma", "filter_capacity", "barrier_function"),
    *("barrier_initial_parameter", "LS_backtracking_ratio", "quasi_newton_memory_size"),
    *("l1_constraint_violation_coefficient", "regularization_failure_threshold"),
)

ROWS = (
    Backend(
        "ipopt",
        "interior point with a filter",
        "NLP",
        "nlpsol",
        "ipopt",
        "mumps, spral",
        WITH_CASADI,
        group="ipopt",
        tolerances=("tol",),
        iterations="max_iter",
        fixed={
            "print_level": 0,
            "sb": "yes",
            "acceptable_iter": 0,  # nearly optimal is no reason to stop: singular arcs settle last
            "bound_relax_factor": 0.0,  # else every bound is overshot by 1e-8
            "nlp_scaling_method": "none",  # ours is in the program; a second one is too loose
        },
        derivatives=_BY_OPTIONS,
        statuses=_IPOPT,
        callback=True,
        warm=_WARM,
    ),
    _sqp(
        "sqp-qrqp",
        "qrqp",
        "sparse QR",
        {**QRQP_QUIET, "constr_viol_tol": _SHARP, "dual_inf_tol": _SHARP},
        only_free=True,
    ),
    _sqp("sqp-qpoases", "qpoases", "dense Cholesky", {"printLevel": "none"}),
    _sqp(
        "sqp-piqp",
        "piqp",
        "sparse LDL; convex steps only",
        {
            "piqp": {
                "eps_abs": _SHARP,
                "eps_rel": 0.0,
                "eps_duality_gap_abs": _SHARP,
                "eps_duality_gap_rel": 0.0,
            }
        },
    ),
    Backend(
        "qrsqp",
        "sequential quadratic programming, CasADi's with qrqp built in",
        "NLP",
        "nlpsol",
        "qrsqp",
        "sparse QR",
        WITH_CASADI,
        tolerances=("tol_pr", "tol_du"),
        iterations="max_iter",
        fixed={"print_header": False, "print_iteration": False},
        plugin_options={
            "qpsol_options": {
                **QRQP_QUIET,
                "error_on_fail": False,
                "constr_viol_tol": _SHARP,
                "dual_inf_tol": _SHARP,
            }
        },
        derivatives={
            "nlp_jac_fg": _SQP_DERIVATIVES["jac_fg"],
            "nlp_hess_l": _SQP_DERIVATIVES["hess_lag"],
        },
        statuses=_SQP,
        callback=True,
        warm={},
        only_free=True,
    ),
    Backend(
        "uno",
        "trust-region SQP with a filter; preset=ipopt for an interior point",
        "NLP",
        "nlpsol",
        "uno",
        "BQPD; mumps",
        WITH_CASADI,
        group="uno",
        tolerances=("primal_tolerance", "dual_tolerance"),
        iterations="max_iterations",
        fixed={"logger": "SILENT"},
        known=_UNO_OPTIONS,
        derivatives={
            "nlp_grad_f": ("grad_f_x",),
            "nlp_jac_g": ("jac_g_x",),
            "nlp_hess_l": ("triu_hess_gamma_x_x",),
        },
        statuses=_UNO,
        isolated=True,
    ),
    Backend(
        "sleqp",
        "active set by linear programs; two runs may differ, and some do not end",
        "NLP",
        "nlpsol",
        "sleqp",
        "HiGHS, mumps; Hessians as products",
        WITH_CASADI,
        accuracy=1e-6,
        group="sleqp",
        tolerances=("stat_tol", "feas_tol", "slack_tol"),
        iterations="max_iter",
        outside=("max_iter",),
        plugin_options={"print_level": 0},
        derivatives={"nlp_grad_f": ("f", "grad_f_x"), "nlp_jac_g": ("g", "jac_g_x")},
        statuses=_SLEQP,
        isolated=True,
    ),
    Backend(
        "fatrop",
        "interior point; without the stages it is made for, often stalls at fixed ends",
        "NLP",
        "nlpsol",
        "fatrop",
        "dense (BLASFEO)",
        WITH_CASADI,
        accuracy=1e-7,  # it relaxes bounds by 1e-8
        group="fatrop",
        tolerances=("tolerance",),
        iterations="max_iter",
        fixed={"print_level": 0},
        derivatives={
            "nlp_grad_f": ("grad_f_x",),
            "nlp_jac_g": ("g", "jac_g_x"),
            "nlp_hess_l": ("grad_gamma_x", "hess_gamma_x_x"),
        },
        statuses={"0": Status.SOLVED, "1": Status.STUCK},
        isolated=True,
        most_unknowns=2000,
    ),
)
