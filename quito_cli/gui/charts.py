"""Solution or Comparison -> the charts of a page, from the same curves as the pictures."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import combinations
from typing import TYPE_CHECKING, Final, Literal

import numpy as np
from numpy.typing import NDArray

from quito_cli.gui.answer import Chart, Kind, Line, Mark, Numbers, Span
from quito_cli.plots import error_panels, panels
from quito_cli.plots.arcs import KIND_NAMES
from quito_cli.plots.curves import Curve, near_bounds
from quito_cli.plots.figure import PANELS
from quito_cli.problem.shapes import Ball, Block
from quito_cli.summary.switches import Switch, switches

if TYPE_CHECKING:
    from quito_cli.comparison.comparison import Comparison
    from quito_cli.plots.panels import Panel
    from quito_cli.solution.solution import Drawing, Solution

Array = NDArray[np.float64]

_DIGITS: Final = 9
"""Of a value: more than a screen shows at any zoom, and half of what is sent."""
_ROUND: Final = 65
"""Points of the outline of a circle."""
_MOST_MARKS: Final = 36
"""Switching times that are marked in a plot."""
REFERENCE: Final = "reference"


def of_solution(solution: Solution) -> tuple[Chart, ...]:
    """Return states, controls, costates, switching functions, and the plans of the file."""
    found: list[Chart] = []
    marked = _marked(switches(solution))
    kinds: tuple[Literal["states", "controls", "costates", "switching"], ...]
    kinds = ("states", "controls", "costates", "switching")
    for kind in kinds:
        for curve in PANELS[kind](solution):
            assert isinstance(curve, Curve)
            found.append(_curve(kind, curve, marked))
    return (*found, *(chart for drawn in solution.drawings for chart in _plan(drawn)))


def _marked(found: Sequence[Switch]) -> list[Switch]:
    """Return the switching times that are marked: of very many the highest jumps."""
    highest = sorted(found, key=lambda one: -one.height)[:_MOST_MARKS]
    return sorted(highest, key=lambda one: one.time)


def _curve(
    kind: Literal["states", "controls", "costates", "switching"],
    curve: Curve,
    marked: Sequence[Switch],
) -> Chart:
    names = {line.name for line in curve.lines} if kind == "controls" else set()
    lines = [_line(one.name, i, curve.times, one.values) for i, one in enumerate(curve.lines)]
    known_times = curve.times if curve.known_times is None else curve.known_times
    for line in curve.lines:
        if line.known is not None:
            name = REFERENCE if len(curve.lines) == 1 else f"{line.name}, {REFERENCE}"
            lines.append(_line(name, -1, known_times, line.known))
    low, high = panels.span([line.values for line in curve.lines])
    flat, middle = high - low < curve.least, (low + high) / 2  # what is so small is no shape
    return Chart(
        kind,
        curve.lines[0].name if len(curve.lines) == 1 else curve.label,
        curve.label,
        "t",
        tuple(lines),
        bounds=tuple(near_bounds(curve)),
        marks=tuple(
            Mark(one.time, one.uncertainty, one.said, not names.isdisjoint(one.controls))
            for one in marked
        ),
        spans=tuple(
            Span(arc.start, arc.end, arc.kind, KIND_NAMES[arc.kind])
            for arc in (*curve.arcs, *curve.shades)
            if arc.kind in KIND_NAMES
        ),
        logarithmic=curve.logarithmic,
        low=middle - curve.least / 2 if flat else None,
        high=middle + curve.least / 2 if flat else None,
    )


def _line(name: str, number: int, x: Array, y: Array) -> Line:
    x, y = panels.thinned(x, panels.finite(y))
    role: Literal["answer", "reference"] = "reference" if number < 0 else "answer"
    return Line(name, role, number, _numbers(x), _numbers(y))


def _numbers(values: Iterable[float]) -> Numbers:
    return tuple(
        float(f"{value:.{_DIGITS}g}") if math.isfinite(value) else None for value in values
    )


def _plan(drawn: Drawing) -> Iterator[Chart]:
    """Yield a plan; one in space is seen along each of its axes."""
    obstacles: tuple[Ball | Block, ...] = (*drawn.balls, *drawn.blocks)
    for i, j in combinations(range(len(drawn.labels)), 2):
        flat = len(drawn.labels) == 2
        title = drawn.title or drawn.name
        yield Chart(
            "plan",
            title if flat else f"{title}: {drawn.labels[i]}, {drawn.labels[j]}",
            drawn.labels[j],
            drawn.labels[i],
            tuple(
                Line(name, "answer", k, _numbers(points[:, i]), _numbers(points[:, j]))
                for k, (name, points) in enumerate(drawn.curves.items())
            ),
            outlines=tuple(_outline(one, i, j) for one in obstacles),
        )


def _outline(shape: Ball | Block, i: int, j: int) -> tuple[Numbers, Numbers]:
    """Return the shadow of an obstacle on the plane of axes i and j."""
    x, y = shape.centre[i], shape.centre[j]
    if isinstance(shape, Ball):
        angles = np.linspace(0, 2 * np.pi, _ROUND)
        around = x + shape.radius * np.cos(angles), y + shape.radius * np.sin(angles)
        return _numbers(around[0]), _numbers(around[1])
    a, b = shape.half[i], shape.half[j]
    return _numbers([x - a, x + a, x + a, x - a, x - a]), _numbers(
        [y - b, y - b, y + b, y + b, y - b]
    )


def of_comparison(comparison: Comparison) -> tuple[Chart, ...]:
    """Return controls and states of all methods, and views of the control's error."""
    return tuple(
        _panel(kind, panel, comparison)
        for kind, view in VIEWS.items()
        for panel in view(comparison)
    )


VIEWS: Final[Mapping[Kind, Callable[[Comparison], Sequence[Panel]]]] = {
    "controls": panels.controls,
    "states": panels.states,
    "error": error_panels.on_the_whole,
    "magnified": error_panels.magnified,
    "logarithmic": error_panels.logarithmic,
    "spectrum": error_panels.spectrum,
}
"""Of a comparison, as the sheet of `quito compare` has them."""


def _panel(kind: Kind, panel: Panel, comparison: Comparison) -> Chart:
    lines = []
    for trace in panel.traces:
        known = trace.method < 0
        name = REFERENCE if known else comparison.rows[trace.method].method
        role: Literal["answer", "reference"] = "reference" if known else "answer"
        x, y = _numbers(trace.x), _numbers(trace.y)
        lines.append(Line(name, role, trace.method, x, y, trace.rough))
    return Chart(
        kind,
        panel.label,
        panel.label,
        panel.axis,
        tuple(lines),
        bounds=panel.bounds,
        spans=tuple(Span(a, b, "zone", "jump zone") for a, b in panel.zones),
        logarithmic=panel.logarithmic,
        low=panel.low,
        high=panel.high,
        note=panel.note,
    )


def panel_of(chart: Chart) -> Panel:
    """Return the plot of a comparison that a chart was made of."""

    def array(values: Numbers) -> Array:
        return np.array([math.nan if value is None else value for value in values])

    assert chart.low is not None
    assert chart.high is not None
    return panels.Panel(
        chart.label,
        chart.across,
        tuple(
            panels.Trace(one.number, array(one.x), array(one.y), one.rough) for one in chart.lines
        ),
        chart.low,
        chart.high,
        chart.bounds,
        tuple((span.start, span.end) for span in chart.spans),
        chart.logarithmic,
        chart.note,
    )
