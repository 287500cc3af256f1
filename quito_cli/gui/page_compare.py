"""The tab of comparisons: an answer held against the reference, and against LGR, by a click."""

from __future__ import annotations

from collections.abc import Awaitable, Callable

from nicegui import ui

from quito_cli.gui.answer import Answer
from quito_cli.gui.page_chart import picture
from quito_cli.gui.page_html import notes, table
from quito_cli.gui.page_see import chart, legend

METHODS: tuple[tuple[str, str, tuple[str, ...]], ...] = (
    ("known", "With the reference", ()),
    ("lgr", "With LGR collocation", ("lgr",)),
)
"""Mark, word, and methods of a click."""
_EMPTY = (
    "<p>Holds the answer that is seen against what its file knows of the truth, and against "
    "what Legendre-Gauss-Radau collocation of as many points finds: errors, spectra, ringing.</p>"
)


class Compare:
    """Buttons, and what the last of them led to."""

    def __init__(self, compare: Callable[[tuple[str, ...]], Awaitable[None]]) -> None:
        with ui.element("div").classes("tools").props('role=group aria-label="Compare"'):
            ui.label("Compare").style("color: var(--muted)")
            self._buttons = [
                ui.button(word, on_click=lambda against=against: compare(against))
                .props("flat")
                .classes("plain")
                .mark(f"compare-{mark}")
                for mark, word, against in METHODS
            ]
        self._place = ui.element("div").mark("compared")
        self.show(None)

    def allow(self, there: bool) -> None:
        """Whether there is an answer to compare, and nothing runs."""
        for button in self._buttons:
            button.set_enabled(there)

    def show(self, answer: Answer | None) -> None:
        """Show a comparison."""
        self._place.clear()
        with self._place:
            if answer is None:
                ui.html(_EMPTY).classes("empty")
                return
            said = notes(answer.diagnosis, "bad") + notes(answer.warnings, "warn")
            for each in answer.tables:
                said += table(each.title, each.heads, each.rows, each.helps)
            ui.html(said + notes(answer.notes, "plain"))
            kinds = dict.fromkeys(drawn.kind for drawn in answer.charts)
            for kind in kinds:
                drawn = picture(answer, [kind], (), True)
                if drawn is not None:
                    ui.html(legend(drawn)).classes("legend")
                    chart(drawn)
