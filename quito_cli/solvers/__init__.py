"""Nlp -> numbers: a table of backends, and a judgement that does not trust them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from quito_cli.solvers.outcome import Listener, Outcome, Progress, Status
from quito_cli.solvers.residuals import JUDGED_AT, Residuals, residuals
from quito_cli.transcription.transcribe import Nlp

__all__ = ["Listener", "Outcome", "Progress", "Residuals", "Status", "minimise"]


def minimise(
    nlp: Nlp,
    tolerance: float,
    max_iterations: int,
    options: dict[str, Any],
    listener: Listener | None,
) -> tuple[Outcome, Residuals]:
    """Solve `nlp` and judge the answer by residuals recomputed at the returned point.

    Raises:
        UsageError: the solver does not know an option.
    """
    from quito_cli.solvers import ipopt

    outcome = ipopt.solve(nlp, tolerance, max_iterations, options, listener)
    found = residuals(nlp, outcome)
    return replace(outcome, status=_judge(outcome.status, found, tolerance)), found


def _judge(said: Status, found: Residuals, tolerance: float) -> Status:
    """Return the status that the residuals allow."""
    if said is Status.INTERRUPTED:
        return said
    if found.largest <= JUDGED_AT * tolerance:
        return Status.SOLVED
    return Status.INACCURATE if said is Status.SOLVED else said
