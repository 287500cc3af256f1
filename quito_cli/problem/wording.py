"""pydantic's findings in the words of the problem file: what was expected, by place."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from pydantic_core import ErrorDetails

from quito_cli.problem.keys import Path, Place, at_place
from quito_cli.problem.text.complaints import suggest

_STATE: Final = "its end values and bounds, such as {name}: {{initial: 0}}, or {name}: {{}}"
_CONTROL: Final = "its bounds, such as {name}: {{lower: -1, upper: 1}}, or {name}: {{}}"
_PARAMETER: Final = "its bounds or a guess, such as {name}: {{lower: 0, upper: 1}}"
_TABLE: Final = "its data, such as {name}: {{x: [0, 1, 2], y: [5, 7, 6]}}"
_BALL: Final = "{{centre: [0, 0], radius: 1}}"

MAPPINGS: Final[Mapping[Place, str]] = {
    ("constants",): "names with their values, such as k: 2",
    ("time",): "both ends of the horizon, such as {{initial: 0, final: 2}}",
    ("states",): "names with what is known of each, such as x: {{initial: 0}}",
    ("states", "*"): _STATE,
    ("controls",): "names with their bounds, such as u: {{lower: -1, upper: 1}}, or u: {{}}",
    ("controls", "*"): _CONTROL,
    ("parameters",): "names with their bounds, such as p: {{lower: 0, upper: 1}}",
    ("parameters", "*"): _PARAMETER,
    ("tables",): "names with their data, such as wind: {{x: [0, 1, 2], y: [5, 7, 6]}}",
    ("tables", "*"): _TABLE,
    ("expressions",): "names for formulas, such as speed: sqrt(v^2 + w^2)",
    ("dynamics",): "one line for each state, such as x: v",
    ("cost",): (
        "{{lagrange: ...}} for an integral over the horizon, or {{mayer: ...}} for a value at the"
        " end"
    ),
    ("constraints",): "kinds of constraints, such as path: {{limit: x <= 1}}",
    ("constraints", "*"): "names with what must hold, such as limit: x <= 1",
    ("constraints", "point", "*"): ("a time and what must hold then, {{at: 0.5, holds: x <= 1}}"),
    ("plots",): "plots by name, such as plan: {{curves: {{boat: [x, y]}}}}",
    ("plots", "*"): "what to draw, such as {name}: {{curves: {{boat: [x, y]}}}}",
    ("plots", "*", "curves"): "curves by name, such as curves: {{boat: [x, y]}}",
    ("plots", "*", "circles", "*"): _BALL,
    ("plots", "*", "spheres", "*"): "{{centre: [0, 0, 0], radius: 1}}",
    ("plots", "*", "boxes", "*"): "{{centre: [0, 0], half: [1, 1]}}",
    ("reference",): "what is known of the answer, such as {{cost: 0.5, accuracy: 1e-6}}",
    ("reference", "constants"): "names with their values, such as k: 2",
    ("reference", "state"): "states with functions of t, such as x: 1 - t",
    ("reference", "control"): "controls with functions of t, such as u: 1 - t",
    ("reference", "state", "*", "*"): "a piece, {{until: 1, value: 1 - t}}",
    ("reference", "control", "*", "*"): "a piece, {{until: 1, value: 1 - t}}",
    ("published", "*"): "a row of a table, such as {{tool: ICLOCS2, steps: 100}}",
    ("options",): "options by name, such as {{steps: 100}}",
    ("options", "solver_options"): "options by name, such as {{mu_strategy: adaptive}}",
}
"""What to write where a mapping is expected; `name` is the key there."""

_LISTS: Final[Mapping[Place, str]] = {
    ("tags",): "a list of words, such as [singular, tracking]",
    ("published",): "a list of rows, such as [{tool: ICLOCS2, steps: 100}]",
    ("plots", "*", "labels"): "a list of names, such as [x, y]",
    ("plots", "*", "circles"): "a list, such as [{centre: [0, 0], radius: 1}]",
    ("plots", "*", "spheres"): "a list, such as [{centre: [0, 0, 0], radius: 1}]",
    ("plots", "*", "boxes"): "a list, such as [{centre: [0, 0], half: [1, 1]}]",
    ("reference", "switching_times"): "a list of times, such as [0.5, 1]",
    ("tables", "*", "x"): "a list of numbers, such as [0, 1, 2]",
    ("tables", "*", "y"): "a list of numbers, such as [5, 7, 6]",
}
"""What to write where a list is expected."""

_ALTERNATIVES = {
    "constants": "a number, an expression, a list or a list of lists",
    "initial": "a number, an expression, {lower:, upper:} or a list",
    "final": "a number, an expression, {lower:, upper:} or a list",
    "dynamics": "an expression or a list of expressions",
    "state": "an expression of t or a list of pieces {until:, value:}",
    "control": "an expression of t or a list of pieces {until:, value:}",
}
_GUESS = "an expression of t, a list with one for each entry, or {times:, values:}"


def expected(detail: ErrorDetails, path: Path = ()) -> str:
    """Return what was expected, in plain words."""
    kind, value = detail["type"], detail["input"]
    context: dict[str, Any] = detail.get("ctx", {})
    match kind:
        case "value_error" | "refused_key":
            return str(context["error"])
        case "union_tag_not_found" | "union_tag_invalid":
            wanted = _alternatives(path)
        case "model_type" | "dict_type" | "model_attributes_type":
            wanted = _mapping(path)
        case "list_type" if row := at_place(_LISTS, path):
            wanted = row
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


def _mapping(path: Path) -> str:
    """Return what to write where a mapping is expected."""
    wanted = at_place(MAPPINGS, path) or "a mapping, `key: value` lines or {{...}}"
    return wanted.format(name=path[-1] if path else "")


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
