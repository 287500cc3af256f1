"""An inequality that does not hold."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.polish.equations.structure import Held
from quito_cli.transcription.legendre import Nodes

Array = NDArray[np.float64]
What = Literal["vanished", "sign", "beyond", "violated", "pull", "curvature", "end"]

OFFSETS = (1 - np.cos(np.linspace(0.0, np.pi, 25))) / 2
"""Where every segment is looked at: Chebyshev's points, from which it is known between them."""
FINELY = np.linspace(0.0, 1.0, 97)
"""Where what is known from `OFFSETS` is looked at."""
SLIGHT = 1e-7
"""Wrong by this much of its size is rounding, where a function touches zero."""


@dataclass(frozen=True)
class Fault:
    """An inequality that does not hold."""

    what: What
    start: float
    end: float
    """From when to when."""
    amount: float
    """Over the size of what it is of."""
    sentence: str
    phase: int = -1
    control: int = -1
    held: Held | None = None
    """The row."""
    upper: bool = False
    """Of `beyond`: which bound; of `sign`: at which it is now."""


@dataclass(frozen=True)
class Run:
    """A stretch of time in which something is wrong."""

    start: float
    end: float
    amount: float
    worst: int
    """Entry at which it is worst."""

    @property
    def when(self) -> str:
        """For a reader."""
        return f"from {self.start:.6g} to {self.end:.6g}"


@lru_cache(maxsize=1)
def _weights() -> Array:
    return Nodes(OFFSETS).weights(FINELY)


def finely(wrong: Array, t: Array) -> tuple[Array, Array]:
    """Return values at `FINELY` by those at `OFFSETS` of each segment, with peaks between them.

    What is wrong between two points may be so nowhere else: of a peak that is within the bounds at
    all points, the parabola through three of them tells the height.

    Args:
        wrong: (K · len(OFFSETS),), smooth inside each of K segments.
        t: the same.

    Returns:
        Both, (K · len(FINELY),).
    """
    values, times = (v.reshape(-1, len(OFFSETS)) @ _weights().T for v in (wrong, t))
    before, here, after = values[:, :-2], values[:, 1:-1], values[:, 2:]
    bend = before - 2 * here + after
    peak = (here >= before) & (here >= after) & (bend < 0)
    rise = (after - before) ** 2 / np.where(peak, -8 * bend, np.inf)
    values[:, 1:-1] = here + np.where(peak, rise, 0.0)
    return values.ravel(), times.ravel()


def runs(wrong: Array, t: Array) -> Iterator[Run]:
    """Give the stretches in which something is positive; (n,) in order of time."""
    flags = np.concatenate([[False], wrong > 0, [False]])
    edges = np.flatnonzero(flags[1:] != flags[:-1])
    for a, b in zip(edges[::2], edges[1::2], strict=True):
        first, last = max(a - 1, 0), min(b, len(t) - 1)
        worst = int(a + np.argmax(wrong[a:b]))
        yield Run(float(t[first]), float(t[last]), float(wrong[worst]), worst)
