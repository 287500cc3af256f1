"""Times as they are known."""

from __future__ import annotations

import math

_DIGITS = 12
"""Digits of a time after the point, at most."""


def instant(time: float, uncertainty: float) -> str:
    """Return a time to as many digits as it is known."""
    if not uncertainty > 0:
        return f"{time:.10g}"
    digits = min(max(math.ceil(-math.log10(uncertainty)), 0), _DIGITS)
    return f"{time:.{digits}f} ± {uncertainty:.0e}"
