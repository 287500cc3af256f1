"""A suite in, a Report out: what `quito batch` does, from the names of files to the verdict.

report = quito.run_suite("nightly.yaml", baseline="nightly.baseline.yaml")
report.write_junit("reports/junit.xml")
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol, get_args

from quito_cli.batch.judging import holding
from quito_cli.batch.reports.report import Report
from quito_cli.batch.suite.case import Ending, Finished, Scalar
from quito_cli.batch.suite.gathering import gather, selected
from quito_cli.batch.suite.suite import Suite
from quito_cli.batch.workers.jobs import workers_of
from quito_cli.batch.workers.recorded import in_order, limited, recorded
from quito_cli.batch.workers.run import Setting
from quito_cli.batch.workers.solving import Keep
from quito_cli.errors import UsageError


class Watcher(Protocol):
    """Who is told of a run as it goes."""

    moving: bool
    """Whether the progress of each solver is of interest."""

    def show(self, finished: Finished) -> None:
        """A case has finished."""

    def watch(self, name: str, progress: Any) -> None:
        """The solver of a case is at this Progress; None at its start."""

    def draw(self) -> None:
        """Some time has passed."""


class Nobody:
    """A Watcher who looks at nothing: to be filled in where something is of interest."""

    moving = False

    def show(self, finished: Finished) -> None:
        """Do nothing."""

    def watch(self, name: str, progress: Any) -> None:
        """Do nothing."""

    def draw(self) -> None:
        """Do nothing."""


def gathered(
    suite: str | Path | Suite | Sequence[str],
    *,
    options: Mapping[str, Any] | None = None,
    constants: Mapping[str, Scalar] | None = None,
    only: Sequence[str] = (),
    time_limit: float | None = None,
    memory_limit: int | str | None = None,
) -> Suite:
    """Return the cases that are to be run; none is solved. Arguments as of `run_suite`."""
    if isinstance(suite, str | Path):
        suite = [str(suite)]
    if not isinstance(suite, Suite):
        suite = gather(suite, options or {}, constants or {})
    elif options or constants:
        raise UsageError("options and constants are for problems: a Suite has its own")
    return limited(selected(suite, only), time_limit, memory_limit)


def run_suite(
    suite: str | Path | Suite | Sequence[str],
    *,
    options: Mapping[str, Any] | None = None,
    constants: Mapping[str, Scalar] | None = None,
    only: Sequence[str] = (),
    jobs: int | None = None,
    cluster: str | None = None,
    output: str | Path = "results",
    time_limit: float | None = None,
    memory_limit: int | str | None = None,
    keep: Keep = "all",
    resume: bool = False,
    fail_fast: bool = False,
    baseline: str | Path | None = None,
    update_baseline: bool = False,
    watcher: Watcher | None = None,
) -> Report:
    """Solve all cases of a suite, as `quito batch` does.

    Ctrl-C stops it with what is done: the Report says so, and `resume` goes on from there.

    Args:
        suite: a suite or a problem file, the name of a bundled one, or several of these.
        options: fields of `Options` for all cases, where those are of problem files.
        constants: to set in all cases, likewise.
        only: parts of names of cases, or whole names with `*` and `?`; the others are left out.
        jobs: cases that are solved at once; as many as there are processors by default.
        cluster: address of a Dask scheduler whose workers solve the cases, or its scheduler file.
        output: folder of the result files and of the journal.
        time_limit: seconds of a case; by default what the suite says.
        memory_limit: of a case, in bytes or such as "2 GB"; by default what the suite says.
        keep: whose result files stay: those of "all" cases, of "failed" ones, or "none".
        resume: go on where an earlier run stopped.
        fail_fast: stop at the first case that does not pass.
        baseline: a file with the figures of an earlier run, to hold this one against.
        update_baseline: write this run's figures to the baseline, which may be a new one.
        watcher: told of the run as it goes.

    Returns:
        What became of the cases, in the order of the suite, with the verdict.

    Raises:
        UsageError: no such suite, baseline or option, or nothing to resume.
        ProblemError: the suite or the baseline has mistakes; all of them are told.
        UnavailableError: the cluster cannot be used.
        ResultFileError: a file cannot be written.
    """
    setting = Setting(workers_of(jobs, cluster), Path(output), known(keep), cluster=cluster)
    if update_baseline and baseline is None:
        raise UsageError("update_baseline needs a baseline: the file to write")
    made = gathered(
        suite,
        options=options,
        constants=constants,
        only=only,
        time_limit=time_limit,
        memory_limit=memory_limit,
    )
    held = None
    if baseline is not None:
        here = None if cluster is not None else min(setting.jobs, len(made.cases))
        held = holding.prepare(Path(baseline), here, update=update_baseline)
    record = held.baseline.costly if held else ()
    setting = replace(setting, limits=made.limits, record=record)
    began = time.perf_counter()
    finished, stopped = _finished(made, setting, watcher or Nobody(), resume, fail_fast)
    seconds = time.perf_counter() - began
    report = holding.report_of(made, finished, seconds, held)
    return replace(report, planned=made.cases, folder=setting.folder, interrupted=stopped)


def _finished(
    suite: Suite, setting: Setting, watcher: Watcher, resume: bool, fail_fast: bool
) -> tuple[tuple[Finished, ...], bool]:
    """Return what became of the cases, in their order, and whether the user stopped them."""
    from quito_cli.solvers.interruption import interruptible

    finished: list[Finished] = []
    with interruptible() as interruption:

        def stop() -> bool:
            watcher.draw()
            failed = fail_fast and any(one.ending is not Ending.PASSED for one in finished)
            return interruption.requested or failed

        setting = replace(setting, stop=stop, watch=watcher.watch if watcher.moving else None)
        for one in recorded(suite, setting, resume=resume):
            finished.append(one)
            watcher.show(one)
        done = sum(one.ending is not Ending.INTERRUPTED for one in finished)
        stopped = interruption.requested and done < len(suite.cases)
    return in_order(suite, finished), stopped


def known(keep: str) -> Keep:
    """Return which result files stay.

    Raises:
        UsageError: that means nothing.
    """
    words: tuple[Keep, ...] = get_args(Keep)
    for word in words:
        if keep == word:
            return word
    raise UsageError(f"keep: expected {', '.join(words[:-1])} or {words[-1]}, got {keep!r}")
