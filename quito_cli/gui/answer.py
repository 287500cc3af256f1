"""What a finished job leaves in its folder, for the page: words, figures and curves, as JSON.

    result.h5       the Solution; of a comparison our row's
    answer.json     the rest

The answer is made in the worker, so that the server reads no HDF5 and knows no CasADi.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from quito_cli.comparison.comparison import Comparison
    from quito_cli.solution.solution import Solution

RESULT, ANSWER = "result.h5", "answer.json"
"""Files in the folder of a job."""

Numbers = tuple[float | None, ...]
"""None where a figure is not known."""


@dataclass(frozen=True)
class Line:
    """A quantity over time; all of a chart's lines are at the chart's times."""

    name: str
    values: Numbers
    known: Numbers | None
    """The reference, where there is one."""
    lower: float | None
    """Bound; None where there is none."""
    upper: float | None


@dataclass(frozen=True)
class Mark:
    """A switching time."""

    time: float
    uncertainty: float
    kind: str
    """jump or bend."""
    said: str
    """`1.36674 ± 1e-05  u jumps -1 → 1`."""


@dataclass(frozen=True)
class Chart:
    """A plot over time."""

    kind: str
    """states, controls, costates, switching, error, spectrum."""
    label: str
    """Of the vertical axis, with the unit."""
    across: str
    """Of the horizontal axis: t, or frequency."""
    times: tuple[float, ...]
    lines: tuple[Line, ...]
    marks: tuple[Mark, ...]
    logarithmic: bool


@dataclass(frozen=True)
class Condition:
    """A row of the certificate."""

    condition: str
    residual: float | None
    scale: float | None
    time: float | None
    verdict: str
    """holds, fails, `not applicable`, ..."""
    reason: str


@dataclass(frozen=True)
class Table:
    """A table of a comparison, as `quito compare` prints it."""

    title: str
    heads: tuple[str, ...]
    """The first is empty: names of methods stand below it."""
    helps: tuple[str, ...]
    """What each column means; the first is empty."""
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Answer:
    """An answer as the page shows it."""

    kind: str
    """solve or compare."""
    name: str
    title: str
    success: bool
    status: str
    """A word: solved, interrupted, infeasible, ..."""
    said: str
    """The sentence behind it."""
    diagnosis: tuple[str, ...]
    """Why it is no success, in words of the problem file."""
    rows: tuple[tuple[str, str], ...]
    """The summary of `quito solve`: label and what is said; an empty label continues the one above."""
    warnings: tuple[str, ...]
    verdict: str | None
    """Of Pontryagin's conditions, in a line; None where they were not looked at."""
    caveat: str
    """What the conditions do not say."""
    certificate: tuple[Condition, ...]
    charts: tuple[Chart, ...]
    tables: tuple[Table, ...]
    """Of a comparison."""
    notes: tuple[str, ...]
    """Of a comparison: how it was compared."""
    figures: Mapping[str, Any]
    """What `quito solve --json` or `quito compare --json` prints."""

    def save(self, folder: Path) -> None:
        """Write it into the folder of its job."""
        (folder / ANSWER).write_text(json.dumps(asdict(self), ensure_ascii=False), "utf-8")

    @classmethod
    def load(cls, folder: Path) -> Answer:
        """Read what `save` wrote."""
        raise NotImplementedError


def of_solution(solution: Solution) -> Answer:
    """Return a solution as the page shows it."""
    raise NotImplementedError


def of_comparison(comparison: Comparison) -> Answer:
    """Return a comparison as the page shows it."""
    raise NotImplementedError
