"""The checked syntax tree of an expression: text in, `Expression` out, nothing evaluated.

The tokens are written out once more for Python's parser with `^` as `**` and one blank between
them, and every character remembers where it came from; that is how a complaint about the tree
finds its way back into the user's text. Of Python's syntax only the node types listed in
`_children` are let through.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from quito_cli.problem.language.functions import BOUNDARY_FUNCTIONS, FUNCTIONS
from quito_cli.problem.language.hints import LISTED, About, function_hint
from quito_cli.problem.language.names import KNOWN_CONSTANTS, nearest
from quito_cli.problem.language.order import MAX_DEPTH, TOO_DEEP, check_order
from quito_cli.problem.language.tokens import ExpressionError, Token, read_tokens

_COMPARISONS: Final = {
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.Eq: "==",
    ast.NotEq: "!=",
}
_ARITHMETIC: Final = (ast.Add, ast.Sub, ast.Mult, ast.Div, ast.Pow, ast.MatMult)
_Place = tuple[ast.expr, bool]
"""A node, and whether a condition has to stand there instead of a value."""


@dataclass(frozen=True)
class Expression:
    """An expression whose syntax is right; its names are not looked up yet.

    A side of a comparison keeps the whole text, so that offsets are those of what the user wrote.
    """

    text: str
    tree: ast.expr
    names: tuple[str, ...]
    """The variables in order of appearance, those inside initial() and final() too."""
    functions: tuple[str, ...]
    """The functions called, `initial` and `final` too, in order of appearance."""
    columns: tuple[int, ...]
    """The offset in `text` of every character that was parsed."""
    tables: tuple[str, ...] = ()
    """The tables read by interpolate(), in order of appearance; they are not among the names."""

    @property
    def source(self) -> str:
        """The part of the text that this expression stands for."""
        return self.source_of(self.tree)

    def span(self, node: ast.expr) -> tuple[int, int]:
        """Give the offset and the length of a node in the user's text."""
        start = self.columns[node.col_offset]
        end = self.columns[(node.end_col_offset or node.col_offset + 1) - 1] + 1
        return start, end - start

    def source_of(self, node: ast.expr) -> str:
        """Give the user's text of a node, on one line."""
        start, length = self.span(node)
        return " ".join(self.text[start : start + length].split())

    def error(self, message: str, node: ast.expr, about: About | None = None) -> ExpressionError:
        """Give the complaint that points at a node."""
        return ExpressionError(message, *self.span(node), about)


@dataclass(frozen=True)
class Comparison:
    """A comparison of two or more sides: `a <= b < c` has three sides and two operators."""

    sides: tuple[Expression, ...]
    operators: tuple[str, ...]


def parse(text: str) -> Expression:
    """Check the syntax of a formula and give its tree.

    Raises:
        ExpressionError: with the place in the text and what was expected there.
    """
    whole = _whole(text)
    return _checked(whole, whole.tree)


def parse_comparison(text: str) -> Comparison:
    """Check the syntax of a constraint, a comparison that may be chained, and give its sides.

    Raises:
        ExpressionError: with the place in the text and what was expected there.
    """
    whole = _whole(text)
    tree = whole.tree
    if not isinstance(tree, ast.Compare):
        if isinstance(tree, ast.BoolOp | ast.UnaryOp) and not _is_value(tree):
            raise whole.error(
                "write conditions that hold together as constraints of their own", tree
            )
        raise whole.error("a comparison is expected here, such as x <= 1", tree)
    sides = tuple(_checked(whole, side) for side in (tree.left, *tree.comparators))
    return Comparison(sides, comparison_operators(whole, tree))


def comparison_operators(expression: Expression, node: ast.Compare) -> tuple[str, ...]:
    """Give the operators of a comparison as text."""
    for operator in node.ops:
        if type(operator) not in _COMPARISONS:
            raise expression.error("this comparison is not allowed", node)
    return tuple(_COMPARISONS[type(operator)] for operator in node.ops)


def subscripts(expression: Expression, node: ast.Subscript) -> tuple[int | slice, ...]:
    """Read the one or two indices in brackets, which have to be whole numbers or slices of them."""
    index = node.slice
    parts = index.elts if isinstance(index, ast.Tuple) else [index]
    if len(parts) > 2:
        raise expression.error("there are at most two indices: row and column", node)
    return tuple(_subscript(expression, part) for part in parts)


def _subscript(expression: Expression, part: ast.expr) -> int | slice:
    """Read one index."""
    if isinstance(part, ast.Slice):
        ends = (part.lower, part.upper, part.step)
        limits = [None if end is None else _whole_number(expression, end) for end in ends]
        if limits[2] == 0:
            raise expression.error("the step of a slice cannot be 0", part)
        return slice(*limits)
    return _whole_number(expression, part)


def _whole_number(expression: Expression, node: ast.expr) -> int:
    """Read a whole number that is written out."""
    match node:
        case ast.Constant(value=value) if type(value) is int:
            return value
        case ast.UnaryOp(op=ast.USub(), operand=ast.Constant(value=value)) if type(value) is int:
            return -value
    raise expression.error("an index is a whole number written out, counted from 0", node)


def _whole(text: str) -> Expression:
    """Parse without a look at the tree, but for its depth."""
    tokens = read_tokens(text)
    check_order(tokens)
    python, columns = _python_text(tokens)
    try:
        tree = ast.parse(python, mode="eval").body
    except SyntaxError as error:
        column = min(max(error.offset or 1, 1), len(columns)) - 1
        offset = min(columns[column], len(text) - 1)
        raise ExpressionError("this cannot be understood here", offset, 1) from error
    except (RecursionError, MemoryError) as error:
        raise ExpressionError(TOO_DEEP, 0, len(text)) from error
    except ValueError as error:
        raise ExpressionError("this cannot be understood", 0, len(text)) from error
    whole = Expression(text, tree, (), (), columns)
    _check_depth(whole)
    return whole


def _python_text(tokens: Iterable[Token]) -> tuple[str, tuple[int, ...]]:
    """Write the tokens for Python's parser, with the original offset of every character."""
    pieces: list[str] = []
    columns: list[int] = []
    for token in tokens:
        text, offset = token.text, token.offset
        if text == "^":
            pieces.append("** ")
            columns += [offset, offset, offset + 1]
        else:
            pieces.append(text + " ")
            columns += range(offset, offset + len(text) + 1)
    return "".join(pieces), tuple(columns)


def _check_depth(whole: Expression) -> None:
    """Refuse a tree on which the evaluation, which recurses, could run out of stack."""
    level: list[ast.AST] = [whole.tree]
    for _ in range(MAX_DEPTH):
        level = [child for node in level for child in ast.iter_child_nodes(node)]
    for node in level:
        if isinstance(node, ast.expr):
            raise whole.error(TOO_DEEP, node)


def _checked(whole: Expression, tree: ast.expr) -> Expression:
    """Hold a tree against the list of what is allowed, and collect its names."""
    names: dict[str, None] = {}
    functions: dict[str, None] = {}
    tables: dict[str, None] = {}
    pending: list[_Place] = [(tree, False)]
    while pending:
        node, condition = pending.pop()
        pending.extend(reversed(_children(whole, node, condition)))
        if isinstance(node, ast.Name):
            names[node.id] = None
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            functions[node.func.id] = None
            tables |= dict.fromkeys(_tables_named(node))
    variables = tuple(name for name in names if name not in KNOWN_CONSTANTS)
    return Expression(whole.text, tree, variables, tuple(functions), whole.columns, tuple(tables))


def _tables_named(call: ast.Call) -> list[str]:
    """Give the name in the last argument of a function that reads a table."""
    row = FUNCTIONS.get(call.func.id) if isinstance(call.func, ast.Name) else None
    last = call.args[-1] if row is not None and row.tabular else None
    return [last.id] if isinstance(last, ast.Name) else []


def _is_value(node: ast.expr) -> bool:
    """Tell values from conditions by the form alone."""
    is_not = isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not)
    return not (is_not or isinstance(node, ast.Compare | ast.BoolOp))


def _check_place(whole: Expression, node: ast.expr, condition: bool) -> None:
    """Refuse a value in place of a condition, and a condition in place of a value."""
    if condition and _is_value(node):
        raise whole.error("the condition of if_else is a comparison, such as x > 0", node)
    if not condition and not _is_value(node):
        raise whole.error("a comparison can only stand in the condition of if_else", node)


def _children(whole: Expression, node: ast.expr, condition: bool) -> list[_Place]:
    """Give the parts of an allowed node; refuse every other kind of node."""
    _check_place(whole, node, condition)
    parts: list[ast.expr] = []
    match node:
        case ast.Constant(value=value) if type(value) in {int, float}:
            pass
        case ast.Name(id=name):
            if name in FUNCTIONS or name in BOUNDARY_FUNCTIONS:
                raise whole.error(f"'{name}' is a function: write {name}(...)", node)
        case ast.BinOp(left=left, op=op, right=right) if isinstance(op, _ARITHMETIC):
            parts = [left, right]
        case ast.UnaryOp(op=ast.UAdd() | ast.USub() | ast.Not(), operand=operand):
            return [(operand, condition)]
        case ast.List(elts=parts):
            pass
        case ast.Subscript(value=indexed):
            subscripts(whole, node)
            parts = [indexed]
        case ast.Compare(left=left, comparators=others):
            comparison_operators(whole, node)
            parts = [left, *others]
        case ast.BoolOp(values=values):
            return [(value, True) for value in values]
        case ast.Call(args=arguments):
            row = FUNCTIONS.get(_function_name(whole, node))
            conditional = row is not None and row.conditional
            values = arguments[:-1] if row is not None and row.tabular else arguments
            return [(value, conditional and i == 0) for i, value in enumerate(values)]
        case _:
            raise whole.error("this is not allowed in an expression", node)
    return [(part, False) for part in parts]


def _function_name(whole: Expression, node: ast.Call) -> str:
    """Check who is called and with how many arguments; give its name."""
    if not isinstance(node.func, ast.Name) or node.keywords:
        raise whole.error("this is not allowed in an expression", node)
    name, given = node.func.id, len(node.args)
    if name in BOUNDARY_FUNCTIONS:
        if given != 1 or not isinstance(node.args[0], ast.Name):
            example = f"as in {name}(t) or {name}(x)[0]"
            raise whole.error(f"{name}() takes a name alone, {example}", node)
        return name
    if name not in FUNCTIONS:
        argument = whole.source_of(node.args[0]) if node.args else ""
        hint = function_hint(name, argument)
        hint = hint or nearest(name, (*FUNCTIONS, *BOUNDARY_FUNCTIONS), 0.7) or LISTED
        about = About("call", name, argument)
        raise whole.error(f"'{name}' is not a function{hint}", node.func, about)
    row = FUNCTIONS[name]
    message = row.count_message(given)
    if message is not None:
        raise whole.error(message, node)
    if row.tabular and not isinstance(node.args[-1], ast.Name):
        message = f"{name}(x, table) takes the name of a table here, and nothing else"
        raise whole.error(message, node.args[-1])
    return name
