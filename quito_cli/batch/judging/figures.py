"""Figures of an answer, by name: what a suite may expect, and what a baseline holds.

A figure is a row of `FIGURES`. Most are read off the Solution. Those of `COSTLY` hold the answer
against the reference of its file, as `quito compare` does, which takes as long as a small solve:
they are found only where somebody asks for them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Final, Literal

from quito_cli.batch.suite.case import Figure

if TYPE_CHECKING:
    from quito_cli.comparison.comparison import Row
    from quito_cli.problem.schema import Problem
    from quito_cli.solution.solution import Solution

Kind = Literal["number", "count", "word", "flag", "times"]
PASSED: Final = "passed"
"""What is said of a certificate of which no condition fails."""


class Answer:
    """A Solution with the problem it is one of, measured when a figure needs it."""

    def __init__(self, solution: Solution, problem: Problem, processor_seconds: float) -> None:
        self.solution, self.problem = solution, problem
        self.processor_seconds = processor_seconds

    @cached_property
    def row(self) -> Row | None:
        """The answer held against the file's reference; None where that knows no control."""
        from quito_cli.comparison.measure import SAMPLES, ZONE, Setting, measured
        from quito_cli.comparison.methods import control_points
        from quito_cli.comparison.truth import from_reference
        from quito_cli.problem.build import build

        truth = from_reference(build(self.problem))
        if truth is None:
            return None
        samples = SAMPLES * control_points(self.solution.options)
        answers = [(self.problem.name, self.solution)]
        return measured(answers, truth, Setting(samples, ZONE), (), ()).rows[0]

    @property
    def known_cost(self) -> float | None:
        """The optimal cost, as the file's reference has it."""
        reference = self.solution.reference
        return None if reference is None else reference.cost


@dataclass(frozen=True)
class Known:
    """A row of the table of figures."""

    name: str
    kind: Kind
    """What it is: a number with a tolerance, or something that is so or not."""
    of: Callable[[Answer], Figure]
    costly: bool = False
    """Whether it is found on request only."""


def _size_of_cost_error(answer: Answer) -> Figure:
    known = answer.known_cost
    return None if known is None else abs(answer.solution.cost - known)


def _resimulated(answer: Answer) -> Figure:
    known = answer.known_cost
    return None if known is None else abs(answer.solution.evidence.resimulated_cost - known)


def _relative(answer: Answer) -> Figure:
    known = answer.known_cost
    return None if known is None else abs(answer.solution.cost - known) / (abs(known) or 1.0)


def _certificate(answer: Answer) -> Figure:
    """Return `passed`, or the condition furthest from holding; None where none was judged."""
    from quito_cli.solution.tally import applying, blind, failing, told

    rows = answer.solution.certificate
    if failed := failing(rows):
        return told(failed[0])
    return PASSED if applying(rows) and not blind(rows) else None


def _estimate(answer: Answer) -> Figure:
    refinement = answer.solution.refinement
    account = refinement.account if refinement else None
    return account.control if account else None


def _compared(key: str) -> Callable[[Answer], Figure]:
    """Return what reads a column of the tables of `quito compare`."""

    def value(answer: Answer) -> Figure:
        from quito_cli.comparison.table import COLUMNS

        (column,) = (one for given in COLUMNS.values() for one in given if one.key == key)
        return None if answer.row is None else column.value(answer.row)

    return value


def _held(key: str) -> Known:
    return Known(key, "number", _compared(key), costly=True)


_ROWS: Final = (
    Known("cost", "number", lambda a: a.solution.cost),
    Known("cost_error", "number", _size_of_cost_error),
    Known("relative_cost_error", "number", _relative),
    Known("resimulated_cost_error", "number", _resimulated),
    _held("error_l2"),
    _held("error_l1"),
    _held("error_sup"),
    _held("error_sup_outside"),
    _held("error_norm"),
    _held("dft_norm"),
    _held("state_error"),
    _held("switching_error"),
    Known("switching_times", "times", lambda a: a.solution.switching_times),
    Known("initial_time", "number", lambda a: float(a.solution.times[0])),
    Known("final_time", "number", lambda a: float(a.solution.times[-1])),
    Known("status", "word", lambda a: a.solution.status.name.lower()),
    Known("success", "flag", lambda a: a.solution.success),
    Known("certificate", "word", _certificate),
    Known("polished", "flag", lambda a: a.solution.polished),
    Known("iterations", "count", lambda a: a.solution.statistics.iterations),
    Known("cells", "count", lambda a: len(a.solution.times) - 1),
    Known("warnings", "count", lambda a: len(a.solution.warnings)),
    Known("violation", "number", lambda a: a.solution.evidence.maximum_violation),
    Known("resimulation_gap", "number", lambda a: a.solution.evidence.resimulation_gap),
    Known("total_variation", "number", lambda a: sum(a.solution.evidence.total_variation)),
    Known("ringing", "number", lambda a: max(a.solution.evidence.ringing, default=0.0)),
    Known("estimated_error", "number", _estimate),
    Known("build_seconds", "number", lambda a: a.solution.statistics.build_seconds),
    Known("solve_seconds", "number", lambda a: a.solution.statistics.solve_seconds),
    Known("processor_seconds", "number", lambda a: a.processor_seconds),
)
FIGURES: Final[Mapping[str, Known]] = {row.name: row for row in _ROWS}
COSTLY: Final = frozenset(row.name for row in _ROWS if row.costly)
"""Those that are found on request only."""
TIMES: Final = frozenset(("build_seconds", "solve_seconds", "processor_seconds"))
"""Those that are of the machine, and of what else it does."""


def figures(
    solution: Solution, problem: Problem, processor_seconds: float, wanted: Collection[str]
) -> dict[str, Figure]:
    """Return the figures of an answer by name; None where one is not known.

    Args:
        solution: the answer.
        problem: what it is an answer to.
        processor_seconds: what it took of a processor.
        wanted: names of those to be found though it takes time.
    """
    answer = Answer(solution, problem, processor_seconds)
    chosen = (row for row in _ROWS if not row.costly or row.name in wanted)
    return {row.name: _finite(row.of(answer)) for row in chosen}


def _finite(value: Figure) -> Figure:
    """Return a figure, None for one that is not a number."""
    return None if isinstance(value, float) and math.isnan(value) else value
