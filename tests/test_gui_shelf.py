"""The shelf: what can be read and saved by name, and that nothing else can."""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterator
from pathlib import Path

import pytest

from quito_cli.errors import UsageError
from quito_cli.gui.shelf import PlaceName, Shelf, ThereAlreadyError, objection, template, uploaded
from quito_cli.problem.library import bundled
from quito_cli.problem.load import load_text

MOST = 10_000
TEXT = "title: 'A cart'\nstates: {x: {}}\n"
OUTSIDE = (
    "../secret.yaml",
    "..\\secret.yaml",
    "sub/inside.yaml",
    "/etc/passwd.yaml",
    "C:\\secret.yaml",
    "C:secret.yaml",
    "\\\\server\\share.yaml",
    "..",
    ".",
    "",
    ".hidden.yaml",
    "a\0.yaml",
    "a\n.yaml",
    "con.yaml",
    "NUL.yaml",
    "com1.yaml",
    "aux.backup.yaml",
    "a .yaml",
    "a..yaml",
    "stream.txt:x.yaml",
    "~root.yaml",
    "-rf.yaml",
    "ünïcode.yaml",
    "a\u202eb.yaml",
    "x" * 300 + ".yaml",
    "result.h5",
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    folder = tmp_path / "own"
    (folder / "sub").mkdir(parents=True)
    (folder / "cart.yaml").write_text(TEXT)
    (folder / "Boat.yml").write_text("states: {}\n")
    (folder / "sub" / "inside.yaml").write_text(TEXT)
    (folder / "folder.yaml").mkdir()
    (folder / "notes.txt").write_text("")
    (tmp_path / "secret.yaml").write_text("title: secret\n")
    (folder / "link.yaml").symlink_to(tmp_path / "secret.yaml")
    (folder / "loop.yaml").symlink_to(folder / "loop.yaml")
    os.mkfifo(folder / "pipe.yaml")
    return folder


@pytest.fixture
def shelf(folder: Path) -> Iterator[Shelf]:
    made = Shelf(folder, MOST)
    yield made
    made.close()


# Listing


def test_plain_problem_files_are_listed_by_name_with_their_titles(shelf: Shelf) -> None:
    assert [(entry.name, entry.title) for entry in shelf.own()] == [
        ("Boat.yml", "Boat.yml"),
        ("cart.yaml", "A cart"),
    ]


def test_the_library_is_listed_with_its_titles() -> None:
    listed = {entry.name: entry.title for entry in Shelf(None, MOST).library()}
    assert list(listed) == list(bundled())
    assert listed["van_der_pol"] == "Van der Pol oscillator with bounded control"
    assert not Shelf(None, MOST).own()


def test_titles_are_those_that_a_problem_has() -> None:
    shelf = Shelf(None, MOST)
    for entry in shelf.library():
        problem = load_text(shelf.read("library", entry.name), entry.name)
        assert entry.title == problem.title


# Reading


def test_a_problem_is_read_by_name(shelf: Shelf) -> None:
    assert shelf.read("folder", "cart.yaml") == TEXT
    text = shelf.read("library", "van_der_pol")
    assert text.startswith("title: Van der Pol")
    assert "yaml-language-server" not in text
    assert load_text(template(), "new.yaml").title == "A cart with a weak motor"


@pytest.mark.parametrize("name", OUTSIDE)
def test_nothing_outside_can_be_read(shelf: Shelf, name: str) -> None:
    places: tuple[PlaceName, ...] = ("folder", "library")
    for place in places:
        with pytest.raises(UsageError) as refused:
            shelf.read(place, name)
        assert "\0" not in str(refused.value)
        assert len(str(refused.value)) < 400


@pytest.mark.parametrize("name", ["link.yaml", "loop.yaml", "pipe.yaml", "folder.yaml", "no.yaml"])
def test_what_is_no_plain_file_is_not_there(shelf: Shelf, name: str) -> None:
    with pytest.raises(UsageError, match="there is no problem file"):
        shelf.read("folder", name)


def test_a_folder_swapped_for_a_link_stays_the_folder_it_was(shelf: Shelf, folder: Path) -> None:
    elsewhere = folder.with_name("elsewhere")
    elsewhere.mkdir()
    (elsewhere / "secret.yaml").write_text("title: secret\n")
    folder.rename(folder.with_name("moved"))
    folder.symlink_to(elsewhere)
    with pytest.raises(UsageError, match="there is no problem file"):
        shelf.read("folder", "secret.yaml")
    assert shelf.read("folder", "cart.yaml") == TEXT


def test_what_is_too_large_or_no_text_is_refused(shelf: Shelf, folder: Path) -> None:
    (folder / "large.yaml").write_bytes(b"#" * (MOST + 1))
    (folder / "full.yaml").write_bytes(b"#" * MOST)
    (folder / "binary.yaml").write_bytes(b"\xff\xfe\x00")
    assert len(shelf.read("folder", "full.yaml")) == MOST
    with pytest.raises(UsageError, match="too large"):
        shelf.read("folder", "large.yaml")
    with pytest.raises(UsageError, match="UTF-8"):
        shelf.read("folder", "binary.yaml")


def test_what_is_no_folder_is_refused(folder: Path) -> None:
    with pytest.raises(UsageError, match="it is no folder"):
        Shelf(folder / "cart.yaml", MOST)
    with pytest.raises(UsageError, match="cannot be opened"):
        Shelf(folder / "nowhere", MOST)


# Saving


def test_a_problem_is_saved_and_replaced_only_when_asked(shelf: Shelf, folder: Path) -> None:
    assert shelf.writable
    assert shelf.save("new", TEXT, replace=False) == "new.yaml"
    assert shelf.read("folder", "new.yaml") == TEXT
    with pytest.raises(ThereAlreadyError, match=r"new\.yaml is there already"):
        shelf.save("new.yaml", "other", replace=False)
    assert shelf.read("folder", "new.yaml") == TEXT
    assert shelf.save("new.yaml", "other\n", replace=True) == "new.yaml"
    assert shelf.read("folder", "new.yaml") == "other\n"
    assert not [path for path in folder.iterdir() if path.name.startswith(".")]


def test_a_file_keeps_its_bytes_when_its_successor_cannot_be_written(
    shelf: Shelf, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*args: object, **kwargs: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(UsageError, match="No space left"):
        shelf.save("cart.yaml", "half", replace=True)
    assert (folder / "cart.yaml").read_text() == TEXT
    assert not [path for path in folder.iterdir() if path.name.startswith(".")]


@pytest.mark.parametrize("name", [name for name in OUTSIDE if name != "result.h5"])
def test_nothing_outside_can_be_written(shelf: Shelf, tmp_path: Path, name: str) -> None:
    def everything() -> list[tuple[Path, float]]:
        files = [path for path in tmp_path.rglob("*") if stat.S_ISREG(path.lstat().st_mode)]
        return sorted((path, path.stat().st_mtime_ns) for path in files)

    before = everything()
    for replace in (False, True):
        with pytest.raises(UsageError):
            shelf.save(name, TEXT, replace=replace)
    assert everything() == before


def test_a_link_is_replaced_itself_not_what_it_points_to(
    shelf: Shelf, folder: Path, tmp_path: Path
) -> None:
    with pytest.raises(ThereAlreadyError):
        shelf.save("link.yaml", TEXT, replace=False)
    shelf.save("link.yaml", TEXT, replace=True)
    assert not (folder / "link.yaml").is_symlink()
    assert (tmp_path / "secret.yaml").read_text() == "title: secret\n"
    with pytest.raises(UsageError, match="is a folder"):
        shelf.save("folder.yaml", TEXT, replace=True)


def test_a_new_file_is_there_whole_or_not_at_all(
    shelf: Shelf, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    for name in ("link", "replace", "rename"):
        monkeypatch.setattr(os, name, interrupted)
    with pytest.raises(KeyboardInterrupt):
        shelf.save("late", TEXT, replace=False)
    assert not (folder / "late.yaml").exists()


def test_a_new_file_is_saved_where_there_are_no_hard_links(
    shelf: Shelf, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: object, **__: object) -> None:
        raise OSError(errno.EPERM, os.strerror(errno.EPERM))

    monkeypatch.setattr(os, "link", refused)
    shelf.save("new", TEXT, replace=False)
    with pytest.raises(ThereAlreadyError):
        shelf.save("new", "other", replace=False)
    assert (folder / "new.yaml").read_text("utf-8") == TEXT


def test_what_cannot_be_read_again_is_not_saved(shelf: Shelf) -> None:
    with pytest.raises(UsageError, match="too large"):
        shelf.save("a", "#" * (MOST + 1), replace=False)
    with pytest.raises(UsageError, match="UTF-8"):
        shelf.save("a", "\ud800", replace=False)
    with pytest.raises(UsageError, match="quito gui FOLDER"):
        Shelf(None, MOST).save("a", TEXT, replace=False)


# Uploads


@pytest.mark.parametrize(
    ("filename", "name"),
    [
        ("rocket.yaml", "rocket.yaml"),
        ("Rocket.YML", "Rocket.yaml"),
        ("../../etc/passwd", "passwd.yaml"),
        ("C:\\files\\my rocket (2).yaml", "my_rocket_2.yaml"),
        ("con.yaml", "problem.yaml"),
        ("", "problem.yaml"),
        ("....", "problem.yaml"),
        ("\0\n", "problem.yaml"),
        ("x" * 500, "x" * 95 + ".yaml"),
        ("日本.yaml", "problem.yaml"),
    ],
)
def test_an_upload_gets_a_name_that_is_one(filename: str, name: str) -> None:
    assert uploaded(filename, b"\xef\xbb\xbfstates: {}", MOST) == (name, "states: {}")
    assert not objection(name)


def test_an_upload_that_is_too_large_or_no_text_is_refused() -> None:
    with pytest.raises(UsageError, match="too large"):
        uploaded("a.yaml", b"#" * (MOST + 1), MOST)
    with pytest.raises(UsageError, match="UTF-8"):
        uploaded("a.yaml", b"\xff", MOST)
