"""Comparison -> plots of its trajectories: points, frames, and what a frame leaves out.

A frame is made for the first method and the reference; a method that rings or diverges may reach
as far beyond as they reach, and what is cut off is said. Of a line with more points than a plot can
show, the least and the largest of each group of neighbours are drawn: the same picture.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.plots.layout import shared, with_unit
from quito_cli.plots.sampling import drawn_times
from quito_cli.solution.solution import Quantity

if TYPE_CHECKING:
    from quito_cli.comparison.comparison import Comparison, Truth

Array = NDArray[np.float64]
Line = tuple[int, Array, Array]
"""Number of a row in the comparison, -1 for the reference; x and y."""

_GROUPS = 500
"""Groups of neighbours, two points of each drawn: about the pixels of a plot."""
_REFERENCE_POINTS = 801
_FAR = 2.0
"""Bounds of a control further away than this many sizes of it are not drawn (of a state: spans)."""
_NEAR = 0.6
_BEYOND = 1.0
"""Part of the frame's height that rings and divergence may add on either side."""
_ROUGH, _ROUGH_ERROR = 4.0, 12.0
"""A line covers what is beneath if its total variation within the frame is this many times the
reference's; an error's, if it crosses its frame this often."""
_TAME = 20.0
"""Values further out than this many frames are drawn there: far out of sight."""


@dataclass(frozen=True)
class Trace:
    """A line of a method, or of the reference."""

    method: int
    """Number of its row in the comparison; -1 the reference's."""
    x: Array
    y: Array
    rough: bool
    """It may cover others: draw it thin, and beneath."""


@dataclass(frozen=True)
class Panel:
    """One small plot."""

    label: str
    axis: str
    """What is on the horizontal axis."""
    traces: tuple[Trace, ...]
    """In the order to draw them: the roughest first, the first method last."""
    low: float
    high: float
    bounds: tuple[float, ...] = ()
    zones: tuple[tuple[float, float], ...] = ()
    logarithmic: bool = False
    note: str = ""
    """What a reader must know of the frame."""


def thinned(x: Array, y: Array) -> tuple[Array, Array]:
    """Return at most two points of each group of neighbours, the least and the largest."""
    size = -(-len(x) // _GROUPS)
    if size <= 2:
        return x, y
    room = -len(x) % size
    padded = np.concatenate([y, np.full(room, y[-1])]).reshape(-1, size)
    starts = np.arange(len(padded)) * size
    least = np.where(np.isnan(padded), np.inf, padded).argmin(axis=1)
    largest = np.where(np.isnan(padded), -np.inf, padded).argmax(axis=1)
    chosen = np.sort(np.concatenate([[0, len(x) - 1], starts + least, starts + largest]))
    chosen = np.unique(np.minimum(chosen, len(x) - 1))
    return x[chosen], y[chosen]


def controls(comparison: Comparison) -> list[Panel]:
    """Return the controls of all methods with the reference's."""
    return _trajectories(comparison, comparison.controls, "control", True)


def states(comparison: Comparison) -> list[Panel]:
    """Return the states of all methods with the reference's."""
    return _trajectories(comparison, comparison.states, "state", False)


def _trajectories(
    comparison: Comparison, quantities: tuple[Quantity, ...], what: str, far_bounds: bool
) -> list[Panel]:
    if not quantities:
        return []
    curves: list[Line] = []
    if comparison.truth is not None:
        times = _reference_times(comparison, comparison.truth)
        known: Callable[[Array], Array] = getattr(comparison.truth, what)
        curves.append((-1, times, finite(known(times))))
    for number, row in enumerate(comparison.rows):
        times = np.union1d(drawn_times(row.solution), row.solution.times)
        curves.append((number, times, finite(getattr(row.solution, what)(times))))
    panels = []
    for name, entries in shared(quantities).items():
        low, high = _frame(comparison, [(n, y[:, entries]) for n, _, y in curves])
        reach = _FAR * max(high - low, abs(low), abs(high)) if far_bounds else _NEAR * (high - low)
        limits = {b for i in entries for b in (quantities[i].lower, quantities[i].upper)}
        bounds = tuple(sorted(b for b in limits if low - reach <= b <= high + reach))
        lines = [(n, x, y[:, i]) for i in entries for n, x, y in curves]
        low, high = padded(min(low, high, *bounds), max(low, high, *bounds))
        note = beyond(comparison, lines, low, high)
        label = with_unit(name, quantities[entries[0]].unit)
        drawn = traces(lines, low, high)
        panels.append(Panel(label, "t", drawn, low, high, bounds, note=note))
    return panels


def _reference_times(comparison: Comparison, truth: Truth) -> Array:
    """Return a grid over the horizon of the truth, with both sides of every jump."""
    ends = [row.solution.times[[0, -1]] for row in comparison.rows]
    start, end = truth.horizon or (min(e[0] for e in ends), max(e[1] for e in ends))
    jumps = np.array(truth.breaks + truth.switching_times)
    jumps = jumps[(jumps > start) & (jumps < end)]
    grid = np.linspace(start, end, _REFERENCE_POINTS)
    return np.union1d(grid, np.concatenate([jumps, np.nextafter(jumps, -np.inf)]))


def finite(values: Array) -> Array:
    """Return NaN in the place of what no plot can hold."""
    return np.where(np.abs(values) < 1e150, values, np.nan)


def first(comparison: Comparison) -> int:
    """Return the row that frames are made for: the first that is solved."""
    solved = (i for i, row in enumerate(comparison.rows) if row.solution.success)
    return next(solved, 0)


def span(values: list[Array]) -> tuple[float, float]:
    """Return the least and the largest finite number; 0 and 1 where there is none."""
    numbers = np.concatenate([[], *(v.ravel() for v in values)])
    numbers = numbers[np.isfinite(numbers)]
    return (float(numbers.min()), float(numbers.max())) if numbers.size else (0.0, 1.0)


def _frame(comparison: Comparison, curves: list[tuple[int, Array]]) -> tuple[float, float]:
    """Return the range of the reference and the first method, and a little of what is beyond."""
    trusted = -1, first(comparison)
    low, high = span([y for n, y in curves if n in trusted])
    least, most = span([y for _, y in curves])
    room = _BEYOND * (high - low) or 0.5 * max(abs(low), 1.0)
    return max(least, low - room), min(most, high + room)


def beyond(comparison: Comparison, lines: list[Line], low: float, high: float) -> str:
    """Return what is said of methods that leave the frame."""
    slack = 1e-6 * max(high - low, abs(low), abs(high))
    cut: dict[int, tuple[float, float]] = {}
    for number, _, y in lines:
        if number < 0 or not np.isfinite(y).any():
            continue
        least, most = span([y])
        if least < low - slack or most > high + slack:
            before = cut.get(number, (least, most))
            cut[number] = min(least, before[0]), max(most, before[1])
    if not cut:
        return ""
    worst = max(cut, key=lambda n: cut[n][1] - cut[n][0])
    name, (least, most) = shortened(comparison.rows[worst].method, 24), cut[worst]
    others = f" and {len(cut) - 1} more" if len(cut) > 1 else ""
    return f"cut off: {name} from {least:.2g} to {most:.2g}{others}"


def shortened(text: str, most: int) -> str:
    """Return `text`, or its beginning where it is too long."""
    return text if len(text) <= most else text[: most - 1] + "…"


def traces(lines: list[Line], low: float, high: float) -> tuple[Trace, ...]:
    """Return the lines in the order to draw them."""
    room = _TAME * (high - low)
    variation: dict[int, float] = {}
    for number, _, y in lines:
        steps = np.abs(np.diff(np.clip(y, low, high)))
        variation[number] = variation.get(number, 0.0) + float(np.nansum(steps))
    most = _ROUGH_ERROR * (high - low)
    if -1 in variation:
        most = _ROUGH * max(variation[-1], high - low)
    order = sorted(lines, key=lambda line: (line[0] == 0, -variation[line[0]]))
    return tuple(
        Trace(n, *thinned(x, np.clip(y, low - room, high + room)), variation[n] > most)
        for n, x, y in order
        if np.isfinite(y).any()
    )


def padded(low: float, high: float) -> tuple[float, float]:
    """Return the frame with a margin; rounding is no shape."""
    if high - low <= 1e-9 * max(abs(low), abs(high), 1.0):
        return low - 0.5 * max(abs(low), 1.0), high + 0.5 * max(abs(high), 1.0)
    return low - 0.05 * (high - low), high + 0.05 * (high - low)
