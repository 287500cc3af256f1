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
from quito_cli.problem.complaints import Complaint, ProblemError, suggest
from quito_cli.problem.schema import Problem
from quito_cli.problem.source import Source

Path = tuple[str | int, ...]

_ALTERNATIVES = {
    "constants": "a number, an expression, a list or a list of lists",
    "initial": "a number, an expression, {lower:, upper:} or a list",
    "final": "a number, an expression, {lower:, upper:} or a list",
    "dynamics": "an expression or a list of expressions",
    "state": "an expression of t or a list of pieces {until:, value:}",
    "control": "an expression of t or a list of pieces {until:, value:}",
}
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
    complaints = [_complaint(detail) for detail in details]
    raise ProblemError(complaints + _beyond(details, source, name), source, set_values(changes))


def _named(problem: Problem, source: Source, name: str) -> Problem:
    problem._source = source
    problem._name = name
    return problem


def _beyond(details: list[ErrorDetails], source: Source, name: str) -> list[Complaint]:
    """Return complaints about formulas, with the structure mended where that can be guessed."""
    data = copy.deepcopy(source.data)
    poisoned: set[str] = set()
    for detail in details:
        path = _real_path(detail["loc"])
        if len(path) > 1 and path[0] in ("constants", "states", "controls"):
            poisoned.add(str(path[1]))
        if detail["type"] != "missing" and path:
            _mend(data, path, detail["type"] == "extra_forbidden")
    try:
        problem = _named(Problem.model_validate(data), source, name)
    except ValidationError:
        return []
    return try_build(problem, poisoned)[1]


def _mend(data: Any, path: Path, unknown_key: bool) -> None:
    """Give an unknown key the name it was likely meant to have, or leave the value out."""
    for step in path[:-1]:
        try:
            data = data[step]
        except (KeyError, IndexError, TypeError):
            return
    key = path[-1]
    if not isinstance(data, dict) or key not in data:
        return
    value = data.pop(key)
    if unknown_key and (meant := _meant(path, data)):
        data[meant] = value


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


def _real_path(location: tuple[str | int, ...]) -> Path:
    """Return pydantic's location without the tags of alternatives, which start with '='."""
    return tuple(step for step in location if not (isinstance(step, str) and step.startswith("=")))


def _complaint(detail: ErrorDetails) -> Complaint:
    path, kind = _real_path(detail["loc"]), detail["type"]
    if kind == "extra_forbidden":
        hint = suggest(str(path[-1]), _known_keys(path))
        known = "" if hint else f"; known here: {', '.join(_known_keys(path))}"
        message = f"unknown key '{path[-1]}'{hint}{known}"
        return Complaint(path, message, length=len(str(path[-1])), key=True)
    if kind == "missing":
        key = str(path[-1])
        told = _MISSING.get(key, "") if len(path) == 1 else ""
        return Complaint(path[:-1], told or f"`{key}` is missing here", key=len(path) > 1)
    return Complaint(path, expected(detail, path))


def expected(detail: ErrorDetails, path: Path = ()) -> str:
    """Return what was expected, in plain words."""
    kind, value = detail["type"], detail["input"]
    context: dict[str, Any] = detail.get("ctx", {})
    match kind:
        case "value_error":
            return str(context["error"])
        case "union_tag_not_found" | "union_tag_invalid":
            nearest_first = [_ALTERNATIVES[s] for s in reversed(path) if s in _ALTERNATIVES]
            wanted = nearest_first[0] if nearest_first else "a number or an expression"
        case "model_type" | "dict_type" | "model_attributes_type":
            wanted = "a mapping, `key: value` lines or {...}"
        case "literal_error":
            names = str(context["expected"]).replace("'", "")
            return f"expected {names}, got {_shown(value)}{suggest(str(value), names.split(', '))}"
        case "too_long":
            return f"expected at most {context['max_length']} entries, got {_length(context)}"
        case "too_short":
            return f"expected at least {context['min_length']} entries, got {_length(context)}"
        case _:
            wanted = _plain(detail)
    return f"expected {wanted}, got {_shown(value)}"


def _length(context: dict[str, Any]) -> Any:
    return context["actual_length"]


def _plain(detail: ErrorDetails) -> str:
    """Return pydantic's sentence in the voice of the other messages."""
    words = detail["msg"].removeprefix("Input should be ")
    words = words.replace("a valid integer", "a whole number").replace("valid ", "")
    for ours, theirs in (
        ("at least", "greater than or equal to"),
        ("at most", "less than or equal to"),
    ):
        words = words.replace(theirs, ours)
    return words


def _shown(value: Any) -> str:
    names = {dict: "a mapping", list: "a list", type(None): "nothing"}
    text = names.get(type(value)) or repr(value)
    return text if len(text) <= 40 else text[:37] + "..."
