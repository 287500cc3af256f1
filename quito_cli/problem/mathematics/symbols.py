"""Names as letters: subscripts, Greek, accents, bold vectors; in unicode and LaTeX."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Final

SUBSCRIPTS: Final = str.maketrans(
    "0123456789+−aehijklmnoprstuvxβγρφχ", "₀₁₂₃₄₅₆₇₈₉₊₋ₐₑₕᵢⱼₖₗₘₙₒₚᵣₛₜᵤᵥₓᵦᵧᵨᵩᵪ"
)
SUPERSCRIPTS: Final = str.maketrans(
    "0123456789+−abcdefghijklmnoprstuvwxyzT", "⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻ᵃᵇᶜᵈᵉᶠᵍʰⁱʲᵏˡᵐⁿᵒᵖʳˢᵗᵘᵛʷˣʸᶻᵀ"
)
FRACTIONS: Final = {
    Fraction(*map(int, unicodedata.normalize("NFKD", sign).split("\u2044"))): sign
    for sign in "½⅓⅔¼¾⅕⅖⅗⅘⅙⅚⅛⅜⅝⅞"
}
_SMALL_GREEK: Final = (
    "alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu nu xi pi rho sigma tau "
    "upsilon phi chi psi omega"
)
_LARGE_GREEK: Final = "Gamma Delta Theta Lambda Xi Pi Sigma Upsilon Phi Psi Omega"
_GREEK: Final = {
    word: (letter, "\\" + word)
    for word, letter in zip(
        f"{_SMALL_GREEK} {_LARGE_GREEK}".split(), "αβγδεζηθικλμνξπρστυφχψωΓΔΘΛΞΠΣΥΦΨΩ", strict=True
    )
} | {
    "epsilon": ("ε", r"\varepsilon"),
    "eps": ("ε", r"\varepsilon"),
    "phi": ("φ", r"\varphi"),
    "lam": ("λ", r"\lambda"),
}
_ACCENTS: Final = {
    "dot": ("\u0307", r"\dot{%s}"),
    "ddot": ("\u0308", r"\ddot{%s}"),
    "hat": ("\u0302", r"\hat{%s}"),
    "bar": ("\u0304", r"\bar{%s}"),
    "tilde": ("\u0303", r"\tilde{%s}"),
}
_SPECIAL: Final = str.maketrans(
    {c: "\\" + c for c in "_{}#$%&"}
    | {"\\": r"\textbackslash{}", "^": r"\^{}", "~": r"\~{}", "<": r"\(<\)", ">": r"\(>\)"}
)


@dataclass(frozen=True)
class Symbol:
    """A name as it is printed: a letter or word with accents and subscripts."""

    base: str
    subscripts: tuple[str, ...] = ()
    accents: tuple[str, ...] = ()
    shape: tuple[int, ...] = ()
    """Rows, or rows and columns; empty for a scalar."""
    literal: bool = False
    """Print the name as it is typed, since another one would look the same."""
    bold: bool = False

    def text(self, latex: bool) -> str:
        """Write it out."""
        return self._latex() if latex else self._unicode()

    def entry(self, index: str) -> Symbol | None:
        """Give the symbol of an entry, or None where there is a subscript already."""
        if self.literal or self.subscripts:
            return None
        return replace(self, subscripts=(index,), bold=False, shape=())

    def derivative(self, latex: bool) -> str:
        """Write its derivative with respect to time."""
        if not latex and len(_greek(self.base, False)) > 1:
            return f"d {self.text(False)}/dt"
        if self.accents[-1:] == ("dot",):
            return replace(self, accents=(*self.accents[:-1], "ddot")).text(latex)
        return replace(self, accents=(*self.accents, "dot")).text(latex)

    def _unicode(self) -> str:
        if self.literal:
            return self.base
        base = _greek(self.base, False) + "".join(_ACCENTS[accent][0] for accent in self.accents)
        first, *others = [_greek(part, False) for part in self.subscripts] or [""]
        lowered = first.translate(SUBSCRIPTS)
        if any(a == b for a, b in zip(first, lowered, strict=True)):
            return "_".join([base, first, *others])
        if others and not (first.isdigit() and not others[0].isdigit()):
            return "_".join([base, first, *others])
        return "_".join([base + lowered, *others])

    def _latex(self) -> str:
        base = _latex_base(self)
        for accent in self.accents:
            base = _ACCENTS[accent][1] % base
        lowered = ",".join(_latex_subscript(part) for part in self.subscripts)
        return base + (f"_{braced(lowered)}" if lowered else "")


def _latex_base(symbol: Symbol) -> str:
    """Give letter, bold letter or word."""
    if symbol.literal:
        return rf"\mathtt{{{escaped(symbol.base)}}}"
    if symbol.base in _GREEK:
        letter = _GREEK[symbol.base][1]
        return rf"\boldsymbol{{{letter}}}" if symbol.bold else letter
    if symbol.bold:
        return rf"\mathbf{{{symbol.base}}}"
    return symbol.base if len(symbol.base) < 2 else rf"\mathit{{{symbol.base}}}"


def _latex_subscript(part: str) -> str:
    """Words stand upright; letters, numbers and indices do not."""
    if part in _GREEK or len(part) == 1 or not any(map(str.isalpha, part)):
        return _greek(part, True)
    return rf"\mathrm{{{part}}}"


def _greek(word: str, latex: bool) -> str:
    """Give the Greek letter of that name, else the word."""
    return _GREEK.get(word, (word, word))[latex]


def braced(text: str) -> str:
    """Return a LaTeX argument: in braces where it is more than a character."""
    return text if len(text) == 1 else f"{{{text}}}"


def escaped(text: str) -> str:
    """Write a text so that LaTeX prints it as it stands."""
    return text.translate(_SPECIAL)


def read_symbols(shapes: Mapping[str, tuple[int, ...]]) -> dict[str, Symbol]:
    """Give the symbols of all names; names that would look the same keep their spelling."""
    symbols = {name: read_symbol(name, shape) for name, shape in shapes.items()}
    looks = ["t", "π", *(symbol.text(False) for symbol in symbols.values())]
    for name, symbol in symbols.items():
        if looks.count(symbol.text(False)) > 1:
            symbols[name] = Symbol(name, shape=symbol.shape, literal=True)
    return symbols


def read_symbol(name: str, shape: tuple[int, ...]) -> Symbol:
    """Take a name apart: `x1`, `v_max`, `beta_hat`."""
    head, *rest = name.split("_")
    base, digits = re.fullmatch(r"(.*?)(\d*)", head, re.DOTALL).groups()  # type: ignore[union-attr]
    if not base or re.search(r"\d", base):
        base, digits = head, ""
    single = len(_greek(base, False)) == 1
    accents = tuple(part for part in rest if single and part in _ACCENTS)
    parts = (digits, *(part for part in rest if not (single and part in _ACCENTS)))
    subscript = tuple(part for part in parts if part)
    return Symbol(base, subscript, accents, shape, bold=len(shape) == 1)
