"""The form of settings, with help, and the command line that does the same."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import Any

from nicegui import ui
from nicegui.elements.mixins.value_element import ValueElement

from quito_cli.errors import QuitoError
from quito_cli.gui.settings import Setting, command, given, idle, settings

_HELP = "Settings begin with what the file asks for; changed ones are blue. Help stands here."


class Form:
    """Fields of the options; made anew when the file asks for something else."""

    def __init__(self, changed: Callable[[], None]) -> None:
        self._changed = changed
        self._file: dict[str, object] = {}
        self._settings: tuple[Setting, ...] = ()
        self._chosen: dict[str, Any] = {}
        self._fields: dict[str, ValueElement[Any]] = {}
        self._name = ""
        self._solvers: Collection[str] | None = None
        with ui.element("section").classes("panel").props('aria-label="Set the options"'):
            self._body = ui.element("div")
            self._help = ui.label(_HELP).classes("helped").props("aria-live=polite").mark("help")
            with ui.element("div").classes("command"):
                ui.label("$").props("aria-hidden=true").style("color: var(--muted)")
                self._command = ui.element("code").props('tabindex=0 aria-label="Command line"')
                with self._command:
                    self._words = ui.label().style("display: inline").mark("command")
                copy = (
                    ui.button("Copy", on_click=self._copy)
                    .props("flat")
                    .classes("quiet")
                    .mark("copy")
                )
                copy.props('aria-label="Copy the command line"')

    @property
    def chosen(self) -> dict[str, Any]:
        """What was changed by the user."""
        return dict(self._chosen)

    def given(self) -> dict[str, Any]:
        """Return what is to be asked for.

        Raises:
            UsageError: a value is out of its range, or values exclude each other.
        """
        return given(self._chosen, self._file)

    def know(self, solvers: Collection[str]) -> None:
        """Take note of which solvers are here, and say so of the others."""
        self._solvers = solvers
        self._make(self._file)

    def begin(self, name: str, chosen: Mapping[str, Any]) -> None:
        """Begin with another problem, or with settings that were kept."""
        self._name, self._chosen = name, dict(chosen)
        self._file, self._settings = {}, ()
        self._make({})

    def follow(self, file_options: Mapping[str, object]) -> None:
        """Take what the file asks for as defaults; what the user changed stays."""
        if file_options != self._file or not self._settings:
            self._make(file_options)

    def _make(self, file_options: Mapping[str, object]) -> None:
        self._file, self._settings = dict(file_options), settings(file_options, self._solvers)
        known = {setting.name for setting in self._settings}
        self._chosen = {k: v for k, v in self._chosen.items() if k in known}
        self._fields = {}
        self._body.clear()
        with self._body:
            with ui.element("div").classes("fields"):
                for setting in self._settings:
                    if not setting.advanced:
                        self._field(setting)
            with ui.element("details").classes("more"):
                with ui.element("summary"):
                    ui.label("More settings").style("display: inline")
                with ui.element("div").classes("fields"):
                    for setting in self._settings:
                        if setting.advanced:
                            self._field(setting)
        self._refresh()

    def _field(self, setting: Setting) -> None:
        value = self._chosen.get(setting.name, setting.default)
        field = _element(setting, value)
        field.mark(f"set-{setting.name}")
        field.on_value_change(lambda event: self._set(setting, event.value))
        field.on("focusin", lambda: self._help.set_text(_helped(setting)))
        field.on("mouseenter", lambda: self._help.set_text(_helped(setting)))
        self._fields[setting.name] = field

    def _set(self, setting: Setting, value: Any) -> None:
        if isinstance(value, float) and value.is_integer():
            value = int(value)  # as a person writes it
        if value in (None, "") or value == setting.default:
            self._chosen.pop(setting.name, None)
        else:
            self._chosen[setting.name] = value
        self._refresh()
        self._changed()

    def _refresh(self) -> None:
        """Disable what means nothing now, mark what was changed, and write the command line."""
        unused = idle(self._chosen, self._file)
        for name, field in self._fields.items():
            changed = name in self._chosen
            field.classes(add="changed") if changed else field.classes(remove="changed")
            field.props("disable") if name in unused else field.props(remove="disable")
        try:
            self._words.set_text(command(self._name, self.given()))
            self._command.props(remove="aria-invalid")
        except QuitoError as error:
            self._words.set_text(f"# {str(error).splitlines()[0]}")
            self._command.props("aria-invalid=true")

    def rename(self, name: str) -> None:
        """Take another name of the problem for the command line."""
        self._name = name
        self._refresh()

    async def _copy(self) -> None:
        ui.clipboard.write(self._words.text)
        self._help.set_text("The command line is copied.")


def _element(setting: Setting, value: Any) -> ValueElement[Any]:
    """Return the field of a setting."""
    if setting.kind == "choice":
        return _select(setting, value)
    if setting.kind == "switch":
        return ui.checkbox(setting.label, value=bool(value)).props("dense")
    field = ui.number(setting.label, value=value).props("outlined dense stack-label debounce=150")
    field.props("step=1" if setting.kind == "integer" else "step=any")
    return field.props('placeholder="automatic"') if setting.default is None else field


def _select(setting: Setting, value: Any) -> ui.select:
    """Return a field of words, with the help of each where it is chosen."""
    words = {"": "automatic"} if setting.default is None else {}
    for choice in setting.choices:
        words[choice.value] = choice.value + (f" – {choice.help}" if choice.help else "")
    field = ui.select(words, value=value or "", label=setting.label)
    field.props("outlined dense options-dense")
    field.props(f'display-value="{value or "automatic"}"')
    field.on_value_change(
        lambda event: field.props(f'display-value="{event.value or "automatic"}"')
    )
    return field


def _helped(setting: Setting) -> str:
    """Return the help of a setting, with its range and default."""
    said = setting.help
    low = setting.least if setting.above is None else setting.above
    if low is not None and setting.kind != "choice":
        most = f" to {setting.most:g}" if setting.most is not None else ""
        said += f" {'From' if setting.above is None else 'Above'} {low:g}{most}."
    default = "found from the problem" if setting.default is None else _said(setting.default)
    return f"{said} {'The file asks for' if setting.from_file else 'Default:'} {default}."


def _said(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:g}" if isinstance(value, float) else str(value)
