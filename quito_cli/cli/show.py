"""`quito show`: a result again, with its evidence and options; or a problem."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer


def show(
    what: Annotated[
        str, typer.Argument(help="A result file, a problem file, or the name of a bundled problem.")
    ],
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object, and nothing else.")
    ] = False,
) -> None:
    """Show a result with its evidence, or a problem."""
    from quito_cli.solution.store import is_result

    if Path(what).suffix == ".h5" or is_result(Path(what)):
        _show_result(Path(what), as_json)
    else:
        _show_problem(what, as_json)


def _show_result(path: Path, as_json: bool) -> None:
    from quito_cli.cli.report import as_dictionary, print_solution
    from quito_cli.solution.solution import Solution

    solution = Solution.load(path)
    if as_json:
        typer.echo(json.dumps(as_dictionary(solution, path, None), ensure_ascii=False))
    else:
        print_solution(solution, verbose=True)


def _show_problem(where: str, as_json: bool) -> None:
    from quito_cli.problem.load import load

    problem = load(where)
    if as_json:
        data = problem.model_dump(mode="json", exclude_unset=True)
        typer.echo(json.dumps(data, ensure_ascii=False))
        return
    from quito_cli.cli.text import plain

    heading = [typer.style(plain(problem.title or problem.name), bold=True)]
    notes = [plain(note.strip()) for note in (problem.source, problem.description) if note]
    typer.echo("\n".join(heading + notes) + f"\n\n{problem.text.strip()}")
