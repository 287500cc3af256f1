"""What a polish did, step by step, for people."""

from __future__ import annotations

import math
from textwrap import wrap
from typing import TYPE_CHECKING, Final

import typer

from quito_cli.cli.text import columns, labelled, plain
from quito_cli.solution.polishing import Action
from quito_cli.solution.tally import CAVEAT
from quito_cli.summary.arcs import arc_rows, pontryagin_rows
from quito_cli.summary.polishing import polish_rows

if TYPE_CHECKING:
    from collections.abc import Sequence

    from quito_cli.solution.polishing import Polishing, PolishStep
    from quito_cli.solution.solution import Solution

_WIDTH = 90
"""Of a sentence."""
_MOST_RESIDUALS = 8
"""In a line of the table of residuals."""
_DONE: Final[dict[Action, str]] = {
    "assume": "assumed",
    "solve": "solved",
    "drop": "dropped",
    "insert": "inserted",
    "release": "released",
    "refine": "refined",
    "check": "checked",
    "accept": "accepted",
    "refuse": "refused",
}
"""What is said of each kind of step."""
_MEANING: Final[dict[Action, str]] = {
    "assume": "the structure that the direct answer shows, or what it has become",
    "solve": "Newton's method on states, costates, junction times and multipliers together; "
    "the residual is that of all equations, scaled, and falls quadratically at the end",
    "drop": "an arc that shrank to nothing, or that the equations know nothing of, is left out",
    "insert": "a sign that does not hold asks for an arc that was missing",
    "release": "a bound or constraint that pushes the wrong way is let go",
    "refine": "segments are halved where their polynomials do not carry, and all is solved again",
    "check": "signs, bounds and constraints of what was solved, between the points too",
    "refuse": "what was assumed cannot be made to meet a condition",
}
"""What the less plain of them mean."""


def polish_page(solution: Solution) -> str:
    """Return the account of a polish with what it came to.

    Args:
        solution: one that was to be polished.
    """
    assert solution.polishing is not None
    everything = len(solution.arcs)
    rows = [
        *polish_rows(solution),
        *arc_rows(solution, everything, everything),
        *pontryagin_rows(solution, verbose=False),
    ]
    title = typer.style(plain(solution.origin.title or solution.origin.name), bold=True)
    parts = title, account(solution.polishing), labelled(rows), CAVEAT
    return "\n\n".join(part for part in parts if part)


def account(how: Polishing) -> str:
    """Return step by step what was assumed, tried and found, and what the words mean."""
    if not how.steps:
        return "The polish, step by step\n  none was taken"
    width = max(len(_DONE[step.action]) for step in how.steps)
    lines = ["The polish, step by step"]
    for number, step in enumerate(how.steps, start=1):
        lines += _step(number, step, width)
    seen = dict.fromkeys(step.action for step in how.steps)
    meanings = [(_DONE[action], _MEANING[action]) for action in seen if action in _MEANING]
    glossary = [line for word, said in meanings for line in _hung(f"{word}: {said}")]
    if glossary:
        lines += ["", *(typer.style(line, dim=True) for line in glossary)]
    return "\n".join(lines)


def _step(number: int, step: PolishStep, width: int) -> list[str]:
    """Return what was done in a step, and below it how the residual fell."""
    head = f"  {number:2d}  {_DONE[step.action].ljust(width)}  "
    first, *rest = wrap(plain(step.sentence), _WIDTH) or [""]
    lines = [(head + first).rstrip(), *(" " * len(head) + line for line in rest)]
    return lines + _residuals(step.residuals, " " * len(head))


def _residuals(residuals: Sequence[float], indent: str) -> list[str]:
    """Return a small table of the residual by Newton step."""
    lines = []
    for start in range(0, len(residuals), _MOST_RESIDUALS):
        part = residuals[start : start + _MOST_RESIDUALS]
        numbers = [str(start + i) for i in range(len(part))]
        rows = [("Newton step", *numbers), ("residual", *(_small(value) for value in part))]
        lines += columns(rows, indent=indent).split("\n")
    return lines


def _small(value: float) -> str:
    return f"{value:.1e}" if math.isfinite(value) else "none"


def _hung(text: str) -> list[str]:
    return wrap(text, _WIDTH, initial_indent="  ", subsequent_indent="      ")
