"""The page itself: its parts side by side, and what passes between them.

Everything stands there before the browser is heard of, so that it is seen at once; then the tab is
known, its draft and its results come back, and a solve that is under way is followed again.
"""

from __future__ import annotations

import asyncio
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

from nicegui import Client, background_tasks, ui

from quito_cli.errors import QuitoError
from quito_cli.gui.answer import Answer
from quito_cli.gui.job import Failed, Finished, Request, Running
from quito_cli.gui.page_choose import Choose
from quito_cli.gui.page_edit import Edit
from quito_cli.gui.page_results import Results
from quito_cli.gui.page_run import RunBar
from quito_cli.gui.page_set import Form
from quito_cli.gui.page_state import Draft, Services, Tab, draft_of
from quito_cli.gui.work import Iterated

FIRST = "alychan"
"""What a tab begins with."""
_HERE = Path(__file__).parent
_DEBOUNCE = 0.35
"""Seconds without typing after which a text is looked at."""
_PATIENCE = 60.0
"""Seconds that a browser may take to answer, on a machine with much else to do."""
_WHERE = "(() => ({draft: quito.draft(), dark: Quasar.Dark.isActive, colours: quito.colours()}))()"
_BLANK = Draft("problem.yaml", "own", "", {})
_COLOURS: dict[str, bool | None] = {"Auto": None, "Light": False, "Dark": True}


async def page(services: Services) -> None:
    """Make the page for a client, and bring back what its tab works on."""
    client = ui.context.client
    ui.add_head_html(f"<style>{(_HERE / 'page.css').read_text('utf-8')}</style>")
    ui.add_head_html(f"<script>{(_HERE / 'page.js').read_text('utf-8')}</script>")
    ui.colors(primary="var(--accent)")
    view = View(services, client)
    await client.connected(timeout=_PATIENCE)
    if client.tab_id is None:
        return
    tab = services.tabs.come(client.tab_id, client.id)
    client.on_delete(lambda: services.tabs.go(tab.session, client.id))
    await view.begin(tab)


class View:
    """The page of one client."""

    def __init__(self, services: Services, client: Client) -> None:
        self._services, self._client = services, client
        self._tab = Tab("")
        self._checking: asyncio.Task[None] | None = None
        self._history: tuple[Iterated, ...] = ()
        ui.html("Skip to the editor", tag="a").classes("skip").props('href="#edit"')
        self._top()
        with ui.element("div").classes("desk"):
            with ui.element("div").classes("left"):
                shelf, most = services.shelf, services.most_characters
                self._choose = Choose(shelf, most, self._open, self._draft, self._say)
                self._edit = Edit(self._typed)
                self._form = Form(self._set)
            with ui.element("div").classes("right"):
                self._bar = RunBar(self._solve, self._cancel)
                self._results = Results(services, self._tab, self._compare, self._say)

    def _top(self) -> None:
        with ui.element("header").classes("top"):
            ui.html("quito", tag="h1")
            ui.label("constrained optimal control, solved by clicking").classes("what")
            ui.html("<kbd>Ctrl</kbd> <kbd>Enter</kbd> runs, <kbd>Esc</kbd> cancels").classes("keys")
            self._mode = ui.dark_mode(None)
            self._colours = ui.select(list(_COLOURS), value="Auto", label="Colours").mark("colours")
            self._colours.props("outlined dense options-dense").style("width: 104px")
            self._colours.on_value_change(lambda event: self._colour(str(event.value)))
            ui.on("quito-dark", lambda event: self._edit.darken(bool(event.args)))

    def _colour(self, word: str) -> None:
        self._mode.set_value(_COLOURS[word])
        self._client.run_javascript(f"quito.colour({json.dumps(word)})")

    # Coming back, and what is being worked on.

    async def begin(self, tab: Tab) -> None:
        """Bring back what the tab works on."""
        self._tab = tab
        try:
            known = dict(await self._client.run_javascript(_WHERE, timeout=_PATIENCE) or {})
        except TimeoutError:  # what the server has will do
            known = {}
        self._edit.darken(bool(known.get("dark")))
        if known.get("colours") in _COLOURS:
            self._colours.set_value(known["colours"])
        draft = draft_of(known.get("draft"), self._services.most_characters) or tab.draft
        if draft is None:
            text = self._services.shelf.read("library", FIRST)
            draft = Draft(FIRST, "library", text, {})
        self._take_up(draft)
        self._client.run_javascript("quito.restored()")
        if tab.asked is not None:
            self._bar.begin("Running")
        else:
            self._bar.rest()
        await self._results.begin(tab)
        if tab.asked is not None:
            self._follow(tab.asked)
        self._form.know(await self._services.checker.solvers())

    def _draft(self) -> Draft:
        return self._tab.draft or _BLANK

    async def _open(self, draft: Draft) -> None:
        """Open another problem; an edited text that is not saved can be brought back."""
        before = self._draft()
        if before.place == "own" or before.text != self._saved(before):
            self._tab.put_aside(before)
        self._tab.aside.pop(draft.name, None)
        self._take_up(draft)

    def _saved(self, draft: Draft) -> str:
        """Return the text of a draft as it stands on the shelf; nothing where it does not."""
        if draft.place == "own":
            return ""
        try:
            return _lines(self._services.shelf.read(draft.place, draft.name))
        except QuitoError:
            return ""

    def _take_up(self, draft: Draft) -> None:
        draft = replace(draft, text=_lines(draft.text))
        self._tab.draft = draft
        self._choose.show(draft, self._tab.aside)
        self._edit.show(draft.name, draft.text)
        self._form.begin(draft.name, draft.chosen)
        self._keep()
        self._look(draft.text, 0.0)

    def _keep(self) -> None:
        """Tell the browser what stands beside the text, for the draft it keeps."""
        self._client.run_javascript(f"quito.keep({json.dumps(self._draft().about)})")

    def _typed(self, text: str) -> None:
        if self._tab.draft is None or text == self._tab.draft.text:
            return
        draft = replace(self._tab.draft, text=text)
        if draft.place == "library":  # it is that of the library no more
            draft = replace(draft, place="own", name=f"{draft.stem}.yaml")
            self._tab.draft = draft
            self._choose.show(draft, self._tab.aside)
            self._edit.rename(draft.name)
            self._form.rename(draft.name)
            self._keep()
        self._tab.draft = draft
        self._look(text, _DEBOUNCE)

    def _look(self, text: str, seconds: float) -> None:
        """Look at a text after some seconds, unless there is another one by then."""
        if self._checking is not None:
            self._checking.cancel()
        soon = self._check_soon(text, seconds)
        self._checking = background_tasks.create(soon, name="look at the text")

    async def _check_soon(self, text: str, seconds: float) -> None:
        await asyncio.sleep(seconds)
        with self._client:
            await self._check(text)

    async def _check(self, text: str) -> None:
        """Look at the text, and show what is found unless it is not the text any more."""
        checked = await self._services.checker.check(text, self._draft().stem)
        if text != self._draft().text or self._left:
            return
        self._edit.say(checked, text)
        if checked.ok:
            self._form.follow(checked.options)

    def _set(self) -> None:
        self._tab.draft = replace(self._draft(), chosen=self._form.chosen)
        self._keep()

    def _say(self, text: str, kind: str) -> None:
        self._bar.say(text, kind)

    # Running.

    async def _solve(self) -> None:
        try:
            given = self._form.given()
        except QuitoError as error:
            self._say(str(error), "bad")
            return
        draft = self._draft()
        self._submit(Request(text=draft.text, name=draft.stem, options=given))

    async def _compare(self, against: tuple[str, ...]) -> None:
        request = self._results.comparison(against)
        if request is not None:
            self._submit(request)

    def _submit(self, request: Request) -> None:
        try:
            job = self._services.desk.submit(self._tab.session, request)
        except QuitoError as error:
            self._say(str(error), "bad")
            return
        self._history = ()
        self._tab.asked = job
        self._tab.requests[job] = request
        self._bar.begin("Starting")
        self._follow(job)

    def _follow(self, job: str) -> None:
        background_tasks.create(self._followed(job), name="follow a solve")

    async def _followed(self, job: str) -> None:
        """Show how the job is until it ends or the page does; nothing new is asked for before."""
        with self._client:
            self._results.busy(True)
            try:
                async for state in self._services.desk.follow(job):
                    if self._left:
                        return
                    if isinstance(state, Running):
                        self._history = state.history
                    self._bar.show(state)
                    if isinstance(state, Finished):
                        await self._finished(job, state)
                    elif isinstance(state, Failed):
                        self._results.forget(job)
                        self._say(state.message, "bad")
            except QuitoError as error:  # it was dropped
                self._say(str(error), "bad")
            finally:
                if not self._left:  # else the page that is there now does it
                    self._tab.asked = None
                    self._bar.rest()
                    self._results.busy(False)

    @property
    def _left(self) -> bool:
        """Whether this page is there no more, or another one has taken its place in the tab."""
        return self._client.is_deleted or self._tab.client != self._client.id

    async def _finished(self, job: str, state: Finished) -> None:
        answer = await self._results.add(job, state.folder)
        kind = "good" if answer.success else "bad"
        if answer.kind == "compare":
            self._bar.draw(self._history)
            self._say("Compared.", kind)
            return
        self._bar.end(_last(answer, state.seconds), self._history)
        self._say(state.note or answer.said, kind)

    def _cancel(self) -> None:
        if self._tab.asked is not None:
            self._services.desk.cancel(self._tab.asked)
            self._say("Stopping: the iterate so far is kept.", "")


def _last(answer: Answer, seconds: float) -> dict[str, str]:
    """Return the figures of a solve that is over."""
    figures: dict[str, Any] = dict(answer.figures)
    said = {"time": f"{seconds:.1f} s"}
    if isinstance(figures.get("iterations"), int):
        said["iteration"] = str(figures["iterations"])
    if isinstance(figures.get("cost"), float):
        said["objective"] = f"{figures['cost']:.8g}"
    if isinstance(figures.get("feasibility"), float):
        said["infeasibility"] = f"{figures['feasibility']:.1e}"
    return said


def _lines(text: str) -> str:
    """Return a text with the breaks of lines that an editor has."""
    return text.replace("\r\n", "\n").replace("\r", "\n")
