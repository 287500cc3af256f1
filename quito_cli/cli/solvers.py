"""`quito solvers`: what can solve the discretized problem, and what of it is here."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Annotated, Any

import typer

from quito_cli.cli.options import AsJson

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

_TAKES = {"NLP": "nonlinear", "QP": "quadratic"}


def solvers(
    test: Annotated[
        bool, typer.Option("--test", help="Solve two small problems with each that is here.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """List the solvers: what they are for, and which are in this installation.

    Accuracy is what one attains where that is less than the tolerance asked of it.
    """
    rows = [_row(name, test=test) for name in _names()]
    if as_json:
        typer.echo(json.dumps({"solvers": rows}, ensure_ascii=False))
        return
    from quito_cli.cli.text import columns

    typer.echo(columns(_table(rows), indent="", header=True))
    if test:
        typer.echo("\n" + columns(_tests(rows), indent="", header=True))


def _names() -> list[str]:
    from quito_cli.solvers import SOLVERS

    return list(SOLVERS)


def _row(name: str, *, test: bool) -> dict[str, Any]:
    """Return what is to be said of one solver, for programs."""
    from quito_cli.solvers import backend
    from quito_cli.solvers.availability import available

    row = backend(name)
    here = available(row)
    said: dict[str, Any] = {
        "name": row.name,
        "title": row.title,
        "available": here,
        "provides": row.provides,
        "program": row.takes,
        "linear_algebra": row.algebra,
        "accuracy": row.accuracy or None,
        "warm_start": row.warm is not None,
        "own_process": row.isolated,
        "most_unknowns": row.most_unknowns,
    }
    if test:
        from quito_cli.selftest import selftest

        said["tests"] = [
            {
                "problem": found.problem,
                "success": found.success,
                "message": found.message,
                "iterations": found.iterations,
                "seconds": found.seconds,
                "cost_error": found.cost_error if math.isfinite(found.cost_error) else None,
            }
            for found in (selftest(name) if here else ())
        ]
    return said


def _table(rows: Sequence[Mapping[str, Any]]) -> list[list[str]]:
    table = [["name", "here", "programs", "accuracy", "linear algebra", "what it is"]]
    for row in rows:
        table.append(
            [
                row["name"],
                "yes" if row["available"] else "no",
                _TAKES[row["program"]],
                f"{row['accuracy']:.0e}" if row["accuracy"] else "-",
                row["linear_algebra"],
                row["title"] if row["available"] else f"needs {row['provides']}",
            ]
        )
    return table


def _tests(rows: Sequence[Mapping[str, Any]]) -> list[list[str]]:
    table = [["name", "problem", "iterations", "time", "cost error", "how it ended"]]
    for row in rows:
        for found in row["tests"]:
            error = found["cost_error"]
            table.append(
                [
                    row["name"],
                    found["problem"],
                    "unknown" if found["iterations"] is None else str(found["iterations"]),
                    f"{found['seconds']:.2f} s",
                    "-" if error is None else f"{error:.0e}",
                    "solved" if found["success"] else f"failed: {found['message']}",
                ]
            )
    return table
