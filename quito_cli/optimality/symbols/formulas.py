"""Derived formulas in the problem's own symbols: CasADi expressions in, printed pieces out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

from quito_cli.optimality.hamiltonian import Pontryagin
from quito_cli.optimality.symbols.reading import Reader
from quito_cli.optimality.symbols.sums import Sum, TooLongError, number
from quito_cli.optimality.symbols.wording import Writer
from quito_cli.optimality.transversality import Transversality
from quito_cli.problem.language.syntax import parse
from quito_cli.problem.language.tokens import ExpressionError
from quito_cli.problem.mathematics import notation_of
from quito_cli.problem.mathematics.formulas import formula
from quito_cli.problem.mathematics.notation import Notation, Piece
from quito_cli.problem.mathematics.symbols import SUBSCRIPTS, Symbol
from quito_cli.problem.model import Variable, labels
from quito_cli.problem.schema import Problem

if TYPE_CHECKING:
    import casadi as ca

UNREADABLE = (TooLongError, ZeroDivisionError, RecursionError)
"""What reading and writing a formula may end with: too long, undefined, or nested too deeply."""
LINE = 100
"""Characters of a fraction that goes on one line."""


@dataclass(frozen=True)
class Attached(Symbol):
    """A letter with the symbol of something for its subscript, as the costate λ of x₁."""

    of: str = ""
    """The subscript in unicode, its letters not lowered."""
    of_latex: str = ""

    def entry(self, index: str) -> Symbol | None:
        """Give the symbol of an entry: the subscript's own index follows it."""
        latex = f"{{{self.of_latex}}}_{{{index}}}"
        return replace(self, shape=(), bold=False, of=self.of + index, of_latex=latex)

    def _unicode(self) -> str:
        base = super()._unicode()
        lowered = self.of.translate(SUBSCRIPTS)
        plain = any(a == b for a, b in zip(self.of, lowered, strict=True))
        return base + (f"_{self.of}" if plain else lowered)

    def _latex(self) -> str:
        return f"{super()._latex()}_{{{self.of_latex}}}"


@dataclass(frozen=True, eq=False)
class Formulas:
    """How one problem's derivation is written; every method takes expressions of `arguments`."""

    system: Pontryagin
    ends: Transversality
    notation: Notation
    costates: tuple[str, ...]
    """A name of the language for each entry of λ."""
    names: tuple[str, ...]
    """Of all arguments and constants, in order."""
    integrals: tuple[str, ...]
    """A name of the language for each multiplier ν."""
    end_names: tuple[str, ...]
    """Of the values at both ends, parameters, ω and constants."""

    @cached_property
    def inputs(self) -> list[ca.SX]:
        """Symbols that `names` name."""
        return [*self.system.arguments, self.system.constants.symbols]

    @cached_property
    def end_inputs(self) -> list[ca.SX]:
        """Symbols that `end_names` name."""
        ends, m = self.system.model.ends, self.system.model
        times = [ends.x0, ends.t0, ends.xf, ends.tf, m.p]
        return [*times, self.ends.boundary_multipliers, self.system.constants.symbols]

    def values(self, expression: ca.SX) -> list[Piece | None]:
        """Write the entries of an expression; None for one too long to read."""
        return self._written(self.names, self.inputs, expression, together=False)

    def quotients(self, expression: ca.SX) -> list[Piece | None]:
        """Write entries each as one fraction in lowest terms."""
        return self._written(self.names, self.inputs, expression, together=True)

    def fraction(self, expression: ca.SX) -> tuple[Piece | None, Piece | None]:
        """Write numerator and denominator of a scalar whose fraction is too long for one line.

        None and None where there is no denominator, or the whole is short, or too long to read.
        """
        reader = Reader(self.names)
        writer = self._writer(reader)
        try:
            (value,) = reader.read(self.inputs, expression)
            above, below = reader.algebra.fraction(value, number(1))
            if len(below) == 1 or len(writer.quotient(above, below)) <= LINE:
                return None, None
            return self.piece(writer.text(above)), self.piece(writer.text(below))
        except UNREADABLE:
            return None, None

    def numerator(self, expression: ca.SX) -> Piece | None:
        """Write what is zero where a scalar is."""
        try:
            reader = Reader(self.names)
            (value,) = reader.read(self.inputs, expression)
            above, _ = reader.algebra.fraction(value, number(1))
            return self.piece(self._writer(reader).factors(above))
        except UNREADABLE:
            return None

    def at_ends(self, expression: ca.SX) -> list[Piece | None]:
        """Write the entries of an expression of values at the ends."""
        return self._written(self.end_names, self.end_inputs, expression, together=False)

    def text(self, expression: ca.SX) -> str | None:
        """Return a scalar as a formula of the language; None for one too long to read."""
        reader = Reader(self.names)
        try:
            return self._writer(reader).text(reader.read(self.inputs, expression)[0])
        except UNREADABLE:
            return None

    def _written(
        self, names: Sequence[str], inputs: list[ca.SX], expression: ca.SX, *, together: bool
    ) -> list[Piece | None]:
        reader = Reader(names)
        try:
            sums = reader.read(inputs, expression)
        except UNREADABLE:
            if expression.numel() == 1:
                return [None]
            parts = [expression[i] for i in range(expression.numel())]
            return [self._written(names, inputs, p, together=together)[0] for p in parts]
        writer = self._writer(reader)
        return [self._safely(reader, writer, value, together) for value in sums]

    def _safely(self, reader: Reader, writer: Writer, value: Sum, together: bool) -> Piece | None:
        try:
            if together:
                return self.piece(writer.quotient(*reader.algebra.fraction(value, number(1))))
            return self.piece(writer.text(value))
        except UNREADABLE:
            return None

    def _writer(self, reader: Reader) -> Writer:
        k = self.system.constants.names
        return Writer(reader, [*k, *self.costates, *self.names], self.costates)

    def piece(self, text: str) -> Piece | None:
        """Write a formula of the language; None where it is none, or too long."""
        try:
            return formula(self.notation, parse(text))
        except ExpressionError:
            return None


def formulas(problem: Problem, system: Pontryagin, ends: Transversality, latex: bool) -> Formulas:
    """Return how the derivation of a problem is written."""
    m = system.model
    notation = notation_of(problem, latex)
    taken = set(notation.symbols)
    symbols = dict(notation.symbols)

    def attach(letter: str, prefix: str, name: str, shape: tuple[int, ...] = ()) -> str:
        """Add the symbol of a letter with a name below it."""
        own = _unused(f"{prefix}_{name}", taken)
        of = notation.symbols.get(name) or Symbol(name, literal=True)
        plain = Symbol(of.base, (), of.accents).text(False) + "".join(of.subscripts)
        symbols[own] = Attached(
            *(letter, (), (), shape), bold=bool(shape), of=plain, of_latex=of.text(True)
        )
        return own

    costates = [attach("lambda", "costate", v.name, _shape(v)) for v in m.states]
    entries = [
        f"{name}[{i}]" if v.vector else name
        for name, v in zip(costates, m.states, strict=True)
        for i in range(v.size)
    ]
    nu = [attach("nu", "integral", c.name) for c in m.constraints.integral]
    omega = [
        attach("omega", "boundary", label) for c in m.constraints.boundary for label in c.labels
    ]
    mu = [_unused(f"multiplier_{i}", taken) for i in range(len(system.rows))]
    k, p = system.constants.names, labels(m.parameters)
    notation = replace(notation, symbols=symbols, moving=notation.moving | frozenset(costates))
    names = (*labels(m.states), *entries, *labels(m.controls), *p, "t", *mu, *nu, *k)
    first, last = (_at(which, m.states) for which in ("initial", "final"))
    end_names = (*first, "initial(t)", *last, "final(t)", *p, *omega, *k)
    return Formulas(system, ends, notation, tuple(entries), names, tuple(nu), end_names)


def _unused(name: str, taken: set[str]) -> str:
    """Return a name of the language that nothing has yet."""
    name = "".join(c if c.isalnum() and c.isascii() else "_" for c in name)
    while name in taken:
        name += "_"
    taken.add(name)
    return name


def _shape(variable: Variable) -> tuple[int, ...]:
    return (variable.size,) if variable.vector else ()


def _at(which: str, variables: tuple[Variable, ...]) -> list[str]:
    """Return the names of values at an end."""
    return [
        f"{which}({v.name})[{i}]" if v.vector else f"{which}({v.name})"
        for v in variables
        for i in range(v.size)
    ]
