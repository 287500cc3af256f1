"""Files that a suite may name: problems and other suites.

Suites may come from elsewhere. One can make quito read files whose names end in .yaml or .yml,
wherever they are, and nothing else; what is found in them is checked as anything else is, and
nothing in them names a place to write to. `*` and `?` stand in the last part of a path only, so
that nothing walks through folders.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from quito_cli.problem.library import bundled
from quito_cli.problem.load import ENDINGS
from quito_cli.problem.text.complaints import Complaint, suggest
from quito_cli.problem.text.complaints import Path as Place

WIDEST: Final = 1000
"""Files that a pattern may stand for."""


class Wrong(Exception):  # noqa: N818 - a signal within this package
    """What is wrong with an entry of a suite."""

    def __init__(self, *complaints: Complaint) -> None:
        super().__init__()
        self.complaints = complaints


def problem_of(given: str, folder: Path, place: Place) -> str:
    """Return the absolute path of a problem that a suite names, or the name of a bundled one.

    Args:
        given: as the suite has it.
        folder: where the suite is.
        place: of the name in the suite.

    Raises:
        Wrong: there is none, or it is no file that a suite may name.
    """
    path = folder / given
    if path.is_file():
        _refuse_other_files(path, place)
        return str(path.resolve())
    if given in bundled():
        return given
    beside = [other.name for other in folder.iterdir() if other.suffix in ENDINGS]
    hint = suggest(given, [*bundled(), *beside])
    message = (
        f"there is no file {given} beside the suite, and no bundled problem of that name{hint}"
    )
    raise Wrong(Complaint(place, message, length=len(given)))


def matched(pattern: str, folder: Path, chain: tuple[Path, ...], place: Place) -> Sequence[Path]:
    """Return the files that an include stands for; not those that are including it.

    Args:
        pattern: as the suite has it.
        folder: where the suite is.
        chain: resolved paths of the suite, and of those that include it.
        place: of the pattern in the suite.

    Raises:
        Wrong: there is none, or it is no file that a suite may name.
    """
    *above, last = Path(pattern).parts or ("",)
    wild = "*" in last or "?" in last
    within = folder.joinpath(*above)
    if any("*" in part or "?" in part for part in above) or "**" in last:
        message = "`*` and `?` stand in the name of the file only, not in that of a folder"
        raise Wrong(Complaint(place, message, length=len(pattern)))
    if not wild:
        path = within / last
        if not path.is_file():
            raise Wrong(Complaint(place, f"there is no file {pattern}", length=len(pattern)))
        _refuse_other_files(path, place)
        if path.resolve() in chain:
            raise Wrong(Complaint(place, f"{pattern} includes itself", length=len(pattern)))
        return [path]
    named = sorted(within.glob(last)) if within.is_dir() else []
    found = [p for p in named if _is_meant(p) and p.resolve() not in chain]
    if not found:
        message = f"no problem or suite is called {pattern}"
        raise Wrong(Complaint(place, message, length=len(pattern)))
    if len(found) > WIDEST:
        message = f"{pattern} stands for {len(found)} files, and {WIDEST} are the most"
        raise Wrong(Complaint(place, message, length=len(pattern)))
    return found


def _is_meant(path: Path) -> bool:
    """Whether a pattern means a file: one that a suite may name, and that is not hidden."""
    return path.suffix in ENDINGS and not path.name.startswith(".") and path.is_file()


def _refuse_other_files(path: Path, place: Place) -> None:
    if path.suffix not in ENDINGS:
        message = f"{path.name} is no problem file: those end in .yaml or .yml"
        raise Wrong(Complaint(place, message))
