"""The desk: all solves of a server, in a fixed number of processes and one queue.

A session is a browser tab and has one solve at a time, so that first come, first served is fair.
Nothing here blocks: a thread of the desk's own, the clerk, waits for the workers, and `Desk.state`
tells what it has heard.

    desk = Desk(LIMITS, workers=2)
    job = desk.submit("tab 1", Request(text=..., name="rocket"))
    async for state in desk.follow(job):    # Waiting, Running, ..., then Finished or Failed
        ...
    desk.cancel(job)                        # keeps the best iterate
    desk.close()

To be cancelled is first to be asked: a solver that is at its iterations stops at the next one, and
its best iterate is judged like an answer. What has not noticed within `Limits.grace`, or has no
iterate yet, is ended with its process; so is what is cancelled twice.
"""

from __future__ import annotations

import asyncio
import atexit
import itertools
import multiprocessing
import multiprocessing.connection
import shutil
import threading
from collections.abc import AsyncIterator
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path
from typing import cast

from quito_cli.errors import UsageError
from quito_cli.gui.folders import new_folder
from quito_cli.gui.job import (
    Failed,
    Finished,
    Job,
    Limits,
    Place,
    Request,
    Running,
    State,
    Waiting,
)

__all__ = [
    "LIMITS",
    "Desk",
    "Failed",
    "Finished",
    "Limits",
    "Request",
    "Running",
    "State",
    "Waiting",
]

LIMITS = Limits(
    seconds=300.0, memory=4 * 10**9, characters=200_000, grace=0.8, judging=20.0, waiting=50
)
"""Of a server that was told nothing else."""
_TICK = 0.1
"""Seconds between two looks at the clock, while something runs."""
_FOLLOW = 0.05
"""Seconds between two looks at a job that is followed."""


class Desk:
    """All solves of a server; safe to call from any thread, and never waits."""

    def __init__(self, limits: Limits, workers: int, folder: Path | None = None) -> None:
        """Make the folder of the server, a new temporary one unless it is given; warm up."""
        self.limits = limits
        self.folder = folder or new_folder()
        """Of the jobs' folders; removed at the end."""
        self._lock = threading.Lock()
        self._jobs: dict[str, Job] = {}
        self._queue: list[Job] = []
        self._numbers = itertools.count(1)
        spare = self.folder / "warm-up"
        self._places = [Place(limits, spare) for _ in range(workers)]
        self._bell, self._ring = multiprocessing.Pipe(duplex=False)
        self._closed = False
        self._clerk = threading.Thread(target=self._serve, name="quito desk", daemon=True)
        self._clerk.start()
        atexit.register(self.close)

    def submit(self, session: str, request: Request) -> str:
        """Put a request into the queue, and return the job's name.

        Raises:
            UsageError: the text is too long, the session has a solve that has not ended, or the
                queue is full.
        """
        if len(request.text) > self.limits.characters:
            raise UsageError(
                f"the problem has {len(request.text):,} characters; at most "
                f"{self.limits.characters:,} are solved here"
            )
        with self._lock:
            if self._closed:
                raise UsageError("the server is being closed")
            if any(job.session == session and not job.ended for job in self._jobs.values()):
                raise UsageError("a solve of this tab has not ended: cancel it first")
            if len(self._queue) >= self.limits.waiting:
                raise UsageError("too many solves are waiting: try again later")
            name = f"job{next(self._numbers)}"
            job = Job(name, session, request, self.folder / name)
            self._jobs[name] = job
            self._queue.append(job)
            self._tell_places()
        self._wake()
        return name

    def state(self, job: str) -> State:
        """Tell how a job is.

        Raises:
            UsageError: there is no such job, or it has been dropped.
        """
        with self._lock:
            return self._find(job).state

    async def follow(self, job: str) -> AsyncIterator[State]:
        """Yield the state of a job whenever it changes, Finished or Failed last.

        Raises:
            UsageError: there is no such job, or it is dropped meanwhile.
        """
        seen: State | None = None
        while not isinstance(seen, Finished | Failed):
            state = self.state(job)
            if state is seen:
                await asyncio.sleep(_FOLLOW)
                continue
            seen = state
            yield state

    def cancel(self, job: str) -> None:
        """Take a job from the queue, or tell its solver to stop; one that has ended stays so."""
        with self._lock:
            self._cancel(self._find(job))
        self._wake()

    def drop(self, job: str) -> None:
        """Forget a job with its files; one that has not ended is ended first."""
        with self._lock:
            found = self._jobs.pop(job, None)
            if found is None:
                return
            found.dropped = True
            if found in self._queue:
                self._cancel(found)
        self._wake()
        if found.ended:  # else the clerk does it
            shutil.rmtree(found.folder, ignore_errors=True)

    def leave(self, session: str) -> None:
        """Drop all jobs of a session: its tab is closed."""
        with self._lock:
            own = [name for name, job in self._jobs.items() if job.session == session]
        for name in own:
            self.drop(name)

    def close(self) -> None:
        """End all processes, and remove the folder."""
        with self._lock:
            if self._closed:
                return
            self._closed = True
        atexit.unregister(self.close)
        self._wake()
        self._clerk.join()
        shutil.rmtree(self.folder, ignore_errors=True)

    def _find(self, job: str) -> Job:
        if job not in self._jobs:
            raise UsageError("that run is not kept any more: run it again")
        return self._jobs[job]

    def _cancel(self, job: Job) -> None:
        if job in self._queue:
            self._queue.remove(job)
            job.fail("cancelled before it began", "cancelled")
            self._tell_places()
        else:
            job.cancelled += 1

    def _tell_places(self) -> None:
        for place, job in enumerate(self._queue, 1):
            job.state = Waiting(place)

    def _wake(self) -> None:
        with suppress(OSError, ValueError):
            self._ring.send_bytes(b"!")

    def _serve(self) -> None:
        """What the clerk does until the desk is closed."""
        for place in self._places:
            place.warm()
        while not self._closed:
            self._give_out()
            busy = {place.connection: place for place in self._places if place.busy}
            at_work = any(place.job for place in self._places)
            for ready in multiprocessing.connection.wait(
                [self._bell, *busy], _TICK * at_work or None
            ):
                if ready is self._bell:
                    self._bell.recv_bytes()
                else:
                    busy[cast(Connection, ready)].hear()
            for place in self._places:
                place.watch()
        for place in self._places:
            place.close()

    def _give_out(self) -> None:
        """Give the next jobs to places that have none."""
        for place in self._places:
            if place.busy:
                continue
            with self._lock:
                if not self._queue:
                    return
                job = self._queue.pop(0)
                self._tell_places()
            try:
                place.start(job)
            except OSError as error:
                job.fail(f"no process could be started: {error.strerror}", "crashed")
