"""Where problems come from: the library, the folder of `quito gui DIR`, and what was uploaded.

Nothing outside of the folder can be reached: a name is one name, without a folder in it, and what
it names is a file itself, no link. The folder is opened once, and files are opened beside that
(`openat`) without following links, so that nobody can swap it in between.
"""

from __future__ import annotations

import errno
import os
import re
import stat
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from quito_cli.errors import UsageError
from quito_cli.problem.library import SCHEMA_LINE, TEMPLATE, bundled
from quito_cli.problem.load import ENDINGS

PlaceName = Literal["library", "folder"]

_MOST_ENTRIES = 500
"""Of a folder that are listed: the first by name."""
_LONGEST = 100
"""Characters of a name."""
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_. +-]*", re.ASCII)
_DEVICES = re.compile(r"(con|prn|aux|nul|com[0-9]|lpt[0-9])(\..*)?", re.IGNORECASE)
"""What Windows takes for a device, whatever the ending."""
_TITLE = re.compile(
    r"^title:[ \t]*(?P<quote>['\"]?)(?P<text>[^\r\n]{1,200}?)(?P=quote)[ \t]*$", re.M
)
_NO_LINKS = {errno.EPERM, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS, errno.EMLINK}
"""What file systems without hard links (FAT, some network shares) answer to one."""
_HEAD = 4_000
"""Bytes in which a title is looked for."""


class ThereAlreadyError(UsageError):
    """A file of that name is there; ask before it is replaced."""


@dataclass(frozen=True)
class Entry:
    """A problem that can be chosen."""

    name: str
    """As `Shelf.read` takes it: without ending in the library, with it in the folder."""
    title: str
    """The file's own; its name where it has none, or cannot be read."""
    place: PlaceName


class Shelf:
    """Problems to choose from, and the place to save own ones."""

    def __init__(self, folder: Path | None, most_bytes: int) -> None:
        """Look into `folder`, where there is one.

        Raises:
            UsageError: it is no folder, or cannot be read.
        """
        self._most = most_bytes
        self.folder = folder
        self._handle: int | None = None
        if folder is not None:
            try:
                self._handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
            except OSError as error:
                reason = "it is no folder" if error.errno == errno.ENOTDIR else error.strerror
                raise UsageError(f"{folder} cannot be opened: {reason}") from None

    @property
    def writable(self) -> bool:
        """Whether there is a folder to save in."""
        return self.folder is not None and os.access(self.folder, os.W_OK | os.X_OK)

    def library(self) -> tuple[Entry, ...]:
        """Return the bundled problems, by name."""
        return tuple(
            Entry(name, _title(path.read_bytes()[:_HEAD], name), "library")
            for name, path in bundled().items()
        )

    def own(self) -> tuple[Entry, ...]:
        """Return the problem files of the folder, by name; what is no plain file is left out."""
        if self._handle is None:
            return ()
        found: list[Entry] = []
        for name in sorted(os.listdir(self._handle), key=str.casefold):
            if len(found) == _MOST_ENTRIES:
                break
            if not objection(name):
                with suppress(UsageError):
                    found.append(Entry(name, _title(self._bytes(name, _HEAD), name), "folder"))
        return tuple(found)

    def read(self, place: PlaceName, name: str) -> str:
        """Return the text of a problem.

        Raises:
            UsageError: there is none of that name, or it is too large, or no text in UTF-8.
        """
        if place == "library":
            path = bundled().get(name)
            if path is None:
                raise UsageError(f"there is no bundled problem {_shown(name)}")
            return _standing_alone(path.read_text("utf-8-sig"))
        _refuse(name)
        content = self._bytes(name, self._most + 1)
        return decoded(content, name, self._most)

    def save(self, name: str, text: str, *, replace: bool) -> str:
        """Write a problem file into the folder, beside the old one and renamed.

        Returns:
            The name that it was given: with an ending.

        Raises:
            ThereAlreadyError: there is one of that name, and `replace` is false.
            UsageError: there is no folder, that is no name for a file, or it cannot be written.
        """
        if self._handle is None:
            raise UsageError("there is no folder to save in: start with quito gui FOLDER")
        content = text.encode("utf-8", "surrogatepass")
        name = name if name.lower().endswith(ENDINGS) else f"{name}.yaml"
        _refuse(name)
        decoded(content, name, self._most)
        aside = f".{name}.{os.getpid()}.{id(content):x}"
        try:
            self._write(aside, content)
            if replace:
                self._refuse_folder(name)
                os.replace(aside, name, src_dir_fd=self._handle, dst_dir_fd=self._handle)
            else:
                self._give_name(aside, name)
        except FileExistsError:
            raise ThereAlreadyError(f"{name} is there already: replace it?") from None
        except OSError as error:
            raise UsageError(f"{name} cannot be written: {error.strerror}") from None
        finally:
            with suppress(OSError):
                os.unlink(aside, dir_fd=self._handle)
        return name

    def close(self) -> None:
        """Let go of the folder."""
        if self._handle is not None:
            os.close(self._handle)
            self._handle = None

    def _bytes(self, name: str, most: int) -> bytes:
        """Return the first bytes of a plain file of the folder.

        Raises:
            UsageError: there is none, it is a link or no file, or it cannot be read.
        """
        missing = UsageError(f"there is no problem file {_shown(name)} in the folder")
        if self._handle is None:
            raise missing
        flags = os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK  # a pipe must not keep us waiting
        try:
            handle = os.open(name, flags, dir_fd=self._handle)
        except (OSError, ValueError):
            raise missing from None
        try:
            if not stat.S_ISREG(os.fstat(handle).st_mode):
                raise missing
            with open(handle, "rb", closefd=False) as file:
                return file.read(most)
        except OSError as error:
            raise UsageError(f"{name} cannot be read: {error.strerror}") from None
        finally:
            os.close(handle)

    def _write(self, name: str, content: bytes) -> None:
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW
        handle = os.open(name, flags, 0o666, dir_fd=self._handle)
        with open(handle, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(handle)

    def _give_name(self, aside: str, name: str) -> None:
        """Let `name` stand for what was written aside, whole at once, unless it is taken."""
        beside = {"src_dir_fd": self._handle, "dst_dir_fd": self._handle}
        try:
            os.link(aside, name, follow_symlinks=False, **beside)
        except OSError as error:
            if error.errno not in _NO_LINKS:
                raise
            # an empty file keeps the name for us: a rename would take any file's place
            self._write(name, b"")
            os.replace(aside, name, **beside)

    def _refuse_folder(self, name: str) -> None:
        with suppress(FileNotFoundError):
            if stat.S_ISDIR(os.stat(name, dir_fd=self._handle, follow_symlinks=False).st_mode):
                raise UsageError(f"{name} is a folder: choose another name")


def template() -> str:
    """Return what `quito new` writes: a commented problem that solves as it stands."""
    return _standing_alone(TEMPLATE.read_text("utf-8"))


def _standing_alone(text: str) -> str:
    """Return text without the line by which editors find the schema from where the file was."""
    return SCHEMA_LINE.sub("", text, count=1).lstrip()


def uploaded(filename: str, content: bytes, most_bytes: int) -> tuple[str, str]:
    """Return name and text of an uploaded file, the name made fit for a file.

    Raises:
        UsageError: it is too large, or no text in UTF-8.
    """
    last = re.split(r"[/\\]", filename)[-1]
    stem = re.sub(r"\.ya?ml$", "", last, flags=re.IGNORECASE)
    stem = re.sub(r"[^A-Za-z0-9_+-]+", "_", stem).strip("_-+")[: _LONGEST - 5]
    name = f"{stem}.yaml"
    return (name if stem and not objection(name) else "problem.yaml"), decoded(
        content, name if stem else "the file", most_bytes
    )


def decoded(content: bytes, name: str, most: int) -> str:
    """Return the text of a problem file.

    Raises:
        UsageError: it is too large, or no text in UTF-8.
    """
    if len(content) > most:
        raise UsageError(f"{_shown(name)} is too large for a problem here: {most:,} bytes at most")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise UsageError(f"{_shown(name)} is not text in UTF-8; is it a problem file?") from None


def objection(name: str) -> str:
    """Say why no file of the folder may be called so, on any system; nothing where it may."""
    stem, ending = os.path.splitext(name)
    if ending.lower() not in ENDINGS:
        return f"the name of a problem ends with {' or '.join(ENDINGS)}"
    if len(name) > _LONGEST:
        return f"a name has {_LONGEST} characters at most"
    if not _NAME.fullmatch(name) or stem[-1] in " .":
        return "a name has letters, digits, _, -, + and blanks, and begins with one of the first"
    if _DEVICES.fullmatch(name):
        return "Windows keeps that name for a device"
    return ""


def _refuse(name: str) -> None:
    if said := objection(name):
        raise UsageError(f"{_shown(name)} is no name for a problem file: {said}")


def _shown(name: str) -> str:
    """Return a name as it may stand in a message."""
    clear = "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in name)
    return clear if len(clear) <= _LONGEST else f"{clear[:_LONGEST]}..."


def _title(head: bytes, name: str) -> str:
    found = _TITLE.search(head.decode("utf-8", "replace"))
    return found["text"].strip() if found else name
