"""The problem file as frozen pydantic models: what keys there are and what each means.

The attribute docstrings are the documentation: they become the JSON Schema's descriptions and the
hover text in editors. Formulas stay text here; `build` turns them into a Model.
"""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import ConfigDict, Field, PrivateAttr, model_validator

from quito_cli.problem.options import FileOptions
from quito_cli.problem.schema_plots import MAX_SHAPES, Plot
from quito_cli.problem.schema_reference import Published, Reference
from quito_cli.problem.schema_values import (
    MAX_SIZE,
    MAX_TABLE,
    MAX_VARIABLES,
    BoundValue,
    ConstantValue,
    DynamicsValue,
    EndValue,
    Expression,
    GuessValue,
    Instant,
    Strict,
)
from quito_cli.problem.text.source import Source

TagWord = Annotated[str, Field(pattern="^[a-z][a-z0-9-]{0,39}$")]
"""A word in small letters and hyphens."""


class Time(Strict):
    """The horizon."""

    initial: Instant
    """Initial time: a number, an expression of constants, or {lower:, upper:, guess:} if free."""
    final: Instant
    """Final time: a number, an expression such as pi/2, or {lower:, upper:, guess:} if free."""


class Variable(Strict):
    """What states and controls have in common."""

    size: Annotated[int, Field(ge=1, le=MAX_SIZE, strict=True)] | None = None
    """Number of entries of a vector; leave out for a scalar."""
    lower: BoundValue = None
    """Smallest value on the whole horizon."""
    upper: BoundValue = None
    """Largest value on the whole horizon."""
    guess: GuessValue = None
    """Where the solver starts: an expression of t, or a table {times:, values:}."""
    scale: BoundValue = None
    """Its typical size; by default from bounds, guess and dynamics."""
    unit: str = ""
    """Unit, for labels."""
    description: str = ""
    """What it is, in words."""


class Control(Variable):
    """A control; a vector if it has a size."""


class State(Variable):
    """A state; a vector if it has a size."""

    initial: EndValue = None
    """Value at the initial time; free if left out."""
    final: EndValue = None
    """Value at the final time; free if left out."""


class Parameter(Strict):
    """An unknown that is constant in time; a vector if it has a size."""

    size: Annotated[int, Field(ge=1, le=MAX_SIZE, strict=True)] | None = None
    """Number of entries of a vector; leave out for a scalar."""
    lower: BoundValue = None
    """Smallest value."""
    upper: BoundValue = None
    """Largest value."""
    guess: BoundValue = None
    """Where the solver starts; by default the middle of the bounds."""
    scale: BoundValue = None
    """Its typical size; by default from bounds and guess."""
    unit: str = ""
    """Unit, for labels."""
    description: str = ""
    """What it is, in words."""


class Table(Strict):
    """Measured data, used in formulas as interpolate(argument, name)."""

    x: Annotated[list[float], Field(min_length=2, max_length=MAX_TABLE)]
    """Increasing arguments."""
    y: Annotated[list[float], Field(min_length=2, max_length=MAX_TABLE)]
    """Values."""
    method: Literal["linear", "cubic"] = "cubic"
    """Piecewise linear, or a cubic spline (smooth: what an optimiser likes)."""


class PointConstraint(Strict):
    """A constraint at one time."""

    at: Expression
    """When: a time, or with a free horizon a fraction of it, 0 to 1."""
    holds: str
    """Comparison of states, controls, parameters and t."""


class Constraints(Strict):
    """Comparisons of formulas, by name: <=, >=, ==, or a chain such as -1 <= x1 - x2 <= 1."""

    path: Annotated[dict[str, str], Field(max_length=MAX_VARIABLES)] = {}
    """On the whole horizon: states, controls, parameters, t."""
    boundary: Annotated[dict[str, str], Field(max_length=MAX_VARIABLES)] = {}
    """Between the ends: initial(x), final(x), initial(t), final(t), parameters."""
    integral: Annotated[dict[str, str], Field(max_length=MAX_VARIABLES)] = {}
    """On integrals over the horizon: one side is the integrand, the others are constants."""
    point: Annotated[dict[str, PointConstraint], Field(max_length=MAX_VARIABLES)] = {}
    """At given times."""


class Cost(Strict):
    """What is minimised (or maximised): the integral of `lagrange` plus `mayer`."""

    model_config = ConfigDict(json_schema_extra={"minProperties": 1})

    lagrange: Expression = 0.0
    """Running cost, integrated over the horizon: states, controls, t."""
    mayer: Expression = 0.0
    """End cost: bare names are final values, t the final time; initial(x) and final(x) too."""

    @model_validator(mode="after")
    def _says_something(self) -> Self:
        if not self.model_fields_set:
            raise ValueError("a cost has `lagrange`, `mayer` or both")
        return self


class Problem(Strict):
    """An optimal control problem, as its file says it."""

    title: str = ""
    """One line, for headings."""
    source: str = ""
    """Where the problem comes from."""
    description: str = ""
    """Notes: what makes it hard, what to look at."""
    tags: Annotated[list[TagWord], Field(max_length=20)] = []
    """Families it belongs to, such as singular, bang-bang, state-constrained or free-time."""
    constants: Annotated[dict[str, ConstantValue], Field(max_length=MAX_VARIABLES)] = {}
    """Numbers, vectors, matrices, or expressions of earlier constants, by name."""
    time: Time
    """The horizon."""
    states: Annotated[dict[str, State], Field(min_length=1, max_length=MAX_VARIABLES)]
    """States by name; their order here is their order everywhere."""
    controls: Annotated[dict[str, Control], Field(max_length=MAX_VARIABLES)] = {}
    """Controls by name; their order here is their order everywhere."""
    parameters: Annotated[dict[str, Parameter], Field(max_length=MAX_VARIABLES)] = {}
    """Unknowns that are constant in time, by name."""
    tables: Annotated[dict[str, Table], Field(max_length=MAX_VARIABLES)] = {}
    """Measured data by name, for interpolate(argument, name)."""
    expressions: Annotated[dict[str, Expression], Field(max_length=MAX_VARIABLES)] = {}
    """Names for formulas, in order, for use in formulas further down."""
    dynamics: dict[str, DynamicsValue]
    """Time derivative of each state: an expression of states, controls, constants and t."""
    sense: Literal["minimize", "maximize"] = "minimize"
    """Whether the cost is to be small or large."""
    cost: Cost
    """What is minimised, or maximised."""
    constraints: Constraints = Constraints()
    """Comparisons that must hold: path, boundary, integral, point."""
    plots: Annotated[dict[str, Plot], Field(max_length=MAX_SHAPES)] = {}
    """Further plots by name: a plan view with its obstacles, a phase plane, a path in space."""
    reference: Reference | None = None
    """What is known of the answer."""
    published: list[Published] = []
    """Published results, kept with the problem."""
    options: FileOptions = FileOptions()
    """What the file asks of the solver; the command line wins."""

    _source: Source | None = PrivateAttr(default=None)
    _name: str = PrivateAttr(default="problem")
    _changes: tuple[tuple[str, str], ...] = PrivateAttr(default=())

    @property
    def name(self) -> str:
        """Short name: the file's name without its ending."""
        return self._name

    @property
    def text(self) -> str:
        """The YAML text it was read from, or an equal one."""
        if self._source is not None:
            return self._source.text
        import yaml

        return yaml.safe_dump(self.model_dump(exclude_unset=True), sort_keys=False)

    @property
    def changes(self) -> tuple[tuple[str, str], ...]:
        """What was set since reading: (name, value) in order."""
        return self._changes

    @property
    def file(self) -> Source | None:
        """The file it was read from, with positions; None if it was built in Python."""
        return self._source
