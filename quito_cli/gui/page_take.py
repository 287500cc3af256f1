"""Buttons that take away what a job has left, as files of several formats."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from nicegui import ui

from quito_cli.errors import QuitoError
from quito_cli.gui.exports import Exporter


class Take:
    """Downloads, made when they are asked for."""

    def __init__(self, exporter: Exporter, say: Callable[[str, str], None]) -> None:
        self._exporter, self._say = exporter, say

    def buttons(
        self, taken: Sequence[tuple[str, str, str]], said: str, mark: str
    ) -> dict[str, ui.button]:
        """Put a group of buttons on the page, and return them by format.

        Args:
            taken: format, word and help of each.
            said: what the group is, for readers of screens.
            mark: of the buttons, before their formats.
        """
        with ui.element("div").classes("take").props(f'role=group aria-label="{said}"'):
            ui.label("Take away").classes("quietly")
            return {
                form: ui.button(word)
                .props(f'flat title="{what}"')
                .classes("plain")
                .mark(f"{mark}-{form}")
                for form, word, what in taken
            }

    async def take(self, folder: Path, form: str) -> bool:
        """Let the browser have a file of a job; return whether there was one."""
        try:
            made = await self._exporter.export(folder, form)
        except QuitoError as error:
            self._say(str(error), "bad")
            return False
        ui.download.file(made.path, made.filename, made.media_type)
        return True
