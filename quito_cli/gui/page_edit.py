"""The editor: YAML with colours and line numbers, and the checker's complaints at their lines."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from html import escape
from typing import Any, Final

from nicegui import ui

from quito_cli.gui.checking import Checked, Remark
from quito_cli.gui.page_mathematics import formulas

LIGHT: Final = "githubLight"
DARK: Final = "githubDark"
_UNREADABLE = "<p class='none'>Formulas stand here once the text can be read.</p>"
_SHOWN = 90
"""Characters of a complaint beside its line; all of it is in the list and in the tooltip."""


class Edit:
    """Formulas above, editor, complaints below; heights do not depend on what is in them."""

    def __init__(self, typed: Callable[[str], None]) -> None:
        with ui.element("details").classes("panel").props("open"):
            with ui.element("summary"):
                ui.label("Formulas").style("display: inline")
            self._formulas = ui.html("<p class='none'>…</p>").classes("formulas")
            self._formulas.props('tabindex=0 role=region aria-label="The problem as mathematics"')
            self._formulas.mark("formulas")
        whole = ui.element("section").classes("panel edit")
        with whole.props('id=edit tabindex=-1 aria-label="Edit the problem"'):
            with ui.element("div").classes("bar"):
                self._name = (
                    ui.label().props("role=heading aria-level=2").classes("name").mark("name")
                )
                self._count = ui.label().props("role=status aria-live=polite").mark("count")
            self.editor = ui.codemirror(
                language="YAML",
                theme=LIGHT,
                indent="  ",
                on_change=lambda event: typed(str(event.value or "")),
            ).mark("editor")
            self._remarks = ui.element("div").classes("remarks").mark("remarks")
            self._remarks.props('tabindex=0 role=region aria-label="Complaints"')

    def show(self, name: str, text: str) -> None:
        """Put a text into the editor."""
        self._name.set_text(name)
        self.editor.decorations = []
        self.editor.line_tooltips = {}
        self.editor.set_value(text)

    def rename(self, name: str) -> None:
        """Say under what name the text is."""
        self._name.set_text(name)

    def darken(self, dark: bool) -> None:
        """Take the colours for a dark or for a light page."""
        self.editor.set_theme(DARK if dark else LIGHT)

    def say(self, checked: Checked, text: str) -> None:
        """Show what was found in `text`, which is the editor's."""
        errors = sum(remark.severity == "error" for remark in checked.remarks)
        said = _counted(errors, len(checked.remarks) - errors)
        self._count.set_text(said if checked.complete else f"{said} so far: it takes long to read")
        self._count.classes(replace="status bad" if errors else "status")
        if checked.formulas:
            self._formulas.set_content(
                f"<div aria-hidden='true'>{formulas(checked)}</div>"
                f"<div class='hidden-text'>{escape(checked.unicode)}</div>"
            )
        elif not self._formulas.content.startswith("<div"):
            self._formulas.set_content(_UNREADABLE)
        placed = [remark for remark in checked.remarks if remark.line is not None]
        self.editor.decorations = decorations(text, placed)
        self.editor.line_tooltips = tooltips(text, placed)
        self._list(checked.remarks)

    def _list(self, remarks: Sequence[Remark]) -> None:
        self._remarks.clear()
        with self._remarks:
            if not remarks:
                ui.label("No complaints.").classes("none")
            for remark in remarks:
                self._entry(remark)

    def _entry(self, remark: Remark) -> None:
        where = f"Line {remark.line}" if remark.line is not None else "File"
        said = f"<b>{where}:</b> {escape(remark.message)}"
        entry = ui.html(said, tag="button").classes(f"remark {remark.severity}")
        if remark.line is not None:
            line = remark.line
            entry.on("click", lambda: self.editor.reveal_line(line))


def _counted(errors: int, warnings: int) -> str:
    """Say how many complaints there are."""
    said = [
        f"{count} {word}{'s' if count > 1 else ''}"
        for count, word in ((errors, "error"), (warnings, "warning"))
        if count
    ]
    return " and ".join(said) or "no complaints"


def decorations(text: str, remarks: Sequence[Remark]) -> list[dict[str, Any]]:
    """Return colours of lines, underlines, and words at the ends of lines, for CodeMirror.

    Args:
        text: of the editor.
        remarks: those that have a line.
    """
    lines = text.split("\n")
    starts = [0]
    for line in lines:
        starts.append(starts[-1] + len(line) + 1)
    found: list[dict[str, Any]] = []
    for number, (worst, said) in _by_line(remarks, len(lines)).items():
        start, length = starts[number - 1], len(lines[number - 1])
        found.append({"kind": "line", "line": number, "class": f"line-{worst}"})
        for remark in said:
            first = _index(lines[number - 1], (remark.column or 1) - 1)
            last = _index(lines[number - 1], (remark.column or 1) - 1 + max(remark.length, 1))
            if remark.column is not None and last > first:
                mark = f"mark-{remark.severity}"
                ends = {"from": start + first, "to": start + last}
                found.append({"kind": "mark", **ends, "class": mark})
        words = "  ".join(" ".join(remark.message.split()) for remark in said)
        shown = words if len(words) <= _SHOWN else words[: _SHOWN - 1] + "…"
        end = start + length
        found.append({"kind": "widget", "position": end, "text": shown, "class": f"said-{worst}"})
    return found


def _index(line: str, units: int) -> int:
    """Return how many characters of a line come before that many UTF-16 units."""
    return len(line.encode("utf-16-le")[: 2 * units].decode("utf-16-le", "ignore"))


def tooltips(text: str, remarks: Sequence[Remark]) -> dict[int, str]:
    """Return the whole complaints by line."""
    said = _by_line(remarks, text.count("\n") + 1)
    return {line: "\n".join(r.message for r in found) for line, (_, found) in said.items()}


def _by_line(remarks: Sequence[Remark], count: int) -> dict[int, tuple[str, list[Remark]]]:
    """Return the remarks of each line with the worst severity; those beyond the end at the last."""
    lines: dict[int, list[Remark]] = {}
    for remark in remarks:
        lines.setdefault(min(max(remark.line or 1, 1), count), []).append(remark)
    return {
        line: ("error" if any(r.severity == "error" for r in found) else "warning", found)
        for line, found in sorted(lines.items())
    }
