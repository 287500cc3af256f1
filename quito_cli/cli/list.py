"""`quito list`: the bundled problems."""

from __future__ import annotations

import json
from typing import Annotated

import typer


def list_problems(
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object, and nothing else.")
    ] = False,
) -> None:
    """List the bundled problems."""
    from quito_cli.problem.library import bundled
    from quito_cli.problem.load import load
    from quito_cli.problem.schema import Control, State

    def size(entries: dict[str, State] | dict[str, Control]) -> int:
        return sum(entry.size or 1 for entry in entries.values())

    rows = []
    for name, path in bundled().items():
        problem = load(path)
        known = problem.reference
        rows.append(
            {
                "name": name,
                "states": size(problem.states),
                "controls": size(problem.controls),
                "reference": _what_is_known(known.cost is not None, bool(known.control))
                if known
                else "",
                "title": problem.title,
            }
        )
    if as_json:
        typer.echo(json.dumps({"problems": rows}, ensure_ascii=False))
        return
    from quito_cli.cli.text import columns

    table = [tuple(rows[0]), *(tuple(str(value) for value in row.values()) for row in rows)]
    typer.echo(columns(table, indent="", header=True))


def _what_is_known(cost: bool, control: bool) -> str:
    return " and ".join(word for word, known in (("cost", cost), ("control", control)) if known)
