"""Operators between matrices, comparisons and indexing, with the shapes they need.

As in the table of functions, the operands are dense SX matrices, and what does not fit is refused
with a ValueError in plain words that spell the sizes out.
"""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

from quito_cli.problem.language.functions import shape_text

if TYPE_CHECKING:
    from casadi import SX

    Operation = Callable[[SX, SX], SX]

COMPARE: Final[Mapping[str, Operation]] = MappingProxyType(
    {
        "<": operator.lt,
        "<=": operator.le,
        ">": operator.gt,
        ">=": operator.ge,
        "==": operator.eq,
        "!=": operator.ne,
    }
)
"""The comparisons of a condition, by the text of their operator."""

_ENTRYWISE: Final[Mapping[type[ast.operator], Operation]] = MappingProxyType(
    {
        ast.Add: operator.add,
        ast.Sub: operator.sub,
        ast.Mult: operator.mul,
        ast.Div: operator.truediv,
    }
)


def operate(kind: type[ast.operator], left: SX, right: SX) -> SX:
    """Apply an arithmetic operator: entry by entry, but for `@` and the power."""
    if kind is ast.MatMult:
        return _product(left, right)
    if kind is ast.Pow:
        return _power(left, right)
    if left.shape != right.shape and left.numel() != 1 and right.numel() != 1:
        joint = "times" if kind is ast.Mult else "and"
        shapes = f"{shape_text(left)} {joint} {shape_text(right)}"
        if kind is ast.Mult and left.shape[1] == right.shape[0]:
            raise ValueError(f"{shapes}: the product of matrices is written '@'")
        raise ValueError(f"{shapes}: entry by entry, the shapes have to be equal")
    return _ENTRYWISE[kind](left, right)


def product_work(left: SX, right: SX) -> int:
    """Count the multiplications of a product of matrices."""
    return int(left.shape[0] * left.shape[1] * right.shape[1])


def _product(left: SX, right: SX) -> SX:
    """Multiply two matrices."""
    import casadi

    if left.shape[1] != right.shape[0]:
        shapes = f"{shape_text(left)} times {shape_text(right)}"
        if left.numel() == 1 or right.numel() == 1:
            raise ValueError(f"{shapes}: the product with a scalar is written '*'")
        if left.shape == right.shape and left.shape[1] == 1:
            raise ValueError(f"{shapes}: the product of two vectors is written dot(a, b)")
        raise ValueError(shapes)
    return casadi.mtimes(left, right)


def _power(base: SX, exponent: SX) -> SX:
    """Raise a scalar, or every entry of a vector, to a scalar power."""
    if exponent.numel() != 1:
        raise ValueError(f"an exponent is a scalar, not {shape_text(exponent)}")
    if min(base.shape) != 1:
        message = f"a {shape_text(base)} matrix has no power here: write products with '@'"
        raise ValueError(message)
    return base**exponent


def take(value: SX, indices: Sequence[int | slice]) -> SX:
    """Give an entry or a part of a vector by one index, of a matrix by row and column.

    Indices count from 0, and negative ones from the end; unlike Python, a slice that reaches
    beyond the end is refused rather than cut short.
    """
    rows, columns = value.shape
    if len(indices) == 2:
        row = _positions(indices[0], rows, "row")
        column = _positions(indices[1], columns, "column")
        return value[row, column]
    if value.numel() == 1 and isinstance(indices[0], slice):
        return value[_positions(indices[0], 1, "entry"), 0]
    if min(rows, columns) != 1:
        raise ValueError(f"a {shape_text(value)} matrix takes two indices: [row, column]")
    places = _positions(indices[0], value.numel(), "entry")
    return value[places, 0] if columns == 1 else value[0, places]


def _positions(index: int | slice, size: int, what: str) -> list[int]:
    """Turn an index into the places that it selects."""
    kinds = {"entry": "entries", "row": "rows", "column": "columns"}
    noun = what if size == 1 else kinds[what]
    counted = f"there {'is' if size == 1 else 'are'} {size} {noun}, counted from 0"
    if isinstance(index, int):
        if not -size <= index < size:
            raise ValueError(f"no {what} {index}: {counted}")
        return [index % size]
    for end in (index.start, index.stop):
        if end is not None and not -size <= end <= size:
            raise ValueError(f"the slice goes to {end}: {counted}")
    places = list(range(size))[index]
    if not places:
        raise ValueError(f"the slice selects nothing: {counted}")
    return places
