"""What a case may take."""

from __future__ import annotations

import re
from dataclasses import dataclass

from quito_cli.errors import UsageError

_UNITS = {"": 1, "b": 1, "kb": 10**3, "mb": 10**6, "gb": 10**9, "tb": 10**12}
_SIZE = re.compile(r"\s*([0-9]+(?:\.[0-9]+)?)\s*([A-Za-z]*)\s*")
LEAST_MEMORY = 100_000_000
"""Bytes that Python and CasADi need by themselves, about."""

MOST_MEMORY = 2**60
"""Bytes that no machine has."""


@dataclass(frozen=True)
class Limits:
    """Of one case; None where there is none."""

    seconds: float | None
    """Of time, from when the solver's modules are loaded."""
    memory: int | None
    """Bytes of resident memory, of its process and all that it starts."""


def bytes_of(text: str | int) -> int:
    """Return a size written as `500 MB`, `2GB` or a number of bytes.

    Raises:
        UsageError: it is not written so, or too small for anything to be solved in.
    """
    found = _SIZE.fullmatch(str(text))
    factor = _UNITS.get(found[2].lower()) if found else None
    if found is None or factor is None:
        raise UsageError(f"expected a size such as 500 MB or 2 GB, got {str(text)[:80]!r}")
    number = float(found[1])
    if number * factor > MOST_MEMORY:
        raise UsageError(f"{str(text)[:20]} is more than there is: write such as 500 MB or 2 GB")
    size = int(number * factor)
    if size < LEAST_MEMORY:
        raise UsageError(f"{text} is too little for any solve: write 100 MB or more")
    return size
