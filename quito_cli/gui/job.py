"""A job, and the place where it is done: a worker, what it has told, and its clock."""

from __future__ import annotations

import shutil
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from quito_cli.batch.worker import Died, Raised, Returned, Told, Worker
from quito_cli.errors import QuitoError
from quito_cli.gui.work import Iterated, Noticed, Work, carry_out, warm_up

MOST_POINTS = 500
"""Of a history."""
_LONGEST_LOOK = 0.2
"""Seconds between two looks that count: where we were kept from looking, the worker was too."""


@dataclass(frozen=True)
class Limits:
    """What one solve may take."""

    seconds: float
    """After which it is told to stop, and keeps its best iterate."""
    memory: int
    """Bytes of its process."""
    characters: int
    """Of a problem's text."""
    grace: float
    """Seconds between being told to stop and having noticed, or being ended."""
    judging: float
    """Seconds after it, for the evidence of the iterate at which a solver has stopped."""
    waiting: int
    """Jobs in the queue, of all sessions."""


@dataclass(frozen=True)
class Request:
    """What is to be solved."""

    text: str
    """The problem, as YAML."""
    name: str
    """Of the problem, as files are named."""
    options: Mapping[str, Any] = field(default_factory=dict)
    """As given: fields of Options that differ from the file's own and the defaults."""
    against: tuple[str, ...] | None = None
    """None: a solve. Else a comparison with the reference, and with these methods: `("lgr",)`."""
    result: Path | None = None
    """Of a comparison: a saved answer in the place of our solve."""


@dataclass(frozen=True)
class Waiting:
    """All workers are busy."""

    place: int
    """In the queue, from 1."""


@dataclass(frozen=True)
class Running:
    """A worker is at it."""

    seconds: float
    history: tuple[Iterated, ...]
    """The latest last; a long one is thinned, so that it is never more than `MOST_POINTS`."""
    stopping: bool
    """Whether it has been told to stop."""
    stopped: bool
    """Whether that has been noticed: the solver stops at its iterate, which is being judged."""


@dataclass(frozen=True)
class Finished:
    """There is an answer; it may be one that did not converge, and says so."""

    folder: Path
    """Of `quito_cli.gui.answer.Answer.load`; it is there until the job is dropped."""
    seconds: float
    note: str
    """What ended it before its time; else empty."""


@dataclass(frozen=True)
class Failed:
    """There is none."""

    message: str
    """For people; several lines where the problem has several mistakes."""
    reason: str
    """`refused` (problem or options), `time`, `memory`, `cancelled`, `crashed`."""
    seconds: float


State = Waiting | Running | Finished | Failed
_TOO_LATE = {
    "cancelled": "cancelled before there was an iterate to keep",
    "time": "the time limit of {seconds:g} s was reached before there was an iterate to keep",
}
_NOTES = {
    "cancelled": "Cancelled: this is the best iterate so far.",
    "time": "The time limit of {seconds:g} s was reached: this is the best iterate so far.",
}


class Job:
    """One request from its arrival to its end; `state` is replaced as a whole."""

    def __init__(self, name: str, session: str, request: Request, folder: Path) -> None:
        self.name, self.session, self.request, self.folder = name, session, request, folder
        self.state: State = Waiting(0)
        self.cancelled = 0
        """How often that was asked for."""
        self.dropped = False
        self.begun = False
        """Whether the worker has it: a request to stop would be lost before."""
        self.asked = False
        """Whether it is to stop."""
        self.interrupted = False
        """Whether its solver was told so."""
        self.silence = 0.0
        """Seconds since it is to stop, as far as they were watched, until it had noticed."""
        self.stopped: float | None = None
        """When it had noticed, with an iterate to keep."""
        self.why = ""
        """It was told to: a key of the notes."""
        self._history: list[Iterated] = []
        self._began = 0.0

    @property
    def ended(self) -> bool:
        """Whether nothing more will come of it."""
        return isinstance(self.state, Finished | Failed)

    @property
    def seconds(self) -> float:
        """Since it began."""
        return time.monotonic() - self._began if self._began else 0.0

    @property
    def work(self) -> Work:
        """What the worker is to know."""
        asked = self.request
        return Work(
            asked.text, asked.name, dict(asked.options), asked.against, asked.result, self.folder
        )

    def begin(self) -> None:
        """Start the clock."""
        self._began = time.monotonic()
        self.tell()

    def heard(self, points: tuple[Iterated, ...]) -> None:
        """Add iterations; every other one of the older half goes when there are too many."""
        self._history += points
        while len(self._history) > MOST_POINTS:
            half = len(self._history) // 2
            self._history[:half] = self._history[:half:2]

    def tell(self) -> None:
        """Bring the state up to date."""
        self.state = Running(
            self.seconds, tuple(self._history), self.asked, self.stopped is not None
        )

    @property
    def iterating(self) -> bool:
        """Whether there is an iterate."""
        return bool(self._history)

    def finish(self, interrupted: bool, limits: Limits) -> None:
        """End with an answer; one that was interrupted is the best iterate."""
        told = interrupted and self.why
        note = _NOTES[self.why].format(seconds=limits.seconds) if told else ""
        self.state = Finished(self.folder, self.seconds, note)

    def fail(self, message: str, reason: str) -> None:
        """End without one."""
        self.state = Failed(message, reason, self.seconds)
        shutil.rmtree(self.folder, ignore_errors=True)


class Place:
    """A worker with the job it is at; for the clerk alone."""

    def __init__(self, limits: Limits, folder: Path) -> None:
        """Prepare; `folder` is for what is of no job."""
        self._limits, self._folder = limits, folder
        self._worker = Worker(limits.memory)
        self._looked = 0.0
        self.job: Job | None = None
        """None where it waits, or is warming up."""

    @property
    def busy(self) -> bool:
        """Whether it is at a job, or warming up."""
        return self._worker.busy

    @property
    def connection(self) -> Connection:
        """To wait for."""
        return self._worker.connection

    def warm(self) -> None:
        """Let the worker load what every solve needs, before there is one."""
        self._worker.start(warm_up, self._folder)

    def start(self, job: Job) -> None:
        """Begin a job.

        Raises:
            OSError: no process can be started for it.
        """
        self._worker.start(carry_out, job.work)
        job.begin()
        self.job, self._looked = job, time.monotonic()

    def hear(self) -> None:
        """Take a message of the worker, which is there."""
        said, job = self._worker.receive(), self.job
        if job is None:  # it has warmed up, or has died of it, and then its first job will tell
            return
        if isinstance(said, Told):
            job.begun = True
            if not isinstance(said.message, Noticed):
                job.heard(said.message)
            elif job.iterating:  # else there is nothing to keep, and nobody knows what it is at
                job.stopped = time.monotonic()
            job.tell()
            return
        if isinstance(said, Returned):
            job.finish(said.value, self._limits)
        elif isinstance(said, Raised):
            self._raised(job, said)
        else:
            self._died(job, said)
        self._free(again=isinstance(said, Died))

    def watch(self) -> None:
        """Look at the clock, and at what is wanted of the job."""
        job, limits = self.job, self._limits
        if job is None:
            return
        now = time.monotonic()
        passed, self._looked = min(now - self._looked, _LONGEST_LOOK), now
        late = job.seconds > limits.seconds
        if job.asked and not job.stopped:
            job.silence += passed
        elif not job.asked and (job.cancelled or late):
            job.why = "cancelled" if job.cancelled else "time"
            job.asked = True
        if job.asked and job.begun and not job.interrupted:
            job.interrupted = True
            self._worker.interrupt()
        silent = job.silence > limits.grace and not job.stopped
        slow = job.stopped and now - job.stopped > limits.judging
        if job.dropped or job.cancelled > 1 or silent or slow:
            self._worker.kill()
            why = job.why or "cancelled"
            job.fail(_TOO_LATE[why].format(seconds=limits.seconds), why)
            self._free(again=True)
        else:
            job.tell()

    def close(self) -> None:
        """End the worker."""
        self._worker.kill()

    def _free(self, *, again: bool) -> None:
        """Be ready for the next job, `again` with a new process."""
        if self.job is not None and self.job.dropped:
            shutil.rmtree(self.job.folder, ignore_errors=True)
        self.job = None
        if again:
            self.warm()

    def _raised(self, job: Job, said: Raised) -> None:
        if job.asked:
            job.fail(_TOO_LATE[job.why].format(seconds=self._limits.seconds), job.why)
        elif isinstance(said.error, QuitoError):
            job.fail(str(said.error), "refused")
        else:
            job.fail(f"a bug in quito: {said.error}", "crashed")

    def _died(self, job: Job, said: Died) -> None:
        reason = "memory" if said.out_of_memory else "crashed"
        job.fail(f"the process of the solver ended: {said.sentence}", reason)
