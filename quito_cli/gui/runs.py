"""The runs of a session: the present one, five earlier ones to lay over it, and their table.

Older ones are dropped with their files, but for those that were taken away: who has downloaded a
run may want it again.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

MOST_RUNS: Final = 5
"""Earlier ones that are kept, besides those that were taken away."""
_UNKNOWN: Final = "–"


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
    """Of its answer: what `quito solve --json` prints."""

    @property
    def label(self) -> str:
        """`2: rocket, steps 300`."""
        settings = (f"{_plain(name)} {_text(value)}" for name, value in self.given.items())
        return ", ".join([f"{self.number}: {self.name}", *settings])


class Runs:
    """The runs of one session, by age."""

    def __init__(self) -> None:
        self._runs: dict[str, Run] = {}
        self._taken: set[str] = set()

    def add(self, run: Run) -> tuple[str, ...]:
        """Keep a run; return the jobs that are dropped for it, to be dropped at the desk too."""
        self._runs[run.job] = run
        loose = [job for job in self._runs if job not in self._taken and job != run.job]
        dropped = tuple(loose[: max(len(loose) - MOST_RUNS, 0)])
        for job in dropped:
            self.remove(job)
        return dropped

    def taken(self, job: str) -> None:
        """Note that a run was downloaded: it is not dropped by itself."""
        if job in self._runs:
            self._taken.add(job)

    def remove(self, job: str) -> None:
        """Forget a run."""
        self._runs.pop(job, None)
        self._taken.discard(job)

    def kept(self) -> tuple[Run, ...]:
        """Return the runs, the oldest first."""
        return tuple(self._runs.values())

    def table(self) -> tuple[tuple[str, ...], tuple[tuple[str, ...], ...]]:
        """Return heads and rows as text: settings that were given in any run, and figures."""
        runs = self.kept()
        names = dict.fromkeys(name for run in runs for name in run.given)
        heads = ("run", "problem", *map(_plain, names), *_FIGURES)
        return heads, tuple(_row(run, tuple(names)) for run in runs)


def _row(run: Run, names: tuple[str, ...]) -> tuple[str, ...]:
    """Return a run as text; a setting that means nothing to it is not known."""
    options = run.figures.get("options", {})
    settings = (_text(options.get(name, run.given.get(name))) for name in names)
    figures = (figure(run.figures) for figure in _FIGURES.values())
    return (str(run.number), run.name, *settings, *figures)


def _plain(name: str) -> str:
    return name.replace("_", " ")


def _text(value: Any) -> str:
    if value is None:
        return _UNKNOWN
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:g}" if isinstance(value, float) else str(value)


def _number(name: str, form: str) -> Callable[[Mapping[str, Any]], str]:
    """Return what writes a figure, or the sum of one by control."""

    def written(figures: Mapping[str, Any]) -> str:
        value = figures.get(name)
        if isinstance(value, Mapping):
            values = list(value.values())
            value = None if None in values or not values else math.fsum(values)
        return _UNKNOWN if value is None else format(value, form)

    return written


def _seconds(figures: Mapping[str, Any]) -> str:
    parts = [figures.get(f"{name}_seconds") for name in ("build", "solve")]
    known = [part for part in parts if part is not None]
    return f"{sum(known):.2g}" if known else _UNKNOWN


_FIGURES: Final[Mapping[str, Callable[[Mapping[str, Any]], str]]] = {
    "status": lambda figures: str(figures.get("status", _UNKNOWN)).replace("_", " "),
    "cost": _number("cost", ".9g"),
    "cells": _number("steps", "d"),
    "iterations": _number("iterations", "d"),
    "violation": _number("maximum_violation", ".1e"),
    "gap": _number("resimulation_gap", ".1e"),
    "variation": _number("total_variation", ".4g"),
    "seconds": _seconds,
}
"""Columns of the table: heads, and how the figure of an answer is written."""
