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
    from rich.table import Table

    from quito_cli.cli.console import console

    table = Table("name", "states", "controls", "reference", "title", box=None, header_style="dim")
    for row in rows:
        table.add_row(*(str(value) for value in row.values()))
    console().print(table)


def _what_is_known(cost: bool, control: bool) -> str:
    return " and ".join(word for word, known in (("cost", cost), ("control", control)) if known)
