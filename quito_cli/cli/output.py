"""Where a command writes, in which format, and with how many jobs: what several commands share."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from quito_cli.errors import UsageError

PICTURES = ("png", "pdf", "svg")
_FILES = ("h5", "hdf5", "yaml", "yml", "json", "csv", "jpg", *PICTURES)

Picture = Annotated[str, typer.Option("--format", help="Format of the picture: png, pdf or svg.")]


def check_picture(picture: str) -> None:
    """Refuse a format that no picture is drawn in.

    Raises:
        UsageError: there is no such format.
    """
    if picture not in PICTURES:
        raise UsageError(f"format: expected png, pdf or svg, got {picture!r}")


def check_folder(output: Path) -> None:
    """Refuse a folder that cannot be written: a long solve must not end with nowhere to write.

    It is not made yet: the problem or an option may still be refused.

    Raises:
        UsageError: it is named like a file, or cannot be made, or not be written to.
    """
    if output.suffix[1:].lower() in _FILES and not output.is_dir():
        raise UsageError(
            f"-o names a folder, and {output} looks like a file; the files in it are named after "
            "the problem"
        )
    _check_writable(output, f"the output folder {output}")


def check_file(path: Path) -> None:
    """Refuse a file that cannot be written, before the work that it is to tell of.

    Raises:
        UsageError: it is a folder, or its folder cannot be made, or not be written to.
    """
    if path.is_dir():
        raise UsageError(f"{path} is a folder: name a file in it")
    _check_writable(path.parent, str(path))


def _check_writable(folder: Path, what: str) -> None:
    folders = (folder, *folder.absolute().parents)
    nearest = next(one for one in folders if os.path.lexists(one))
    if not nearest.is_dir():
        raise UsageError(f"{what} cannot be made: {nearest} is not a folder")
    if not os.access(nearest, os.W_OK | os.X_OK):
        raise UsageError(f"{what} cannot be written: no permission")
