"""What a polish came to, for people and for programs."""

from __future__ import annotations

from dataclasses import asdict
from textwrap import wrap
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from quito_cli.solution.polishing import Polishing, PolishStep
    from quito_cli.solution.solution import Solution

_WIDTH = 90
"""Of a sentence in the summary."""


def polish_rows(solution: Solution) -> list[tuple[str, str]]:
    """Return how the polish ended, in a line where it came to an end; none where none was asked."""
    how = solution.polishing
    if how is None:
        return []
    label = "polished" if how.polished else "not polished"
    said = _success(solution, how) if how.polished else (_failure(how),)
    lines = [line for sentence in said for line in wrap(sentence, _WIDTH)]
    return [(label if i == 0 else "", line) for i, line in enumerate(lines)]


def _success(solution: Solution, how: Polishing) -> tuple[str, str]:
    count = len(solution.switching_times)
    figures = (
        _counted(count, "junction"),
        f"residual {how.residual:.0e}",
        _counted(how.newton_steps, "Newton step"),
        f"{how.seconds:.2g} s",
    )
    moved = f"{solution.cost - how.cost_before:+.1e}"
    solved = f"Pontryagin's system solved: {', '.join(figures)}"
    return solved, f"cost moved by {moved} from the direct answer's"


def _failure(how: Polishing) -> str:
    return f"{how.outcome}; the direct answer stands"


def _counted(count: int, what: str) -> str:
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


def polishing_as_dictionary(how: Polishing | None) -> dict[str, Any] | None:
    """Return the account of a polish; None where none was asked for."""
    if how is None:
        return None
    said = {
        "status": how.status.name.lower(),
        "message": how.status.value,
        "polished": how.polished,
    }
    return asdict(how) | said | {"steps": [_step_as_dictionary(step) for step in how.steps]}


def _step_as_dictionary(step: PolishStep) -> dict[str, Any]:
    return asdict(step) | {"residuals": list(step.residuals)}
