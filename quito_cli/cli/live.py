"""A run of many cases as it goes: a line for each that has finished, and on a terminal, below them,
a table of those at work.

The lines go to stdout; the table is on stderr, and is taken away before anything else is printed.
"""

from __future__ import annotations

import shutil
import sys
import time
from typing import TYPE_CHECKING, Any, Final, Self

import typer

from quito_cli.cli.text import plain

if TYPE_CHECKING:
    from quito_cli.batch.suite.case import Finished
    from quito_cli.solvers.outcome import Progress

COLOURS: Final = {0: "green", 3: "yellow"}
"""By exit code; red for others."""
_EVERY: Final = 0.1
"""Seconds between two drawings."""
_MOST: Final = 16
"""Cases at work that are shown."""
_WORD: Final = 13
"""Columns of how a case ended."""


class Live:
    """The lines of one run."""

    def __init__(self, cases: int, *, silent: bool, quiet: bool, verbose: bool) -> None:
        self.cases = cases
        """Cases of the run."""
        self.solved = 0
        """Those that are done, and were not interrupted."""
        self._silent, self._quiet, self._verbose = silent, quiet, verbose
        self.moving = sys.stderr.isatty() and sys.stdout.isatty() and not quiet and not silent
        """Whether somebody looks at the cases at work."""
        self._began = time.perf_counter()
        self._at_work: dict[str, tuple[float, Progress | None]] = {}
        self._done = self._failed = self._lines = 0
        self._drawn = 0.0

    def watch(self, name: str, progress: Any) -> None:
        """Note how far a case is; None at its start."""
        started, _ = self._at_work.get(name, (time.perf_counter(), None))
        self._at_work[name] = started, progress

    def show(self, finished: Finished) -> None:
        """Print a case that has finished."""
        self._at_work.pop(finished.case.name, None)
        self._done += 1
        self.solved += finished.ending.name != "INTERRUPTED"
        passed = finished.ending.exit_code == 0
        self._failed += not passed
        if self._silent or (self._quiet and passed):
            return
        self._erase()
        typer.echo("\n".join(lines_of(finished, every_check=self._verbose)))
        sys.stdout.flush()
        self.draw(now=True)

    def draw(self, *, now: bool = False) -> None:
        """Show the cases at work, unless that has just been done."""
        clock = time.perf_counter()
        if not self.moving or (clock - self._drawn < _EVERY and not now):
            return
        self._drawn = clock
        self._erase()
        room = shutil.get_terminal_size().columns - 1
        at_work = list(self._at_work.items())
        lines = [_line(name, clock - started, at) for name, (started, at) in at_work[:_MOST]]
        left = self.cases - self._done
        share = f"{self._done} of {self.cases} done, {self._failed} not passed, {left} to go"
        lines.append(f"{share}   {clock - self._began:.0f} s")
        sys.stderr.write("".join(f"{plain(line)[:room]}\n" for line in lines))
        sys.stderr.flush()
        self._lines = len(lines)

    def _erase(self) -> None:
        if self._lines:
            sys.stderr.write(f"\x1b[{self._lines}A\x1b[J")
            sys.stderr.flush()
            self._lines = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._erase()


def word_of(finished: Finished) -> str:
    """Return how a case ended, in a word or three, in its colour."""
    word = finished.ending.name.lower().replace("_", " ").ljust(_WORD)
    code = finished.ending.exit_code
    return typer.style(word, fg=COLOURS.get(code, "red"), bold=code != 0)


def lines_of(finished: Finished, *, every_check: bool) -> list[str]:
    """Return a finished case as lines: how it ended, and what is not as expected."""
    cost = finished.figures.get("cost")
    said = f"   cost {cost:.8g}" if isinstance(cost, float) else ""
    lines = [f"{word_of(finished)} {plain(finished.case.name)}   {finished.seconds:.2f} s{said}"]
    indent = " " * (_WORD + 1)
    if finished.ending.exit_code not in COLOURS:
        lines += [indent + plain(line) for line in finished.message.splitlines()]
    lines += [
        indent + plain(check.sentence)
        for check in finished.checks
        if every_check or not check.passed
    ]
    return lines


def _line(name: str, seconds: float, at: Progress | None) -> str:
    line = f"{'at work'.ljust(_WORD)} {name}   {seconds:.0f} s"
    if at is None:
        return line
    stage = f"   {at.stage}" if at.stage else ""
    return (
        f"{line}{stage}   iteration {at.iteration}   cost {at.cost:.5e}   viol. {at.violation:.1e}"
    )
