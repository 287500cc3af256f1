"""How much a suite may ask for: what a problem file may, by its steps and the sizes of its states.

A person who gives `-N` may ask for anything. A suite is a file, which may come from elsewhere; so
the limit that problem files have holds for its cases, before any of them is solved.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from pydantic import ValidationError

from quito_cli.batch.suite.case import Case
from quito_cli.batch.suite.schema_suite import Entry
from quito_cli.errors import UsageError
from quito_cli.options import SIZES, Options, too_large
from quito_cli.problem.options import FileOptions
from quito_cli.problem.text.complaints import Complaint, Path


class Sizes:
    """What the cases of an entry ask for; the same options are looked at once."""

    def __init__(self, content: Mapping[str, Any] | None) -> None:
        """Look at a problem.

        Args:
            content: data of its file; None where they cannot be read, which its cases will tell.
        """
        self._variables = 0 if content is None else _variables(content)
        self._file = FileOptions() if content is None else _options(content)
        self._known: dict[str, str | None] = {}

    def complaint(self, case: Case, entry: Entry, place: Path) -> Complaint | None:
        """Return what is wrong with the size of a case, at what makes it so large.

        Args:
            case: one of the entry's.
            entry: of the suite.
            place: of the entry in the file.
        """
        named = sorted(SIZES.intersection(case.options))
        if not named:  # the solve holds the problem file to the limit itself
            return None
        said = self._asked(case.options)
        if said is None:
            return None
        return Complaint(_place(named, entry, place), f"{said}: take fewer")

    def _asked(self, options: Mapping[str, Any]) -> str | None:
        key = repr(sorted(options.items(), key=str))
        if key not in self._known:
            try:
                chosen = Options.resolve(self._file, options)
                self._known[key] = too_large(self._variables, chosen)
            except UsageError:  # its case will tell
                self._known[key] = None
        return self._known[key]


def _place(named: list[str], entry: Entry, place: Path) -> Path:
    """Return where a suite asks for so much: on an axis, in the entry, or in the defaults."""
    sections: dict[str, Collection[str]] = {
        "matrix": entry.matrix,
        "over": entry.over,
        "options": entry.options.model_fields_set,
    }
    for section, there in sections.items():
        for name in named:
            if name in there:
                return (*place, section, name)
    return "defaults", "options", named[0]


def _variables(content: Mapping[str, Any]) -> int:
    """Return the number of states and controls in the data of a problem file."""
    found = 0
    for section in ("states", "controls"):
        entries = content.get(section)
        for one in entries.values() if isinstance(entries, dict) else ():
            size = one.get("size") if isinstance(one, dict) else None
            found += size if isinstance(size, int) else 1
    return found


def _options(content: Mapping[str, Any]) -> FileOptions:
    """Return what a problem file asks for; nothing where that makes no sense."""
    try:
        return FileOptions.model_validate(content.get("options") or {})
    except ValidationError:
        return FileOptions()
