"""A suite run with its journal: what has finished is on disk at once, and a run can be resumed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Final

from quito_cli.batch.case import Ending, Finished
from quito_cli.batch.journal import Journal
from quito_cli.batch.limits import Limits, bytes_of
from quito_cli.batch.run import NO_LIMITS, Setting, run
from quito_cli.batch.suite import Suite
from quito_cli.errors import UsageError

_WORST_FIRST: Final = (2, 1, 3)
"""Exit codes: where cases ended differently, the first of these counts."""


def journal_path(folder: Path, suite: Suite) -> Path:
    """Return where the journal of a suite is, beside its results."""
    return folder / f"{suite.name}.batch.jsonl"


def recorded(suite: Suite, setting: Setting, *, resume: bool) -> Iterator[Finished]:
    """Run a suite, and write down every case as it finishes.

    Args:
        suite: what to run.
        setting: how.
        resume: whether to go on where an earlier run stopped: what it finished is yielded first.

    Raises:
        UsageError: there is nothing to resume, it is of other cases, or another run is at it.
        ResultFileError: the journal cannot be read or written.
    """
    with Journal(journal_path(setting.folder, suite), suite.cases, resume=resume) as journal:
        yield from (journal.done[c.name] for c in suite.cases if c.name in journal.done)
        for finished in _runner(setting)(suite.cases, setting, journal.done):
            journal.write(finished)
            yield finished


def _runner(setting: Setting) -> Callable[..., Iterator[Finished]]:
    """Return what runs cases: processes here, or a cluster."""
    if setting.cluster is None:
        return run
    from quito_cli.batch.cluster import run_on

    return partial(run_on, setting.cluster)


def limited(suite: Suite, seconds: float | None, memory: int | str | None) -> Suite:
    """Return a suite with limits for all of its cases, where they are given.

    Raises:
        UsageError: a limit is none.
    """
    if seconds is not None and not seconds > 0:
        raise UsageError(f"time-limit: a number of seconds above 0 is expected, got {seconds:g}")
    size = None if memory is None else bytes_of(memory)

    def over(below: Limits) -> Limits:
        return Limits(
            below.seconds if seconds is None else seconds, below.memory if size is None else size
        )

    every = {case.name: over(suite.limits.get(case.name, NO_LIMITS)) for case in suite.cases}
    return replace(suite, limits=every)


def in_order(suite: Suite, finished: Iterable[Finished]) -> tuple[Finished, ...]:
    """Return finished cases in the order of their suite."""
    places = {case.name: i for i, case in enumerate(suite.cases)}
    return tuple(sorted(finished, key=lambda one: places[one.case.name]))


def counted(finished: Iterable[Finished]) -> dict[Ending, int]:
    """Return how many cases ended how, in the order of `Ending`."""
    counts = Counter(one.ending for one in finished)
    return {ending: counts[ending] for ending in Ending if counts[ending]}


def exit_code(finished: Iterable[Finished]) -> int:
    """Return what a run ends with: 0 where all passed, 2 where one was refused, 1 where one did
    not solve, 3 where one is outside its tolerance; interrupted ones say nothing."""
    codes = {one.ending.exit_code for one in finished}
    return next((code for code in _WORST_FIRST if code in codes), 0)
