"""The value of a checked formula: one walk over its tree, giving CasADi SX.

The tree is walked, never run as Python. All arithmetic is that of doubles inside CasADi, so that a
tower of powers overflows to infinity at once, and the work a formula may cause is capped, for a
problem file can come from anywhere.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import reduce
from typing import TYPE_CHECKING, Final

from quito_cli.problem.language.functions import (
    FUNCTIONS,
    MAX_ENTRIES,
    FunctionRow,
    check_one_shape,
    shape_text,
)
from quito_cli.problem.language.hints import About
from quito_cli.problem.language.names import KNOWN_CONSTANTS, nearest
from quito_cli.problem.language.operations import COMPARE, operate, product_work, take
from quito_cli.problem.language.syntax import Expression, comparison_operators, subscripts
from quito_cli.problem.language.tokens import ExpressionError

if TYPE_CHECKING:
    from casadi import SX

    from quito_cli.problem.language.tables import TableData

MAX_WORK_IN_ALL: Final = 1_000_000
"""Scalar operations that all formulas of a file may write out."""
MAX_WORK: Final = 200_000
"""Scalar operations that one expression may write out."""


@dataclass
class Budget:
    """What the formulas of a file have cost so far."""

    spent: int = 0

    @property
    def exhausted(self) -> bool:
        """Whether nothing more is to be evaluated."""
        return self.spent > MAX_WORK_IN_ALL


@dataclass
class Evaluation:
    """One walk over a checked tree; its fields are the arguments of `evaluate`."""

    expression: Expression
    scope: Mapping[str, SX]
    refused: Mapping[str, str]
    boundary: Mapping[str, Mapping[str, SX] | None]
    tables: Mapping[str, TableData]
    budget: Budget
    lookups: list[tuple[TableData, SX]]
    work: int = 0

    def value(self, node: ast.expr) -> SX:
        """Give the value of a node and count what it cost."""
        import casadi

        match node:
            case ast.Constant(value=int() | float() as number):
                result = casadi.SX(float(number))
            case ast.Name():
                result = self._name(node)
            case ast.UnaryOp(op=ast.UAdd() | ast.USub() as sign, operand=operand):
                result = self.value(operand)
                result = -result if isinstance(sign, ast.USub) else result
            case ast.BinOp():
                result = self._operation(node)
            case ast.List():
                result = self._list(node)
            case ast.Subscript():
                result = self._indexed(node)
            case ast.Call(func=ast.Name(id=name)):
                result = self._call(node, name)
            case _:
                raise self._error("this is not allowed in an expression", node)
        self._spend(result.numel(), node)
        if result.numel() > MAX_ENTRIES:
            raise self._error(f"a matrix of {shape_text(result)} is too large", node)
        return casadi.densify(result)

    def _error(self, message: str, node: ast.expr) -> ExpressionError:
        """Give the complaint that points at a node."""
        return self.expression.error(message, node)

    def _spend(self, work: int, node: ast.expr) -> None:
        """Count work that is about to be done, and stop before it is too much."""
        self.work += work
        if self.work > MAX_WORK:
            message = f"the expression is too large: it takes more than {MAX_WORK} operations"
            raise self._error(message, node)
        self.budget.spent += work
        if self.budget.exhausted:
            message = f"the formulas so far take more than {MAX_WORK_IN_ALL} operations together"
            raise self._error(message, node)

    def _name(self, node: ast.Name) -> SX:
        """Look a name up."""
        import casadi

        name = node.id
        if name in self.refused:
            raise self._error(self.refused[name], node)
        if name in self.scope:
            return self.scope[name]
        if name == "pi":
            return casadi.SX(math.pi)
        if name in self.tables:
            raise self._error(f"'{name}' is a table: write interpolate(x, {name})", node)
        known = (*self.scope, *self.tables)
        message = f"unknown name '{name}'{nearest(name, known, 0.5)}"
        raise self.expression.error(message, node, About("name", name))

    def _boundary_value(self, node: ast.Call, which: str) -> SX:
        """Look up what initial(name) or final(name) stands for."""
        values, argument = self.boundary[which], node.args[0]
        if values is None:
            home = "boundary constraints and the Mayer cost"
            raise self._error(f"{which}() belongs to {home}; it has no meaning here", node)
        name = argument.id if isinstance(argument, ast.Name) else ""
        if name in values:
            return values[name]
        if name in self.refused:
            raise self._error(self.refused[name], argument)
        if name in self.scope or name in self.tables or name in KNOWN_CONSTANTS:
            raise self._error(f"'{name}' has no {which} value: it is not a state", argument)
        raise self._error(f"unknown name '{name}'{nearest(name, values, 0.5)}", argument)

    def _call(self, node: ast.Call, name: str) -> SX:
        """Apply a row of the table of functions."""
        if name in self.boundary:
            return self._boundary_value(node, name)
        row = FUNCTIONS[name]
        if row.tabular:
            return self._tabular(node, row)
        given = node.args
        first = [self._condition(given[0])] if row.conditional else []
        arguments = first + [self.value(argument) for argument in given[len(first) :]]
        rows = arguments[0].shape[0]
        self._spend(rows**3 if row.cubic else sum(a.numel() for a in arguments), node)
        try:
            if row.elementwise:
                check_one_shape(arguments)
            return row.apply(arguments)
        except ValueError as error:
            raise self._error(str(error), node) from error

    def _tabular(self, node: ast.Call, row: FunctionRow) -> SX:
        """Apply a row that reads a table."""
        at, name = self.value(node.args[0]), self.expression.source_of(node.args[-1])
        if name not in self.tables:
            hint = nearest(name, self.tables, 0.5)
            hint = hint or ": measured data are given by name under `tables:`"
            raise self._error(f"'{name}' is no table{hint}", node.args[-1])
        self._spend(at.numel() * self.tables[name].operations, node)
        self.lookups.append((self.tables[name], at))
        return row.apply([at, self.tables[name]])

    def _condition(self, node: ast.expr) -> SX:
        """Give the truth of a condition, 0 or 1."""
        import casadi

        match node:
            case ast.BoolOp(op=op, values=values):
                join = casadi.logic_and if isinstance(op, ast.And) else casadi.logic_or
                return reduce(join, [self._condition(value) for value in values])
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return casadi.logic_not(self._condition(operand))
            case ast.Compare(left=left, comparators=others):
                sides = [self._scalar(side) for side in (left, *others)]
                names = comparison_operators(self.expression, node)
                pairs = zip(names, sides[:-1], sides[1:], strict=True)
                return reduce(casadi.logic_and, (COMPARE[name](a, b) for name, a, b in pairs))
        raise self._error("the condition of if_else is a comparison, such as x > 0", node)

    def _scalar(self, node: ast.expr) -> SX:
        """Give the value of a side of a comparison."""
        value = self.value(node)
        if value.numel() != 1:
            raise self._error(f"a condition compares scalars, not {shape_text(value)}", node)
        return value

    def _list(self, node: ast.List) -> SX:
        """Give a column for a list of scalars, a matrix for a list of lists."""
        import casadi

        rows = [e.elts if isinstance(e, ast.List) else [e] for e in node.elts]
        nested = [isinstance(e, ast.List) for e in node.elts]
        if any(nested) and not all(nested):
            odd = node.elts[nested.index(False)]
            raise self._error("a list holds either scalars or lists of equal length", odd)
        for row, entry in zip(rows, node.elts, strict=True):
            if len(row) != len(rows[0]):
                lengths = f"{len(rows[0])} and {len(row)} entries"
                raise self._error(f"the rows of a matrix are equally long, not {lengths}", entry)
        return casadi.vertcat(*(casadi.horzcat(*map(self._entry, row)) for row in rows))

    def _entry(self, node: ast.expr) -> SX:
        """Give the value of an entry of a list."""
        value = self.value(node)
        if value.numel() != 1:
            raise self._error(f"an entry of a list is a scalar, not {shape_text(value)}", node)
        return value

    def _operation(self, node: ast.BinOp) -> SX:
        """Apply an operator between two values."""
        left, right = self.value(node.left), self.value(node.right)
        if isinstance(node.op, ast.MatMult):
            self._spend(product_work(left, right), node)
        try:
            return operate(type(node.op), left, right)
        except ValueError as error:
            raise self._misfit(error, node) from error

    def _indexed(self, node: ast.Subscript) -> SX:
        """Take an entry or a part of a value."""
        value = self.value(node.value)
        try:
            return take(value, subscripts(self.expression, node))
        except ValueError as error:
            raise self._misfit(error, node) from error

    def _misfit(self, error: ValueError, node: ast.expr) -> ExpressionError:
        """Give the complaint that begins with the user's text of the operation, cut to fit."""
        source = self.expression.source_of(node)
        shown = source if len(source) <= 40 else f"{source[:38]} …"
        return self._error(f"{shown}: {error}", node)
