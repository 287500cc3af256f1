"""Something done in a process of its own, within limits: quick work with untrusted matter.

Unlike a job at the desk it is waited for, and leaves nothing when it is ended.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

from quito_cli.batch.worker import Died, Raised, Returned, Told, Worker


class Aside:
    """A process that does one thing at a time; callers take their turns."""

    def __init__(self, seconds: float, memory: int) -> None:
        """Prepare; the process is started when there is something to do.

        Args:
            seconds: that one thing may take.
            memory: bytes that the process may hold.
        """
        self.seconds = seconds
        self._worker = Worker(memory)
        self._turn = threading.Lock()
        self._closed = False

    def do(
        self,
        function: Callable[..., Any],
        *arguments: Any,
        told: Callable[[Any], None] = lambda message: None,
    ) -> Returned | Raised | Died | None:
        """Let the process do `function(*arguments, tell)`, and wait for the end of it.

        Args:
            function: of a module's top level.
            *arguments: to be pickled, as is what it returns.
            told: called with what it tells on the way.

        Returns:
            How it ended; None where it did not end in time, or this is closed.
        """
        with self._turn:
            if self._closed:
                return None
            self._worker.start(function, *arguments)
            until = time.monotonic() + self.seconds
            while self._worker.connection.poll(max(until - time.monotonic(), 0)):
                message = self._worker.receive()
                if not isinstance(message, Told):
                    return message
                told(message.message)
            self._worker.kill()
            return None

    def close(self) -> None:
        """End the process, when it has done what it is at."""
        self._closed = True
        with self._turn:
            self._worker.kill()
