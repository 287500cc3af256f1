"""What is seen of an answer: plots, summary, certificate; and what can be taken away of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from html import escape

from nicegui import ui

from quito_cli.gui.answer import Answer, Condition
from quito_cli.gui.page_chart import Picture, picture
from quito_cli.gui.page_html import notes, table
from quito_cli.gui.page_take import Take
from quito_cli.gui.runs import Run

_TAKEN = (
    ("h5", "HDF5", "The result file"),
    ("csv", "CSV", "The trajectory as a table"),
    ("png", "PNG", "The picture"),
    ("pdf", "PDF", "The picture, for papers"),
    ("svg", "SVG", "The picture, to edit"),
    ("yaml", "YAML", "The problem as it was solved"),
    ("html", "Report", "A page with all of it"),
)
_KINDS = (
    ("controls", "Controls", True),
    ("states", "States", True),
    ("costates", "Costates", False),
    ("switching", "Switching functions", False),
)
_PLAN = "plan"
_PLOT = "plot"
"""Name of the place of the plots."""
_ZOOMS = (("+", 0.5, "Zoom in"), ("−", 2.0, "Zoom out"), ("Whole", 0.0, "See the whole horizon"))
_EMPTY = (
    "<p>Nothing solved yet.</p><p>Choose a problem and press <b>Run</b>, or <kbd>Ctrl</kbd> "
    "<kbd>Enter</kbd>.</p>"
)


class Verdict:
    """The line above the tabs: how it ended, and the downloads."""

    def __init__(self, take: Take, taken: Callable[[str], None]) -> None:
        self._take, self._taken = take, taken
        self._run: Run | None = None
        with ui.element("div").classes("verdict"):
            self._said = ui.html("<b>No result yet</b>").classes("said").mark("verdict")
            self._buttons = take.buttons(_TAKEN, "Take away", "take")
        for form, button in self._buttons.items():
            button.on_click(lambda form=form: self._asked(form))
        self.show(None, None)

    def show(self, chosen: Run | None, answer: Answer | None) -> None:
        """Show the verdict on an answer."""
        self._run = chosen
        for button in self._buttons.values():
            button.set_enabled(chosen is not None)
        if chosen is None or answer is None:
            self._said.set_content("<b>No result yet</b>")
            return
        word = "Solved" if answer.success else "Not solved"
        kind = "good" if answer.success else "bad"
        figures = answer.figures
        cost = figures.get("cost")
        said = f" · cost {cost:.10g}" if isinstance(cost, int | float) else ""
        self._said.set_content(
            f"<b class='{kind}'>{word}</b>{escape(said)} · {escape(chosen.label)}"
        )

    async def _asked(self, form: str) -> None:
        run = self._run
        if run is not None and await self._take.take(run.folder, form):
            self._taken(run.job)


class Plots:
    """The tab of plots, with what is drawn in them."""

    def __init__(self) -> None:
        self._answer: Answer | None = None
        self._overlays: Sequence[tuple[str, Answer]] = ()
        with ui.element("div").classes("tools").props('role=group aria-label="What is drawn"'):
            self._kinds = {
                kind: ui.checkbox(word, value=shown, on_change=self.draw).mark(f"draw-{kind}")
                for kind, word, shown in _KINDS
            }
            self._known = ui.checkbox("Reference", value=True, on_change=self.draw).mark("known")
            for box in (*self._kinds.values(), self._known):
                box.props("dense")
            ui.element("div").classes("space")
            zoom(_PLOT)
        self._legend = ui.html("").classes("legend").mark("legend")
        self._place = ui.element("div").style("min-height: 360px").mark("plots")
        self.draw()

    def show(self, answer: Answer | None, overlays: Sequence[tuple[str, Answer]]) -> None:
        """Show an answer with others laid over it."""
        self._answer, self._overlays = answer, overlays
        self.draw()

    def draw(self) -> None:
        """Draw what is asked for."""
        self._place.clear()
        drawn = plan = None
        if self._answer is not None:
            there = {chart.kind for chart in self._answer.charts}
            for kind, box in self._kinds.items():
                box.set_enabled(kind in there)
            kinds = [kind for kind, box in self._kinds.items() if box.value]
            known = bool(self._known.value)
            drawn = picture(self._answer, kinds, self._overlays, known)
            plan = picture(self._answer, [_PLAN], self._overlays, known)
        with self._place:
            if drawn is None:
                words = _EMPTY if self._answer is None else "<p>Choose above what to draw.</p>"
                ui.html(words).classes("empty")
        self._legend.set_content("" if drawn is None else legend(drawn))
        if drawn is not None:
            with self._place:
                zoomed(drawn, _PLOT).mark("chart")
        if plan is not None:
            with self._place:
                chart(plan).mark("plan")


def zoom(place: str) -> None:
    """Put buttons on the page that zoom in the picture at that place."""
    with ui.element("div").classes("zoom").props('role=group aria-label="Zoom in time"'):
        for sign, factor, what in _ZOOMS:
            button = ui.button(sign).props(f'flat aria-label="{what}" title="{what}"')
            handler = f"() => quito.zoom('{place}', {factor})"
            button.classes("quiet").on("click", js_handler=handler)


def zoomed(drawn: Picture, place: str) -> ui.echart:
    """Put a picture on the page in which a band can be drawn to zoom, at a place of that name."""
    with ui.element("div").props(f"id={place}") as around:
        drawing = chart(drawn)
    around.props(f"data-chart={drawing.id}")
    return drawing


def chart(drawn: Picture) -> ui.echart:
    """Put a picture on the page."""
    element = ui.echart(drawn.options, renderer="svg").style(f"height: {drawn.height}px")
    return element.props(f'role=img aria-label="{_attribute(drawn.said)}"')


def legend(drawn: Picture) -> str:
    """Return the legend of a picture."""
    found = []
    for entry in drawn.legend:
        look = f"border-top: 2px {entry.style} {entry.colour}"
        if entry.style == "shade":
            look = f"background: {entry.colour}"
        found.append(
            f"<span><i class='{entry.style}' style='{look}'></i>{escape(entry.name)}</span>"
        )
    return "".join(found) + "".join(f"<span>{escape(note)}</span>" for note in drawn.notes)


def _attribute(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', "'").replace("\n", " ")


def summary(answer: Answer | None) -> str:
    """Return the summary with its evidence."""
    if answer is None:
        return f"<div class='empty'>{_EMPTY}</div>"
    said = notes([answer.said], "plain" if answer.success else "bad")
    said += notes(answer.diagnosis, "bad") + notes(answer.warnings, "warn")
    return said + table("", (), answer.rows)


_CLASSES = {"holds": "holds", "fails": "fails", "not applicable": "idle"}


def certificate(answer: Answer | None) -> str:
    """Return the certificate of Pontryagin's conditions, where there is one."""
    if answer is None or not answer.certificate:
        return "<div class='empty'><p>No certificate: there is no answer to be judged.</p></div>"
    heads = ("condition", "verdict", "residual", "scale", "worst at")
    rows = [
        (
            row.condition,
            f"{row.verdict}: {row.reason}" if row.reason else row.verdict,
            _figure(row.residual, ".1e"),
            _figure(row.scale, ".2g"),
            _figure(row.time, ".4g"),
        )
        for row in answer.certificate
    ]
    verdict = notes([answer.verdict], "plain") if answer.verdict else ""
    colours = [_class(row) for row in answer.certificate]
    return verdict + table("", heads, rows, classes=colours) + notes([answer.caveat], "plain")


def _class(row: Condition) -> str:
    return next((name for word, name in _CLASSES.items() if row.verdict.startswith(word)), "")


def _figure(value: float | None, form: str) -> str:
    return "–" if value is None else format(value, form)
