"""A text with plain data read from it, which knows where everything in it stands."""

from __future__ import annotations

import re
from bisect import bisect_right
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from quito_cli.problem.text.complaints import Path, Position

_BREAK = re.compile(r"\r\n|[\n\r\x85\u2028\u2029]")
BLANK = " \t\n\r\x85\u2028\u2029"

# One match is what one character of a value is written as. Only those that are not blank (`solid`)
# survive YAML's folding of lines, so positions are found by counting them.
_WRITTEN = {
    "'": re.compile(rf"[{BLANK}]|(?P<solid>''|.)"),
    '"': re.compile(
        rf"[{BLANK}]|\\(?:[tnrNLP{BLANK}]|(?:x|u00|U000000)(?:09|0[aAdD]|20|85)|(?:u|U0000)202[89])"
        r"|(?P<solid>\\x..|\\u.{4}|\\U.{8}|\\.|.)"
    ),
    "": re.compile(rf"[{BLANK}]|(?P<solid>.)"),
}


@dataclass(slots=True)
class Node:
    """A value and where it stands: indices into the text, which count characters from 0."""

    start: int
    end: int
    data: Any
    written: str | None = None  # of a scalar: its characters before they are read as a number
    style: str = ""  # of a scalar: ' " | > or nothing
    key: int | None = None
    children: dict[str | int, Node] = field(default_factory=dict)


@dataclass(frozen=True)
class Source:
    """A text that has been read: plain data, and the place of every value and key of it."""

    name: str
    text: str
    data: dict[str, Any]
    _root: Node = field(repr=False, compare=False)

    def position(self, path: Path, offset: int | None = None, *, key: bool = False) -> Position:
        """Where the value at `path` stands, or its key; for want of it, its nearest ancestor.

        `offset` counts characters into the value as YAML hands it out, unquoted and unfolded; it
        is disregarded for keys, for ancestors, and for values that are no text.
        """
        node = self._root
        for step in path:
            child = node.children.get(step)
            if child is None:
                offset = None
                break
            node = child
        if key and node.key is not None:
            return self.place(node.key)
        if offset is None or node.written is None:
            return self.place(node.start)
        return self.place(self._index(node, node.written, max(offset, 0)))

    def place(self, index: int) -> Position:
        """Line and column of a character of the text, counted from 0."""
        line = bisect_right(self._lines, index)
        return Position(line, index - self._lines[line - 1] + 1)

    def index(self, position: Position) -> int:
        """Return which character of the text, counted from 0, stands at a place in it."""
        return self._lines[position.line - 1] + position.column - 1

    def line(self, number: int) -> str:
        """The text of a line, counted from 1; empty outside the text."""
        if not 1 <= number <= len(self._lines):
            return ""
        start = self._lines[number - 1]
        return self.text[start : self._line_end(start)]

    @cached_property
    def _lines(self) -> list[int]:
        return [0, *(match.end() for match in _BREAK.finditer(self.text))]

    def _line_end(self, index: int) -> int:
        found = _BREAK.search(self.text, index)
        return found.start() if found else len(self.text)

    def _index(self, node: Node, written: str, offset: int) -> int:
        """Where character `offset` of a scalar stands in the text.

        Non-blank characters stand in the text in the same order and number as in the value,
        whatever the style; blanks are counted from the character before them.
        """
        start, end = node.start, node.end
        if node.style in ("|", ">"):
            start = self._line_end(start)
        elif node.style:
            start, end = start + 1, end - 1
        pattern = _WRITTEN.get(node.style, _WRITTEN[""])
        solid = [match for match in pattern.finditer(self.text, start, end) if match["solid"]]
        ahead = written[:offset]
        count = sum(character not in BLANK for character in ahead)
        if count < len(solid) and written[offset : offset + 1].strip(BLANK):
            return solid[count].start()
        last = solid[min(count, len(solid)) - 1].end() if count and solid else start
        return min(last + len(ahead) - len(ahead.rstrip(BLANK)), self._line_end(last))
