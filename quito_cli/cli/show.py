"""`quito show`: a result again, with its evidence and options; or a problem as mathematics."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from quito_cli.cli.options import AsJson
from quito_cli.errors import UsageError

if TYPE_CHECKING:
    pass


def show(
    what: Annotated[
        str, typer.Argument(help="A result file, a problem file, or the name of a bundled problem.")
    ],
    as_yaml: Annotated[
        bool, typer.Option("--yaml", help="Print a problem's file as it stands, and nothing else.")
    ] = False,
    latex: Annotated[
        bool, typer.Option("--latex", help="Print a problem as LaTeX, and nothing else.")
    ] = False,
    as_json: AsJson = False,
    pontryagin: Annotated[
        bool,
        typer.Option(
            "--pontryagin",
            help="Derive Pontryagin's conditions of a problem; with --latex as LaTeX.",
        ),
    ] = False,
    certificate: Annotated[
        bool,
        typer.Option(
            "--certificate",
            help="Of a result, all of Pontryagin's conditions with their residuals and verdicts.",
        ),
    ] = False,
    explain: Annotated[
        bool,
        typer.Option(
            "--explain", help="Of a polished result, what was assumed, tried and found, by step."
        ),
    ] = False,
) -> None:
    """Show a result with its evidence, or a problem as mathematics."""
    from quito_cli.solution.store import is_result

    _refuse_together(as_yaml, latex, as_json, pontryagin, certificate, explain)
    if Path(what).suffix == ".h5" or is_result(Path(what)):
        _refuse_of_result(what, pontryagin=pontryagin, text=as_yaml or latex)
        if certificate:
            _show_certificate(Path(what))
        elif explain:
            _show_polish(Path(what))
        else:
            _show_result(Path(what), as_json)
        return
    _refuse_of_problem(what, certificate=certificate, explain=explain)
    if as_yaml:
        _print_file(what)
    elif pontryagin:
        _show_derivation(what, latex)
    else:
        _show_problem(what, as_json, latex)


def _refuse_of_result(what: str, *, pontryagin: bool, text: bool) -> None:
    """Refuse what a result has not.

    Raises:
        UsageError: that is asked for.
    """
    if pontryagin:
        raise UsageError(f"{what} is a result: --pontryagin takes the problem, so name that")
    if text:
        raise UsageError(f"{what} is a result: --yaml and --latex are for problems")


def _refuse_of_problem(what: str, *, certificate: bool, explain: bool) -> None:
    """Refuse what a problem has not.

    Raises:
        UsageError: that is asked for.
    """
    if certificate:
        raise UsageError(
            f"{what} is no result: --certificate takes the file of one, such as results/"
            f"{Path(what).stem}.h5; quito show {what} --pontryagin says what the conditions of a "
            "problem are"
        )
    if explain:
        raise UsageError(
            f"{what} is no result: --explain takes the file of one that was polished; quito solve "
            f"{what} --polish --explain makes one"
        )


def _refuse_together(
    as_yaml: bool, latex: bool, as_json: bool, pontryagin: bool, certificate: bool, explain: bool
) -> None:
    """Refuse two pages at once.

    Raises:
        UsageError: naming them.
    """
    if as_yaml + latex + as_json > 1:
        raise UsageError("--yaml, --latex and --json exclude each other")
    if pontryagin and (as_yaml or as_json):
        raise UsageError("--pontryagin goes with --latex only")
    others = as_yaml or latex or as_json or pontryagin
    if certificate and (others or explain):
        raise UsageError(
            "--certificate goes with no other option; --json without it has the certificate too"
        )
    if explain and others:
        raise UsageError(
            "--explain goes with no other option; --json without it has the polish too"
        )


def _show_result(path: Path, as_json: bool) -> None:
    from quito_cli.cli.report import print_solution
    from quito_cli.solution.solution import Solution
    from quito_cli.summary.dictionary import as_dictionary

    solution = Solution.load(path)
    if as_json:
        typer.echo(json.dumps(as_dictionary(solution, path, None), ensure_ascii=False))
    else:
        print_solution(solution, verbose=True)


def _show_certificate(path: Path) -> None:
    from quito_cli.cli.certificate import certificate_page
    from quito_cli.solution.solution import Solution

    solution = Solution.load(path)
    if solution.extremal is None:
        raise UsageError(
            f"{path} has no certificate: it is older than certificates, or was not solved; solve "
            "it again"
        )
    typer.echo(certificate_page(solution, _room()))


def _show_polish(path: Path) -> None:
    from quito_cli.cli.polishing import polish_page
    from quito_cli.solution.solution import Solution

    solution = Solution.load(path)
    if solution.polishing is None:
        raise UsageError(
            f"{path} was not to be polished, so there is nothing to explain: solve it again with "
            "--polish"
        )
    typer.echo(polish_page(solution))


def _room() -> int | None:
    """Return the width of the terminal; None where there is none."""
    return shutil.get_terminal_size().columns if sys.stdout.isatty() else None


def _print_file(where: str) -> None:
    """Print the bytes of a problem file, once it is known to be one."""
    from quito_cli.problem.load import find, load

    load(where)
    typer.echo(find(where).read_bytes(), nl=False)


def _show_problem(where: str, as_json: bool, latex: bool) -> None:
    from quito_cli.problem.load import load

    problem = load(where)
    if as_json:
        data = problem.model_dump(mode="json", exclude_unset=True)
        typer.echo(json.dumps(data, ensure_ascii=False))
        return
    from quito_cli.cli.problem import problem_page

    typer.echo(problem_page(problem, _room(), latex=latex))


def _show_derivation(where: str, latex: bool) -> None:
    from quito_cli.cli.problem import derivation_page
    from quito_cli.problem.load import load

    typer.echo(derivation_page(load(where), _room(), latex=latex))
