"""Controls with kinks taken apart, so that nothing has one any more.

Where H has kinks at b_1 < … < b_m in a control, that control becomes m + 1 parts of one sign each,

    u = b_1 − v_0 + v_1 + … + v_m,    0 ≤ v_0 ≤ b_1 − lower,    0 ≤ v_j ≤ b_{j+1} − b_j,

and a term φ(u) of costs, dynamics and constraints becomes one that is smooth in every part,

    φ_0(b_1 − v_0) + Σ_j φ_j(b_j + v_j) − φ_j(b_j),

φ_j its branch between b_j and b_{j+1}: |u| becomes v_0 + v_1, v_0 = max(−u, 0) and v_1 = max(u, 0).
They are the same as long as parts are filled in order, v_j > 0 only where what is below is full.
H of the parts is never below the least H of u then, so that parts in order that minimise it give a
u that does. At rest on a kink two parts are at bounds, where H_v ≥ 0 of the one and H_v ≤ 0 or ≥ 0
of the other say that zero is between the slopes of H on either side: the subdifferential has it
(F. H. Clarke, Optimization and Nonsmooth Analysis, 1983, section 5.2). Bang-off-bang is bang-bang
of the parts, its junctions where the slope on one side is zero. Where H is concave at a kink
minimising parts are out of order, and the answer is none.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import accumulate, pairwise

import numpy as np
from numpy.typing import NDArray

from quito_cli.problem.model import Bounds, Model

Array = NDArray[np.float64]

LEAST = 1e-6
"""Range of a control without bounds that does nothing."""


@dataclass(frozen=True)
class Cut:
    """A control, and where it has kinks."""

    label: str
    unit: str
    lower: float
    upper: float
    sites: tuple[float, ...]
    """Within its bounds, increasing; none of a control that stays whole."""

    @property
    def ends(self) -> tuple[float, ...]:
        """Where its parts begin and end, one more than parts."""
        return (self.lower, *self.sites, self.upper)

    @property
    def count(self) -> int:
        """Parts."""
        return len(self.sites) + 1

    @property
    def bounds(self) -> Bounds:
        """Of its parts, (count,) each."""
        if not self.sites:
            return Bounds(np.array([self.lower]), np.array([self.upper]))
        return Bounds(np.zeros(self.count), np.diff(self.ends))

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of its parts."""
        if not self.sites:
            return (self.label,)
        inner = (f"{self.label}({a:g}…{b:g})" for a, b in pairwise(self.sites))
        return f"{self._from(self.sites[0])}⁻", *inner, f"{self._from(self.sites[-1])}⁺"

    def _from(self, site: float) -> str:
        if site == 0:
            return self.label
        return f"({self.label} {'-' if site > 0 else '+'} {abs(site):g})"

    @property
    def told(self) -> str:
        """What it is the sum of."""
        first, *rest = self.labels
        start = f"{self.sites[0]:g} - " if self.sites[0] else "-"
        return f"{self.label} = {start}{' + '.join([first, *rest])}"

    def split(self, u: Array) -> Array:
        """Return the parts, (points, count), of values (points,)."""
        if not self.sites:
            return u[:, None]
        widths = [*np.diff(self.sites), np.inf]
        above = [np.clip(u - b, 0.0, w) for b, w in zip(self.sites, widths, strict=True)]
        return np.column_stack([np.maximum(self.sites[0] - u, 0.0), *above])

    def merged(self, parts: Array) -> Array:
        """Return values, (points,), of parts (points, count)."""
        if not self.sites:
            return parts[:, 0]
        return np.asarray(self.sites[0] - parts[:, 0] + parts[:, 1:].sum(axis=1))

    def disorder(self, parts: Array) -> Array:
        """Return what is in a part while the one below has room, (points,); zero in order."""
        if not self.sites:
            return np.zeros(len(parts))
        room = np.diff(self.ends) - parts
        room[:, 0] = parts[:, 0]  # counted downwards
        return np.asarray(np.minimum(room[:, :-1], parts[:, 1:]).max(axis=1))


@dataclass(frozen=True, eq=False)
class Parts:
    """A Model, and the one of its controls' parts."""

    whole: Model
    model: Model
    cuts: tuple[Cut, ...]
    """By control of the whole."""

    @property
    def places(self) -> tuple[slice, ...]:
        """Where the parts of each control are among all."""
        ends = tuple(accumulate((cut.count for cut in self.cuts), initial=0))
        return tuple(slice(*pair) for pair in pairwise(ends))

    @property
    def told(self) -> str:
        """What controls are the sums of; empty where a side of each kink is beyond its bounds."""
        return "; ".join(cut.told for cut in self.cuts if cut.sites)

    def split(self, u: Array) -> Array:
        """Return all parts, (points, parts), of controls (points, n_u)."""
        columns = [cut.split(u[:, i]) for i, cut in enumerate(self.cuts)]
        return np.hstack([np.zeros((len(u), 0)), *columns])

    def merged(self, parts: Array) -> Array:
        """Return controls, (points, n_u), of parts (points, parts)."""
        found = [c.merged(parts[:, at]) for c, at in zip(self.cuts, self.places, strict=True)]
        return np.column_stack(found)

    def disorder(self, parts: Array) -> Array:
        """Return `Cut.disorder` of every control, over its range, (points, n_u)."""
        found = []
        for cut, at in zip(self.cuts, self.places, strict=True):
            span = cut.upper - cut.lower
            size = span if np.isfinite(span) else np.abs(parts[:, at]).max(initial=LEAST)
            found.append(cut.disorder(parts[:, at]) / (size or 1.0))
        return np.column_stack(found)
