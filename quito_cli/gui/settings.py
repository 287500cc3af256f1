"""The form: options of a solve with help, choices and ranges; and the command line that says it.

All of it is read off the models of options and the tables that they name, so that an option that is
added there is here too. What is idle beside what is decided by asking `Options.resolve`, which
refuses what means nothing.
"""

from __future__ import annotations

import shlex
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, Final, Literal

from pydantic import ValidationError

from quito_cli.errors import UsageError
from quito_cli.options import Options
from quito_cli.problem.json_schema import attribute_docstrings
from quito_cli.problem.options import COLLOCATION, FileOptions, RequestedOptions
from quito_cli.problem.wording import expected

Kind = Literal["integer", "number", "choice", "switch"]

USUAL: Final[tuple[str, ...]] = (
    *("steps", "variance", "generating_function", "discretization", "control", "mesh", "polish"),
    *("solver", "tolerance"),
)
"""Those of a form at first sight, in their order; one that there is none of is left out."""
_LEADING: Final[tuple[str, ...]] = ("discretization", "control", "mesh", "polish", "solver")
"""What other options may mean nothing beside; the first wins."""
_NOT_HERE: Final = ("solver_options", "warm_start")
"""For the command line: they have no field, or need a result file."""
_KINDS: Final[Mapping[str, Kind]] = {
    "integer": "integer",
    "number": "number",
    "boolean": "switch",
}
"""Of fields, by the schema's types."""
_SHORT: Final = {"steps": "-N"}
_OFF: Final = {"normalised": "--as-printed"}
"""How a switch is turned off; the others have `--no-`."""
_WORDS: Final = {
    ("control", "quasi-interpolant"): "shifted generating functions: no ringing on singular arcs",
    ("control", "piecewise-constant"): "one value a cell, as MISER and ACADO have it",
    ("control", "piecewise-linear"): "continuous, linear in each cell, as DIRCOL has it",
    ("discretization", COLLOCATION): "Legendre-Gauss-Radau collocation, as GPOPS-II and ICLOCS2",
    ("mesh", "uniform"): "equal cells",
    ("mesh", "adaptive"): "cells that follow the control, small at its jumps and kinks",
    ("path_points", "nodes"): "at the ends of the cells",
    ("path_points", "substeps"): "wherever the integrator looks at the control",
    ("solver", "auto"): "a quadratic program's own solver where it is one, else ipopt",
}
"""Of choices that no table has a row for."""


@dataclass(frozen=True)
class Choice:
    """One of several words."""

    value: str
    help: str
    """What it is; empty where nothing is to be said."""
    available: bool
    """Whether it is there on this machine; else `help` says where it is from."""


@dataclass(frozen=True)
class Setting:
    """A field of the form."""

    name: str
    """Of the option: `generating_function`."""
    label: str
    """`generating function`."""
    help: str
    kind: Kind
    choices: tuple[Choice, ...]
    """Of a choice."""
    least: float | None
    """Smallest value; None where there is none."""
    above: float | None
    """What a value must be larger than; None where nothing."""
    most: float | None
    """Largest value; None where there is none."""
    default: Any
    """The file's own value, else that of `Options`; None where it is found from the problem."""
    from_file: bool
    """Whether the default is the file's."""
    advanced: bool
    """Whether it may be hidden until it is asked for."""


def settings(
    file_options: Mapping[str, Any], solvers: Collection[str] | None = None
) -> tuple[Setting, ...]:
    """Return the fields of the form for a file, the usual ones first.

    Args:
        file_options: what the file asks for, as `Checked.options` has it.
        solvers: those that are here, as `Checker.solvers` tells; None counts all as here.
    """
    names = [name for name in RequestedOptions.model_fields if name not in _NOT_HERE]
    ordered = [name for name in USUAL if name in names]
    ordered += [name for name in names if name not in ordered]
    return tuple(_setting(name, file_options, solvers) for name in ordered)


def _setting(
    name: str, file_options: Mapping[str, Any], solvers: Collection[str] | None
) -> Setting:
    form = _form(name)
    words = form.get("enum", ())
    return Setting(
        name=name,
        label=name.replace("_", " "),
        help=_helps()[name].replace("`", ""),
        kind="choice" if words else _KINDS[form["type"]],
        choices=tuple(_choice(name, word, solvers) for word in words),
        least=form.get("minimum"),
        above=form.get("exclusiveMinimum"),
        most=form.get("maximum"),
        default=file_options.get(name, getattr(Options, name)),
        from_file=name in file_options,
        advanced=name not in USUAL,
    )


@cache
def _helps() -> dict[str, str]:
    said = attribute_docstrings(RequestedOptions) | attribute_docstrings(FileOptions)
    return {name: " ".join(text.split()) for name, text in said.items()}


@cache
def _form(name: str) -> dict[str, Any]:
    """Return the schema of an option; what a file may not ask for, a page may not either."""
    model = FileOptions if name in FileOptions.model_fields else RequestedOptions
    schema = model.model_json_schema()["properties"][name]
    forms: list[dict[str, Any]] = schema.get("anyOf", [schema])
    return next(form for form in forms if form.get("type") != "null")


def _choice(name: str, word: str, solvers: Collection[str] | None) -> Choice:
    if (name, word) in _WORDS:
        return Choice(word, _WORDS[name, word], True)
    if name == "solver":
        return _solver(word, solvers)
    rows = {"generating_function": _generating_function, "discretization": _scheme}
    return Choice(word, rows[name](word) if name in rows else "", True)


def _solver(name: str, solvers: Collection[str] | None) -> Choice:
    from quito_cli.solvers.table import backend

    row = backend(name)
    help = f"{row.title}; {'quadratic programs only; ' * (row.takes == 'QP')}".removesuffix("; ")
    if solvers is None or name in solvers:
        return Choice(name, help, True)
    return Choice(name, f"not here: from {row.provides}", False)


def _generating_function(name: str) -> str:
    from quito_cli.transcription.generating import generating_function

    row = generating_function(name)
    return f"{row.number}, of order {row.order}: {row.formula}"


def _scheme(name: str) -> str:
    from quito_cli.transcription.schemes import scheme

    row = scheme(name)
    return f"{row.title}, of order {row.order}"


def idle(chosen: Mapping[str, Any], file_options: Mapping[str, Any]) -> frozenset[str]:
    """Return the names of the options that mean nothing beside those chosen: to be disabled.

    Args:
        chosen: what was set in the form; what is not in it is at its default.
        file_options: what the file asks for.
    """
    return _sorted_out(chosen, FileOptions.model_validate(file_options))[1]


def given(chosen: Mapping[str, Any], file_options: Mapping[str, Any]) -> dict[str, Any]:
    """Return what is to be asked for: what makes a difference beside the file and the defaults.

    It is what `Request.options` and `command` take. What is idle is left out.

    Raises:
        UsageError: a value is out of its range, or options exclude each other.
    """
    refuse_out_of_range(chosen)
    file = FileOptions.model_validate(file_options)
    asked = _sorted_out(chosen, file)[0]
    whole = Options.resolve(file, asked)
    for name in list(asked):
        fewer = {other: value for other, value in asked.items() if other != name}
        if _resolved(file, fewer) == whole:
            asked = fewer
    return asked


def refuse_out_of_range(chosen: Mapping[str, Any]) -> None:
    """Refuse what a page may not ask for: as much as a file may, and no names but those known.

    Raises:
        UsageError: a value is out of its range; all of them are told.
    """
    refused = []
    for name, value in chosen.items():
        if name in _NOT_HERE or name not in RequestedOptions.model_fields:
            raise UsageError(f"there is no option '{name}' on this page")
        if said := _out_of_range(name, value):
            refused.append(said)
    if refused:
        raise UsageError("\n".join(refused))


def _out_of_range(name: str, value: Any) -> str:
    """Say what is wrong with a value; nothing where it may be asked for."""
    model = FileOptions if name in FileOptions.model_fields else RequestedOptions
    try:
        model.model_validate({name: value})
    except ValidationError as error:
        return f"{name.replace('_', ' ')}: {expected(error.errors()[0])}"
    return ""


def _sorted_out(
    chosen: Mapping[str, Any], file: FileOptions
) -> tuple[dict[str, Any], frozenset[str]]:
    """Return what is chosen and means something, and the names of all that mean nothing.

    A number means nothing where any is refused: one that is wrong, or too small beside others, is
    the user's mistake, and to be told.
    """
    asked: dict[str, Any] = {}
    sound: dict[str, Any] = {}
    unused = set()
    mine = {name: value for name, value in chosen.items() if value is not None}
    names = [name for name in RequestedOptions.model_fields if name not in _NOT_HERE]
    order = [name for name in _LEADING if name in names]
    order += [name for name in names if name not in order]
    for name in sorted(order, key=lambda name: name not in mine):
        form, value = _form(name), mine.get(name)
        telling = value is not None and ("enum" in form or form["type"] == "boolean")
        wrong = value is None or bool(_out_of_range(name, value))
        tried = value if telling and not wrong else _probe(name, file)
        if _resolved(file, sound | {name: tried}) is None:
            unused.add(name)
        elif name in mine:
            asked[name] = value
            if not wrong and _resolved(file, sound | {name: value}) is not None:
                sound[name] = value
    return asked, frozenset(unused)


def _probe(name: str, file: FileOptions) -> Any:
    """Return a value of an option that is right in itself."""
    form, default = _form(name), getattr(file, name, None)
    for value in (default, getattr(Options, name), form.get("maximum")):
        if value is not None:
            return value
    return form["enum"][0] if "enum" in form else 1


def _resolved(file: FileOptions, asked: Mapping[str, Any]) -> Options | None:
    try:
        return Options.resolve(file, asked)
    except UsageError:
        return None


def command(problem: str, given: Mapping[str, Any]) -> str:
    """Return the `quito solve` command line that does the same, quoted for a shell.

    Args:
        problem: a path, or the name of a bundled problem.
        given: as the function of that name returns it.
    """
    words = ["quito", "solve", f"./{problem}" if problem.startswith("-") else problem]
    for name, value in given.items():
        flag = f"--{name.replace('_', '-')}"
        if value is True:
            words.append(flag)
        elif value is False:
            words.append(_OFF.get(name, f"--no-{flag[2:]}"))
        else:
            words += [_SHORT.get(name, flag), str(value)]
    return shlex.join(words)
