"""A value of an axis, from what a command line or a file says: exact, and one that can be had."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any, Final, get_args

from quito_cli.batch.case import Scalar
from quito_cli.errors import UsageError
from quito_cli.problem.options import CommonOptions

FORMS: Final = "write START:STOP:POINTS, START:STOP:POINTS:log, or values with commas between"
LONGEST: Final = 80
"""Characters of what was given that are repeated in a message."""
_SWITCH: Final = {"true": True, "yes": True, "false": False, "no": False}


def value_of(name: str, model: type[CommonOptions] | None, given: Any) -> Scalar:
    """Return a value as its option has it, or as a finite number where there is no `model`.

    Raises:
        UsageError: it cannot be that.
    """
    if model is not None:
        return _option_value(name, model, given)
    if isinstance(given, bool) or not isinstance(given, str | int | float):
        raise UsageError(f"{str(given)[:LONGEST]} is no number")
    return float(number(str(given).strip()))


def number(text: str) -> Fraction | float:
    """Return a number, exact where it is written as one, or the value of a formula of numbers.

    Raises:
        UsageError: it is neither.
    """
    from quito_cli.problem.values import Reader

    if not text:
        raise UsageError(f"a value is missing: {FORMS}")
    try:
        near = float(text)
        if math.isfinite(near):
            return Fraction(text) if near else Fraction(0)  # of 1e-999999999 nothing else is wanted
    except ValueError:
        pass
    reader = Reader()
    value = reader.number(("value",), text, {})
    if value is None or not math.isfinite(value):
        said = reader.complaints[0].message if reader.complaints else "no finite number"
        raise UsageError(f"{text[:LONGEST]!r} is no number: {said}")
    return value


def _option_value(name: str, model: type[CommonOptions], given: Any) -> Scalar:
    """Return a value of an option, as the option has it.

    Raises:
        UsageError: the option cannot be that.
    """
    from pydantic import ValidationError

    from quito_cli.problem.wording import expected

    value = _scalar(given.strip(), kinds_of(name, model)) if isinstance(given, str) else given
    try:
        options = model.model_validate({name: value})
    except ValidationError as error:
        raise UsageError(f"{str(given)[:LONGEST]}: {expected(error.errors()[0])}") from None
    read: Scalar = getattr(options, name)
    return float(read) if kinds_of(name, model) == (float,) else read


def _scalar(text: str, kinds: tuple[type, ...]) -> Scalar:
    """Return a text as what an option of these types makes of it; itself where it is neither."""
    if bool in kinds:
        return _SWITCH.get(text.lower(), text)
    for kind in (int, float):
        if kind in kinds or (kind is int and float in kinds):
            try:
                return kind(text)
            except ValueError:
                pass
    return text


def kinds_of(name: str, model: type[CommonOptions]) -> tuple[type, ...]:
    """Return the types of an option's values."""
    annotation = model.model_fields[name].annotation
    return tuple(kind for kind in get_args(annotation) if kind is not type(None))
