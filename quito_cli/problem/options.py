"""What may be asked of a solve, and what a problem file may ask for.

Defaults are not here: they live in `quito_cli.options.Options`, and only there. A field that is
None was not asked for.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal, get_args

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    WithJsonSchema,
    field_validator,
)
from pydantic_core import InitErrorDetails, PydanticCustomError

from quito_cli.errors import UsageError

GeneratingFunctionName = Literal[
    "gaussian", "laguerre4", "laguerre6", "hermite10", "trigonometric", "sech"
]
ControlName = Literal["quasi-interpolant", "piecewise-constant", "piecewise-linear"]
DiscretizationName = Literal["euler", "trapezoidal", "rk4", "hermite-simpson", "radau", "lgr"]
PathPointsName = Literal["nodes", "substeps"]
SolverName = Literal[
    "auto",
    "ipopt",
    "sqp-qrqp",
    "sqp-qpoases",
    "sqp-piqp",
    "qrsqp",
    "uno",
    "sleqp",
    "fatrop",
    "scipy-slsqp",
    "scipy-trust-constr",
    "piqp",
    "qrqp",
    "qpoases",
    "highs",
    "osqp",
    "knitro",
    "snopt",
    "worhp",
    "madnlp",
    "conopt",
]

_BY_NUMBER = dict(zip("123456", get_args(GeneratingFunctionName), strict=True))


def _name_of_number(value: Any) -> Any:
    """The paper numbers its generating functions; 1 and "1" are `gaussian`."""
    return _BY_NUMBER.get(str(value), value)


_SHORT = {"sqpmethod": "sqp-qrqp", "scipy": "scipy-trust-constr", "fmincon": "scipy-trust-constr"}
"""What a family of solvers stands for when it is asked for by its own name."""


def _solver_of(value: Any) -> Any:
    """CasADi's, SciPy's and MATLAB's own names are understood too."""
    return _SHORT.get(value, value) if isinstance(value, str) else value


COLLOCATION: DiscretizationName = "lgr"
"""The discretization that is no shooting."""
SHOOTING_ONLY = ("control", "variance", "generating_function", "normalised", "substeps")
"""Options that mean nothing to a collocation: its control is the polynomial through its points."""
COLLOCATION_ONLY = ("degree",)
"""Options that mean nothing to shooting."""


def idle(discretization: str | None) -> tuple[str, ...]:
    """Return the options that mean nothing to a discretization."""
    return SHOOTING_ONLY if discretization == COLLOCATION else COLLOCATION_ONLY


def refuse_idle(wanted: Mapping[str, Any], discretization: str | None) -> None:
    """Refuse options that mean nothing to the discretization, and a mesh that it has none of.

    Raises:
        UsageError: there is one.
    """
    for name in idle(discretization):
        if name in wanted and name in COLLOCATION_ONLY:
            raise UsageError(
                f"{name} belongs to collocation: add --discretization {COLLOCATION}, or leave it "
                "out"
            )
        if name in wanted:
            raise UsageError(
                f"{name.replace('_', '-')} means nothing to {COLLOCATION}, whose control is the "
                "polynomial through its points: leave it out, or ask for another discretization"
            )
    if discretization == COLLOCATION and wanted.get("mesh") == "adaptive":
        raise UsageError(
            f"an adaptive mesh follows the control of a shooting method, and {COLLOCATION} is "
            "none: leave the mesh out, or ask for another discretization"
        )


class CommonOptions(BaseModel):
    """What anyone may ask for, each with its meaning."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)

    steps: Annotated[int | None, Field(ge=1, strict=True)] = None
    """Number N of control cells."""
    variance: Annotated[float | None, Field(gt=0)] = None
    """Shape parameter D of the generating function: larger is smoother."""
    generating_function: Annotated[
        GeneratingFunctionName | None,
        BeforeValidator(
            _name_of_number,
            json_schema_input_type=GeneratingFunctionName | Literal[1, 2, 3, 4, 5, 6],
        ),
    ] = None
    """Generating function of the quasi-interpolant, by name or by the paper's number, 1 to 6."""
    normalised: bool | None = None
    """Divide by the sum of weights (default); `false` gives the paper's sum as printed."""
    control: ControlName | None = None
    """How the control is represented."""
    discretization: DiscretizationName | None = None
    """Integration scheme of states and cost in every control cell; or `lgr`, collocation at
    Legendre-Gauss-Radau points, whose control is the polynomial through them."""
    substeps: Annotated[int | None, Field(ge=1, strict=True)] = None
    """Steps of the scheme in each control cell."""
    degree: Annotated[int | None, Field(ge=1, strict=True)] = None
    """Degree of the states' polynomials, and points, in each cell of a collocation."""
    mesh: Literal["uniform", "adaptive"] | None = None
    """Equal cells, or cells that follow the control: small at its jumps and kinks."""
    mesh_steps: Annotated[int | None, Field(ge=4, le=200, strict=True)] = None
    """Cells that an adaptive mesh starts from."""
    mesh_tolerance: Annotated[float | None, Field(ge=1e-5, le=0.1)] = None
    """Change of the control from mesh to mesh, outside its jumps and relative to its range, at
    which refinement ends."""
    mesh_iterations: Annotated[int | None, Field(ge=1, le=30, strict=True)] = None
    """Meshes that are tried at most."""
    mesh_limit: Annotated[int | None, Field(ge=4, le=100_000, strict=True)] = None
    """Cells that an adaptive mesh may come to; by default twice those it starts from."""
    polish: bool | None = None
    """Solve Pontryagin's conditions with the structure that the answer shows; the exact answer
    takes its place where it comes to one. Unless a mesh is asked for, it is an adaptive one."""
    tolerance: Annotated[float | None, Field(gt=0, le=1e-3)] = None
    """Tolerance of the solver on the scaled first-order conditions."""
    max_iterations: Annotated[int | None, Field(ge=0, strict=True)] = None
    """Iterations after which the solver gives up."""
    solver: Annotated[
        SolverName | None,
        BeforeValidator(
            _solver_of, json_schema_input_type=SolverName | Literal["sqpmethod", "scipy", "fmincon"]
        ),
    ] = None
    """What solves the discretized problem, as listed by `quito solvers`; `auto` takes a solver of
    quadratic programs for those."""
    path_points: PathPointsName | None = None
    """Where inequalities along the path hold: at nodes, or at all substep offsets; by default at
    the offsets for those that contain a control, at the nodes for those of states alone. An
    equality with a control always holds at as many points as determine the control. With `lgr` the
    offsets are its points, and the default for all."""
    solver_options: dict[str, float | int | bool | str] | None = None
    """Options of the solver, by its own names."""


_SWITCH = ("yes", "no")
_ALLOWED: dict[str, tuple[str, ...] | None] = {
    # numbers
    "acceptable_tol": None,
    "acceptable_iter": None,
    "acceptable_dual_inf_tol": None,
    "acceptable_constr_viol_tol": None,
    "acceptable_compl_inf_tol": None,
    "barrier_tol_factor": None,
    "bound_frac": None,
    "bound_push": None,
    "bound_relax_factor": None,
    "compl_inf_tol": None,
    "constr_viol_tol": None,
    "dual_inf_tol": None,
    "kappa_d": None,
    "kappa_sigma": None,
    "max_cpu_time": None,
    "max_refinement_steps": None,
    "max_soc": None,
    "max_wall_time": None,
    "mu_init": None,
    "mu_linear_decrease_factor": None,
    "mu_max": None,
    "mu_max_fact": None,
    "mu_min": None,
    "mu_superlinear_decrease_power": None,
    "mu_target": None,
    "nlp_scaling_max_gradient": None,
    "obj_scaling_factor": None,
    "slack_bound_frac": None,
    "slack_bound_push": None,
    "tau_min": None,
    "watchdog_shortened_iter_trigger": None,
    # switches and choices
    "accept_every_trial_step": _SWITCH,
    "expect_infeasible_problem": _SWITCH,
    "fast_step_computation": _SWITCH,
    "honor_original_bounds": _SWITCH,
    "mehrotra_algorithm": _SWITCH,
    "mu_oracle": ("probing", "loqo", "quality-function"),
    "mu_strategy": ("monotone", "adaptive"),
    "nlp_scaling_method": ("none", "gradient-based", "equilibration-based"),
    "start_with_resto": _SWITCH,
}
"""What a problem file may set of IPOPT: numbers and switches. Nothing here names a path, a library
or a plug-in: problem files are untrusted, the command line may pass anything."""


_ALLOWED_SCHEMA: dict[str, Any] = {
    "type": "object",
    "additionalProperties": False,
    "properties": {
        name: {"type": "number"} if choices is None else {"type": "string", "enum": list(choices)}
        for name, choices in _ALLOWED.items()
    },
}


def refuse_solver_option(name: str, value: object) -> str | None:
    """Return why a problem file may not set this solver option, or None if it may."""
    if name not in _ALLOWED:
        return (
            f"a problem file may not set the solver option '{name}', only numbers and switches "
            f"from a list of safe ones; if you trust it, pass --solver-option {name}=... yourself"
        )
    choices = _ALLOWED[name]
    if choices is not None:
        return None if value in choices else f"'{name}' takes {' or '.join(choices)}"
    if isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value):
        return None
    return f"'{name}' takes a number"


class RequestedOptions(CommonOptions):
    """What a call or a command line may ask for."""

    objective_scale: Annotated[float | None, Field(gt=0)] = None
    """Factor of the cost in the nonlinear program; by default chosen from the cost's size."""
    warm_start: bool | None = None
    """Take the multipliers of the guess, an earlier result, too, and start at its bounds."""


class FileOptions(CommonOptions):
    """What a problem file may ask for; the command line wins."""

    steps: Annotated[int | None, Field(ge=1, le=20_000, strict=True)] = None
    """Number N of control cells."""
    variance: Annotated[float | None, Field(gt=0, le=100)] = None
    """Shape parameter D of the generating function: larger is smoother."""
    mesh_limit: Annotated[int | None, Field(ge=4, le=20_000, strict=True)] = None
    """Cells that an adaptive mesh may come to; by default twice those it starts from."""
    substeps: Annotated[int | None, Field(ge=1, le=20, strict=True)] = None
    """Steps of the scheme in each control cell."""
    degree: Annotated[int | None, Field(ge=1, le=200, strict=True)] = None
    """Degree of the states' polynomials, and points, in each cell of a collocation."""
    max_iterations: Annotated[int | None, Field(ge=0, le=10_000, strict=True)] = None
    """Iterations after which the solver gives up."""
    solver_options: Annotated[
        dict[str, float | int | bool | str] | None, WithJsonSchema(_ALLOWED_SCHEMA)
    ] = None
    """Numbers and switches of IPOPT, by its own names, from a list of safe ones."""

    @field_validator("solver_options")
    @classmethod
    def _only_safe_ones(cls, options: dict[str, object] | None) -> dict[str, object] | None:
        refused = []
        for name, value in (options or {}).items():
            if reason := refuse_solver_option(name, value):
                kind = "value_error" if name in _ALLOWED else "refused_key"
                error = PydanticCustomError(kind, "{error}", {"error": reason})
                refused.append(InitErrorDetails(type=error, loc=(name,), input=value))
        if refused:
            raise ValidationError.from_exception_data("solver_options", refused)
        return options
