"""The inside of a worker: jobs come through a connection, one after another, and answers go back.

A job is a module-level function, sent by reference, and its arguments. While it runs, SIGINT is a
request to stop that the solves in it listen to. Standard input is the worker's lifeline: nothing is
ever written to it, and when it closes, the parent is gone, and the worker ends with all that it has
started. Nothing here is run by hand: `quito_cli.batch.workers.worker` starts it.
"""

from __future__ import annotations

import gc
import os
import pickle
import signal
import sys
import threading
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from quito_cli.errors import QuitoError, UsageError

EXHAUSTED = 112
"""Exit code of a worker that got no more memory."""
_FIRST_TO_GO = "500"
"""Where memory is short the system is to end a worker, not who has the results."""


@dataclass(frozen=True)
class Told:
    """What a job says on its way."""

    message: Any


@dataclass(frozen=True)
class Returned:
    """What a job came to."""

    value: Any


@dataclass(frozen=True)
class Raised:
    """A job ended by an exception."""

    error: QuitoError | str
    """A refusal, or in a line what nobody expected."""


def serve(handle: int) -> None:
    """Do jobs until the parent closes the connection."""
    from quito_cli.solvers.child import TOGETHER

    os.environ[TOGETHER] = "1"
    signal.signal(signal.SIGINT, lambda number, frame: None)  # between jobs there is none to stop
    threading.Thread(target=_follow_the_parent, daemon=True).start()
    with suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text(_FIRST_TO_GO, encoding="ascii")
    gc.disable()  # a job makes no garbage worth the search before its end
    with Connection(handle) as connection:
        sys.path[:] = connection.recv()
        first = True
        with suppress(EOFError, OSError):
            while True:
                _do(connection.recv_bytes(), connection)
                gc.collect()
                if first:
                    gc.freeze()  # modules that are there to stay need not be searched again
                first = False
    os._exit(0)  # some solvers fall over when they are taken down


def _follow_the_parent() -> None:
    """End this process and its children when the parent ends."""
    with suppress(OSError):
        while os.read(0, 1):
            pass
    os.killpg(os.getpid(), signal.SIGKILL)


def _do(job: bytes, connection: Connection) -> None:
    """Do one job and send what it came to."""
    from quito_cli.solvers.interruption import interruptible

    def tell(message: Any) -> None:
        connection.send(Told(message))

    answer: Returned | Raised
    try:
        with interruptible():
            function, arguments = pickle.loads(job)
            answer = Returned(function(*arguments, tell))
        connection.send(answer)
    except QuitoError as error:
        connection.send(Raised(_sendable(error)))
    except KeyboardInterrupt:
        connection.send(Raised("interrupted"))
    except Exception as error:
        if isinstance(error, MemoryError) or "bad_alloc" in str(error):
            os._exit(EXHAUSTED)
        connection.send(Raised(_in_a_line(error)))


def _sendable(error: QuitoError) -> QuitoError:
    """Return an error that survives the way, whatever it was made of."""
    with suppress(Exception):
        if str(pickle.loads(pickle.dumps(error))) == str(error):
            return error
    kind = UsageError if error.exit_code == UsageError.exit_code else QuitoError
    return kind(str(error))


def _in_a_line(error: Exception) -> str:
    """Return what an unexpected error says, and where it was raised."""
    place, trace = "", error.__traceback__
    while trace is not None:
        place = f" ({Path(trace.tb_frame.f_code.co_filename).name}:{trace.tb_lineno})"
        trace = trace.tb_next
    said = (str(error).splitlines() or [""])[0]
    return f"{type(error).__name__}: {said}{place}"
