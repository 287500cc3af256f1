"""Solution or Comparison -> Answer."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from quito_cli.comparison import dictionary
from quito_cli.comparison.table import Table as ComparedTable
from quito_cli.comparison.table import by_control, tables
from quito_cli.comparison.writing import heading, sentences
from quito_cli.gui import charts
from quito_cli.gui.answer import Answer, Condition, Table
from quito_cli.solution.tally import CAVEAT, verdict
from quito_cli.summary.dictionary import as_dictionary, finite
from quito_cli.summary.rows import summary_rows

if TYPE_CHECKING:
    from quito_cli.comparison.comparison import Comparison
    from quito_cli.solution.solution import Solution


def of_solution(solution: Solution, given: Mapping[str, Any]) -> Answer:
    """Return a solution as the page shows it; `given` is what was asked for."""
    looked_at = solution.extremal is not None
    return Answer(
        kind="solve",
        name=solution.origin.name,
        title=solution.origin.title or solution.origin.name,
        given=given,
        success=solution.success,
        status=solution.status.name.lower(),
        said=solution.status.value,
        diagnosis=solution.evidence.diagnosis,
        rows=tuple(summary_rows(solution, verbose=False)),
        warnings=solution.warnings,
        verdict=verdict(solution.certificate) if looked_at else None,
        caveat=CAVEAT if looked_at else "",
        certificate=_certificate(solution),
        charts=charts.of_solution(solution),
        tables=(),
        notes=(),
        figures=as_dictionary(solution, None, None),
    )


def _certificate(solution: Solution) -> tuple[Condition, ...]:
    def known(value: float) -> float | None:
        return value if math.isfinite(value) else None

    return tuple(
        Condition(
            one.condition,
            known(one.residual),
            known(one.scale),
            known(one.time),
            one.verdict,
            one.reason,
        )
        for one in solution.certificate
    )


def of_comparison(comparison: Comparison, given: Mapping[str, Any]) -> Answer:
    """Return a comparison as the page shows it: our row's evidence, and the tables of all."""
    ours = of_solution(comparison.rows[0].solution, given)
    apart = by_control(comparison)
    stacked = (*tables(comparison), *([apart] if apart else []))
    failed = [row for row in comparison.rows if not row.solution.success]
    return Answer(
        kind="compare",
        name=ours.name,
        given=given,
        title=heading(comparison),
        success=not failed,
        status=ours.status,
        said=ours.said,
        diagnosis=tuple(f"{row.method}: {row.solution.status.value}" for row in failed),
        rows=ours.rows,
        warnings=ours.warnings,
        verdict=ours.verdict,
        caveat=ours.caveat,
        certificate=ours.certificate,
        charts=charts.of_comparison(comparison),
        tables=tuple(_table(one) for one in stacked if one.columns),
        notes=sentences(comparison),
        figures=finite(dictionary.as_dictionary(comparison)),
    )


def _table(table: ComparedTable) -> Table:
    return Table(
        table.title,
        ("method", *(column.heading for column in table.columns)),
        ("", *(column.help for column in table.columns)),
        table.rows,
        table.published,
    )
