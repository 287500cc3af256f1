"""Comparison -> tables: columns that terminal, Markdown, LaTeX and JSON share.

A column is a row of `COLUMNS`: its key in JSON, its heading, how its figures are written, what it
means, and where it is found in an answer and in a published row. Columns that no row fills are left
out. They are stacked in three tables rather than set side by side, so that each fits a terminal and
a page.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

from quito_cli.comparison.comparison import Comparison, Row
from quito_cli.problem.schema_reference import Published

Figure = float | int | None


@dataclass(frozen=True)
class Column:
    """A figure of every row."""

    key: str
    heading: str
    latex: str
    """The heading in LaTeX."""
    format: str
    """As Python formats numbers."""
    help: str
    value: Callable[[Row], Figure]
    published: str | None = None
    """Field of a published row that has it."""


@dataclass(frozen=True)
class Table:
    """A block of columns as text."""

    title: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[str, ...], ...]
    """A name and a figure for each column."""
    published: tuple[tuple[str, ...], ...]


def of_errors(name: str) -> Callable[[Row], Figure]:
    """Return what reads a norm of all controls together."""

    def value(row: Row) -> Figure:
        return None if row.errors is None else float(getattr(row.errors, name))

    return value


def _switching_error(row: Row) -> Figure:
    """Return the largest error; infinite where a switch is not made, None where none is known."""
    found = [abs(error) for error in row.switching_errors if not math.isnan(error)]
    return max(found, default=None)


OUTSIDE: Final = "error_sup_outside"
"""Shown where there are jump zones."""
COLUMNS: Final[Mapping[str, tuple[Column, ...]]] = {
    "Solve": (
        Column(
            *("unknowns", "unknowns", "unknowns", "d"),
            "unknowns of the nonlinear program",
            lambda row: row.solution.statistics.unknowns,
        ),
        Column(
            *("iterations", "iterations", "iterations", "d", "of the solver"),
            lambda row: row.solution.statistics.iterations,
            "iterations",
        ),
        Column(
            *("build_seconds", "build s", "build [s]", ".2g", "time before the solver is called"),
            lambda row: row.solution.statistics.build_seconds,
        ),
        Column(
            *("solve_seconds", "solve s", "solve [s]", ".2g", "time in the solver"),
            lambda row: row.solution.statistics.solve_seconds,
        ),
        Column(
            *("polish_seconds", "polish s", "polish [s]", ".2g", "of that, in the polish"),
            lambda row: row.polish_seconds,
        ),
        Column(
            *("seconds", "in all s", "in all [s]", ".2g", "build and solve together"),
            lambda row: row.seconds,
            "time",
        ),
    ),
    "Cost": (
        Column("cost", "cost", "cost", ".8g", "as solved", lambda row: row.solution.cost),
        Column(
            *("cost_error", "error", "error", "+.1e"),
            "cost - the truth's: below zero (above, in a maximisation) where it claims more than "
            "can be had",
            lambda row: row.cost_error,
        ),
        Column(
            *("resimulated_cost", "re-simulated", "re-simulated", ".8g"),
            "what the control attains, integrated anew",
            lambda row: row.solution.evidence.resimulated_cost,
        ),
        Column(
            *("resimulated_cost_error", "its error", "its error", "+.1e"),
            "re-simulated cost - the truth's",
            lambda row: row.resimulated_cost_error,
        ),
        Column(
            *("violation", "violation", "violation", ".1e"),
            "largest violation of any bound or constraint, between the nodes too",
            lambda row: row.solution.evidence.maximum_violation,
            "violation",
        ),
    ),
    "Error of the control": (
        Column(
            "error_l2",
            "L2",
            r"$\|e\|_{L^2}$",
            ".3g",
            "square root of the integral of e^2",
            of_errors("l2"),
        ),
        Column("error_l1", "L1", r"$\|e\|_{L^1}$", ".3g", "integral of |e|", of_errors("l1")),
        Column("error_sup", "sup", r"$\|e\|_\infty$", ".3g", "largest |e|", of_errors("sup")),
        Column(
            *(OUTSIDE, "outside", "outside", ".2g"),
            "largest |e| outside of the jump zones",
            of_errors("sup_outside"),
        ),
        Column(
            *("error_norm", "norm", r"$\|e\|_2$", ".4g", "2-norm of the vector of samples of e"),
            of_errors("norm"),
            "error_norm",
        ),
        Column(
            *("dft_norm", "DFT", r"$\|\mathrm{DFT}\,e\|_2$", ".4g"),
            "2-norm of its discrete Fourier transform, not normalised",
            of_errors("dft_norm"),
            "dft_norm",
        ),
    ),
    "Shape of the control, and the states": (
        Column(
            *("total_variation", "variation", "variation", ".4g"),
            "total variation, summed over the controls",
            lambda row: sum(row.total_variation) if row.total_variation else None,
        ),
        Column(
            *(
                "ringing",
                "ringing",
                "ringing",
                ".2g",
                "largest ringing index; to about 1 it is none",
            ),
            lambda row: max(row.ringing) if row.ringing else None,
        ),
        Column(
            *("switching_error", "switching", "switching", ".1e"),
            "largest error of a switching time; inf where the answer does not switch",
            _switching_error,
        ),
        Column(
            *("state_error", "states", "states", ".1e"),
            "largest error of a state, over the largest value of that state",
            lambda row: row.state_error,
        ),
    ),
}
"""By table."""
_BY_CONTROL: Final = ("Error of the control", "Shape of the control, and the states")
"""Tables whose columns say something of one control by itself."""
_MISSING: Final = "-"


def tables(comparison: Comparison) -> tuple[Table, ...]:
    """Return the tables of a comparison."""
    return tuple(
        table
        for name, given in COLUMNS.items()
        if (table := _table(comparison, name, given)).columns
    )


def _table(comparison: Comparison, title: str, given: Sequence[Column]) -> Table:
    columns = tuple(
        column
        for column in given
        if (comparison.zones or column.key != OUTSIDE)
        and (
            any(_known(column.value(row)) for row in comparison.rows)
            or any(_known(_of_published(column, row)) for row in comparison.published)
        )
    )
    published = [
        row
        for row in comparison.published
        if any(_known(_of_published(column, row)) for column in columns)
    ]
    return Table(
        title,
        columns,
        tuple(
            (called(row), *(text(column.value(row), column.format) for column in columns))
            for row in comparison.rows
        ),
        tuple(
            (_tool(row), *(text(_of_published(column, row), column.format) for column in columns))
            for row in published
        ),
    )


def by_control(comparison: Comparison) -> Table | None:
    """Return the errors and the shape of each control by itself; None where there is but one."""
    if len(comparison.controls) < 2:
        return None
    given = [column for name in _BY_CONTROL for column in COLUMNS[name]]

    def alone(row: Row, i: int) -> Row:
        known = row.by_control and not math.isnan(row.by_control[i].sup)
        return replace(
            row,
            errors=row.by_control[i] if known else None,
            total_variation=row.total_variation[i : i + 1],
            ringing=None if row.ringing is None else row.ringing[i : i + 1],
            state_error=None,
            switching_errors=(),
        )

    rows = tuple(
        replace(alone(row, i), method=f"{control.name} by {row.method}")
        for i, control in enumerate(comparison.controls)
        for row in comparison.rows
    )
    return _table(replace(comparison, rows=rows, published=()), "Each control", given)


def called(row: Row) -> str:
    """Return the name of a row, marked where it is no answer, or not the polished one."""
    if not row.solution.success:
        return f"{row.method} (not solved)"
    unpolished = row.solution.polishing is not None and not row.solution.polished
    return f"{row.method} (not polished)" if unpolished else row.method


def _tool(row: Published) -> str:
    return f"{row.tool}, {row.steps} steps (published)" if row.steps else f"{row.tool} (published)"


def _of_published(column: Column, row: Published) -> Figure:
    return None if column.published is None else getattr(row, column.published)


def _known(value: Figure) -> bool:
    return value is not None and not math.isnan(value)


def text(value: Figure, format: str) -> str:
    """Return a figure as text."""
    if value == 0:
        return "0"
    return _MISSING if value is None or math.isnan(value) else f"{value:{format}}"
