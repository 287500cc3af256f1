"""What can be taken away of a result: HDF5, pictures, CSV, the YAML, and a report page.

Each is made from the result file alone, in a worker where it may take long.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Download:
    """A file for the browser."""

    filename: str
    media_type: str
    path: Path
    """Where it is; in the folder of the job."""


FORMATS = ("h5", "png", "pdf", "svg", "csv", "yaml", "html")
"""Of `export`, by ending."""


def export(folder: Path, form: str) -> Download:
    """Make a download of a finished job; what was made before is not made again.

    It may take a second: call it off the event loop (`nicegui.run.io_bound`).

    Args:
        folder: of a job that is finished.
        form: one of `FORMATS`.

    Raises:
        UsageError: there is no such format.
        ResultFileError: the result is gone or damaged.
    """
    raise NotImplementedError
