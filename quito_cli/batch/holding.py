"""A run held against its baseline file, and the file written anew on request.

What is compared has to be known before the run: the costly figures are found on request only, and
the times want calibrations. These are made before the run and after it, by as many workers at once
as the run has, since cores that share a cache or a clock are slower together; the fastest counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from quito_cli.batch import baseline_file
from quito_cli.batch.baseline import Baseline, updated
from quito_cli.batch.calibration import calibrate
from quito_cli.batch.case import Ending, Finished
from quito_cli.batch.comparing import compare, maximises, same
from quito_cli.batch.report import Report
from quito_cli.batch.suite import Suite
from quito_cli.batch.worker import Returned, Worker
from quito_cli.errors import QuitoError


@dataclass(frozen=True)
class Holding:
    """A baseline file that a run is held against."""

    path: Path
    baseline: Baseline
    update: bool
    """Whether it is written anew."""
    jobs: int | None
    """Workers of the run; None where they are on other machines."""
    calibration: float | None
    """Processor seconds of a calibration solve; None where no time is of interest."""


def prepare(path: Path, jobs: int | None, *, update: bool) -> Holding:
    """Read a baseline, and calibrate where it has times.

    Args:
        path: of the file; it need not be there where it is to be written.
        jobs: workers of the run; None where they are on other machines, whose times say nothing.
        update: whether it is to be written anew.

    Raises:
        UsageError: there is no such file.
        ProblemError: it has mistakes; all of them are told.
        QuitoError: the calibration solve failed.
    """
    begun = update and not path.exists()
    baseline = Baseline() if begun else baseline_file.read(path)
    unit = _calibration(jobs) if jobs is not None and baseline.timed else None
    return Holding(path, baseline, update, jobs, unit)


def _calibration(jobs: int) -> float:
    workers = [Worker(None) for _ in range(jobs)]
    try:
        for worker in workers:
            worker.start(calibrate)
        answers = [worker.receive() for worker in workers]
    finally:
        for worker in workers:
            worker.close()
    found: list[float] = [answer.value for answer in answers if isinstance(answer, Returned)]
    if not found:
        raise QuitoError(
            f"the calibration solve failed: {answers[0]}; without it times cannot be compared: "
            "let the baseline ignore processor_time"
        )
    return min(found)


def report_of(
    suite: Suite,
    finished: Sequence[Finished],
    seconds: float,
    holding: Holding | None,
) -> Report:
    """Return the report of a run; where that is wanted, its baseline is written anew.

    Args:
        suite: what was run.
        finished: what became of its cases.
        seconds: from the start of the run to its end.
        holding: the baseline; None where there is none. Where the suite is whole, a case that
            the baseline alone has is missing.

    Raises:
        ResultFileError: the baseline cannot be written.
    """
    cases = tuple(finished)
    if holding is None:
        return Report(suite.name, suite.title, len(suite.cases), cases, seconds)
    stopped = len(cases) < len(suite.cases) or any(
        case.ending is Ending.INTERRUPTED for case in cases
    )
    baseline, unit = holding.baseline, holding.calibration
    if unit is not None and holding.jobs is not None and not stopped:
        unit = min(unit, _calibration(holding.jobs))
    everything = [case.name for case in suite.cases] if suite.whole else None
    rows = compare(baseline, cases, unit, maximises, everything)
    recorded = holding.update and not stopped
    if recorded:
        made = updated(baseline, cases, same(rows), unit, everything)
        baseline_file.write(made, holding.path)
    return Report(
        suite.name, suite.title, len(suite.cases), cases, seconds, holding.path, rows, recorded
    )
