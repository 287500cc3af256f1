"""Solution or Comparison -> the charts of a page, from the same curves as the pictures."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import combinations
from typing import TYPE_CHECKING, Final, Literal

import numpy as np
from numpy.typing import NDArray

from quito_cli.gui.answer import Chart, Line, Mark, Numbers, Span
from quito_cli.plots import error_panels, panels
from quito_cli.plots.arcs import KIND_NAMES
from quito_cli.plots.curves import Curve, near_bounds
from quito_cli.plots.figure import PANELS
from quito_cli.problem.shapes import Ball, Block
from quito_cli.summary.meshes import said_of

if TYPE_CHECKING:
    from quito_cli.comparison.comparison import Comparison
    from quito_cli.plots.panels import Panel
    from quito_cli.solution.solution import Drawing, Solution

Array = NDArray[np.float64]

_DIGITS: Final = 9
"""Of a value: more than a screen shows at any zoom, and half of what is sent."""
_ROUND: Final = 65
"""Points of the outline of a circle."""
REFERENCE: Final = "reference"


def of_solution(solution: Solution) -> tuple[Chart, ...]:
    """Return states, controls, costates, switching functions, and the plans of the file."""
    found: list[Chart] = []
    kinds: tuple[Literal["states", "controls", "costates", "switching"], ...]
    kinds = ("states", "controls", "costates", "switching")
    for kind in kinds:
        for curve in PANELS[kind](solution):
            assert isinstance(curve, Curve)
            found.append(_curve(kind, curve, solution))
    return (*found, *(chart for drawn in solution.drawings for chart in _plan(drawn)))


def _curve(
    kind: Literal["states", "controls", "costates", "switching"], curve: Curve, solution: Solution
) -> Chart:
    lines = [_line(line.name, "answer", curve.times, line.values) for line in curve.lines]
    for line in curve.lines:
        if line.known is not None:
            name = REFERENCE if len(curve.lines) == 1 else f"{line.name}, {REFERENCE}"
            lines.append(_line(name, "reference", curve.times, line.known))
    return Chart(
        kind,
        curve.lines[0].name if len(curve.lines) == 1 else curve.label,
        curve.label,
        "t",
        tuple(lines),
        bounds=tuple(near_bounds(curve)),
        marks=tuple(Mark(one.time, one.uncertainty, said_of(solution, one)) for one in curve.marks),
        spans=tuple(
            Span(arc.start, arc.end, arc.kind, KIND_NAMES[arc.kind])
            for arc in (*curve.arcs, *curve.shades)
            if arc.kind in KIND_NAMES
        ),
        logarithmic=curve.logarithmic,
    )


def _line(name: str, role: Literal["answer", "reference"], x: Array, y: Array) -> Line:
    x, y = panels.thinned(x, panels.finite(y))
    return Line(name, role, _numbers(x), _numbers(y))


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
                Line(name, "answer", _numbers(points[:, i]), _numbers(points[:, j]))
                for name, points in drawn.curves.items()
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
    """Return controls and states of all methods, the error of the control, and its spectrum."""
    parts: tuple[tuple[Literal["controls", "states", "error", "spectrum"], Sequence[Panel]], ...]
    parts = (
        ("controls", panels.controls(comparison)),
        ("error", error_panels.on_the_whole(comparison)),
        ("error", error_panels.logarithmic(comparison)),
        ("spectrum", error_panels.spectrum(comparison)),
        ("states", panels.states(comparison)),
    )
    return tuple(_panel(kind, panel, comparison) for kind, drawn in parts for panel in drawn)


def _panel(
    kind: Literal["controls", "states", "error", "spectrum"], panel: Panel, comparison: Comparison
) -> Chart:
    lines = []
    for trace in panel.traces:
        known = trace.method < 0
        name = REFERENCE if known else comparison.rows[trace.method].method
        x, y = _numbers(trace.x), _numbers(trace.y)
        lines.append(Line(name, "reference" if known else "answer", x, y))
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
