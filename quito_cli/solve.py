"""The pipeline itself: Problem -> Model -> Nlp -> numbers -> Solution."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from quito_cli.errors import UsageError
from quito_cli.options import SIZES, Options, too_large

if TYPE_CHECKING:
    from quito_cli.problem.model import Model
    from quito_cli.problem.schema import Problem
    from quito_cli.solution.solution import Solution
    from quito_cli.solvers.outcome import Listener
    from quito_cli.solving.on_mesh import Task


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
    from quito_cli.solution.follow import guided
    from quito_cli.solving.on_answer import polished
    from quito_cli.solving.on_mesh import Task

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
    _refuse_too_large(model, chosen, given)
    _refuse_warm_start(chosen, earlier, problem)
    task = Task(problem, model, chosen, chosen.tolerance, chosen.max_iterations, True, listener)
    warm = earlier if chosen.warm_start else None
    direct, stop = _direct(task, warm, time.perf_counter() - started)
    return polished(problem, model, chosen, direct, listener, stop)


def _direct(task: Task, warm: Solution | None, build_seconds: float) -> tuple[Solution, bool]:
    """Return the certified answer, and whether the user has asked to stop once it was found.

    It is that on the mesh asked for, or the best on those that refinement finds; the first solve
    starts from the multipliers of `warm`.
    """
    import numpy as np

    from quito_cli.solving.on_answer import certified
    from quito_cli.transcription.mesh import Mesh

    model, options = task.model, task.options
    points = np.array([point.at for point in model.constraints.point], dtype=float)
    mesh = Mesh.through(options.steps, points)
    if options.mesh == "uniform":
        return certified(model, task.on(mesh, warm, build_seconds)), False

    from quito_cli.refinement.refine import Limits, refine
    from quito_cli.solvers.interruption import interruptible
    from quito_cli.solving.on_mesh import method_on
    from quito_cli.solving.on_meshes import solver_of

    order = method_on(options, mesh).order
    limits = Limits(
        options.mesh_tolerance, options.mesh_iterations, options.most_cells, np.unique(points)
    )
    with interruptible() as interruption:
        solve_on = solver_of(task, warm, build_seconds, interruption)
        refined = refine(model, solve_on, mesh, options.substeps, order, limits)
        direct = certified(model, refined)
    return direct, direct.success and interruption.requested


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


def _refuse_too_large(model: Model, options: Options, given: set[str]) -> None:
    """Keep a file from asking for more than a machine has; a person may ask for anything.

    Raises:
        UsageError: the file's own steps and sizes make too large a program.
    """
    said = None if SIZES & given else too_large(model.n_x + model.n_u, options)
    if said:
        raise UsageError(f"the file asks for {said}; if you mean it, say so with -N")


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
