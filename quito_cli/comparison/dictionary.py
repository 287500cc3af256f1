"""Comparison -> what `--json` prints: the columns of the tables, and what is behind them."""

from __future__ import annotations

import math
from typing import Any

from quito_cli.comparison.comparison import Comparison, Errors, Row
from quito_cli.comparison.table import COLUMNS, Figure, of_errors


def as_dictionary(comparison: Comparison) -> dict[str, Any]:
    """Return what `--json` prints; figures that are not finite are still numbers here."""
    truth, names = comparison.truth, [q.name for q in comparison.controls]
    return {
        "problem": comparison.problem,
        "title": comparison.title,
        "against": truth.title if truth else None,
        "reference": None
        if truth is None
        else {
            "title": truth.title,
            "cost": truth.cost,
            "accuracy": truth.accuracy,
            "switching_times": list(truth.switching_times),
            "total_variation": dict(zip(names, truth.total_variation, strict=True)),
        },
        "samples": len(comparison.sample_times),
        "zones": [list(zone) for zone in comparison.zones],
        "rows": [_row(comparison, row) for row in comparison.rows],
        "published": [row.model_dump(exclude_none=True) for row in comparison.published],
        "notes": list(comparison.notes),
    }


def _row(comparison: Comparison, row: Row) -> dict[str, Any]:
    solution, truth = row.solution, comparison.truth
    said: dict[str, Any] = {
        "method": row.method,
        "success": row.solution.success,
        "status": solution.status.name.lower(),
        "message": solution.status.value,
        "polished": None if solution.polishing is None else solution.polished,
    }
    said |= {column.key: column.value(row) for given in COLUMNS.values() for column in given}
    known = truth.switching_times if truth else ()
    said |= {
        "error_l2_outside": of_errors("l2_outside")(row),
        "samples": len(comparison.sample_times),
        "resimulation_gap": solution.evidence.resimulation_gap,
        "final_time": float(solution.times[-1]),
        "switching_times": [
            {"known": time, "found": found, "error": error}
            for time, found, error in zip(
                known, row.switching_times, row.switching_errors, strict=True
            )
        ],
        "controls": {q.name: _control(row, i) for i, q in enumerate(comparison.controls)},
        "states": {
            q.name: {"error_sup": error}
            for q, error in zip(comparison.states, row.state_errors, strict=True)
        },
        "options": dict(solution.options),
    }
    return said


def _control(row: Row, i: int) -> dict[str, Figure]:
    unknown = Errors(*[math.nan] * 7)
    errors = row.by_control[i] if row.by_control else unknown
    return {
        "error_l1": errors.l1,
        "error_l2": errors.l2,
        "error_l2_outside": errors.l2_outside,
        "error_sup": errors.sup,
        "error_sup_outside": errors.sup_outside,
        "error_norm": errors.norm,
        "dft_norm": errors.dft_norm,
        "total_variation": row.total_variation[i],
        "ringing": row.ringing[i] if row.ringing else None,
    }
