"""What a value of the problem file may be: alternatives told apart by their kind.

pydantic tries all alternatives of a union and complains of each; here the kind of a value chooses
one, so that an error speaks of one only. The tags start with "=", which marks them in the places
that pydantic reports.
"""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag

MAX_SIZE = 200
"""Entries a vector may have."""
MAX_VARIABLES = 500
"""Names a section may have."""
MAX_TABLE = 1000
"""Rows a table may have."""


def kind(value: Any) -> str | None:
    """Tell the alternatives of a value apart, so that an error speaks of one of them only."""
    if isinstance(value, bool):
        return None
    if isinstance(value, int | float):
        return "=number"
    if isinstance(value, str):
        return "=expression"
    if isinstance(value, list):
        return "=list"
    if isinstance(value, dict | BaseModel):
        return "=mapping"
    return "=nothing" if value is None else None


Number = Annotated[float, Tag("=number")]
Formula = Annotated[str, Tag("=expression")]
Nothing = Annotated[None, Tag("=nothing")]

Expression = Annotated[Number | Formula, Discriminator(kind)]
"""A number or a formula."""


class Strict(BaseModel):
    """A mapping of the file: frozen, no unknown keys."""

    # Not built one by one: only Problem's validator, which holds all others, is ever used.
    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)


class Range(Strict):
    """A value that may lie anywhere between two bounds."""

    lower: Expression | None = None
    """Smallest value; none if left out."""
    upper: Expression | None = None
    """Largest value; none if left out."""


RangeEntry = Annotated[Range, Tag("=mapping")]
EndEntry = Annotated[Number | Formula | RangeEntry | Nothing, Discriminator(kind)]
EndValue = Annotated[
    Number
    | Formula
    | RangeEntry
    | Nothing
    | Annotated[list[EndEntry], Field(max_length=MAX_SIZE), Tag("=list")],
    Discriminator(kind),
]
"""A number, an expression of constants, a range, or a list with one of these for each entry."""
BoundEntry = Annotated[Number | Formula | Nothing, Discriminator(kind)]
BoundValue = Annotated[
    Number
    | Formula
    | Nothing
    | Annotated[list[BoundEntry], Field(max_length=MAX_SIZE), Tag("=list")],
    Discriminator(kind),
]
"""A number, an expression of constants, or a list with one of these for each entry."""
Row = Annotated[list[Expression], Field(max_length=MAX_SIZE), Tag("=list")]
ConstantValue = Annotated[
    Number
    | Formula
    | Annotated[
        list[Annotated[Number | Formula | Row, Discriminator(kind)]],
        Field(min_length=1, max_length=MAX_SIZE),
        Tag("=list"),
    ],
    Discriminator(kind),
]
"""A number, a vector, a matrix (list of rows), or an expression of earlier constants."""
DynamicsValue = Annotated[
    Number
    | Formula
    | Annotated[list[Expression], Field(min_length=1, max_length=MAX_SIZE), Tag("=list")],
    Discriminator(kind),
]


class FreeTime(Strict):
    """A time that is an unknown."""

    lower: Expression | None = None
    """Earliest."""
    upper: Expression | None = None
    """Latest."""
    guess: Expression | None = None
    """Where the solver starts; by default between the bounds."""


Instant = Annotated[Number | Formula | Annotated[FreeTime, Tag("=mapping")], Discriminator(kind)]
"""A number, an expression of constants such as pi/2, or {lower:, upper:, guess:} where free."""


Numbers = Annotated[list[float], Field(max_length=MAX_SIZE), Tag("=list")]


class GuessTable(Strict):
    """A guess by values at times, linear in between."""

    times: Annotated[list[float], Field(min_length=2, max_length=MAX_TABLE)]
    """Increasing times."""
    values: Annotated[
        list[Annotated[Number | Numbers, Discriminator(kind)]],
        Field(min_length=2, max_length=MAX_TABLE),
    ]
    """A value for each time; a list of values for a vector."""


GuessValue = Annotated[
    Number
    | Formula
    | Annotated[GuessTable, Tag("=mapping")]
    | Nothing
    | Annotated[list[Expression], Field(min_length=1, max_length=MAX_SIZE), Tag("=list")],
    Discriminator(kind),
]
"""An expression of t, a list with one for each entry, or a table {times:, values:}."""
