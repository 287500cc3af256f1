"""Where a problem comes from: a path, the name of a bundled one, or text; and `--set`."""

from __future__ import annotations

import copy
from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from quito_cli.errors import UsageError
from quito_cli.problem.library import bundled, bundled_suites
from quito_cli.problem.schema import Problem
from quito_cli.problem.text.complaints import suggest
from quito_cli.problem.text.strict_yaml import read
from quito_cli.problem.validate import validate

SETTABLE = ("time", "states", "controls", "parameters", "tables", "constants")
"""Sections whose values `--set section.key...=value` may change."""
ENDINGS = (".yaml", ".yml")
"""Of problem files."""
RESULTS = Path("results")
"""Where `quito solve` saves results unless told otherwise."""
MAX_BYTES = 4_000_000


def load(where: str | Path, changes: Mapping[str, str | float] | None = None) -> Problem:
    """Read a problem.

    Args:
        where: a path, or the name of a bundled problem.
        changes: constants to set by name, or other values by dotted path
            (`states.x2.upper`); values are numbers or expressions.

    Raises:
        UsageError: there is no such file, or nothing of that name to set.
        ProblemError: the file has mistakes; all of them are told.
    """
    path = find(where)
    return load_text(text_of(path), str(where) if path == Path(where) else str(path), changes)


def load_text(text: str, name: str, changes: Mapping[str, str | float] | None = None) -> Problem:
    """Read a problem from YAML text; `name` stands in messages and names results.

    Raises:
        UsageError: there is nothing of that name to set, or it is a suite of cases.
        ProblemError: the text has mistakes; all of them are told.
    """
    source = read(text, name)
    if "cases" in source.data and "dynamics" not in source.data:
        raise UsageError(
            f"{name} is a suite of cases, no problem: `quito batch {name}` runs it, and only reads "
            "it with --list"
        )
    return changed(validate(source, Path(name).stem), changes or {})


def changed(problem: Problem, changes: Mapping[str, str | float]) -> Problem:
    """Return the problem with constants, or values at dotted paths, set anew.

    Raises:
        UsageError: there is nothing of that name to set.
        ProblemError: the file makes no sense with that value.
    """
    if not changes:
        return problem
    file = problem.file
    data = copy.deepcopy(file.data if file else problem.model_dump(exclude_unset=True))
    for key, value in changes.items():
        _set(data, key, value)
    source = replace(file, data=data) if file else read(problem.text, problem.name)
    if not file:
        source = replace(source, data=data)
    made = tuple((key, str(value)) for key, value in changes.items())
    return validate(source, problem.name, problem.changes + made)


def find(where: str | Path, suites: Collection[str] = ()) -> Path:
    """Return the path of a problem given by path or bundled name.

    Args:
        where: as given.
        suites: names of bundled suites, where these are understood too.

    Raises:
        UsageError: there is none.
    """
    path = Path(where)
    if not str(where).strip():
        raise UsageError("name a problem: a file, or one of those that `quito list` shows")
    if path.is_file():
        return path
    if path.is_dir():
        raise UsageError(f"{where} is a folder; name a problem file in it")
    library = bundled()
    if str(where) in library:
        return library[str(where)]
    beside = next((other for other in _files_named(path) if other.is_file()), None)
    if beside:
        raise UsageError(f"there is no file {where}; did you mean {beside}?")
    if str(where) in bundled_suites():
        raise UsageError(f"{where} is a suite of cases, no problem: `quito batch {where}` runs it")
    hint = suggest(path.stem, [*library, *suites])
    what = "problem or suite" if suites else "problem"
    raise UsageError(
        f"there is no file {where}, and no bundled {what} of that name{hint}; "
        "`quito list` shows the bundled problems"
    )


def _files_named(path: Path) -> list[Path]:
    """Return the problem files that a name without its ending may mean."""
    return [path.with_name(path.name + ending) for ending in ENDINGS] if path.name else []


def refuse_problem(where: str | Path, verb: str) -> None:
    """Refuse a problem where a result is expected.

    Args:
        where: what was given for a result.
        verb: what was to be done with it, for the message.

    Raises:
        UsageError: it is a problem file, or the name of a problem.
    """
    path = Path(where)
    if path.suffix in ENDINGS and path.is_file():
        what = f"{path} is a problem file"
    elif path.exists() or path.suffix:
        return
    elif beside := next((other for other in _files_named(path) if other.is_file()), None):
        what = f"there is no file {path}; {beside} is a problem file"
    elif str(path) in bundled():
        what = f"there is no file {path}; that is a bundled problem"
    else:
        return
    result = RESULTS / f"{path.stem}.h5"
    if result.is_file():
        raise UsageError(f"{what}; did you mean {result}?")
    raise UsageError(f"{what}: solve it first, then {verb} {result}")


def text_of(path: Path) -> str:
    """Return the text of a problem or a suite file.

    Raises:
        UsageError: it is too large, no text, or cannot be read.
    """
    try:
        if path.stat().st_size > MAX_BYTES:
            raise UsageError(
                f"{path} is too large for a problem file ({MAX_BYTES:,} bytes at most)"
            )
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        if path.suffix == ".h5":
            raise UsageError(f"{path} is a result; `quito show` and `quito plot` read it") from None
        raise UsageError(f"{path} is not text in UTF-8; is it a problem file?") from None
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror}") from None


def _set(data: Any, key: str, value: str | float) -> None:
    """Change one value of the file's data in place."""
    steps = key.split(".") if "." in key else ["constants", key]
    constants = data.get("constants") or {}
    if len(steps) == 2 and steps[0] == "constants" and steps[1] not in constants:
        hint = suggest(steps[1], constants)
        known = f"it has {', '.join(constants)}" if constants else "it has none"
        raise UsageError(
            f"--set {key}: the problem has no constant '{steps[1]}'{hint} ({known}); other values "
            "are set by their path, such as --set states.x1.upper=2"
        )
    if steps[0] not in SETTABLE:
        raise UsageError(f"--set {key}: {_unsettable(data, steps)}")
    holder = _holder(data, key, steps)
    holder[steps[-1]] = _number_or_text(value)


def _unsettable(data: Any, steps: list[str]) -> str:
    """Say why a value cannot be set, and what can be done about it."""
    for section in SETTABLE:
        entries = data.get(section)
        if isinstance(entries, dict) and steps[0] in entries:
            return f"did you mean {section}.{'.'.join(steps)}?"
    only = f"only {', '.join(SETTABLE)} can be set"
    if steps[0] == "options":
        return f"{only}; options of the solve are given by name, such as --steps 100"
    return f"{only}; what else a problem says is changed in its file"


def _holder(data: Any, key: str, steps: list[str]) -> Any:
    """Return the mapping that holds the last step."""
    for i, step in enumerate(steps[:-1]):
        if not isinstance(data, dict) or step not in data:
            hint = suggest(step, data) if isinstance(data, dict) else ""
            raise UsageError(f"--set {key}: there is no '{'.'.join(steps[: i + 1])}'{hint}")
        if data[step] is None:
            data[step] = {}
        data = data[step]
    if not isinstance(data, dict):
        raise UsageError(f"--set {key}: '{'.'.join(steps[:-1])}' is a single value; set it whole")
    return data


def _number_or_text(value: str | float) -> str | float:
    try:
        return float(value)
    except ValueError:
        return value


def parse_settings(settings: Iterable[str], option: str) -> dict[str, str]:
    """Return NAME=VALUE texts of a command line as a mapping.

    Raises:
        UsageError: one of them is not of that form.
    """
    parsed: dict[str, str] = {}
    for setting in settings:
        name, equals, value = setting.partition("=")
        if not (name.strip() and equals and value.strip()):
            raise UsageError(f"{option} {setting!r}: write NAME=VALUE")
        parsed[name.strip()] = value.strip()
    return parsed
