"""The bundled problems: inside the package where it is installed, else beside it."""

from __future__ import annotations

from pathlib import Path

_PACKAGE = Path(__file__).resolve().parent.parent


def data_folder(name: str) -> Path:
    """Return the folder `problems` or `schemas`."""
    inside = _PACKAGE / name
    return inside if inside.is_dir() else _PACKAGE.parent / name


def bundled() -> dict[str, Path]:
    """Return the bundled problems by name, sorted."""
    return {path.stem: path for path in sorted(data_folder("problems").glob("*.yaml"))}
