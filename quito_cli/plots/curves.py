"""A small plot of quantities over time: lines, bounds, references, and what marks them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.plots.arcs import bar, shade
from quito_cli.plots.palette import BOUND, COLOURS, JUNCTION, KNOWN, OURS, plain
from quito_cli.solution.junctions import Junction
from quito_cli.solution.optimal import Arc

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

_NEAR, _FAR = 0.6, 2.0
"""Bounds further than this many spans of a state, or sizes of a control, are not drawn."""
_MOST_MARKS = 36
"""Jumps and kinks marked in a plot: the highest."""


@dataclass(frozen=True)
class Line:
    """A quantity over time."""

    name: str
    values: Array
    known: Array | None = None
    """The reference, at the curve's `known_times`; NaN where unknown."""
    lower: float = -np.inf
    upper: float = np.inf


@dataclass(frozen=True)
class Curve:
    """One small plot: a line, or those of a vector."""

    label: str
    times: Array
    lines: tuple[Line, ...]
    far_bounds: bool = False
    """Draw bounds that are not near too."""
    steps: bool = False
    logarithmic: bool = False
    marks: tuple[Junction, ...] = ()
    """Jumps and kinks of its lines."""
    arcs: tuple[Arc, ...] = ()
    """Drawn as a bar on the axis of time."""
    shades: tuple[Arc, ...] = ()
    """Drawn as shades behind the lines."""
    horizon: tuple[float, float] | None = None
    """Times that the plot shows at least."""
    zero: bool = False
    """Draw the line of zero where it is near."""
    least: float = 0.0
    """Height that the plot shows at least: what is small beside it is no shape."""
    known_times: Array | None = None
    """Of the references; None where they are those of the lines."""


def draw_curve(axes: Axes, curve: Curve) -> None:
    """Draw lines with their bounds, references and marks."""
    several = len(curve.lines) > 1
    style = "steps-post" if curve.steps else "default"
    drawn: list[Artist] = []
    bar(axes, curve.arcs)
    shade(axes, curve.shades)
    for i, line in enumerate(curve.lines):
        colour, name = (COLOURS[i % len(COLOURS)], plain(line.name)) if several else (OURS, "quito")
        drawn += axes.plot(curve.times, line.values, color=colour, label=name, drawstyle=style)
        if line.known is not None:
            times = curve.times if curve.known_times is None else curve.known_times
            axes.plot(times, line.known, "--", color=KNOWN, linewidth=1.2, label="reference")
    _mark(axes, curve.marks)
    low, high = _range(curve)
    for bound in near_bounds(curve):
        axes.axhline(bound, color=BOUND, linewidth=0.9, linestyle=":", label="bound")
    reach = max(_NEAR * (high - low), (curve.least - (high - low)) / 2)
    if curve.zero and low - reach <= 0 <= high + reach:
        axes.axhline(0, color=BOUND, linewidth=0.9, zorder=1)
    if curve.logarithmic:
        axes.set_yscale("log")
        axes.set_ylim(low / 3, high * 3)
    elif high - low <= 1e-9 * max(abs(high), 1.0):  # rounding is no shape
        axes.set_ylim(low - 0.5 * max(abs(low), 1.0), high + 0.5 * max(abs(high), 1.0))
    elif high - low < curve.least:
        axes.set_ylim((low + high - curve.least) / 2, (low + high + curve.least) / 2)
    if curve.horizon is not None:
        axes.update_datalim([(time, low) for time in curve.horizon], updatey=False)
    axes.set_ylabel(curve.label)
    axes.grid(alpha=0.25)
    axes.margins(x=0.01)
    if several:
        axes.legend(handles=drawn, frameon=False, fontsize="small")


def _mark(axes: Axes, junctions: tuple[Junction, ...]) -> None:
    """Mark where jumps and kinks are, and shade how uncertain that is."""
    highest = sorted(junctions, key=lambda one: -abs(one.after - one.before))
    for one in highest[:_MOST_MARKS]:
        ends = one.time - one.uncertainty, one.time + one.uncertainty
        axes.axvspan(*ends, color=JUNCTION, alpha=0.12, linewidth=0, zorder=0.5)
        label = "jump or kink"
        axes.axvline(one.time, color=JUNCTION, linewidth=0.9, linestyle=":", label=label, zorder=1)


def _range(curve: Curve) -> tuple[float, float]:
    """Return the least and the largest value drawn."""
    values = np.concatenate([line.values for line in curve.lines])
    finite = values[np.isfinite(values)]
    return (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)


def near_bounds(curve: Curve) -> list[float]:
    """Return the bounds that are near enough to be drawn, sorted."""
    low, high = _range(curve)
    reach = _reach(curve, low, high)
    bounds = {b for line in curve.lines for b in (line.lower, line.upper)}
    return sorted(b for b in bounds if low - reach <= b <= high + reach)


def _reach(curve: Curve, low: float, high: float) -> float:
    """Return how far from the values a bound may be to be drawn."""
    if curve.far_bounds:
        return _FAR * max(high - low, abs(low), abs(high)) or 1e300
    return _NEAR * max(high - low, 1e-12)
