"""One panel of a picture: axes, lines, bounds, marks and shades of a chart, as ECharts has them.

Colours are CSS variables, which SVG takes as they are, so that light and dark need no new picture.
What is drawn but has no value to hover has a name that begins with ~.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from quito_cli.gui.answer import Answer, Chart, Line, Mark, Numbers

COLOURS = tuple(f"var(--run{i})" for i in range(6))
KNOWN, BOUND, MARK = "var(--known)", "var(--bound)", "var(--mark)"
_SHADES = {
    "lower": "var(--arc-bound)",
    "upper": "var(--arc-bound)",
    "singular": "var(--arc-singular)",
    "kink": "var(--arc-singular)",
    "active": "var(--arc-active)",
    "zone": "var(--arc-bound)",
}
"""Of the stretches that are shaded; interior arcs are what is left."""
_WORDS = {"lower": "at a bound", "upper": "at a bound"}
"""What the legend says of stretches, where it is not what the answer says."""
_MARKED = {True: {"width": 1.6, "opacity": 1.0}, False: {"width": 1.1, "opacity": 0.6}}
"""How a switching time is marked: where it is the chart's own, and elsewhere."""
_MOST_TIMES = 4
"""Switching times that the legend names."""
_BOUND_POINTS = 300
Points = tuple[tuple[float | None, float | None], ...]


@dataclass(frozen=True)
class Entry:
    """A line of the legend."""

    name: str
    colour: str
    style: str
    """solid, dashed, dotted, or shade."""


@dataclass(frozen=True)
class Panel:
    """One grid of the picture."""

    index: int
    chart: Chart
    overlays: Sequence[tuple[str, Answer]]
    known: bool
    reach: tuple[float, float]
    """Of the horizontal axis, where panels share it."""

    def across(self, last: bool) -> dict[str, Any]:
        """Return the horizontal axis; numbers stand at the lowest panel alone."""
        low, high = self.reach
        axis = _axis() | {
            "gridIndex": self.index,
            "type": "value",
            "axisLabel": _label() | {"show": last},
            "name": self.chart.across if last else "",
            "nameLocation": "middle",
            "nameGap": 22,
            "nameTextStyle": _name() | {"align": "center"},
            "axisLine": {"onZero": False, "lineStyle": {"color": "var(--line-strong)"}},
        }
        return axis | ({"scale": True} if self.chart.kind == "plan" else {"min": low, "max": high})

    def upright(self) -> dict[str, Any]:
        """Return the vertical axis."""
        axis = _axis() | {
            "gridIndex": self.index,
            "type": "log" if self.chart.logarithmic else "value",
            "scale": True,
            "splitNumber": 4,
            "name": self.chart.label + (", magnified" if self.chart.kind == "magnified" else ""),
            "nameLocation": "end",
            "nameGap": 6,
            "axisLabel": _label(),
        }
        given = self.chart.low, self.chart.high
        if None not in given:
            return axis | _between(*given)
        if self.chart.logarithmic:
            return axis
        low, high = span(value for line in self.chart.lines for value in line.y)
        if high - low <= 1e-9 * max(abs(low), abs(high), 1.0):  # rounding is no shape
            room = 0.5 * max(abs(low), 1.0)
            return axis | _between(low - room, high + room)
        return axis | {"boundaryGap": ["4%", "4%"]}

    def series(self) -> list[dict[str, Any]]:
        """Return the lines, those of other answers and the reference beneath."""
        drawn = [*self._outlines(), *self._bounds(), *self._others()]
        for line, colour in self._coloured():
            style, height = ("dashed", 5) if line.role == "reference" else ("solid", 4)
            name = f"{self.chart.name}, {line.name}" if line.name == "reference" else line.name
            drawn.append(self._line(name, line, colour, style, height))
        if drawn:
            drawn[-1] |= self._marks()
        return drawn

    def _coloured(self) -> list[tuple[Line, str]]:
        """Return the lines to be drawn, each with its colour."""
        answers = [line for line in self.chart.lines if line.role == "answer"]
        found = [(line, COLOURS[line.number % len(COLOURS)]) for line in answers]
        if self.known:
            found += [(line, KNOWN) for line in self.chart.lines if line.role == "reference"]
        return found

    def legend(self) -> list[Entry]:
        """Return what the lines are."""
        answers = [pair for pair in self._coloured() if pair[0].role == "answer"]
        found = []
        if len(answers) > 1:
            ordered = sorted(answers, key=lambda pair: pair[0].number)
            found += [Entry(line.name, colour, "solid") for line, colour in ordered]
        elif self.overlays:
            found.append(Entry("this run", COLOURS[0], "solid"))
        for i, (label, _) in enumerate(self.overlays, 1):
            found.append(Entry(label, COLOURS[i % len(COLOURS)], "solid"))
        if len(self._coloured()) > len(answers):
            found.append(Entry("reference", KNOWN, "dashed"))
        if self.chart.bounds:
            found.append(Entry("bound", BOUND, "dotted"))
        if self.chart.marks:
            found.append(Entry(_switching(self.chart.marks), MARK, "dotted"))
        found += [
            Entry(_WORDS.get(span.kind, span.said), _SHADES[span.kind], "shade")
            for span in self.chart.spans
            if span.kind in _SHADES
        ]
        return found

    def _marks(self) -> dict[str, Any]:
        """Return switching times, and shades of arcs."""
        found: dict[str, Any] = {}
        if self.chart.marks:
            found["markLine"] = {
                "symbol": "none",
                "silent": True,
                "animation": False,
                "label": {"show": False},
                "lineStyle": {"color": MARK, "type": "dotted"},
                "data": [
                    {"xAxis": mark.time, "name": mark.said, "lineStyle": _MARKED[mark.own]}
                    for mark in self.chart.marks
                ],
            }
        spans = [span for span in self.chart.spans if span.kind in _SHADES]
        if spans:
            found["markArea"] = {
                "silent": True,
                "animation": False,
                "data": [
                    [
                        {"xAxis": span.start, "itemStyle": {"color": _SHADES[span.kind]}},
                        {"xAxis": span.end},
                    ]
                    for span in spans
                ],
            }
        return found

    def _bounds(self) -> list[dict[str, Any]]:
        first, last = self.reach
        places = [first + (last - first) * i / (_BOUND_POINTS - 1) for i in range(_BOUND_POINTS)]
        return [
            self._series(f"~bound {bound:g}", tuple((t, bound) for t in places), BOUND, "dotted", 2)
            for bound in self.chart.bounds
        ]

    def _outlines(self) -> list[dict[str, Any]]:
        """Return the obstacles of a plan."""
        return [
            self._series("~obstacle", _points(x, y), BOUND, "solid", 1)
            | {"areaStyle": {"color": "var(--arc-bound)"}}
            for x, y in self.chart.outlines
        ]

    def _others(self) -> list[dict[str, Any]]:
        """Return the lines of the other answers in charts of the same name."""
        drawn = []
        for i, (label, answer) in enumerate(self.overlays, 1):
            colour = COLOURS[i % len(COLOURS)]
            for chart in answer.charts:
                if (chart.kind, chart.name) == (self.chart.kind, self.chart.name):
                    drawn += [
                        self._line(f"{line.name}, {label}", line, colour, "solid", 3)
                        for line in chart.lines
                        if line.role == "answer"
                    ]
        return drawn

    def _line(self, name: str, line: Line, colour: str, style: str, height: int) -> dict[str, Any]:
        drawn = self._series(name, _points(line.x, line.y), colour, style, height)
        if line.rough:  # it may cover others
            drawn["lineStyle"] |= {"width": 0.9, "opacity": 0.75}
        return drawn

    def _series(
        self, name: str, points: Points, colour: str, style: str, height: int
    ) -> dict[str, Any]:
        width = {"solid": 1.8, "dashed": 1.4, "dotted": 1.1}[style]
        return {
            "type": "line",
            "name": name,
            "xAxisIndex": self.index,
            "yAxisIndex": self.index,
            "data": points,
            "symbol": "none",
            "silent": True,
            "z": height,
            "color": colour,
            "lineStyle": {"color": colour, "type": style, "width": width},
            "emphasis": {"disabled": True},
        }


def _switching(marks: Sequence[Mark]) -> str:
    """Return what the legend says of switching times: a few by name, of many how many they are."""
    if len(marks) > _MOST_TIMES:
        return f"{len(marks)} switching times"
    times = ", ".join(f"{mark.time:.5g}" for mark in marks)
    return f"switching time{'s' if len(marks) > 1 else ''} {times}"


def _name() -> dict[str, Any]:
    return {"color": "var(--ink)", "fontSize": 12, "fontWeight": 600, "align": "left"}


def _axis() -> dict[str, Any]:
    return {
        "splitLine": {"lineStyle": {"color": "var(--grid)"}},
        "axisTick": {"show": False},
        "nameTextStyle": _name(),
        "axisPointer": {
            "lineStyle": {"color": "var(--line-strong)", "type": "solid"},
            "label": {"show": False},
            "animation": False,
        },
    }


def _label() -> dict[str, Any]:
    look = {"color": "var(--muted)", "fontSize": 11, "hideOverlap": True}
    return look | {":formatter": "value => quito.number(value)"}


def _between(low: float | None, high: float | None) -> dict[str, Any]:
    """Return the ends of an axis; they are no round numbers, and so not written at it."""
    unwritten = {"showMinLabel": False, "showMaxLabel": False}
    return {"min": low, "max": high, "axisLabel": _label() | unwritten}


def span(values: Iterable[float | None]) -> tuple[float, float]:
    """Return the least and the largest finite number; 0 and 1 where there is none."""
    known = [value for value in values if value is not None and math.isfinite(value)]
    return (min(known), max(known)) if known else (0.0, 1.0)


def _points(x: Numbers, y: Numbers) -> Points:
    """Return the points of a line; as tuples, for NiceGUI watches every list for changes."""
    return tuple(zip(x, y, strict=True))
