"""Values of the file as mathematics: numbers, formulas, vectors and matrices; and the notation.

What cannot be read as a formula is printed as it stands.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final

from quito_cli.problem.language.syntax import Expression, parse
from quito_cli.problem.language.tokens import ExpressionError
from quito_cli.problem.mathematics.formulas import formula
from quito_cli.problem.mathematics.notation import Level, Notation, Piece
from quito_cli.problem.mathematics.symbols import escaped, read_symbols
from quito_cli.problem.schema import Parameter, Problem, Variable

LONGEST: Final = 8
"""Entries of a vector, rows of a matrix, and members of a list that are written out."""


def notation_of(problem: Problem, latex: bool) -> Notation:
    """Give the symbols of a problem and its horizon."""
    fixed = {**problem.constants, **problem.tables}
    variables: dict[str, Variable] = {**problem.states, **problem.controls}
    sized: dict[str, Variable | Parameter] = {**variables, **problem.parameters}
    moving = [*variables, *problem.expressions]
    shapes = {name: _shape(given) for name, given in fixed.items()}
    shapes |= dict.fromkeys(moving, ())
    shapes |= {name: () if spec.size is None else (spec.size,) for name, spec in sized.items()}
    zero = Piece(("0",))
    bare = Notation(latex, read_symbols(shapes), frozenset(moving), (zero, zero), inline=True)
    names = ("t_0", "t_f") if latex else ("t₀", "t_f")
    times = (problem.time.initial, problem.time.final)
    start, end = (
        value(bare, time) if isinstance(time, int | float | str) else Piece((name,))
        for time, name in zip(times, names, strict=True)
    )
    return replace(bare, ends=(start, end), inline=False)


def value(notation: Notation, given: Any) -> Piece:
    """Write a number, a formula, or a list of them or of rows."""
    if isinstance(given, int | float):
        return notation.number(given)
    if not isinstance(given, list):
        expression = read(given)
        return formula(notation, expression) if expression else literal(notation, given)
    shape = _shape(given)
    if max(shape, default=0) > LONGEST:
        size = (r" \times " if notation.latex else "×").join(map(str, shape))
        noun = " matrix" if len(shape) == 2 else "-vector"
        return Piece((size + (rf"\text{{{noun}}}" if notation.latex else noun),))
    notation = replace(notation, inline=True)
    rows = [entry if isinstance(entry, list) else [entry] for entry in given]
    texts = [[notation.signed(value(notation, entry)) for entry in row] for row in rows]
    return notation.array(texts, len(shape) == 2)


def inline_value(notation: Notation, given: Any) -> Piece:
    """Write a value among others on a line, where a fraction would be too high."""
    return value(replace(notation, inline=True), given)


def read(text: object) -> Expression | None:
    """Read a formula, or give None for what is none."""
    try:
        return parse(str(text))
    except ExpressionError:
        return None


def literal(notation: Notation, text: object) -> Piece:
    """Print what cannot be read as it stands."""
    plain = " ".join(str(text).split())
    return Piece(
        (rf"\text{{\ttfamily {escaped(plain)}}}" if notation.latex else plain,), Level.CHOICE
    )


def _shape(given: Any) -> tuple[int, ...]:
    """Give the shape of a list of numbers or of rows."""
    if not isinstance(given, list):
        return ()
    return (len(given), len(given[0])) if given and isinstance(given[0], list) else (len(given),)
