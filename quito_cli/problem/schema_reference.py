"""What a problem file may say of its answer: a reference, and published rows."""

from __future__ import annotations

from typing import Annotated

from pydantic import Discriminator, Field, Tag

from quito_cli.problem.schema_values import (
    MAX_SIZE,
    ConstantValue,
    Expression,
    Formula,
    Number,
    Strict,
    kind,
)


class Piece(Strict):
    """A piece of a reference: `value` until `until`."""

    until: Expression | None = None
    """Where the piece ends; the last one has none."""
    value: Expression
    """Expression of t and constants."""


ReferenceValue = Annotated[
    Number
    | Formula
    | Annotated[list[Piece], Field(min_length=1, max_length=MAX_SIZE), Tag("=list")],
    Discriminator(kind),
]


class Reference(Strict):
    """What is known of the answer, for the file as it stands."""

    cost: Expression | None = None
    """Optimal cost."""
    accuracy: Annotated[float, Field(gt=0)] | None = None
    """Absolute accuracy of the cost."""
    verified: str = ""
    """How it was obtained and verified."""
    general: bool = False
    """The expressions hold for changed constants too."""
    constants: dict[str, ConstantValue] = {}
    """Constants of the reference's own, in order."""
    switching_times: Annotated[list[Expression], Field(max_length=MAX_SIZE)] = []
    """All junctions between arcs, increasing."""
    state: dict[str, ReferenceValue] = {}
    """State by name: an expression of t, or a list of pieces {until, value}."""
    control: dict[str, ReferenceValue] = {}
    """Control by name: an expression of t, or a list of pieces {until, value}."""


class Published(Strict):
    """A row of a published table, kept with the problem."""

    tool: str
    """Who computed it, with what."""
    steps: Annotated[int, Field(ge=1)] | None = None
    """Control cells or nodes."""
    time: float | None = None
    """Seconds on the authors' machine."""
    iterations: int | None = None
    """Iterations of the solver."""
    violation: float | None = None
    """Largest constraint violation."""
    error_norm: float | None = None
    """2-norm of the vector of samples of the control error."""
    dft_norm: float | None = None
    """2-norm of its discrete Fourier transform."""
