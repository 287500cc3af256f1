"""Comparisons of the file -> constraints lower ≤ value ≤ upper.

Where one side of a comparison is constant it becomes a bound of the other; otherwise the difference
is bounded by zero. A chain with constants at both ends is two-sided; any other is taken apart.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from quito_cli.problem.language.expressions import (
    Comparison,
    Expression,
    ExpressionError,
    evaluate,
    parse_comparison,
)
from quito_cli.problem.language.hints import infinity
from quito_cli.problem.model import Constraint
from quito_cli.problem.scopes import Scope, Scopes
from quito_cli.problem.values import Path
from quito_cli.problem.variables import Bounds

if TYPE_CHECKING:
    import casadi as ca

_INFINITY = "infinity bounds nothing: leave this side of the comparison out"
_WRITE = {"<": "<=", ">": ">="}


def read_comparison(
    scopes: Scopes, path: Path, text: str, scope: Scope, name: str, *, integral: bool = False
) -> Constraint | None:
    """Return the constraint that `text` says, or None after a complaint."""
    try:
        comparison = parse_comparison(text)
        if scopes.reader.budget.exhausted or scopes.reader.is_poisoned(
            n for s in comparison.sides for n in (*s.names, *s.tables)
        ):
            return None
        _check_operators(comparison, text)
        sides = [
            evaluate(
                side,
                scope.values,
                refused={**infinity(side.tree, _INFINITY), **scope.refused},
                initial=scope.initial,
                final=scope.final,
                tables=scopes.tables,
                budget=scopes.reader.budget,
            )
            for side in comparison.sides
        ]
        _check_shapes(comparison, sides)
        if integral:
            _check_integrand(comparison, sides)
        value, bounds = _bounded(comparison, sides)
    except ExpressionError as error:
        scopes.reader.misread(path, error, ends=scope.initial is not None)
        return None
    import casadi as ca

    return Constraint(
        name,
        text,
        value,
        bounds,
        _size(sides, value),
        bool(scopes.n_u) and bool(ca.depends_on(value, scopes.u)),
    )


def _check_operators(comparison: Comparison, text: str) -> None:
    operators = comparison.operators
    for side, wrong in zip(comparison.sides[1:], operators, strict=True):
        if wrong in ("<", ">", "!="):
            remedy = f"write {_WRITE[wrong]}" if wrong in _WRITE else "write <=, >= or =="
            message = f"'{wrong}' cannot be held by a solver: {remedy}"
            offset = text.rfind(wrong, 0, side.span(side.tree)[0])
            raise ExpressionError(message, max(offset, 0), len(wrong))
    if len(operators) > 2:
        raise ExpressionError("a chain has three sides at most: low <= value <= high", 0, len(text))
    if len(operators) == 2 and "==" in operators:
        message = "a chain has no '==': write two constraints, each with a name of its own"
        raise ExpressionError(message, 0, len(text))
    if len(operators) == 2 and operators[0] != operators[1]:
        message = f"a chain goes one way: {operators[0]} and then {operators[1]} do not"
        raise ExpressionError(message, 0, len(text))


def _check_shapes(comparison: Comparison, sides: list[ca.SX]) -> None:
    rows = {side.numel() for side in sides} - {1}
    if len(rows) > 1 or any(side.shape[1] != 1 for side in sides):
        shapes = ", ".join("x".join(map(str, side.shape)) for side in sides)
        first = comparison.sides[0]
        message = f"the sides of a comparison have one size, or are scalars; these are {shapes}"
        raise ExpressionError(message, 0, len(first.text))


def _check_integrand(comparison: Comparison, sides: list[ca.SX]) -> None:
    """One side is integrated, so that the others are constants; its integral is one number."""
    varying = [i for i, side in enumerate(sides) if not side.is_constant()]
    if len(varying) > 1:
        said = comparison.sides[varying[1]]
        message = "an integral has one integrand: the other sides are constants, and this is none"
        raise said.error(message, said.tree)
    for side, said in zip(sides, comparison.sides, strict=True):
        if side.numel() != 1:
            message = (
                f"an integral is a scalar, this has {side.numel()} entries: take them one by one"
            )
            raise said.error(message, said.tree)


def _bounded(comparison: Comparison, sides: list[ca.SX]) -> tuple[ca.SX, Bounds]:
    """Return value and bounds of a comparison with sides ascending or equal."""
    import casadi as ca

    operators = comparison.operators
    size, said = max(side.numel() for side in sides), comparison.sides
    sides = [ca.repmat(side, size // side.numel(), 1) for side in sides]
    if operators[0] == ">=":
        sides, said = sides[::-1], said[::-1]
    known = [_numbers(side, expression) for side, expression in zip(sides, said, strict=True)]
    text = comparison.sides[0].text
    if all(side is not None for side in known):
        message = (
            f"{'both' if len(sides) == 2 else 'all'} sides are constants: this constrains nothing"
        )
        raise ExpressionError(message, 0, len(text))
    if any(a is not None and b is not None for a, b in pairwise(known)):
        message = "two sides next to each other are constants: leave one of them out"
        raise ExpressionError(message, 0, len(text))
    infinite = np.full(size, np.inf)
    if len(sides) == 3:
        low, middle, high = known
        if low is not None and middle is None and high is not None:
            if np.any(low > high):
                i = int(np.argmax(low > high))
                message = f"the chain allows nothing: {low[i]:g} is above {high[i]:g}"
                raise ExpressionError(message, 0, len(text))
            return sides[1], Bounds(low, high)
        gaps = ca.vertcat(sides[1] - sides[0], sides[2] - sides[1])
        return gaps, Bounds(np.zeros(2 * size), np.tile(infinite, 2))
    equal = operators[0] == "=="
    low, high = known
    if high is not None:
        return sides[0], Bounds(high if equal else -infinite, high)
    if low is not None:
        return sides[1], Bounds(low, low if equal else infinite)
    zero = np.zeros(size)
    return sides[0] - sides[1], Bounds(zero if equal else -infinite, zero)


def _size(sides: list[ca.SX], value: ca.SX) -> ca.SX:
    """Return the size of the largest side, row by row."""
    import casadi as ca

    rows = max(side.numel() for side in sides)
    size = ca.SX.zeros(rows)
    for side in sides:
        size = ca.fmax(size, ca.fabs(ca.repmat(side, rows // side.numel(), 1)))
    return ca.repmat(size, value.numel() // rows, 1)


def _numbers(side: ca.SX, said: Expression) -> np.ndarray | None:
    """Return a constant side as numbers.

    Raises:
        ExpressionError: a constant that is not finite.
    """
    import casadi as ca

    if not side.is_constant():
        return None
    numbers = np.array(ca.DM(side)).ravel()
    if not np.isfinite(numbers).all():
        raise said.error("this side of the comparison is not finite", said.tree)
    return numbers
