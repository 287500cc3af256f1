"""Cases -> Finished cases, as they finish: a few workers, each taking one case after another.

A case that follows another waits for it and starts from its answer; where that is no answer, from
the answer of what it followed in turn, and so on. So what a case comes to does not depend on how
many workers there are. A case that crashes, hangs or takes too much memory ends as that, and its
worker is replaced.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from multiprocessing.connection import wait
from pathlib import Path
from typing import Any, Final

from quito_cli.batch.suite.case import Case, Ending, Finished
from quito_cli.batch.suite.limits import Limits
from quito_cli.batch.workers.solving import BEGUN, Keep, file_stem, result_path, solve_case
from quito_cli.batch.workers.worker import Died, Raised, Returned, Told, Worker
from quito_cli.errors import UsageError

_LOOK: Final = 0.1
"""Seconds between two looks at the clock and at whether to stop."""
_LOADING: Final = 120.0
"""Seconds that a worker may take to load its modules before its case begins."""
_GRACE: Final = 20.0
"""Seconds that a case has to stop, and to look at what it has reached."""
_LAST_WORDS: Final = 300
"""Characters of what a dead worker printed that are told."""
NO_LIMITS: Final = Limits(None, None)


@dataclass(frozen=True)
class Setting:
    """How cases are run, all of them alike."""

    jobs: int
    """Workers at most."""
    folder: Path
    """Where results go; made where it is missing."""
    keep: Keep
    """Whose results stay; those that other cases start from do in any case."""
    limits: Mapping[str, Limits] = field(default_factory=dict)
    """By name of the case; none where it is not named."""
    record: Collection[str] = ()
    """Figures to be found beside those that are expected: costly ones of `judging.figures`."""
    stop: Callable[[], bool] = lambda: False
    """Asked now and then: whether to stop with what there is."""
    watch: Callable[[str, Any], None] | None = None
    """Told the name of a case and the Progress of its solver, now and then; and None at its
    start."""
    job: Callable[..., Finished] = solve_case
    """What a worker does with a case."""
    cluster: str | None = None
    """Address of a Dask scheduler, on whose workers they are run; None: here."""


def run(
    cases: Sequence[Case],
    setting: Setting,
    done: Mapping[str, Finished] | None = None,
    workers: Sequence[Worker] = (),
) -> Iterator[Finished]:
    """Solve cases.

    Args:
        cases: with names of their own.
        setting: how.
        done: what is finished already, by name: it is not solved again, nor yielded.
        workers: idle ones to take, and to leave as they are; none: own ones.

    Yields:
        What became of each, as it comes. When stopped, cases at work are yielded as interrupted,
        and those that have not begun are not yielded.

    Raises:
        UsageError: two cases have a name, or cases follow one another in a circle, or what is none.
    """
    refuse_tangles(cases)
    setting.folder.mkdir(parents=True, exist_ok=True)
    clean(setting.folder, cases)
    finished = dict(done or {})
    pending = {case.name: case for case in cases if case.name not in finished}
    own = [] if workers else [Worker(None) for _ in range(min(setting.jobs, len(pending)))]
    places = [_Place(worker) for worker in workers or own]
    everything = {case.name: case for case in cases}
    followed = frozenset(case.follows for case in cases)
    try:
        while pending or any(place.case for place in places):
            if setting.stop():
                yield from _stopped(places)
                return
            _assign(places, pending, finished, everything, followed, setting)
            for ended in _heard(places, setting):
                finished[ended.case.name] = ended
                yield ended
    finally:
        for worker in own:
            worker.close()


@dataclass
class _Place:
    """A worker and what it is at."""

    worker: Worker
    case: Case | None = None
    started: float = 0.0
    deadline: float | None = None
    limits: Limits = NO_LIMITS
    begun: bool = False
    """Whether the case listens to a request to stop."""

    def end(self, ending: Ending, message: str) -> Finished:
        """Return its case as one without an answer."""
        assert self.case is not None
        seconds = time.perf_counter() - self.started
        ended, self.case = Finished(self.case, ending, message, {}, (), seconds, None), None
        return ended

    def take(self, case: Case, guess: Path | None, keep: Keep, setting: Setting) -> None:
        """Begin with a case."""
        self.case, self.limits = case, setting.limits.get(case.name, NO_LIMITS)
        self.started, self.begun = time.perf_counter(), False
        self.deadline = None if self.limits.seconds is None else self.started + _LOADING
        self.worker.memory = self.limits.memory
        watched = setting.watch is not None
        self.worker.start(setting.job, case, guess, setting.folder, keep, setting.record, watched)
        if setting.watch is not None:
            setting.watch(case.name, None)

    def hear(self, setting: Setting) -> Finished | None:
        """Return its case where it has ended."""
        assert self.case is not None
        match self.worker.receive():
            case Told(message) if message == BEGUN:
                self.started, self.begun = time.perf_counter(), True
                if self.limits.seconds is not None:
                    self.deadline = self.started + self.limits.seconds
            case Told(message):
                if setting.watch is not None:
                    setting.watch(self.case.name, message)
            case Returned(finished):
                self.case = None
                assert isinstance(finished, Finished)
                return finished
            case Raised(error):
                return self.end(Ending.CRASHED, f"a bug in quito: {error}")
            case Died() as died:
                ending = Ending.OUT_OF_MEMORY if died.out_of_memory else Ending.CRASHED
                return self.end(ending, _obituary(died))
        return None


def _assign(
    places: Sequence[_Place],
    pending: dict[str, Case],
    finished: Mapping[str, Finished],
    everything: Mapping[str, Case],
    followed: Collection[str | None],
    setting: Setting,
) -> None:
    """Give idle workers the first cases that need not wait; results of those followed are kept."""
    for place in places:
        if place.case is not None:
            continue
        ready = (c for c in pending.values() if c.follows is None or c.follows in finished)
        case = next(ready, None)
        if case is None:
            return
        del pending[case.name]
        keep: Keep = "all" if case.name in followed else setting.keep
        place.take(case, answer_before(case, finished, everything), keep, setting)


def answer_before(
    case: Case, finished: Mapping[str, Finished], everything: Mapping[str, Case]
) -> Path | None:
    """Return the answer to start from: the nearest on the way that a case follows."""
    name = case.follows
    while name is not None:
        before = finished[name]
        if before.ending in (Ending.PASSED, Ending.OUTSIDE) and before.result is not None:
            return before.result
        name = everything[name].follows
    return None


def _heard(places: Sequence[_Place], setting: Setting) -> Iterator[Finished]:
    """Wait for a while; yield what has ended, by itself or by its limits."""
    busy = [place for place in places if place.case is not None]
    now = time.perf_counter()
    times = [place.deadline - now for place in busy if place.deadline is not None]
    ready = wait([place.worker.connection for place in busy], max(0.0, min([_LOOK, *times])))
    for place in busy:
        if place.worker.connection in ready:
            if (ended := place.hear(setting)) is not None:
                yield ended
        elif place.deadline is not None and time.perf_counter() > place.deadline:
            place.worker.kill()
            limit = place.limits.seconds
            yield place.end(Ending.TIMED_OUT, f"it took more than its limit of {limit:g} s")


def _stopped(places: Sequence[_Place]) -> Iterator[Finished]:
    """Ask all that are at work to stop; yield them as interrupted, with what they have.

    A worker that dies of that has not crashed: its case is to be solved when the run is resumed.
    """
    busy = []
    for place in [place for place in places if place.case is not None]:
        if place.begun or place.worker.connection.poll():
            place.worker.interrupt()
            busy.append(place)
        else:  # there is nothing to be kept, and nobody yet who would hear
            place.worker.kill()
            yield place.end(Ending.INTERRUPTED, "it was stopped before it began")
    end = time.perf_counter() + _GRACE
    quiet = Setting(1, Path(), "none")
    while busy and (left := end - time.perf_counter()) > 0:
        ready = wait([place.worker.connection for place in busy], left)
        for place in [one for one in busy if one.worker.connection in ready]:
            ended = place.hear(quiet)
            if ended is not None:
                busy.remove(place)
                if ended.ending is Ending.CRASHED:
                    said = "it ended when it was asked to stop"
                    ended = replace(ended, ending=Ending.INTERRUPTED, message=said)
                yield ended
    for place in busy:
        place.worker.kill()
        yield place.end(Ending.INTERRUPTED, "it did not stop when it was asked to")


def _obituary(died: Died) -> str:
    last = died.printed[-_LAST_WORDS:]
    return f"{died.sentence}; its last words: {last}" if last else died.sentence


def refuse_tangles(cases: Sequence[Case]) -> None:
    """Refuse names that are not a case's own, and cases that wait for ever.

    Raises:
        UsageError: naming the cases.
    """
    seen: dict[str, str] = {}
    for case in cases:
        stem = file_stem(case.name).casefold()
        if stem in seen:
            raise UsageError(
                f"the cases {seen[stem]} and {case.name} would have the same result file: give one "
                "another name"
            )
        seen[stem] = case.name
    follows = {case.name: case.follows for case in cases}
    settled: set[str] = set()
    for name in follows:
        chain: list[str] = []
        at: str | None = name
        while at is not None and at not in settled:
            if at not in follows:
                raise UsageError(f"the case {chain[-1]} follows {at}, and there is no such case")
            if at in chain:
                raise UsageError(f"the case {name} follows itself, by way of {', '.join(chain)}")
            chain.append(at)
            at = follows[at]
        settled.update(chain)


def clean(folder: Path, cases: Sequence[Case]) -> None:
    """Remove what a run that was killed has left of files of these cases that it was writing."""
    stems = {result_path(folder, case.name).stem for case in cases}
    for path in folder.glob(".*.h5"):
        found = re.fullmatch(r"\.(.+)\.[0-9]+\.h5", path.name)
        if found and found[1] in stems:
            with suppress(OSError):
                path.unlink()
