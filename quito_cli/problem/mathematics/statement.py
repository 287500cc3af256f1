"""A whole problem as mathematics, the way its paper states it: in unicode or in LaTeX.

    minimise   ½ ∫₀⁴ (x₁² + x₂²) dt    (over u)
    subject to ẋ₁ = x₂, …

How a formula looks is the business of `formulas`, how bounds and end conditions do that of
`limits`; here is what stands where on the page. LaTeX needs amsmath and nothing else.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from quito_cli.problem.language.syntax import Comparison, Expression, parse_comparison
from quito_cli.problem.language.tokens import ExpressionError
from quito_cli.problem.mathematics.formulas import formula, integral
from quito_cli.problem.mathematics.limits import bounds, ends
from quito_cli.problem.mathematics.notation import Level, Notation, Piece
from quito_cli.problem.mathematics.page import (
    Line,
    Section,
    latex_page,
    side_by_side,
    unicode_page,
)
from quito_cli.problem.mathematics.values import (
    LONGEST,
    inline_value,
    literal,
    notation_of,
    read,
    value,
)
from quito_cli.problem.schema import PointConstraint, Problem
from quito_cli.problem.schema_values import FreeTime


def render(problem: Problem, *, latex: bool) -> str:
    """Write a problem as mathematics: plain text in unicode, or a LaTeX display with amsmath."""
    lay_out = latex_page if latex else unicode_page
    return lay_out(*statement(problem, latex=latex))


def statement(problem: Problem, *, latex: bool) -> tuple[list[Section], str]:
    """Return the parts of the problem that there are, and the unknowns."""
    notation = notation_of(problem, latex)
    page = _Page(problem, notation)
    limits = [*ends(problem, notation), *bounds(problem, notation)]
    sections: list[Section] = [
        (problem.sense.replace("ize", "ise"), [page.objective()]),
        ("subject to", [*page.dynamics(), *limits, *page.constraints()]),
        ("where", [*page.definitions(), *page.tables()]),
        ("with", [side_by_side(page.facts(), latex)]),
    ]
    return [section for section in sections if section[1]], page.unknowns()


@dataclass(frozen=True)
class _Page:
    """The parts of one problem as lines."""

    problem: Problem
    notation: Notation

    def objective(self) -> Line:
        """Write the cost, the Mayer part first."""
        cost, parts = self.problem.cost, []
        if not _is_zero(cost.mayer):
            parts.append(value(replace(self.notation, at=self.notation.ends[1]), cost.mayer))
        if not _is_zero(cost.lagrange):
            parts.append(self._integral(read(cost.lagrange), cost.lagrange))
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
            return self.notation.integral(literal(self.notation, text))
        return integral(self.notation, expression)

    def unknowns(self) -> str:
        """Name what is chosen: controls, parameters, free times."""
        names = [*self.problem.controls, *self.problem.parameters]
        symbols = [self._symbol(name) for name in names]
        times = (self.problem.time.initial, self.problem.time.final)
        free = [
            end
            for end, time in zip(self.notation.ends, times, strict=True)
            if isinstance(time, FreeTime)
        ]
        return ", ".join(self._shortened([*symbols, *(end.text for end in free)]))

    def dynamics(self) -> Iterator[Line]:
        """Write the differential equations."""
        for name in self.problem.states:
            rate = self.problem.dynamics.get(name, "?")
            if isinstance(rate, list):
                for i, entry in enumerate(rate, start=1):
                    yield self._equation(self._rate(name, str(i)), entry)
            else:
                yield self._equation(self._rate(name, ""), rate)

    def _rate(self, name: str, index: str) -> str:
        """Write the derivative of a state or an entry of it."""
        symbol = self.notation.symbols[name]
        entry = symbol.entry(index) if index else symbol
        if entry is not None:
            return entry.derivative(self.notation.latex)
        inner = symbol.derivative(self.notation.latex)
        return self.notation.subscripted(f"({inner})", index)

    def _equation(self, left: str, right: Any) -> Line:
        """Write a definition, to be broken between summands."""
        return Line(self.notation.signed_terms(value(self.notation, right)), f"{left} = ")

    def constraints(self) -> Iterator[Line]:
        """Write path, boundary, integral and point constraints."""
        kinds: dict[str, Callable[[Any], Piece]] = {
            "path": self._comparison,
            "boundary": self._comparison,
            "integral": self._integral_comparison,
            "point": self._point,
        }
        for kind, write in kinds.items():
            for constraint in getattr(self.problem.constraints, kind).values():
                yield Line(write(constraint).terms)

    def _comparison(self, text: object) -> Piece:
        """Write a comparison as it holds at any time."""
        return self._compared(text, lambda c: (formula(self.notation, side) for side in c.sides))

    def _compared(self, text: object, write: Callable[[Comparison], Iterable[Piece]]) -> Piece:
        """Write the sides of a comparison, or what is none as it stands."""
        try:
            comparison = parse_comparison(str(text))
        except ExpressionError:
            return literal(self.notation, text)
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

    def _point(self, constraint: PointConstraint) -> Piece:
        """Write a comparison at one time."""
        holds = self._comparison(constraint.holds)
        time = self.notation.signed(inline_value(self.notation, constraint.at))
        when = rf"\quad \text{{at }} t = {time}" if self.notation.latex else f", at t = {time}"
        return replace(holds, terms=(*holds.terms[:-1], holds.terms[-1] + when))

    def definitions(self) -> Iterator[Line]:
        """Write the named expressions."""
        for name, text in self.problem.expressions.items():
            yield self._equation(self._symbol(name), text)

    def tables(self) -> Iterator[Line]:
        """Describe the tables, which formulas use like functions."""
        for name, table in self.problem.tables.items():
            text = f"{table.method} interpolation of {len(table.x)} points"
            said = rf"\text{{ {text}}}" if self.notation.latex else f" {text}"
            dot = self.notation.sign("·").strip()
            yield Line((f"{self._symbol(name)}({dot}):{said}",))

    def facts(self) -> list[str]:
        """Write the horizon, the sizes of vectors and the constants."""
        start, end = (self.notation.signed(end) for end in self.notation.ends)
        latex = self.notation.latex
        horizon = rf"t \in [{start}, {end}]" if latex else f"t ∈ [{start}, {end}]"
        variables: dict[str, Any] = {**self.problem.states, **self.problem.controls}
        variables |= self.problem.parameters
        spaces = [
            rf"{self._symbol(name)} \in \mathbf{{R}}^{{{spec.size}}}"
            if latex
            else f"{self._symbol(name)} ∈ ℝ{self.notation.raised(str(spec.size))}"
            for name, spec in variables.items()
            if spec.size is not None
        ]
        constants = [
            f"{self._symbol(name)} = {self.notation.signed(inline_value(self.notation, given))}"
            for name, given in self.problem.constants.items()
        ]
        return [horizon, *spaces, *constants]

    def _symbol(self, name: str) -> str:
        return self.notation.symbols[name].text(self.notation.latex)

    def _shortened(self, texts: Sequence[str]) -> list[str]:
        """Leave out the middle of a long list."""
        if len(texts) <= LONGEST:
            return list(texts)
        return [*texts[: LONGEST - 2], self.notation.sign("…"), texts[-1]]


def _is_zero(given: object) -> bool:
    """Tell a cost that is not there."""
    return str(given).strip() in {"0", "0.0"}
