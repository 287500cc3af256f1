"""A Case to be solved, and the Finished case: what became of it; frozen.

Both are plain data that goes between processes and machines, and into a line of JSON; a Solution
stays where it was found, in a result file.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Any

Scalar = float | int | str | bool
Figure = float | int | bool | str | tuple[float, ...] | None
"""One figure of an answer; None where it is not known."""


@dataclass(frozen=True)
class Expectation:
    """What a figure of an answer is to be."""

    figure: str
    """A name of `judging.figures`: cost, error_l2, switching_times, iterations, …"""
    target: Figure = None
    """What it is to be near to; None where it has a limit alone."""
    absolute: float | None = None
    """Tolerance."""
    relative: float | None = None
    """Tolerance, over the size of the target; the larger of the two holds."""
    most: float | None = None
    """Upper limit."""
    least: float | None = None
    """Lower limit."""


@dataclass(frozen=True)
class Check:
    """An expectation held against what was found."""

    expectation: Expectation
    found: Figure
    passed: bool
    sentence: str
    """`cost is 0.7577, expected 0.7576 ± 1e-06`."""


@dataclass(frozen=True)
class Case:
    """One solve of a suite or a sweep."""

    name: str
    """Unique in its suite, and stable from run to run: `van_der_pol[steps=100]`."""
    problem: str
    """The name of a bundled problem, or an absolute path."""
    options: Mapping[str, Any] = field(default_factory=dict)
    """As given: fields of Options."""
    constants: Mapping[str, Scalar] = field(default_factory=dict)
    """To set, by name, or other values by dotted path."""
    expectations: tuple[Expectation, ...] = ()
    axes: Mapping[str, Scalar] = field(default_factory=dict)
    """Place in a matrix or a sweep: `mu` → 0.1, `steps` → 50."""
    follows: str | None = None
    """Case whose answer this one starts from, of a sweep by continuation."""
    text: str | None = None
    """The problem's text, where it is to be solved without its file: on another machine."""


class Ending(Enum):
    """How a case ended; the values are sentences."""

    PASSED = "Solved, and all that was expected holds."
    OUTSIDE = "Solved, and something is outside its tolerance."
    UNSOLVED = "The solver did not converge."
    REFUSED = "The problem or its options are wrong."
    CRASHED = "The process of the solver ended."
    TIMED_OUT = "The time limit was reached."
    OUT_OF_MEMORY = "The memory limit was reached."
    INTERRUPTED = "Stopped before its end."

    @property
    def exit_code(self) -> int:
        """What a run with such a case among its own ends with, at least."""
        return _EXIT_CODES[self]


_EXIT_CODES = {
    Ending.PASSED: 0,
    Ending.OUTSIDE: 3,
    Ending.UNSOLVED: 1,
    Ending.REFUSED: 2,
    Ending.CRASHED: 1,
    Ending.TIMED_OUT: 1,
    Ending.OUT_OF_MEMORY: 1,
    Ending.INTERRUPTED: 130,
}


@dataclass(frozen=True)
class Finished:
    """What became of a case."""

    case: Case
    ending: Ending
    message: str
    """What the solver or the refusal said; of a crash, the signal."""
    figures: Mapping[str, Figure]
    """By name; empty where there is no answer. They are the same in every run on every machine but
    those of `quito_cli.batch.judging.figures.TIMES`."""
    checks: tuple[Check, ...]
    seconds: float
    """Of the whole case, as the worker took it."""
    result: Path | None
    """Result file; None where there is none."""
