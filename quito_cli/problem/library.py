"""The bundled problems and suites, inside the package or else beside it, and the template."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

TEMPLATE = Path(__file__).with_name("template.yaml")
"""A commented problem that solves as it stands."""
SCHEMA_LINE = re.compile(r"^#\s+yaml-language-server\s*:[^\r\n]*", re.MULTILINE)
"""By which editors find the schema, from where the file stands."""
_PACKAGE = Path(__file__).resolve().parent.parent
_KEY = re.compile(r"^(cases|dynamics)\s*:", re.MULTILINE)


def data_folder(name: str) -> Path:
    """Return the folder `problems` or `schemas`."""
    inside = _PACKAGE / name
    return inside if inside.is_dir() else _PACKAGE.parent / name


def bundled() -> dict[str, Path]:
    """Return the bundled problems by name, sorted."""
    return {name: path for name, path in _files().items() if not _is_suite(path)}


def bundled_suites() -> dict[str, Path]:
    """Return the bundled suites of cases by name, sorted."""
    return {name: path for name, path in _files().items() if _is_suite(path)}


def says_cases(text: str) -> bool:
    """Whether a file's text is that of a suite: it has `cases:`, and no `dynamics:`."""
    keys = set(_KEY.findall(text))
    return "cases" in keys and "dynamics" not in keys


def _files() -> dict[str, Path]:
    return {path.stem: path for path in sorted(data_folder("problems").glob("*.yaml"))}


@cache  # they do not change
def _is_suite(path: Path) -> bool:
    return says_cases(path.read_text(encoding="utf-8"))
