"""The search for admissible controls that make H less than those of an answer.

H is looked at along each control, closer about its other wells, and from points scattered over all
controls downhill; all moments at once. Controls that constraints refuse are moved by Newton's
shortest steps to where they hold. What is found refutes the answer; that nothing is found proves
nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.hamiltonian import Pontryagin
from quito_cli.optimality.looking.dilation import positive

Array = NDArray[np.float64]

ALONG = 33
"""Values of each control that are tried while the others stay."""
CLOSER, ABOUT = 3, np.array([-0.75, -0.5, -0.25, 0.25, 0.5, 0.75])
"""Times that a well is looked at closer, each time four times; where, in steps."""
CORNERS, SCATTERED = 32, 8
"""Points of all controls together that are tried at a moment: where bounds meet, and between."""
DOWNHILL = 5
"""Steps that are taken from each of those between, half as far each time."""
MENDED = 6
"""Newton's steps to where constraints hold."""
DEPENDENT = 1e-12
"""Part of the size of constraints' slopes that is added where they depend on each other."""
INSIDE = 1e-9
"""By how much constraints may be violated, over 1 + |bound|."""

Evaluate = Callable[[int, Array], Sequence[Array]]
"""(tried, controls) ↦ the outputs of `minimum.measured` at n moments, over and over: (tried · n, …)
each; controls are (tried · n, n_u)."""


class Best(NamedTuple):
    """Controls at n moments, and what H is made of there."""

    controls: Array
    """(n, n_u)."""
    summands: Array
    """(n, summands); infinite where no control is admissible."""

    @property
    def hamiltonian(self) -> Array:
        """H, (n,)."""
        return np.asarray(self.summands.sum(axis=1))


@dataclass(frozen=True, eq=False)
class Found:
    """What the search found."""

    own: Best
    """The answer's controls, or better ones so near that they count as the same."""
    least: Best
    """The best that were found."""
    size: Array
    """(n,): what the summands of H change by, in the upper quartile of all that was tried along a
    control, the one along which that is most; 0 where nothing was admissible."""

    @property
    def lost(self) -> Array:
        """H of the answer minus the least that was found, (n,), zero or more."""
        return np.maximum(self.own.hamiltonian - self.least.hamiltonian, 0.0)


@dataclass(frozen=True, eq=False)
class Search:
    """The search for less at n moments."""

    system: Pontryagin
    u: Array
    """(n, n_u) the answer's controls."""
    evaluate: Evaluate

    @cached_property
    def box(self) -> tuple[Array, Array]:
        """Bounds of what is tried, (n_u,) each; of controls without any, as far as they are large.

        That is three times their size beyond what they are, so that a well as far on the other
        side of zero is well inside.
        """
        lower, upper = self.system.model.control_bounds
        low, high = self.u.min(axis=0), self.u.max(axis=0)
        reach = positive(3 * np.abs(self.u).max(axis=0) + high - low)
        return (
            np.where(np.isfinite(lower), lower, np.minimum(low, upper) - reach),
            np.where(np.isfinite(upper), upper, np.maximum(high, lower) + reach),
        )

    @property
    def free(self) -> list[int]:
        """Entries of controls that have a choice."""
        lower, upper = self.box
        return [int(i) for i in np.flatnonzero(upper > lower)]

    def found(self, near: Array) -> Found:
        """Search.

        Args:
            near: (n_u,) how far from the answer's controls others count as the same.
        """
        with np.errstate(all="ignore"):  # what is not finite is not admissible
            return self._found(near)

    def _found(self, near: Array) -> Found:
        own = self._own(near)
        best, size = own, np.zeros(len(self.u))
        for i in self.free:
            line = self._tried(self._line(own.controls, i))
            change = np.abs(line.summands - own.summands).sum(axis=2)
            size = np.maximum(size, _quartile(change))
            best = lower_of(best, _lowest(line))
            well = self._other_well(line, own, i)
            if np.isfinite(well.hamiltonian).any():
                best = lower_of(best, self._closer(well, i))
        if len(self.free) > 1:
            best = lower_of(best, self._scattered(own))
        return Found(own, best, size)

    def _own(self, near: Array) -> Best:
        """Return the answer's controls, or the best of those within `near` of them."""
        summands = self.evaluate(1, self.u)[0]
        best = Best(self.u, summands)
        for i in self.free:
            if near[i] > 0:
                tried = self._tried(self._shifted(best.controls, i, near[i] * ABOUT / ABOUT.max()))
                best = lower_of(best, _lowest(tried))
        return best

    def _line(self, controls: Array, i: int) -> Array:
        """Return controls with the i-th at each value of its range, (ALONG, n, n_u)."""
        tried = np.tile(controls, (ALONG, 1, 1))
        tried[:, :, i] = np.linspace(self.box[0][i], self.box[1][i], ALONG)[:, None]
        return tried

    def _shifted(self, controls: Array, i: int, shifts: Array) -> Array:
        """Return controls with the i-th shifted by each amount, (shifts, n, n_u)."""
        tried = np.tile(controls, (len(shifts), 1, 1))
        low, high = self.box[0][i], self.box[1][i]
        tried[:, :, i] = np.clip(controls[:, i] + shifts[:, None], low, high)
        return tried

    def _tried(self, controls: Array) -> _Tried:
        """Return what H is made of, with controls moved to where constraints hold."""
        count, n, n_u = controls.shape
        flat, summands, off = self._mended(count, controls.reshape(count * n, n_u))
        good = (np.abs(off) <= INSIDE).all(axis=1, keepdims=True)
        good = good & np.isfinite(summands).all(axis=1, keepdims=True)
        summands = np.where(good, summands, np.inf)
        return _Tried(flat.reshape(controls.shape), summands.reshape(count, n, -1))

    def _mended(self, count: int, controls: Array) -> tuple[Array, Array, Array]:
        """Return controls moved to where constraints hold, the summands, and what is still off.

        That is over 1 + |bound|, by row.
        """
        summands, rows, slopes = self.evaluate(count, controls)
        for k in range(MENDED + 1):
            nearest = np.clip(rows, *self._limits)
            off = rows - nearest
            if k == MENDED or not off.any():
                break
            by_u = slopes.reshape(*off.shape, controls.shape[1])
            by_u = np.where(off[:, :, None] != 0, by_u, 0.0)
            controls = np.clip(controls - _shortest(by_u, off), *self.box)
            summands, rows, slopes = self.evaluate(count, controls)
        return controls, summands, off / (1 + np.abs(nearest))

    @cached_property
    def _limits(self) -> tuple[Array, Array]:
        rows = [row for row in self.system.rows if row.mixed]
        return np.array([row.lower for row in rows]), np.array([row.upper for row in rows])

    def _other_well(self, line: _Tried, own: Best, i: int) -> Best:
        """Return the lowest of the values along a control that are less than those beside them.

        But for those next to the answer's own.
        """
        h = line.hamiltonian
        beside = np.pad(h, ((1, 1), (0, 0)), constant_values=np.inf)
        step = (self.box[1][i] - self.box[0][i]) / (ALONG - 1)
        other = np.abs(line.controls[:, :, i] - own.controls[:, i]) > step
        well = other & (h <= beside[:-2]) & (h <= beside[2:])
        return _lowest(_Tried(line.controls, np.where(well[:, :, None], line.summands, np.inf)))

    def _closer(self, best: Best, i: int) -> Best:
        """Return the best about values of a control, between those that were tried."""
        step = (self.box[1][i] - self.box[0][i]) / (ALONG - 1)
        for k in range(CLOSER):
            tried = self._tried(self._shifted(best.controls, i, step * ABOUT / 4**k))
            best = lower_of(best, _lowest(tried))
        return best

    def _scattered(self, own: Best) -> Best:
        """Return the best that is found from points scattered over all controls.

        They differ from moment to moment; what is found at some is tried at all.
        """
        (lower, upper), (n, n_u) = self.box, self.u.shape
        # Halton's points would do as well; a seed makes the same answer of the same problem.
        random = np.random.default_rng(0)
        corners = np.array(sorted({tuple(c) for c in random.integers(0, 2, (CORNERS, n_u))}))
        best = lower_of(
            own, _lowest(self._tried(self._spread(np.repeat(corners[:, None], n, axis=1))))
        )
        inner = self._tried(self._spread(random.random((SCATTERED, n, n_u))))
        for k in range(DOWNHILL):
            for i in self.free:
                step = (upper[i] - lower[i]) / 4 / 2**k
                for shift in (-step, step):
                    moved = inner.controls.copy()
                    moved[:, :, i] = np.clip(moved[:, :, i] + shift, lower[i], upper[i])
                    inner = inner.lower(self._tried(moved))
        best = lower_of(best, _lowest(inner))
        some = np.linspace(0, n - 1, SCATTERED).astype(int)
        return lower_of(best, _lowest(self._tried(np.repeat(best.controls[some][:, None], n, 1))))

    def _spread(self, shares: Array) -> Array:
        """Return controls by shares of their ranges."""
        return self.box[0] + shares * (self.box[1] - self.box[0])


class _Tried(NamedTuple):
    """Controls that were tried, and what H is made of there."""

    controls: Array
    """(tried, n, n_u)."""
    summands: Array
    """(tried, n, summands); infinite where they are not admissible."""

    @property
    def hamiltonian(self) -> Array:
        """(tried, n)."""
        return np.asarray(self.summands.sum(axis=2))

    def lower(self, other: _Tried) -> _Tried:
        """Return the lower of each pair."""
        less = (other.hamiltonian < self.hamiltonian)[:, :, None]
        return _Tried(
            np.where(less, other.controls, self.controls),
            np.where(less, other.summands, self.summands),
        )


def _lowest(tried: _Tried) -> Best:
    """Return the best of what was tried at each moment."""
    at = tried.hamiltonian.argmin(axis=0), np.arange(tried.controls.shape[1])
    return Best(tried.controls[at], tried.summands[at])


def lower_of(one: Best, other: Best) -> Best:
    """Return the lower of two at each moment, the first where they are equal."""
    less = (other.hamiltonian < one.hamiltonian)[:, None]
    return Best(
        np.where(less, other.controls, one.controls), np.where(less, other.summands, one.summands)
    )


def _quartile(changes: Array) -> Array:
    """Return upper quartiles over what was tried, (n,), of what is finite; 0 where nothing is."""
    known = np.where(np.isfinite(changes), changes, np.inf)
    ordered, counts = np.sort(known, axis=0), np.isfinite(known).sum(axis=0)
    at = np.maximum(3 * counts - 1, 0) // 4
    return np.where(counts > 0, ordered[at, np.arange(changes.shape[1])], 0.0)


def _shortest(slopes: Array, off: Array) -> Array:
    """Return the shortest steps with slopes · step = off, (points, n_u)."""
    a = np.where(np.isfinite(slopes), slopes, 0.0)
    square = a @ a.transpose(0, 2, 1)
    damping = DEPENDENT * np.trace(square, axis1=1, axis2=2) + np.finfo(float).tiny
    square += damping[:, None, None] * np.eye(off.shape[1])
    right = np.where(np.isfinite(off), off, 0.0)[:, :, None]
    return np.asarray((a.transpose(0, 2, 1) @ np.linalg.solve(square, right))[:, :, 0])
