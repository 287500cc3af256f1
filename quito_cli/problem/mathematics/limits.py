"""Conditions at the ends of the horizon, and bounds: x(0) = 1, |u(t)| ≤ 1, t_f ≥ 0."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from math import isfinite
from typing import Any

from quito_cli.problem.mathematics.notation import Notation, Piece
from quito_cli.problem.mathematics.page import Line, side_by_side
from quito_cli.problem.mathematics.values import inline_value
from quito_cli.problem.schema import Parameter, Problem, Variable
from quito_cli.problem.schema_values import FreeTime, Range


def ends(problem: Problem, notation: Notation) -> Iterator[Line]:
    """Write the conditions at the initial and at the final time."""
    for which, at in zip(("initial", "final"), notation.ends, strict=True):
        conditions: list[str] = []
        for name, state in problem.states.items():
            conditions += _end(notation, name, getattr(state, which), at)
        if conditions:
            yield side_by_side(conditions, notation.latex)


def bounds(problem: Problem, notation: Notation) -> list[Line]:
    """Write the bounds on free times, parameters, states and controls."""
    times = (problem.time.initial, problem.time.final)
    texts = [
        _between(notation, time.lower, time.upper, end.text, scalar=False)
        for time, end in zip(times, notation.ends, strict=True)
        if isinstance(time, FreeTime)
    ]
    for name, parameter in problem.parameters.items():
        texts += _bounded(notation, name, parameter, None)
    for name, variable in {**problem.states, **problem.controls}.items():
        texts += _bounded(notation, name, variable, Piece(("t",)))
    found = [text for text in texts if text]
    return [side_by_side(found, notation.latex)] if found else []


def _end(notation: Notation, name: str, given: Any, at: Piece) -> list[str]:
    """Write the conditions on one state at an end; a free one has none."""
    if isinstance(given, list) and any(not isinstance(v, int | float | str) for v in given):
        entries = [
            _between(notation, *_limits(entry), notation.name(name, at, str(i)).text, scalar=True)
            for i, entry in enumerate(given, start=1)
        ]
        return [text for text in entries if text]
    text = _between(notation, *_limits(given), notation.name(name, at).text, scalar=False)
    return [text] if text else []


def _limits(given: Any) -> tuple[Any, Any]:
    """Give lower and upper end of a range, twice the same for a fixed value."""
    return (given.lower, given.upper) if isinstance(given, Range) else (given, given)


def _bounded(
    notation: Notation, name: str, spec: Variable | Parameter, at: Piece | None
) -> list[str]:
    """Write the bounds on a variable, entry by entry where they are given so."""
    if not isinstance(spec.lower, list) and not isinstance(spec.upper, list):
        middle = notation.name(name, at).text
        return [_between(notation, spec.lower, spec.upper, middle, scalar=spec.size is None)]
    return [
        _between(
            notation,
            _entry(notation, spec.lower, i),
            _entry(notation, spec.upper, i),
            notation.name(name, at, str(i + 1)).text,
            scalar=True,
        )
        for i in range(spec.size or 1)
    ]


def _entry(notation: Notation, given: Any, i: int) -> Any:
    """Take an entry of a list, or of a named vector; a number is the same for all."""
    if isinstance(given, list):
        return given[i] if i < len(given) else None
    symbol = notation.symbols.get(str(given))
    return f"{given}[{i}]" if symbol and symbol.shape else given


def _between(notation: Notation, lower: Any, upper: Any, middle: str, *, scalar: bool) -> str:
    """Write a value and its limits; nothing where it has none."""
    low, high = (None if _is_open(v) else inline_value(notation, v) for v in (lower, upper))
    le, signed = notation.sign("<="), notation.signed
    if low and high and low == high:
        return f"{middle} = {signed(high)}"
    if low and high and scalar and low == replace(high, negative=True) and not high.negative:
        return f"|{middle}| {le} {high.text}"
    if low and high:
        return f"{signed(low)} {le} {middle} {le} {signed(high)}"
    if high:
        return f"{middle} {le} {signed(high)}"
    return f"{middle} {notation.sign('>=')} {signed(low)}" if low else ""


def _is_open(bound: object) -> bool:
    """Tell a bound that does not bound."""
    return bound is None or (isinstance(bound, int | float) and not isfinite(bound))
