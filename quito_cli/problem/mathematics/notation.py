"""How signs, functions and numbers look, unicode beside LaTeX, and where brackets are needed.

Every part of a formula becomes a `Piece`: its text, and how tightly it binds. Brackets are set from
that alone, where a part binds more loosely than its place asks for.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from enum import IntEnum
from math import inf, isfinite
from typing import Final, NamedTuple

from quito_cli.problem.language.names import KNOWN_CONSTANTS
from quito_cli.problem.mathematics.symbols import (
    SUBSCRIPTS,
    SUPERSCRIPTS,
    Symbol,
    braced,
    read_symbol,
)

_SIGNS: Final = {
    "-": ("−", "-"),
    "·": ("·", r" \cdot "),
    "∘": (" ∘ ", r" \circ "),
    " ": (" ", r"\,"),
    "pi": ("π", r"\pi"),
    "inf": ("∞", r"\infty"),
    "…": ("…", r"\dots"),
    "<": ("<", "<"),
    ">": (">", ">"),
    "<=": ("≤", r"\le"),
    ">=": ("≥", r"\ge"),
    "==": ("=", "="),
    "!=": ("≠", r"\ne"),
    "and": (" and ", r" \text{ and } "),
    "or": (" or ", r" \text{ or } "),
    "not": ("not %s", r"\text{not } %s"),
    "if_else": (
        "(%s if %s, else %s)",
        r"\begin{cases} %s & \text{if } %s, \\ %s & \text{otherwise} \end{cases}",
    ),
}


class Level(IntEnum):
    """How tightly a piece binds, the loosest first."""

    CHOICE = 0
    SUM = 1
    MIXED = 2  # a quotient on one line, a cross product: a summand, but no factor without brackets
    PRODUCT = 3
    POWER = 4
    CALL = 5
    ATOM = 6


class _Row(NamedTuple):
    """How a function is written that has a notation of its own."""

    forms: tuple[str, str]
    levels: tuple[Level, Level]
    arguments: tuple[Level, ...]
    inline: bool = False
    """Quotients in the arguments are written on the line."""


def _row(unicode: str, latex: str, level: Level, *arguments: Level) -> _Row:
    return _Row((unicode, latex), (level, level), arguments)


NOTATIONS: Final = {
    "abs": _row("|%s|", r"\left|%s\right|", Level.ATOM, Level.CHOICE),
    "norm": _row("‖%s‖", r"\left\|%s\right\|", Level.ATOM, Level.CHOICE),
    "sqrt": _row("√(%s)", r"\sqrt{%s}", Level.CALL, Level.CHOICE),
    "exp": _Row(
        ("exp(%s)", r"\mathrm{e}^{%s}"), (Level.CALL, Level.POWER), (Level.CHOICE,), inline=True
    ),
    "transpose": _row("%sᵀ", r"%s^{\top}", Level.POWER, Level.ATOM),
    "inv": _row("%s⁻¹", "%s^{-1}", Level.POWER, Level.ATOM),
    "solve": _row("%s⁻¹ %s", r"%s^{-1}\,%s", Level.PRODUCT, Level.ATOM, Level.PRODUCT),
    "dot": _row("%sᵀ %s", r"%s^{\top} %s", Level.PRODUCT, Level.ATOM, Level.PRODUCT),
    "cross": _row("%s × %s", r"%s \times %s", Level.MIXED, Level.POWER, Level.POWER),
}
SQUARED_IN_FRONT: Final = frozenset({"sin", "cos", "tan", "sinh", "cosh", "tanh"})
CALLS: Final = (
    {name: (name, "\\" + name) for name in (*SQUARED_IN_FRONT, "min", "max")}
    | {"a" + name: ("arc" + name, r"\arc" + name) for name in ("sin", "cos", "tan")}
    | {f"a{n}h": (f"ar{n}h", rf"\operatorname{{ar{n}h}}") for n in ("sin", "cos", "tan")}
    | {"log": ("ln", r"\ln"), "sign": ("sgn", r"\operatorname{sgn}")}
)


@dataclass(frozen=True)
class Piece:
    """A part of a formula as text: the summands, each with the sign before it; and how it binds."""

    terms: tuple[str, ...]
    level: Level = Level.ATOM
    negative: bool = False
    """A minus sign belongs before the text."""

    @property
    def text(self) -> str:
        """The text without the leading minus sign."""
        return " ".join(self.terms)


@dataclass(frozen=True)
class Notation:
    """How the formulas of one problem are written."""

    latex: bool
    symbols: Mapping[str, Symbol]
    moving: frozenset[str]
    """The names that are functions of time."""
    ends: tuple[Piece, Piece]
    """The initial and the final time, for `initial(x)` and `final(x)`."""
    at: Piece | None = None
    """The time at which moving names are taken; None for any time."""
    inline: bool = False
    """Quotients are written on the line, as in exponents."""

    def sign(self, name: str) -> str:
        """Give a sign of the table."""
        return _SIGNS[name][self.latex]

    def signed(self, piece: Piece) -> str:
        """Give the text with its sign."""
        return self.sign("-") * piece.negative + piece.text

    def signed_terms(self, piece: Piece) -> tuple[str, ...]:
        """Give the summands with the sign of the whole before the first."""
        return (self.sign("-") * piece.negative + piece.terms[0], *piece.terms[1:])

    def fit(self, piece: Piece, least: Level) -> str:
        """Give the text for a place that asks for a level, in brackets if need be."""
        loose = piece.level < least or (piece.negative and least > Level.SUM)
        return self.bracketed(self.signed(piece)) if loose else self.signed(piece)

    def bracketed(self, text: str) -> str:
        """Put brackets around a text, as high as it is."""
        tall = self.latex and re.search(r"\\(frac|begin|sqrt|int|left)\b", text)
        return rf"\left({text}\right)" if tall else f"({text})"

    def number(self, value: float) -> Piece:
        """Write a number, one that is large or small with a power of ten."""
        value = double(value)
        if not isfinite(value):
            return Piece((self.sign("inf") if abs(value) == inf else "?",), negative=value < 0)
        decimal = Decimal(repr(abs(value))).normalize()
        exponent = decimal.as_tuple().exponent
        size = decimal.adjusted()
        if not decimal or (size >= -4 and isinstance(exponent, int) and exponent < 5):
            return Piece((format(decimal, "f"),), negative=value < 0)
        ten = self.power("10", self.number(float(size)))
        if decimal == Decimal(1).scaleb(size):
            return Piece((ten,), Level.POWER, value < 0)
        text = format(decimal.scaleb(-size), "f") + self.sign("·") + ten
        return Piece((text,), Level.PRODUCT, value < 0)

    def power(self, base: str, exponent: Piece) -> str:
        """Raise the exponent, which is typed after a ^ where unicode lacks a letter."""
        text = self.signed(exponent)
        if self.latex:
            return f"{base}^{braced(text)}"
        raised = self.raised(text.replace(" + ", "+").replace(" − ", "−"))
        if raised and "ᵀ" not in raised:
            return base + raised
        atom = exponent.level == Level.ATOM and not exponent.negative
        return f"{base}^{text}" if atom else f"{base}^({text})"

    def raised(self, text: str) -> str:
        """Give a text in superscript characters, or nothing where there are none."""
        return translated(text, SUPERSCRIPTS)

    def lowered(self, text: str) -> str:
        """Give a text in subscript characters, or nothing where there are none."""
        return translated(text, SUBSCRIPTS)

    def times(self, left: str, right: str) -> str:
        """Write factors side by side, with a dot where two numbers would meet."""
        number = re.fullmatch(r"[\d.]+|\\tfrac\{\d\}\{\d\}", left)
        if right[:1].isnumeric() or (number and right.startswith((r"\frac", r"\tfrac"))):
            return left + self.sign("·") + right
        return left + (" " if number else self.sign(" ")) + right

    def product(self, left: Piece, right: Piece) -> Piece:
        """Write a product, the sign of the first factor before it."""
        first = self.fit(replace(left, negative=False), Level.PRODUCT)
        text = self.times(first, self.fit(right, Level.PRODUCT))
        return Piece((text,), Level.PRODUCT, left.negative)

    def quotient(self, above: Piece, below: Piece) -> Piece:
        """Write a quotient, the sign of what is above before it."""
        plain = replace(above, negative=False)
        if self.latex and not self.inline:
            text = rf"\frac{{{plain.text}}}{{{self.signed(below)}}}"
            return Piece((text,), Level.POWER, above.negative)
        text = f"{self.fit(plain, Level.PRODUCT)}/{self.fit(below, Level.POWER)}"
        return Piece((text,), Level.MIXED, above.negative)

    def sum(self, left: Piece, right: Piece, minus: bool) -> Piece:
        """Add a summand, or take it off; a sum needs brackets but where it is added as it is."""
        if left.level == Level.CHOICE:
            left = Piece((self.fit(left, Level.SUM),))
        signed = right.negative or right.terms[0].startswith(self.sign("-"))
        if minus or signed or right.level != Level.SUM:
            right = Piece((self.fit(right, Level.MIXED),))
        added = (f"{self.sign('-') if minus else '+'} {right.terms[0]}", *right.terms[1:])
        return Piece((*self.signed_terms(left), *added), Level.SUM)

    def array(self, rows: Sequence[Sequence[str]], matrix: bool) -> Piece:
        """Write a matrix, or a vector given as rows of one entry each."""
        lines = [", ".join(row) for row in rows]
        if self.latex and self.inline and not matrix:
            return Piece((rf"({', '.join(lines)})^{{\top}}",), Level.POWER)
        if self.latex:
            body = r" \\ ".join(" & ".join(row) for row in rows)
            return Piece((rf"\begin{{pmatrix}} {body} \end{{pmatrix}}",))
        return Piece((f"[{', '.join(f'[{line}]' if matrix else line for line in lines)}]",))

    def integral(self, integrand: Piece) -> Piece:
        """Integrate over the horizon."""
        low, high = (self.signed(end) for end in self.ends)
        if self.latex:
            sign, end = rf"\int_{braced(low)}^{braced(high)} ", r" \, \mathrm{d}t"
        else:
            above = self.raised(high) or self.power("", replace(self.ends[1], terms=(high,)))
            sign, end = f"∫{self.lowered(low) or '_' + low}{above} ", " dt"
        left, right = "", ""
        if integrand.level < Level.MIXED or integrand.negative:
            tall = self.bracketed(integrand.text) != f"({integrand.text})"
            left, right = (r"\Bigl(", r"\Bigr)") if tall else ("(", ")")
        first, *others = self.signed_terms(integrand)
        *before, last = [sign + left + first, *others]
        return Piece((*before, last + right + end), Level.PRODUCT)

    def relation(self, sides: Sequence[Piece], operators: Sequence[str]) -> Piece:
        """Write a comparison; every side begins a term, so that long ones can be broken there."""
        terms = list(self.signed_terms(sides[0]))
        for name, side in zip(operators, sides[1:], strict=True):
            first, *others = self.signed_terms(side)
            terms += [f"{self.sign(name)} {first}", *others]
        return Piece(tuple(terms), Level.CHOICE)

    def name(self, name: str, at: Piece | None, index: str = "") -> Piece:
        """Write a name, an entry of it, or its value at a time."""
        if name == "t":
            return at or Piece(("t",))
        if name in KNOWN_CONSTANTS:
            return Piece((self.sign(name),))
        symbol = self.symbols.get(name) or read_symbol(name, ())
        text = symbol.text(self.latex)
        if index:
            entry = symbol.entry(index)
            text = entry.text(self.latex) if entry else self.subscripted(f"({text})", index)
        when = f"({self.signed(at)})" if at and name in self.moving else ""
        return Piece((text + when,))

    def subscripted(self, base: str, index: str) -> str:
        """Write an index under something in brackets."""
        return base + Symbol("", (index,)).text(self.latex)


def translated(text: str, table: dict[int, int]) -> str:
    """Translate a text if every character has a counterpart."""
    return text.translate(table) if all(ord(character) in table for character in text) else ""


def double(value: float) -> float:
    """Give the double that a number stands for."""
    try:
        return float(value)
    except OverflowError:
        return inf
