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
    """Fields of the options; they are made once, and filled anew where the file asks for others.

    A field that was put in the place of another would lose what is being typed into it.
    """

    def __init__(self, changed: Callable[[], None]) -> None:
        self._changed = changed
        self._file: dict[str, object] = {}
        self._settings: dict[str, Setting] = {}
        self._chosen: dict[str, Any] = {}
        self._fields: dict[str, ValueElement[Any]] = {}
        self._name = ""
        self._solvers: Collection[str] | None = None
        self._quietly = False
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
        self._fill({})

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
        self._fill(self._file)

    def begin(self, name: str, chosen: Mapping[str, Any]) -> None:
        """Begin with another problem, or with settings that were kept."""
        self._name, self._chosen = name, dict(chosen)
        self._fill({})

    def follow(self, file_options: Mapping[str, object]) -> None:
        """Take what the file asks for as defaults; what the user changed stays."""
        if file_options != self._file:
            self._fill(file_options)

    def _fill(self, file_options: Mapping[str, object]) -> None:
        self._file = dict(file_options)
        self._settings = {each.name: each for each in settings(self._file, self._solvers)}
        self._chosen = {k: v for k, v in self._chosen.items() if k in self._settings}
        if not self._fields:  # before anybody looks, so that nothing jumps then
            self._make()
        self._quietly = True
        for name, field in self._fields.items():
            setting = self._settings[name]
            _write(field, setting, self._chosen.get(name, setting.default))
        self._quietly = False
        self._refresh()

    def _make(self) -> None:
        with self._body:
            with ui.element("div").classes("fields"):
                self._make_fields(advanced=False)
            with ui.element("details").classes("more"):
                with ui.element("summary"):
                    ui.label("More settings").style("display: inline")
                with ui.element("div").classes("fields"):
                    self._make_fields(advanced=True)

    def _make_fields(self, *, advanced: bool) -> None:
        for name, setting in self._settings.items():
            if setting.advanced == advanced:
                field = self._fields[name] = _element(setting)
                field.mark(f"set-{name}")
                field.on_value_change(lambda event, name=name: self._set(name, event.value))
                for rests in ("focusin", "mouseenter"):
                    field.on(rests, lambda name=name: self._explain(name))

    def _explain(self, name: str) -> None:
        self._help.set_text(_helped(self._settings[name]))

    def _set(self, name: str, value: Any) -> None:
        if self._quietly:
            return
        if isinstance(value, float) and value.is_integer():
            value = int(value)  # as a person writes it
        if value in (None, "") or value == self._settings[name].default:
            self._chosen.pop(name, None)
        else:
            self._chosen[name] = value
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


def _element(setting: Setting) -> ValueElement[Any]:
    """Return the field of a setting, with nothing in it yet."""
    if setting.kind == "choice":
        chosen = ui.select(_words(setting), label=setting.label)
        chosen.props("outlined dense options-dense")
        chosen.on_value_change(lambda event: _display(chosen, event.value))
        return chosen
    if setting.kind == "switch":
        return ui.checkbox(setting.label).props("dense")
    field = ui.number(setting.label).props("outlined dense stack-label debounce=150")
    return field.props("step=1" if setting.kind == "integer" else "step=any")


def _write(field: ValueElement[Any], setting: Setting, value: Any) -> None:
    """Write a value into the field of a setting."""
    if isinstance(field, ui.select):
        field.set_options(_words(setting), value=value or "")
        _display(field, value)
    elif setting.kind == "switch":
        field.set_value(bool(value))
    else:
        none = setting.default is None
        field.props('placeholder="automatic"') if none else field.props(remove="placeholder")
        field.set_value(value)


def _words(setting: Setting) -> dict[str, str]:
    """Return what can be chosen, with the help of each."""
    words = {"": "automatic"} if setting.default is None else {}
    for choice in setting.choices:
        words[choice.value] = choice.value + (f" – {choice.help}" if choice.help else "")
    return words


def _display(field: ui.select, value: Any) -> None:
    field.props(f'display-value="{value or "automatic"}"')


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
