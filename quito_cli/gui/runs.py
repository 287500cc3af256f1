"""The runs of a session: up to five earlier ones to lay over the present one, and their table."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

MOST_RUNS = 5
"""Kept besides those that were downloaded."""


@dataclass(frozen=True)
class Run:
    """A finished job of the session."""

    job: str
    number: int
    """1, 2, ... in the session; never used again."""
    name: str
    """Of the problem."""
    given: Mapping[str, Any]
    """What was asked for beside the file and the defaults."""
    folder: Path
    figures: Mapping[str, Any]
    """Those of the table: status, cost, iterations, steps, violation, seconds, total variation."""

    @property
    def label(self) -> str:
        """`2: steps 300, variance 1`."""
        raise NotImplementedError


class Runs:
    """The runs of one session; old ones are dropped beyond `MOST_RUNS` and those taken away."""

    def add(self, run: Run) -> tuple[str, ...]:
        """Keep a run; return the jobs that are to be dropped at the desk."""
        raise NotImplementedError

    def taken(self, job: str) -> None:
        """Note that a run was downloaded: it is not dropped by itself."""
        raise NotImplementedError

    def remove(self, job: str) -> None:
        """Forget a run."""
        raise NotImplementedError

    def table(self) -> tuple[tuple[str, ...], tuple[tuple[str, ...], ...]]:
        """Return heads and rows as text: settings that differ between the runs, and figures."""
        raise NotImplementedError
