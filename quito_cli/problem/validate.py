"""Data of a file -> Problem: pydantic's findings in the words of the problem file.

To show every mistake at once, formulas are checked even where the structure is wrong: what is
wrong is mended or left out, and the rest is looked at.
"""

from __future__ import annotations

import copy
import re
from dataclasses import replace
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from quito_cli.problem.build import set_values, try_build
from quito_cli.problem.keys import Path, meant, unknown_key
from quito_cli.problem.language.names import is_valid_name
from quito_cli.problem.schema import Problem
from quito_cli.problem.text.complaints import Complaint, ProblemError
from quito_cli.problem.text.source import Source
from quito_cli.problem.wording import expected

_STAND_IN = "mended"
"""A name that counts as poisoned: a formula in place of one that could not be read."""
_NAMING = ("constants", "states", "controls", "parameters", "tables", "expressions")
"""Sections whose keys are names in formulas."""
_VARIABLES = ("states", "controls", "parameters")
"""Sections whose entries are mappings, in which a wrong key can be left out."""
_ASIDE = ("tags", "plots", "reference", "published", "options")
"""Sections that the other ones do not speak of."""

_WORD = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_MENDINGS = 4
"""Rounds of mending: what was left out or renamed may leave something else to mend."""

_MISSING = {
    "states": "every problem needs `states:`",
    "dynamics": "every problem needs `dynamics:`, one line for each state",
    "cost": "every problem needs `cost:` with `lagrange`, `mayer` or both",
    "time": "every problem needs `time: {initial:, final:}`",
}


def validate(source: Source, name: str, changes: tuple[tuple[str, str], ...] = ()) -> Problem:
    """Return the Problem in `source`, whose data has `changes` in it already.

    Raises:
        ProblemError: with every mistake of structure, and of formulas as far as they can be read.
    """
    try:
        problem = _named(Problem.model_validate(source.data), source, name)
        problem._changes = changes
        return problem
    except ValidationError as error:
        details = error.errors()
    details = _told_once(details, source.data)
    complaints = [_complaint(detail, real_path(detail["loc"], source.data)) for detail in details]
    raise ProblemError(complaints + _beyond(details, source, name), source, set_values(changes))


def _named(problem: Problem, source: Source, name: str) -> Problem:
    problem._source = source
    problem._name = name
    return problem


def _told_once(details: list[ErrorDetails], data: Any) -> list[ErrorDetails]:
    """Leave out what is missed only because its key is misspelt: the key is complained of."""
    unknown = [real_path(d["loc"], data) for d in details if d["type"] == "extra_forbidden"]
    found = {(*path[:-1], meant(path, _holder(data, path))) for path in unknown}
    return [d for d in details if d["type"] != "missing" or real_path(d["loc"], data) not in found]


def _beyond(details: list[ErrorDetails], source: Source, name: str) -> list[Complaint]:
    """Return complaints about formulas, with the structure mended where that can be guessed."""
    data = copy.deepcopy(source.data)
    poisoned = {_STAND_IN}
    moved: dict[Path, Path] = {}
    told: list[Complaint] = []
    for _ in range(_MENDINGS):
        wrong = [(detail["type"], real_path(detail["loc"], data)) for detail in details]
        for kind, path in wrong:
            if path[0] in _NAMING and len(path) == 1 and kind != "extra_forbidden":
                poisoned |= _undeclared(source.data)
            unknown = kind == "extra_forbidden"
            known = _rename(data, path, moved) if unknown else _replace(data, path)
            if not known:
                poisoned.add(str(path[1]))
        try:
            problem = _named(Problem.model_validate(data), source, name)
        except ValidationError as error:
            details = _told_once(error.errors(), data)
            for detail in details:
                path = real_path(detail["loc"], data)
                if _written(path, moved) != path:  # it was under an unknown key, and not looked at
                    told.append(_complaint(detail, path))
        else:
            told += try_build(problem, poisoned)[1]
            break
    return [replace(c, path=_written(c.path or (), moved)) for c in told]


def _written(path: Path, moved: dict[Path, Path]) -> Path:
    """Return where the file has what is at a path since keys were given other names."""
    for length in range(len(path), 0, -1):
        path = moved.get(path[:length], path[:length]) + path[length:]
    return path


def _undeclared(data: Any) -> set[str]:
    """Return every word of the file that is not declared as a name.

    It may be a name of a section that cannot be read, and no more is said of what has it.
    """
    words: set[str] = set()
    pending = [data]
    while pending:
        part = pending.pop()
        if isinstance(part, str):
            words.update(_WORD.findall(part))
        elif isinstance(part, dict | list):
            pending += part.values() if isinstance(part, dict) else part
    sections = (data.get(section) for section in _NAMING)
    return words.difference(*(section for section in sections if isinstance(section, dict)))


def _rename(data: Any, path: Path, moved: dict[Path, Path]) -> bool:
    """Give an unknown key the name it was likely meant to have, noted in `moved`, or leave it out.

    False if the state, control or constant that holds it cannot be spoken of any more.
    """
    if path[0] in _ASIDE and path[1:]:
        return _replace(data, path)
    holder = _holder(data, path)
    if path[-1] not in holder:  # left out already, for another mistake beside it
        return True
    value = holder.pop(path[-1])
    key = meant(path, holder)
    if key:
        holder[key] = value
        moved[(*path[:-1], key)] = path
    elif path[0] == "parameters" and len(path) == 3:
        holder.setdefault("guess", 0)
    return bool(key) or path[0] not in _NAMING or len(path) < 3


def _replace(data: Any, path: Path) -> bool:
    """Put something harmless where a value is wrong or missing; False as for `_rename`."""
    match path:
        case (str(section), *_) if section in _ASIDE:
            data.pop(section, None)
        case (str(section),):
            _replace_section(data, section)
        case ("time" | "dynamics" as section, key, *_):
            data[section][key] = _STAND_IN
        case ("constraints", str(kind), name, *_) if isinstance(data.get("constraints"), dict):
            _holder(data, ("constraints", kind, name)).pop(name, None)
        case (str(section), name) | (str(section), name, "size", *_) if (
            section in _VARIABLES and section in data
        ):
            data[section][name] = _unknown(section)  # nothing that has a length can be checked
            return False
        case (str(section), name, key, *_) if section in _VARIABLES:
            variable = _holder(data, (section, name, key))
            variable.pop(key, None)
            if section == "parameters":
                variable |= {"guess": 0} if variable.get("guess") is None else {}
        case (str(section), key, *_):
            data[section].pop(key, None)
            return section not in _NAMING
    return True


def _replace_section(data: Any, section: str) -> None:
    """Put something harmless in place of a whole section."""
    if section in ("states", "controls"):
        data.pop("reference", None)  # it may speak of them
    match section:
        case "time":
            data["time"] = {"initial": _STAND_IN, "final": _STAND_IN}
        case "states":
            _replace_states(data)
        case "dynamics":
            states = data.get("states")
            data["dynamics"] = dict.fromkeys(states if isinstance(states, dict) else (), _STAND_IN)
        case "cost":
            data["cost"] = {"mayer": 0}
        case _:
            data.pop(section, None)


def _replace_states(data: Any) -> None:
    """Take the states to be those that have dynamics; of their lengths nothing is known."""
    dynamics = data.get("dynamics")
    named = dynamics if isinstance(dynamics, dict) else {}
    data["states"] = {name: {} for name in named if not is_valid_name(name)} or {_STAND_IN: {}}
    data["dynamics"] = {name: named.get(name, _STAND_IN) for name in data["states"]}


def _unknown(section: str) -> dict[str, Any]:
    """Return a variable of which nothing is known."""
    return {"guess": 0} if section == "parameters" else {}


def _holder(data: Any, path: Path) -> Any:
    """Return the mapping that holds the last key of a path; empty where it is left out already."""
    for step in path[:-1]:
        if isinstance(data, dict):
            data = data.get(step)
        elif isinstance(data, list) and isinstance(step, int):
            data = data[step]
        else:
            return {}
    return data if isinstance(data, dict) else {}


def real_path(location: tuple[str | int, ...], data: Any) -> Path:
    """Return pydantic's location without the tags of alternatives, which start with '='.

    A file may have keys that look like them, so that the data decides.
    """
    path: list[str | int] = []
    for step in location:
        inside = isinstance(data, dict) and step in data
        if isinstance(step, str) and step.startswith("=") and not inside:
            continue
        path.append(step)
        if inside or (isinstance(data, list) and isinstance(step, int)):
            data = data[step]
    return tuple(path)


def _complaint(detail: ErrorDetails, path: Path) -> Complaint:
    kind = detail["type"]
    if kind == "extra_forbidden":
        return Complaint(path, unknown_key(path), length=len(str(path[-1])), key=True)
    if kind == "missing":
        key = str(path[-1])
        told = _MISSING.get(key, "") if len(path) == 1 else ""
        return Complaint(path[:-1], told or f"`{key}` is missing here", key=len(path) > 1)
    if kind == "refused_key":
        return Complaint(path, expected(detail), length=len(str(path[-1])), key=True)
    return Complaint(path, expected(detail, path))
