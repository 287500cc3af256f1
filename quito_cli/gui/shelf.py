"""Where problems come from: the library, the folder of `quito gui DIR`, and what was uploaded.

Nothing outside of the folder can be reached: a name is one name, without a folder in it, and what
it names is a file itself, no link.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from quito_cli.errors import UsageError


class ThereAlreadyError(UsageError):
    """A file of that name is there; ask before it is replaced."""


@dataclass(frozen=True)
class Entry:
    """A problem that can be chosen."""

    name: str
    """As `Shelf.read` takes it."""
    title: str
    """The file's own; its name where it has none, or cannot be read."""
    place: str
    """library or folder."""


class Shelf:
    """Problems to choose from, and the place to save own ones."""

    def __init__(self, folder: Path | None, most_bytes: int) -> None:
        """Look into `folder`, where there is one.

        Raises:
            UsageError: it is no folder, or cannot be read.
        """
        raise NotImplementedError

    @property
    def writable(self) -> bool:
        """Whether there is a folder to save in."""
        raise NotImplementedError

    def library(self) -> tuple[Entry, ...]:
        """Return the bundled problems, by name."""
        raise NotImplementedError

    def own(self) -> tuple[Entry, ...]:
        """Return the problem files of the folder, by name; what is no plain file is left out."""
        raise NotImplementedError

    def read(self, place: str, name: str) -> str:
        """Return the text of a problem.

        Raises:
            UsageError: there is none of that name, or it is too large, or no text in UTF-8.
        """
        raise NotImplementedError

    def template(self, name: str) -> str:
        """Return the text that `quito new` writes."""
        raise NotImplementedError

    def save(self, name: str, text: str, *, replace: bool) -> str:
        """Write a problem file into the folder, beside the old one and renamed; return its name.

        Raises:
            ThereAlreadyError: there is one of that name, and `replace` is false.
            UsageError: there is no folder, that is no name for a file, or it cannot be written.
        """
        raise NotImplementedError


def uploaded(filename: str, content: bytes, most_bytes: int) -> tuple[str, str]:
    """Return name and text of an uploaded file, the name made fit for a file.

    Raises:
        UsageError: it is too large, or no text in UTF-8.
    """
    raise NotImplementedError
