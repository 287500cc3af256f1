"""Cases -> Finished cases on a Dask cluster: what `run` does, on other machines.

    quito sweep van_der_pol --over mu=0.1:2:20 --cluster tcp://head-node:8786

Scheduler and workers need quito in the same version and no file of ours: a case goes out with the
text of its problem, and its result file comes back and is written here. What is under way is
bounded, so that neither the scheduler nor the workers fill up with results. When a worker dies,
Dask gives its cases to others; each case is taken once, whatever comes of it twice. A case that
follows another is sent when that one's answer is here: so what comes of it does not depend on
where, and with how many others, it is solved.
"""

from __future__ import annotations

import threading
import time
import uuid
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any, Final

from quito_cli import __version__
from quito_cli.batch.suite.case import Case, Ending, Finished
from quito_cli.batch.workers import remote
from quito_cli.batch.workers.connection import connected, refuse_versions
from quito_cli.batch.workers.run import NO_LIMITS, Setting, answer_before, clean, refuse_tangles
from quito_cli.batch.workers.solving import result_path
from quito_cli.errors import UnavailableError, UsageError
from quito_cli.problem.load import find, text_of
from quito_cli.solution.store import write_content

if TYPE_CHECKING:
    from distributed import Client, Future

_GONE: Final = 20.0
"""Seconds without the scheduler after which it is given up."""
_LOOK: Final = 0.1
"""Seconds between two looks at whether to stop."""
_FETCHED: Final = 4
"""Results fetched at once."""
_HEARD: Final = 5.0
"""Seconds that workers have to hear that they are to stop."""
_COUNT: Final = 2.0
"""Seconds between two looks at how many workers there are."""
_AT_ONCE: Final = 4
"""Cases under way for each thread of the workers."""
_LEAST: Final = 32
"""Cases under way at least: a cluster that grows with its work must see some."""


def run_on(
    address: str,
    cases: Sequence[Case],
    setting: Setting,
    done: Mapping[str, Finished] | None = None,
) -> Iterator[Finished]:
    """Solve cases on a cluster.

    Args:
        address: of the scheduler, such as `tcp://head-node:8786`, or the path of the file that it
            wrote with `--scheduler-file`.
        cases: with names of their own.
        setting: how; the number of jobs is the cluster's, and progress within a case is not told.
        done: what is finished already, by name: it is not solved again, nor yielded.

    Yields:
        What became of each, as it comes. When stopped, cases under way are ended, and none of them
        is yielded.

    Raises:
        UsageError: the address is none, or the names of cases make no sense.
        UnavailableError: `distributed` is not installed here or quito not there, the scheduler does
            not answer, is lost, or has another version of quito.
        ResultFileError: a result cannot be written.
    """
    refuse_tangles(cases)
    setting.folder.mkdir(parents=True, exist_ok=True)
    clean(setting.folder, cases)
    with connected(address) as client:
        refuse_versions(client, address)
        yield from _Flight(client, address, cases, setting, dict(done or {})).finish()


@dataclass
class _Flight:
    """A run that is under way."""

    client: Client
    address: str
    cases: Sequence[Case]
    setting: Setting
    finished: dict[str, Finished]
    name: str = field(default_factory=lambda: uuid.uuid4().hex)
    flying: dict[str, Future] = field(default_factory=dict)
    """By name of the case."""
    pool: ThreadPoolExecutor = field(default_factory=lambda: ThreadPoolExecutor(_FETCHED))
    """Fetches results."""
    landed: SimpleQueue[tuple[str, Any]] = field(default_factory=SimpleQueue)
    """Deliveries by name of the case, or what was raised in their place."""
    refused: list[Finished] = field(default_factory=list)
    """Cases whose files cannot be read here."""
    threads: int = 0
    counted: float = -_COUNT
    """When the threads were."""
    seen: float = field(default_factory=time.monotonic)
    """When the scheduler was there."""

    @cached_property
    def followed(self) -> frozenset[str | None]:
        """Names of cases that others start from: their results are kept."""
        return frozenset(case.follows for case in self.cases)

    def finish(self) -> Iterator[Finished]:
        """Send cases and yield what becomes of them, until there are none."""
        pending = {case.name: case for case in self.cases if case.name not in self.finished}
        everything = {case.name: case for case in self.cases}
        try:
            while pending or self.flying or self.refused:
                if self.setting.stop():
                    return
                self._send(pending, everything)
                if (ended := self._next(everything)) is not None:
                    self.finished[ended.case.name] = ended
                    yield ended
        finally:
            self.pool.shutdown(wait=False, cancel_futures=True)
            if self.flying:
                self._stop()

    def _send(self, pending: dict[str, Case], everything: Mapping[str, Case]) -> None:
        """Send cases that need not wait, as many as may be under way."""
        if self.client.status != "running":
            return
        room = max(_LEAST, _AT_ONCE * self._threads()) - len(self.flying)
        ready = (c for c in pending.values() if c.follows is None or c.follows in self.finished)
        for case in [case for case, _ in zip(ready, range(room), strict=False)]:
            del pending[case.name]
            try:
                contents = _packed(case, answer_before(case, self.finished, everything))
            except UsageError as error:
                said = Finished(case, Ending.REFUSED, str(error), {}, (), 0.0, None)
                self.refused.append(said)
                continue
            parcel = remote.Parcel(
                self.name,
                __version__,
                *contents,
                self.setting.limits.get(case.name, NO_LIMITS),
                "all" if case.name in self.followed else self.setting.keep,
                tuple(self.setting.record),
                self.setting.job,
            )
            key = f"quito-{self.name}-{case.name}"
            future = self.client.submit(remote.solve, parcel, key=key, pure=False)
            self.flying[case.name] = future
            future.add_done_callback(partial(self._land, case.name))

    def _threads(self) -> int:
        """Return those of the workers, as far as is known here."""
        now = time.monotonic()
        if now - self.counted > _COUNT and self.client.status == "running":
            with suppress(Exception):  # of a scheduler that is lost `_next` tells
                self.threads, self.counted = sum(self.client.nthreads().values()), now
        return self.threads

    def _next(self, everything: Mapping[str, Case]) -> Finished | None:
        """Wait for a while; return what has ended."""
        if self.refused:
            return self.refused.pop()
        try:
            name, fetched = self.landed.get(timeout=_LOOK)
        except Empty:
            self._refuse_lost()
            return None
        future = self.flying.pop(name, None)
        if future is None:  # it has been taken
            return None
        if isinstance(fetched, remote.Delivery):
            return _unpacked(everything[name], fetched, self.setting.folder)
        if future.cancelled() or self.client.status != "running":
            self.flying.clear()
            raise self._lost()
        if _killed(fetched):
            said = "every worker that took it died"
            return Finished(everything[name], Ending.CRASHED, said, {}, (), 0.0, None)
        raise UnavailableError(
            f"a worker of the cluster cannot do cases: {_line(fetched)}; what had finished is "
            "kept, and --resume goes on from there"
        )

    def _land(self, name: str, future: Future) -> None:
        """Have the result of a case fetched."""
        with suppress(RuntimeError):  # the run is over
            self.pool.submit(self._fetch, name, future)

    def _fetch(self, name: str, future: Future) -> None:
        """Get a result from where it is; if that is gone meanwhile, from where it is done again."""
        try:
            self.landed.put((name, future.result()))
        except BaseException as error:
            self.landed.put((name, error))

    def _refuse_lost(self) -> None:
        """Give up when the scheduler has been away for long.

        Raises:
            UnavailableError: it has.
        """
        if self.client.status == "running":
            self.seen = time.monotonic()
        elif time.monotonic() - self.seen > _GONE:
            self.flying.clear()
            raise self._lost()

    def _lost(self) -> UnavailableError:
        return UnavailableError(
            f"the scheduler at {self.address} is gone: what had finished is kept, and --resume "
            "goes on from there"
        )

    def _stop(self) -> None:
        """End what is under way."""

        def tell() -> None:
            with suppress(Exception):  # of a cluster that is gone there is nothing left to end
                self.client.cancel(list(self.flying.values()), force=True)
                self.client.run(remote.stop, self.name, on_error="ignore")

        telling = threading.Thread(target=tell, daemon=True)
        telling.start()
        telling.join(_HEARD)  # a worker that hears nothing is not waited for


def _packed(case: Case, start: Path | None) -> tuple[Case, tuple[str, bytes] | None]:
    """Return a case that needs no file of ours, and name and bytes of the result it starts from.

    Raises:
        UsageError: a file that it needs cannot be read.
    """
    options = dict(case.options)
    if start is None and (given := options.pop("guess", None)) is not None:
        start = Path(given)
    options.pop("guess", None)
    text = case.text if case.text is not None else text_of(find(case.problem))
    try:
        guess = None if start is None else (start.name, start.read_bytes())
    except OSError as error:
        raise UsageError(f"{start} cannot be read: {error.strerror}") from None
    return replace(case, options=options, text=text), guess


def _unpacked(case: Case, delivery: remote.Delivery, folder: Path) -> Finished:
    """Return what became of a case, its result written here."""
    path, content = result_path(folder, case.name), delivery.result
    if content is None:
        path.unlink(missing_ok=True)  # of an earlier run
        return replace(delivery.finished, case=case)
    write_content(path, content)
    return replace(delivery.finished, case=case, result=path)


def _killed(error: BaseException) -> bool:
    from distributed import KilledWorker

    return isinstance(error, KilledWorker)


def _line(error: BaseException) -> str:
    """Return the first line of what an error says."""
    return (str(error).splitlines() or [type(error).__name__])[0]
