"""What the parts of the page share: words among formulas, letters, equations as lines."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from quito_cli.optimality.symbols.formulas import Formulas
from quito_cli.optimality.symbols.probes import Probe
from quito_cli.optimality.symbols.reading import Reader, constant
from quito_cli.optimality.symbols.wording import Writer
from quito_cli.problem.mathematics.notation import Level, Piece
from quito_cli.problem.mathematics.page import Line
from quito_cli.problem.mathematics.symbols import escaped
from quito_cli.problem.model import labels

if TYPE_CHECKING:
    import casadi as ca

MOST_LINES = 12
"""States, controls, or rows of constraints that are written out."""

_LETTERS = {
    "sigma": (("σ", r"\sigma"), ("ς", r"\varsigma")),
    "eta": (("η", r"\eta"), ("χ", r"\chi")),
} | {
    plain: ((plain, plain), (script, rf"\mathcal{{{plain}}}"))
    for plain, script in zip("ABCDHNS", "𝒜ℬ𝒞𝒟ℋ𝒩𝒮", strict=True)
}
"""Letters of the derivation, unicode and LaTeX, and others where the problem has them itself."""


@dataclass(frozen=True, eq=False)
class Setting:
    """How the page is written."""

    of: Formulas
    probe: Probe

    @property
    def latex(self) -> bool:
        """Whether it is LaTeX."""
        return self.of.notation.latex

    def maths(self, unicode: str, latex: str) -> Piece:
        """Give a formula that has both forms."""
        return Piece((latex if self.latex else unicode,))

    def say(self, *parts: str | Piece) -> Line:
        """Write words and formulas on one line."""
        return Line((self.joined(*parts),))

    def joined(self, *parts: str | Piece) -> str:
        """Write words and formulas side by side."""
        return "".join(
            self._words(part) if isinstance(part, str) else self._text(part) for part in parts
        )

    def _text(self, piece: Piece) -> str:
        return self.of.notation.signed(piece)

    def _words(self, words: str) -> str:
        if not self.latex or not words:
            return words
        signs = {"≥": r"}\ge\text{", "≤": r"}\le\text{"}
        text = escaped(words)
        for sign, written in signs.items():
            text = text.replace(sign, written)
        return rf"\text{{{text}}}".replace(r"\text{}", "")

    def equation(self, left: Piece, right: Piece | None, *words: str | Piece) -> Line:
        """Write an equation to be broken between summands, with words behind it."""
        head = f"{self._text(left)} = "
        if right is None:
            return Line((self.joined("(too long to write out)"),), head)
        *terms, last = self.of.notation.signed_terms(right)
        return Line((*terms, last + self.joined(*words)), head)

    def quotient(self, left: Piece, expression: ca.SX, *words: str | Piece) -> Iterator[Line]:
        """Write an equation whose right side is one fraction; a long one in three lines."""
        above, below = self.of.fraction(expression)
        if above is None or below is None:
            whole = self.of.quotients(expression)[0]
            yield self.equation(left, whole, *words)
            return
        n, d = self.letter("N"), self.letter("D")
        yield self.equation(left, self.of.notation.quotient(n, d), ", where", *words)
        yield self.equation(n, above)
        yield self.equation(d, below)

    def letter(self, name: str) -> Piece:
        """Give a letter of the derivation, or another one where the problem uses it."""
        usual, other = _LETTERS[name]
        taken = any(s.text(False) == usual[0] for s in self.of.notation.symbols.values())
        return self.maths(*(other if taken else usual))

    def slope(self, above: Piece, below: Piece) -> Piece:
        """Write a partial derivative."""
        a, b = self._text(above), self._text(below)
        return self.maths(f"∂{a}/∂{b}", rf"\partial {a}/\partial {b}")

    def pull(self, below: Piece) -> Piece:
        """Write what a constraint's multiplier does, η ∂C/∂x."""
        slope = self.slope(self.letter("C"), below)
        return Piece((self.joined(self.letter("eta"), self.maths(" ", r"\,"), slope),))

    @cached_property
    def adjoint(self) -> Piece:
        """dλ/dt = −∂H/∂x."""
        slope = self._text(self.slope(self.letter("H"), self.maths("x", "x")))
        return self.maths(f"dλ/dt = −{slope}", rf"\dot\lambda = -{slope}")

    @cached_property
    def costate_is(self) -> Piece:
        """λ = ∂V/∂x, V the least cost to go."""
        return self.maths(
            "λ = ∂V/∂x, V the least cost to go",
            r"\lambda = \partial V/\partial x,\ V \text{ the least cost to go}",
        )

    def rate(self, i: int) -> Piece:
        """Write the time derivative of a costate."""
        notation = self.of.notation
        name, _, index = self.of.costates[i].partition("[")
        symbol = notation.symbols[name]
        entry = symbol.entry(str(int(index[:-1]) + 1)) if index else symbol
        return Piece(((entry or symbol).derivative(self.latex),))

    def named(self, label: str) -> Piece:
        """Write a state, control, costate or parameter, or an entry of one."""
        piece = self.of.piece(label)
        return piece or Piece((label,), Level.ATOM)

    def at_end(self, name: str, which: str) -> Piece:
        """Write a state or costate, or an entry of one, at an end."""
        base, _, index = name.partition("[")
        return self.named(f"{which}({base})" + (f"[{index}" if index else ""))

    def derived(self, letter: Piece, degree: int) -> Piece:
        """Write a time derivative of a letter."""
        text = self._text(letter)
        if self.latex:
            dots = {0: text, 1: rf"\dot{{{text}}}", 2: rf"\ddot{{{text}}}"}
            return Piece((dots.get(degree, f"{text}^{{({degree})}}"),))
        raised = self.of.notation.raised(str(degree))
        return Piece(
            (
                text
                if not degree
                else f"d{text}/dt"
                if degree == 1
                else f"d{raised}{text}/dt{raised}",
            )
        )

    def control(self, i: int) -> Piece:
        """Write an entry of u."""
        return self.named(labels(self.of.system.model.controls)[i])

    def number(self, value: float) -> Piece:
        """Write a number."""
        if len(f"{value:.15g}") < 9:
            return self.of.notation.number(value)
        text = Writer(Reader(()), (), ()).text(constant(value))
        return self.of.piece(text) or self.of.notation.number(value)

    @cached_property
    def used_constants(self) -> set[str]:
        """Names of the constants that the derivation may show."""
        import casadi as ca

        system = self.of.system
        whole = ca.vertcat(system.hamiltonian, system.model.mayer)
        names = system.constants.names
        symbols = system.constants.symbols
        return {name for i, name in enumerate(names) if ca.depends_on(whole, symbols[i])}

    def one(self, expression: ca.SX) -> Piece | None:
        """Write a scalar."""
        return self.of.values(expression)[0]
