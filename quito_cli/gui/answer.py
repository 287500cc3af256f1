"""What a finished job leaves in its folder for the page: words, figures and charts, as JSON.

    result.h5       the Solution; of a comparison our row's
    answer.json     the Answer

The answer is made in the worker, so that the server reads no HDF5 and loads no CasADi.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Literal

from pydantic import TypeAdapter

from quito_cli.errors import ResultFileError

RESULT, ANSWER = "result.h5", "answer.json"
"""Files in the folder of a job."""

Kind = Literal[
    "states",
    "controls",
    "costates",
    "switching",
    "plan",
    "error",
    "magnified",
    "logarithmic",
    "spectrum",
]
"""Of a chart: the last four are views of the error in a comparison."""
Numbers = tuple[float | None, ...]
"""None where there is none: a gap in the line."""


@dataclass(frozen=True)
class Line:
    """A curve of a chart."""

    name: str
    """For the legend: of the quantity, of the method, or `reference`."""
    role: Literal["answer", "reference"]
    number: int
    """Of the component or of the method, from 0: by it lines are told apart; -1 the reference's."""
    x: Numbers
    y: Numbers
    rough: bool = False
    """It may cover others: draw it thin."""


@dataclass(frozen=True)
class Mark:
    """A switching time."""

    time: float
    uncertainty: float
    said: str
    """`1.36674 ± 1e-05  u jumps -1 → 1`."""
    own: bool
    """Whether what the chart shows switches there itself."""


@dataclass(frozen=True)
class Span:
    """A stretch of the horizontal axis: an arc, or a jump zone of a comparison."""

    start: float
    end: float
    kind: str
    """lower, upper, interior, singular, active; or zone."""
    said: str
    """As a legend has it: `at lower bound`."""


@dataclass(frozen=True)
class Chart:
    """A plot."""

    kind: Kind
    name: str
    """Of the quantity; charts of several runs belong together where kind and name are the same."""
    label: str
    """Of the vertical axis, with the unit."""
    across: str
    """Of the horizontal axis: t, frequency, or a coordinate of a plan."""
    lines: tuple[Line, ...]
    bounds: tuple[float, ...] = ()
    """Near enough to be shown."""
    marks: tuple[Mark, ...] = ()
    spans: tuple[Span, ...] = ()
    logarithmic: bool = False
    low: float | None = None
    """Of the vertical axis, where it is not to be found from the lines."""
    high: float | None = None
    note: str = ""
    """What a reader must know of the frame."""
    outlines: tuple[tuple[Numbers, Numbers], ...] = ()
    """Of the obstacles of a plan: x and y, closed."""


@dataclass(frozen=True)
class Condition:
    """A row of the certificate."""

    condition: str
    residual: float | None
    scale: float | None
    time: float | None
    verdict: str
    """holds, `holds to discretization accuracy`, fails, `not applicable`."""
    reason: str


@dataclass(frozen=True)
class Table:
    """A table of a comparison, as `quito compare` prints it."""

    title: str
    heads: tuple[str, ...]
    """The first is `method`."""
    helps: tuple[str, ...]
    """What each column means; the first is empty."""
    rows: tuple[tuple[str, ...], ...]
    """A method and its figures."""
    published: tuple[tuple[str, ...], ...]
    """The same of tables in print."""


@dataclass(frozen=True)
class Answer:
    """An answer as the page shows it."""

    kind: Literal["solve", "compare"]
    name: str
    """Of the problem."""
    title: str
    given: Mapping[str, Any]
    """What was asked for beside the file and the defaults."""
    success: bool
    """Of a comparison, whether all rows are solved."""
    status: str
    """A word: solved, interrupted, infeasible, ...; of a comparison our row's."""
    said: str
    """The sentence behind it."""
    diagnosis: tuple[str, ...]
    """Why it is no success, in the words of the problem file."""
    rows: tuple[tuple[str, str], ...]
    """The summary of `quito solve`: labels and what is said; no label continues the row above."""
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
    """Of a comparison: what it was held against, and how."""
    figures: Mapping[str, Any]
    """What `quito solve --json` or `quito compare --json` prints."""

    def save(self, folder: Path) -> None:
        """Write it into the folder of its job."""
        (folder / ANSWER).write_bytes(_adapter().dump_json(self))

    @classmethod
    def load(cls, folder: Path) -> Answer:
        """Read what `save` wrote.

        Raises:
            ResultFileError: the run is not kept any more.
        """
        try:
            return _adapter().validate_json((folder / ANSWER).read_bytes())
        except (OSError, ValueError):
            raise ResultFileError("that run is not kept any more: run it again") from None


@cache
def _adapter() -> TypeAdapter[Answer]:
    """Return what writes and reads answers; it takes a tenth of a second to make."""
    return TypeAdapter(Answer)
