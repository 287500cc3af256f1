"""Data of a file -> Problem: pydantic's findings in the words of the problem file.

To show every mistake at once, formulas are checked even where the structure is wrong: what is
wrong is mended or left out, and the rest is looked at.
"""

from __future__ import annotations

import copy
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from quito_cli.problem.build import set_values, try_build
from quito_cli.problem.schema import Problem
from quito_cli.problem.text.complaints import Complaint, ProblemError, suggest
from quito_cli.problem.text.source import Source

Path = tuple[str | int, ...]

_STAND_IN = "mended"
"""A name that counts as poisoned: a formula in place of one that could not be read."""
_NAMING = ("constants", "states", "controls", "parameters", "tables", "expressions")
"""Sections whose keys are names in formulas."""
_VARIABLES = ("states", "controls", "parameters")
"""Sections whose entries are mappings, in which a wrong key can be left out."""
_ASIDE = ("tags", "plots", "reference", "published", "options")
"""Sections that the other ones do not speak of."""

_ALTERNATIVES = {
    "constants": "a number, an expression, a list or a list of lists",
    "initial": "a number, an expression, {lower:, upper:} or a list",
    "final": "a number, an expression, {lower:, upper:} or a list",
    "dynamics": "an expression or a list of expressions",
    "state": "an expression of t or a list of pieces {until:, value:}",
    "control": "an expression of t or a list of pieces {until:, value:}",
}
_GUESS = "an expression of t, a list with one for each entry, or {times:, values:}"
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
    complaints = [
        _complaint(detail, _real_path(detail["loc"], source.data))
        for detail in _told_once(details, source.data)
    ]
    raise ProblemError(complaints + _beyond(details, source, name), source, set_values(changes))


def _named(problem: Problem, source: Source, name: str) -> Problem:
    problem._source = source
    problem._name = name
    return problem


def _told_once(details: list[ErrorDetails], data: Any) -> list[ErrorDetails]:
    """Leave out what is missed only because its key is misspelt: the key is complained of."""
    unknown = [_real_path(d["loc"], data) for d in details if d["type"] == "extra_forbidden"]
    found = {(*path[:-1], _meant(path, _holder(data, path))) for path in unknown}
    return [d for d in details if d["type"] != "missing" or _real_path(d["loc"], data) not in found]


def _beyond(details: list[ErrorDetails], source: Source, name: str) -> list[Complaint]:
    """Return complaints about formulas, with the structure mended where that can be guessed."""
    data = copy.deepcopy(source.data)
    poisoned = {_STAND_IN}
    for detail in details:
        path = _real_path(detail["loc"], source.data)
        known = (_rename if detail["type"] == "extra_forbidden" else _replace)(data, path)
        if not known:
            poisoned.add(str(path[1]))
    try:
        problem = _named(Problem.model_validate(data), source, name)
    except ValidationError:
        return []
    return try_build(problem, poisoned)[1]


def _rename(data: Any, path: Path) -> bool:
    """Give an unknown key the name it was likely meant to have, or leave it out.

    False if the state, control or constant that holds it cannot be spoken of any more.
    """
    if path[0] in _ASIDE and path[1:]:
        return _replace(data, path)
    holder = _holder(data, path)
    if path[-1] not in holder:  # left out already, for another mistake beside it
        return True
    value = holder.pop(path[-1])
    meant = _meant(path, holder)
    if meant:
        holder[meant] = value
    return bool(meant) or path[0] not in _NAMING or len(path) < 3


def _replace(data: Any, path: Path) -> bool:
    """Put something harmless where a value is wrong or missing; False as for `_rename`."""
    match path:
        case (str(section), *_) if section in _ASIDE:
            data.pop(section, None)
        case ("time",):
            data["time"] = {"initial": _STAND_IN, "final": _STAND_IN}
        case ("dynamics",):
            states = data.get("states")
            data["dynamics"] = dict.fromkeys(states if isinstance(states, dict) else (), _STAND_IN)
        case ("cost",):
            data["cost"] = {}
        case ("time" | "dynamics" as section, key, *_):
            data[section][key] = _STAND_IN
        case ("constraints", str(kind), name, *_) if isinstance(data.get("constraints"), dict):
            _holder(data, ("constraints", kind, name)).pop(name, None)
        case (str(section), name, "size", *_) if section in _VARIABLES and section in data:
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
        case (str(key),):
            data.pop(key, None)
    return True


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


def _known_keys(path: Path) -> list[str]:
    """Return the keys that the mapping holding `path` may have."""
    model: Any = Problem
    for step in path[:-1]:
        if isinstance(step, str) and step in model.model_fields:
            inner = _models_in(model.model_fields[step].annotation)
            model = inner[0] if inner else model
    return list(model.model_fields)


def _models_in(annotation: Any) -> list[Any]:
    """Return the pydantic models that a field's type speaks of, mappings of them included."""
    if hasattr(annotation, "model_fields"):
        return [annotation]
    found: list[Any] = []
    for argument in getattr(annotation, "__args__", ()):
        found += _models_in(argument)
    return found


def _meant(path: Path, present: dict[str, Any]) -> str | None:
    """Return the one key, not yet there, that an unknown key is near to."""
    candidates = [key for key in _known_keys(path) if key not in present]
    hint = suggest(str(path[-1]), candidates)
    return next((key for key in candidates if f"'{key}'" in hint), None)


def _real_path(location: tuple[str | int, ...], data: Any) -> Path:
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
        hint = suggest(str(path[-1]), _known_keys(path))
        known = "" if hint else f"; known here: {', '.join(_known_keys(path))}"
        message = f"unknown key '{path[-1]}'{hint}{known}"
        return Complaint(path, message, length=len(str(path[-1])), key=True)
    if kind == "missing":
        key = str(path[-1])
        told = _MISSING.get(key, "") if len(path) == 1 else ""
        return Complaint(path[:-1], told or f"`{key}` is missing here", key=len(path) > 1)
    if kind == "refused_key":
        return Complaint(path, expected(detail), length=len(str(path[-1])), key=True)
    return Complaint(path, expected(detail, path))


def expected(detail: ErrorDetails, path: Path = ()) -> str:
    """Return what was expected, in plain words."""
    kind, value = detail["type"], detail["input"]
    context: dict[str, Any] = detail.get("ctx", {})
    match kind:
        case "value_error" | "refused_key":
            return str(context["error"])
        case "union_tag_not_found" | "union_tag_invalid":
            wanted = _alternatives(path)
        case "model_type" | "dict_type" | "model_attributes_type" if path[:1] == ("constraints",):
            wanted = _CONSTRAINTS[min(len(path), 3) if path[1:2] == ("point",) else len(path)]
        case "model_type" | "dict_type" | "model_attributes_type":
            wanted = "a mapping, `key: value` lines or {...}"
        case "literal_error":
            names = str(context["expected"]).replace("'", "")
            hint = suggest(str(value), names.replace(" or ", ", ").split(", "))
            by_number = ", or its number 1 to 6" if "generating_function" in detail["loc"] else ""
            return f"expected {names}{by_number}, got {_shown(value)}{hint}"
        case "too_long":
            return f"expected at most {_entries(context['max_length'])}, got {_length(context)}"
        case "too_short":
            return f"expected at least {_entries(context['min_length'])}, got {_length(context)}"
        case "string_type" if _comparison_at(path):
            wanted = "a comparison with a name of its own, such as limit: x <= 1"
        case "string_type" if isinstance(value, bool | int | float):
            return f"expected text, got {_shown(value)}: quote it"
        case "string_pattern_mismatch":
            wanted = "small letters, digits and hyphens, such as bang-bang"
        case _:
            wanted = _plain(detail)
    return f"expected {wanted}, got {_shown(value)}"


_CONSTRAINTS = {
    1: "kinds of constraints, such as path: {limit: x <= 1}",
    2: "names with what must hold, such as limit: x <= 1",
    3: "a time and what must hold then, {at: 0.5, holds: x <= 1}",
}


def _comparison_at(path: Path) -> bool:
    """Whether a comparison stands at a path."""
    return path[:1] == ("constraints",) and (len(path) == 3 or path[-1] == "holds")


def _alternatives(path: Path) -> str:
    if path[:1] == ("time",):
        inner = path[2:] and path[2] in ("lower", "upper", "guess")
        return (
            "a number or an expression"
            if inner
            else "a number, an expression, or {lower:, upper:, guess:} where it is free"
        )
    if path[2:3] == ("curves",) and path[:1] == ("plots",):
        return "two or three expressions in a list, or one that is a vector"
    if path[:1] in (("states",), ("controls",)) and "guess" in path[2:3]:
        return "a number" if "values" in path[3:] else _GUESS
    keys = [step for step in reversed(path) if step in _ALTERNATIVES]
    if not keys:
        return "a number or an expression"
    if isinstance(path[-1], int):
        range_too = keys[0] in ("initial", "final")
        return (
            f"a number{', an expression or {lower:, upper:}' if range_too else ' or an expression'}"
        )
    return _ALTERNATIVES[str(keys[0])]


def _entries(count: int) -> str:
    return f"{count} entries" if count != 1 else "one entry"


def _length(context: dict[str, Any]) -> Any:
    return "more" if context["actual_length"] is None else context["actual_length"]


def _plain(detail: ErrorDetails) -> str:
    """Return pydantic's sentence in the voice of the other messages."""
    words = detail["msg"].removeprefix("Input should be ").split(", ")[0]
    for theirs, ours in (
        ("greater than or equal to", "at least"),
        ("less than or equal to", "at most"),
        ("greater than", "a number above"),
        ("less than", "a number below"),
        ("a valid integer", "a whole number"),
        ("a valid boolean", "true or false"),
        ("a valid string", "text"),
        ("valid ", ""),
    ):
        words = words.replace(theirs, ours)
    return words


def _shown(value: Any) -> str:
    names = {dict: "a mapping", list: "a list", type(None): "nothing"}
    if isinstance(value, bool):
        return str(value).lower()
    text = names.get(type(value)) or repr(value)
    return text if len(text) <= 40 else text[:37] + "..."
