"""What is wrong with a problem file, and how it is said.

A person mends a file fastest when every mistake is shown at once, each at its line and column with
the text in sight. A stage that finds mistakes collects `Complaint`s, says where in the data each
one belongs, and raises a single `ProblemError`, which finds the places and prints:

    problems/vdp.yaml:12:15: unknown name 'x3'; did you mean 'x1'?
       12 |   x2: mu*(1 - x3^2)
          |               ^~
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from difflib import SequenceMatcher
from typing import Protocol

from quito_cli.errors import UsageError

Path = tuple[str | int, ...]

_PRINTED = 20  # complaints; who reads more than that mends the first ones first
_WIDTH = 100  # characters of a line shown around a caret
_COMPARED = 100  # characters of a name looked at for a suggestion: the comparison is quadratic


@dataclass(frozen=True, order=True)
class Position:
    """A place in a text as editors count it: line and column from 1."""

    line: int
    column: int


@dataclass(frozen=True)
class Complaint:
    """One mistake, at a path of the data, or at a position of the text where that is known.

    `offset` counts characters into the text value at `path`, `length` is how many of them are
    underlined, and `key` moves the complaint from a value to its name.
    """

    path: Path | None
    message: str
    offset: int | None = None
    length: int = 1
    key: bool = False
    position: Position | None = None


class Locator(Protocol):
    """What finds paths in a text: `quito_cli.problem.text.source.Source`, seen from below it."""

    @property
    def name(self) -> str:
        """The file's name as the user typed it."""

    def position(self, path: Path, offset: int | None = None, *, key: bool = False) -> Position:
        """Where the value at `path`, or its key, stands."""

    def line(self, number: int) -> str:
        """The text of a line."""


class ProblemError(UsageError):
    """A problem that cannot be read, with every complaint about it.

    `complaints` are sorted by place, and carry their positions where there is a source; a problem
    built in Python has none, and its complaints name the path instead.
    """

    def __init__(
        self, complaints: Iterable[Complaint], source: Locator | None, note: str = ""
    ) -> None:
        located = [_located(complaint, source) for complaint in complaints]
        self.complaints = tuple(sorted(located, key=_order))
        self.source = source
        blocks = [_shown(complaint, source) for complaint in self.complaints[:_PRINTED]]
        if len(self.complaints) > _PRINTED:
            blocks.append(f"... and {len(self.complaints) - _PRINTED} more")
        self.note = note
        super().__init__("\n".join([note, *blocks] if note else blocks))

    def __reduce__(self) -> tuple[object, ...]:
        # Workers of a batch hand their errors back pickled, and an exception's own way passes on
        # the message alone.
        return type(self), (self.complaints, self.source, self.note)


def suggest(name: str, known: Iterable[str]) -> str:
    """`"; did you mean 'x'?"` for the known name nearest to `name`, or nothing where none is near.

    Short names differ in half of their letters by one slip (x3 for x1), so less is asked of them.
    The first of equally near names wins: the order of the file is the likeliest.
    """
    wanted = name[:_COMPARED].casefold()
    matcher = SequenceMatcher(autojunk=False)
    matcher.set_seq2(wanted)
    best, score = "", 0.5 if len(wanted) <= 3 else 0.6
    for candidate in known:
        matcher.set_seq1(candidate[:_COMPARED].casefold())
        if matcher.real_quick_ratio() < score or (best and matcher.quick_ratio() <= score):
            continue
        ratio = matcher.ratio()
        if ratio > score or (ratio == score and not best):
            best, score = candidate, ratio
    return f"; did you mean {best!r}?" if best else ""


def _located(complaint: Complaint, source: Locator | None) -> Complaint:
    if source is None or complaint.path is None or complaint.position is not None:
        return complaint
    place = source.position(complaint.path, complaint.offset, key=complaint.key)
    return replace(complaint, position=place)


def _order(complaint: Complaint) -> Position:
    return complaint.position or Position(0, 0)


def _shown(complaint: Complaint, source: Locator | None) -> str:
    place, message = complaint.position, _printable(complaint.message)
    if source is None:
        path = _dotted(complaint.path or ())
        return f"{path}: {message}" if path else message
    if place is None:
        return f"{source.name}: {message}"
    excerpt, column, room = _window(_printable(source.line(place.line)), place.column - 1)
    underline = "^" + "~" * (min(complaint.length, room) - 1)
    number = f"{place.line:>5} |"
    return (
        f"{source.name}:{place.line}:{place.column}: {message}\n{number} {excerpt}".rstrip()
        + f"\n{'|':>{len(number)}} {' ' * column}{underline}"
    )


def _dotted(path: Path) -> str:
    """`states.x.initial[2]`, as one would write it in Python."""
    steps = (f"[{step}]" if isinstance(step, int) else f".{step}" for step in path)
    return "".join(steps).removeprefix(".")


def _printable(line: str) -> str:
    """The text, character for character, without what would move or colour a terminal's text."""
    return "".join(c if c.isprintable() else " " if c.isspace() else "\ufffd" for c in line)


def _window(line: str, column: int) -> tuple[str, int, int]:
    """A short enough piece of a line around a column, the column there, and the room after it."""
    first = max(0, min(column - _WIDTH // 2, len(line) - _WIDTH))
    last = min(len(line), first + _WIDTH)
    head = "..." if first > 0 else ""
    tail = "..." if last < len(line) else ""
    return head + line[first:last] + tail, column - first + len(head), last - column


# What PyYAML and libyaml say (the two differ in words), and what a person can do about it. The
# first row that is found in "context: problem, where on the line" counts.
_SYNTAX = (
    (r"tab character|'\\t'", "a tab cannot indent a line: use spaces"),
    (r"cannot start any token", "a value cannot begin with {found}: quote it"),
    (r"find expected ':'", "expected 'name: value', but there is no ': ' in this line"),
    (
        r"sequence entries are not allowed",
        "'- ' begins a list entry, which cannot stand here: quote the expression, or write"
        " the minus sign without the blank after it",
    ),
    (
        r"mapping values are not allowed",
        "a ':' cannot stand here: quote a text that holds one, or check the indentation",
    ),
    (r"unexpected ':'", "a blank must follow this ':'"),
    (r"mapping keys are not allowed", "'? ' cannot stand here: quote the text"),
    (r"unexpected end of stream", "the quote opened in line {opened} is never closed"),
    (
        r"unexpected document (indicator|separator)",
        "the quote opened in line {opened} is not closed before this line of '---' or '...'",
    ),
    (r"escape|hexad|hexdec", "unknown escape inside double quotes: use single quotes instead"),
    (
        r"block scalar",
        "a value that begins with '>' or '|' is a block of text to YAML: quote the expression",
    ),
    (
        r"scanning an (anchor|alias)",
        "a value that begins with '*' or '&' is an alias or anchor to YAML: quote the expression",
    ),
    (r" tag", "a value that begins with '!' is a tag to YAML: quote the text"),
    (r"directive|incompatible", "a line that begins with '%' is a YAML directive: remove it"),
    (
        r"flow sequence.*expected ','",
        "expected ',' or ']' in the list opened in line {opened}, but found {found}",
    ),
    (
        r"flow mapping.*expected ','",
        "expected ',' or '}}' in the braces opened in line {opened}, but found {found}",
    ),
    (r"(node content|block mapping).*, found ':'", "a name is missing before this ':'"),
    (r"node content", "expected a value, but found {found}"),
    (
        r"(block (mapping|collection)|<document start>).*within",
        "nothing can follow a closing quote or bracket: quote the whole expression",
    ),
    (
        r"block collection",
        "expected '- ', as in the list that begins in line {opened}: check the indentation",
    ),
    (
        r"block mapping",
        "expected 'name: value', indented as in line {opened}: check the indentation",
    ),
    (r"<document start>", "nothing can follow what stands above: check the indentation"),
)


def plain_words(problem: str, *, found: str, opened: int, within: bool) -> str:
    """Say what a YAML parser's error means to somebody who does not know how YAML is parsed.

    `problem` is the parser's own "context: problem", `found` the character it stopped at, `opened`
    the line where the construct began, and `within` tells whether text stands before the spot on
    its line.
    """
    situation = f"{problem}, found {found!r} {'within' if within else 'first on'} the line"
    shown = "the end of the file"
    if found:
        shown = "the end of the line" if found.isspace() else repr(found)
    for pattern, sentence in _SYNTAX:
        if re.search(pattern, situation):
            return sentence.format(found=shown, opened=opened)
    return "this is not YAML: check the quotes, brackets and indentation here"
