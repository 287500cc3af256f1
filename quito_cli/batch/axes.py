"""The axes of a sweep: what a command line or a suite says of them -> names with their values.

    mu=0.1:2:20              20 points from 0.1 to 2, both included
    mu=1e-3:1:10:log         10 points of which each is the same multiple of the one before
    steps=50,100,200         what is listed: numbers, formulas of numbers, names

A name is a constant of the problem, a path as `--set` takes it, or an option of a solve; of a name
that is both, the constant is meant. Points are exact to the last digit (computed in fractions), so
that 0.3 is 0.3, and an axis has the same values, and its cases the same names, on every machine.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import pairwise
from typing import Any, Final

from quito_cli.batch.axis_values import FORMS, LONGEST, kinds_of, number, value_of
from quito_cli.batch.case import Scalar
from quito_cli.errors import UsageError
from quito_cli.problem.load import SETTABLE
from quito_cli.problem.options import CommonOptions, RequestedOptions
from quito_cli.problem.schema import Problem
from quito_cli.problem.text.complaints import suggest

MOST_CASES: Final = 10_000
"""Of a sweep: more than that is a mistake in a range."""
NO_AXES: Final = {
    "solver_options": "an option of the solver by its own name is given with --solver-option",
    "warm_start": "--warm starts each solve from its neighbour",
    "guess": "--warm starts each solve from its neighbour",
}
"""Options that have no values in an order."""
_VARIABLES: Final = ("states", "controls", "parameters")
_DIGITS: Final = 15
"""Of a point between two others on a logarithmic axis: the last would be rounding."""
_EVEN: Final = 1e-6
"""How much steps that are the same may differ."""
_SHORT: Final = 6
"""Digits of a value in the name of a case, where that tells it from the others."""


@dataclass(frozen=True)
class Axis:
    """What a sweep goes over."""

    name: str
    """A constant, a path such as `states.x2.lower`, or an option, with underscores."""
    values: tuple[Scalar, ...]
    """Each once, in the order given."""
    option: bool
    """Whether it is an option of the solve."""
    logarithmic: bool = False
    """Whether each value is the same multiple of the one before."""

    @property
    def numeric(self) -> bool:
        """Whether the values are numbers."""
        return not any(isinstance(value, str | bool) for value in self.values)

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """The values as text, each different from the others."""
        short = tuple(text_of(value) for value in self.values)
        if len(set(short)) == len(short):
            return short
        return tuple(str(value) for value in self.values)


@dataclass(frozen=True)
class Known:
    """What there is to go over."""

    constants: tuple[str, ...]
    variables: Mapping[str, Collection[str]]
    """States, controls and parameters by section, for hints."""
    options: type[CommonOptions]
    """What may be asked for."""

    @property
    def axes(self) -> list[str]:
        """Options that have values in an order."""
        return [option for option in self.options.model_fields if option not in NO_AXES]


def known(problem: Problem) -> Known:
    """Return what a command line may go over."""
    variables = {section: tuple(getattr(problem, section)) for section in _VARIABLES}
    return Known(tuple(problem.constants), variables, RequestedOptions)


def text_of(value: Scalar) -> str:
    """Return a value as text, a number to six digits."""
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"{value:.{_SHORT}g}" if isinstance(value, float) else str(value)


def parse(given: Iterable[str], problem: Problem) -> tuple[Axis, ...]:
    """Return the axes of a command line's `--over NAME=VALUES`.

    Raises:
        UsageError: one is not of that form, names nothing that can be swept, has a value that it
            cannot take, or they come to too many cases.
    """
    axes, there = [], known(problem)
    for text in given:
        name, equals, values = text.partition("=")
        if not (name.strip() and equals and values.strip()):
            raise UsageError(f"--over {text!r}: write NAME=VALUES; {FORMS}")
        try:
            axes.append(axis(name.strip(), values.strip(), there))
        except UsageError as error:
            raise UsageError(f"--over {text[:LONGEST]}: {error}") from None
    refuse_unswept(axes)
    return tuple(axes)


def refuse_unswept(axes: Sequence[Axis]) -> None:
    """Refuse a name that stands on two axes, and more cases than a sweep may have.

    Raises:
        UsageError: it is so.
    """
    names = [axis.name for axis in axes]
    for name in names:
        if names.count(name) > 1:
            raise UsageError(f"{name} is swept twice: put its values on one axis")
    count = math.prod(len(axis.values) for axis in axes)
    if count > MOST_CASES:
        sizes = " x ".join(str(len(axis.values)) for axis in axes)
        raise UsageError(
            f"{sizes} are {count:,} cases, and a sweep has {MOST_CASES:,} at most: take fewer"
        )


def axis(name: str, given: Any, there: Known) -> Axis:
    """Return an axis.

    Args:
        name: of a constant, a path, or an option; with hyphens or underscores.
        given: a text as on the command line, a value, or a sequence of values.
        there: what there is to go over.

    Raises:
        UsageError: there is nothing of that name, or it cannot have these values.
    """
    name, option = _named(name, there)
    model = there.options if option else None
    points = given.split(":") if isinstance(given, str) else []
    if len(points) > 1:
        return Axis(name, *_range(name, model, [point.strip() for point in points]))
    listed = given.split(",") if isinstance(given, str) else given
    listed = listed if isinstance(listed, list | tuple) else [listed]
    if len(listed) > MOST_CASES:
        raise UsageError(f"{len(listed):,} values, where a sweep has {MOST_CASES:,} at most")
    values = _each_once([value_of(name, model, value) for value in listed])
    return Axis(name, values, option, evenly_multiplied(values))


def evenly_multiplied(values: Sequence[Scalar]) -> bool:
    """Whether each value is the same multiple of the one before: three or more numbers."""
    if len(values) < 3 or not all(isinstance(v, int | float) and v > 0 for v in values):
        return False
    logs = [math.log(float(value)) for value in values]
    steps = [after - before for before, after in pairwise(logs)]
    return max(steps) - min(steps) <= _EVEN * max(map(abs, steps))


def shadowed(axes: Iterable[Axis]) -> tuple[str, ...]:
    """Return the names that are options too, and swept as constants."""
    options = RequestedOptions.model_fields
    return tuple(axis.name for axis in axes if axis.name in options and not axis.option)


def _named(name: str, there: Known) -> tuple[str, bool]:
    """Return the name as it is known, and whether it is an option.

    Raises:
        UsageError: there is nothing of that name.
    """
    constants = there.constants
    if name in constants:
        return name, False
    if "." in name:
        section, _, rest = name.partition(".")
        if section not in SETTABLE:
            raise UsageError(f"only {', '.join(SETTABLE)} have values to sweep{_path(name, there)}")
        return (rest if section == "constants" and rest in constants else name), False
    plain = name.replace("-", "_")
    if plain in NO_AXES:
        raise UsageError(f"{name} is no axis: {NO_AXES[plain]}")
    if plain in there.axes:
        return plain, True
    if beside := _path(name, there):
        raise UsageError(f"'{name}' is neither a constant nor an option{beside}")
    has = f"the constants are {', '.join(constants)}" if constants else "it has no constants"
    raise UsageError(
        f"the problem has no constant '{name}', nor is it an option"
        f"{suggest(name, [*constants, *there.axes])} ({has}); other values are swept by their "
        "path, such as states.x1.upper"
    )


def _path(name: str, there: Known) -> str:
    """Return the end of a message on the state, control or parameter that a name begins with."""
    first = name.partition(".")[0]
    for section, names in there.variables.items():
        if first in names:
            path = name if "." in name else f"{first}.upper"
            return f"; did you mean {section}.{path}?"
    return "; sweep the horizon as time.final" if first in ("t", "tf", "T") else ""


def _range(
    name: str, model: type[CommonOptions] | None, parts: list[str]
) -> tuple[tuple[Scalar, ...], bool, bool]:
    """Return the points of a range, whether it is an option's, and whether it is logarithmic.

    Raises:
        UsageError: it is none.
    """
    if len(parts) not in (3, 4) or (len(parts) == 4 and parts[3] not in ("log", "lin")):
        raise UsageError(FORMS)
    kinds = (float,) if model is None else kinds_of(name, model)
    if not {int, float} & set(kinds):
        raise UsageError(f"{name} has no values between others: list them with commas")
    start, stop = (Fraction(number(part)) for part in parts[:2])
    if not re.fullmatch("[0-9]{1,6}", parts[2]) or not 2 <= int(parts[2]) <= MOST_CASES:
        raise UsageError(f"the number of points is from 2 to {MOST_CASES:,}, got {parts[2][:20]!r}")
    if start == stop:
        raise UsageError(f"the range starts where it stops: write {name}={parts[0]}")
    logarithmic = parts[3:] == ["log"]
    points = _spaced(start, stop, int(parts[2]), logarithmic)
    whole = [point if float in kinds else round(point) for point in points]
    read = [value_of(name, model, point) for point in whole]
    return _each_once(read), model is not None, logarithmic


def _spaced(start: Fraction, stop: Fraction, count: int, logarithmic: bool) -> list[float]:
    """Return the points from start to stop."""
    if not logarithmic:
        return [float(start + (stop - start) * i / (count - 1)) for i in range(count)]
    if start * stop <= 0:
        raise UsageError("a logarithmic range has both ends on the same side of zero")
    first, ratio = float(start), float(stop / start)
    between = (first * ratio ** (i / (count - 1)) for i in range(1, count - 1))
    return [first, *(float(f"{point:.{_DIGITS}g}") for point in between), float(stop)]


def _each_once(values: list[Any]) -> tuple[Scalar, ...]:
    """Return the values.

    Raises:
        UsageError: one stands there twice.
    """
    seen: set[Any] = set()
    for value in values:
        if value in seen:
            raise UsageError(f"{text_of(value)} stands there twice: each value is solved once")
        seen.add(value)
    return tuple(values)
