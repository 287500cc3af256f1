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
from quito_cli.gui.answer import RESULT, Answer
from quito_cli.gui.job import Failed, Finished, Request, Running
from quito_cli.gui.page_choose import Choose
from quito_cli.gui.page_compare import Compare
from quito_cli.gui.page_edit import Edit
from quito_cli.gui.page_run import RunBar
from quito_cli.gui.page_runs import RunsTable
from quito_cli.gui.page_see import Plots, Verdict, certificate, summary
from quito_cli.gui.page_set import Form
from quito_cli.gui.page_state import Draft, Services, Tab, draft_of
from quito_cli.gui.runs import MOST_RUNS, Run
from quito_cli.gui.work import Iterated

FIRST = "alychan"
"""What a tab begins with."""
_HERE = Path(__file__).parent
_DEBOUNCE = 0.35
"""Seconds without typing after which a text is looked at."""
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
    await client.connected(timeout=30.0)
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
                with ui.element("section").classes("panel see").props('aria-label="Results"'):
                    self._verdict = Verdict(services.exporter, self._say, self._taken)
                    self._tabs()

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

    def _tabs(self) -> None:
        names = ("Plots", "Summary", "Certificate", "Compare", "Runs")
        with ui.tabs().props("dense no-caps align=left inline-label") as tabs:
            for name in names:
                ui.tab(name).mark(f"tab-{name.lower()}")
        with (
            ui.element("div").classes("scroll"),
            ui.tab_panels(tabs, value=names[0], animated=False, keep_alive=True),
        ):
            with ui.tab_panel("Plots"):
                self._plots = Plots()
            with ui.tab_panel("Summary"):
                self._summary = ui.html(summary(None)).mark("summary")
            with ui.tab_panel("Certificate"):
                self._certificate = ui.html(certificate(None)).mark("certificate")
            with ui.tab_panel("Compare"):
                self._compare = Compare(self._hold_against)
            with ui.tab_panel("Runs"):
                self._runs = RunsTable(self._show, self._lay, self._remove)

    # Coming back, and what is being worked on.

    async def begin(self, tab: Tab) -> None:
        """Bring back what the tab works on."""
        self._tab = tab
        try:
            known = dict(await self._client.run_javascript(_WHERE, timeout=10.0) or {})
        except TimeoutError:  # what the server has will do
            known = {}
        self._edit.darken(bool(known.get("dark")))
        if known.get("colours") in _COLOURS:
            self._colours.set_value(known["colours"])
        draft = draft_of(known.get("draft"), self._services.most_characters) or tab.draft
        if draft is None:
            text = self._services.shelf.read("library", FIRST)
            draft = Draft(FIRST, "library", text, {})
        await self._take_up(draft)
        self._client.run_javascript("quito.restored()")
        self._bar.rest()
        self._runs.fill(tab)
        if tab.shown is not None:
            await self._show(tab.shown)
        if tab.compared is not None:
            await self._show_comparison(tab.compared)
        if tab.asked is not None:
            self._follow()
        self._form.know(await self._services.checker.solvers())

    def _draft(self) -> Draft:
        return self._tab.draft or _BLANK

    async def _open(self, draft: Draft) -> None:
        """Open another problem; an edited text that is not saved can be brought back."""
        before = self._draft()
        if before.place == "own" or before.text != self._saved(before):
            self._tab.put_aside(before)
        self._tab.aside.pop(draft.name, None)
        await self._take_up(draft)

    def _saved(self, draft: Draft) -> str:
        """Return the text of a draft as it stands on the shelf; nothing where it does not."""
        if draft.place == "own":
            return ""
        try:
            return _lines(self._services.shelf.read(draft.place, draft.name))
        except QuitoError:
            return ""

    async def _take_up(self, draft: Draft) -> None:
        draft = replace(draft, text=_lines(draft.text))
        self._tab.draft = draft
        self._choose.show(draft, self._tab.aside)
        self._edit.show(draft.name, draft.text)
        self._form.begin(draft.name, draft.chosen)
        self._keep()
        await self._check(draft.text)

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
        if self._checking is not None:
            self._checking.cancel()
        self._checking = background_tasks.create(self._check_soon(text), name="look at the text")

    async def _check_soon(self, text: str) -> None:
        await asyncio.sleep(_DEBOUNCE)
        with self._client:
            await self._check(text)

    async def _check(self, text: str) -> None:
        """Look at the text, and show what is found unless it is not the text any more."""
        checked = await self._services.checker.check(text, self._draft().stem)
        if text != self._draft().text or self._client.is_deleted:
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
        self._submit(Request(text=draft.text, name=draft.stem, options=given), "Running")

    async def _hold_against(self, against: tuple[str, ...]) -> None:
        seen = self._tab.run(self._tab.shown)
        if seen is None:
            return
        solved, result = self._tab.requests[seen.job], seen.folder / RESULT
        self._submit(replace(solved, against=against, result=result), "Comparing")

    def _submit(self, request: Request, said: str) -> None:
        try:
            job = self._services.desk.submit(self._tab.session, request)
        except QuitoError as error:
            self._say(str(error), "bad")
            return
        self._tab.asked = job
        self._tab.requests[job] = request
        self._bar.begin(said)
        self._follow()

    def _follow(self) -> None:
        background_tasks.create(self._followed(), name="follow a solve")

    async def _followed(self) -> None:
        """Show how the job is, until it ends or the page does."""
        job = self._tab.asked
        if job is None:
            return
        with self._client:
            self._bar.begin("Running")
            self._compare.allow(False)
            try:
                async for state in self._services.desk.follow(job):
                    if self._client.is_deleted:
                        return
                    if isinstance(state, Running):
                        self._history = state.history
                    self._bar.show(state)
                    if isinstance(state, Finished):
                        await self._finished(job, state)
                    elif isinstance(state, Failed):
                        self._failed(job, state)
            except QuitoError as error:  # it was dropped
                self._tab.asked = None
                self._bar.rest()
                self._say(str(error), "bad")
            self._compare.allow(self._tab.shown is not None)

    def _failed(self, job: str, state: Failed) -> None:
        self._tab.asked = None
        self._forget(job)
        self._say(state.message, "bad")

    async def _finished(self, job: str, state: Finished) -> None:
        """Show the answer; a run is kept, of comparisons the last."""
        tab, request = self._tab, self._tab.requests[job]
        tab.asked = None
        answer = await asyncio.to_thread(Answer.load, state.folder)
        if answer.kind == "compare":
            before, tab.compared = tab.compared, job
            if before is not None:
                self._forget(before)
            self._compare.show(answer)
            self._say("Compared.", "good" if answer.success else "bad")
            return
        tab.count += 1
        made = Run(job, tab.count, request.name, request.options, state.folder, answer.figures)
        for old in tab.runs.add(made):
            self._forget(old)
        await self._show(job, answer)
        self._bar.end(_last(answer, state.seconds), self._history)
        said = f"{answer.said} {state.note}".strip()
        self._say(said, "good" if answer.success else "bad")

    def _cancel(self) -> None:
        if self._tab.asked is not None:
            self._services.desk.cancel(self._tab.asked)
            self._say("Stopping: the iterate so far is kept.", "")

    # Seeing.

    async def _show(self, job: str, answer: Answer | None = None) -> None:
        """Show a run with those that are laid over it."""
        tab = self._tab
        chosen = tab.run(job)
        if chosen is None:
            return
        tab.shown = job
        tab.overlaid = [other for other in tab.overlaid if other != job and tab.run(other)]
        seen = answer or await asyncio.to_thread(Answer.load, chosen.folder)
        self._verdict.show(chosen, seen)
        self._summary.set_content(summary(seen))
        self._certificate.set_content(certificate(seen))
        self._compare.allow(tab.asked is None)
        self._runs.fill(tab)
        self._plots.show(seen, await self._overlays())

    async def _overlays(self) -> list[tuple[str, Answer]]:
        runs = [one for job in self._tab.overlaid if (one := self._tab.run(job))]
        return [(one.label, await asyncio.to_thread(Answer.load, one.folder)) for one in runs]

    async def _lay(self, job: str, over: bool) -> None:
        others = [other for other in self._tab.overlaid if other != job]
        self._tab.overlaid = [*others, job][-MOST_RUNS:] if over else others
        if self._tab.shown is not None:
            await self._show(self._tab.shown)

    async def _remove(self, job: str) -> None:
        self._tab.runs.remove(job)
        self._forget(job)
        others = self._tab.runs.kept()
        if others:
            await self._show(self._tab.shown or others[-1].job)
            return
        self._verdict.show(None, None)
        self._plots.show(None, ())
        self._summary.set_content(summary(None))
        self._certificate.set_content(certificate(None))
        self._compare.allow(False)
        self._runs.fill(self._tab)

    def _forget(self, job: str) -> None:
        """Drop a job with its files."""
        self._tab.requests.pop(job, None)
        self._tab.overlaid = [other for other in self._tab.overlaid if other != job]
        if self._tab.shown == job:
            self._tab.shown = None
        self._services.desk.drop(job)

    def _taken(self, job: str) -> None:
        self._tab.runs.taken(job)

    async def _show_comparison(self, job: str) -> None:
        state = self._services.desk.state(job)
        if isinstance(state, Finished):
            self._compare.show(await asyncio.to_thread(Answer.load, state.folder))


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
