"""The pipeline itself: Problem -> Model -> Nlp -> numbers -> Solution; and the options with their
defaults, which are here and nowhere else."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from quito_cli.errors import UsageError

if TYPE_CHECKING:
    from quito_cli.problem.model import Model
    from quito_cli.problem.options import CommonOptions
    from quito_cli.problem.schema import Problem
    from quito_cli.solution.solution import Solution
    from quito_cli.solvers import Residuals
    from quito_cli.solvers.outcome import Listener, Outcome
    from quito_cli.transcription.control import Basis, ControlBasis
    from quito_cli.transcription.method import Method
    from quito_cli.transcription.transcribe import Nlp


@dataclass(frozen=True)
class Options:
    """How to solve; what each means is said in `quito_cli.problem.options`."""

    steps: int = 100
    variance: float = 2.0
    generating_function: str = "gaussian"
    normalised: bool = True
    control: str = "quasi-interpolant"
    discretization: str = "rk4"
    substeps: int = 2
    degree: int = 4
    tolerance: float = 1e-9
    max_iterations: int = 1000
    solver: str = "ipopt"
    objective_scale: float | None = None
    path_points: Literal["nodes", "substeps"] | None = None
    guess: str | None = None
    warm_start: bool = False
    solver_options: Mapping[str, float | int | bool | str] = field(default_factory=dict)

    @classmethod
    def resolve(cls, file: CommonOptions, given: Mapping[str, Any]) -> Options:
        """Return the options of a solve: given ones, then the file's, then the defaults.

        Args:
            file: what the problem file asks for.
            given: what the call or the command line asks for; None counts as not given.

        Raises:
            UsageError: an unknown option, a wrong value, or options that exclude each other.
        """
        from quito_cli.problem.options import idle, refuse_idle

        asked = _checked(given)
        wanted = file.model_dump(exclude_none=True)
        if "solver" in asked and asked["solver"] != wanted.get("solver", cls.solver):
            wanted.pop("solver_options", None)  # the file's are for the file's solver
        discretization = asked.get("discretization", wanted.get("discretization"))
        if discretization != wanted.get("discretization"):
            for name in idle(discretization):  # the file's choice was for the file's method
                wanted.pop(name, None)
        if "control" in asked and asked["control"] != wanted.get("control", cls.control):
            for name in QUASI_INTERPOLANT_ONLY:  # the file's choice was for the file's control
                wanted.pop(name, None)
        wanted["solver_options"] = wanted.get("solver_options", {}) | asked.pop(
            "solver_options", {}
        )
        wanted |= asked
        refuse_idle(wanted, discretization)
        control = wanted.get("control", cls.control)
        for name in QUASI_INTERPOLANT_ONLY:
            if control != "quasi-interpolant" and name in wanted:
                raise UsageError(
                    f"{name.replace('_', '-')} belongs to quasi-interpolants; a {control} control "
                    "has none: leave it out"
                )
        return replace(cls(), **wanted)

    @property
    def record(self) -> dict[str, Any]:
        """By name, those that mean something to the discretization."""
        from quito_cli.problem.options import idle

        return {k: v for k, v in asdict(self).items() if k not in idle(self.discretization)}


MOST_OF_A_FILE = 1_000_000
"""Variables times substeps that a file may ask for by itself."""
DENSE_POINTS = 20
"""Points of a collocation that depend on one another as much as a step costs."""
RESCALINGS = 2
"""Solves that may follow because the guess misjudged the size of the cost."""
QUASI_INTERPOLANT_ONLY = ("variance", "generating_function", "normalised")
"""Options that mean nothing to the classical controls."""
MESH_TOLERANCE = 1e-3
"""Error of the control, relative to its range, that a mesh is expected to reach."""
SATURATION_LIMIT = MESH_TOLERANCE / 10
"""Saturation of the control, relative to its range, above which there is a warning."""
CLASSICAL_CONTROLS = {"piecewise-constant": "box", "piecewise-linear": "hat"}
"""Controls that are a generating function of their own."""


def solve(
    problem: str | Path | Problem,
    *,
    constants: Mapping[str, str | float] | None = None,
    listener: Listener | None = None,
    **options: Any,
) -> Solution:
    """Solve an optimal control problem.

    Args:
        problem: a path, the name of a bundled problem, or a Problem.
        constants: constants to set, by name, or other values by dotted path.
        listener: told of every iteration of the solver.
        **options: fields of `Options`; `guess` may be an earlier Solution or the path of one.

    Returns:
        The Solution, with its evidence; whether it is one, says `solution.success`.

    Raises:
        UsageError: a wrong option, or no such problem.
        ProblemError: mistakes in the problem file, all of them told.
    """
    import casadi  # noqa: F401 - before the clock starts

    from quito_cli.problem.build import build
    from quito_cli.problem.load import changed, load
    from quito_cli.solution.extract import extract
    from quito_cli.solution.follow import guided

    if isinstance(problem, str | Path):
        problem = load(problem)
    problem = changed(problem, constants or {})
    earlier, guess = _earlier(options.pop("guess", None))
    given = {name for name, value in options.items() if value is not None}
    chosen = replace(Options.resolve(problem.options, options), guess=guess)
    started = time.perf_counter()
    model = build(problem)
    if earlier is not None:
        model = guided(model, earlier)
    _refuse_too_large(model, chosen, bool({"steps", "degree"} & given))
    _refuse_warm_start(chosen, earlier, problem)
    method = _method(model, chosen)
    built = time.perf_counter() - started
    nlp, outcome, residuals, transcribed = _minimised(
        model, method, chosen, earlier if chosen.warm_start else None, listener
    )
    built += transcribed
    doubt = control_warning(model, method.basis)
    nlp = replace(nlp, notes=nlp.notes + ((doubt,) if doubt else ()))
    return extract(problem, nlp, outcome, residuals, chosen.record, built)


def _method(model: Model, options: Options) -> Method:
    """Return what the options make the problem finite with.

    Raises:
        UsageError: too few cells for the points of the problem, or too small a variance.
    """
    import numpy as np

    from quito_cli.problem.options import COLLOCATION
    from quito_cli.transcription.cells import Discretization
    from quito_cli.transcription.collocation import Collocation
    from quito_cli.transcription.mesh import Mesh
    from quito_cli.transcription.schemes import scheme

    points = [constraint.at for constraint in model.constraints.point]
    mesh = Mesh.through(options.steps, np.array(points, dtype=float))
    if options.discretization == COLLOCATION:
        return Collocation(mesh, options.degree)
    rows = scheme(options.discretization)
    return Discretization(mesh, control_basis(options), rows, options.substeps)


def _minimised(
    model: Model,
    method: Method,
    options: Options,
    warm: Solution | None,
    listener: Listener | None,
) -> tuple[Nlp, Outcome, Residuals, float]:
    """Return program, answer, residuals and the seconds of transcription.

    An earlier answer to start from `warm` gives its multipliers, too. Where the guess was so costly
    that its scale makes the objective count for nothing, it is solved again from the answer, with
    the scale that the cost found calls for.
    """
    from quito_cli.solution.follow import resumed
    from quito_cli.solvers import Status, minimise
    from quito_cli.transcription.transcribe import FAR_TOO_SMALL, transcribe, wanted_scale

    started = time.perf_counter()
    nlp = transcribe(model, method, options.objective_scale, options.path_points)
    nlp, start = (nlp, None) if warm is None else resumed(nlp, warm)
    seconds = time.perf_counter() - started
    settings = (
        options.solver,
        options.tolerance,
        options.max_iterations,
        options.solver_options,
        listener,
    )
    outcome, residuals = minimise(nlp, *settings, start)
    for _ in range(RESCALINGS if options.objective_scale is None else 0):
        scale = wanted_scale(residuals.cost)
        if nlp.objective_scale > FAR_TOO_SMALL * scale or outcome.status is Status.INTERRUPTED:
            break
        before, started = outcome, time.perf_counter()
        nlp = replace(transcribe(model, method, scale, options.path_points), guess=outcome.w)
        seconds += time.perf_counter() - started
        outcome, residuals = minimise(nlp, *settings, None)
        outcome = outcome.following(before)
    return nlp, outcome, residuals, seconds


def _refuse_warm_start(options: Options, earlier: Solution | None, problem: Problem) -> None:
    """Refuse a warm start without a result of the same problem.

    Raises:
        UsageError: there is none, or one of another problem.
    """
    if options.warm_start and earlier is None:
        raise UsageError("a warm start needs an earlier result: give one with --guess")
    if options.warm_start and earlier is not None and earlier.origin.name != problem.name:
        raise UsageError(
            f"a warm start takes the multipliers of the same problem, and the result is one of "
            f"{earlier.origin.name}: leave --warm-start out to take it as a guess alone"
        )


def _refuse_too_large(model: Model, options: Options, asked: bool) -> None:
    """Keep a file from asking for more than a machine has; a person may ask for anything.

    Raises:
        UsageError: the file's own steps and sizes make too large a program.
    """
    from quito_cli.problem.options import COLLOCATION

    each, what, dense = options.substeps, "steps", 1
    if options.discretization == COLLOCATION:
        each, what, dense = options.degree, "points", 1 + options.degree // DENSE_POINTS
    size = (model.n_x + model.n_u) * options.steps * each * dense
    if size > MOST_OF_A_FILE and not asked:
        raise UsageError(
            f"the file asks for {options.steps} cells of {each} {what} with "
            f"{model.n_x + model.n_u} states and controls, which may take hours and all memory; if "
            "you mean it, say so with -N"
        )


def _earlier(guess: str | Path | Solution | None) -> tuple[Solution | None, str | None]:
    """Return an earlier answer to start from, and how it is recorded."""
    if guess is None:
        return None, None
    from quito_cli.problem.load import refuse_problem
    from quito_cli.solution.solution import Solution

    if isinstance(guess, Solution):
        return guess, guess.origin.name
    refuse_problem(guess, "start from")
    return Solution.load(guess), str(guess)


def control_basis(options: Options) -> ControlBasis:
    """Return the control's functions on `options.steps` cells.

    Where the scheme looks at û in too few points, ghosts that none of them could determine are left
    out.

    Raises:
        UsageError: a variance too small for the generating function.
    """
    from quito_cli.transcription.cells import points_seen
    from quito_cli.transcription.control import ControlBasis
    from quito_cli.transcription.generating import (
        GENERATING_FUNCTIONS,
        check_variance,
        generating_function,
    )
    from quito_cli.transcription.schemes import scheme

    classical = CLASSICAL_CONTROLS.get(options.control)
    if classical is not None:
        return ControlBasis(GENERATING_FUNCTIONS[classical], options.steps, 1.0, True)
    row = generating_function(options.generating_function)
    check_variance(row, options.variance)
    basis = ControlBasis(row, options.steps, options.variance, options.normalised)
    seen = points_seen(scheme(options.discretization), options.substeps, options.steps)
    most = max(-1 if options.steps > 2 else 0, (seen - options.steps - 1) // 2)
    return basis if basis.ghosts <= most else replace(basis, most_ghosts=most)


def control_warning(model: Model, basis: Basis) -> str | None:
    """Return what there is to say against a control's generating function and variance."""
    from quito_cli.transcription.control import ControlBasis
    from quito_cli.transcription.qualities import saturation_warning

    if not isinstance(basis, ControlBasis):
        return None
    bounds = model.control_bounds
    return saturation_warning(basis, bounds.lower, bounds.upper, SATURATION_LIMIT)


def _checked(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the given options, validated, without those that are None."""
    from pydantic import ValidationError

    from quito_cli.problem.keys import option_hint
    from quito_cli.problem.options import RequestedOptions
    from quito_cli.problem.wording import expected

    known = [f.name for f in fields(Options) if f.name != "guess"]
    for name in given:
        if name not in known:
            raise UsageError(f"there is no option '{name}'{option_hint(name, known)}")
    present = {name: value for name, value in given.items() if value is not None}
    try:
        return RequestedOptions.model_validate(present).model_dump(exclude_none=True)
    except ValidationError as error:
        messages = [
            f"{str(detail['loc'][0]).replace('_', '-')}: {expected(detail)}"
            for detail in error.errors()
        ]
        raise UsageError("\n".join(messages)) from None
