"""Tables of measured data as smooth functions: `interpolate(x, table)` in an expression.

CasADi's own interpolants exist as MX only, and all expressions here are SX, so a table is written
out: piecewise polynomials in the distance s from the left end of their piece,

    value = c₀ + s (c₁ + s (c₂ + s c₃)),    s = x − left,

whose numbers (left, c₀, c₁, …) are a sum over the pieces, each times an indicator that is 1 on the
piece that holds x and 0 elsewhere. One term of the sum is not zero, so it is exact; the numbers are
finite, so no 0·∞ arises; they are constant on a piece, so that AD differentiates the polynomial
alone and exactly, to every order. SX has neither look-up nor branches, so every number is read at
every evaluation; the indicators keep that to 8 operations a point (linear) or 12 (cubic).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from typing import TYPE_CHECKING, Final, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from casadi import SX

Array = NDArray[np.float64]
Method = Literal["linear", "cubic"]

MAX_POINTS: Final = 1000
_TOLD: Final = 5
"""Entries named for one kind of mistake: a table in no order at all has it everywhere."""


@dataclass(frozen=True, eq=False)
class TableData:
    """Values y measured at increasing x, and how to go between them; see `check`.

    - `linear`: straight lines from point to point; beyond the ends, the end segments continue.
      The derivative jumps at the inner points, where it is that of the segment to the right.
    - `cubic`: the cubic spline, twice continuously differentiable, with not-a-knot ends: two
      points give their line, three their parabola, and samples of any cubic give that cubic.
      Beyond the ends its tangents there continue, so that the first derivative is continuous and
      an optimiser that wanders off meets no runaway cubic. The second derivative is zero out
      there; at the end points themselves it is the spline's.
    """

    name: str
    x: Array
    y: Array
    method: Method = "cubic"

    def __call__(self, at: SX) -> SX:
        """Give the interpolated value, entry by entry."""
        import casadi

        row = casadi.vec(at).T
        where = self._indicators(row)
        left, value, slope, *bends = casadi.vertsplit(casadi.mtimes(self._pieces, where))
        distance = row - left
        if bends:  # none beyond the ends, where the square of a large distance is not finite
            inside = distance * (1 - where[0, :] - where[-1, :])
            slope += inside * (bends[0] + inside * bends[1])
        return casadi.reshape((value + distance * slope).T, *at.shape)

    @property
    def operations(self) -> int:
        """Scalar operations that it takes to write one value out."""
        return 2 * int(self._pieces.size + self._pieces.shape[1])

    def _indicators(self, row: SX) -> SX:
        """Give 1 where an argument (column) lies in a piece (row), else 0."""
        import casadi

        breaks, count = self._breaks, row.numel()
        shape = (breaks.size, count)
        passed = casadi.repmat(row, breaks.size, 1) >= np.broadcast_to(breaks[:, None], shape)
        first, none = casadi.SX.ones(1, count), casadi.SX.zeros(1, count)
        return casadi.vertcat(first, passed) - casadi.vertcat(passed, none)

    @property
    def _breaks(self) -> Array:
        """Where the pieces begin, but the first; the tangent begins behind the end of a cubic."""
        if self.method == "linear":
            return self.x[1:-1]
        return np.append(self.x[:-1], np.nextafter(self.x[-1], np.inf))

    @cached_property
    def _pieces(self) -> Array:
        """One column a piece from left to right: where it counts from, then its coefficients."""
        return _cubic(self.x, self.y) if self.method == "cubic" else _linear(self.x, self.y)


def check(x: ArrayLike, y: ArrayLike) -> list[tuple[int | None, str]]:
    """Say what is wrong with the points of a table; nothing if they can be interpolated.

    Returns:
        Messages, each with the entry (counted from 0) that it is about, or None for the whole.
    """
    places, values = np.asarray(x, float).ravel(), np.asarray(y, float).ravel()
    found: list[tuple[int | None, str]] = []
    if places.size != values.size:
        found.append((None, f"x has {_entries(places.size)} and y has {_entries(values.size)}"))
    fewest, most = sorted((places.size, values.size))
    if fewest < 2:
        found.append((None, f"a table has at least 2 points, not {fewest}"))
    if most > MAX_POINTS:
        found.append((None, f"a table has at most {MAX_POINTS} points, not {most}"))
    found += islice(_infinite("x", places), _TOLD)
    found += _falling(places)
    found += islice(_infinite("y", values), _TOLD)
    if not found and not _representable(places, values):
        found.append((None, "the points are too close together, or the values too large, to join"))
    return found


def _infinite(what: str, numbers: Array) -> Iterable[tuple[int, str]]:
    """Name the entries that are not finite."""
    for i in np.flatnonzero(~np.isfinite(numbers)).tolist():
        yield i, f"entry {i} of {what} is not finite: {float(numbers[i])}"


def _falling(x: Array) -> Iterable[tuple[int | None, str]]:
    """Name the entries that do not increase, but a table turned round as one mistake."""
    with np.errstate(invalid="ignore"):
        wrong = np.flatnonzero(x[1:] <= x[:-1]) + 1
        if wrong.size > 1 and (x[1:] < x[:-1]).all():
            return [(None, "x decreases: give the points in the opposite order")]
    return [
        (i, f"entry {i} of x, {float(x[i])}, is not above the one before, {float(x[i - 1])}")
        for i in wrong[:_TOLD].tolist()
        if np.isfinite(x[i - 1 : i + 1]).all()
    ]


def _representable(x: Array, y: Array) -> bool:
    """Tell whether the coefficients stay finite: slopes can overflow where the points do not."""
    with np.errstate(all="ignore"):
        return bool(np.isfinite(_cubic(x, y)).all())


def _entries(count: int) -> str:
    return "1 entry" if count == 1 else f"{count} entries"


def _linear(x: Array, y: Array) -> Array:
    """Give the segments: left end, value there, slope."""
    return np.array([x[:-1], y[:-1], np.diff(y) / np.diff(x)])


def _cubic(x: Array, y: Array) -> Array:
    """Give the pieces of the spline between the tangents at its ends.

    With its second derivatives M at the points, the width h and the mean slope r of a piece
    (Stoer and Bulirsch, Introduction to Numerical Analysis, sec. 2.4.2; `₊`: at its right end):
    c₀ = y, c₁ = r − h (2M + M₊)/6, c₂ = M/2, c₃ = (M₊ − M)/(6h).
    """
    h, bend = np.diff(x), _second_derivatives(x, y)
    rise = np.diff(y) / h
    here, there = bend[:-1], bend[1:]
    slope = rise - h * (2 * here + there) / 6
    inner = [x[:-1], y[:-1], slope, here / 2, (there - here) / 6 / h]
    before = [x[0], y[0], slope[0], 0, 0]
    beyond = [x[-1], y[-1], rise[-1] + h[-1] * (here[-1] + 2 * there[-1]) / 6, 0, 0]
    return np.column_stack([before, inner, beyond])


def _second_derivatives(x: Array, y: Array) -> Array:
    """Give the second derivatives M of the spline at its points.

    At an inner point with h₋, r₋ to its left and h, r to its right the slope is continuous where
    h₋ M₋ + 2(h₋ + h) M + h M₊ = 6(r − r₋). Not-a-knot ends (de Boor, A Practical Guide to Splines,
    ch. IV) let the first two pieces share one third derivative, M₀ = M₁ + (M₁ − M₂) h₀/h₁, and
    the equation of the first inner point becomes
    (h₀ + 2h₁) M₁ + (h₁ − h₀) M₂ = 6(r₁ − r₀) h₁/(h₀ + h₁); likewise at the other end. Every row
    is dominated by its diagonal, and no accuracy is lost where the widths differ much.
    """
    h = np.diff(x)
    change = np.diff(np.diff(y) / h)
    if x.size < 4:  # a line or a parabola
        return np.full(x.size, 2 * change[0] / (h[0] + h[1]) if x.size == 3 else 0.0)
    lower, diagonal, upper, right = h[1:-1].copy(), 2 * (h[:-1] + h[1:]), h[1:-1].copy(), 6 * change
    diagonal[0], upper[0] = h[0] + 2 * h[1], h[1] - h[0]
    diagonal[-1], lower[-1] = h[-1] + 2 * h[-2], h[-2] - h[-1]
    right[0] *= h[1] / (h[0] + h[1])
    right[-1] *= h[-2] / (h[-2] + h[-1])
    inner = _tridiagonal(lower, diagonal, upper, right)
    first = inner[0] + (inner[0] - inner[1]) * (h[0] / h[1])
    last = inner[-1] + (inner[-1] - inner[-2]) * (h[-1] / h[-2])
    return np.array([first, *inner, last])


def _tridiagonal(lower: Array, diagonal: Array, upper: Array, right: Array) -> Array:
    """Solve by elimination; rows that their diagonal dominates need no pivoting."""
    pivots, values = diagonal.copy(), right.copy()
    for i in range(1, pivots.size):
        factor = lower[i - 1] / pivots[i - 1]
        pivots[i] -= factor * upper[i - 1]
        values[i] -= factor * values[i - 1]
    values[-1] /= pivots[-1]
    for i in range(pivots.size - 2, -1, -1):
        values[i] = (values[i] - upper[i] * values[i + 1]) / pivots[i]
    return values
