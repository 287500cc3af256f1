"""The cubic through two points with given slopes: numbers or symbols alike."""

from __future__ import annotations

from typing import Any


def hermite(x0: Any, x1: Any, slope0: Any, slope1: Any, h: Any, s: Any) -> Any:
    """Return the value at the fraction s of a step h from x0 to x1 with slopes at its ends."""
    rise = x1 - x0
    bend = (1 - s) * (h * slope0 - rise) - s * (h * slope1 - rise)
    return x0 + s * rise + s * (1 - s) * bend
