"""What is wrong with the structure of a suite, in its own words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from pydantic_core import ErrorDetails

from quito_cli.batch.suite.schema_suite import SuiteFile
from quito_cli.problem.keys import Place, at_place, known_keys, unknown_key
from quito_cli.problem.text.complaints import Complaint, Path, suggest
from quito_cli.problem.wording import expected

_OPTIONS: Final = "options by name, such as {steps: 100}"
_SET: Final = "constants with their values, such as {mu: 0.5}"
_EXPECT: Final = "figures with what they are to be, such as {cost: 0.75 ± 1e-6}"
_LIMITS: Final = "{seconds: 60, memory: 2 GB}, or one of them"
_SHARED: Final[Mapping[str, str]] = {
    "options": _OPTIONS,
    "set": _SET,
    "expect": _EXPECT,
    "limits": _LIMITS,
}
_WANTED: Final[Mapping[Place, str]] = {
    ("defaults",): "what holds for every case, such as {options: {steps: 100}}",
    ("cases",): "a list of cases, such as [van_der_pol] or - problem: cart.yaml",
    ("cases", "*"): "a problem, or a mapping such as {problem: cart.yaml}",
    ("cases", "*", "matrix"): "axes with their values, such as {steps: [50, 100]}",
    ("cases", "*", "matrix", "*"): "a list of values, such as [50, 100]",
    ("cases", "*", "matrix", "*", "*"): "a number, a word, an expression, or true or false",
    ("cases", "*", "over"): "axes with their values, such as {mu: 0.1:2:20}",
    ("cases", "*", "over", "*"): "a range such as 0.1:2:20, or a list of values",
    ("cases", "*", "over", "*", "*"): "a number, a word, or true or false",
    ("cases", "*", "warm"): "true or false",
    **{("defaults", key): words for key, words in _SHARED.items()},
    **{("cases", "*", key): words for key, words in _SHARED.items()},
}
"""What to write where something else stands."""
_NEAR: Final = "a value with its tolerance, or a limit: 0.75 ± 1e-6, <= 0.01 or {most: 0.01}"
_EXPECTED: Final[Mapping[str, str]] = {
    "switching_times": "times with a tolerance, such as {value: [0.5, 1], absolute: 0.01}",
    **dict.fromkeys(("iterations", "cells", "warnings"), "a whole number, <= 20 or {most: 20}"),
}
_ALIASES: Final[Mapping[str, str]] = {
    "case": "cases",
    "tests": "cases",
    "problems": "cases",
    "file": "problem",
    "files": "include",
    "constants": "set",
    "expected": "expect",
    "expectations": "expect",
    "axes": "matrix",
    "sweep": "over",
    "sweeps": "over",
    "timeout": "limits",
    "time_limit": "limits",
    "memory_limit": "limits",
    "seconds": "limits",
    "maximum_violation": "violation",
    "max": "most",
    "min": "least",
    "target": "value",
    "values": "value",
    "tolerance": "absolute",
    "time": "seconds",
}
"""Words that are near to a key in meaning, not in letters."""
_WRONG_TYPES: Final = ("model_type", "dict_type", "model_attributes_type", "list_type")


def complaint(detail: ErrorDetails, path: Path) -> Complaint:
    """Return what pydantic found as a complaint."""
    kind, last = detail["type"], str(path[-1]) if path else ""
    if kind == "extra_forbidden":
        return Complaint(path, _unknown(path), length=len(last), key=True)
    if kind == "missing":
        said = "a suite needs `cases:`, a list of problems" if len(path) == 1 else ""
        return Complaint(path[:-1], said or f"`{last}` is missing here", key=len(path) > 1)
    if kind == "refused_key":
        return Complaint(path, expected(detail), length=len(last), key=True)
    tagged = kind in ("union_tag_not_found", "union_tag_invalid")
    if tagged or kind in _WRONG_TYPES:
        wanted = _EXPECTED.get(last, _NEAR) if _of_figure(path) else at_place(_WANTED, path)
        if wanted is None and path[-2:-1] == ("set",):
            wanted = "a number or an expression"
        if wanted is not None:
            shown = expected({**detail, "type": "model_type"}).rpartition(", got ")[2]
            return Complaint(path, f"expected {wanted}, got {shown}")
    return Complaint(path, expected(detail, _as_of_a_problem(path)))


def _unknown(path: Path) -> str:
    """Return what is said of an unknown key."""
    if path[-2:-1] == ("options",):
        return unknown_key(("options", path[-1]))
    key, known = str(path[-1]), known_keys(path, SuiteFile)
    if _ALIASES.get(key) in known:
        hint = f"; did you mean {_ALIASES[key]!r}?"
    else:
        hint = suggest(key, known) or f"; known here: {', '.join(known)}"
    return f"unknown key '{key}'{hint}"


def _of_figure(path: Path) -> bool:
    """Whether a path is that of an expected figure."""
    return path[-2:-1] == ("expect",)


def _as_of_a_problem(path: Path) -> Path:
    """Return the path that an option has in a problem file, whose words are used."""
    return path[path.index("options") :] if "options" in path else ("suite", *path)
