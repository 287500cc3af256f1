"""`quito show`: a result again, with its evidence and options; or a problem as mathematics."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Annotated

import typer

from quito_cli.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Sequence

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
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object, and nothing else.")
    ] = False,
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
        if pontryagin:
            raise UsageError(f"{what} is a result: --pontryagin takes the problem, so name that")
        if as_yaml or latex:
            raise UsageError(f"{what} is a result: --yaml and --latex are for problems")
        if certificate:
            _show_certificate(Path(what))
        elif explain:
            _show_polish(Path(what))
        else:
            _show_result(Path(what), as_json)
    elif certificate:
        raise UsageError(
            f"{what} is no result: --certificate takes the file of one, such as results/"
            f"{Path(what).stem}.h5; quito show {what} --pontryagin says what the conditions of a "
            "problem are"
        )
    elif explain:
        raise UsageError(
            f"{what} is no result: --explain takes the file of one that was polished; quito solve "
            f"{what} --polish --explain makes one"
        )
    elif as_yaml:
        _print_file(what)
    elif pontryagin:
        _show_derivation(what, latex)
    else:
        _show_problem(what, as_json, latex)


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
    from quito_cli.problem.mathematics import render

    problem = load(where)
    if as_json:
        data = problem.model_dump(mode="json", exclude_unset=True)
        typer.echo(json.dumps(data, ensure_ascii=False))
        return
    from quito_cli.cli.text import labelled, plain
    from quito_cli.problem.build import build

    known = build(problem).known
    mathematics = plain(render(problem, latex=latex))
    if latex:
        typer.echo(mathematics)
        return
    paragraphs = [
        _heading(problem),
        _wrapped(plain(problem.description)),
        mathematics,
        labelled(_facts(problem, known), indent=""),
        _published(problem.published),
    ]
    typer.echo("\n\n".join(paragraph for paragraph in paragraphs if paragraph))


def _show_derivation(where: str, latex: bool) -> None:
    from quito_cli.cli.text import plain
    from quito_cli.optimality.page import derivation
    from quito_cli.problem.load import load

    problem = load(where)
    text = plain(derivation(problem, latex=latex))
    typer.echo(text if latex else f"{_heading(problem)}\n\n{text}")


def _heading(problem: Problem) -> str:
    """Return the title, with the source below it."""
    from quito_cli.cli.text import plain

    title = typer.style(plain(problem.title or problem.name), bold=True)
    return f"{title}\n{_wrapped(plain(problem.source))}".strip()


def _wrapped(text: str, *, indent: int = 0) -> str:
    """Return text within the width of the terminal, its paragraphs kept."""
    room = min(_WIDTH, _room() or _WIDTH)
    return "\n".join(
        fill(line, max(20, room - indent), break_long_words=False, break_on_hyphens=False)
        for line in text.strip().splitlines()
    ).replace("\n", "\n" + " " * indent)


def _facts(problem: Problem, known: Known | None) -> list[tuple[str, str]]:
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
    return [(label, _wrapped(text, indent=margin)) for label, text in rows if text.strip()]


def _options(problem: Problem) -> str:
    asked = problem.options.model_dump(exclude_unset=True, exclude_none=True)
    solver = asked.pop("solver_options", {})
    pairs = {name.replace("_", "-"): value for name, value in asked.items()} | solver
    return ", ".join(f"{name} {_text(value)}" for name, value in pairs.items())


def _published(rows: Sequence[Published]) -> str:
    """Return published rows as a table, without the columns that none of them fills."""
    from quito_cli.cli.text import columns

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
