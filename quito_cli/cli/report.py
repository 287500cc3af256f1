"""A Solution for people: the summary on a terminal."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from quito_cli.cli.polishing import account
from quito_cli.cli.text import columns, labelled, plain
from quito_cli.summary.meshes import round_rows
from quito_cli.summary.rows import option_rows, summary_rows

if TYPE_CHECKING:
    from quito_cli.solution.solution import Solution

_MOST_VIOLATIONS = 12


def print_solution(
    solution: Solution,
    *,
    verbose: bool,
    files: tuple[Path | None, ...] = (),
    explain: bool = False,
) -> None:
    """Print the summary with its evidence; with `explain` the account of its polish, too."""
    good = solution.success
    word = typer.style(
        "Solved." if good else "Not solved.", bold=True, fg="green" if good else "red"
    )
    paragraphs = [
        typer.style(plain(solution.origin.title or solution.origin.name), bold=True)
        + f"\n{word} {solution.status.value}"
        + "".join(f"\n  {plain(sentence)}" for sentence in solution.evidence.diagnosis),
        labelled(summary_rows(solution, verbose=verbose)),
    ]
    if explain and solution.polishing is not None:
        paragraphs.append(account(solution.polishing))
    if verbose:
        if solution.refinement is not None:
            paragraphs.append(columns(round_rows(solution.refinement), header=True))
        paragraphs += [_all_violations(solution), labelled(option_rows(solution))]
    if solution.warnings:
        mark = typer.style("Warning:", bold=True, fg="yellow")
        paragraphs.append("\n".join(f"{mark} {plain(text)}" for text in solution.warnings))
    written = [str(path) for path in files if path is not None]
    if written:
        paragraphs.append(f"Saved {' and '.join(written)}")
    typer.echo("\n\n".join(paragraphs))


def _all_violations(solution: Solution) -> str:
    rows = [("condition", "worst at t", "violated by")]
    found = solution.evidence.violations
    for violation in found[:_MOST_VIOLATIONS]:
        amount = f"{violation.amount:.2e}" if violation.amount > 0 else "holds"
        rows.append((violation.constraint, f"{violation.time:.6g}", amount))
    if len(found) > _MOST_VIOLATIONS:
        rows.append((f"and {len(found) - _MOST_VIOLATIONS} less violated", "", ""))
    return columns(rows, header=True)
