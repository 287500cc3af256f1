"""What became of a sweep, for people and for programs: a table with a row a case, or JSON."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import typer

from quito_cli.batch.suite.axes import shadowed
from quito_cli.cli.text import columns, plain
from quito_cli.summary.dictionary import finite

if TYPE_CHECKING:
    from quito_cli.batch.suite.case import Figure, Finished
    from quito_cli.batch.sweeps.sweep import Swept

_MOST: Final = 100
"""Rows of the table: the file has all."""


def print_swept(
    swept: Swept, shown: tuple[str, ...], files: tuple[Path, ...], folder: Path
) -> None:
    """Print the table, and what was written where."""
    sweep = swept.sweep
    title = typer.style(plain(sweep.title or sweep.name), bold=True)
    solved, count = swept.solved.count(True), len(swept.solved)
    word = typer.style(
        "Solved." if solved == count else "Not all solved.",
        bold=True,
        fg="green" if solved == count else "red",
    )
    paragraphs = [f"{title}\n{word} {solved} of {count} cases", _table(swept, shown)]
    paragraphs += [f"{name}: {said}" for name, said in _notes(swept, shown).items()]
    written = ", ".join(map(str, files))
    paragraphs.append(f"Saved {written}\nResults of the cases in {folder}")
    typer.echo("\n" + "\n\n".join(paragraphs))


def print_json(swept: Swept, shown: tuple[str, ...], files: tuple[Path, ...]) -> None:
    """Print the sweep as one JSON object."""
    from quito_cli.batch.workers.recorded import exit_code

    sweep, (hdf5, *plots) = swept.sweep, files
    said = {
        "problem": sweep.name,
        "title": sweep.title,
        "axes": [
            {"name": axis.name, "option": axis.option, "values": list(axis.values)}
            for axis in sweep.axes
        ],
        "warm": sweep.warm,
        "options": dict(sweep.options),
        "set": dict(sweep.constants),
        "figures": list(shown),
        "cases": [
            _as_data(case.name, case.axes, one)
            for case, one in zip(sweep.cases, swept.finished, strict=True)
        ],
        "solved": swept.solved.count(True),
        "exit_code": exit_code(one for one in swept.finished if one is not None),
        "notes": [f"{name}: {said}" for name, said in _notes(swept, shown).items()],
        "hdf5": str(hdf5),
        "plots": list(map(str, plots)),
    }
    typer.echo(json.dumps(finite(said), ensure_ascii=False))


def _as_data(name: str, axes: Any, one: Finished | None) -> dict[str, Any]:
    said: dict[str, Any] = {"case": name, "axes": dict(axes)}
    if one is None:
        return said | {"ending": None, "message": "", "figures": {}, "seconds": None, "hdf5": None}
    return said | {
        "ending": one.ending.name.lower(),
        "message": one.message,
        "figures": {
            key: list(value) if isinstance(value, tuple) else value
            for key, value in one.figures.items()
        },
        "seconds": one.seconds,
        "hdf5": None if one.result is None else str(one.result),
    }


def _notes(swept: Swept, shown: tuple[str, ...]) -> dict[str, str]:
    """Return what a reader must know of axes and figures, by their names."""
    said = "a constant of the problem and an option of a solve; the constant was swept"
    notes = dict.fromkeys(shadowed(swept.sweep.axes), said)
    for name in shown:
        count = sum(
            name not in one.figures
            for one, solved in zip(swept.finished, swept.solved, strict=True)
            if one is not None and solved
        )
        if count:
            notes[name] = f"not found of {count} cases done before; leave --resume out to have it"
    return notes


def _table(swept: Swept, shown: tuple[str, ...]) -> str:
    """Return a row for each case, numbers right-aligned."""
    sweep = swept.sweep
    names = [axis.name for axis in sweep.axes]
    rows = [[*names, *(name.replace("_", " ") for name in shown), "seconds", "ended"]]
    places = [
        [axis.labels[axis.values.index(case.axes[axis.name])] for axis in sweep.axes]
        for case in sweep.cases[:_MOST]
    ]
    found = [swept.figure(name) for name in shown]
    for i, place in enumerate(places):
        one = swept.finished[i]
        seconds = "-" if one is None else f"{one.seconds:.2f}"
        ended = "not begun" if one is None else one.ending.name.lower().replace("_", " ")
        rows.append([*place, *(_text(values[i]) for values in found), seconds, ended])
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    last = len(widths) - 1
    aligned = [
        [cell if i == last else cell.rjust(widths[i]) for i, cell in enumerate(row)] for row in rows
    ]
    text = columns(aligned, header=True)
    left = len(sweep.cases) - _MOST
    return f"{text}\n  and {left} more in the file" if left > 0 else text


def _text(value: Figure) -> str:
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "-"
    if isinstance(value, tuple):
        return " ".join(f"{entry:.4g}" for entry in value) or "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.8g}" if isinstance(value, float) else plain(str(value))
