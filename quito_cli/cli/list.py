"""`quito list`: the bundled problems, one line each."""

from __future__ import annotations

import json
import shutil
import sys
from typing import TYPE_CHECKING, Annotated, Any

import typer

from quito_cli.cli.options import AsJson
from quito_cli.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from quito_cli.problem.schema import Control, Problem, State

_LEAST_TITLE = 16  # columns: less of a title says nothing
_GAP = 2


def list_problems(
    tags: Annotated[
        list[str] | None,
        typer.Option("--tag", metavar="TAG", help="Only those with this tag; may be repeated."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """List the bundled problems.

    Constraints are counted; `states` says that states have bounds.
    """
    from quito_cli.problem.library import bundled
    from quito_cli.problem.load import load

    problems = [load(path) for path in bundled().values()]
    chosen = _tagged(problems, tags or [])
    rows = [_row(problem) for problem in chosen]
    if as_json:
        typer.echo(json.dumps({"problems": rows}, ensure_ascii=False))
    elif rows:
        typer.echo(_table(rows))
    else:
        typer.echo(f"No bundled problem has all of these tags: {', '.join(tags or [])}.", err=True)


def _tagged(problems: Sequence[Problem], tags: Sequence[str]) -> list[Problem]:
    """Return the problems that have all of the tags.

    Raises:
        UsageError: none of the problems has such a tag.
    """
    from quito_cli.problem.text.complaints import suggest

    known = sorted({tag for problem in problems for tag in problem.tags})
    for tag in tags:
        if tag not in known:
            raise UsageError(
                f"there is no tag {tag!r}{suggest(tag, known)}; the tags are {', '.join(known)}"
            )
    return [problem for problem in problems if set(tags) <= set(problem.tags)]


def _row(problem: Problem) -> dict[str, Any]:
    """Return what is to be said of one problem, for programs."""
    from quito_cli.problem.build import build

    known = build(problem).known
    constraints = problem.constraints
    return {
        "name": problem.name,
        "title": problem.title,
        "tags": list(problem.tags),
        "states": _entries(problem.states),
        "controls": _entries(problem.controls),
        "parameters": sum(entry.size or 1 for entry in problem.parameters.values()),
        "state_bounds": any(
            bound is not None
            for state in problem.states.values()
            for bound in (state.lower, state.upper)
        ),
        "constraints": {
            "path": len(constraints.path),
            "boundary": len(constraints.boundary),
            "integral": len(constraints.integral),
            "point": len(constraints.point),
        },
        "singular": "singular" in problem.tags,
        "maximize": problem.sense == "maximize",
        "optimum": known.cost if known else None,
        "accuracy": known.accuracy if known else None,
        "switching_times": list(known.switching_times) if known else [],
        "known": [
            kind
            for kind, there in (
                ("state", known and known.states),
                ("control", known and known.controls),
            )
            if there
        ],
    }


def _entries(variables: Mapping[str, State] | Mapping[str, Control]) -> int:
    return sum(variable.size or 1 for variable in variables.values())


def _table(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return the table: whole in a pipe, within the width of a terminal."""
    from quito_cli.cli.text import columns

    table = [
        ["name", "states", "controls", "constraints", "singular", "known optimum", "title"],
        *([*_facts(row), _optimum(row, accuracy=True), row["title"]] for row in rows),
    ]
    if sys.stdout.isatty():
        room = shutil.get_terminal_size().columns
        if _room_for_title(table, room) < _LEAST_TITLE:
            table[0][-2] = "optimum"
            for line, row in zip(table[1:], rows, strict=True):
                line[-2] = _optimum(row, accuracy=False)
        room = _room_for_title(table, room)
        table = [[*line[:-1], *_cut(line[-1], room)] for line in table]
    return columns(table, indent="", header=True)


def _facts(row: Mapping[str, Any]) -> list[str]:
    count = sum(row["constraints"].values())
    constraints = [*(["states"] if row["state_bounds"] else []), *([str(count)] if count else [])]
    return [
        row["name"],
        str(row["states"]),
        str(row["controls"]),
        " + ".join(constraints) or "-",
        "yes" if row["singular"] else "no",
    ]


def _optimum(row: Mapping[str, Any], *, accuracy: bool) -> str:
    if row["optimum"] is None:
        return "-"
    known = accuracy and row["accuracy"] is not None
    return f"{row['optimum']:.8g}" + (f" ± {row['accuracy']:.0e}" if known else "")


def _room_for_title(table: Sequence[Sequence[str]], room: int) -> int:
    """Return the columns that are left beside all others."""
    widths = [max(len(line[i]) for line in table) for i in range(len(table[0]) - 1)]
    return room - sum(width + _GAP for width in widths)


def _cut(title: str, room: int) -> list[str]:
    """Return a title that fits, or none."""
    if room < _LEAST_TITLE:
        return []
    return [title if len(title) <= room else f"{title[: room - 1].rstrip()}…"]
