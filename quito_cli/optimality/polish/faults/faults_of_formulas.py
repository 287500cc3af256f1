"""Formulas that jump along an extremal: a comparison of states that changes in the midst of an arc.

What is looked at between the points of segments may miss a jump, and one back soon after: a band of
states in which something else holds. So it is the arguments of corners that are followed. Where one
is zero others are looked at again, since in abs(x − 1) < 1e-4 the corner of abs tells where the
comparison changes. At each zero the formulas of both sides are compared.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.polish.faults.dense import Dense, Piece
from quito_cli.optimality.polish.faults.fault import FINELY, Fault

if TYPE_CHECKING:
    import casadi as ca

Array = NDArray[np.float64]

BESIDE = 1e-9
"""Part of a segment on either side of a zero at which formulas are compared."""
JUMPS = 1e-6
"""Part of its size by which a formula jumps at least."""
CLOSE = 40
"""Halvings of what a zero is within."""


def jumping(dense: Dense, _: tuple[Piece, ...]) -> Iterator[Fault]:
    """Give where a formula of the problem jumps inside an arc."""
    found = dense.system.setting.corners
    if found is None:
        return
    for k, segments in enumerate(dense.at.phases):
        fine = dense.piece(k, FINELY)
        values = dense.along(found.arguments, k, fine)[0].reshape(*fine.t.shape, -1)
        for j in range(segments.count):
            at = _Segment(dense, k, j, found.arguments)
            offsets = np.unique([*FINELY, *at.zeros(FINELY, values[j])])
            if len(offsets) == len(FINELY):
                continue
            for zero in at.zeros(offsets, np.array([at.values(s) for s in offsets])):
                yield from _jump(at, zero, found.formulas)


class _Segment:
    """A segment of a phase, evaluated at single offsets."""

    def __init__(self, dense: Dense, k: int, j: int, arguments: ca.Function) -> None:
        self.dense, self.k, self.j, self.arguments = dense, k, j, arguments

    def along(self, function: ca.Function, offset: float) -> tuple[float, Array]:
        """Return the time and the values of a function."""
        whole, own = self.dense.piece(self.k, np.array([offset])), slice(self.j, self.j + 1)
        piece = Piece(*(part[own] for part in (whole.t, whole.y, whole.z, whole.u)))
        return float(piece.t[0, 0]), self.dense.along(function, self.k, piece)[0][0]

    def values(self, offset: float) -> Array:
        """Return the arguments of corners."""
        return self.along(self.arguments, offset)[1]

    def zeros(self, offsets: Array, values: Array) -> list[float]:
        """Return offsets at which an argument, known at some, changes its sign."""
        found = []
        for i, signs in enumerate(np.sign(values.T)):
            for a, b in pairwise(np.flatnonzero(signs)):
                if signs[a] != signs[b]:
                    found.append(self._bisected(i, float(offsets[a]), float(offsets[b])))
        return found

    def _bisected(self, i: int, low: float, high: float) -> float:
        sign = np.sign(self.values(high)[i])
        for _ in range(CLOSE):
            middle = (low + high) / 2
            if np.sign(self.values(middle)[i]) == sign:
                high = middle
            else:
                low = middle
        return high


def _jump(at: _Segment, zero: float, formulas: ca.Function) -> Iterator[Fault]:
    sides = [max(zero - BESIDE, 0.0), min(zero + BESIDE, 1.0)]
    (time, before), (_, after) = (at.along(formulas, side) for side in sides)
    size = np.abs([before, after]).max() or 1.0
    amount = float(np.abs(after - before).max() / size)
    if amount > JUMPS:
        says = (
            f"a formula of the problem jumps at t = {time:.6g}, where a comparison of what is not "
            "time alone changes: costates may jump there, and no junction is put at such a place"
        )
        yield Fault("curvature", time, time, amount, says, at.k)
