"""The tab of runs: settings and figures, which of them is seen, and which are laid over it."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from functools import partial

from nicegui import ui

from quito_cli.gui.page_panel import COLOURS
from quito_cli.gui.page_state import Tab

_HEADS = ("show", "overlay", "remove")
Show = Callable[[str], Awaitable[None]]
Lay = Callable[[str, bool], Awaitable[None]]


class RunsTable:
    """A row a run."""

    def __init__(self, show: Show, lay: Lay, remove: Show) -> None:
        self._show, self._lay, self._remove = show, lay, remove
        self._place = ui.element("div").classes("scrolled").mark("runs")

    def fill(self, tab: Tab) -> None:
        """Write the table anew."""
        heads, rows = tab.runs.table()
        jobs = [run.job for run in tab.runs.kept()]
        self._place.clear()
        with self._place:
            if not jobs:
                ui.html("<p>Runs of this session stand here.</p>").classes("empty")
                return
            with ui.element("table").classes("data runs"):
                with ui.element("thead"), ui.element("tr"):
                    for head in (*_HEADS, *heads):
                        with ui.element("th").props("scope=col"):
                            ui.label(head)
                with ui.element("tbody"):
                    for job, row in zip(jobs, rows, strict=True):
                        self._row(tab, job, row)

    def _row(self, tab: Tab, job: str, row: tuple[str, ...]) -> None:
        shown = job == tab.shown
        with ui.element("tr"):
            with ui.element("td"):
                button = ui.button("Shown" if shown else "Show", on_click=partial(self._show, job))
                button.props("flat").classes("quiet").set_enabled(not shown)
                button.props(f'aria-label="Show run {row[0]}"')
            with ui.element("td"):
                box = ui.checkbox(value=job in tab.overlaid).props("dense")
                box.props(f'aria-label="Lay run {row[0]} over it"').set_enabled(not shown)
                box.on_value_change(lambda event: self._lay(job, bool(event.value)))
                box.mark(f"overlay-{row[0]}")
                if job in tab.overlaid:
                    colour = COLOURS[(tab.overlaid.index(job) + 1) % len(COLOURS)]
                    ui.element("span").classes("swatch").style(f"color: {colour}")
            with ui.element("td"):
                gone = ui.button("×", on_click=partial(self._remove, job)).mark(f"remove-{row[0]}")
                gone.props(f'flat aria-label="Remove run {row[0]}" title="Remove"').classes("quiet")
            for text in row:
                with ui.element("td"):
                    ui.label(text)
