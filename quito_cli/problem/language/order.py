"""The order of the tokens of an expression: operands and operators alternate, brackets match.

This finds in words, and at the right place, nearly all that Python's parser would call invalid
syntax. It also bounds what makes a parser recurse: open brackets, and rows of signs and powers.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from quito_cli.problem.language.functions import FUNCTIONS
from quito_cli.problem.language.hints import About
from quito_cli.problem.language.names import WORD_OPERATORS
from quito_cli.problem.language.tokens import Token

MAX_BRACKETS: Final = 50
MAX_DEPTH: Final = 200
TOO_DEEP: Final = (
    f"more than {MAX_DEPTH} operations are chained or nested: "
    "name parts of it as expressions of their own"
)

_PREFIXES: Final = frozenset({"+", "-", "not"})
_CLOSERS: Final = {"(": ")", "[": "]"}


def check_order(tokens: Iterable[Token]) -> None:
    """Check that the tokens of a text may follow each other as they do.

    Raises:
        ExpressionError: with the token that cannot stand where it does.
    """
    order = _Order()
    for token in tokens:
        order.take(token)
    order.finish()


class _Bracket(NamedTuple):
    """An open bracket and what it is for: a group, a call, a list or an index."""

    token: Token
    role: str


@dataclass
class _Order:
    """Follows the tokens from left to right and knows which may come next."""

    brackets: list[_Bracket] = field(default_factory=list)
    before: Token | None = None
    chains: list[int] = field(default_factory=lambda: [0])
    """Signs and powers in a row inside every open bracket: the parser's stack grows with them."""

    def take(self, token: Token) -> None:
        """Accept the next token or say why it cannot stand here."""
        check = self._take_after_operand if self._operand_ended() else self._take_before_operand
        role = check(token)
        self._count_chain(token, prefix=check == self._take_before_operand)
        if token.text in _CLOSERS:
            self.brackets.append(_Bracket(token, role))
            self.chains.append(0)
            if len(self.brackets) > MAX_BRACKETS:
                raise token.error(f"brackets are nested more than {MAX_BRACKETS} deep")
        elif token.text in _CLOSERS.values():
            self.brackets.pop()
            self.chains.pop()
        self.before = token

    def finish(self) -> None:
        """Refuse a text that ends too early."""
        if self.brackets:
            opener = self.brackets[-1].token
            raise opener.error(f"this '{opener.text}' is never closed")
        if self.before is not None and not self._operand_ended():
            raise self.before.error(f"something is missing after '{self.before.text}'")

    def _count_chain(self, token: Token, *, prefix: bool) -> None:
        """Refuse a tower of powers or a row of signs before the parser gets to see it."""
        if token.text in {"^", "**"} or (prefix and token.text in _PREFIXES):
            self.chains[-1] += 1
            if sum(self.chains) > MAX_DEPTH:
                raise token.error(TOO_DEEP)
        elif token.kind == "symbol" and token.text not in "()[]":
            self.chains[-1] = 0

    def _operand_ended(self) -> bool:
        """Tell whether what came before is a complete operand."""
        if self.before is None or self.before.text in WORD_OPERATORS:
            return False
        return self.before.kind in {"number", "name"} or self.before.text in _CLOSERS.values()

    def _role(self) -> str:
        """Give the role of the innermost open bracket."""
        return self.brackets[-1].role if self.brackets else "none"

    def _take_before_operand(self, token: Token) -> str:
        """Check a token where an operand has to begin; give the role of an opening bracket."""
        text = token.text
        last = self.before.text if self.before is not None else ""
        if text in _CLOSERS.values():
            opener = self._matching(token)
            colon_ended = opener.role == "index" and last == ":"
            if opener.token is self.before and opener.role != "call":
                raise token.error(f"nothing stands between '{last}' and '{text}'")
            if opener.token is not self.before and not colon_ended:
                raise token.error(f"something is missing between '{last}' and '{text}'")
        elif token.kind == "symbol" and text not in _CLOSERS and text not in _PREFIXES:
            open_slice = self._role() == "index" and (
                (text == ":" and last in {"[", ",", ":"}) or (text == "," and last == ":")
            )
            if not open_slice:
                where = f"between '{last}' and '{text}'" if last else f"before '{text}'"
                raise token.error(f"something is missing {where}")
        elif text in {"and", "or"}:
            raise token.error(f"something is missing before '{text}'")
        return "group" if text == "(" else "list"

    def _take_after_operand(self, token: Token) -> str:
        """Check a token that follows an operand; give the role of an opening bracket."""
        assert self.before is not None
        text = token.text
        if text in _CLOSERS.values():
            self._matching(token)
        elif text == ",":
            self._check_comma(token)
        elif text == ":" and self._role() != "index":
            raise token.error("':' can only stand inside an index such as x[0:2]")
        elif text == "(" and self.before.kind == "name":
            return "call"
        elif text == "[" and self.before.kind != "number":
            return "index"
        elif token.kind in {"number", "name"} or text in _CLOSERS:
            self._refuse_neighbours(token)
        return "none"

    def _refuse_neighbours(self, token: Token) -> None:
        """Refuse two operands side by side, unless the second is `and` or `or`."""
        assert self.before is not None
        last, text = self.before, token.text
        if text in {"and", "or"}:
            return
        if text == "not":
            raise token.error(f"an operator is missing between '{last.text}' and 'not'")
        touching = last.offset + len(last.text) == token.offset
        if last.kind == "number" and touching and text.startswith("."):
            raise token.error("a number has one decimal point")
        if last.text in FUNCTIONS:
            raise token.error(f"arguments stand in round brackets: write {last.text}(...)")
        if last.text in _CLOSERS.values() or text in _CLOSERS:
            raise token.error(
                f"a product needs its '*': write it between '{last.text}' and '{text}'"
            )
        unit = last.kind == "number" and token.kind == "name"
        raise token.error(
            f"a product needs its '*': write {last.text}*{text}",
            About("unit", text, last.text) if unit else None,
        )

    def _check_comma(self, token: Token) -> None:
        """Allow a comma between arguments, entries and indices only."""
        assert self.before is not None
        if self._role() in {"call", "list", "index"}:
            return
        if self.before.kind == "number" and self.before.text.isdigit():
            raise token.error("a decimal comma is not understood: write a decimal point")
        raise token.error("',' can only separate the arguments of a function or entries of a list")

    def _matching(self, closer: Token) -> _Bracket:
        """Give the innermost open bracket, which has to fit the closing one."""
        if not self.brackets:
            raise closer.error(f"this '{closer.text}' has no opening bracket")
        opener = self.brackets[-1]
        if _CLOSERS[opener.token.text] != closer.text:
            place = f"'{opener.token.text}' opened at character {opener.token.offset + 1}"
            raise closer.error(f"'{closer.text}' cannot close the {place}")
        return opener
