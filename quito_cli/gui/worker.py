"""A process that takes one job after another, is told to stop, or is ended."""

from __future__ import annotations

import multiprocessing
import os
import resource
import signal
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

from quito_cli.errors import QuitoError


@dataclass(frozen=True)
class Told:
    """Something that a job says on its way."""

    what: Any


@dataclass(frozen=True)
class Done:
    """What a job returned."""

    value: Any


@dataclass(frozen=True)
class Broken:
    """A job that ended without an answer."""

    message: str
    reason: str
    """refused, memory, cancelled, crashed."""


class Worker:
    """One process."""

    def __init__(self, memory: int) -> None:
        context = multiprocessing.get_context("spawn")
        self.connection, there = context.Pipe()
        self._process = context.Process(target=_serve, args=(there, memory), daemon=True)
        self._process.start()
        there.close()

    def start(self, function: Callable[..., Any], *arguments: Any) -> None:
        """Begin `function(tell, *arguments)`; `tell` sends what `receive` hands out."""
        self.connection.send((function, arguments))

    def receive(self) -> Told | Done | Broken:
        """Return the next message; Broken where the process has ended."""
        try:
            message: Told | Done | Broken = self.connection.recv()
        except (EOFError, OSError):
            self._process.join(1.0)
            return Broken(f"the process of the solver ended ({self._process.exitcode})", "crashed")
        return message

    def interrupt(self) -> None:
        """Tell the job to stop, as Ctrl-C does."""
        if self._process.pid is not None and self._process.is_alive():
            os.kill(self._process.pid, signal.SIGINT)

    def kill(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.join(5.0)
        self.connection.close()


def _serve(connection: Connection, memory: int) -> None:
    """Take jobs until nobody is there to give one."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # between jobs there is nothing to stop
    resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))
    with suppress(EOFError, OSError):
        while True:
            function, arguments = connection.recv()
            signal.signal(signal.SIGINT, signal.default_int_handler)
            said = _carried_out(function, arguments, connection)
            signal.signal(signal.SIGINT, signal.SIG_IGN)
            connection.send(said)


def _carried_out(
    function: Callable[..., Any], arguments: tuple[Any, ...], connection: Connection
) -> Done | Broken:
    try:
        return Done(function(lambda what: connection.send(Told(what)), *arguments))
    except QuitoError as error:
        return Broken(str(error), "refused")
    except KeyboardInterrupt:
        return Broken("stopped before there was an answer", "cancelled")
    except MemoryError:
        return Broken("the memory limit was reached", "memory")
    except Exception as error:
        return Broken(f"a bug in quito: {type(error).__name__}: {error}".splitlines()[0], "crashed")
