"""What a worker does for the page: solve or compare, and leave the answer in the job's folder.

It is told to stop by SIGINT, whose handler runs as soon as Python does: at the next iteration of a
solver, or between two steps of what comes before and after. A thread says so, for the main one may
be at anything then.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from quito_cli.gui.answer import Answer
    from quito_cli.problem.schema import Problem
    from quito_cli.solution.solution import Solution
    from quito_cli.solvers.outcome import Progress

Tell = Callable[[Any], None]
_EVERY = 0.05
"""Seconds between two messages about iterations."""
_LOOK = 0.02
"""Seconds between two looks at whether a request to stop has arrived."""


QUICK = """\
time: {initial: 0, final: 1}
states: {x: {initial: 1}}
controls: {u: {}}
dynamics: {x: u}
cost: {lagrange: x^2 + u^2}
"""
"""What a process begins with, so that all it needs has been loaded once."""


@dataclass(frozen=True)
class Work:
    """What is to be done; plain data for another process."""

    text: str
    name: str
    options: Mapping[str, Any]
    against: tuple[str, ...] | None
    result: Path | None
    folder: Path
    """Of the job; it is made."""


@dataclass(frozen=True)
class Iterated:
    """One iteration that was heard of."""

    count: int
    """Of all solves of the job together, from 0."""
    iteration: int
    """Of its solve: it begins anew on every mesh, and where the cost is scaled anew."""
    cost: float
    violation: float
    stage: str
    """`mesh 3, 143 cells`; of a comparison the method before it; often empty."""


@dataclass(frozen=True)
class Noticed:
    """The request to stop has arrived: a solver stops now, and what it has is judged."""


def warm_up(folder: Path, tell: Tell) -> None:
    """Do something quick, so that all that a solve needs has been loaded once."""
    carry_out(Work(QUICK, "warm-up", {"steps": 5}, None, None, folder), tell)


def carry_out(work: Work, tell: Tell) -> bool:
    """Solve or compare; tell of iterations on the way, and leave the answer in the folder.

    What is told are tuples of `Iterated`, an empty one at the start, and `Noticed`.

    Returns:
        Whether it was interrupted: the answer is the best iterate then.

    Raises:
        QuitoError: the problem or an option is refused, or the answer cannot be written.
    """
    tell(())  # from here on a request to stop is heard
    from quito_cli.gui.answer import RESULT
    from quito_cli.problem.load import load_text

    work.folder.mkdir(parents=True, exist_ok=True)
    problem = load_text(work.text, f"{work.name}.yaml")
    with _telling(tell) as told:
        do = _solved if work.against is None else _compared
        solution, answer, interrupted = do(work, problem, told)
    solution.save(work.folder / RESULT)
    answer.save(work.folder)
    return interrupted


def _solved(work: Work, problem: Problem, told: _Telling) -> tuple[Solution, Answer, bool]:
    from quito_cli.gui.answering import of_solution
    from quito_cli.solve import solve
    from quito_cli.solvers.outcome import Status

    solution = solve(problem, listener=told.of_solve, **work.options)
    interrupted = solution.status is Status.INTERRUPTED
    return solution, of_solution(solution, work.options), interrupted


def _compared(work: Work, problem: Problem, told: _Telling) -> tuple[Solution, Answer, bool]:
    from quito_cli.comparison.compare import OF_OUR_ROW, compare
    from quito_cli.gui.answering import of_comparison

    assert work.against is not None
    settled = OF_OUR_ROW if work.result is not None else ()
    options = {name: value for name, value in work.options.items() if name not in settled}
    found = compare(problem, work.against, result=work.result, listener=told.of_method, **options)
    return found.rows[0].solution, of_comparison(found, work.options), found.interrupted


@contextmanager
def _telling(tell: Tell) -> Iterator[_Telling]:
    """Tell of iterations and of a request to stop, for the time of the block."""
    from quito_cli.solvers.interruption import interruptible

    with interruptible() as interruption:
        told, done = _Telling(tell), threading.Event()

        def watch() -> None:
            while not done.wait(_LOOK):
                if interruption.requested:
                    told.notice()
                    return

        watcher = threading.Thread(target=watch, daemon=True)
        watcher.start()
        try:
            yield told
        finally:
            done.set()
            watcher.join()
    told.send()


class _Telling:
    """Gathers iterations, so that a quick solver does not drown the page in messages."""

    def __init__(self, tell: Tell) -> None:
        self._tell = tell
        self._lock = threading.Lock()
        self._points: list[Iterated] = []
        self._sent = 0.0
        self._count = 0

    def of_solve(self, reached: Progress) -> None:
        """Hear of an iteration."""
        self._hear(reached, reached.stage)

    def of_method(self, method: str, reached: Progress) -> None:
        """Hear of an iteration of one of several methods."""
        self._hear(reached, f"{method}  {reached.stage}".strip())

    def _hear(self, reached: Progress, stage: str) -> None:
        told = reached.iteration, reached.cost, reached.violation, stage
        self._points.append(Iterated(self._count, *told))
        self._count += 1
        if time.monotonic() - self._sent > _EVERY:
            self.send()

    def notice(self) -> None:
        """Tell that the request to stop has arrived."""
        with self._lock:
            self._tell(Noticed())

    def send(self) -> None:
        """Send what has been gathered."""
        if self._points:
            with self._lock:
                self._tell(tuple(self._points))
        self._points, self._sent = [], time.monotonic()
