"""The text of an expression, split into numbers, names and symbols before it is parsed.

Python's parser says "invalid syntax" to most of what people get wrong in a formula, and it accepts
much that has no place there. So the text is read here first, with the user's own character offsets,
and what may never occur in a formula is refused with a word on what to write instead.
"""

from __future__ import annotations

import math
import re
import unicodedata
from typing import Final, NamedTuple

from quito_cli.problem.language.hints import (
    DOTTED_INFINITY,
    About,
    attribute_message,
    degrees,
)
from quito_cli.problem.language.names import word_message

MAX_LENGTH: Final = 10_000

_TOKEN: Final = re.compile(
    r"(?P<blank>[ \t\r\n]+)"
    r"|(?P<number>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)"
    r"|(?P<symbol>(?<=[0-9])_|\*\*|//|<<|>>|<=|>=|==|!=|:=|=<|=>|&&|\|\||[-+*/^@<>=!&|~%,:;.?()\[\]{}])"
    r"|(?P<name>[A-Za-z_][A-Za-z0-9_]*)"
    r"|(?P<other>.)",
    re.DOTALL,
)

_BRACES: Final = "braces are not allowed: write ( ) to group and [ ] for a list"
_EQUALS: Final = (
    "a single '=' has no meaning here: a comparison is written '==', "
    "and arguments are given by position"
)
_QUOTED: Final = "quoted text is not allowed: an expression holds numbers, names and operators"
_REFUSED: Final = {
    "//": "'//' is not an operator here: a division is written '/'",
    "%": "'%' is not an operator here: there is no remainder",
    "<<": "'<<' is not an operator here: there are no bit operations",
    ">>": "'>>' is not an operator here: there are no bit operations",
    "&": "'&' is not an operator here: write 'and'",
    "&&": "'&&' is not an operator here: write 'and'",
    "|": "'|' is not an operator here: write 'or'",
    "||": "'||' is not an operator here: write 'or'",
    "!": "'!' is not an operator here: write 'not'",
    "~": "'~' is not an operator here: write 'not'",
    "?": "'?' is not an operator here: write if_else(condition, a, b)",
    ":=": "nothing can be assigned inside an expression",
    "=<": "'=<' is not an operator: write '<='",
    "=>": "'=>' is not an operator: write '>='",
    "=": _EQUALS,
    "_": "the digits of a number stand together, without '_'",
    ".": "'.' can only be a decimal point: names have no attributes here",
    ";": "';' is not allowed: this has to be one expression",
    "#": "'#' is not allowed inside an expression: a comment belongs to the YAML around it",
    "{": _BRACES,
    "}": _BRACES,
    '"': _QUOTED,
    "'": _QUOTED,
    "\N{MINUS SIGN}": "this minus sign is not the one of the keyboard: write '-'",
    "\N{EN DASH}": "this dash is not the minus of the keyboard: write '-'",
    "\N{MULTIPLICATION SIGN}": "a product is written '*'",
    "\N{MIDDLE DOT}": "a product is written '*'",
    "\N{DIVISION SIGN}": "a division is written '/'",
    "\N{SUPERSCRIPT TWO}": "a power is written '^2'",
    "\N{SUPERSCRIPT THREE}": "a power is written '^3'",
    "\N{LESS-THAN OR EQUAL TO}": "this comparison is written '<='",
    "\N{GREATER-THAN OR EQUAL TO}": "this comparison is written '>='",
    "\N{NOT EQUAL TO}": "this comparison is written '!='",
    "\N{GREEK SMALL LETTER PI}": "the number is written 'pi'",
    "\N{INFINITY}": DOTTED_INFINITY,
}

_PRIME: Final = (
    "a prime has no meaning here: a transpose is written transpose(...), "
    "and a line of `dynamics` is the derivative itself"
)
_OPENED: Final = {
    "|": "an absolute value is written abs(...)",
    "||": "the length of a vector is written norm(...)",
}
"""What is said of symbols where an operand has to begin."""


class ExpressionError(Exception):
    """What is wrong with an expression, and where in the text as the user wrote it.

    `offset` counts characters from 0; `length` is the number of characters to underline. `about`
    is for those who know more than the parser: which names there are.
    """

    def __init__(self, message: str, offset: int, length: int, about: About | None = None) -> None:
        super().__init__(message, offset, length)
        self.about = about
        self.message = message
        self.offset = offset
        self.length = length

    def __str__(self) -> str:
        return self.message


class Token(NamedTuple):
    """One number, name or symbol at its place in the text."""

    kind: str
    text: str
    offset: int

    def error(self, message: str, about: About | None = None) -> ExpressionError:
        """Give the complaint that points at this token."""
        return ExpressionError(message, self.offset, len(self.text), about)


def read_tokens(text: str) -> list[Token]:
    """Split the text of one expression into its tokens.

    Raises:
        ExpressionError: for a character, a symbol or a word that no expression has.
    """
    if len(text) > MAX_LENGTH:
        message = f"the expression is too long: {len(text)} characters, at most {MAX_LENGTH}"
        raise ExpressionError(message, MAX_LENGTH, 1)
    matches = (match for match in _TOKEN.finditer(text) if match.lastgroup != "blank")
    tokens = [Token(str(match.lastgroup), match.group(), match.start()) for match in matches]
    if not tokens:
        raise ExpressionError("the expression is empty", 0, len(text))
    for i, token in enumerate(tokens):
        if remedy := _message_among(tokens, i):
            raise token.error(remedy)
        _refuse_alone(token)
    return tokens


def _message_among(tokens: list[Token], i: int) -> str | None:
    """Say what a symbol was meant to be where its neighbours tell."""
    token, before = tokens[i], tokens[i - 1] if i else None
    after = tokens[i + 1].text if i + 1 < len(tokens) else ""
    if token.text == "." and after in ("inf", "Inf", "INF"):
        return DOTTED_INFINITY
    if token.text == "\N{DEGREE SIGN}":
        return degrees(before.text if before is not None and before.kind == "number" else "")
    if before is None or not (before.kind in ("number", "name") or before.text in ")]"):
        return _OPENED.get(token.text)
    if token.text == "'" and sum(other.text == "'" for other in tokens) % 2:
        return _PRIME  # and no quotes around a text
    return _after_operand(before, token, after)


def _after_operand(before: Token, token: Token, after: str) -> str | None:
    """Say what a symbol between an operand and what comes next was meant to be."""
    if token.text == "." and before.kind == "name":
        return attribute_message(before.text, after)
    if token.text == "%" and before.kind == "number" and not after:
        return f"a percentage is written as a number, {before.text}/100"
    return None


def _refuse_alone(token: Token) -> None:
    """Refuse a token that is wrong wherever it stands."""
    if token.kind != "name" and token.text in _REFUSED:
        raise token.error(_REFUSED[token.text])
    if token.kind == "other":
        raise token.error(_character_message(token.text))
    if token.kind == "name":
        message = word_message(token.text)
        if message is not None:
            raise token.error(message, About("name", token.text))
    if token.kind == "number":
        if math.isinf(float(token.text)):
            raise token.error("this number is not finite: it is too large for a double")
        if len(token.text) > 1 and token.text.isdigit() and token.text.startswith("0"):
            raise token.error(
                f"a whole number has no leading zeros: write {int(token.text[-300:])}"
            )


def _character_message(character: str) -> str:
    """Name a character that is not allowed, even if it cannot be seen."""
    code = f"U+{ord(character):04X}"
    name = unicodedata.name(character, "a control character")
    shown = f"'{character}' " if character.isprintable() and not character.isspace() else ""
    return (
        f"the character {shown}({code}, {name}) is not allowed: names and numbers are plain ASCII"
    )
