"""The tree of a formula as it is printed. Entries are counted from 1, as on paper."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from math import isfinite
from typing import Final

from quito_cli.problem.language.functions import BOUNDARY_FUNCTIONS, FUNCTIONS
from quito_cli.problem.language.syntax import Expression, comparison_operators, subscripts
from quito_cli.problem.mathematics.notation import (
    CALLS,
    NOTATIONS,
    SQUARED_IN_FRONT,
    Level,
    Notation,
    Piece,
)
from quito_cli.problem.mathematics.symbols import FRACTIONS, escaped


def _number_of(node: ast.expr) -> Fraction | None:
    """Read a number or a quotient of two, as it stands before other factors."""
    match node:
        case ast.Constant(value=int() | float() as number) if isfinite(number):
            return Fraction(repr(number))
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            value = _number_of(operand)
            return None if value is None else -value
        case ast.BinOp(left=above, op=ast.Div(), right=ast.Constant() as below):
            over, under = _number_of(above), _number_of(below)
            return over / under if over is not None and under else None
    return None


def formula(notation: Notation, expression: Expression) -> Piece:
    """Write an expression."""
    return _Walk(expression, notation).piece(expression.tree)


def integral(notation: Notation, expression: Expression) -> Piece:
    """Write the integral of an expression over the horizon, a leading number in front of it."""
    walk = _Walk(expression, notation)
    number, rest, minus = _split(expression.tree)
    integrand = walk.piece(rest)
    if number is None and integrand.negative:
        minus, integrand = not minus, replace(integrand, negative=False)
    whole = notation.integral(integrand)
    if number is None:
        return replace(whole, negative=minus)
    factor = walk.coefficient(number)
    plain = notation.fit(replace(factor, negative=False), Level.PRODUCT)
    first = notation.times(plain, whole.terms[0])
    return Piece((first, *whole.terms[1:]), Level.PRODUCT, factor.negative != minus)


def _split(node: ast.expr) -> tuple[ast.expr | None, ast.expr, bool]:
    """Take a leading number and the minus signs before a bracket from the rest of a product."""
    match node:
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            number, rest, minus = _split(operand)
            return number, rest, not minus
        case ast.BinOp(left=left, op=ast.Mult() as times, right=right):
            if _number_of(left) is not None:
                return left, right, False
            number, rest, minus = _split(left)
            return number, ast.BinOp(rest, times, right), minus
    return None, node, False


@dataclass(frozen=True)
class _Walk:
    """One walk over a checked tree."""

    expression: Expression
    notation: Notation

    def piece(self, node: ast.expr) -> Piece:
        """Write a node."""
        match node:
            case ast.Constant(value=int() | float() as value):
                result = self.notation.number(value)
            case ast.Name(id=name):
                result = self.notation.name(name, self.notation.at)
            case ast.UnaryOp(op=ast.UAdd() | ast.USub() as sign, operand=operand):
                result = self.piece(operand)
                result = self._negated(result) if isinstance(sign, ast.USub) else result
            case ast.BinOp(op=op):
                result = _OPERATIONS[type(op)](self, node)
            case ast.List(elts=entries):
                result = self._list(entries)
            case ast.Subscript():
                result = self._indexed(node)
            case ast.Call(func=ast.Name(id=name)):
                result = self._call(node, name)
            case _:
                result = Piece((self.notation.bracketed(self.expression.source_of(node)),))
        return result

    def _negated(self, piece: Piece) -> Piece:
        """Take the minus sign before the text, in front of brackets if need be."""
        if piece.negative or piece.level < Level.MIXED:
            return Piece((self.notation.bracketed(self.notation.signed(piece)),), negative=True)
        return replace(piece, negative=True)

    def sum(self, node: ast.BinOp) -> Piece:
        """Write a sum or difference."""
        minus = isinstance(node.op, ast.Sub)
        return self.notation.sum(self.piece(node.left), self.piece(node.right), minus)

    def product(self, node: ast.BinOp) -> Piece:
        """Write a product; one of two vectors, entry by entry, has a sign of its own."""
        if _is_array(node.left, self.notation) and _is_array(node.right, self.notation):
            sides = [self.notation.fit(self.piece(n), Level.POWER) for n in (node.left, node.right)]
            return Piece((self.notation.sign("∘").join(sides),), Level.MIXED)
        return self.notation.product(self.coefficient(node.left), self.piece(node.right))

    def coefficient(self, node: ast.expr) -> Piece:
        """Write the first factor, a simple fraction as one."""
        value = _number_of(node)
        decimal = not any(isinstance(part, ast.Div) for part in ast.walk(node))
        if value is None or abs(value) not in FRACTIONS or (decimal and value.denominator > 4):
            return self.piece(node)
        latex = rf"\tfrac{{{abs(value.numerator)}}}{{{value.denominator}}}"
        text = latex if self.notation.latex else FRACTIONS[abs(value)]
        return Piece((text,), negative=value < 0)

    def matrix_product(self, node: ast.BinOp) -> Piece:
        """Write a matrix product."""
        return self.notation.product(self.piece(node.left), self.piece(node.right))

    def quotient(self, node: ast.BinOp) -> Piece:
        """Write a quotient."""
        return self.notation.quotient(self.piece(node.left), self.piece(node.right))

    def power(self, node: ast.BinOp) -> Piece:
        """Write a power; sin(x)^2 is sin²(x)."""
        exponent = self._inline(node.right)
        match node.left, node.right:
            case ast.Call(func=ast.Name(id=name)) as call, ast.Constant(value=int() as value):
                if name in SQUARED_IN_FRONT and value > 1:
                    return self._call(call, name, exponent)
        base = self.notation.fit(self.piece(node.left), Level.ATOM)
        return Piece((self.notation.power(base, exponent),), Level.POWER)

    def _inline(self, node: ast.expr) -> Piece:
        """Write a node with quotients on the line."""
        return _Walk(self.expression, replace(self.notation, inline=True)).piece(node)

    def _list(self, entries: list[ast.expr]) -> Piece:
        """Write a vector or a matrix."""
        nested = any(isinstance(entry, ast.List) for entry in entries)
        rows = [entry.elts if isinstance(entry, ast.List) else [entry] for entry in entries]
        texts = [[self.notation.signed(self.piece(entry)) for entry in row] for row in rows]
        return self.notation.array(texts, nested)

    def _indexed(self, node: ast.Subscript) -> Piece:
        """Write an entry or a part."""
        at, value = self.notation.at, node.value
        match value:
            case ast.Call(func=ast.Name(id=which), args=[ast.Name() as named]):
                if which in BOUNDARY_FUNCTIONS:
                    at, value = self._end(which), named
        name = value.id if isinstance(value, ast.Name) else ""
        symbol = self.notation.symbols.get(name)
        index = _index_text(subscripts(self.expression, node), symbol.shape if symbol else ())
        if name and index:
            return self.notation.name(name, at, index)
        inner = self.piece(node.value)
        text = self.notation.fit(inner, Level.ATOM) if name else f"({self.notation.signed(inner)})"
        if index:
            return Piece((self.notation.subscripted(text, index),))
        return Piece((f"{text}[{self.expression.source_of(node.slice)}]",))

    def _end(self, which: str) -> Piece:
        """Give the time that `initial` or `final` means."""
        return self.notation.ends[BOUNDARY_FUNCTIONS.index(which)]

    def _call(self, node: ast.Call, name: str, exponent: Piece | None = None) -> Piece:
        """Write a call in the notation of its function."""
        latex, arguments = self.notation.latex, node.args
        if name in BOUNDARY_FUNCTIONS and isinstance(arguments[0], ast.Name):
            return self.notation.name(arguments[0].id, self._end(name))
        if name in FUNCTIONS and FUNCTIONS[name].conditional:
            return self._choice(arguments)
        if name == "interpolate":
            *arguments, table = arguments
            return self._applied(self.piece(table).text, arguments)
        row = NOTATIONS.get(name)
        if row is None:
            head = CALLS.get(name, (name, rf"\operatorname{{{escaped(name)}}}"))[latex]
            return self._applied(
                self.notation.power(head, exponent) if exponent else head, arguments
            )
        pieces = [self._inline(n) if row.inline else self.piece(n) for n in arguments]
        places = zip(pieces, row.arguments, strict=True)
        texts = tuple(self.notation.fit(piece, level) for piece, level in places)
        return Piece((row.forms[latex] % texts,), row.levels[latex])

    def _applied(self, head: str, arguments: Iterable[ast.expr]) -> Piece:
        """Write a function and its arguments in brackets."""
        texts = [self.notation.signed(self.piece(argument)) for argument in arguments]
        return Piece((head + self.notation.bracketed(", ".join(texts)),), Level.CALL)

    def _choice(self, arguments: Sequence[ast.expr]) -> Piece:
        """Write the two cases of if_else."""
        condition = self._condition(arguments[0])
        first, second = (self.notation.signed(self.piece(n)) for n in arguments[1:])
        text = self.notation.sign("if_else") % (first, condition, second)
        return Piece((text,), Level.CHOICE if self.notation.latex else Level.ATOM)

    def _condition(self, node: ast.expr, nested: bool = False) -> str:
        """Write a condition; one inside another has brackets unless it is a comparison."""
        match node:
            case ast.Compare(left=left, comparators=others):
                sides = [self.piece(side) for side in (left, *others)]
                names = comparison_operators(self.expression, node)
                return self.notation.relation(sides, names).text
            case ast.BoolOp(op=op, values=values):
                word = self.notation.sign("and" if isinstance(op, ast.And) else "or")
                text = word.join(self._condition(value, True) for value in values)
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                text = self.notation.sign("not") % self._condition(operand, True)
            case _:
                text = self.notation.signed(self.piece(node))
        return f"({text})" if nested else text


_OPERATIONS: Final[Mapping[type[ast.operator], Callable[[_Walk, ast.BinOp], Piece]]] = {
    ast.Add: _Walk.sum,
    ast.Sub: _Walk.sum,
    ast.Mult: _Walk.product,
    ast.MatMult: _Walk.matrix_product,
    ast.Div: _Walk.quotient,
    ast.Pow: _Walk.power,
}


def _is_array(node: ast.expr, notation: Notation) -> bool:
    """Tell what is surely a vector or matrix by its form and the shapes of its names."""
    parts: list[ast.expr] = []
    match node:
        case ast.Name(id=name):
            return name in notation.symbols and bool(notation.symbols[name].shape)
        case ast.BinOp(left=ast.Name(id=name), op=ast.MatMult()):
            return name in notation.symbols and len(notation.symbols[name].shape) == 2
        case ast.BinOp(left=left, op=op, right=right) if not isinstance(op, ast.MatMult):
            parts = [left, right]
        case ast.UnaryOp(operand=operand):
            parts = [operand]
        case ast.Call(func=ast.Name(id=name), args=arguments):
            row = FUNCTIONS.get(name)
            entrywise = name in BOUNDARY_FUNCTIONS or (row is not None and row.elementwise)
            parts = arguments if entrywise else []
    return isinstance(node, ast.List) or any(_is_array(part, notation) for part in parts)


def _index_text(parts: Iterable[int | slice], shape: tuple[int, ...]) -> str:
    """Write indices counted from 1, or nothing where that takes a size that is not known."""
    sizes = (*shape, None, None)
    texts = [_counted(part, size) for part, size in zip(parts, sizes, strict=False)]
    short = all(len(text) == 1 for text in texts)
    return ("" if short else ",").join(texts) if all(texts) else ""


def _counted(part: int | slice, size: int | None) -> str:
    """Write one index, a range with both its ends."""
    if isinstance(part, int):
        place = part if part >= 0 else part + (size or 0)
        return str(place + 1) if place >= 0 else ""
    bounds = (part.start or 0, -1 if part.stop is None else part.stop)
    if part.step not in {None, 1} or (size is None and min(bounds) < 0):
        return ""
    first, last, _ = part.indices(bounds[1] if size is None else size)
    return f"{first + 1}:{last}"
