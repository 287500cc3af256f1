"""Whether two files state the same problem: all that its answer depends on, and nothing else."""

from __future__ import annotations

from typing import Any, Final

from quito_cli.problem.schema import Problem

_ASIDE: Final = {
    *("title", "source", "description", "tags", "plots", "reference", "published", "options")
}
"""Sections that the answer does not depend on."""
_WORDS: Final = {"guess", "scale", "unit", "description"}
"""Of a variable or a free time: the way to the answer, and words."""
_ORDERED: Final = ("states", "controls", "parameters")
"""Sections whose order is an order of rows and columns."""


def differing(one: Problem, other: Problem) -> str | None:
    """Return the first section in which two problems differ, or None where they state the same.

    Formulas are the same where they are the same text but for blanks; values that were set, with
    `--set`, count as they were set.
    """
    first, second = _statement(one), _statement(other)
    return next((name for name in first if first[name] != second[name]), None)


def _statement(problem: Problem) -> dict[str, Any]:
    data = problem.model_dump(exclude=_ASIDE)
    for section in (*_ORDERED, "time"):
        for entry in data[section].values():
            for word in _WORDS if isinstance(entry, dict) else ():
                entry.pop(word, None)
    return {
        name: list(_plain(value).items()) if name in _ORDERED else _plain(value)
        for name, value in data.items()
    }


def _plain(value: Any) -> Any:
    """Return a value without the blanks in its formulas."""
    if isinstance(value, str):
        return "".join(value.split())
    if isinstance(value, dict):
        return {key: _plain(entry) for key, entry in value.items()}
    return [_plain(entry) for entry in value] if isinstance(value, list) else value
