"""What the page keeps for each browser tab: it outlives a reload, and ends with the tab.

NiceGUI makes a new client at every load of the page, but knows the tab it is in. A tab without a
client may be reloading, or asleep; after `LINGER` seconds it is taken for closed, and its results
and solves are dropped. Its text is in the browser too, and comes back with it.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from quito_cli.gui.checking import Checker
from quito_cli.gui.desk import Desk
from quito_cli.gui.exports import Exporter
from quito_cli.gui.job import Request
from quito_cli.gui.runs import Run, Runs
from quito_cli.gui.shelf import Shelf

LINGER = 3600.0
"""Seconds that what belongs to a tab is kept without it."""
_LONGEST_NAME = 200
_MOST_ASIDE = 5
Place = Literal["library", "folder", "own"]


@dataclass(frozen=True)
class Draft:
    """What is being worked on."""

    name: str
    """As the shelf has it: with an ending, except in the library."""
    place: Place
    """Where it was read; what was edited since has a place of its own no more."""
    text: str
    chosen: Mapping[str, Any]
    """Settings that were changed, by name."""

    @property
    def stem(self) -> str:
        """The name without its ending."""
        return self.name.removesuffix(".yaml").removesuffix(".yml")

    @property
    def about(self) -> dict[str, Any]:
        """All but the text, as the browser keeps it beside the text."""
        return {"name": self.name, "place": self.place, "chosen": dict(self.chosen)}


def draft_of(kept: object, most: int) -> Draft | None:
    """Return what a browser has kept; None where that is no draft, or one of an older page."""
    if not isinstance(kept, dict):
        return None
    name, place, text = (kept.get(key) for key in ("name", "place", "text"))
    chosen = kept.get("chosen")
    if not (isinstance(name, str) and isinstance(text, str)):
        return None
    if place not in ("library", "folder", "own"):
        return None
    if not name or len(name) > _LONGEST_NAME or len(text) > most or not isinstance(chosen, dict):
        return None
    plain = {k: v for k, v in chosen.items() if isinstance(v, str | int | float | bool)}
    return Draft(name, place, text, plain)


@dataclass
class Tab:
    """What one browser tab works on."""

    session: str
    """Its name at the desk."""
    client: str = ""
    """The page that is shown in it now."""
    draft: Draft | None = None
    aside: dict[str, Draft] = field(default_factory=dict)
    """What was edited and not saved before another problem was opened, by name."""
    runs: Runs = field(default_factory=Runs)
    count: int = 0
    """Runs so far."""
    requests: dict[str, Request] = field(default_factory=dict)
    """What was asked for, by job."""
    asked: str | None = None
    """The job that was submitted last, until its end has been seen."""
    shown: str | None = None
    """The job whose answer is seen."""
    overlaid: list[str] = field(default_factory=list)
    """Jobs laid over it."""
    compared: str | None = None
    """The job of the last comparison."""

    def put_aside(self, draft: Draft) -> None:
        """Keep a draft to be brought back; of many the last."""
        self.aside.pop(draft.name, None)
        self.aside[draft.name] = replace(draft, place="own")
        while len(self.aside) > _MOST_ASIDE:
            del self.aside[next(iter(self.aside))]

    def run(self, job: str | None) -> Run | None:
        """Return the run of that job; None where it is not kept."""
        return next((run for run in self.runs.kept() if run.job == job), None)


class Tabs:
    """The tabs of a server."""

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        self._tabs: dict[str, Tab] = {}
        self._clients: dict[str, set[str]] = {}
        self._left: dict[str, float] = {}

    def come(self, name: str, client: str) -> Tab:
        """Return the tab of that name, a new one where it is not known; a client shows it."""
        self.sweep()
        self._left.pop(name, None)
        self._clients.setdefault(name, set()).add(client)
        tab = self._tabs.setdefault(name, Tab(name))
        tab.client = client
        return tab

    def go(self, name: str, client: str) -> None:
        """Note that a client is gone: the page was left, or is loaded anew."""
        clients = self._clients.get(name, set())
        clients.discard(client)
        if not clients:
            self._left[name] = time.monotonic()

    def sweep(self) -> None:
        """Drop what belongs to tabs that have been gone for long."""
        now = time.monotonic()
        for name in [name for name, left in self._left.items() if now - left > LINGER]:
            del self._left[name]
            self._clients.pop(name, None)
            self._tabs.pop(name, None)
            self._desk.leave(name)


@dataclass(frozen=True)
class Services:
    """What the page stands on."""

    desk: Desk
    checker: Checker
    exporter: Exporter
    shelf: Shelf
    tabs: Tabs
    most_characters: int
    """Of a problem's text."""
