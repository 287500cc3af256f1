"""Ctrl-C during a solve: a flag that the iteration callback reads, not an exception in C++."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from types import FrameType


class Interruption:
    """Whether the user has asked to stop."""

    requested: bool = False


_OUTER: ContextVar[Interruption | None] = ContextVar("outer", default=None)
"""Of the block that this one is in."""


@contextmanager
def interruptible() -> Iterator[Interruption]:
    """Turn SIGINT into a request to stop for the time of the block; a second one stops at once.

    A block within another one shares its request: what comes between two solves of a series stops
    the next. Signals reach the main thread only: elsewhere nothing is ever requested.
    """
    outer = _OUTER.get()
    if outer is not None:
        yield outer
        return
    interruption = Interruption()
    if threading.current_thread() is not threading.main_thread():
        yield interruption
        return
    before = signal.getsignal(signal.SIGINT)

    def request(number: int, frame: FrameType | None) -> None:
        if interruption.requested:
            raise KeyboardInterrupt
        interruption.requested = True

    signal.signal(signal.SIGINT, request)
    mark = _OUTER.set(interruption)
    try:
        yield interruption
    finally:
        _OUTER.reset(mark)
        signal.signal(signal.SIGINT, before)
