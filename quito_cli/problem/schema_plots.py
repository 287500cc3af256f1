"""What a problem file may ask to have drawn beside states and controls over time."""

from __future__ import annotations

from typing import Annotated

from pydantic import Discriminator, Field, Tag

from quito_cli.problem.schema_values import BoundValue, Expression, Formula, Strict, kind

MAX_SHAPES = 100
"""Obstacles and curves a plot may have."""

CurveValue = Annotated[
    Formula | Annotated[list[Expression], Field(min_length=2, max_length=3), Tag("=list")],
    Discriminator(kind),
]
"""Two or three expressions, or one that is a vector of two or three entries."""


class Ball(Strict):
    """A circle in a plane, a sphere in space."""

    centre: BoundValue
    """Its two or three coordinates: numbers, expressions of constants, or a vector constant."""
    radius: Expression
    """Its radius: a number or an expression of constants."""


class Box(Strict):
    """A rectangle in a plane, a box in space, with edges along the axes."""

    centre: BoundValue
    """Its two or three coordinates: numbers, expressions of constants, or a vector constant."""
    half: BoundValue
    """Half the length of its edges, axis by axis, or one number for all."""


class Plot(Strict):
    """Quantities drawn against each other: a plan view, a phase plane, a path in space."""

    title: str = ""
    """Heading; by default the plot's name."""
    curves: Annotated[dict[str, CurveValue], Field(min_length=1, max_length=MAX_SHAPES)]
    """By name for the legend: two or three states (or expressions of states, controls, t)."""
    labels: Annotated[list[str], Field(min_length=2, max_length=3)] | None = None
    """Names of the axes; by default what the first curve draws on them."""
    circles: Annotated[list[Ball], Field(max_length=MAX_SHAPES)] = []
    """Obstacles of a plot with two axes."""
    spheres: Annotated[list[Ball], Field(max_length=MAX_SHAPES)] = []
    """Obstacles of a plot with three axes."""
    boxes: Annotated[list[Box], Field(max_length=MAX_SHAPES)] = []
    """Obstacles with straight edges, in two or three axes."""
