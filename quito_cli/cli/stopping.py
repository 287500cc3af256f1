"""Ctrl-C in a run of many cases: what is kept, and how to go on, whenever it comes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Self

import typer

from quito_cli.cli.solve import INTERRUPTED

if TYPE_CHECKING:
    from quito_cli.cli.live import Live


class Stopping:
    """A block in which Ctrl-C ends the command with a word, and with exit code 130.

    While cases are solved, it only asks them to stop, and the command goes on to tell of what is
    done; `leave` ends it then. At any other time it raises.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.live: Live | None = None
        """The lines of the run, as soon as there are any."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is KeyboardInterrupt:
            self.leave()

    def leave(self) -> None:
        """Say what is kept, and end the command."""
        typer.echo(f"Interrupted; {self._sentence()}.", err=True)
        raise typer.Exit(INTERRUPTED)

    def _sentence(self) -> str:
        live = self.live
        if live is None:
            return "no case had begun, and nothing is written"
        if not live.solved:
            return f"none of {live.cases} cases was done: the same command begins anew"
        if live.solved == live.cases:
            return (
                f"all {live.cases} cases are done and kept in {self._folder}: the same command "
                "with --resume writes the rest, and solves none again"
            )
        return (
            f"{live.solved} of {live.cases} cases are done and kept in {self._folder}: the same "
            "command with --resume goes on"
        )
