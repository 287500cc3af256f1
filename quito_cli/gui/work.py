"""What a worker does for the page: solve or compare, and leave the answer in the job's folder."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from quito_cli.solvers.interruption import Interruption
    from quito_cli.solvers.outcome import Progress

Tell = Callable[[Any], None]
_EVERY = 0.05
"""Seconds between two messages about iterations."""


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

    iteration: int
    cost: float
    violation: float
    stage: str
    """`mesh 3, 143 cells`; of a comparison the method before it; often empty."""


@dataclass(frozen=True)
class Stopped:
    """The solver has been asked to stop and does: what follows is the judgement."""


def warm_up(tell: Tell) -> None:
    """Load what every solve needs."""
    import quito_cli.gui.answering
    import quito_cli.optimality.certificate
    import quito_cli.problem.build  # noqa: F401 - it is loaded, and that is all


def carry_out(work: Work, tell: Tell) -> None:
    """Solve or compare; tell of iterations on the way, and leave the answer in the folder.

    Raises:
        QuitoError: the problem or an option is refused.
    """
    from quito_cli.gui.answer import RESULT
    from quito_cli.gui.answering import of_comparison, of_solution
    from quito_cli.problem.load import load_text
    from quito_cli.solvers.interruption import interruptible

    work.folder.mkdir(parents=True, exist_ok=True)
    problem = load_text(work.text, f"{work.name}.yaml")
    with interruptible() as interruption:
        told = _Telling(tell, interruption)
        if work.against is None:
            from quito_cli.solve import solve

            solution = solve(problem, listener=told.of_solve, **work.options)
            answer = of_solution(solution, work.options)
        else:
            from quito_cli.comparison.compare import compare

            found = compare(
                problem,
                work.against,
                result=work.result,
                listener=told.of_method,
                **work.options,
            )
            solution = found.rows[0].solution
            answer = of_comparison(found, work.options)
    told.send()
    solution.save(work.folder / RESULT)
    answer.save(work.folder)


class _Telling:
    """Gathers iterations, so that a quick solver does not drown the page in messages."""

    def __init__(self, tell: Tell, interruption: Interruption) -> None:
        self._tell, self._interruption = tell, interruption
        self._points: list[Iterated] = []
        self._sent = 0.0
        self._stopped = False

    def of_solve(self, reached: Progress) -> None:
        """Hear of an iteration."""
        self._hear(reached, reached.stage)

    def of_method(self, method: str, reached: Progress) -> None:
        """Hear of an iteration of one of several methods."""
        self._hear(reached, f"{method}  {reached.stage}".strip())

    def _hear(self, reached: Progress, stage: str) -> None:
        point = Iterated(reached.iteration, reached.cost, reached.violation, stage)
        self._points.append(point)
        if self._interruption.requested and not self._stopped:
            self._stopped = True
            self.send()
            self._tell(Stopped())
        elif time.monotonic() - self._sent > _EVERY:
            self.send()

    def send(self) -> None:
        """Send what has been gathered."""
        if self._points:
            self._tell(tuple(self._points))
        self._points, self._sent = [], time.monotonic()
