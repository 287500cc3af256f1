"""A process that takes one job after another, and may die of one without harm to anybody else.

    worker = Worker(memory=2 * 10**9)
    worker.start(solve_case, case, folder)
    while isinstance(answer := worker.receive(), Told): ...

It is a fresh interpreter, started when its first job comes and replaced when it has died, in a
session of its own: Ctrl-C of the terminal does not reach it, and what it starts ends with it. BLAS
and solvers have one thread in it. Several workers are waited for together with
`multiprocessing.connection.wait([worker.connection for worker in ...])`. A thread here looks at its
memory and keeps the end of what it prints, for the report of a crash.
"""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import Pipe
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

from quito_cli.batch.workers.memory import QUICK, in_words, resident
from quito_cli.batch.workers.serving import EXHAUSTED, Raised, Returned, Told

__all__ = ["Answer", "Died", "Raised", "Returned", "Told", "Worker"]

_THREADS = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "BLIS_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "NUMEXPR_NUM_THREADS",
)
_LOOK = 0.05 if QUICK else 0.5
"""Seconds between two looks at the memory."""
_TAIL = 2_000
"""Bytes kept of what a worker prints."""
_GROWTH = 500_000_000
"""Bytes that a worker may have grown by since its first job before it is replaced."""
_SHARE = 8
"""Part of its limit that it may have grown by: what a job finds taken is not its fault."""
_GRACE = 1.0
"""Seconds that a worker has to leave by itself."""


@dataclass(frozen=True)
class Died:
    """The process ended in a job."""

    code: int | None
    """Exit code; the negative number of the signal; None where it is not known."""
    sentence: str
    """What it died of."""
    out_of_memory: bool = False
    """Whether it held more than its limit, or got no more."""
    printed: str = ""
    """The end of what it printed."""


Answer = Told | Returned | Raised | Died


class Worker:
    """A process for one job at a time."""

    def __init__(self, memory: int | None) -> None:
        """Prepare; the process is started with the first job.

        Args:
            memory: bytes it may hold, with what it starts; None: without limit.
        """
        self.memory = memory
        """Holds from the next job on."""
        self.busy = False
        """Whether a job is at work."""
        self._process: _Process | None = None
        self._settled = 0

    @property
    def connection(self) -> Connection:
        """To wait for; of the process at hand, so ask anew for every wait."""
        return self._running().connection

    def start(self, function: Callable[..., Any], *arguments: Any) -> None:
        """Begin a job: `function(*arguments, tell)` in the worker.

        Args:
            function: of a module's top level, sent by reference; `tell(message)` sends a `Told`.
            *arguments: to be pickled, as is what it returns.
        """
        assert not self.busy, "one job at a time"
        job = pickle.dumps((function, arguments))
        if self._process is not None and self._outgrown():
            self._process.leave()
            self._process = None
        if self._process is None:
            self._process = _Process()
            self._settled = 0
        self._process.memory = self.memory
        self.busy = True
        with suppress(OSError):  # of one that has died in the meantime `receive` will tell
            self._process.connection.send_bytes(job)

    def receive(self) -> Answer:
        """Return the next message of the job; blocks until there is one."""
        process = self._running()
        try:
            answer = process.connection.recv()
        except (EOFError, OSError, pickle.UnpicklingError):
            self.busy, self._process = False, None
            return process.died()
        if isinstance(answer, Returned | Raised):
            self.busy = False
            self._settled = self._settled or process.rss()
        assert isinstance(answer, Told | Returned | Raised)
        return answer

    def interrupt(self) -> None:
        """Ask the job to stop with what it has; solves keep their best iterate, and return."""
        if self.busy:
            self._running().interrupt()

    def kill(self) -> None:
        """End the process at once, with all that it has started; the next job gets a new one."""
        if self._process is not None:
            self._process.end(0)
        self.busy, self._process = False, None

    def close(self) -> None:
        """Let an idle process leave; a busy one is ended."""
        if self._process is not None and not self.busy:
            self._process.leave()
            self._process = None
        self.kill()

    def rss(self) -> int:
        """Return the bytes of resident memory, with those of what it started; 0 without process."""
        return self._process.rss() if self._process is not None else 0

    def _running(self) -> _Process:
        assert self._process is not None, "the worker has no job"
        return self._process

    def _outgrown(self) -> bool:
        """Whether the process is gone, or has kept so much of its jobs that a new one is better."""
        process = self._running()
        growth = _GROWTH if self.memory is None else min(_GROWTH, self.memory // _SHARE)
        return not process.alive or bool(self._settled and process.rss() > self._settled + growth)


class _Process:
    """One interpreter, from its start to its end."""

    def __init__(self) -> None:
        ours, theirs = Pipe()
        with theirs:
            self._popen = subprocess.Popen(
                [
                    sys.executable,
                    "-P",  # what lies in the working folder is not to be imported
                    "-c",
                    f"from quito_cli.batch.workers.serving import serve; serve({theirs.fileno()})",
                ],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                env=_environment(),
                pass_fds=[theirs.fileno()],
                start_new_session=True,
            )
        self.connection = ours
        self._tail = b""
        self._excess = 0
        self.memory: int | None = None
        self._ended = threading.Event()
        self._watcher = threading.Thread(target=self._watch, daemon=True)
        self._watcher.start()
        with suppress(OSError):
            self.connection.send(sys.path)

    @property
    def alive(self) -> bool:
        return self._excess == 0 and self._popen.poll() is None

    def rss(self) -> int:
        return resident(self._popen.pid) if self._popen.returncode is None else 0

    def interrupt(self) -> None:
        self._popen.send_signal(signal.SIGINT)

    def end(self, patience: float) -> int:
        """Return the exit code; what has not ended by itself is ended, with all it has started."""
        with suppress(subprocess.TimeoutExpired):
            self._popen.wait(patience)
        self._kill()
        code = self._popen.wait()
        self._ended.set()
        self._watcher.join()
        self.connection.close()
        assert self._popen.stdin is not None
        self._popen.stdin.close()
        return code

    def died(self) -> Died:
        """Say what the process, which has closed its connection, died of."""
        code = self.end(_GRACE)
        printed = self._tail.decode(errors="replace").strip()
        if self._excess:
            held, most = in_words(self._excess), in_words(self.memory or 0)
            return Died(code, f"it held {held}, and the limit is {most}", True, printed)
        if code == EXHAUSTED:
            return Died(code, "the system had no more memory for it", True, printed)
        return Died(code, _death(code), False, printed)

    def leave(self) -> None:
        """Close the connection, and see to it that the process ends."""
        self.connection.close()
        self.end(_GRACE)

    def _kill(self) -> None:
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self._popen.pid, signal.SIGKILL)

    def _watch(self) -> None:
        """Keep the end of what is printed, and end the process when it holds too much."""
        source = self._popen.stdout
        assert source is not None
        with source:
            listening = [source.fileno()]
            while not self._ended.is_set():
                if wait(listening, _LOOK):
                    printed = os.read(source.fileno(), 65536)
                    self._tail = (self._tail + printed)[-_TAIL:]
                    listening = listening if printed else []
                if not listening:  # it will print no more, but it may still grow
                    self._ended.wait(_LOOK)
                self._weigh()

    def _weigh(self) -> None:
        """End the process where it holds more than it may."""
        if self.memory is not None and not self._excess and (held := self.rss()) > self.memory:
            self._excess = held
            self._kill()


def _environment() -> dict[str, str]:
    """Return the environment of a worker: this package is found, and there is one thread."""
    home = str(Path(__file__).resolve().parents[2])
    paths = [home, *filter(None, [os.environ.get("PYTHONPATH")])]
    return {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(paths),
        **dict.fromkeys(_THREADS, "1"),
    }


def _death(code: int) -> str:
    """Return a sentence on how the process ended."""
    if code >= 0:
        return f"its process ended with code {code}"
    with suppress(ValueError):
        return f"its process ended by {signal.Signals(-code).name}"
    return f"its process ended by signal {-code}"
