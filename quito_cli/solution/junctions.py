"""Jumps and kinks of a control, found in û itself.

In index space a jump of the control has a width of its own: that of the step response of the
generating function, a few cells, however small the cells are; a steep but smooth passage spreads
over more cells the more of them there are. So a jump is a peak of the differences |û(s+½) − û(s)|
that has fallen to nothing within `width` cells on either side. A kink is the same one derivative
later: a peak of the second differences. Where cells are as small as refinement makes them, the
cells that a jump takes are its uncertainty in time.

The time of a jump from a to b is where a step would have the same integral, for that is what the
dynamics feel: ∫û dt = a (t* − t₁) + b (t₂ − t*). That of a kink is where the tangents meet.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from quito_cli.solution.median import median
from quito_cli.transcription.control import Basis, ControlBasis
from quito_cli.transcription.generating import GENERATING_FUNCTIONS
from quito_cli.transcription.mesh import Mesh
from quito_cli.transcription.qualities import jump

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

HEIGHT = 0.03
"""A jump is at least this part of the control's range."""
SLOPE = 0.5
"""A kink changes the slope by at least this many ranges a horizon."""
HARDLY_MOVES = 0.01
"""A control that moves by less than this part of its size is judged by that."""
NOISE = 1e-8
"""Of its bounds: a control that is no larger is zero, but for what a solver leaves of it."""
FADED = 0.05
"""Part of its peak to which a jump or kink has fallen where it ends."""
ABOVE = 4.0
"""A kink changes the slope by this many times as much as the neighbourhood does."""
SMALLEST = 1e-4
"""A kink that rounds off less of the range than this is not to be told from noise."""
STEEP = 4.0
"""A jump is this many times steeper than û is around it."""
WAVE = 0.3
"""Part of its slope that a control may have beside a jump: more, and the jump is one of a wave."""
SHORT = 2e-3
"""What takes no more than this part of the horizon is a jump or kink, however many cells it has."""
_FINE = 2
"""Points a cell."""
_EDGE = 6
"""Points at either end where û is not quite what its coefficients are elsewhere."""
_PLAIN = 3
"""Cells that a jump takes of a control that is no quasi-interpolant."""


@dataclass(frozen=True)
class Junction:
    """Where a control jumps or has a kink."""

    control: int
    """Entry of the stacked controls."""
    kind: Literal["jump", "kink"]
    time: float
    uncertainty: float
    """Half the time that û takes for it."""
    before: float
    """û just before it takes place."""
    after: float
    """û just after."""
    blur: float
    """L² norm over time of û minus the step that a jump is; 0 of a kink."""


def junctions(
    basis: Basis, mesh: Mesh, coefficients: Array, times: tuple[float, float], bounds: Array
) -> tuple[Junction, ...]:
    """Return the jumps and kinks of every control, by time.

    Args:
        basis: functions of the control.
        mesh: the cells.
        coefficients: (count, n_u).
        times: initial and final time.
        bounds: (n_u,) the size of each control's bounds, see `ranges`.
    """
    cells, offsets = mesh.points(np.arange(_FINE) / _FINE)
    cells, offsets = np.append(cells, mesh.cells - 1), np.append(offsets, 1.0)
    fractions = mesh.at(cells, offsets)
    u = basis.evaluate(coefficients, cells, offsets)
    spread, most = ranges(u, bounds), _FINE * width(basis)
    start, horizon = times[0], times[1] - times[0]
    found: list[Junction] = []
    for i, size in enumerate(spread):
        v = u[:, i] / size
        jumps = _jumps(v, fractions, most)
        found += [_jump(i, span, v, fractions) for span in jumps]
        found += [_kink(i, span, v, fractions) for span in _kinks(v, fractions, most, jumps)]
    return tuple(
        replace(
            j,
            time=start + horizon * j.time,
            uncertainty=horizon * j.uncertainty,
            before=j.before * float(spread[j.control]),
            after=j.after * float(spread[j.control]),
            blur=j.blur * float(spread[j.control]) * math.sqrt(horizon),
        )
        for j in sorted(found, key=lambda junction: junction.time)
    )


def ranges(u: Array, bounds: Array) -> Array:
    """Return the range of each control, (n_u,), from samples (points, n_u).

    A control that hardly moves is judged by its size; one that is zero but for noise, by its
    bounds; without any, by one.

    Args:
        u: samples.
        bounds: (n_u,) the largest finite bound of each, zero where there is none.
    """
    size = np.abs(u).max(axis=0, initial=0.0)
    nothing = size <= NOISE * np.where(bounds > 0, bounds, 1.0)
    found = np.maximum(np.ptp(u, axis=0), HARDLY_MOVES * size)
    return np.where(nothing, np.where(bounds > 0, bounds, 1.0), found)


def width(basis: Basis) -> int:
    """Return how many cells a step of the coefficients takes, and one for where it falls."""
    if not isinstance(basis, ControlBasis) or not basis.function.scaled:
        return _PLAIN
    return _step_width(basis.function.name, basis.variance) + 1


@cache
def _step_width(name: str, variance: float) -> int:
    """Return the cells in which û, for coefficients that are a step, is not yet level."""
    s, u = jump(GENERATING_FUNCTIONS[name], variance, True)
    slopes = np.abs(np.diff(u))
    steep = s[:-1][slopes > FADED * slopes.max()]
    return math.ceil(float(np.ptp(steep)))


def _jumps(u: Array, t: Array, most: int) -> list[tuple[int, int]]:
    """Return the jumps of one control over its range, as ranges of points, first and last.

    The steepest place is looked at first, and what is steep around it belongs to it. Two with no
    more than a cell between them are one: it falls into that cell.
    """
    slopes = np.abs(np.diff(u) / np.diff(t))
    middle = (t[1:] + t[:-1]) / 2
    least = HEIGHT / max(most * float(median(np.diff(t))), SHORT)
    usual = _usual(slopes, middle, most)
    left = np.where(slopes > STEEP * usual, slopes, 0.0)
    spans: list[tuple[int, int]] = []
    while left[peak := int(np.argmax(left))] > least:
        faded = np.flatnonzero(slopes <= max(FADED * slopes[peak], 2 * usual[peak]))
        first = int(faded[faded < peak].max(initial=-1)) + 1
        last = int(faded[faded > peak].min(initial=len(slopes)))
        left[first:last] = 0.0
        around = np.append(slopes[max(first - most, 0) : first], slopes[last : last + most])
        if first == 0 or last == len(slopes):  # a layer at an end of the horizon is no jump
            continue
        if t[last] - t[first] > SHORT and (
            last - first > most or around.max(initial=0.0) > WAVE * slopes[peak]
        ):
            continue
        within = [s for s in spans if s[0] <= last + _FINE and first <= s[1] + _FINE]
        spans = [span for span in spans if span not in within] + [
            (min(first, *(a for a, _ in within)), max(last, *(b for _, b in within)))
            if within
            else (first, last)
        ]
    return [(a, b) for a, b in spans if abs(u[b] - u[a]) > HEIGHT]


def _usual(slopes: Array, middle: Array, most: int) -> Array:
    """Return the median slope around each place, at times further off than a jump would take."""
    places = np.arange(len(middle))
    first, last = np.maximum(places - most // 2, 0), np.minimum(places + most // 2, len(places) - 1)
    way = np.maximum(middle[last] - middle[first], SHORT) / 2
    times = middle[:, None] + way[:, None] * np.concatenate([np.arange(-8, 0), np.arange(1, 9)])
    inside = (times > middle[0]) & (times < middle[-1])
    around = np.where(inside, np.interp(times, middle, slopes), np.inf)
    middle_one = np.maximum(inside.sum(axis=1) - 1, 0) // 2
    found = np.sort(around, axis=1)[places, middle_one]
    return np.where(inside.any(axis=1), found, 0.0)


def _kinks(u: Array, t: Array, most: int, jumps: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Return the kinks of one control away from its jumps, as ranges of points, first and last.

    Mean slopes of two windows on either side of a gap that a kink would take: those next to it
    differ far more than the two on a side do. At the ends of the horizon the outer one may be
    missing.
    """
    side = most // 2
    starts = np.arange(len(u) - most - 2 * side)
    if not starts.size:
        return []
    first, last = starts + side, starts + side + most
    outer = np.maximum(starts - side, 0), np.minimum(last + 2 * side, len(u) - 1)

    def slope(a: Indices, b: Indices) -> Array:
        with np.errstate(invalid="ignore"):
            return np.asarray((u[b] - u[a]) / (t[b] - t[a]))

    before, after = slope(starts, first), slope(last, last + side)
    change = np.abs(after - before)
    with np.errstate(invalid="ignore"):
        bends = np.array(
            [
                np.abs(before - slope(outer[0], starts)) / (t[first] - t[outer[0]]),
                np.abs(slope(last + side, outer[1]) - after) / (t[outer[1]] - t[last]),
            ]
        )
    bends = np.where(np.isnan(bends), bends[::-1], bends)
    usual = bends.sum(axis=0) * (t[last + side] - t[starts])
    score = change / (usual + SLOPE / ABOVE)
    plain = (score > ABOVE) & (change * (t[last] - t[first]) > SMALLEST)
    ends = np.column_stack([starts, last + side])
    plain &= (ends[:, 0] >= _EDGE) & (ends[:, 1] < len(u) - _EDGE)
    for a, b in jumps:
        plain &= (ends[:, 1] < a) | (ends[:, 0] > b)
    clear = np.where(plain, score, 0.0)
    spans = []
    while clear[best := int(np.argmax(clear))] > 0:
        spans.append((int(first[best]), int(last[best])))
        clear[max(best - 2 * most, 0) : best + 2 * most + 1] = 0.0
    return spans


def _jump(control: int, span: tuple[int, int], u: Array, t: Array) -> Junction:
    """Return the step with the same integral as û has over `span`."""
    t, v = t[span[0] : span[1] + 1], u[span[0] : span[1] + 1]
    integral = float(((v[1:] + v[:-1]) / 2 * np.diff(t)).sum())
    before, after = float(v[0]), float(v[-1])
    at = (integral + before * t[0] - after * t[-1]) / (before - after)
    at = float(np.clip(at, t[0], t[-1]))
    middle = (t[1:] + t[:-1]) / 2
    off = (v[1:] + v[:-1]) / 2 - np.where(middle < at, before, after)
    blur = float(np.sqrt((off**2 * np.diff(t)).sum()))
    return Junction(control, "jump", at, float(t[-1] - t[0]) / 2, before, after, blur)


def _kink(control: int, span: tuple[int, int], u: Array, t: Array) -> Junction:
    """Return where the lines through the windows on both sides of `span` meet."""
    first, last = span
    side = (last - first) // 2
    i = [first - side, first, last, last + side]
    t, v = t[i], u[i]
    left, right = (v[1] - v[0]) / (t[1] - t[0]), (v[3] - v[2]) / (t[3] - t[2])
    at = float(np.clip((v[2] - v[1] + left * t[1] - right * t[2]) / (left - right), t[1], t[2]))
    value = float(v[1] + left * (at - t[1]))
    return Junction(control, "kink", at, float(t[2] - t[1]) / 2, value, value, 0.0)
