"""The text of a problem file -> plain data that knows where it stands.

YAML is read strictly: a file means what it seems to mean, or is refused. Numbers, booleans and null
are those of the YAML 1.2 core schema, so that `1e-3` is a number and `yes`, `1:30` or `017` are
text; a key occurs once; tags, anchors and aliases are refused, and with them anything that builds
objects or grows when it is loaded. The data is made from the parser's events, not by its
constructors, which have none of these rules and forget every position.

Expressions make one trap of YAML common: inside braces and brackets a comma or a bracket ends an
unquoted value, so `{x: min(a, b)}` is read as two keys, and `{x: u[0]}` not at all. Both are found
here, where the text is at hand to show what should be quoted.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import islice
from typing import Any, NamedTuple

import yaml

from quito_cli.problem.text.complaints import Complaint, ProblemError, plain_words
from quito_cli.problem.text.source import Node, Source

_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_LONGEST = 1_000_000  # characters of a file
_DEEPEST = 20  # levels of nesting; a problem file has six
_EXPRESSION = 10_000  # characters of an expression that flow style cuts short
_SHORT = 60  # characters of a text quoted in a message
_DIGITS = 300  # of an integer; a longer one may not fit a float
_REREADINGS = 20  # of a text whose expressions break its syntax: as many as are printed

_UNREADABLE = yaml.reader.Reader.NON_PRINTABLE

_SECOND = "a second document begins here: a file holds only one"
_REPEAT = "repeat the value, or name it under constants"

_INTEGER = re.compile(r"[-+]?(?:0|[1-9][0-9]*)")
_REAL = re.compile(
    r"(?![-+]?0[0-9]+\Z)[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?"
    r"|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)"
)
_WORDS: dict[str, bool | None] = dict.fromkeys(("", "~", "null", "Null", "NULL"))
_WORDS |= dict.fromkeys(("true", "True", "TRUE"), True)
_WORDS |= dict.fromkeys(("false", "False", "FALSE"), False)

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


def _resolve(written: str) -> str | int | float | bool | None:
    """A plain scalar by the core schema of YAML 1.2, without octal and hexadecimal numbers."""
    if written in _WORDS:
        return _WORDS[written]
    if _INTEGER.fullmatch(written) and len(written) <= _DIGITS:
        return int(written)
    if not _REAL.fullmatch(written):
        return written
    return float(written.replace(".", "") if written[-1] in "fFnN" else written)


def _extent(text: str, start: int) -> tuple[int, bool]:
    """Where an expression in flow style would end if it were quoted, and if its brackets match."""
    awaited: list[str] = []
    end = min(len(text), start + _EXPRESSION)
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


def _start(event: yaml.Event) -> int:
    return event.start_mark.index if event.start_mark else 0


def _end(event: yaml.Event) -> int:
    return event.end_mark.index if event.end_mark else 0


class _Halt(Exception):  # noqa: N818 - a signal within this module
    """Nothing that follows in the text can be made sense of."""


class _Cut(NamedTuple):
    """A stretch of text that was complained of as a whole: nothing in it is said twice."""

    start: int
    stop: int
    closed: bool


class _Role(NamedTuple):
    """What an expression is in the braces or brackets around it, and how to write it there."""

    name: str
    before: str
    after: str


_NAME = _Role("name inside braces", "{", ": ...}")
_ENTRY_OF_LIST = _Role("entry inside brackets", "[", "]")


def _value_of(key: str) -> _Role:
    return _Role("value inside braces", f"{{{_short(key)}: ", "}")


class _Reader:
    """One pass over the events of a text: its nodes, and what is wrong with them."""

    def __init__(self, text: str, source: Source) -> None:
        self.text = text
        self.source = source
        self.events: Iterator[yaml.Event] = yaml.parse(text, Loader=_LOADER)
        self.complaints: list[Complaint] = []
        self.cut = _Cut(0, 0, True)
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
            node.data = event.value if node.style else _resolve(event.value)
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
                self.check(event, _ENTRY_OF_LIST)
            child = node.children[len(node.data)] = self.node(event, depth)
            node.data.append(child.data)

    def mapping(self, node: Node, flow: bool, depth: int) -> None:
        node.data = {}
        while not isinstance(event := next(self.events), yaml.MappingEndEvent):
            start = _start(event)
            if flow:
                self.check(event, _NAME)
            key = self.key(event, depth)
            value = next(self.events)
            if flow:
                self.check(value, _value_of(key or "..."))
            child = self.node(value, depth)
            child.key = start
            if key is None:
                continue
            if (first := node.children.get(key)) and first.key is not None:
                line = self.source.place(first.key).line
                message = f"duplicate key {_short(key)!r}: it is given in line {line} already"
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

    def check(self, event: yaml.Event, role: _Role) -> None:
        """Look at a plain scalar in flow style: is it all of what was meant?"""
        start = _start(event)
        plain = isinstance(event, yaml.ScalarEvent) and not event.style and event.value
        if plain and start >= self.cut.stop and self.text[start] not in "&!":
            self.check_extent(start, role)

    def check_extent(self, start: int, role: _Role) -> None:
        """Complain of an expression that flow style ends early, with what to write instead."""
        stop, closed = _extent(self.text, start)
        early = _CUT.search(self.text, start, stop)
        if closed and early is None:
            return
        expression = self.text[start:stop].rstrip()
        if early and closed:
            what = "comma" if early[0] == "," else repr(early[0])
            quote = "'" if '"' in expression else '"'
            sample = f"{quote}{_short(expression)}{quote}"
            remedy = f"{role.before}{sample}{role.after}"
            message = f"the {what} ends this {role.name}: quote the expression, {remedy}"
        else:
            message = (
                f"the brackets of this {role.name} do not match: close them, or quote the text"
            )
        self.complain(start, message, len(expression))
        self.cut = _Cut(start, stop, closed)

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
        if not self.flow and not _FLOW.search(self.text, begin, index):
            return
        for match in _ENTRY.finditer(self.text, begin, index):
            start = match.start("value")
            stop, _ = _extent(self.text, start)
            if index < stop and _CUT.search(self.text, start, index):
                if name := match["name"]:
                    self.check_extent(start, _value_of(name))
                else:
                    self.check_extent(start, _ENTRY_OF_LIST)
                return


def _short(text: str) -> str:
    words = " ".join(text.split())
    return words if len(words) <= _SHORT else words[: _SHORT - 3] + "..."
