"""Nlp -> numbers: a table of backends, and a judgement that does not trust them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from quito_cli.errors import UnavailableError, UsageError
from quito_cli.solvers.asking import Request
from quito_cli.solvers.backend import Backend
from quito_cli.solvers.outcome import Listener, Outcome, Progress, Status
from quito_cli.solvers.program import Program, Start, start_at
from quito_cli.solvers.residuals import JUDGED_AT, Residuals, residuals
from quito_cli.solvers.table import AUTOMATIC, SOLVERS, backend
from quito_cli.transcription.transcribe import Nlp

if TYPE_CHECKING:
    from quito_cli.solvers.engines import Engine

__all__ = [
    "AUTOMATIC",
    "SOLVERS",
    "Backend",
    "Listener",
    "Outcome",
    "Progress",
    "Residuals",
    "Start",
    "Status",
    "backend",
    "judged",
    "judged_at",
    "minimise",
    "start_at",
]

FOR_ALL = "ipopt"
"""What `auto` takes for a program that is not quadratic, and where the other one fails."""
FOR_QUADRATIC = "piqp"
"""What `auto` takes for a quadratic program: see the README for what was measured."""


def minimise(
    nlp: Nlp,
    solver: str,
    tolerance: float,
    max_iterations: int,
    options: Mapping[str, Any],
    listener: Listener | None,
    start: Start | None,
) -> tuple[Outcome, Residuals]:
    """Solve `nlp` and judge the answer by residuals recomputed at the returned point.

    Args:
        nlp: what to solve; its guess is where to start.
        solver: a row of the table, or `auto`.
        tolerance: of the scaled first-order conditions.
        max_iterations: after which the solver gives up.
        options: by the solver's own names.
        listener: told of every iteration, where the solver tells.
        start: multipliers to start from.

    Raises:
        UsageError: no such solver or option, or a program that the solver does not take.
        UnavailableError: a solver that is not in this installation.
    """
    if solver == AUTOMATIC:
        return _automatic(nlp, tolerance, max_iterations, options, listener, start)
    row = backend(solver)
    _check(row, nlp, start)
    outcome = _solved(nlp, Request(row, tolerance, max_iterations, options, listener), start)
    found = residuals(nlp, outcome)
    return judged(outcome, found, tolerance), found


def judged_at(row: Backend, tolerance: float) -> float:
    """Return the tolerance that an answer of `row` is judged by: no less than it can attain."""
    return max(tolerance, row.accuracy)


def _automatic(
    nlp: Nlp,
    tolerance: float,
    max_iterations: int,
    options: Mapping[str, Any],
    listener: Listener | None,
    start: Start | None,
) -> tuple[Outcome, Residuals]:
    """Solve a quadratic program by the solver made for them; all else, and what it fails at, not.

    Options by a solver's own names, and multipliers to start from, are those of `FOR_ALL`.
    """
    direct = not options and start is None and nlp.nonlinearity is None
    if direct and tolerance >= SOLVERS[FOR_QUADRATIC].accuracy:
        first = minimise(nlp, FOR_QUADRATIC, tolerance, max_iterations, {}, listener, None)
        if first[0].status in (Status.SOLVED, Status.INTERRUPTED):
            return first
    return minimise(nlp, FOR_ALL, tolerance, max_iterations, options, listener, start)


def _check(row: Backend, nlp: Nlp, start: Start | None) -> None:
    """Refuse what `row` cannot do.

    Raises:
        UsageError, UnavailableError: see `minimise`.
    """
    from quito_cli.solvers.availability import available

    if not available(row):
        raise UnavailableError(
            f"the solver {row.name} is not in this installation; it needs {row.provides}"
        )
    if row.takes == "QP" and nlp.nonlinearity is not None:
        raise UsageError(
            f"{row.name} solves quadratic programs, and this is none: {nlp.nonlinearity}"
        )
    if start is not None and row.warm is None:
        able = ", ".join(other.name for other in SOLVERS.values() if other.warm is not None)
        raise UsageError(f"{row.name} cannot start warm; {able} can")
    if row.most_unknowns is not None and len(nlp.guess) > row.most_unknowns:
        raise UsageError(
            f"{row.name} is for programs of up to {row.most_unknowns} unknowns, and this has "
            f"{len(nlp.guess)}: take fewer --steps, or another solver"
        )


def _solved(nlp: Nlp, request: Request, start: Start | None) -> Outcome:
    """Return the outcome in terms of all unknowns."""
    whole = Program.of(nlp, start)
    row = request.backend
    if (row.isolated or row.engine == "scipy") and not whole.finite(whole.guess):
        return _undefined(whole, row)  # some of these would never end
    program = whole.of_free_unknowns() if row.only_free else whole
    outcome = _engine(row)(program, request)
    if not row.only_free:
        return outcome
    w, lam_w = np.where(whole.free, 0.0, whole.lower), np.zeros(len(whole.lower))
    w[whole.free], lam_w[whole.free] = outcome.w, outcome.lam_w
    return replace(outcome, w=w, lam_w=lam_w)


def _engine(row: Backend) -> Engine:
    """Return what solves programs, in a process of its own where that is safer."""
    if row.isolated:
        from quito_cli.solvers import child

        return child.solve
    from quito_cli.solvers.engines import ENGINES

    return ENGINES[row.engine]()


def _undefined(program: Program, row: Backend) -> Outcome:
    """Return the guess, at which something is not finite."""
    zeros = np.zeros(len(program.row_lower)), np.zeros(len(program.guess))
    said = "not asked: the guess is undefined"
    return Outcome(Status.NOT_FINITE, program.guess, *zeros, 0, {}, 0.0, 0.0, said, row.name)


def judged(outcome: Outcome, found: Residuals, tolerance: float) -> Outcome:
    """Return the outcome with the status that the residuals allow at a tolerance."""
    if outcome.status is Status.INTERRUPTED:
        return outcome
    if found.largest <= JUDGED_AT * judged_at(SOLVERS[outcome.solver], tolerance):
        return replace(outcome, status=Status.SOLVED)
    return (
        replace(outcome, status=Status.INACCURATE) if outcome.status is Status.SOLVED else outcome
    )
