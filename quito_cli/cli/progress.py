"""The live line of a solve: on a terminal, and nowhere else."""

from __future__ import annotations

import shutil
import sys
from typing import TYPE_CHECKING, Self

if TYPE_CHECKING:
    from quito_cli.solvers.outcome import Listener, Progress


class ProgressLine:
    """One line on stderr, rewritten at every iteration; one line each when asked for."""

    def __init__(self, *, quiet: bool, every_line: bool) -> None:
        self._every_line = every_line and not quiet
        self._live = sys.stderr.isatty() and not quiet and not self._every_line
        self._shown = False
        self.heading = ""
        """What is solved, where it is one of several."""

    @property
    def listener(self) -> Listener | None:
        """What the solver is to call; None where nothing is shown."""
        return self._show if self._live or self._every_line else None

    def _show(self, progress: Progress) -> None:
        digits = 5 if progress.stage else 9  # the line is not to be wider than a terminal
        parts = [
            f"{self.heading}{progress.stage}{'  ' if progress.stage else ''}"
            f"iteration {progress.iteration:4d}",
            f"cost {progress.cost: .{digits}e}",
            f"violation {progress.violation:.2e}",
        ]
        if self._every_line:
            print("   ".join(parts), file=sys.stderr)
            return
        room = shutil.get_terminal_size().columns - 1
        while len(parts) > 1 and len("   ".join(parts)) > room:
            parts.pop()  # a line that does not fit would not go away
        print(f"\r{'   '.join(parts)[:room]}\x1b[K", end="", file=sys.stderr, flush=True)
        self._shown = True

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._shown:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)
