"""Names: which ones a problem may use, which words are taken, and the nearest known one."""

from __future__ import annotations

import difflib
import keyword
import re
from collections.abc import Iterable
from typing import Final

from quito_cli.problem.language.functions import BOUNDARY_FUNCTIONS, FUNCTIONS

KNOWN_CONSTANTS: Final = ("pi",)
RESERVED: Final = ("t", *KNOWN_CONSTANTS, *BOUNDARY_FUNCTIONS, *FUNCTIONS)

WORD_OPERATORS: Final = frozenset({"and", "or", "not"})
_LONGEST_SUGGESTED: Final = 60  # the comparison of two names takes the product of their lengths
_NAME: Final = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_LOOPS: Final = frozenset({"for", "in", "while", "async", "await", "yield"})


def is_valid_name(name: str) -> str | None:
    """Say why a state, control, parameter or constant cannot have this name; None if it can."""
    if not name:
        return "a name cannot be empty"
    if name in BOUNDARY_FUNCTIONS or name in FUNCTIONS:
        return f"'{name}' is the name of a function"
    if name in RESERVED:
        return f"'{name}' is reserved: it is {'the time' if name == 't' else 'a known constant'}"
    if keyword.iskeyword(name):
        return f"'{name}' cannot be a name: write {name}_, say"
    if _NAME.fullmatch(name) is None:
        return f"'{name}' is no name: names are letters, digits and '_', and begin with a letter"
    return None


def word_message(word: str) -> str | None:
    """Say why a word of an expression can be neither a name nor an operator; None if it can."""
    if word in WORD_OPERATORS:
        return None
    if word in {"if", "else"}:
        return "there is no 'if ... else' here: write if_else(condition, a, b)"
    if word in _LOOPS:
        return f"'{word}' cannot be a name, and there are no loops here"
    if keyword.iskeyword(word):
        return f"'{word}' cannot be a name: write {word}_, say"
    if word.startswith("_"):
        return f"'{word}' is no name: names begin with a letter"
    return None


def nearest(name: str, known: Iterable[str], cutoff: float) -> str:
    """Give the end of a message that suggests the known name most like this one, or nothing.

    Of equally good ones it is the first; upper and lower case count as the same.
    """
    likeness = {
        other: difflib.SequenceMatcher(None, name.casefold(), other.casefold()).ratio()
        for other in known
        if max(len(name), len(other)) <= _LONGEST_SUGGESTED
    }
    best = max(likeness, key=likeness.__getitem__, default="")
    return f"; did you mean '{best}'?" if best and likeness[best] >= cutoff else ""
