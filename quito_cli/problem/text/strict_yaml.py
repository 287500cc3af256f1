"""The text of a problem file -> plain data that knows where it stands.

YAML is read strictly: a file means what it seems to mean, or is refused. Numbers, booleans and null
are those of YAML 1.2 (`scalars`); a key occurs once; tags, anchors and aliases are refused, and
with them anything that builds objects or grows when it is loaded. The data is made from the
parser's events, not by its constructors, which have none of these rules and forget every position.

Expressions make one trap of YAML common: an unquoted one that braces or brackets cut short. It is
found here (by `flow`), where the text is at hand to show what should be quoted.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import islice
from typing import Any

import yaml

from quito_cli.problem.text.complaints import Complaint, ProblemError, plain_words
from quito_cli.problem.text.flow import (
    ENTRY_OF_LIST,
    NAME,
    Cut,
    Role,
    cut_before,
    cut_short,
    short,
    value_of,
)
from quito_cli.problem.text.scalars import resolve
from quito_cli.problem.text.source import Node, Source

_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_LONGEST = 1_000_000  # characters of a file
_DEEPEST = 20  # levels of nesting; a problem file has six
_REREADINGS = 20  # of a text whose expressions break its syntax: as many as are printed

_UNREADABLE = yaml.reader.Reader.NON_PRINTABLE

_SECOND = "a second document begins here: a file holds only one"
_REPEAT = "repeat the value, or name it under constants"


def read(text: str, name: str) -> Source:
    """Read YAML strictly; every complaint that can be found at once is in the `ProblemError`."""
    text = text.removeprefix("\ufeff")
    blank = Source(name, text, {}, Node(0, 0, {}))
    if len(text) > _LONGEST:
        message = f"the file has {len(text):,} characters; at most {_LONGEST:,} are read"
        raise ProblemError([Complaint(None, message)], blank)
    unreadable = [
        Complaint(None, f"unprintable character {match[0]!r}", position=blank.place(match.start()))
        for match in islice(_UNREADABLE.finditer(text), _REREADINGS)
    ]
    if unreadable:
        raise ProblemError(unreadable, blank)
    found: list[Complaint] = []
    masked = text
    for _ in range(_REREADINGS):
        reader = _Reader(masked, blank)
        root = reader.read()
        if not reader.broken:
            break
        # What stands behind a broken expression is read as if that had been quoted.
        start, stop = reader.cut.start, reader.cut.stop
        masked = f'{masked[:start]}"{"_" * (stop - start - 2)}"{masked[stop:]}'
        found.append(reader.complaints[-1])
    found += reader.complaints
    if found or root is None:
        raise ProblemError(dict.fromkeys(found), blank)
    return Source(name, text, root.data, root)


def _start(event: yaml.Event) -> int:
    return event.start_mark.index if event.start_mark else 0


def _end(event: yaml.Event) -> int:
    return event.end_mark.index if event.end_mark else 0


class _Halt(Exception):  # noqa: N818 - a signal within this module
    """Nothing that follows in the text can be made sense of."""


class _Reader:
    """One pass over the events of a text: its nodes, and what is wrong with them."""

    def __init__(self, text: str, source: Source) -> None:
        self.text = text
        self.source = source
        self.events: Iterator[yaml.Event] = yaml.parse(text, Loader=_LOADER)
        self.complaints: list[Complaint] = []
        self.cut = Cut(0, 0, True)
        self.broken = False  # the parser gave up inside the last cut
        self.flow = 0  # depth of braces and brackets
        self.refused = 0  # depth of keys that are no text: one complaint is enough for each

    def read(self) -> Node | None:
        """The root, or None where the text could not be read to its end."""
        try:
            return self.document()
        except yaml.MarkedYAMLError as error:
            self.syntax(error)
        except _Halt:
            pass
        return None

    def complain(self, index: int, message: str, length: int = 1) -> None:
        """Note a mistake, unless it stands in what has been complained of as a whole."""
        if index >= self.cut.stop and not self.refused:
            place = self.source.place(index)
            self.complaints.append(Complaint(None, message, length=length, position=place))

    def document(self) -> Node | None:
        """The root of the only document, which is a mapping."""
        root = None
        for event in self.events:
            if isinstance(event, yaml.DocumentStartEvent) and root is not None:
                self.complain(_start(event), _SECOND)
                raise _Halt
            if isinstance(event, yaml.NodeEvent):
                root = self.node(event, 0)
        if root is None or (root.written == "" and not root.style):
            self.complain(0, "the file is empty: expected lines such as 'title: My problem'")
        elif not isinstance(root.data, dict):
            kind = "a list" if isinstance(root.data, list) else "a single value"
            message = f"expected lines such as 'title: My problem', but the file is {kind}"
            self.complain(root.start, message)
        return root

    def node(self, event: yaml.Event, depth: int) -> Node:
        """The value that begins with an event; the recursion ends at the cap on nesting."""
        node = Node(_start(event), _end(event), None)
        self.refuse_properties(event)
        if isinstance(event, yaml.ScalarEvent):
            self.refuse_nothing(event)
            node.written, node.style = event.value, event.style or ""
            node.data = event.value if node.style else resolve(event.value)
        elif isinstance(event, yaml.CollectionStartEvent):
            if depth == _DEEPEST:
                self.complain(node.start, f"nested more than {_DEEPEST} levels deep")
                raise _Halt
            self.flow += bool(event.flow_style)
            fill = self.mapping if isinstance(event, yaml.MappingStartEvent) else self.sequence
            fill(node, bool(event.flow_style), depth + 1)
            self.flow -= bool(event.flow_style)
        return node

    def sequence(self, node: Node, flow: bool, depth: int) -> None:
        node.data = []
        while not isinstance(event := next(self.events), yaml.SequenceEndEvent):
            if flow:
                self.check(event, ENTRY_OF_LIST)
            child = node.children[len(node.data)] = self.node(event, depth)
            node.data.append(child.data)

    def mapping(self, node: Node, flow: bool, depth: int) -> None:
        node.data = {}
        while not isinstance(event := next(self.events), yaml.MappingEndEvent):
            start = _start(event)
            if flow:
                self.check(event, NAME)
            key = self.key(event, depth)
            value = next(self.events)
            if flow:
                self.check(value, value_of(key or "..."))
            child = self.node(value, depth)
            child.key = start
            if key is None:
                continue
            if (first := node.children.get(key)) and first.key is not None:
                line = self.source.place(first.key).line
                message = f"duplicate key {short(key)!r}: it is given in line {line} already"
                self.complain(start, message, _end(event) - start)
            else:
                node.children[key], node.data[key] = child, child.data

    def key(self, event: yaml.Event, depth: int) -> str | None:
        """The key that begins with an event, or None where it is refused."""
        if isinstance(event, yaml.ScalarEvent):
            self.refuse_properties(event)
            self.refuse_nothing(event)
            if event.value or event.style:
                return str(event.value)
            self.complain(_start(event), "a name is missing here: expected 'name: value'")
            return None
        if isinstance(event, yaml.AliasEvent):
            self.refuse_properties(event)
            return None
        self.complain(_start(event), "a name must be text, not a list or braces")
        self.refused += 1
        self.node(event, depth)
        self.refused -= 1
        return None

    def refuse_nothing(self, event: yaml.ScalarEvent) -> None:
        """Refuse the character that ends texts in many libraries."""
        if "\0" in event.value:
            self.complain(_start(event), r"the character \0 has no place in a text: remove it")

    def refuse_properties(self, event: yaml.Event) -> None:
        """Refuse what makes YAML more than data: aliases can grow without bound, tags run code."""
        start = _start(event)
        if isinstance(event, yaml.AliasEvent):
            self.refuse(start, "aliases", _REPEAT)
            return
        if getattr(event, "anchor", None) is not None:
            self.refuse(self.text.index("&", start), "anchors", _REPEAT)
        # libyaml does not report the tag "!".
        if getattr(event, "tag", None) is not None or self.text.startswith("!", start):
            self.refuse(self.text.index("!", start), "tags", "remove it, or quote the text")

    def refuse(self, index: int, what: str, remedy: str) -> None:
        word = re.compile(r"[^\s,\[\]{}]*").match(self.text, index)
        length = len(word[0]) if word else 1
        self.complain(index, f"{what} are not read: {remedy}", length)

    def check(self, event: yaml.Event, role: Role) -> None:
        """Look at a plain scalar in flow style: is it all of what was meant?"""
        start = _start(event)
        plain = isinstance(event, yaml.ScalarEvent) and not event.style and event.value
        if plain and start >= self.cut.stop and self.text[start] not in "&!":
            self.check_extent(start, role)

    def check_extent(self, start: int, role: Role) -> None:
        """Complain of an expression that flow style ends early, with what to write instead."""
        if found := cut_short(self.text, start, role):
            cut, message = found
            self.complain(start, message, len(self.text[start : cut.stop].rstrip()))
            self.cut = cut

    def syntax(self, error: yaml.MarkedYAMLError) -> None:
        """Say why the parser gave up, unless an expression that was cut short is the reason."""
        mark = error.problem_mark or error.context_mark
        index = mark.index if mark else 0
        if index >= self.cut.stop + (not self.cut.closed):
            self.find_cut(index)
        if index < self.cut.stop + (not self.cut.closed):
            self.broken = self.cut.closed
            return
        place = self.source.place(index)
        begun = error.context_mark.index if error.context_mark else index
        found = self.text[index : index + 1] if self.text[index:].strip() else ""
        message = plain_words(
            f"{error.context}: {error.problem}",
            found=found,
            opened=self.source.place(begun).line,
            within=bool(self.source.line(place.line)[: place.column - 1].strip()),
        )
        # At the end of the file, or of a line without its colon, there is nothing to mend: the
        # mistake is where the quote, bracket or line begins.
        if not found or "find expected ':'" in str(error.problem):
            place = self.source.place(min(begun, len(self.text.rstrip())))
        self.complaints.append(Complaint(None, message, position=place))

    def find_cut(self, index: int) -> None:
        """Look for an early end on a line that the parser gave up before it handed out a value.

        It reads on for a line or 1024 characters to see whether a ':' makes the value a key.
        """
        begin = max(self.text.rfind("\n", 0, index) + 1, index - 1024, self.cut.stop)
        if found := cut_before(self.text, begin, index, inside=self.flow > 0):
            self.check_extent(*found)
