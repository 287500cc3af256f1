"""Expressions of the problem file: text -> checked syntax tree -> CasADi SX.

This is the door to it: `parse` and `parse_comparison` check the text (`tokens`, `order`, `syntax`),
`evaluate` and `constant` give it a value (`evaluation`).

A value is a dense matrix; a vector is a column, a list of scalars is one, and a list of lists is a
matrix, rows as written. Scalars go with every shape; `*` works entry by entry, `@` is the product.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final

from quito_cli.problem.language.evaluation import Budget, Evaluation
from quito_cli.problem.language.names import is_valid_name
from quito_cli.problem.language.syntax import Comparison, Expression, parse, parse_comparison
from quito_cli.problem.language.tokens import ExpressionError

if TYPE_CHECKING:
    import numpy as np
    from casadi import SX
    from numpy.typing import NDArray

    from quito_cli.problem.language.tables import TableData

__all__ = [
    "Budget",
    "Comparison",
    "Expression",
    "ExpressionError",
    "constant",
    "evaluate",
    "is_valid_name",
    "parse",
    "parse_comparison",
]

_NOTHING: Final[Mapping[str, Any]] = MappingProxyType({})


def evaluate(
    expression: Expression,
    scope: Mapping[str, SX],
    *,
    refused: Mapping[str, str] = _NOTHING,
    initial: Mapping[str, SX] | None = None,
    final: Mapping[str, SX] | None = None,
    tables: Mapping[str, TableData] = _NOTHING,
    budget: Budget | None = None,
    lookups: list[tuple[TableData, SX]] | None = None,
) -> SX:
    """Give the value of an expression as a dense SX matrix.

    Args:
        expression: what `parse` gave, or a side of a comparison.
        scope: the values of the names; `pi` is always known.
        refused: names that exist but are not allowed here, each with the reason as a message.
        initial: what `initial(name)` stands for; None where it has no meaning.
        final: the same for `final(name)`.
        tables: what `interpolate(x, name)` may read.
        budget: what all formulas of a file may cost together; None for one by itself.
        lookups: where to note which tables are read, and at what.

    Raises:
        ExpressionError: for an unknown name, shapes that do not fit, or too much work.
    """
    boundary = {"initial": initial, "final": final}
    notes = [] if lookups is None else lookups
    walk = Evaluation(expression, scope, refused, boundary, tables, budget or Budget(), notes)
    return walk.value(expression.tree)


def constant(
    expression: Expression,
    scope: Mapping[str, SX],
    *,
    refused: Mapping[str, str] = _NOTHING,
    tables: Mapping[str, TableData] = _NOTHING,
) -> float | NDArray[np.float64]:
    """Give the value of an expression of numbers: a float, a vector (1-D) or a matrix (2-D).

    Raises:
        ExpressionError: as `evaluate`, and for a value that has symbols in it or is not finite.
    """
    import casadi
    import numpy as np

    value = evaluate(expression, scope, refused=refused, tables=tables)
    if not value.is_constant():
        nodes = [node for node in ast.walk(expression.tree) if isinstance(node, ast.Name)]
        free = [node for node in nodes if node.id in scope and not scope[node.id].is_constant()]
        first = min(free, key=lambda node: node.col_offset)
        raise expression.error(f"a constant is expected, and '{first.id}' is none", first)
    numbers: NDArray[np.float64] = casadi.DM(value).full()
    if not np.isfinite(numbers).all():
        wrong = numbers[~np.isfinite(numbers)][0]
        raise expression.error(f"the value is not finite: {wrong}", expression.tree)
    if value.numel() == 1:
        return float(numbers[0, 0])
    return numbers[:, 0] if value.shape[1] == 1 else numbers
