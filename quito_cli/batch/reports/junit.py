"""Report -> JUnit XML, the dialect that Jenkins, GitLab and GitHub's reporters read.

There is no standard of it; this is what Maven Surefire writes and Jenkins' schema accepts:

    testsuites > testsuite (name, tests, failures, errors, skipped, time)
      > properties, then testcase (name, classname, time)
        > one of failure, error, skipped; then system-out

A *failure* is an answer outside a tolerance or worse than the baseline; an *error* is no answer at
all; what was interrupted is *skipped*. A case that only the baseline has is a failure of its own.
The figures of a case are its system-out: the schema knows properties of a suite alone. Characters
that do not print are replaced: some XML cannot hold.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Final
from xml.etree import ElementTree as ET

from quito_cli import __version__
from quito_cli.batch.reports.report import Report
from quito_cli.batch.reports.table import GONE, Row, figure, shown, table
from quito_cli.batch.suite.case import Ending, Finished
from quito_cli.solution.store import write_content

_OUTCOMES: Final = {
    Ending.PASSED: "failure",
    Ending.OUTSIDE: "failure",
    Ending.INTERRUPTED: "skipped",
}
"""Elements by ending, of a case that failed; of the rest, error."""


def write(report: Report, path: Path) -> None:
    """Write the JUnit XML of a run; an older file is replaced only when all is written.

    Raises:
        ResultFileError: the file cannot be written.
    """
    write_content(path, junit(report))


def junit(report: Report) -> str:
    """Return the JUnit XML of a run."""
    rows = table(report).rows
    outcomes = [_outcome(row) for row in rows]
    counts = {
        "tests": len(rows) + len(report.gone),
        "failures": outcomes.count("failure") + len(report.gone),
        "errors": outcomes.count("error"),
    }
    common = {name: str(count) for name, count in counts.items()}
    common |= {"name": shown(report.suite), "time": _seconds(report.seconds)}
    root = ET.Element("testsuites", common)
    suite = ET.SubElement(root, "testsuite", {**common, "skipped": str(outcomes.count("skipped"))})
    _properties(suite, report)
    for row, outcome in zip(rows, outcomes, strict=True):
        _case(suite, report, row, outcome)
    for name in report.gone:
        case = _testcase(suite, name, f"{report.suite}.baseline", 0.0)
        ET.SubElement(case, "failure", {"type": "missing", "message": GONE}).text = GONE
    ET.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ET.tostring(root, encoding="unicode")}\n'


def _properties(suite: ET.Element, report: Report) -> None:
    said = {"quito": __version__, "verdict": report.verdict}
    if report.baseline is not None:
        said["baseline"] = str(report.baseline)
    properties = ET.SubElement(suite, "properties")
    for name, value in said.items():
        ET.SubElement(properties, "property", {"name": name, "value": shown(value)})


def _outcome(row: Row) -> str:
    return _OUTCOMES.get(row.case.ending, "error") if row.failed else ""


def _case(suite: ET.Element, report: Report, row: Row, outcome: str) -> None:
    given = row.case.case
    problem = Path(given.problem).stem
    case = _testcase(suite, row.name, f"{report.suite}.{problem}", row.case.seconds)
    if outcome:
        message = row.reasons[0] if row.reasons else row.case.ending.value
        said = {"type": row.result.replace(" ", "-"), "message": shown(message)}
        ET.SubElement(case, outcome, said).text = shown(
            "\n".join((row.case.ending.value, *row.reasons))
        )
    ET.SubElement(case, "system-out").text = shown("\n".join(_told(row.case)))


def _testcase(suite: ET.Element, name: str, classname: str, seconds: float) -> ET.Element:
    said = {"name": shown(name), "classname": shown(classname), "time": _seconds(seconds)}
    return ET.SubElement(suite, "testcase", said)


def _told(case: Finished) -> Iterator[str]:
    """Yield what there is to say of a case, in lines."""
    if case.message:
        yield case.message
    yield from (f"{'+' if check.passed else '-'} {check.sentence}" for check in case.checks)
    yield from (f"{name} = {figure(value)}" for name, value in case.figures.items())
    given = {"option": case.case.options, "set": case.case.constants}
    for what, values in given.items():
        yield from (f"{what} {name} = {value}" for name, value in values.items())
    if case.result is not None:
        yield f"result {case.result}"


def _seconds(seconds: float) -> str:
    return f"{max(seconds, 0.0):.3f}"
