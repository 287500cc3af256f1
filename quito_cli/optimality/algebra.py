"""Sums of products with exact numbers: the normal form in which derived formulas are simplified.

A sum is {monomial: coefficient}; a monomial is a sorted tuple of (atom, exponent), a coefficient a
Fraction, so that 0.7 is 7/10. An atom is a name, a call such as sin(x), or a sum in brackets that
is not multiplied out: one with a negative or broken exponent, or a power too long for a page. Like
terms are collected by construction. Two forms of one function need not be equal (sin² + cos² is not
known to be 1): the form serves reading, never a decision.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from fractions import Fraction
from math import comb, gcd, lcm

Monomial = tuple[tuple[str, Fraction], ...]
Sum = dict[Monomial, Fraction]

ONE: Monomial = ()
MOST_TERMS = 300
"""Terms of a sum that is still worked on."""
MOST_EXPANDED = 12
"""Terms that a power is multiplied out to; longer ones stay in brackets."""
CANCELLED = Fraction(1, 10**13)
"""What is left of the sum of two numbers is none where it is this small beside them: rounding."""


class TooLongError(Exception):
    """A sum of more terms than anybody reads."""


def number(value: Fraction | int) -> Sum:
    """Return a number."""
    return {ONE: Fraction(value)} if value else {}


def atom(name: str, exponent: Fraction | int = 1) -> Sum:
    """Return an atom or a power of it."""
    return {((name, Fraction(exponent)),): Fraction(1)}


def constant_of(value: Sum) -> Fraction | None:
    """Return the number that a sum is, if it is one."""
    return value.get(ONE, Fraction(0)) if not value or value.keys() == {ONE} else None


def add(left: Sum, right: Sum) -> Sum:
    """Return the sum.

    Raises:
        TooLongError: more than MOST_TERMS terms.
    """
    found = dict(left)
    for monomial, b in right.items():
        a = found.get(monomial, Fraction(0))
        if abs(a + b) <= CANCELLED * (abs(a) + abs(b)):
            found.pop(monomial, None)
        else:
            found[monomial] = a + b
    if len(found) > MOST_TERMS:
        raise TooLongError
    return found


def scaled(value: Sum, factor: Fraction | int, by: Monomial = ONE) -> Sum:
    """Return a sum times a number and a monomial, nothing multiplied out."""
    return {times(m, by): c * factor for m, c in value.items()} if factor else {}


def times(left: Monomial, right: Monomial) -> Monomial:
    """Return the product of two monomials."""
    if not left or not right:
        return left or right
    exponents = dict(left)
    for name, exponent in right:
        exponents[name] = exponents.get(name, Fraction(0)) + exponent
    return tuple(sorted((name, e) for name, e in exponents.items() if e))


def content(value: Sum) -> tuple[Fraction, Monomial]:
    """Return the largest number and monomial that divide every term, the number positive."""
    if not value:
        return Fraction(1), ONE
    above = gcd(*(c.numerator for c in value.values()))
    below = lcm(*(c.denominator for c in value.values()))
    least = dict(next(iter(value)))
    for monomial in value:
        here = dict(monomial)
        least = {n: min(e, here.get(n, Fraction(0))) for n, e in least.items()} | {
            n: e for n, e in here.items() if n not in least and e < 0
        }
        # A name that this term lacks divides no further than to the power 0.
        least = {n: e for n, e in least.items() if n in here or e < 0}
    return Fraction(above, below), tuple(sorted((n, e) for n, e in least.items() if e))


def inverse(monomial: Monomial) -> Monomial:
    """Return 1 over a monomial."""
    return tuple((name, -e) for name, e in monomial)


def leading(value: Sum) -> Monomial:
    """Return the monomial that comes first in the lexicographic order of exponents."""
    names = sorted({name for monomial in value for name, _ in monomial})
    return max(value, key=lambda m: [dict(m).get(name, Fraction(0)) for name in names])


def divided(value: Sum, by: Sum) -> Sum | None:
    """Return the exact quotient of two polynomials, or None where there is a remainder."""
    names = sorted({name for sum_ in (value, by) for m in sum_ for name, _ in m})

    def rank(monomial: Monomial) -> list[Fraction]:
        here = dict(monomial)
        return [here.get(name, Fraction(0)) for name in names]

    head = max(by, key=rank)
    left, quotient = dict(value), Sum()
    for _ in range(MOST_TERMS):
        if not left:
            return quotient
        first = max(left, key=rank)
        step = times(first, inverse(head))
        if any(e < 0 for _, e in step):
            return None
        factor = left[first] / by[head]
        quotient[step] = factor
        left = add(left, scaled(by, -factor, step))
        left.pop(first, None)
    return None


class Algebra:
    """Arithmetic of sums; remembers what the sums in brackets stand for."""

    def __init__(self) -> None:
        self.brackets: dict[str, Sum] = {}

    def product(self, left: Sum, right: Sum) -> Sum:
        """Return the product, multiplied out where that is not too long.

        Raises:
            TooLongError: more than MOST_TERMS terms.
        """
        if len(left) * len(right) > MOST_TERMS:
            longer, other = (left, right) if len(left) > len(right) else (right, left)
            return self.product(self.bracketed(longer, Fraction(1)), other)
        found: Sum = {}
        for a, c in left.items():
            for b, d in right.items():
                found = add(found, self._opened(times(a, b), c * d))
        return found

    def _opened(self, monomial: Monomial, factor: Fraction) -> Sum:
        """Multiply out brackets whose powers have met to a small whole power."""
        found: Sum = {monomial: factor}
        for name, exponent in monomial:
            inner = self.brackets.get(name)
            if inner is None or exponent.denominator > 1 or exponent < 0:
                continue
            if comb(len(inner) + int(exponent) - 1, int(exponent)) <= MOST_EXPANDED:
                rest: Sum = {tuple(pair for pair in monomial if pair[0] != name): factor}
                return self.product(rest, self.whole_power(inner, int(exponent)))
        return found

    def whole_power(self, value: Sum, exponent: int) -> Sum:
        """Return a power multiplied out; the exponent is 0 or more."""
        found = number(1)
        for _ in range(exponent):
            found = self.product(found, value)
        return found

    def power(self, value: Sum, exponent: Fraction) -> Sum:
        """Return a power with a number for exponent.

        Raises:
            ZeroDivisionError: zero to a negative power.
        """
        whole = exponent.denominator == 1
        if not value and exponent <= 0:
            if not exponent:
                return number(1)
            raise ZeroDivisionError
        if len(value) <= 1 and whole:
            return {
                tuple((n, e * exponent) for n, e in m): c ** int(exponent) for m, c in value.items()
            }
        if len(value) == 1:
            ((monomial, factor),) = value.items()
            if factor == 1 and len(monomial) == 1 and monomial[0][1] == 1:
                return atom(monomial[0][0], exponent)
        n = int(exponent)
        if whole and n >= 0 and comb(len(value) + n - 1, n) <= MOST_EXPANDED:
            return self.whole_power(value, n)
        return self.bracketed(value, exponent)

    def bracketed(self, value: Sum, exponent: Fraction) -> Sum:
        """Return a power of a sum as an atom; what divides all terms is in front of a whole one."""
        factor, common = Fraction(1), ONE
        if exponent.denominator == 1 and len(value) > 1:
            factor, common = content(value)
            first = ONE if ONE in value else leading(value)
            factor = -factor if value[first] < 0 else factor
            value = scaled(value, 1 / factor, inverse(common))
        name = f"({key(value)})"
        self.brackets[name] = value
        outside = tuple((n, e * exponent) for n, e in common)
        front = factor ** int(exponent) if factor != 1 else Fraction(1)
        return {times(outside, ((name, exponent),)): front}

    def shortened(self, value: Sum) -> Sum:
        """Return a sum with brackets that divide all of it taken from its denominators."""
        if len(value) <= 1:
            return value
        common = tuple(
            (name, e)
            for name, e in content(value)[1]
            if name not in self.brackets or all(name in dict(monomial) for monomial in value)
        )
        inner: Sum = {}
        for monomial, factor in value.items():
            inner = add(inner, self._opened(times(monomial, inverse(common)), factor))
        taken: Monomial = ONE
        for name, exponent in common:
            for _ in range(int(-exponent) if name in self.brackets and exponent < 0 else 0):
                quotient = divided(inner, self.brackets[name])
                if quotient is None:
                    break
                inner, taken = quotient, times(taken, ((name, Fraction(1)),))
        short = taken or len(inner) <= len(value)
        return scaled(inner, 1, times(common, taken)) if short else value

    def fraction(self, above: Sum, below: Sum) -> tuple[Sum, Sum]:
        """Return a quotient in lowest terms, as far as known factors go: (numerator, denominator).

        Raises:
            TooLongError: more than MOST_TERMS terms.
        """
        above, below = self._cleared(above, below)
        candidates = [inner for inner in self.brackets.values() if len(inner) > 1]
        for factor in [below, above, *candidates]:
            while len(factor) > 1:
                a, b = divided(above, factor), divided(below, factor)
                if a is None or b is None:
                    break
                above, below = a, b
        (c, m), (d, n) = content(above), content(below)
        shared = tuple((name, min(e, dict(n)[name])) for name, e in m if name in dict(n))
        sign = -1 if below and below[leading(below)] < 0 else 1
        whole = sign * lcm(c.denominator, d.denominator)
        common = gcd(int(c * abs(whole)), int(d * abs(whole))) or 1
        factor_ = Fraction(whole, common)
        return scaled(above, factor_, inverse(shared)), scaled(below, factor_, inverse(shared))

    def _cleared(self, above: Sum, below: Sum) -> tuple[Sum, Sum]:
        """Multiply both by what stands in denominators."""
        for _ in range(20):
            lowest: dict[str, Fraction] = {}
            for monomial in (*above, *below):
                for name, exponent in monomial:
                    if exponent < 0:
                        lowest[name] = min(lowest.get(name, exponent), exponent)
            if not lowest:
                break
            by: Sum = {tuple(sorted((n, -e) for n, e in lowest.items())): Fraction(1)}
            above, below = self.product(above, by), self.product(below, by)
        return above, below


def key(value: Sum) -> str:
    """Return a text that is the same for the same sum."""
    terms = (
        " ".join([str(c), *(f"{name}^{exponent}" for name, exponent in monomial)])
        for monomial, c in sorted(value.items())
    )
    return " + ".join(terms)


def atoms(values: Iterable[Mapping[Monomial, Fraction]]) -> set[str]:
    """Return the atoms of sums."""
    return {name for value in values for monomial in value for name, _ in monomial}
