"""A problem as `quito show` prints it: its mathematics and what is known of it; its conditions."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill
from typing import TYPE_CHECKING

import typer

from quito_cli.cli.text import columns, labelled, plain

if TYPE_CHECKING:
    from quito_cli.problem.model import Known
    from quito_cli.problem.schema import Problem
    from quito_cli.problem.schema_reference import Published

_WIDTH = 100
_PUBLISHED = {
    "tool": "published",
    "steps": "steps",
    "time": "seconds",
    "iterations": "iterations",
    "violation": "violation",
    "error_norm": "error norm",
    "dft_norm": "DFT norm",
}
"""Columns of published rows, with their headings."""


def problem_page(problem: Problem, room: int | None, *, latex: bool) -> str:
    """Return a problem as mathematics, among its title and what is known of it; LaTeX is alone.

    Args:
        problem: what is shown.
        room: columns of the terminal; None where there is none.
        latex: whether the mathematics is wanted for a paper.
    """
    from quito_cli.problem.build import build
    from quito_cli.problem.mathematics import render

    known = build(problem).known
    mathematics = plain(render(problem, latex=latex))
    if latex:
        return mathematics
    width = min(_WIDTH, room or _WIDTH)
    paragraphs = [
        _heading(problem, width),
        _wrapped(plain(problem.description), width),
        mathematics,
        labelled(_facts(problem, known, width), indent=""),
        _published(problem.published),
    ]
    return "\n\n".join(paragraph for paragraph in paragraphs if paragraph)


def derivation_page(problem: Problem, room: int | None, *, latex: bool) -> str:
    """Return Pontryagin's conditions of a problem below its title; LaTeX is alone.

    Arguments are those of `problem_page`.
    """
    from quito_cli.optimality.page.page import derivation

    text = plain(derivation(problem, latex=latex))
    return text if latex else f"{_heading(problem, min(_WIDTH, room or _WIDTH))}\n\n{text}"


def _heading(problem: Problem, width: int) -> str:
    """Return the title, with the source below it."""
    title = typer.style(plain(problem.title or problem.name), bold=True)
    return f"{title}\n{_wrapped(plain(problem.source), width)}".strip()


def _wrapped(text: str, width: int, *, indent: int = 0) -> str:
    """Return text within a width, its paragraphs kept."""
    return "\n".join(
        fill(line, max(20, width - indent), break_long_words=False, break_on_hyphens=False)
        for line in text.strip().splitlines()
    ).replace("\n", "\n" + " " * indent)


def _facts(problem: Problem, known: Known | None, width: int) -> list[tuple[str, str]]:
    """Return what is known of the answer, what the file asks for, and its tags."""
    rows: list[tuple[str, str]] = []
    reference = problem.reference
    if known is not None and reference is not None:
        if known.cost is not None:
            within = f" ± {known.accuracy:g}" if known.accuracy is not None else ""
            rows.append(("known optimum", f"{known.cost:.16g}{within}"))
        if known.switching_times:
            rows.append(("switching times", ", ".join(f"{t:.10g}" for t in known.switching_times)))
        functions = [*known.states, *known.controls]
        if functions:
            rows.append(("known functions", ", ".join(f"{name}(t)" for name in functions)))
        rows.append(("verified", reference.verified))
    rows.append(("options", _options(problem)))
    rows.append(("tags", ", ".join(problem.tags)))
    margin = max(len(label) for label, _ in rows) + 2
    return [(label, _wrapped(text, width, indent=margin)) for label, text in rows if text.strip()]


def _options(problem: Problem) -> str:
    asked = problem.options.model_dump(exclude_unset=True, exclude_none=True)
    solver = asked.pop("solver_options", {})
    pairs = {name.replace("_", "-"): value for name, value in asked.items()} | solver
    return ", ".join(f"{name} {_text(value)}" for name, value in pairs.items())


def _published(rows: Sequence[Published]) -> str:
    """Return published rows as a table, without the columns that none of them fills."""
    filled = {
        field: heading
        for field, heading in _PUBLISHED.items()
        if any(getattr(row, field) is not None for row in rows)
    }
    return columns(
        [
            [*filled.values()],
            *([_text(getattr(row, field)) for field in filled] for row in rows),
        ]
        if rows
        else [],
        indent="",
        header=True,
    )


def _text(value: str | float | None) -> str:
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return value if isinstance(value, str) else f"{value:.10g}"
