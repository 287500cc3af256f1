"""Answer and Solution -> a report: one HTML file with everything in it, and nothing that runs.

All text is escaped, pictures are data, and a policy in its head forbids whatever else there might
be: the report is safe to open wherever it is sent.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Final

from quito_cli.errors import QuitoError, UsageError
from quito_cli.gui.settings import command
from quito_cli.problem.load import load_text
from quito_cli.problem.mathematics import render
from quito_cli.summary.rows import option_rows

if TYPE_CHECKING:
    from quito_cli.gui.answer import Answer, Condition, Table
    from quito_cli.solution.solution import Solution

_POLICY: Final = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"
_STYLE: Final = """
:root { color-scheme: light dark; }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; }
pre, table { overflow-x: auto; display: block; }
pre { padding: 0.7rem; border: 1px solid #8886; }
th, td { text-align: left; vertical-align: top; padding: 0.15rem 1rem 0.15rem 0; }
img { max-width: 100%; background: white; }
.fails { font-weight: bold; }
"""


def report(answer: Answer, solution: Solution) -> str:
    """Return the page: summary, formulas, pictures, certificate, comparison, options, file."""
    verdict = "Solved." if answer.success else "Not solved."
    lines = (verdict, answer.said, *answer.diagnosis)
    parts = [
        f"<h1>{escape(answer.title)}</h1>",
        *(f"<p>{escape(line)}</p>" for line in lines),
        *(f"<p><strong>Warning:</strong> {escape(text)}</p>" for text in answer.warnings),
        _section("Summary", _rows(answer.rows)),
        _section("The problem", _mathematics(solution)),
        _section("The answer", _pictures(solution)),
        _section("Pontryagin's conditions", _certificate(answer)),
        _section("Comparison", _comparison(answer)),
        _section("Options", _command(answer) + _rows(option_rows(solution))),
        _section("The file", f"<pre>{escape(solution.origin.text)}</pre>"),
    ]
    head = (
        '<meta charset="utf-8"><meta name="viewport" content="width=device-width">'
        f'<meta http-equiv="Content-Security-Policy" content="{escape(_POLICY)}">'
        f"<title>{escape(answer.title)}</title><style>{_STYLE}</style>"
    )
    body = "\n".join(part for part in parts if part)
    return f'<!doctype html>\n<html lang="en"><head>{head}</head><body>\n{body}\n</body></html>\n'


def _section(title: str, content: str) -> str:
    return f"<h2>{escape(title)}</h2>\n{content}" if content else ""


def _rows(rows: Iterable[tuple[str, str]]) -> str:
    """Return labels and what is said as a table; a row without label goes on in the one above."""
    joined: list[tuple[str, list[str]]] = []
    for label, said in rows:
        if label or not joined:
            joined.append((label, [said]))
        else:
            joined[-1][1].append(said)
    cells = (
        f"<tr><th scope=row>{escape(label)}</th><td>{'<br>'.join(map(escape, said))}</td></tr>"
        for label, said in joined
    )
    return f"<table>{''.join(cells)}</table>"


def _mathematics(solution: Solution) -> str:
    try:
        problem = load_text(solution.origin.text, solution.origin.name)
    except QuitoError:  # of another version, which took what this one does not
        return ""
    description = f"<p>{escape(problem.description)}</p>" if problem.description else ""
    source = f"<p>{escape(problem.source)}</p>" if problem.source else ""
    return f"{description}{source}<pre>{escape(render(problem, latex=False))}</pre>"


def _pictures(solution: Solution) -> str:
    """Return states, controls and plans as one picture, and costates and what belongs to them."""
    from quito_cli.plots.figure import DEFAULT, draw

    found = []
    with TemporaryDirectory(prefix="quito-report-") as folder:
        for panels, said in (
            (DEFAULT, "States and controls over time"),
            (("costates", "switching"), "Costates, switching functions, Hamiltonian over time"),
        ):
            path = Path(folder, "picture.png")
            try:
                draw(solution, panels, path)
            except UsageError:  # there is nothing of that kind
                continue
            data = b64encode(path.read_bytes()).decode()
            found.append(f'<p><img alt="{said}" src="data:image/png;base64,{data}"></p>')
    return "\n".join(found)


def _certificate(answer: Answer) -> str:
    if answer.verdict is None:
        return ""
    applying = [one for one in answer.certificate if one.verdict != "not applicable"]
    heads = ("condition", "residual", "scale", "worst at t", "verdict")
    table = _table(heads, [_condition(one) for one in applying])
    return f"<p>{escape(answer.verdict)}</p>{table}<p>{escape(answer.caveat)}</p>"


def _condition(one: Condition) -> tuple[str, ...]:
    figures = (_small(one.residual), _small(one.scale))
    time = "–" if one.time is None else f"{one.time:.6g}"
    verdict = f"{one.verdict}: {one.reason}" if one.reason else one.verdict
    return (one.condition, *figures, time, verdict)


def _small(value: float | None) -> str:
    return "–" if value is None else f"{value:.1e}"


def _comparison(answer: Answer) -> str:
    notes = "".join(f"<p>{escape(note)}</p>" for note in answer.notes)
    return notes + "".join(map(_compared, answer.tables))


def _compared(table: Table) -> str:
    return f"<h3>{escape(table.title)}</h3>" + _table(table.heads, (*table.rows, *table.published))


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    if not rows:
        return ""
    first = "".join(f"<th scope=col>{escape(head)}</th>" for head in heads)
    others = "".join(
        f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in rows
    )
    return f"<table><tr>{first}</tr>{others}</table>"


def _command(answer: Answer) -> str:
    """Return the command line that does the same; nothing of a comparison, which has its own."""
    if answer.kind != "solve":
        return ""
    return f"<pre>{escape(command(f'{answer.name}.yaml', answer.given))}</pre>"
