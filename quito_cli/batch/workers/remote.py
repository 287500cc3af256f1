"""What a Dask worker does: it solves a case in a process of quito's own, and hands back the result.

A case comes as a `Parcel`, with the text of its problem and the bytes of the answer it starts from,
and goes back as a `Delivery`, with the bytes of its result file: the machine needs quito and no
file. The case runs in a `Worker`, as it does at home, so that one that crashes, or is ended by its
limits, does not take the Dask worker with it. A Worker is kept for the next case for a while.
"""

from __future__ import annotations

import os
import tempfile
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Final

from quito_cli import __version__
from quito_cli.batch.suite.case import Case, Ending, Finished
from quito_cli.batch.suite.limits import Limits
from quito_cli.batch.workers.run import Setting, run
from quito_cli.batch.workers.solving import Keep
from quito_cli.batch.workers.worker import Worker
from quito_cli.errors import UnavailableError

_IDLE: Final = 30.0
"""Seconds that a Worker waits for its next case before it leaves."""
_REMEMBERED: Final = 100
"""Runs that have been stopped: cases of a later one come no more."""


@dataclass(frozen=True)
class Parcel:
    """A case on its way to a worker."""

    run: str
    """Of which run it is; every run has a name of its own."""
    version: str
    """Of the quito that sends it."""
    case: Case
    """With its text."""
    guess: tuple[str, bytes] | None
    """Name and bytes of the result file that it starts from."""
    limits: Limits
    keep: Keep
    record: tuple[str, ...]
    """Figures to be found beside those that are expected."""
    job: Callable[..., Finished]


@dataclass(frozen=True)
class Delivery:
    """What became of a case, on its way back."""

    finished: Finished
    """Of the case by its name alone, without result."""
    result: bytes | None
    """Of the result file; None where there is none."""


_lock = threading.Lock()
_idle: list[tuple[float, Worker]] = []
_stopped: OrderedDict[str, None] = OrderedDict()


def version() -> str:
    """Return the version of quito here."""
    return __version__


def solve(parcel: Parcel) -> Delivery:
    """Solve a case.

    Raises:
        UnavailableError: another quito is installed here than there.
    """
    if parcel.version != __version__:
        raise UnavailableError(
            f"a worker has quito {__version__}, and the cases come from {parcel.version}: install "
            "the same version everywhere"
        )
    with tempfile.TemporaryDirectory(prefix="quito-") as home, _borrowed() as worker:
        folder = Path(home)
        case = replace(parcel.case, follows=None)
        if parcel.guess is not None:
            name, start = parcel.guess
            (folder / name).write_bytes(start)
            case = replace(case, options={**case.options, "guess": name})
        setting = Setting(
            jobs=1,
            folder=folder / "results",
            keep=parcel.keep,
            limits={case.name: parcel.limits},
            record=parcel.record,
            stop=lambda: parcel.run in _stopped,
            job=partial(_within, home, parcel.job),
        )
        for finished in run([case], setting, workers=[worker]):
            path = finished.result
            content = path.read_bytes() if path is not None else None
            return Delivery(replace(finished, case=Case(case.name, ""), result=None), content)
    never = Finished(Case(case.name, ""), Ending.INTERRUPTED, "not begun", {}, (), 0.0, None)
    return Delivery(never, None)


def _within(home: str, job: Callable[..., Finished], *arguments: Any) -> Finished:
    """Do a job in a folder: what it records of files there are names that all machines have."""
    os.chdir(home)
    try:
        return job(*arguments)
    finally:
        os.chdir(os.path.sep)  # the folder is about to go


def stop(run: str) -> None:
    """End what is at work here of a run, and begin none of its cases that are still to come."""
    with _lock:
        _stopped[run] = None
        while len(_stopped) > _REMEMBERED:
            _stopped.popitem(last=False)


@contextmanager
def _borrowed() -> Iterator[Worker]:
    """Lend an idle Worker, or a new one."""
    with _lock:
        worker = _idle.pop()[1] if _idle else Worker(None)
    try:
        yield worker
    finally:
        if worker.busy:  # the case was given up in the middle
            worker.kill()
        with _lock:
            _idle.append((time.monotonic(), worker))
        timer = threading.Timer(_IDLE + 1.0, _dismiss)
        timer.daemon = True
        timer.start()


def _dismiss() -> None:
    """Let Workers leave that have been idle for long."""
    with _lock:
        since = time.monotonic() - _IDLE
        leaving = [worker for at, worker in _idle if at < since]
        _idle[:] = [(at, worker) for at, worker in _idle if at >= since]
    for worker in leaving:
        worker.close()
