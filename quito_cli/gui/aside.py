"""Something done in a process of its own, within limits: quick work with untrusted matter.

Unlike a job at the desk it is waited for, and leaves nothing when it is ended. A process that has
just been started loads what it needs before the clock runs: that takes longer than the work, and
many times longer where the machine has much else to do.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

from quito_cli.batch.worker import Died, Raised, Returned, Told, Worker

Ended = Returned | Raised | Died | None
_LOADING = 120.0
"""Seconds that a new process may take to load what it needs."""
_LOOK = 0.1
"""Seconds between two looks at whether this is closed."""


class Aside:
    """A process that does one thing at a time; callers take their turns."""

    def __init__(self, seconds: float, memory: int, load: Callable[..., Any]) -> None:
        """Prepare; the process is started when there is something to do.

        Args:
            seconds: that one thing may take.
            memory: bytes that the process may hold.
            load: `load(tell)` is what every new process does first; of a module's top level.
        """
        self.seconds = seconds
        self._worker = Worker(memory)
        self._load = load
        self._loaded = False
        self._turn = threading.Lock()
        self._closed = False

    def do(
        self,
        function: Callable[..., Any],
        *arguments: Any,
        told: Callable[[Any], None] | None = None,
    ) -> Ended:
        """Let the process do `function(*arguments, tell)`, and wait for the end of it.

        Args:
            function: of a module's top level.
            *arguments: to be pickled, as is what it returns.
            told: called with what it tells on the way.

        Returns:
            How it ended; None where it did not end in time, or this is closed.
        """
        with self._turn:
            if not self._loaded:
                loaded = self._within(_LOADING, _unheard, self._load)
                if not isinstance(loaded, Returned):
                    return loaded
                self._loaded = True
            return self._within(self.seconds, told or _unheard, function, *arguments)

    def _within(
        self,
        seconds: float,
        told: Callable[[Any], None],
        function: Callable[..., Any],
        *arguments: Any,
    ) -> Ended:
        if self._closed:
            return None
        self._worker.start(function, *arguments)
        until = time.monotonic() + seconds
        while not self._closed and (left := until - time.monotonic()) > 0:
            if not self._worker.connection.poll(min(left, _LOOK)):
                continue
            message = self._worker.receive()
            if not isinstance(message, Told):
                self._loaded = self._loaded and not isinstance(message, Died)
                return message
            told(message.message)
        self._worker.kill()
        self._loaded = False
        return None

    def close(self) -> None:
        """End the process, whatever it is at."""
        self._closed = True
        with self._turn:
            self._worker.kill()


def _unheard(message: Any) -> None:
    """Nobody listens."""
