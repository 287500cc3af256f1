"""The tab of comparisons: an answer held against the reference, and against LGR, by a click."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from pathlib import Path

from nicegui import ui

from quito_cli.gui.answer import Answer
from quito_cli.gui.page_chart import Picture, picture
from quito_cli.gui.page_html import notes, table
from quito_cli.gui.page_see import chart, legend, zoom, zoomed
from quito_cli.gui.page_take import Take

METHODS: tuple[tuple[str, str, tuple[str, ...]], ...] = (
    ("known", "With the reference", ()),
    ("lgr", "With LGR collocation", ("lgr",)),
)
"""Mark, word, and methods of a click."""
_TAKEN = (
    ("csv", "CSV", "The figures as a table, in full precision"),
    ("png", "PNG", "The picture"),
    ("pdf", "PDF", "The picture, for papers"),
    ("svg", "SVG", "The picture, to edit"),
    ("html", "Report", "A page with the tables"),
)
_OVER_TIME = ("controls", "error", "magnified", "logarithmic", "states")
_OVER_FREQUENCY = ("spectrum",)
_PLOT = "compared-plot"
"""Name of the place of the plots over time."""
_EMPTY = (
    "<p>Holds the answer that is seen against what its file knows of the truth, and against "
    "what Legendre-Gauss-Radau collocation of as many points finds: errors, spectra, ringing.</p>"
)


class Compare:
    """Buttons, and what the last of them led to."""

    def __init__(self, compare: Callable[[tuple[str, ...]], Awaitable[None]], take: Take) -> None:
        self._take = take
        with ui.element("div").classes("tools").props('role=group aria-label="Compare"'):
            ui.label("Compare").classes("quietly")
            self._buttons = [
                ui.button(word, on_click=lambda against=against: compare(against))
                .props("flat")
                .classes("plain")
                .mark(f"compare-{mark}")
                for mark, word, against in METHODS
            ]
        self._place = ui.element("div").mark("compared")
        self.show(None, None)

    def allow(self, there: bool) -> None:
        """Whether there is an answer to compare, and nothing runs."""
        for button in self._buttons:
            button.set_enabled(there)

    def show(self, answer: Answer | None, folder: Path | None) -> None:
        """Show a comparison, which is in that folder: plots, and below them the tables."""
        self._place.clear()
        with self._place:
            if answer is None or folder is None:
                ui.html(_EMPTY).classes("empty")
                return
            with ui.element("div").classes("tools"):
                buttons = self._take.buttons(_TAKEN, "Take away the comparison", "compared")
                for form, button in buttons.items():
                    button.on_click(lambda form=form: self._take.take(folder, form))
                ui.element("div").classes("space")
                zoom(_PLOT)
            said = notes(answer.diagnosis, "bad") + notes(answer.warnings, "warn")
            ui.html(said + notes(answer.notes[:1], "plain"))
            over_time = picture(answer, _OVER_TIME, (), True)
            if over_time is not None:
                _explained(over_time)
                zoomed(over_time, _PLOT).mark("compared-chart")
            spectra = picture(answer, _OVER_FREQUENCY, (), True)
            if spectra is not None:
                _explained(spectra)
                chart(spectra)
            tables = [table(one.title, one.heads, one.rows, one.helps) for one in answer.tables]
            ui.html("".join(tables) + notes(answer.notes[1:], "plain"))


def _explained(drawn: Picture) -> None:
    ui.html(legend(drawn)).classes("legend")
