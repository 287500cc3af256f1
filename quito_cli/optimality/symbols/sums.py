"""Sums of products with exact numbers: the normal form in which derived formulas are simplified.

A sum is {monomial: coefficient}; a monomial is a sorted tuple of (atom, exponent), a coefficient a
Fraction, so that 0.7 is 7/10. An atom is a name, a call such as sin(x), or a sum in brackets that
is not multiplied out: one with a negative or broken exponent, or a power too long for a page. Like
terms are collected by construction. Two forms of one function need not be equal (sin² + cos² is not
known to be 1): the form serves reading, never a decision.
"""

from __future__ import annotations

from fractions import Fraction
from math import gcd, lcm

Monomial = tuple[tuple[str, Fraction], ...]
Sum = dict[Monomial, Fraction]

ONE: Monomial = ()
MOST_TERMS = 300
"""Terms of a sum that is still worked on."""
LONGEST_KEY = 4000
"""Characters of an atom's name."""
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
    include(found, right)
    return found


def include(found: Sum, right: Sum) -> None:
    """Add a sum to another in place."""
    for monomial, b in right.items():
        a = found.get(monomial, Fraction(0))
        if abs(a + b) <= CANCELLED * (abs(a) + abs(b)):
            found.pop(monomial, None)
        else:
            found[monomial] = a + b
    if len(found) > MOST_TERMS:
        raise TooLongError


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


def bits(value: Fraction) -> int:
    """Return the binary digits of the longer of numerator and denominator."""
    return max(part.bit_length() for part in value.as_integer_ratio())


def key(value: Sum) -> str:
    """Return a text that is the same for the same sum.

    Raises:
        TooLongError: longer than LONGEST_KEY.
    """
    terms = (
        " ".join([str(c), *(f"{name}^{exponent}" for name, exponent in monomial)])
        for monomial, c in sorted(value.items())
    )
    text = " + ".join(terms)
    if len(text) > LONGEST_KEY:
        raise TooLongError
    return text
