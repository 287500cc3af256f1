"""Sums as formulas of the problem file's language, arranged for reading.

Terms are gathered by costates, what divides all of a bracket stands before it, and a sum begins
with a positive term. The text is one that `language.syntax` parses, so that `mathematics` prints it
the way it prints the file's own formulas.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from quito_cli.optimality.symbols.reading import Reader
from quito_cli.optimality.symbols.sums import (
    ONE,
    Monomial,
    Sum,
    TooLongError,
    constant_of,
    content,
    inverse,
    scaled,
)

LONGEST = 1200
"""Characters of a formula that is still printed."""
_INFIX = {"<", "<=", "==", "!=", "and", "or"}


class Writer:
    """Writes the sums of a Reader."""

    def __init__(self, reader: Reader, first: Sequence[str], gathered: Sequence[str]) -> None:
        """`first` are names in the order of factors; `gathered` those that terms are grouped by."""
        self.reader = reader
        self.rank = {name: i for i, name in reversed(list(enumerate(first)))}
        self.gathered = list(gathered)
        self.written: dict[str, str] = {}
        """Brackets and calls that have been written already."""

    def text(self, value: Sum) -> str:
        """Return a sum as a formula, gathered.

        Raises:
            TooLongError: longer than LONGEST.
        """
        groups: dict[Monomial, Sum] = {}
        for monomial, factor in value.items():
            head = tuple(pair for pair in monomial if pair[0] in self.gathered)
            rest = tuple(pair for pair in monomial if pair[0] not in self.gathered)
            groups.setdefault(head, {})[rest] = factor
        groups = {head: self.reader.algebra.shortened(rest) for head, rest in groups.items()}
        order = sorted(groups, key=lambda head: [self.gathered.index(n) for n, _ in head])
        terms = []
        for head in order:
            if head == ONE:
                terms += self._terms(groups[head])
            else:
                terms.append(self._group(head, groups[head]))
        return self._checked(_joined(terms))

    def quotient(self, above: Sum, below: Sum) -> str:
        """Return a quotient of sums as a formula.

        Raises:
            TooLongError: longer than LONGEST.
        """
        divisor = constant_of(below)
        if divisor is not None:
            return self.text(scaled(above, 1 / divisor))
        if len(below) == 1:
            ((monomial, factor),) = below.items()
            return self.text(scaled(above, 1 / factor, inverse(monomial)))
        sign, top = self._factored(above)
        bottom = self._factored(below)
        text = f"{top}/({bottom[1]})"
        return self._checked(f"-{text}" if sign * bottom[0] < 0 else text)

    def factors(self, value: Sum) -> str:
        """Return a sum as a formula, without the sign and number before all of it.

        Raises:
            TooLongError: longer than LONGEST.
        """
        factor, _ = content(value)
        return self._checked(self._factored(scaled(value, 1 / factor))[1])

    def _checked(self, text: str) -> str:
        if len(text) > LONGEST:
            raise TooLongError
        return text

    def _group(self, head: Monomial, rest: Sum) -> tuple[int, str]:
        """Write a product of gathered names with the sum that multiplies them."""
        if len(rest) == 1:
            ((monomial, factor),) = rest.items()
            return self._product(factor, (*head, *monomial))
        return self._factored(rest, head)

    def _factored(self, value: Sum, head: Monomial = ONE) -> tuple[int, str]:
        """Write a sum as one product: what divides all terms, `head`, the rest in brackets."""
        if len(value) <= 1:
            ((monomial, factor),) = value.items() if value else ((ONE, Fraction(0)),)
            return self._product(factor, monomial)
        factor, common = content(value)
        if common == ONE and (factor.denominator > 1 or factor.numerator == 1):
            factor = Fraction(1)
        inner = scaled(value, 1 / factor, inverse(common))
        terms = self._terms(inner)
        sign = 1
        if terms[0][0] < 0:  # no term is positive: they are written so
            sign, terms = -1, [(-s, text) for s, text in terms]
        text = f"({_joined(terms)})"
        below = tuple((n, -e) for n, e in common if e < 0)
        above = (*head, *((n, e) for n, e in common if e > 0))
        if factor.numerator != 1 or above:
            text = f"{self._product(Fraction(factor.numerator), above)[1]}*{text}"
        if below or factor.denominator != 1:
            text += f"/({self._product(Fraction(factor.denominator), below)[1]})"
        return sign, text

    def _terms(self, value: Sum) -> list[tuple[int, str]]:
        """Write the terms of a sum, low degrees first, but the positive ones before a minus."""
        order = sorted(value, key=self._place)
        if order and value[order[0]] < 0:
            order.sort(key=lambda monomial: value[monomial] < 0)
        return [self._product(value[monomial], monomial) for monomial in order] or [(1, "0")]

    def _place(self, monomial: Monomial) -> tuple[Fraction, list[tuple[int, str]]]:
        names = [(self.rank.get(name, len(self.rank)), name) for name, _ in monomial]
        constants = {"pi"}
        degree = sum((abs(e) for name, e in monomial if name not in constants), Fraction(0))
        return degree, sorted(names)

    def _product(self, factor: Fraction, monomial: Monomial) -> tuple[int, str]:
        """Write a term, the sign of its number apart."""
        sign, size = (-1 if factor < 0 else 1), abs(factor)
        above = tuple((n, e) for n, e in monomial if e > 0)
        below = tuple((n, -e) for n, e in monomial if e < 0)
        top, bottom = _number(size)
        if bottom and (below or "." in bottom):
            whole = self._written([top] if top != "1" else [], above) or "1"
            return sign, f"{whole}/({self._written([bottom], below)})"
        front = f"{top}/{bottom}" if bottom else top
        whole = self._written([front] if front != "1" else [], above) or "1"
        if not below:
            return sign, whole
        under = self._written([], below)
        return sign, f"{whole}/({under})" if len(below) > 1 else f"{whole}/{under}"

    def _written(self, front: list[str], monomial: Monomial) -> str:
        order = sorted(monomial, key=lambda pair: (self.rank.get(pair[0], len(self.rank)), pair[0]))
        return "*".join([*front, *(self._power(name, e) for name, e in order)])

    def _power(self, name: str, exponent: Fraction) -> str:
        """Write an atom to a positive power."""
        if exponent.denominator == 2 and exponent.numerator == 1:
            inner = self._atom(name)
            return f"sqrt({inner[1:-1] if name in self.reader.algebra.brackets else inner})"
        return self._atom(name) if exponent == 1 else f"{self._atom(name)}^{_exponent(exponent)}"

    def _atom(self, name: str) -> str:
        """Write a name, a bracket, or a call."""
        if name not in self.written:
            self.written[name] = self._unwritten(name)
        return self.written[name]

    def _unwritten(self, name: str) -> str:
        inner = self.reader.algebra.brackets.get(name)
        if inner is not None:
            return f"({self.text(inner)})"
        if name not in self.reader.calls:
            return name
        function, given = self.reader.calls[name]
        texts = [self.text(value) for value in given]
        if function in _INFIX:
            return f"({texts[0]} {function} {texts[1]})"
        if function == "^":
            return f"({texts[0]})^({texts[1]})"
        if function == "not":
            return f"(not {texts[0]})"
        return f"{function}({', '.join(texts)})"


def _exponent(exponent: Fraction) -> str:
    return str(exponent.numerator) if exponent.denominator == 1 else f"({exponent})"


def _joined(terms: list[tuple[int, str]]) -> str:
    (sign, first), *others = terms or [(1, "0")]
    text = f"-{first}" if sign < 0 else first
    return text + "".join(f" {'-' if s < 0 else '+'} {term}" for s, term in others)


def _number(size: Fraction) -> tuple[str, str]:
    """Write a positive number: a whole or decimal one, or numerator and denominator."""
    below = size.denominator
    if below in {1, 2, 3, 4, 6, 8}:
        return str(size.numerator), "" if below == 1 else str(below)
    decimal = f"{float(size):.12g}"
    if len(decimal.lstrip("0.")) <= 6 or below > 200:
        return decimal, ""
    return str(size.numerator), str(below)
