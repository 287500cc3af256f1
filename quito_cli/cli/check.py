"""`quito check`: problem files looked at without solving them, and printed back as mathematics."""

from __future__ import annotations

import json
from typing import Annotated, Any

import typer

from quito_cli.cli.options import AsJson
from quito_cli.cli.text import plain
from quito_cli.errors import QuitoError


def check(
    files: Annotated[
        list[str], typer.Argument(metavar="FILE...", help="Problem files, or bundled names.")
    ],
    latex: Annotated[bool, typer.Option("--latex", help="Print the mathematics as LaTeX.")] = False,
    as_json: AsJson = False,
    quiet: Annotated[
        bool, typer.Option("--quiet", "-q", help="Print errors and warnings only.")
    ] = False,
) -> None:
    """Look at problems without solving them."""
    reports = [_report(file, latex) for file in files]
    if as_json:
        typer.echo(json.dumps({"files": reports}, ensure_ascii=False))
    else:
        for report in reports:
            _print(report, quiet, latex)
    if not all(report["ok"] for report in reports):
        raise typer.Exit(2)


def _report(file: str, latex: bool) -> dict[str, Any]:
    """Return what is to be said of one file."""
    from quito_cli.check import check as look
    from quito_cli.problem.load import load
    from quito_cli.problem.mathematics import render
    from quito_cli.problem.text.complaints import ProblemError

    report: dict[str, Any] = {"file": file, "ok": False, "errors": [], "warnings": []}
    try:
        problem = load(file)
        warnings = look(problem)
    except ProblemError as error:
        return report | {"errors": _complaints(error), "shown": str(error)}
    except QuitoError as error:
        plain = {"line": None, "column": None, "message": str(error)}
        return report | {"errors": [plain], "shown": f"{file}: {error}"}
    told = ProblemError(warnings, problem.file)
    return report | {
        "ok": True,
        "title": problem.title,
        "warnings": _complaints(told),
        "shown": str(told) if warnings else "",
        "mathematics": render(problem, latex=latex),
    }


def _complaints(error: Any) -> list[dict[str, Any]]:
    return [
        {
            "line": complaint.position.line if complaint.position else None,
            "column": complaint.position.column if complaint.position else None,
            "message": complaint.message,
        }
        for complaint in error.complaints
    ]


def _print(report: dict[str, Any], quiet: bool, latex: bool) -> None:
    if not report["ok"]:
        typer.echo(report["shown"], err=True)
        return
    count = len(report["warnings"])
    verdict = "no complaints" if not count else f"{count} warning{'s' if count > 1 else ''}"
    if latex and not quiet:  # nothing else, to be piped into a document
        typer.echo(plain(report["mathematics"]))
    elif not quiet:
        typer.echo(typer.style(plain(report["title"] or report["file"]), bold=True))
        typer.echo(f"\n{plain(report['mathematics'])}\n")
        typer.echo(f"{report['file']}: {verdict}")
    if count:
        typer.echo(report["shown"], err=latex)
