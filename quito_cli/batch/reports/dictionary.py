"""Report -> what `quito batch --json` prints."""

from __future__ import annotations

from typing import Any

from quito_cli.batch.judging.comparing import Difference, Verdict
from quito_cli.batch.reports.report import Report
from quito_cli.batch.suite.case import Case, Check, Figure, Finished


def as_dictionary(report: Report) -> dict[str, Any]:
    """Return what `--json` prints; figures that are not finite are still numbers here."""
    return {
        "suite": report.suite,
        "title": report.title,
        "verdict": report.verdict,
        "exit_code": report.exit_code,
        "counts": {ending.name.lower(): count for ending, count in report.counts.items()},
        "not_begun": report.cases - len(report.finished),
        "failed": sum(map(report.failed, report.finished)) + len(report.gone),
        "seconds": report.seconds,
        "cases": [_finished(report, one) for one in report.finished],
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


def of_case(case: Case) -> dict[str, Any]:
    """Return what a case is."""
    return {
        "case": case.name,
        "problem": case.problem,
        "options": dict(case.options),
        "set": dict(case.constants),
        "axes": dict(case.axes),
        "follows": case.follows,
        "expect": [
            {key: _plain(value) for key, value in vars(one).items() if value is not None}
            for one in case.expectations
        ],
    }


def _finished(report: Report, one: Finished) -> dict[str, Any]:
    return of_case(one.case) | {
        "ending": one.ending.name.lower(),
        "failed": report.failed(one),
        "message": one.message,
        "figures": {name: _plain(figure) for name, figure in one.figures.items()},
        "checks": [_check(check) for check in one.checks],
        "seconds": one.seconds,
        "result": None if one.result is None else str(one.result),
    }


def _check(check: Check) -> dict[str, Any]:
    return {
        "figure": check.expectation.figure,
        "found": _plain(check.found),
        "passed": check.passed,
        "sentence": check.sentence,
    }


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
