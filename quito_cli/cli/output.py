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
    folders = (output, *output.absolute().parents)
    nearest = next(folder for folder in folders if os.path.lexists(folder))
    if not nearest.is_dir():
        raise UsageError(f"the output folder {output} cannot be made: {nearest} is not a folder")
    if not os.access(nearest, os.W_OK | os.X_OK):
        raise UsageError(f"the output folder {output} cannot be written: no permission")


def check_jobs(jobs: int | None, cluster: str | None) -> None:
    """Refuse a number of jobs that is none, or that is said of a cluster.

    Raises:
        UsageError: it is so.
    """
    if jobs is not None and jobs < 1:
        raise UsageError(f"jobs: a number from 1 on is expected, got {jobs}")
    if cluster is not None and jobs is not None:
        raise UsageError("--jobs is of this machine, and a cluster has its own: leave it out")
