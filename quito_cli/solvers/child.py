"""A solver in a process of its own: one that can take its process down takes only that.

The program goes to the child's standard input, pickled; progress and the outcome come back on its
standard output, each one pickle. What the solver itself prints, past Python, goes nowhere. Ctrl-C
is passed on once, so that a solver that listens may hand back its best iterate; after that, or
when it does not answer, the child is ended.
"""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import IO, Any

import numpy as np

from quito_cli.errors import QuitoError
from quito_cli.solvers.asking import Request
from quito_cli.solvers.interruption import Interruption, interruptible
from quito_cli.solvers.outcome import Outcome, Progress, Status
from quito_cli.solvers.program import Program

GRACE = 2.0
"""Seconds that a child has to answer a request to stop."""
LOOK = 0.05
"""Seconds between two looks at whether the user wants to stop."""
TOGETHER = "QUITO_TOGETHER"
"""In the environment of a process that no terminal reaches: its children stay in its group, so
that they can be ended as one."""


def solve(program: Program, request: Request) -> Outcome:
    """Minimise in another process.

    Raises:
        QuitoError: what the engine raised there, such as an unknown option.
    """
    started = time.perf_counter()
    with interruptible() as interruption, _started() as child:
        try:
            message, asked = _awaited(child, program, request, interruption)
        finally:
            child.kill()  # when it has answered, there is nothing more to come
        code = child.wait()
    if isinstance(message, QuitoError):
        raise message
    if isinstance(message, Outcome):
        return message
    said = "interrupted" if asked else _death(request.backend.name, code)
    status = Status.INTERRUPTED if asked else Status.FAILED
    zeros = np.zeros(len(program.row_lower)), np.zeros(len(program.guess))
    seconds = time.perf_counter() - started
    return Outcome(
        status, program.guess, *zeros, None, {}, 0.0, seconds, said, request.backend.name
    )


def _awaited(
    child: subprocess.Popen[bytes], program: Program, request: Request, interruption: Interruption
) -> tuple[Any, bool]:
    """Return the child's last message, None where it died, and whether it was asked to stop."""
    received: SimpleQueue[Any] = SimpleQueue()
    threading.Thread(target=_converse, args=(child, program, request, received)).start()
    asked: float | None = None
    while True:
        try:
            message = received.get(timeout=LOOK)
        except Empty:
            if interruption.requested and asked is None:
                child.send_signal(signal.SIGINT)
                asked = time.perf_counter()
            elif asked is not None and time.perf_counter() - asked > GRACE:
                child.kill()
            continue
        if not isinstance(message, Progress):
            if message is None:
                child.wait()  # its own end, before ours for it
            return message, asked is not None
        if request.listener is not None:
            request.listener(message)


def _started() -> subprocess.Popen[bytes]:
    """Return the child; it finds this package where this process did; no terminal reaches it."""
    home = str(Path(__file__).resolve().parents[2])
    paths = [home, *filter(None, [os.environ.get("PYTHONPATH")])]
    return subprocess.Popen(
        [sys.executable, "-P", "-m", "quito_cli.solvers.child"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
        start_new_session=TOGETHER not in os.environ,
    )


def _converse(
    child: subprocess.Popen[bytes], program: Program, request: Request, into: SimpleQueue[Any]
) -> None:
    """Send the task; put what comes back `into` the queue, None where the child dies."""
    assert child.stdin is not None
    assert child.stdout is not None
    try:
        pickle.dump((program, replace(request, listener=None)), child.stdin)
        child.stdin.close()
        while True:
            message = pickle.load(child.stdout)
            into.put(message)
            if not isinstance(message, Progress):
                return
    except (EOFError, OSError, pickle.UnpicklingError):
        into.put(None)


def _death(name: str, code: int) -> str:
    """Return a sentence on how the child ended."""
    if code < 0:
        return f"{name} ended its process by {signal.Signals(-code).name}"
    return f"{name} ended its process with code {code}"


def _serve(source: IO[bytes], sink: IO[bytes]) -> None:
    """Solve what comes, and say what became of it."""
    from quito_cli.solvers.engines import ENGINES

    program, request = pickle.load(source)

    def tell(message: Any) -> None:
        pickle.dump(message, sink)
        sink.flush()

    try:
        tell(ENGINES[request.backend.engine]()(program, replace(request, listener=tell)))
    except QuitoError as error:
        tell(error)


def _main() -> None:
    """Keep the pipe to the parent, and give the solver nowhere to print."""
    answers = os.fdopen(os.dup(1), "wb")
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(nowhere, stream)
    _serve(sys.stdin.buffer, answers)
    answers.flush()
    os._exit(0)  # some solvers fall over when they are taken down


if __name__ == "__main__":
    _main()
