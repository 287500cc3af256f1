"""Report -> one page that needs nothing else: no network, no other file.

The verdict, the cases in a table that sorts, the differences from the baseline, and each case with
its figures and its picture. Whatever comes from a file is escaped, and a policy within the page
lets a browser run this module's own script alone, and load nothing.
"""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Final

from quito_cli import __version__
from quito_cli.batch.reports.pictures import MOST, pictures
from quito_cli.batch.reports.report import Report
from quito_cli.batch.reports.table import (
    DIFFERENCES,
    GONE,
    Row,
    Table,
    differences,
    figure,
    seconds,
    shown,
    table,
)
from quito_cli.solution.store import write_aside

_STYLE: Final = Path(__file__).with_name("page.css")
_KINDS: Final = {
    "case": ' class="name"',
    "change": ' class="number"',
    "allowed": ' class="number"',
    "note": ' class="note"',
}
"""Of the columns of differences."""
_SCRIPT: Final = Path(__file__).with_name("page.js")


def write(report: Report, path: Path, plots: str) -> None:
    """Write the page of a run; an older file is replaced only when all is written.

    Args:
        report: the run.
        path: of the file.
        plots: of which cases there are pictures: `failed`, `all` or `none`.

    Raises:
        ResultFileError: the file cannot be written.
    """
    drawn = pictures(report, plots)
    write_aside(path, lambda aside: _write(aside, page(report, drawn)))


def _write(path: Path, parts: Iterable[str]) -> None:
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.writelines(f"{part}\n" for part in parts)


def page(report: Report, drawn: Mapping[str, str]) -> Iterator[str]:
    """Yield the lines of a page.

    Args:
        report: the run.
        drawn: by case the address of its picture, or a sentence why there is none.
    """
    style = _STYLE.read_text(encoding="utf-8")
    script = _SCRIPT.read_text(encoding="utf-8")
    made = table(report)
    yield from _head(report, style, script)
    good = report.exit_code == 0
    yield f"<h1>{_text(report.heading)}</h1>"
    yield f'<p class="verdict{"" if good else " bad"}">{_text(report.verdict)}</p>'
    yield f'<p class="faint">{seconds(report.seconds)}, quito {__version__}</p>'
    yield from _cases(made, report)
    yield from _differences(report)
    for title, rows in (("Failed", made.failed), ("Passed", made.passed)):
        if rows:
            yield f"<h2>{title}</h2>"
            yield from _undrawn(rows, drawn) if title == "Failed" else ()
            for row in rows:
                yield from _case(row, drawn.get(row.name))
    yield f"<script>{script}</script>\n</body>\n</html>"


def _head(report: Report, style: str, script: str) -> Iterator[str]:
    policy = (
        f"default-src 'none'; img-src data:; style-src '{_hash(style)}'; "
        f"script-src '{_hash(script)}'; base-uri 'none'; form-action 'none'"
    )
    yield '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">'
    yield f'<meta http-equiv="Content-Security-Policy" content="{policy}">'
    yield '<meta name="viewport" content="width=device-width, initial-scale=1">'
    yield f"<title>{_text(report.heading)}: {_text(report.verdict)}</title>"
    yield f"<style>{style}</style>\n</head>\n<body>"


def _hash(text: str) -> str:
    return f"sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode('ascii')}"


def _cases(made: Table, report: Report) -> Iterator[str]:
    """Yield the table of cases, those that failed first."""
    headings = ("case", "result", *(column.heading for column in made.columns), "time")
    helps = ("", "", *(column.help for column in made.columns), "of the whole case")
    yield '<h2>Cases</h2>\n<input type="search" placeholder="Show names with…" hidden>'
    yield '<div class="wide"><table class="cards" id="cases">\n<thead><tr>'
    for i, (heading, help) in enumerate(zip(headings, helps, strict=True)):
        kind = ' class="number"' if i > 1 else ""
        yield f'<th{kind} title="{_text(help)}"><button>{heading}</button></th>'
    yield "</tr></thead>\n<tbody>"
    for row in (*made.failed, *made.passed):
        yield _row(row, made)
    for name in report.gone:
        label = f'data-name="{_text(name)}" title="{GONE}"'
        result = '<td class="result" data-label="result">missing</td>'
        rest = "<td></td>" * (len(made.columns) + 1)
        yield f'<tr class="bad" {label}><td class="name">{_text(name)}</td>{result}{rest}</tr>'
    yield "</tbody>\n</table></div>"


def _row(row: Row, made: Table) -> str:
    link = f'<a href="#{_identity(row.name)}">{_text(row.name)}</a>'
    cells = [
        _number(cell, value, column.heading)
        for cell, value, column in zip(row.cells, row.values, made.columns, strict=True)
    ]
    return (
        f'<tr class="{"bad" if row.failed else "good"}" data-name="{_text(row.name)}">'
        f'<td class="name">{link}</td><td class="result" data-label="result">{row.result}</td>'
        f"{''.join(cells)}{_number(row.seconds, row.case.seconds, 'time')}</tr>"
    )


def _number(cell: str, value: float | None, label: str) -> str:
    known = "" if value is None else f' data-value="{value!r}"'
    return f'<td class="number" data-label="{label}"{known}>{_text(cell)}</td>'


def _differences(report: Report) -> Iterator[str]:
    rows = differences(report)
    if not rows:
        return
    yield "<h2>Against the baseline</h2>"
    yield '<div class="wide"><table class="cards single">\n<thead><tr>'
    for heading in DIFFERENCES:
        kind = _KINDS[heading] if heading in ("change", "allowed") else ""
        yield f"<th{kind}><button>{heading}</button></th>"
    yield "</tr></thead>\n<tbody>"
    for row in rows:
        bad = "bad" if row[0] in ("worse", "missing") else "good"
        cells = [f'<td class="result" data-label="verdict">{row[0]}</td>']
        cells += [
            f'<td{_KINDS.get(heading, "")} data-label="{heading}">{_text(cell)}</td>'
            for heading, cell in zip(DIFFERENCES[1:], row[1:], strict=True)
        ]
        yield f'<tr class="{bad}">{"".join(cells)}</tr>'
    yield "</tbody>\n</table></div>"


def _undrawn(rows: Sequence[Row], drawn: Mapping[str, str]) -> Iterator[str]:
    """Say that there are too many pictures to draw."""
    left = sum(row.case.result is not None and row.name not in drawn for row in rows)
    if drawn and left:
        yield f"<p>There are pictures of the first {MOST} of these; {left} are not drawn.</p>"


def _case(row: Row, picture: str | None) -> Iterator[str]:
    """Yield a case with all that is known of it; open where it failed."""
    case = row.case
    names = f'id="{_identity(row.name)}" data-name="{_text(row.name)}"'
    yield f'<details class="case" {names}{" open" if row.failed else ""}>'
    bad = " bad" if row.failed else ""
    yield f'<summary><h3>{_text(row.name)}</h3> <span class="result{bad}">{row.result}</span>'
    yield f"</summary>\n<p>{_text(case.ending.value)}</p>"
    if case.message:
        yield f"<pre>{_text(case.message)}</pre>"
    said = [(reason, "bad") for reason in row.reasons if reason != case.message]
    said += [(check.sentence, "good") for check in case.checks if check.passed]
    if said:
        lines = (f'<li class="{kind}">{_text(sentence)}</li>' for sentence, kind in said)
        yield f"<ul>{''.join(lines)}</ul>"
    if picture is not None and picture.startswith("data:"):
        alt = f"States and controls of {_text(row.name)}"
        yield f'<div class="picture"><img alt="{alt}" src="{picture}"></div>'
    elif picture is not None:
        yield f"<p>{_text(picture)}</p>"
    yield from _facts(row)
    yield "</details>"


def _facts(row: Row) -> Iterator[str]:
    case = row.case
    facts = {"problem": case.case.problem}
    facts |= {f"option {name}": str(value) for name, value in case.case.options.items()}
    facts |= {f"set {name}": str(value) for name, value in case.case.constants.items()}
    facts |= {name.replace("_", " "): figure(value) for name, value in case.figures.items()}
    facts |= {"time": row.seconds} | ({"result": str(case.result)} if case.result else {})
    pairs = (
        f"<div><dt>{_text(name)}</dt><dd>{_text(said)}</dd></div>" for name, said in facts.items()
    )
    yield f"<dl>{''.join(pairs)}</dl>"


def _identity(name: str) -> str:
    """Return what a link within the page calls a case."""
    return f"case-{hashlib.sha256(name.encode(errors='replace')).hexdigest()[:12]}"


def _text(text: str) -> str:
    return escape(shown(text), quote=True)
