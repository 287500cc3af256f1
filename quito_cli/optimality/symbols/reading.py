"""CasADi's expressions as sums: the operations of a function gone through once.

What a sum cannot express becomes an atom: calls with the names of the file's language, powers with
a symbol in the exponent, if_else. Arguments of calls are remembered as sums, for `wording`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from math import isfinite, pi
from typing import TYPE_CHECKING

from quito_cli.optimality.symbols.algebra import Algebra
from quito_cli.optimality.symbols.sums import (
    Sum,
    TooLongError,
    add,
    atom,
    constant_of,
    key,
    number,
    scaled,
)

if TYPE_CHECKING:
    import casadi as ca

MOST_STEPS = 6000
"""Operations of expressions that are still written out."""

CALLS = {
    "SIN": "sin", "COS": "cos", "TAN": "tan", "ASIN": "asin", "ACOS": "acos", "ATAN": "atan",
    "SINH": "sinh", "COSH": "cosh", "TANH": "tanh", "ASINH": "asinh", "ACOSH": "acosh",
    "ATANH": "atanh", "ATAN2": "atan2", "EXP": "exp", "LOG": "log", "FABS": "abs",
    "SIGN": "sign", "FMIN": "min", "FMAX": "max", "ERF": "erf", "POW": "^", "CONSTPOW": "^",
    "LT": "<", "LE": "<=", "EQ": "==", "NE": "!=", "AND": "and", "OR": "or", "NOT": "not",
}  # fmt: skip
"""CasADi's operations and the functions and operators of the language."""


@dataclass
class Reader:
    """Sums and what their atoms stand for."""

    names: Sequence[str]
    """Of all inputs' entries, in order: names of the language, or entries such as x[0]."""
    algebra: Algebra = field(default_factory=Algebra)
    calls: dict[str, tuple[str, tuple[Sum, ...]]] = field(default_factory=dict)
    """By atom: the function or operator, and its arguments."""

    def read(self, inputs: list[ca.SX], values: ca.SX) -> list[Sum]:
        """Return the entries of an expression of `inputs`, whose entries have `names`.

        Raises:
            TooLongError: more operations than MOST_STEPS, or too many terms.
        """
        import casadi as ca

        function = ca.Function("read", inputs, [ca.densify(values)], {"cse": True})
        if function.n_instructions() > MOST_STEPS:
            raise TooLongError
        operations = {getattr(ca, name): name for name in dir(ca) if name.startswith("OP_")}
        starts = [0]
        for given in inputs:
            starts.append(starts[-1] + given.numel())
        work: list[Sum] = [{}] * function.sz_w()
        found: list[Sum] = [{}] * values.numel()
        for i in range(function.n_instructions()):
            name = operations[function.instruction_id(i)].removeprefix("OP_")
            into, at = function.instruction_output(i), function.instruction_input(i)
            if name == "CONST":
                work[into[0]] = constant(function.instruction_constant(i))
            elif name == "INPUT":
                work[into[0]] = atom(self.names[starts[at[0]] + at[1]])
            elif name == "OUTPUT":
                found[into[1]] = work[at[0]]
            else:
                work[into[0]] = self._apply(name, [work[j] for j in at])
        return found

    def _apply(self, name: str, given: list[Sum]) -> Sum:
        """Return the value of an operation; one without a row in the tables is a call."""
        if name in ARITHMETIC:
            return ARITHMETIC[name](self.algebra, given)
        exponent = constant_of(given[1]) if name in {"POW", "CONSTPOW"} else None
        if exponent is not None:
            return self.algebra.power(given[0], exponent)
        if name == "IF_ELSE_ZERO":
            return self._call("if_else", [*given, {}]) if given[1] else {}
        return self._call(CALLS.get(name, name.lower()), given)

    def _call(self, function: str, given: list[Sum]) -> Sum:
        """Return a call as an atom; odd functions have the sign in front."""
        sign = 1
        if function in {"sin", "tan", "atan", "sinh", "tanh", "asinh"} and given[0]:
            sign = -1 if all(c < 0 for c in given[0].values()) else 1
            given = [scaled(given[0], sign)]
        name = f"{function}({', '.join(key(value) for value in given)})"
        self.calls[name] = (function, tuple(given))
        return {((name, Fraction(1)),): Fraction(sign)}


def constant(value: float) -> Sum:
    """Return a number as a fraction that people write, or as a multiple of π.

    Raises:
        TooLongError: a value that is not finite.
    """
    if not isfinite(value):
        raise TooLongError
    near = Fraction(value).limit_denominator(1000)
    if abs(value) < 1e6 and abs(float(near) - value) <= 1e-14 * abs(value):
        return number(near)
    turns = Fraction(value / pi).limit_denominator(48)
    if 0 < abs(turns) < 100 and abs(float(turns) * pi - value) <= 1e-14 * abs(value):
        return scaled(atom("pi"), turns)
    return number(Fraction(f"{value:.14g}"))


def _quotient(algebra: Algebra, given: list[Sum]) -> Sum:
    return algebra.product(given[0], algebra.power(given[1], Fraction(-1)))


ARITHMETIC: dict[str, Callable[[Algebra, list[Sum]], Sum]] = {
    "ADD": lambda _, given: add(given[0], given[1]),
    "SUB": lambda _, given: add(given[0], scaled(given[1], -1)),
    "NEG": lambda _, given: scaled(given[0], -1),
    "TWICE": lambda _, given: scaled(given[0], 2),
    "ASSIGN": lambda _, given: given[0],
    "MUL": lambda algebra, given: algebra.product(given[0], given[1]),
    "DIV": _quotient,
    "INV": lambda algebra, given: algebra.power(given[0], Fraction(-1)),
    "SQ": lambda algebra, given: algebra.power(given[0], Fraction(2)),
    "HYPOT": lambda algebra, given: algebra.power(
        add(*(algebra.power(value, Fraction(2)) for value in given)), Fraction(1, 2)
    ),
    "SQRT": lambda algebra, given: algebra.power(given[0], Fraction(1, 2)),
}
