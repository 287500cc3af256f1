"""The bundled problems, inside the package or else beside it, and the template of new ones."""

from __future__ import annotations

import re
from pathlib import Path

TEMPLATE = Path(__file__).with_name("template.yaml")
"""A commented problem that solves as it stands."""
SCHEMA_LINE = re.compile(r"^#\s+yaml-language-server\s*:[^\r\n]*", re.MULTILINE)
"""By which editors find the schema, from where the file stands."""
_PACKAGE = Path(__file__).resolve().parent.parent


def data_folder(name: str) -> Path:
    """Return the folder `problems` or `schemas`."""
    inside = _PACKAGE / name
    return inside if inside.is_dir() else _PACKAGE.parent / name


def bundled() -> dict[str, Path]:
    """Return the bundled problems by name, sorted."""
    return {path.stem: path for path in sorted(data_folder("problems").glob("*.yaml"))}
