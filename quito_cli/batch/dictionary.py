"""Report -> what `quito batch --json` prints."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from quito_cli.batch.case import Check, Figure, Finished
from quito_cli.batch.comparing import Difference, Verdict
from quito_cli.batch.report import Report


def as_dictionary(report: Report) -> dict[str, Any]:
    """Return what `--json` prints; figures that are not finite are still numbers here."""
    return {
        "suite": report.suite,
        "verdict": report.verdict,
        "exit_code": report.exit_code,
        "count": len(report.finished),
        "failed": sum(map(report.failed, report.finished)) + len(report.gone),
        "endings": {ending.name.lower(): count for ending, count in report.counts.items()},
        "seconds": report.seconds,
        "cases": [_case(report, case) for case in report.finished],
        "baseline": None
        if report.baseline is None
        else {
            "file": str(report.baseline),
            "recorded": report.recorded,
            "counts": {verdict.value: n for verdict, n in report.verdicts.items()},
            "differences": [
                _difference(row) for row in report.differences if row.verdict is not Verdict.SAME
            ],
        },
    }


def _case(report: Report, case: Finished) -> dict[str, Any]:
    return {
        "name": case.case.name,
        "problem": case.case.problem,
        "options": dict(case.case.options),
        "set": dict(case.case.constants),
        "axes": dict(case.case.axes),
        "ending": case.ending.name.lower(),
        "failed": report.failed(case),
        "message": case.message,
        "figures": {name: _plain(figure) for name, figure in case.figures.items()},
        "checks": [_check(check) for check in case.checks],
        "seconds": case.seconds,
        "result": None if case.result is None else str(case.result),
    }


def _check(check: Check) -> dict[str, Any]:
    expectation = {key: _plain(value) for key, value in asdict(check.expectation).items()}
    said = {"found": _plain(check.found), "passed": check.passed, "sentence": check.sentence}
    return expectation | said


def _difference(row: Difference) -> dict[str, Any]:
    return {
        "case": row.case,
        "figure": row.figure,
        "verdict": row.verdict.value,
        "recorded": _plain(row.recorded),
        "found": _plain(row.found),
        "allowed": row.allowed,
        "note": row.note,
    }


def _plain(figure: Figure) -> Any:
    return list(figure) if isinstance(figure, tuple) else figure
