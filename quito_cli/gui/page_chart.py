"""Charts of answers -> options of ECharts: panels below one another over one axis of time.

A panel is a grid of the picture. All panels share hover and zoom; the vertical axis follows what is
seen of the horizontal one. Colours are CSS variables, which SVG takes as they are, so that light
and dark need no new picture. What is drawn but has no value to hover has a name that begins with ~.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from quito_cli.gui.answer import Answer, Chart, Line, Numbers

PANEL, GAP, TOP, BOTTOM = 138, 34, 26, 34
"""Heights in pixels: of a panel, of the room between two, above the first, below the last."""
COLOURS = tuple(f"var(--run{i})" for i in range(6))
KNOWN, BOUND, MARK = "var(--known)", "var(--bound)", "var(--mark)"
_NEAR, _FAR = 0.6, 2.0
"""Bounds further than this many spans of a state, or sizes of a control, are not drawn."""
_BOUND_POINTS = 60
_MOST_POINTS = 700
"""Of a line: about the pixels that it has."""


@dataclass(frozen=True)
class Entry:
    """A line of the legend."""

    name: str
    colour: str
    dashes: str
    """solid, dashed or dotted."""


@dataclass(frozen=True)
class Picture:
    """Options of ECharts, with what stands around them."""

    options: dict[str, Any]
    height: int
    """In pixels."""
    legend: tuple[Entry, ...]
    said: str
    """For who cannot see it."""


def picture(
    answer: Answer, kinds: Iterable[str], overlays: Sequence[tuple[str, Answer]], known: bool
) -> Picture | None:
    """Return the plots of an answer with others laid over it; None where there is nothing to draw.

    Args:
        answer: the one whose panels are shown.
        kinds: of the charts wanted, in their order.
        overlays: other answers, with their labels; their lines of the same names are drawn.
        known: whether the reference is drawn where there is one.
    """
    wanted = [chart for kind in kinds for chart in answer.charts if chart.kind == kind]
    if not wanted:
        return None
    panels = [_Panel(i, chart, overlays, known) for i, chart in enumerate(wanted)]
    legend: dict[str, Entry] = {}
    for panel in panels:
        for entry in panel.legend():
            legend.setdefault(entry.name, entry)
    count = len(panels)
    last = count - 1
    options = {
        "animation": False,
        "grid": [
            {"left": 64, "right": 14, "top": TOP + i * (PANEL + GAP), "height": PANEL}
            for i in range(count)
        ],
        "xAxis": [panel.across(i == last) for i, panel in enumerate(panels)],
        "yAxis": [panel.upright() for panel in panels],
        "series": [line for panel in panels for line in panel.series()],
        "axisPointer": {"link": [{"xAxisIndex": "all"}]},
        "tooltip": _tooltip(),
        "dataZoom": [
            {
                "type": "inside",
                "xAxisIndex": list(range(count)),
                "filterMode": "filter",
                "zoomOnMouseWheel": "ctrl",
                "moveOnMouseMove": "shift",
                "moveOnMouseWheel": False,
            }
        ],
        "toolbox": {
            "itemSize": 0,
            "feature": {"dataZoom": {"yAxisIndex": "none", "brushStyle": _BRUSH}},
        },
        "textStyle": {"fontFamily": "inherit"},
    }
    height = TOP + count * (PANEL + GAP) - GAP + BOTTOM
    return Picture(options, height, tuple(legend.values()), _said(wanted))


_BRUSH = {"color": "rgba(90,150,210,0.25)", "borderWidth": 0}


def _tooltip() -> dict[str, Any]:
    return {
        "trigger": "axis",
        ":formatter": "points => quito.hover(points)",
        "confine": True,
        "backgroundColor": "var(--panel)",
        "borderColor": "var(--line)",
        "padding": [6, 10],
        "transitionDuration": 0,
        "textStyle": {"color": "var(--ink)", "fontSize": 12},
        "extraCssText": "box-shadow:0 4px 16px #0003",
    }


def _said(charts: Sequence[Chart]) -> str:
    """Return in words what is seen: names, ranges and switching times."""
    parts = []
    for chart in charts:
        for line in chart.lines:
            values = [value for value in line.values if value is not None]
            if values:
                parts.append(
                    f"{line.name} from {values[0]:.4g} to {values[-1]:.4g}, "
                    f"between {min(values):.4g} and {max(values):.4g}"
                )
        parts += [mark.said for mark in chart.marks]
    return "; ".join(parts) + "."


@dataclass(frozen=True)
class _Panel:
    """One grid of the picture."""

    index: int
    chart: Chart
    overlays: Sequence[tuple[str, Answer]]
    known: bool

    def across(self, last: bool) -> dict[str, Any]:
        """Return the horizontal axis; numbers stand at the lowest panel alone."""
        numbers = {"show": last, "color": "var(--muted)", "fontSize": 11, "hideOverlap": True}
        return _axis() | {
            "gridIndex": self.index,
            "type": "value",
            "min": self.chart.times[0],
            "max": self.chart.times[-1],
            "axisLabel": numbers | {":formatter": "value => quito.number(value)"},
            "name": self.chart.across if last else "",
            "nameLocation": "middle",
            "nameGap": 20,
            "axisLine": {"onZero": False, "lineStyle": {"color": "var(--line-strong)"}},
        }

    def upright(self) -> dict[str, Any]:
        """Return the vertical axis."""
        axis = _axis() | {
            "gridIndex": self.index,
            "type": "log" if self.chart.logarithmic else "value",
            "scale": True,
            "splitNumber": 4,
            "name": self.chart.label,
            "nameLocation": "end",
            "nameGap": 6,
            "axisLabel": {
                "color": "var(--muted)",
                "fontSize": 11,
                ":formatter": "value => quito.number(value)",
            },
        }
        if self.chart.logarithmic:
            return axis
        low, high = _span(value for line in self.chart.lines for value in line.values)
        if high - low <= 1e-9 * max(abs(low), abs(high), 1.0):  # rounding is no shape
            room = 0.5 * max(abs(low), 1.0)
            return axis | {"min": low - room, "max": high + room}
        return axis | {"boundaryGap": ["4%", "4%"]}

    def series(self) -> list[dict[str, Any]]:
        """Return the lines, those of other answers and the reference beneath."""
        drawn = [*self._bounds(), *self._others()]
        for i, line in enumerate(self.chart.lines):
            if self.known and line.known is not None:
                drawn.append(self._line(f"{line.name}, reference", line.known, KNOWN, "dashed", 5))
            colour = COLOURS[i % len(COLOURS)]
            drawn.append(self._line(line.name, line.values, colour, "solid", 4))
        if self.chart.marks:
            drawn[-1]["markLine"] = {
                "symbol": "none",
                "silent": True,
                "animation": False,
                "label": {"show": False},
                "lineStyle": {"color": MARK, "type": "dotted", "width": 1.4},
                "data": [{"xAxis": mark.time, "name": mark.said} for mark in self.chart.marks],
            }
        return drawn

    def legend(self) -> list[Entry]:
        """Return what the lines are."""
        names = [line.name for line in self.chart.lines]
        found = []
        if len(names) > 1:
            found += [Entry(n, COLOURS[i % len(COLOURS)], "solid") for i, n in enumerate(names)]
        elif self.overlays:
            found.append(Entry("this run", COLOURS[0], "solid"))
        for i, (label, _) in enumerate(self.overlays, 1):
            found.append(Entry(label, COLOURS[i % len(COLOURS)], "solid"))
        if self.known and any(line.known is not None for line in self.chart.lines):
            found.append(Entry("reference", KNOWN, "dashed"))
        if self._limits():
            found.append(Entry("bound", BOUND, "dotted"))
        if self.chart.marks:
            found.append(Entry("switching time", MARK, "dotted"))
        return found

    def _limits(self) -> list[float]:
        """Return the bounds that are near enough to be drawn."""
        low, high = _span(value for line in self.chart.lines for value in line.values)
        reach = _NEAR * (high - low)
        if self.chart.kind == "controls":
            reach = _FAR * max(high - low, abs(low), abs(high))
        bounds = {b for line in self.chart.lines for b in (line.lower, line.upper)}
        return sorted(b for b in bounds if b is not None and low - reach <= b <= high + reach)

    def _bounds(self) -> list[dict[str, Any]]:
        first, last = self.chart.times[0], self.chart.times[-1]
        places = [first + (last - first) * i / (_BOUND_POINTS - 1) for i in range(_BOUND_POINTS)]
        return [
            self._series(f"~bound {bound:g}", [[t, bound] for t in places], BOUND, "dotted", 2)
            for bound in self._limits()
        ]

    def _others(self) -> list[dict[str, Any]]:
        """Return the lines of the same names in the other answers."""
        names = {line.name for line in self.chart.lines}
        drawn = []
        for i, (label, answer) in enumerate(self.overlays, 1):
            for chart in answer.charts:
                if chart.kind != self.chart.kind:
                    continue
                for line in chart.lines:
                    if line.name in names:
                        points = _points(chart.times, line.values)
                        colour = COLOURS[i % len(COLOURS)]
                        name = f"{line.name}, {label}"
                        drawn.append(self._series(name, points, colour, "solid", 3))
        return drawn

    def _line(
        self, name: str, values: Numbers, colour: str, dashes: str, height: int
    ) -> dict[str, Any]:
        points = _points(self.chart.times, values)
        return self._series(name, points, colour, dashes, height)

    def _series(
        self, name: str, points: list[list[float | None]], colour: str, dashes: str, height: int
    ) -> dict[str, Any]:
        width = {"solid": 1.8, "dashed": 1.4, "dotted": 1.1}[dashes]
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
            "lineStyle": {"color": colour, "type": dashes, "width": width},
            "emphasis": {"disabled": True},
        }


def _axis() -> dict[str, Any]:
    return {
        "splitLine": {"lineStyle": {"color": "var(--grid)"}},
        "axisTick": {"show": False},
        "nameTextStyle": {"color": "var(--ink)", "fontSize": 12, "fontWeight": 600, "align": "left"},
        "axisPointer": {
            "lineStyle": {"color": "var(--line-strong)", "type": "solid"},
            "label": {"show": False},
            "animation": False,
        },
    }


def _span(values: Iterable[float | None]) -> tuple[float, float]:
    known = [value for value in values if value is not None and math.isfinite(value)]
    return (min(known), max(known)) if known else (0.0, 1.0)


def _points(times: Sequence[float], values: Numbers) -> list[list[float | None]]:
    """Return the points of a line: of each group of neighbours the least and the largest."""
    size = -(-2 * len(times) // _MOST_POINTS)
    if size <= 2:
        return [[t, _short(v)] for t, v in zip(times, values, strict=True)]
    kept = {0, len(times) - 1}
    for start in range(0, len(times), size):
        group = range(start, min(start + size, len(times)))
        known = [i for i in group if values[i] is not None]
        if known:
            kept.add(min(known, key=lambda i: values[i] or 0.0))
            kept.add(max(known, key=lambda i: values[i] or 0.0))
        else:
            kept.add(start)
    return [[times[i], _short(values[i])] for i in sorted(kept)]


def _short(value: float | None) -> float | None:
    """Return a value with as many digits as a hover shows."""
    return None if value is None else float(f"{value:.8g}")
