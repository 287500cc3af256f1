"""Choosing a problem: of the library, of the folder, a file of the user's, or a new one."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping
from typing import Literal

from nicegui import events, ui

from quito_cli.errors import QuitoError, UsageError
from quito_cli.gui.page_state import Draft
from quito_cli.gui.shelf import Shelf, ThereAlreadyError, template, uploaded

_NEW = "my_problem.yaml"
Open = Callable[[Draft], Awaitable[None]]
Say = Callable[[str, str], None]
"""Tells the user something; its kind is info, good or bad."""


class Choose:
    """The row of choices, and what becomes of the file that is being edited."""

    def __init__(
        self, shelf: Shelf, most_bytes: int, opened: Open, draft: Callable[[], Draft], say: Say
    ) -> None:
        self._shelf, self._most, self._opened = shelf, most_bytes, opened
        self._draft, self._say = draft, say
        self._aside: Mapping[str, Draft] = {}
        with ui.element("section").classes("panel choose").props('aria-label="Choose a problem"'):
            self._select = ui.select(
                self._entries(), label="Problem", with_input=True, on_change=self._chosen
            )
            self._select.props("outlined dense options-dense").mark("problem")
            self._select.on("click", js_handler="event => event.target.select?.()")
            ui.button("New", on_click=self._new).props("flat").classes("plain").mark("new")
            uploader = ui.upload(
                on_upload=self._uploaded,
                on_rejected=lambda: say("that file is too large or none at all", "bad"),
                auto_upload=True,
                max_files=None,
                max_file_size=most_bytes,
                label="Problem file",
            )
            uploader.classes("upload").props("accept=.yaml,.yml tabindex=-1").mark("uploader")
            self._uploader = uploader
            pick = ui.button("Upload").props("flat").classes("plain").mark("upload")
            pick.on("click", js_handler=f"() => getElement({uploader.id}).pickFiles()")
            word = "Save" if shelf.writable else "Download"
            ui.button(word, on_click=self._save).props("flat").classes("plain").mark("save")

    def _entries(self) -> dict[str, str]:
        """Return what can be chosen: keys of place and name, and what is read."""
        listed = [*self._shelf.own(), *self._shelf.library()]
        return {
            f"{entry.place}/{entry.name}": entry.name
            + (f" – {entry.title}" if entry.title != entry.name else "")
            for entry in listed
        }

    def show(self, draft: Draft, aside: Mapping[str, Draft]) -> None:
        """Say which problem is open, and which edited ones can be brought back."""
        self._aside = aside
        key, edited = f"{draft.place}/{draft.name}", [*aside]
        if draft.place == "own" and draft.name not in aside:
            edited.append(draft.name)
        entries = {f"own/{name}": f"{name} – edited here" for name in edited} | self._entries()
        self._quietly = True
        self._select.set_options(entries, value=key)
        self._quietly = False

    _quietly = False

    async def _chosen(self, event: events.ValueChangeEventArguments[str]) -> None:
        if self._quietly or not event.value:
            return
        chosen, _, name = str(event.value).partition("/")
        draft = self._draft()
        if (chosen, name) == (draft.place, draft.name):
            return
        if chosen == "own":
            await self._opened(self._aside[name])
            return
        place: Literal["library", "folder"] = "library" if chosen == "library" else "folder"
        try:
            text = self._shelf.read(place, name)
        except QuitoError as error:
            self._say(str(error), "bad")
            return
        await self._opened(Draft(name, place, text, {}))

    async def _new(self) -> None:
        await self._opened(Draft(_NEW, "own", template(), {}))

    async def _uploaded(self, event: events.UploadEventArguments) -> None:
        try:
            name, text = uploaded(event.file.name, await event.file.read(), self._most)
        except QuitoError as error:
            self._say(str(error), "bad")
            return
        finally:
            self._uploader.reset()
        await self._opened(Draft(name, "own", text, {}))

    async def _save(self) -> None:
        draft = self._draft()
        if not self._shelf.writable:
            ui.download.content(draft.text, f"{draft.stem}.yaml", "application/yaml")
            return
        name = await _asked_name(f"{draft.stem}.yaml")
        if name:
            await self._write(name, draft, replace=False)

    async def _write(self, name: str, draft: Draft, *, replace: bool) -> None:
        try:
            written = self._shelf.save(name, draft.text, replace=replace)
        except ThereAlreadyError as error:
            if await _confirmed(f"{error}"):
                await self._write(name, draft, replace=True)
        except UsageError as error:
            self._say(str(error), "bad")
        else:
            self._say(f"saved as {written}", "good")
            await self._opened(Draft(written, "folder", draft.text, draft.chosen))


async def _asked_name(name: str) -> str | None:
    """Ask under which name to save."""
    with ui.dialog() as dialog, ui.card():
        ui.label("Save in the folder as")
        field = ui.input("Name", value=name).props("outlined dense autofocus").mark("name-to-save")
        with ui.row():
            ui.button("Save", on_click=lambda: dialog.submit(field.value)).classes("main").mark(
                "ok"
            )
            ui.button("Not now", on_click=dialog.close).props("flat").classes("plain")
        field.on("keydown.enter", lambda: dialog.submit(field.value))
    answer = await dialog
    dialog.delete()
    return str(answer) if answer else None


async def _confirmed(question: str) -> bool:
    """Ask yes or no."""
    with ui.dialog() as dialog, ui.card():
        ui.label(question)
        with ui.row():
            ui.button("Replace", on_click=lambda: dialog.submit(True)).classes("main").mark("yes")
            ui.button("Keep it", on_click=dialog.close).props("flat").classes("plain")
    answer = await dialog
    dialog.delete()
    return bool(answer)
