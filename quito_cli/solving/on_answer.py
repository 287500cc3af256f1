"""What follows an answer: the certificate, and where it is asked for the polish.

A polish does no harm: where it comes to nothing, or is interrupted, the direct answer stands, with
the account of why.
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from quito_cli.options import Options
    from quito_cli.problem.model import Model
    from quito_cli.problem.schema import Problem
    from quito_cli.solution.polishing import Polishing
    from quito_cli.solution.solution import Solution
    from quito_cli.solvers.outcome import Listener

STAGE = "polish"
"""What who listens is told meanwhile."""


def certified(model: Model, solution: Solution) -> Solution:
    """Return an answer with what Pontryagin's conditions say of it."""
    from quito_cli.optimality.certificate.certificate import certify

    return replace(solution, extremal=certify(model, solution))


def polished(
    problem: Problem,
    model: Model,
    options: Options,
    direct: Solution,
    listener: Listener | None,
    stop: bool,
) -> Solution:
    """Return the polished answer, or the direct one with the account of why it stands.

    Args:
        problem: what is solved.
        model: the Model of it.
        options: resolved; what is not asked for is not done.
        direct: a certified answer.
        listener: told that the polish begins.
        stop: whether the user has asked to stop before it began.
    """
    if not options.polish:
        return direct
    from quito_cli.optimality.polish.polish import polish
    from quito_cli.solvers.outcome import Progress

    started = time.perf_counter()
    try:
        if stop:
            raise KeyboardInterrupt
        if listener is not None:
            listener(Progress(0, direct.cost, direct.evidence.feasibility, STAGE))
        found = polish(problem, model, options, direct)
    except KeyboardInterrupt:
        found = replace(direct, polishing=_interrupted(direct, time.perf_counter() - started))
    return found if found.polished else _standing(found, time.perf_counter() - started)


def _standing(direct: Solution, seconds: float) -> Solution:
    """Return a direct answer with the time that its polish took."""
    statistics = direct.statistics
    whole = replace(statistics, solve_seconds=statistics.solve_seconds + seconds)
    return replace(direct, statistics=whole)


def _interrupted(direct: Solution, seconds: float) -> Polishing:
    from quito_cli.solution.polishing import Polishing, PolishStatus

    nan = float("nan")
    return Polishing(
        status=PolishStatus.INTERRUPTED,
        reason="",
        steps=(),
        residual=nan,
        seconds=seconds,
        cost_before=direct.cost,
        segments=0,
        newton_steps=0,
    )
