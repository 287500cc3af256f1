"""Charts of answers -> options of ECharts: panels below one another over one axis.

A panel is a grid of the picture. All panels share hover and zoom; the vertical axis follows what is
seen of the horizontal one.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from quito_cli.gui.answer import Answer, Chart
from quito_cli.gui.page_panel import Entry, Panel, span

PANEL, PLAN = 138, 420
"""Heights in pixels, of a panel over time and of a plan."""
_GAP, _TOP, _BOTTOM = 36, 26, 36
"""Room between two panels, above the first, below the last."""


@dataclass(frozen=True)
class Picture:
    """Options of ECharts, with what stands around them."""

    options: dict[str, Any]
    height: int
    """In pixels."""
    legend: tuple[Entry, ...]
    said: str
    """For who cannot see it."""
    notes: tuple[str, ...]
    """What a reader must know of the frames."""


def picture(
    answer: Answer, kinds: Iterable[str], overlays: Sequence[tuple[str, Answer]], known: bool
) -> Picture | None:
    """Return the plots of an answer with others laid over it; None where there is nothing to draw.

    Args:
        answer: the one whose panels are shown.
        kinds: of the charts wanted, in their order, over the same axis; a plan stands alone.
        overlays: other answers, with their labels; charts of the same kind and name are drawn.
        known: whether the reference is drawn where there is one.
    """
    wanted = [chart for kind in kinds for chart in answer.charts if chart.kind == kind]
    if not wanted:
        return None
    reach = span(value for chart in wanted for line in chart.lines for value in line.x)
    panels = [Panel(i, chart, overlays, known, reach) for i, chart in enumerate(wanted)]
    count, last = len(panels), len(panels) - 1
    each = PLAN if wanted[0].kind == "plan" else PANEL
    entries = {entry.name: entry for panel in panels for entry in panel.legend()}
    options = {
        "animation": False,
        "grid": [
            {"left": 66, "right": 16, "top": _TOP + i * (each + _GAP), "height": each}
            for i in range(count)
        ],
        "xAxis": [panel.across(i == last or each == PLAN) for i, panel in enumerate(panels)],
        "yAxis": [panel.upright() for panel in panels],
        "series": [line for panel in panels for line in panel.series()],
        "tooltip": _tooltip("axis" if each == PANEL else "none"),
        "textStyle": {"fontFamily": "inherit"},
    }
    if each == PANEL:
        options |= {"axisPointer": {"link": [{"xAxisIndex": "all"}]}} | _zoom(count)
    height = _TOP + count * (each + _GAP) - _GAP + _BOTTOM
    notes = tuple(f"{chart.label}: {chart.note}" for chart in wanted if chart.note)
    return Picture(options, height, tuple(entries.values()), _said(wanted), notes)


def _zoom(count: int) -> dict[str, Any]:
    """Return zooming: a band drawn with the pointer, Ctrl and wheel, or the page's buttons."""
    return {
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
            "feature": {
                "dataZoom": {
                    "yAxisIndex": "none",
                    "brushStyle": {"color": "rgba(90,150,210,0.25)", "borderWidth": 0},
                }
            },
        },
    }


def _tooltip(trigger: str) -> dict[str, Any]:
    return {
        "trigger": trigger,
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
            low, high = span(line.y)
            parts.append(f"{chart.name}, {line.name}: between {low:.4g} and {high:.4g}")
    switching = dict.fromkeys(mark.said for chart in charts for mark in chart.marks)
    return "; ".join([*parts, *(f"switching at {said}" for said in switching)]) + "."
