"""Comparison -> matplotlib Figures: trajectories, control error, its spectrum; and all on a sheet.

A figure is a row of the table `FIGURES`. Each method has a colour, a line style and a marker, so
that it is known without colour too, and where lines coincide; ours is the solid line on top. The
reference is a broad pale line beneath: seen wherever a method leaves it, and hiding none.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from quito_cli.plots.error_panels import logarithmic, magnified, on_the_whole, spectrum
from quito_cli.plots.figure import write
from quito_cli.plots.layout import balanced, legend_columns, places
from quito_cli.plots.palette import BOUND, COLOURS, plain
from quito_cli.plots.panels import Panel, Trace, controls, shortened, states

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from quito_cli.comparison.comparison import Comparison

Rows = list[Sequence[Panel]]

_SHEET_COLUMNS, _COLUMNS = 4, 3
_MARKS = 6
"""Markers on a line."""
_LONGEST = 60
"""Letters of a method's name in a legend."""
_DASHES: tuple[Any, ...] = (
    "-",
    (0, (6, 2)),
    (0, (2, 1)),
    (0, (6, 1.5, 1.5, 1.5)),
    (0, (1, 1)),
    (0, (10, 2)),
    (0, (6, 1.5, 1.5, 1.5, 1.5, 1.5)),
    (0, (3, 2)),
)
_METHODS = (*COLOURS, "#882255")
_MARKERS = ("", "o", "s", "^", "D", "v", "P", "X")
_REFERENCE: dict[str, Any] = {"color": "#BBBBBB", "linewidth": 4.5, "solid_capstyle": "butt"}
_ZONE: dict[str, Any] = {"facecolor": "#EEEEEE", "linewidth": 0}
_BOUND: dict[str, Any] = {"color": BOUND, "linewidth": 0.9, "linestyle": ":"}


def style(number: int) -> dict[str, Any]:
    """Return how the line of a method is drawn: colour, dashes, marker.

    Args:
        number: of its row; eight differ in everything, more differ in dashes and markers.
    """
    turn, place = divmod(number, len(_METHODS))
    return {
        "color": _METHODS[place],
        "linestyle": _DASHES[(place + turn) % len(_DASHES)],
        "marker": _MARKERS[(place + 2 * turn) % len(_MARKERS)],
        "markersize": 4.5,
        "markeredgewidth": 0.3,
        "markeredgecolor": "white",
    }


@dataclass(frozen=True)
class Kind:
    """A figure that a comparison has."""

    heading: str
    suffix: str
    """Of its file's name."""
    rows: Callable[[Comparison], Rows]
    """Its plots by row; none where there is nothing to show."""
    width: float
    """In inches."""
    height: float
    """Of a row, in inches."""


def _trajectories(comparison: Comparison) -> Rows:
    return [
        *balanced(controls(comparison), _COLUMNS),
        *balanced(states(comparison), _COLUMNS),
    ]


def _one_below_the_other(
    *views: Callable[[Comparison], list[Panel]],
) -> Callable[[Comparison], Rows]:
    """Return rows of one plot, the views of a control together; of several side by side."""

    def rows(comparison: Comparison) -> Rows:
        by_control = _by_control(comparison, views)
        if len(by_control) == 1:
            return [[panel] for panel in by_control[0]]
        return by_control

    return rows


def _by_control(
    comparison: Comparison, views: Sequence[Callable[[Comparison], list[Panel]]]
) -> Rows:
    columns = zip_longest(*(view(comparison) for view in views))
    return [[panel for panel in row if panel is not None] for row in columns]


def _sheet(comparison: Comparison) -> Rows:
    errors = _by_control(comparison, (on_the_whole, magnified, logarithmic, spectrum))
    return arranged(controls(comparison), states(comparison), errors) if errors else []


def arranged(controls: Sequence[Panel], states: Sequence[Panel], errors: Rows) -> Rows:
    """Return the rows of a sheet: trajectories, and below them a row of errors a control."""
    if len(controls) + len(states) <= _SHEET_COLUMNS:
        return [[*controls, *states], *errors]
    curves = [row for group in (controls, states) for row in balanced(group, _SHEET_COLUMNS)]
    return curves + errors


FIGURES: dict[str, Kind] = {
    "trajectories": Kind("Controls and states", "-trajectories", _trajectories, 11, 2.4),
    "error": Kind(
        "Error of the control",
        "-error",
        _one_below_the_other(on_the_whole, magnified),
        11,
        2.6,
    ),
    "spectrum": Kind(
        "Spectrum of the control's error", "-spectrum", _one_below_the_other(spectrum), 11, 3.2
    ),
    "error-log": Kind(
        "Error of the control, logarithmic",
        "-error-log",
        _one_below_the_other(logarithmic),
        11,
        3.2,
    ),
    "sheet": Kind("Comparison of the methods", "", _sheet, 17, 2.6),
}


def figure(comparison: Comparison, name: str) -> Figure | None:
    """Return the figure `name` of `FIGURES`; None where it has nothing to show."""
    kind = FIGURES[name]
    rows = kind.rows(comparison)
    if not rows:
        return None
    methods = [(row.method, row.solution.success) for row in comparison.rows]
    known = "" if comparison.truth is None else comparison.truth.title
    return drawn_rows(rows, kind, comparison.title or comparison.problem, methods, known)


def drawn_rows(
    rows: Rows, kind: Kind, title: str, methods: Sequence[tuple[str, bool]], known: str
) -> Figure:
    """Return a figure of plots.

    Args:
        rows: the plots by row.
        kind: the figure's heading and size.
        title: of the problem.
        methods: by number in the comparison, each with whether it is solved.
        known: what the truth is called; empty where there is none.
    """
    from matplotlib.figure import Figure

    panels = [panel for row in rows for panel in row]
    entries = _entries(methods, known, panels)
    columns = legend_columns(list(entries), kind.width)
    legend = 0.22 * math.ceil(len(entries) / columns)
    size = kind.width, 0.8 + legend + kind.height * len(rows)
    drawn = Figure(figsize=size, layout="constrained")
    limits = _limits(panels)
    for i, j, panel, place in places(drawn, rows, [1.0] * len(rows)):
        axes = drawn.add_subplot(place)
        _draw(axes, panel, len(methods))
        axes.set_xlim(*limits[panel.axis])
        below = rows[i + 1] if i + 1 < len(rows) else ()
        if len(below) == len(rows[i]) and below[j].axis == panel.axis:
            axes.tick_params(labelbottom=False)  # they stand under the plot below
        else:
            axes.set_xlabel(panel.axis)
    drawn.suptitle(f"{plain(title)}\n{kind.heading}")
    drawn.legend(
        handles=list(entries.values()),
        labels=list(entries),
        loc="outside lower center",
        ncols=columns,
        frameon=False,
        handlelength=3.2,
    )
    return drawn


def _limits(panels: Sequence[Panel]) -> dict[str, tuple[float, float]]:
    """Return from where to where each kind of horizontal axis reaches: the same in all plots."""
    ends: dict[str, list[float]] = {}
    for panel in panels:
        for trace in panel.traces:
            ends.setdefault(panel.axis, []).extend(trace.x[[0, -1]])
    limits = {}
    for axis, points in ends.items():
        margin = 0.01 * (max(points) - min(points)) or 1.0
        limits[axis] = min(points) - margin, max(points) + margin
    return limits


def _draw(axes: Axes, panel: Panel, count: int) -> None:
    for start, end in panel.zones:
        axes.axvspan(start, end, zorder=0.2, **_ZONE)
    for bound in panel.bounds:
        axes.axhline(bound, zorder=1.5, **_BOUND)
    for place, trace in enumerate(panel.traces):
        _line(axes, trace, 2.0 + place / len(panel.traces), count)
    if panel.logarithmic:
        axes.set_yscale("log")
        axes.minorticks_off()
    axes.set_ylim(panel.low, panel.high)
    axes.set_ylabel(panel.label)
    axes.grid(alpha=0.25)
    if panel.note:
        axes.set_title(plain(panel.note), fontsize="x-small", loc="right", color=BOUND, pad=3)


def _line(axes: Axes, trace: Trace, order: float, count: int) -> None:
    """Draw a line; rough ones beneath the reference, ours on top."""
    if trace.method < 0:
        axes.plot(trace.x, trace.y, zorder=1.9, **_REFERENCE)
        return
    if trace.method == 0:
        width, alpha = (0.9 if trace.rough else 1.3), 1.0
    elif trace.rough:
        width, alpha, order = 0.6, 0.6, order - 0.9 * (order - 1.0)
    else:
        width, alpha = 1.1, 1.0
    ends = trace.x[[0, -1]]
    spread = (np.arange(_MARKS) + (trace.method + 0.5) / (count + 1)) / _MARKS
    marks = np.searchsorted(trace.x, ends[0] + spread * (ends[1] - ends[0]))
    every = np.unique(np.minimum(marks, len(trace.x) - 1)).tolist()
    look = {**style(trace.method), "linewidth": width, "alpha": alpha, "zorder": order}
    axes.plot(trace.x, trace.y, markevery=every, in_layout=False, **look)


def _entries(
    methods: Sequence[tuple[str, bool]], truth: str, panels: Sequence[Panel]
) -> dict[str, Artist]:
    """Return what a legend has, by its name: what is drawn, each once."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    drawn = {trace.method for panel in panels for trace in panel.traces}
    entries: dict[str, Artist] = {}
    for number, (method, solved) in enumerate(methods):
        if number in drawn:
            name = plain(shortened(method, _LONGEST)) + ("" if solved else " (NOT SOLVED)")
            while name in entries:
                name += "′"
            entries[name] = Line2D([], [], linewidth=1.3, **style(number))
    if -1 in drawn and truth:
        title = plain(shortened(truth, _LONGEST))
        known = title if title.startswith("reference") else f"reference: {title}"
        entries[known] = Line2D([], [], **_REFERENCE)
    if any(panel.bounds for panel in panels):
        entries["bound"] = Line2D([], [], **_BOUND)
    if any(panel.zones for panel in panels):
        entries["jump zones"] = Patch(**_ZONE)
    return entries


def draw_all(comparison: Comparison, folder: Path, ending: str) -> tuple[Path, ...]:
    """Write the figures that have something to show, and return their paths.

    Args:
        comparison: what to draw.
        folder: where to; files are `<problem>-compare-error.png` and the like.
        ending: the format: png, svg or pdf.

    Raises:
        ResultFileError: a file cannot be written.
    """
    paths = []
    for name, kind in FIGURES.items():
        drawn = figure(comparison, name)
        if drawn is not None:
            path = folder / f"{comparison.problem}-compare{kind.suffix}.{ending}"
            write(drawn, path)
            paths.append(path)
    return tuple(paths)
