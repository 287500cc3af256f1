"""The functions an expression may call: a table with one row each.

A row says how many arguments a function takes and builds its value out of CasADi matrices; nothing
else knows a function by name, so that a new one is a new row. The operands are dense SX matrices;
a vector is a column. Whatever a row cannot work with it refuses with a ValueError in plain words,
and the caller knows where in the text the call stands.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from casadi import SX

    Apply = Callable[[Sequence[Any]], SX]  # matrices, and a table where a row is tabular

MAX_ENTRIES: Final = 10_000
MAX_SYMBOLIC_INVERSE: Final = 12
MAX_NUMERIC_INVERSE: Final = 50

BOUNDARY_FUNCTIONS: Final = ("initial", "final")
"""Not in the table: they look up a value of a name instead of computing with one."""


@dataclass(frozen=True)
class FunctionRow:
    """One function: its name, how many arguments it takes (None: no upper limit), and its value."""

    name: str
    arguments: tuple[int, int | None]
    apply: Apply
    doc: str
    elementwise: bool = False
    """The arguments have one shape, scalars aside; checked before `apply`."""
    conditional: bool = False
    """The first argument is a condition, not a value."""
    cubic: bool = False
    """The work grows with the third power of the number of rows."""
    tabular: bool = False
    """The last argument is the name of a table, and `apply` gets that table."""

    def count_message(self, given: int) -> str | None:
        """Say what is wrong with this number of arguments, or None."""
        least, most = self.arguments
        if given >= least and (most is None or given <= most):
            return None
        bound = f"{least} or more" if most is None else str(least)
        noun = "argument" if bound == "1" else "arguments"
        return f"{self.name} takes {bound} {noun}, not {given}"


def shape_text(value: SX) -> str:
    """Spell a shape as rows times columns."""
    return f"{value.shape[0]}x{value.shape[1]}"


def check_one_shape(values: Sequence[SX]) -> None:
    """Refuse operands of different shapes; a scalar goes with every shape."""
    shapes = {value.shape: shape_text(value) for value in values if value.numel() != 1}
    if len(shapes) > 1:
        raise ValueError(f"the shapes {' and '.join(shapes.values())} do not fit together")


def _check_vector(name: str, value: SX) -> None:
    """Refuse a matrix where a vector is meant."""
    if min(value.shape) != 1:
        raise ValueError(f"{name} takes a vector, not a {shape_text(value)} matrix")


def _check_square(name: str, value: SX) -> None:
    """Refuse to invert what has no inverse, or one too large to write out."""
    if value.shape[0] != value.shape[1]:
        raise ValueError(f"{name} takes a square matrix, not one of {shape_text(value)}")
    limit = MAX_NUMERIC_INVERSE if value.is_constant() else MAX_SYMBOLIC_INVERSE
    if value.shape[0] > limit:
        size = f"{limit}x{limit}"
        kind = "numbers" if value.is_constant() else "symbols"
        raise ValueError(f"{name} takes matrices of {kind} up to {size}, not {shape_text(value)}")


def _casadi(name: str) -> Apply:
    """Give the CasADi function of that name, looked up when it is first needed."""

    def apply(arguments: Sequence[SX]) -> SX:
        import casadi

        value: SX = getattr(casadi, name)(*arguments)
        return value

    return apply


def _extremum(name: str, pairwise: str) -> Apply:
    """Give `min` or `max`: of two or more operands entry by entry, or over one vector."""

    def apply(arguments: Sequence[SX]) -> SX:
        import casadi

        operands = list(arguments)
        if len(operands) == 1:
            if operands[0].numel() == 1:
                raise ValueError(f"{name} takes two or more arguments, or one vector")
            _check_vector(name, operands[0])
            operands = [operands[0][i] for i in range(operands[0].numel())]
        check_one_shape(operands)
        value = operands[0]
        for operand in operands[1:]:
            value = getattr(casadi, pairwise)(value, operand)
        return value

    return apply


def _dot(arguments: Sequence[SX]) -> SX:
    """Sum the products of two operands of one shape."""
    import casadi

    left, right = arguments
    if left.shape != right.shape:
        shapes = f"{shape_text(left)} and {shape_text(right)}"
        raise ValueError(f"dot takes two vectors of one size, not {shapes}")
    return casadi.dot(left, right)


def _cross(arguments: Sequence[SX]) -> SX:
    """Give the vector product in three dimensions."""
    import casadi

    for vector in arguments:
        if vector.shape != (3, 1):
            raise ValueError(f"cross takes vectors of 3 entries, not {shape_text(vector)}")
    return casadi.cross(arguments[0], arguments[1])


def _norm(arguments: Sequence[SX]) -> SX:
    """Give the Euclidean length."""
    import casadi

    _check_vector("norm", arguments[0])
    return casadi.norm_2(arguments[0])


def _sum(arguments: Sequence[SX]) -> SX:
    """Sum the entries of a vector."""
    import casadi

    _check_vector("sum", arguments[0])
    return casadi.sum(arguments[0])


def _transpose(arguments: Sequence[SX]) -> SX:
    """Exchange rows and columns."""
    return arguments[0].T


def _diag(arguments: Sequence[SX]) -> SX:
    """Put a vector on a diagonal, or take the diagonal of a matrix."""
    import casadi

    value = arguments[0]
    size = value.numel()
    if min(value.shape) == 1 and size * size > MAX_ENTRIES:
        raise ValueError(f"diag of {size} entries is a matrix of more than {MAX_ENTRIES} entries")
    if min(value.shape) != 1 and value.shape[0] != value.shape[1]:
        raise ValueError(f"diag takes a vector or a square matrix, not {shape_text(value)}")
    return casadi.diag(value if value.shape[0] >= value.shape[1] else value.T)


def _inv(arguments: Sequence[SX]) -> SX:
    """Invert a matrix."""
    import casadi

    _check_square("inv", arguments[0])
    return _solved(arguments[0], casadi.SX.eye(arguments[0].shape[0]))


def _solve(arguments: Sequence[SX]) -> SX:
    """Solve A x = b for x."""
    matrix, right = arguments
    _check_square("solve", matrix)
    if right.shape[0] != matrix.shape[0]:
        shapes = f"{shape_text(matrix)} and {shape_text(right)}"
        raise ValueError(f"solve(A, b) takes as many rows of b as of A, not {shapes}")
    return _solved(matrix, right)


def _solved(matrix: SX, right: SX) -> SX:
    """Solve by LAPACK where the matrix is of numbers, else by CasADi's QR factors written out."""
    import casadi
    import numpy as np

    if not matrix.is_constant():
        return casadi.solve(matrix, right)
    numbers = casadi.DM(matrix).full()
    try:
        inverse = np.linalg.inv(numbers)
        if right.is_constant():
            return casadi.SX(np.linalg.solve(numbers, casadi.DM(right).full()))
    except np.linalg.LinAlgError as error:
        raise ValueError("the matrix is singular") from error
    return casadi.mtimes(casadi.SX(inverse), right)


def _interpolate(arguments: Sequence[Any]) -> SX:
    """Read a table at every entry of a value."""
    at, table = arguments
    value: SX = table(at)
    return value


def _elementary(name: str, doc: str, casadi_name: str | None = None) -> FunctionRow:
    """Give the row of a function of one argument that works entry by entry."""
    return FunctionRow(name, (1, 1), _casadi(casadi_name or name), doc, elementwise=True)


_ROWS: Final = (
    _elementary("sin", "sine of an angle in radians"),
    _elementary("cos", "cosine of an angle in radians"),
    _elementary("tan", "tangent of an angle in radians"),
    _elementary("asin", "inverse sine, in radians"),
    _elementary("acos", "inverse cosine, in radians"),
    _elementary("atan", "inverse tangent, in radians"),
    _elementary("sinh", "hyperbolic sine"),
    _elementary("cosh", "hyperbolic cosine"),
    _elementary("tanh", "hyperbolic tangent"),
    _elementary("asinh", "inverse hyperbolic sine"),
    _elementary("acosh", "inverse hyperbolic cosine"),
    _elementary("atanh", "inverse hyperbolic tangent"),
    FunctionRow("atan2", (2, 2), _casadi("atan2"), "angle of the point (x, y): atan2(y, x)", True),
    _elementary("exp", "exponential function"),
    _elementary("log", "natural logarithm"),
    _elementary("sqrt", "square root"),
    _elementary("abs", "absolute value", "fabs"),
    _elementary("sign", "-1, 0 or 1"),
    FunctionRow("min", (1, None), _extremum("min", "fmin"), "smallest argument, or of a vector"),
    FunctionRow("max", (1, None), _extremum("max", "fmax"), "largest argument, or of a vector"),
    _elementary("erf", "error function"),
    FunctionRow(
        "if_else",
        (3, 3),
        _casadi("if_else"),
        "if_else(condition, a, b): a where the condition holds, else b",
        elementwise=True,
        conditional=True,
    ),
    FunctionRow(
        "interpolate",
        (2, 2),
        _interpolate,
        "interpolate(x, table): the value at x of a table of the problem",
        tabular=True,
    ),
    FunctionRow("dot", (2, 2), _dot, "sum of the products of two vectors"),
    FunctionRow("cross", (2, 2), _cross, "vector product in three dimensions"),
    FunctionRow("norm", (1, 1), _norm, "Euclidean length of a vector"),
    FunctionRow("sum", (1, 1), _sum, "sum of the entries of a vector"),
    FunctionRow("transpose", (1, 1), _transpose, "rows and columns exchanged"),
    FunctionRow("inv", (1, 1), _inv, "inverse of a matrix", cubic=True),
    FunctionRow("solve", (2, 2), _solve, "x with A x = b: solve(A, b)", cubic=True),
    FunctionRow("diag", (1, 1), _diag, "vector to diagonal matrix, matrix to its diagonal"),
)

FUNCTIONS: Final[Mapping[str, FunctionRow]] = MappingProxyType({row.name: row for row in _ROWS})
