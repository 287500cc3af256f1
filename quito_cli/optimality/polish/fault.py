"""An inequality that does not hold."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.polish.structure import Held

Array = NDArray[np.float64]
What = Literal["vanished", "sign", "beyond", "violated", "pull", "curvature", "end"]

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


def runs(wrong: Array, t: Array) -> Iterator[Run]:
    """Give the stretches in which something is positive; (n,) in order of time."""
    flags = np.concatenate([[False], wrong > 0, [False]])
    edges = np.flatnonzero(flags[1:] != flags[:-1])
    for a, b in zip(edges[::2], edges[1::2], strict=True):
        first, last = max(a - 1, 0), min(b, len(t) - 1)
        worst = int(a + np.argmax(wrong[a:b]))
        yield Run(float(t[first]), float(t[last]), float(wrong[worst]), worst)
