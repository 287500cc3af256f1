"""The polish: structure assumed, solved, held against every inequality, revised, and again.

    assume    the structure that the arcs of the direct answer show
    solve     its boundary value problem; segments are halved until polynomials carry
    check     every inequality of Pontryagin's conditions
    revise    the worst one that does not hold tells which arc to drop, insert or release

until nothing is wrong, or nothing more is known to try. The polished answer replaces the direct one
only where all holds.
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from quito_cli.optimality.certificate.certificate import certify
from quito_cli.optimality.hamiltonian import pontryagin
from quito_cli.optimality.looking.look import Look
from quito_cli.optimality.parts.apart import mixed, split_answer
from quito_cli.optimality.parts.parted import parted
from quito_cli.optimality.polish.answer.answer import answer, answer_of_parts
from quito_cli.optimality.polish.answer.written import exact
from quito_cli.optimality.polish.equations.setting import Setting, UnsupportedError
from quito_cli.optimality.polish.reading.direct import Direct
from quito_cli.optimality.polish.search.attempts import Ending, Log
from quito_cli.optimality.polish.search.search import search
from quito_cli.optimality.symbols.probes import TooLargeError
from quito_cli.solution.polishing import Polishing, PolishStatus, PolishStep

if TYPE_CHECKING:
    from quito_cli.options import Options
    from quito_cli.problem.model import Model
    from quito_cli.problem.schema import Problem
    from quito_cli.solution.solution import Solution

LEAST_SECONDS = 5.0
"""That a polish may take however quick the solve before it was."""


def polish(problem: Problem, model: Model, options: Options, direct: Solution) -> Solution:
    """Return the polished answer, or the direct one with the account of why it stands.

    Controls with kinks are polished in parts.

    Args:
        problem: what was solved.
        model: its Model.
        options: as resolved for the direct solve.
        direct: its answer, with its arcs.
    """
    started, log = time.perf_counter(), Log()
    parts, sought_of, near = parted(model), model, direct
    if parts is not None:
        if parts.told:
            log.tell("assume", f"controls with kinks are taken apart: {parts.told}")
        sought_of, near = parts.model, split_answer(parts, direct)
        near = replace(near, extremal=certify(parts.model, near))
    ended = sought(sought_of, near, log)
    account = _account(ended, log, time.perf_counter() - started, direct)
    if ended.extremal is None:
        return replace(direct, polishing=account)
    extremal = exact(ended.extremal, account.residual)
    if parts is None:
        polished = answer(problem, model, options, extremal, direct, account, account.seconds)
        refusal = _refusal(polished)
    else:
        given = (problem, parts, options, extremal, near, account, account.seconds)
        own, polished = answer_of_parts(*given)
        refusal = _refusal(own) or mixed(parts, own, polished)
    if not refusal:
        return polished
    steps = (*account.steps[:-1], PolishStep("refuse", refusal))
    status = PolishStatus.NO_BETTER
    account = replace(account, status=status, reason=refusal, steps=steps, segments=0)
    return replace(direct, polishing=account)


def sought(model: Model, direct: Solution, log: Log) -> Ending:
    """Seek the extremal that a direct answer is near to."""
    if not direct.success or not np.isfinite(direct.costates).all():
        ended = Ending(PolishStatus.NO_ANSWER, direct.status.value)
    else:
        try:
            setting = Setting(pontryagin(model))
            with np.errstate(all="ignore"):
                near = Direct(setting, direct, Look.at(setting.system, direct))
                ended = search(near, log, time.thread_time() + _patience(direct))
        except TooLargeError:
            reason = "its formulas are too long to be worked on"
            ended = Ending(PolishStatus.NOT_DERIVED, reason)
        except UnsupportedError as error:
            ended = Ending(PolishStatus.UNSUPPORTED, str(error))
    accepted = ended.status is PolishStatus.POLISHED
    log.tell("accept" if accepted else "refuse", ended.reason or ended.status.value)
    return ended


def _patience(direct: Solution) -> float:
    """Return how many seconds a polish may take: no more than what went before it."""
    seconds = direct.statistics.build_seconds + direct.statistics.solve_seconds
    if direct.refinement is not None:
        seconds = sum(r.seconds for r in direct.refinement.rounds)
    return max(seconds, LEAST_SECONDS)


def _account(ended: Ending, log: Log, seconds: float, direct: Solution) -> Polishing:
    return Polishing(
        ended.status,
        ended.reason,
        tuple(log.steps),
        ended.residual,
        seconds,
        direct.cost,
        ended.extremal.at.segments if ended.extremal else 0,
        log.newton,
    )


def _refusal(polished: Solution) -> str:
    """Say what the evidence has against a polished answer; empty where it has nothing."""
    if not polished.success:
        return f"as a point of a collocation: {polished.status.value}"
    failing = [row for row in polished.certificate if row.verdict == "fails"]
    return f"{failing[0].condition} fails: {failing[0].reason}" if failing else ""
