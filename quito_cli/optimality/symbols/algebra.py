"""Products, powers and quotients of sums, multiplied out as far as is good to read.

A bracket that is not multiplied out is an atom, and the Algebra remembers the sum it stands for, so
that it can divide by it later, and open it where powers meet to a small whole one.
"""

from __future__ import annotations

from fractions import Fraction
from math import comb, gcd, lcm

from quito_cli.optimality.symbols.sums import (
    MOST_TERMS,
    ONE,
    Monomial,
    Sum,
    TooLongError,
    add,
    atom,
    bits,
    content,
    include,
    inverse,
    key,
    leading,
    number,
    scaled,
    times,
)

MOST_WORK = 40_000
"""Terms that are worked on for one formula: about a fifth of a second."""
MOST_EXPANDED = 12
"""Terms that a power is multiplied out to; longer ones stay in brackets."""
MOST_BITS = 900
"""Binary digits of a number: all of a double."""


class Algebra:
    """Arithmetic of sums; remembers what the sums in brackets stand for."""

    def __init__(self) -> None:
        self.brackets: dict[str, Sum] = {}
        self.left = MOST_WORK

    def spend(self, terms: int) -> None:
        """Count terms that are worked on.

        Raises:
            TooLongError: more than MOST_WORK in all.
        """
        self.left -= terms
        if self.left < 0:
            raise TooLongError

    def divided(self, value: Sum, by: Sum) -> Sum | None:
        """Return the exact quotient of two polynomials, or None where there is a remainder.

        Raises:
            TooLongError: more work than is done.
        """
        names = sorted({name for sum_ in (value, by) for m in sum_ for name, _ in m})

        def rank(monomial: Monomial) -> list[Fraction]:
            here = dict(monomial)
            return [here.get(name, Fraction(0)) for name in names]

        head = max(by, key=rank)
        left, quotient = dict(value), Sum()
        for _ in range(MOST_TERMS):
            if not left:
                return quotient
            self.spend(len(left) + len(by))
            first = max(left, key=rank)
            step = times(first, inverse(head))
            if any(e < 0 for _, e in step):
                return None
            factor = left[first] / by[head]
            quotient[step] = factor
            left = add(left, scaled(by, -factor, step))
            left.pop(first, None)
        return None

    def product(self, left: Sum, right: Sum) -> Sum:
        """Return the product, multiplied out where that is not too long.

        Raises:
            TooLongError: more than MOST_TERMS terms.
        """
        if len(left) * len(right) > MOST_TERMS:
            longer, other = (left, right) if len(left) > len(right) else (right, left)
            return self.product(self.bracketed(longer, Fraction(1)), other)
        self.spend(len(left) * len(right))
        found: Sum = {}
        for a, c in left.items():
            for b, d in right.items():
                if bits(c) + bits(d) > MOST_BITS:
                    raise TooLongError
                include(found, self._opened(times(a, b), c * d))
        return found

    def _opened(self, monomial: Monomial, factor: Fraction) -> Sum:
        """Multiply out brackets whose powers have met to a small whole power."""
        found: Sum = {monomial: factor}
        for name, exponent in monomial:
            inner = self.brackets.get(name)
            if inner is None or exponent.denominator > 1 or not 0 < exponent <= MOST_EXPANDED:
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
            if any(abs(c) != 1 and bits(c) * abs(exponent) > MOST_BITS for c in value.values()):
                raise TooLongError
            return {
                tuple((n, e * exponent) for n, e in m): c ** int(exponent) for m, c in value.items()
            }
        if len(value) == 1:
            ((monomial, factor),) = value.items()
            if factor == 1 and len(monomial) == 1 and monomial[0][1] == 1:
                return atom(monomial[0][0], exponent)
        n = int(exponent)
        if whole and 0 <= n <= MOST_EXPANDED and comb(len(value) + n - 1, n) <= MOST_EXPANDED:
            return self.whole_power(value, n)
        return self.bracketed(value, exponent)

    def bracketed(self, value: Sum, exponent: Fraction) -> Sum:
        """Return a power of a sum as an atom; what divides all terms is in front of a whole one."""
        factor, common = Fraction(1), ONE
        if exponent.denominator == 1 and len(value) > 1:
            factor, common = content(value)
            first = ONE if ONE in value else leading(value)
            factor = -factor if value[first] < 0 else factor
            if factor != 1 and bits(factor) * abs(exponent) > MOST_BITS:
                factor = Fraction(1)
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
        self.spend(len(value))
        inner: Sum = {}
        for monomial, factor in value.items():
            inner = add(inner, self._opened(times(monomial, inverse(common)), factor))
        taken: Monomial = ONE
        for name, exponent in common:
            for _ in range(int(-exponent) if name in self.brackets and exponent < 0 else 0):
                quotient = self.divided(inner, self.brackets[name])
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
                a, b = self.divided(above, factor), self.divided(below, factor)
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
