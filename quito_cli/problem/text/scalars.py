"""Plain scalars by the core schema of YAML 1.2, without octal and hexadecimal numbers.

`1e-3` is a number; `yes`, `1:30` and `017` are text.
"""

from __future__ import annotations

import re

_DIGITS = 300  # of an integer; a longer one may not fit a float
_INTEGER = re.compile(r"[-+]?(?:0|[1-9][0-9]*)")
_REAL = re.compile(
    r"(?![-+]?0[0-9]+\Z)[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?"
    r"|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)"
)
_WORDS: dict[str, bool | None] = dict.fromkeys(("", "~", "null", "Null", "NULL"))
_WORDS |= dict.fromkeys(("true", "True", "TRUE"), True)
_WORDS |= dict.fromkeys(("false", "False", "FALSE"), False)


def resolve(written: str) -> str | int | float | bool | None:
    """Return what a plain scalar means."""
    if written in _WORDS:
        return _WORDS[written]
    if _INTEGER.fullmatch(written) and len(written) <= _DIGITS:
        return int(written)
    if not _REAL.fullmatch(written):
        return written
    return float(written.replace(".", "") if written[-1] in "fFnN" else written)
