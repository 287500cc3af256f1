"""What tests of pages and commands share: blocks of pages, commands in this process, a problem."""

from __future__ import annotations

import json
import re
import sys
from dataclasses import dataclass
from typing import Any

import pytest

from quito_cli.cli.app import main

COMMANDS = (
    "solve",
    "compare",
    "batch",
    "sweep",
    "check",
    "list",
    "show",
    "new",
    "plot",
    "generating-functions",
    "solvers",
    "gui",
    "schema",
)


PUSH = """\
title: Push to one
time: {initial: 0, final: 1}
states: {x: {initial: 0, final: 1}}
controls: {u: {lower: -3, upper: 3}}
dynamics: {x: u}
cost: {lagrange: u^2}
"""
"""u = 1 and J = 1."""


@dataclass(frozen=True)
class Ran:
    """What is left of a run."""

    code: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        return json.loads(self.out)


@dataclass(frozen=True)
class Block:
    """A fenced block of a Markdown page."""

    language: str
    text: str
    mark: str
    """The HTML comment on the line before it, without its signs; or nothing."""


def blocks(page: str) -> list[Block]:
    """Return the fenced blocks of a page, in order."""
    fenced = re.compile(r"(?:<!-- ([^\n]*?) -->\n)?^```(\w+)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
    return [Block(found[2], found[3], found[1] or "") for found in fenced.finditer(page)]


def prose(page: str) -> str:
    """Return a page without its fenced blocks."""
    return re.sub(r"^```\w*\n.*?^```$", "", page, flags=re.DOTALL | re.MULTILINE)


def code_spans(page: str) -> list[str]:
    """Return what stands between backquotes in the prose of a page."""
    return [" ".join(span.split()) for span in re.findall(r"`([^`]+)`", prose(page))]


def run(arguments: list[str], monkeypatch: pytest.MonkeyPatch) -> int:
    """Run `quito` with these arguments in this process; return its exit code."""
    monkeypatch.setattr(sys, "argv", ["quito", *arguments])
    try:
        main()
    except SystemExit as left:
        return int(left.code or 0)
    return 0
