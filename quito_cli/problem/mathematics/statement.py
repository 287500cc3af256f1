"""A whole problem as mathematics, the way its paper states it: in unicode or in LaTeX.

    minimise   ½ ∫₀⁴ (x₁² + x₂²) dt    (over u)
    subject to ẋ₁ = x₂, …

How a formula looks is the business of `formulas`; here is what stands where on the page. LaTeX
needs amsmath and nothing else. What cannot be read as a formula is printed as it stands.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import isfinite
from typing import Any, Final

from quito_cli.problem.language.syntax import Comparison, Expression, parse, parse_comparison
from quito_cli.problem.language.tokens import ExpressionError
from quito_cli.problem.mathematics.formulas import formula, integral
from quito_cli.problem.mathematics.notation import Level, Notation, Piece
from quito_cli.problem.mathematics.page import Line, Section, latex_page, unicode_page
from quito_cli.problem.mathematics.symbols import escaped, read_symbols
from quito_cli.problem.schema import Problem

_LONGEST: Final = 8
"""Entries of a vector, rows of a matrix, and members of a list that are written out."""


def render(problem: Problem, *, latex: bool) -> str:
    """Write a problem as mathematics: plain text in unicode, or a LaTeX display with amsmath."""
    lay_out = latex_page if latex else unicode_page
    return lay_out(*statement(problem, latex=latex))


def statement(problem: Problem, *, latex: bool) -> tuple[list[Section], str]:
    """Return the parts of the problem that there are, and the unknowns."""
    page = _Page(problem, notation_of(problem, latex))
    sense = getattr(problem, "sense", "minimize").replace("ize", "ise")
    sections: list[Section] = [
        (sense, [page.objective()]),
        ("subject to", [*page.dynamics(), *page.ends(), *page.bounds(), *page.constraints()]),
        ("where", [*page.definitions(), *page.tables()]),
        ("with", [page.items(page.facts())]),
    ]
    return [section for section in sections if section[1]], page.unknowns()


def notation_of(problem: Problem, latex: bool) -> Notation:
    """Give the symbols of a problem and its horizon."""
    fixed = {**problem.constants, **getattr(problem, "tables", {})}
    sized = {**problem.states, **problem.controls, **getattr(problem, "parameters", {})}
    moving = {**problem.states, **problem.controls, **getattr(problem, "expressions", {})}
    shapes = {name: _shape(value) for name, value in fixed.items()}
    shapes |= dict.fromkeys(moving, ())
    shapes |= {name: () if spec.size is None else (spec.size,) for name, spec in sized.items()}
    zero = Piece(("0",))
    bare = Notation(latex, read_symbols(shapes), frozenset(moving), (zero, zero), inline=True)
    names = ("t_0", "t_f") if latex else ("t₀", "t_f")
    times = (problem.time.initial, problem.time.final)
    start, end = (
        _value(bare, time) if isinstance(time, int | float | str) else Piece((name,))
        for time, name in zip(times, names, strict=True)
    )
    return replace(bare, ends=(start, end), inline=False)


def _shape(value: Any) -> tuple[int, ...]:
    """Give the shape of a list of numbers or of rows."""
    if not isinstance(value, list):
        return ()
    return (len(value), len(value[0])) if value and isinstance(value[0], list) else (len(value),)


def _literal(notation: Notation, text: object) -> Piece:
    """Print what cannot be read as it stands."""
    plain = " ".join(str(text).split())
    return Piece(
        (rf"\text{{\ttfamily {escaped(plain)}}}" if notation.latex else plain,), Level.CHOICE
    )


def _read(text: object) -> Expression | None:
    """Read a formula, or give None for what is none."""
    try:
        return parse(str(text))
    except ExpressionError:
        return None


def _value(notation: Notation, value: Any) -> Piece:
    """Write a number, a formula, or a list of them or of rows."""
    if isinstance(value, int | float):
        return notation.number(value)
    if not isinstance(value, list):
        expression = _read(value)
        return formula(notation, expression) if expression else _literal(notation, value)
    shape = _shape(value)
    if max(shape, default=0) > _LONGEST:
        size = (r" \times " if notation.latex else "×").join(map(str, shape))
        noun = " matrix" if len(shape) == 2 else "-vector"
        return Piece((size + (rf"\text{{{noun}}}" if notation.latex else noun),))
    notation = replace(notation, inline=True)
    rows = [entry if isinstance(entry, list) else [entry] for entry in value]
    texts = [[notation.signed(_value(notation, entry)) for entry in row] for row in rows]
    return notation.array(texts, len(shape) == 2)


@dataclass(frozen=True)
class _Page:
    """The parts of one problem as lines."""

    problem: Problem
    notation: Notation

    def objective(self) -> Line:
        """Write the cost, the Mayer part first."""
        cost, parts = self.problem.cost, []
        if not _is_zero(cost.mayer):
            parts.append(_value(replace(self.notation, at=self.notation.ends[1]), cost.mayer))
        if not _is_zero(cost.lagrange):
            parts.append(self._integral(_read(cost.lagrange), cost.lagrange))
        if not parts:
            return Line(("0",))
        whole = parts[0] if len(parts) == 1 else self._sum(*parts)
        return Line(self.notation.signed_terms(whole))

    def _sum(self, left: Piece, right: Piece) -> Piece:
        """Add an integral, which may be a sum of terms inside and be negative as a whole."""
        first, *others = right.terms
        sign = self.notation.sign("-") if right.negative else "+"
        if left.level == Level.CHOICE:
            left = Piece((self.notation.fit(left, Level.SUM),))
        joined = (*self.notation.signed_terms(left), f"{sign} {first}", *others)
        return Piece(joined, Level.SUM)

    def _integral(self, expression: Expression | None, text: object) -> Piece:
        """Write the integral of a formula, or of what cannot be read."""
        if expression is None:
            return self.notation.integral(_literal(self.notation, text))
        return integral(self.notation, expression)

    def unknowns(self) -> str:
        """Name what is chosen: controls, parameters, free times."""
        names = [*self.problem.controls, *getattr(self.problem, "parameters", {})]
        symbols = [self._symbol(name) for name in names]
        times = (self.problem.time.initial, self.problem.time.final)
        free = [end for end, time in zip(self.notation.ends, times, strict=True) if _is_free(time)]
        return ", ".join(self._shortened([*symbols, *(end.text for end in free)]))

    def dynamics(self) -> Iterator[Line]:
        """Write the differential equations."""
        for name in self.problem.states:
            value = self.problem.dynamics.get(name, "?")
            if isinstance(value, list):
                for i, entry in enumerate(value, start=1):
                    yield self._equation(self._rate(name, str(i)), entry)
            else:
                yield self._equation(self._rate(name, ""), value)

    def _rate(self, name: str, index: str) -> str:
        """Write the derivative of a state or an entry of it."""
        symbol = self.notation.symbols[name]
        entry = symbol.entry(index) if index else symbol
        if entry is not None:
            return entry.derivative(self.notation.latex)
        inner = symbol.derivative(self.notation.latex)
        return self.notation.subscripted(f"({inner})", index)

    def _equation(self, left: str, value: Any) -> Line:
        """Write a definition, to be broken between summands."""
        return Line(self.notation.signed_terms(_value(self.notation, value)), f"{left} = ")

    def ends(self) -> Iterator[Line]:
        """Write the conditions at the initial and at the final time."""
        for which, at in zip(("initial", "final"), self.notation.ends, strict=True):
            conditions: list[str] = []
            for name, state in self.problem.states.items():
                conditions += self._end(name, getattr(state, which), at)
            if conditions:
                yield self.items(conditions)

    def _end(self, name: str, value: Any, at: Piece) -> list[str]:
        """Write the conditions on one state at an end; a free one has none."""
        if isinstance(value, list) and any(not isinstance(v, int | float | str) for v in value):
            entries = [
                self._between(
                    *_limits(entry), self.notation.name(name, at, str(i)).text, scalar=True
                )
                for i, entry in enumerate(value, start=1)
            ]
            return [text for text in entries if text]
        text = self._between(*_limits(value), self.notation.name(name, at).text, scalar=False)
        return [text] if text else []

    def bounds(self) -> list[Line]:
        """Write the bounds on free times, parameters, states and controls."""
        times = (self.problem.time.initial, self.problem.time.final)
        texts = [
            self._between(*_limits(time), end.text, scalar=False)
            for time, end in zip(times, self.notation.ends, strict=True)
            if _is_free(time)
        ]
        for name, spec in getattr(self.problem, "parameters", {}).items():
            texts += self._bounded(name, spec, None)
        for name, spec in {**self.problem.states, **self.problem.controls}.items():
            texts += self._bounded(name, spec, Piece(("t",)))
        found = [text for text in texts if text]
        return [self.items(found)] if found else []

    def _bounded(self, name: str, spec: Any, at: Piece | None) -> list[str]:
        """Write the bounds on a variable, entry by entry where they are given so."""
        lower, upper = getattr(spec, "lower", None), getattr(spec, "upper", None)
        if not isinstance(lower, list) and not isinstance(upper, list):
            middle = self.notation.name(name, at).text
            return [self._between(lower, upper, middle, scalar=spec.size is None)]
        return [
            self._between(
                self._entry(lower, i),
                self._entry(upper, i),
                self.notation.name(name, at, str(i + 1)).text,
                scalar=True,
            )
            for i in range(spec.size or 1)
        ]

    def _entry(self, value: Any, i: int) -> Any:
        """Take an entry of a list, or of a named vector; a number is the same for all."""
        if isinstance(value, list):
            return value[i] if i < len(value) else None
        symbol = self.notation.symbols.get(str(value))
        return f"{value}[{i}]" if symbol and symbol.shape else value

    def _between(self, lower: Any, upper: Any, middle: str, *, scalar: bool) -> str:
        """Write a value and its limits; nothing where it has none."""
        low, high = (None if _is_open(v) else self._inline(v) for v in (lower, upper))
        le, signed = self.notation.sign("<="), self.notation.signed
        if low and high and low == high:
            return f"{middle} = {signed(high)}"
        if low and high and scalar and low == replace(high, negative=True) and not high.negative:
            return f"|{middle}| {le} {high.text}"
        if low and high:
            return f"{signed(low)} {le} {middle} {le} {signed(high)}"
        if high:
            return f"{middle} {le} {signed(high)}"
        return f"{middle} {self.notation.sign('>=')} {signed(low)}" if low else ""

    def constraints(self) -> Iterator[Line]:
        """Write path, boundary, integral and point constraints."""
        kinds: dict[str, Callable[[Any], Piece]] = {
            "path": self._comparison,
            "boundary": self._comparison,
            "integral": self._integral_comparison,
            "point": self._point,
        }
        for kind, write in kinds.items():
            for constraint in (getattr(self._constraints(), kind, None) or {}).values():
                yield Line(write(constraint).terms)

    def _constraints(self) -> object:
        return getattr(self.problem, "constraints", None)

    def _comparison(self, text: object) -> Piece:
        """Write a comparison as it holds at any time."""
        return self._compared(text, lambda c: (formula(self.notation, side) for side in c.sides))

    def _compared(self, text: object, write: Callable[[Comparison], Iterable[Piece]]) -> Piece:
        """Write the sides of a comparison, or what is none as it stands."""
        try:
            comparison = parse_comparison(str(text))
        except ExpressionError:
            return _literal(self.notation, text)
        return self.notation.relation(list(write(comparison)), comparison.operators)

    def _integral_comparison(self, text: object) -> Piece:
        """Write a comparison of an integral: the side that varies is the integrand."""

        def sides(comparison: Comparison) -> Iterator[Piece]:
            fixed = self.problem.constants
            varying = [any(n not in fixed for n in side.names) for side in comparison.sides]
            place = varying.index(True) if any(varying) else (len(varying) - 1) // 2
            for i, side in enumerate(comparison.sides):
                yield self._integral(side, "") if i == place else formula(self.notation, side)

        return self._compared(text, sides)

    def _point(self, constraint: Any) -> Piece:
        """Write a comparison at one time."""
        holds = self._comparison(getattr(constraint, "holds", constraint))
        at = getattr(constraint, "at", None)
        if at is None:
            return holds
        time = self.notation.signed(self._inline(at))
        when = rf"\quad \text{{at }} t = {time}" if self.notation.latex else f", at t = {time}"
        return replace(holds, terms=(*holds.terms[:-1], holds.terms[-1] + when))

    def definitions(self) -> Iterator[Line]:
        """Write the named expressions."""
        for name, value in getattr(self.problem, "expressions", {}).items():
            yield self._equation(self._symbol(name), getattr(value, "value", value))

    def tables(self) -> Iterator[Line]:
        """Describe the tables, which formulas use like functions."""
        for name, table in getattr(self.problem, "tables", {}).items():
            text = f"{getattr(table, 'method', '')} interpolation of {len(table.x)} points".strip()
            said = rf"\text{{ {text}}}" if self.notation.latex else f" {text}"
            dot = self.notation.sign("·").strip()
            yield Line((f"{self._symbol(name)}({dot}):{said}",))

    def facts(self) -> list[str]:
        """Write the horizon, the sizes of vectors and the constants."""
        start, end = (self.notation.signed(end) for end in self.notation.ends)
        latex = self.notation.latex
        horizon = rf"t \in [{start}, {end}]" if latex else f"t ∈ [{start}, {end}]"
        variables: dict[str, Any] = {**self.problem.states, **self.problem.controls}
        variables |= getattr(self.problem, "parameters", {})
        spaces = [
            rf"{self._symbol(name)} \in \mathbf{{R}}^{{{spec.size}}}"
            if latex
            else f"{self._symbol(name)} ∈ ℝ{self.notation.raised(str(spec.size))}"
            for name, spec in variables.items()
            if spec.size is not None
        ]
        constants = [
            f"{self._symbol(name)} = {self.notation.signed(self._inline(value))}"
            for name, value in self.problem.constants.items()
        ]
        return [horizon, *spaces, *constants]

    def _inline(self, value: Any) -> Piece:
        """Write a value among others on a line, where a fraction would be too high."""
        return _value(replace(self.notation, inline=True), value)

    def _symbol(self, name: str) -> str:
        return self.notation.symbols[name].text(self.notation.latex)

    def _shortened(self, texts: Sequence[str]) -> list[str]:
        """Leave out the middle of a long list."""
        if len(texts) <= _LONGEST:
            return list(texts)
        return [*texts[: _LONGEST - 2], self.notation.sign("…"), texts[-1]]

    def items(self, texts: Sequence[str]) -> Line:
        """Write things side by side."""
        commas = [text + "," for text in texts[:-1]]
        return Line((*commas, *texts[-1:]), gap=r" \quad " if self.notation.latex else "  ")


def _is_zero(value: object) -> bool:
    """Tell a cost that is not there."""
    return str(value).strip() in {"0", "0.0"}


def _is_free(time: object) -> bool:
    """Tell a time that is to be found from a number or formula."""
    return not isinstance(time, int | float | str)


def _is_open(bound: object) -> bool:
    """Tell a bound that does not bound."""
    return bound is None or (isinstance(bound, int | float) and not isfinite(bound))


def _limits(value: Any) -> tuple[Any, Any]:
    """Give lower and upper end of a range, twice the same for a fixed value."""
    if value is None or isinstance(value, int | float | str | list):
        return value, value
    return getattr(value, "lower", None), getattr(value, "upper", None)
