"""The bar that runs and cancels, and the progress of a solve: figures and a small plot.

Its height is the same whether something runs or not. The sentence of state is a live region for
readers of screens; the figures that change all the time are none.
"""

from __future__ import annotations

import math
from collections.abc import Awaitable, Callable, Sequence
from typing import Any

from nicegui import ui

from quito_cli.gui.job import Running, State, Waiting
from quito_cli.gui.work import Iterated

_LEAST = 1e-16
"""What an infeasibility of zero is drawn at."""
_EVERY, _DRAWN_EVERY = 0.2, 0.8
"""Seconds between two writings of the figures, and two pictures of them."""
_MOST_POINTS = 160
"""Of a line of the small plot: about its pixels."""
_COLOURS = {"infeasibility": "var(--run1)", "objective": "var(--run0)"}
"""Of the lines, which are named by the figures beside them."""
_FIGURES = ("iteration", "objective", "infeasibility", "time")


class RunBar:
    """Run, Cancel, what is going on."""

    def __init__(self, run: Callable[[], Awaitable[None]], cancel: Callable[[], None]) -> None:
        self._told = self._drawn = -math.inf
        self._said = ("", "")
        with ui.element("section").classes("panel run").props('aria-label="Run"'):
            with ui.element("div").classes("bar"):
                self._run = ui.button("Run", on_click=run).classes("main").mark("run")
                self._run.props('id=run aria-keyshortcuts="Control+Enter"')
                self._cancel = ui.button("Cancel", on_click=cancel).props("flat").classes("plain")
                self._cancel.props('id=cancel aria-keyshortcuts="Escape"').mark("cancel")
                self._status = ui.label().props("role=status aria-live=polite").mark("status")
            with ui.element("div").classes("progress"):
                with ui.element("dl"):
                    self._figures = {name: _figure(name) for name in _FIGURES}
                self._plot = ui.echart(_progress(()), renderer="svg").mark("progress")
                self._plot.props('role=img aria-label="Objective and infeasibility by iteration"')
        self._run.disable()
        self._cancel.disable()

    def say(self, text: str, kind: str = "") -> None:
        """Say what is going on, in a line; all of it where a pointer rests there.

        Args:
            text: of one line or several.
            kind: good, bad or nothing.
        """
        if (text, kind) == self._said:
            return
        self._said = text, kind
        self._status.set_text(text.partition("\n")[0])
        self._status.classes(replace=f"status {kind}")
        self._status.props(f'title="{_attribute(text)}"')

    def rest(self) -> None:
        """Nothing runs."""
        self._run.enable()
        self._cancel.disable()

    def begin(self, said: str) -> None:
        """Something begins."""
        self._run.disable()
        self._cancel.enable()
        self.say(said)
        self._figure({})
        self._told = self._drawn = -math.inf
        self._plot.options.update(_progress(()))

    def show(self, state: State) -> None:
        """Show how the job is."""
        if isinstance(state, Waiting):
            self.say(f"Waiting for a free worker: number {state.place} in the queue.")
        elif isinstance(state, Running):
            stage = state.history[-1].stage if state.history else ""
            word = "Stopping: the iterate so far is kept." if state.stopping else "Running"
            self.say(f"{word}{f', {stage}' if stage and not state.stopping else ''}")
            self._follow(state.history, state.seconds)

    def _follow(self, history: Sequence[Iterated], seconds: float) -> None:
        """Write the figures, and draw them, but not so often that a browser has no time left."""
        if seconds - self._told < _EVERY:
            return
        self._told = seconds
        figures = {"time": f"{seconds:.1f} s"}
        if history:
            last = history[-1]
            figures |= {
                "iteration": str(last.iteration),
                "objective": f"{last.cost:.8g}",
                "infeasibility": f"{last.violation:.1e}",
            }
        self._figure(figures)
        if seconds - self._drawn >= _DRAWN_EVERY:
            self.draw(history)
            self._drawn = seconds

    def _figure(self, figures: dict[str, str]) -> None:
        for name, label in self._figures.items():
            label.set_text(figures.get(name, "–"))

    def end(self, figures: dict[str, str], history: Sequence[Iterated]) -> None:
        """Leave the last figures standing."""
        self._figure(figures)
        if history:
            self.draw(history)

    def draw(self, history: Sequence[Iterated]) -> None:
        """Draw the history."""
        self._plot.options.update(_progress(history))


def _figure(name: str) -> ui.label:
    with ui.element("dt"):
        ui.label(name)
        if name in _COLOURS:
            ui.element("span").classes("swatch").style(f"color: {_COLOURS[name]}")
    with ui.element("dd"):
        return ui.label("–").mark(name)


def _attribute(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', "'").replace("\n", " ")


def _progress(history: Sequence[Iterated]) -> dict[str, Any]:
    """Return the small plot: infeasibility on a scale of tens, objective on its own."""
    history = history[:: -max(-(-len(history) // _MOST_POINTS), 1)][::-1]  # the last one is in it
    series = (
        ("infeasibility", [max(p.violation, _LEAST) for p in history], 0),
        ("objective", [p.cost for p in history], 1),
    )
    axis = {"axisTick": {"show": False}, "axisLabel": _label, "axisLine": {"show": False}}
    ends = {"min": "dataMin", "max": "dataMax"}
    return {
        "animation": False,
        "grid": {"left": 44, "right": 44, "top": 8, "bottom": 18},
        "xAxis": axis
        | ends
        | {"type": "value", "splitLine": {"show": False}}
        | {"axisLabel": _label | {"showMaxLabel": False}},
        "yAxis": [
            axis
            | {
                "type": "log",
                "splitNumber": 3,
                "splitLine": {"lineStyle": {"color": "var(--grid)"}},
                "axisLabel": _label | {":formatter": "value => value.toExponential(0)"},
            },
            axis
            | {
                "type": "value",
                "scale": True,
                "splitNumber": 2,
                "splitLine": {"show": False},
                "axisLabel": _label | {":formatter": "value => quito.number(value)"},
            },
        ],
        "series": [
            {
                "type": "line",
                "name": name,
                "color": _COLOURS[name],
                "yAxisIndex": side,
                "symbol": "none",
                "silent": True,
                "lineStyle": {"width": 1.6, "color": _COLOURS[name]},
                "data": tuple(
                    (p.count, value if math.isfinite(value) else None)
                    for p, value in zip(history, values, strict=True)
                ),
            }
            for name, values, side in series
        ],
    }


_label = {"color": "var(--muted)", "fontSize": 10, "hideOverlap": True}
