"""Expressions that flow style cuts short: what was meant, and what to write instead.

Inside braces and brackets a comma or a bracket ends an unquoted value, so `{x: min(a, b)}` is read
as two keys, and `{x: u[0]}` not at all. Where such an expression would end if it were quoted is
found by counting brackets.
"""

from __future__ import annotations

import re
from typing import NamedTuple

_LONGEST = 10_000  # characters of an expression that flow style cuts short
_SHORT = 60  # characters of a text quoted in a message

_CLOSING = {"(": ")", "[": "]", "{": "}"}
# What can end an expression in flow style, and comments, whose brackets do not count.
_MARK = re.compile(r"[()\[\]{},]|:(?=[\s,\[\]{}]|\Z)|(?<=\s)#[^\n]*")
_CUT = re.compile(r"[,\[\]{}]")
_ENTRY = re.compile(
    r"(?:^|[{\[,])[ \t]*(?:(?P<name>[^\s{}\[\],:\"'][^{}\[\],:\"'\n]*):\s+)?"
    r"(?P<value>[^\s{}\[\],:\"'])",
    re.MULTILINE,
)
_FLOW = re.compile(r"(?:^|:[ \t]|-[ \t])[ \t]*[{\[]", re.MULTILINE)


class Cut(NamedTuple):
    """A stretch of text that was complained of as a whole: nothing in it is said twice."""

    start: int
    stop: int
    closed: bool
    """Whether its brackets match."""


class Role(NamedTuple):
    """What an expression is in the braces or brackets around it, and how to write it there."""

    name: str
    before: str
    after: str


NAME = Role("name inside braces", "{", ": ...}")
ENTRY_OF_LIST = Role("entry inside brackets", "[", "]")


def value_of(key: str) -> Role:
    """Return the role of the value that belongs to a key."""
    return Role("value inside braces", f"{{{short(key)}: ", "}")


def short(text: str) -> str:
    """Return a text as a message quotes it."""
    words = " ".join(text.split())
    return words if len(words) <= _SHORT else words[: _SHORT - 3] + "..."


def cut_short(text: str, start: int, role: Role) -> tuple[Cut, str] | None:
    """Return the expression that flow style ends early and the complaint; None if it does not."""
    stop, closed = _extent(text, start)
    early = _CUT.search(text, start, stop)
    if closed and early is None:
        return None
    if early is None or not closed:
        message = f"the brackets of this {role.name} do not match: close them, or quote the text"
        return Cut(start, stop, closed), message
    expression = text[start:stop].rstrip()
    what = "comma" if early[0] == "," else repr(early[0])
    quote = "'" if '"' in expression else '"'
    remedy = f"{role.before}{quote}{short(expression)}{quote}{role.after}"
    message = f"the {what} ends this {role.name}: quote the expression, {remedy}"
    return Cut(start, stop, closed), message


def cut_before(text: str, begin: int, index: int, *, inside: bool) -> tuple[int, Role] | None:
    """Return where, from `begin` on, a value starts that flow style has cut before `index`.

    `inside` tells that braces or brackets are open at `begin`.
    """
    if not inside and not _FLOW.search(text, begin, index):
        return None
    for match in _ENTRY.finditer(text, begin, index):
        start = match.start("value")
        stop, _ = _extent(text, start)
        if index < stop and _CUT.search(text, start, index):
            name = match["name"]
            return start, value_of(name) if name else ENTRY_OF_LIST
    return None


def _extent(text: str, start: int) -> tuple[int, bool]:
    """Return where an expression would end if it were quoted, and whether its brackets match."""
    awaited: list[str] = []
    end = min(len(text), start + _LONGEST)
    for match in _MARK.finditer(text, start, end):
        mark = match[0]
        if mark in _CLOSING:
            awaited.append(_CLOSING[mark])
        elif awaited and mark == awaited[-1]:
            awaited.pop()
        elif mark == ")":
            return match.end(), False
        elif mark in "]}" or not awaited:
            return match.start(), not awaited
    return end, not awaited
