"""The results of a tab: what is seen of them, what is laid over it, and what is dropped."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from nicegui import ui

from quito_cli.errors import QuitoError
from quito_cli.gui.answer import RESULT, Answer
from quito_cli.gui.job import Finished, Request
from quito_cli.gui.page_compare import Compare
from quito_cli.gui.page_runs import RunsTable
from quito_cli.gui.page_see import Plots, Verdict, certificate, summary
from quito_cli.gui.page_state import Services, Tab
from quito_cli.gui.page_take import Take
from quito_cli.gui.runs import MOST_RUNS, Run

_TABS = ("Plots", "Summary", "Certificate", "Compare", "Runs")


class Results:
    """The panel of results."""

    def __init__(
        self,
        services: Services,
        tab: Tab,
        compare: Callable[[tuple[str, ...]], Awaitable[None]],
        say: Callable[[str, str], None],
    ) -> None:
        self._services, self._tab = services, tab
        with ui.element("section").classes("panel see").props('aria-label="Results"'):
            take = Take(services.exporter, say)
            self._verdict = Verdict(take, self._taken)
            with ui.tabs().props("dense no-caps align=left inline-label") as tabs:
                for name in _TABS:
                    ui.tab(name).mark(f"tab-{name.lower()}")
            with (
                ui.element("div").classes("scroll"),
                ui.tab_panels(tabs, value=_TABS[0], animated=False, keep_alive=True),
            ):
                with ui.tab_panel("Plots"):
                    self._plots = Plots()
                with ui.tab_panel("Summary"):
                    self._summary = ui.html(summary(None)).mark("summary")
                with ui.tab_panel("Certificate"):
                    self._certificate = ui.html(certificate(None)).mark("certificate")
                with ui.tab_panel("Compare"):
                    self._compare = Compare(compare, take)
                with ui.tab_panel("Runs"):
                    self._runs = RunsTable(self.show, self._lay, self._remove)

    async def begin(self, tab: Tab) -> None:
        """Bring back what the tab has found; what is not kept any more is not missed."""
        self._tab = tab
        self._runs.fill(tab)
        with suppress(QuitoError):
            if tab.shown is not None:
                await self.show(tab.shown)
        with suppress(QuitoError):
            if tab.compared is not None:
                state = self._services.desk.state(tab.compared)
                if isinstance(state, Finished):
                    self._compare.show(await _answer(state.folder), state.folder)

    def comparison(self, against: tuple[str, ...]) -> Request | None:
        """Return what is to be asked for to compare the answer that is seen; None without one."""
        seen = self._tab.run(self._tab.shown)
        if seen is None:
            return None
        solved, result = self._tab.requests[seen.job], seen.folder / RESULT
        return replace(solved, against=against, result=result)

    def busy(self, running: bool) -> None:
        """Whether a comparison can be asked for."""
        self._compare.allow(not running and self._tab.shown is not None)

    async def add(self, job: str, folder: Path) -> Answer:
        """Keep the answer of a job, and show it; of comparisons the last is kept.

        Raises:
            ResultFileError: it is gone.
        """
        tab, answer = self._tab, await _answer(folder)
        if answer.kind == "compare":
            before, tab.compared = tab.compared, job
            if before is not None and before != job:
                self.forget(before)
            self._compare.show(answer, folder)
            return answer
        if tab.run(job) is None:  # else the page was loaded anew just then
            tab.count += 1
            asked = tab.requests[job]
            made = Run(job, tab.count, asked.name, asked.options, folder, answer.figures)
            for old in tab.runs.add(made):
                self.forget(old)
        await self.show(job, answer)
        return answer

    async def show(self, job: str, answer: Answer | None = None) -> None:
        """Show a run with those that are laid over it.

        Raises:
            ResultFileError: it is gone.
        """
        tab = self._tab
        chosen = tab.run(job)
        if chosen is None:
            return
        tab.shown = job
        tab.overlaid = [other for other in tab.overlaid if other != job and tab.run(other)]
        seen = answer or await _answer(chosen.folder)
        self._verdict.show(chosen, seen)
        self._summary.set_content(summary(seen))
        self._certificate.set_content(certificate(seen))
        self._compare.allow(tab.asked is None)
        self._runs.fill(tab)
        self._plots.show(seen, await self._overlays())

    async def _overlays(self) -> list[tuple[str, Answer]]:
        runs = [one for job in self._tab.overlaid if (one := self._tab.run(job))]
        return [(one.label, await _answer(one.folder)) for one in runs]

    async def _lay(self, job: str, over: bool) -> None:
        others = [other for other in self._tab.overlaid if other != job]
        self._tab.overlaid = [*others, job][-MOST_RUNS:] if over else others
        if self._tab.shown is not None:
            await self.show(self._tab.shown)

    async def _remove(self, job: str) -> None:
        self._tab.runs.remove(job)
        self.forget(job)
        others = self._tab.runs.kept()
        if others:
            await self.show(self._tab.shown or others[-1].job)
            return
        self._verdict.show(None, None)
        self._plots.show(None, ())
        self._summary.set_content(summary(None))
        self._certificate.set_content(certificate(None))
        self._compare.allow(False)
        self._runs.fill(self._tab)

    def forget(self, job: str) -> None:
        """Drop a job with its files."""
        self._tab.requests.pop(job, None)
        self._tab.overlaid = [other for other in self._tab.overlaid if other != job]
        if self._tab.shown == job:
            self._tab.shown = None
        self._services.desk.drop(job)

    def _taken(self, job: str) -> None:
        self._tab.runs.taken(job)


async def _answer(folder: Path) -> Answer:
    return await asyncio.to_thread(Answer.load, folder)
