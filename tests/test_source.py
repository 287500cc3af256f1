"""Problem files as text: strict YAML, positions, and complaints in words."""

from __future__ import annotations

import math
import pickle
from collections.abc import Callable
from contextlib import suppress
from datetime import timedelta
from itertools import pairwise
from typing import Any

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from processor import within

from quito_cli.errors import UsageError
from quito_cli.problem.text import strict_yaml
from quito_cli.problem.text.complaints import Complaint, Position, ProblemError, suggest
from quito_cli.problem.text.source import Source
from quito_cli.problem.text.strict_yaml import read

LOADERS: list[type] = [yaml.SafeLoader]
if hasattr(yaml, "CSafeLoader"):
    LOADERS.append(yaml.CSafeLoader)


@pytest.fixture(params=LOADERS, ids=lambda loader: str(loader.__name__))
def parser(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Both parsers of PyYAML: they differ in words and, here and there, in marks."""
    monkeypatch.setattr(strict_yaml, "_LOADER", request.param)


def refusal(text: str) -> ProblemError:
    with pytest.raises(ProblemError) as caught:
        read(text, "f.yaml")
    return caught.value


def places(text: str) -> list[tuple[int, int]]:
    found = [complaint.position for complaint in refusal(text).complaints]
    return [(place.line, place.column) for place in found if place]


def value(text: str) -> Any:
    return read(f"a: {text}\n", "f.yaml").data["a"]


# What the data is


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("0", 0),
        ("12", 12),
        ("-1", -1),
        ("+2", 2),
        ("-0", 0),
        ("1e-3", 0.001),
        ("1E+3", 1000.0),
        ("1e3", 1000.0),
        (".5", 0.5),
        ("-.5", -0.5),
        ("5.", 5.0),
        ("5.e1", 50.0),
        ("00.5", 0.5),
        ("6.02e23", 6.02e23),
        (".inf", math.inf),
        ("+.Inf", math.inf),
        ("-.inf", -math.inf),
        ("1e999", math.inf),
        ("true", True),
        ("False", False),
        ("TRUE", True),
        ("null", None),
        ("~", None),
        ("", None),
    ],
)
def test_plain_scalars_of_the_core_schema(text: str, expected: object) -> None:
    found = value(text)
    assert found == expected
    assert type(found) is type(expected)


def test_not_a_number() -> None:
    assert math.isnan(value(".nan"))


@pytest.mark.parametrize(
    "text",
    [
        *("yes", "no", "on", "off", "y", "n", "Yes", "ON", "tRUE", "NuLL"),
        *("1:30", "190:20:30", "2001-12-14", "1_000", "017", "-08", "00", "0x1F", "0o17", "0b1"),
        *("nan", "inf", "-inf", "+.nan", "1e", "e5", ".", ".e3", "1e-3.0", "\u0661", "1.5m"),
        *("<<", "=", "2*pi", "-x"),
    ],
)
def test_everything_else_is_text(text: str) -> None:
    assert value(text) == text


@pytest.mark.parametrize("word", ["1", "1e-3", "true", "null", "~", ".inf", ""])
@pytest.mark.parametrize("quoted", ["'{}'", '"{}"', "|-\n  {}", ">-\n  {}"])
def test_quoted_scalars_are_text(word: str, quoted: str) -> None:
    assert value(quoted.format(word)) == word


def test_keys_are_text() -> None:
    data = read("1: a\ntrue: b\nnull: c\n<<: {x: 1}\n~: d\n1.50: e\n? f\n", "f").data
    assert data == {
        "1": "a",
        "true": "b",
        "null": "c",
        "<<": {"x": 1},
        "~": "d",
        "1.50": "e",
        "f": None,
    }


@pytest.mark.parametrize("digits", ["1" * 100_000, "-" + "9" * 100_000, "1" * 100_000 + ".0"])
def test_long_digit_strings_are_infinite_at_once(digits: str) -> None:
    with within(5):
        assert value(digits) == (-math.inf if digits.startswith("-") else math.inf)


def test_long_integers_stay_exact_and_can_become_floats() -> None:
    assert value("12345678901234567890123") == 12345678901234567890123
    assert math.isfinite(float(value("9" * 300)))
    assert math.isinf(value("9" * 309))


def test_everything_a_problem_file_holds(parser: None) -> None:
    text = """\
# a comment
title: Van der Pol's "oscillator"
constants: {mu: 1, A: [[0, 1], [-1, 0]]}
states:
  x1: {initial: 0, upper: .inf}
  x2:
dynamics:
  x2: mu*(1 - x1^2)*x2 -
    x1 + u
constraints:
  path: {mixed: u + x1/6 <= 2, other: (u + 1)*(x1 - 2) <= 3}
  list:
  - f(x, y)
  - x[0]
options: {"steps": 300, 'variance': 2}
"""
    assert read(text, "f.yaml").data == {
        "title": 'Van der Pol\'s "oscillator"',
        "constants": {"mu": 1, "A": [[0, 1], [-1, 0]]},
        "states": {"x1": {"initial": 0, "upper": math.inf}, "x2": None},
        "dynamics": {"x2": "mu*(1 - x1^2)*x2 - x1 + u"},
        "constraints": {
            "path": {"mixed": "u + x1/6 <= 2", "other": "(u + 1)*(x1 - 2) <= 3"},
            "list": ["f(x, y)", "x[0]"],
        },
        "options": {"steps": 300, "variance": 2},
    }


@pytest.mark.parametrize(
    "text", ["\ufeffa: 1", "a: 1\r\n", "---\na: 1\n...\n", "%YAML 1.2\n---\na: 1"]
)
def test_marks_of_files_and_documents_are_no_content(parser: None, text: str) -> None:
    assert read(text, "f").data == {"a": 1}


@pytest.mark.parametrize(
    "text",
    [
        "a: {tool: ICLOCS2 (LGR), steps: 400}",
        "a: [a # not, (part of it\n, b]",
        "a: {u: http://x.y/z, v: b#c, w: , x}",
        "a: {x: 'min(a, b)', y: \"u[0]\", z: ['f(a, b)', ':(']}",
        "a: {f(x): (1 + 2)*(3), g: ((a))}",
        "a: [[1, 2], {b: [3]}, []]",
        "a: {long: (a +\n  b)*2, c: 1}",
    ],
)
def test_no_false_alarm_in_braces_and_brackets(parser: None, text: str) -> None:
    assert "a" in read(text, "f").data


# Where it stands


def spot(
    found: Source, *path: str | int, offset: int | None = None, key: bool = False
) -> tuple[int, int]:
    place = found.position(path, offset, key=key)
    return place.line, place.column


def test_positions_of_values_keys_and_entries(parser: None) -> None:
    found = read("a: 1\nb:\n  c: [10, {d: 20}]\n  'e f':\n", "f")
    assert spot(found) == (1, 1)
    assert spot(found, "a") == (1, 4)
    assert spot(found, "a", key=True) == (1, 1)
    assert spot(found, "b", key=True) == (2, 1)
    assert spot(found, "b") == (3, 3)
    assert spot(found, "b", "c") == (3, 6)
    assert spot(found, "b", "c", 0) == (3, 7)
    assert spot(found, "b", "c", 1) == (3, 11)
    assert spot(found, "b", "c", 1, key=True) == (3, 11)
    assert spot(found, "b", "c", 1, "d") == (3, 15)
    assert spot(found, "b", "c", 1, "d", key=True) == (3, 12)
    assert spot(found, "b", "e f", key=True) == (4, 3)
    assert spot(found, "b", "e f") == (4, 9)


def test_a_missing_path_is_its_nearest_ancestor() -> None:
    found = read("states:\n  x1: {initial: 0}\n", "f")
    assert spot(found, "states", "x1", "lower") == (2, 7)
    assert spot(found, "states", "x1", "lower", key=True) == (2, 3)
    assert spot(found, "states", "x1", "initial", "float", offset=3) == (2, 17)
    assert spot(found, "controls", "u", 3) == (1, 1)
    assert spot(found, "states", 0) == (2, 3)


STYLES = {
    "plain": "a:\n  b: mu*(1 - x1^2)*x2 + u\n",
    "plain, several lines": "a:\n  b: mu*(1 -\n     x1^2)\n\n    *x2\n\n\n    + u\n  c: 1\n",
    "plain in braces": "a: {c: 1, b: mu*(1 -\n  x1^2)*x2   , d: 2}\n",
    "single-quoted": "a:\n  b: 'mu*(1 - x1^2) - x2'\n",
    "single-quoted, several lines": "a:\n  b: '  mu*(1\n    - x1^2)\n\n    - x2 '\n",
    "double-quoted": 'a:\n  b: "mu*(1 - x1^2) - x2"\n',
    "double-quoted, several lines": 'a:\n  b: "mu*(1\n    - x1^2) \\\n    - x2\\n\\x20 + u"\n',
    "literal": "a:\n  b: |\n    mu*(1\n      - x1^2)\n\n    *x2\n  c: 1\n",
    "literal with a header": "a:\n  b: |2-  # x1\n     mu*(1\n    - x1^2)\n  c: 1\n",
    "folded": "a:\n  b: >-\n    mu*(1\n    - x1^2)\n\n    *x2\n      + u\n    - w\n",
    "folded on Windows": "a:\r\n  b: >\r\n    mu*(1\r\n    - x1^2)\r\n",
    "beyond ASCII": "a:\n  b: é*𝛼 + ü\u00a0x\n",
}


@pytest.mark.parametrize("text", STYLES.values(), ids=STYLES.keys())
def test_offsets_find_every_character(parser: None, text: str) -> None:
    found = read(text, "f")
    expression = found.data["a"]["b"]
    lines = text.replace("\r\n", "\n").split("\n")
    seen = []
    for offset, character in enumerate(expression):
        place = found.position(("a", "b"), offset)
        if not character.isspace() or character == "\u00a0":
            assert lines[place.line - 1][place.column - 1] == character
            seen.append(place)
    assert seen == sorted(set(seen))
    beyond = found.position(("a", "b"), len(expression.rstrip()))
    assert beyond == Position(seen[-1].line, seen[-1].column + 1)


@pytest.mark.parametrize(
    ("text", "offset", "expected"),
    [
        ("a: x + y", 0, (1, 4)),
        ("a: x + y", 4, (1, 8)),
        ("a: x + y", 1, (1, 5)),
        ("a: x + y", 5, (1, 9)),
        ("a: x + y", 99, (1, 9)),
        ("a: x + y", -1, (1, 4)),
        ("a: 'it''s x'", 2, (1, 7)),
        ("a: 'it''s x'", 3, (1, 9)),
        ("a: 'it''s x'", 5, (1, 11)),
        ("a: '  x'", 1, (1, 6)),
        ('a: "a\\tb"', 2, (1, 8)),
        ('a: "a\\x41b"', 1, (1, 6)),
        ('a: "a\\x41b"', 2, (1, 10)),
        ('a: "\\u0020\\u00e9 b"', 1, (1, 11)),
        ('a: "\\U0001d6fc*b"', 2, (1, 16)),
        ('a: "\\"b"', 1, (1, 7)),
        ('a: "x\\\n  y"', 1, (2, 3)),
        ("a: |\n  x +\n  y", 4, (3, 3)),
        ("a: |\n  x +\n  y", 3, (2, 6)),
        ("a: >\n\n\n  x\n  y", 2, (4, 3)),
        ("a: 12", 1, (1, 5)),
        ("a:", 3, (1, 3)),
        ("a: ''", 0, (1, 5)),
        ("a: [1]", 3, (1, 4)),
    ],
)
def test_offsets(parser: None, text: str, offset: int, expected: tuple[int, int]) -> None:
    assert spot(read(text, "f"), "a", offset=offset) == expected


def test_lines_are_those_of_the_file() -> None:
    found = read("a: 1\r\nb: 2\n\nc: 3", "f")
    assert [found.line(number) for number in range(6)] == ["", "a: 1", "b: 2", "", "c: 3", ""]
    assert found.position(("c",)) == Position(4, 4)
    assert (found.name, found.text) == ("f", "a: 1\r\nb: 2\n\nc: 3")


# What is refused, and how it is said


GOLDEN = {
    # The mistakes that expressions make of YAML
    "a: {x: min(a, b)}": """\
f.yaml:1:8: the comma ends this value inside braces: quote the expression, {x: "min(a, b)"}
    1 | a: {x: min(a, b)}
      |        ^~~~~~~~~""",
    "a: {x: u[0]}": """\
f.yaml:1:8: the '[' ends this value inside braces: quote the expression, {x: "u[0]"}
    1 | a: {x: u[0]}
      |        ^~~~""",
    "a:\n  - [min(a, b), 2]": """\
f.yaml:2:6: the comma ends this entry inside brackets: quote the expression, ["min(a, b)"]
    2 |   - [min(a, b), 2]
      |      ^~~~~~~~~""",
    "{u[0]: 1}": """\
f.yaml:1:2: the '[' ends this name inside braces: quote the expression, {"u[0]": ...}
    1 | {u[0]: 1}
      |  ^~~~""",
    "a: {x: (b + 1}": """\
f.yaml:1:8: the brackets of this value inside braces do not match: close them, or quote the text
    1 | a: {x: (b + 1}
      |        ^~~~~~""",
    "a: - x1 + u": """\
f.yaml:1:4: '- ' begins a list entry, which cannot stand here: quote the expression, or write \
the minus sign without the blank after it
    1 | a: - x1 + u
      |    ^""",
    "a: [1, 2] @ x": """\
f.yaml:1:11: a value cannot begin with '@': quote it
    1 | a: [1, 2] @ x
      |           ^""",
    "a: [1, 2]*x": """\
f.yaml:1:10: nothing can follow a closing quote or bracket: quote the whole expression
    1 | a: [1, 2]*x
      |          ^""",
    "a: >= 3": """\
f.yaml:1:5: a value that begins with '>' or '|' is a block of text to YAML: quote the expression
    1 | a: >= 3
      |     ^""",
    # More than data
    "a: !!python/object/apply:os.system [ls]": """\
f.yaml:1:4: tags are not read: remove it, or quote the text
    1 | a: !!python/object/apply:os.system [ls]
      |    ^~~~~~~~~~~~~~~~~~~~~~~~~~~~~~~""",
    "a: ! 12": """\
f.yaml:1:4: tags are not read: remove it, or quote the text
    1 | a: ! 12
      |    ^""",
    "a: &mu 1\nb: *mu": """\
f.yaml:1:4: anchors are not read: repeat the value, or name it under constants
    1 | a: &mu 1
      |    ^~~
f.yaml:2:4: aliases are not read: repeat the value, or name it under constants
    2 | b: *mu
      |    ^~~""",
    "a: 1\n---\nb: 2": """\
f.yaml:2:1: a second document begins here: a file holds only one
    2 | ---
      | ^""",
    # Less than data
    "": """\
f.yaml:1:1: the file is empty: expected lines such as 'title: My problem'
    1 |
      | ^""",
    "- 1": """\
f.yaml:1:1: expected lines such as 'title: My problem', but the file is a list
    1 | - 1
      | ^""",
    "hello": """\
f.yaml:1:1: expected lines such as 'title: My problem', but the file is a single value
    1 | hello
      | ^""",
    # Keys
    "a: 1\nb: 2\n'a': 3": """\
f.yaml:3:1: duplicate key 'a': it is given in line 1 already
    3 | 'a': 3
      | ^~~""",
    "? [a, b]\n: 1": """\
f.yaml:1:3: a name must be text, not a list or braces
    1 | ? [a, b]
      |   ^""",
    "a: {: 1}": """\
f.yaml:1:5: a name is missing before this ':'
    1 | a: {: 1}
      |     ^""",
    "a: 1\n: 2": """\
f.yaml:2:1: a name is missing before this ':'
    2 | : 2
      | ^""",
    "a: 1\n? \n: 2": """\
f.yaml:2:2: a name is missing here: expected 'name: value'
    2 | ?
      |  ^""",
    # Syntax
    "a:\n\tb: 1": """\
f.yaml:2:1: a tab cannot indent a line: use spaces
    2 |  b: 1
      | ^""",
    "a: 1\n\tb: 1": """\
f.yaml:2:1: a tab cannot indent a line: use spaces
    2 |  b: 1
      | ^""",
    "a:\n  b: 1\n c: 2": """\
f.yaml:3:2: expected 'name: value', indented as in line 1: check the indentation
    3 |  c: 2
      |  ^""",
    "a: 1\n  b: 2": """\
f.yaml:2:4: a ':' cannot stand here: quote a text that holds one, or check the indentation
    2 |   b: 2
      |    ^""",
    "a:\n - b\n c: 1": """\
f.yaml:3:2: expected '- ', as in the list that begins in line 2: check the indentation
    3 |  c: 1
      |  ^""",
    "a: 1\nb\nc: 2": """\
f.yaml:2:1: expected 'name: value', but there is no ': ' in this line
    2 | b
      | ^""",
    "a: 'x\nb: 1\n": """\
f.yaml:1:4: the quote opened in line 1 is never closed
    1 | a: 'x
      |    ^""",
    "a: {b: 1\nc: 2": """\
f.yaml:2:2: expected ',' or '}' in the braces opened in line 1, but found ':'
    2 | c: 2
      |  ^""",
    "a: [1, 2\n\n": """\
f.yaml:1:4: expected ',' or ']' in the list opened in line 1, but found the end of the file
    1 | a: [1, 2
      |    ^""",
    "a: ]": """\
f.yaml:1:4: expected a value, but found ']'
    1 | a: ]
      |    ^""",
    "a: \x00 \x1b[0m": """\
f.yaml:1:4: unprintable character '\\x00'
    1 | a: \ufffd \ufffd[0m
      |    ^
f.yaml:1:6: unprintable character '\\x1b'
    1 | a: \ufffd \ufffd[0m
      |      ^""",
}


@pytest.mark.parametrize(("text", "message"), GOLDEN.items(), ids=map(repr, GOLDEN))
def test_golden_messages(parser: None, text: str, message: str) -> None:
    assert str(refusal(text)) == message


@pytest.mark.parametrize(
    ("text", "where", "quoted"),
    [
        ("a: {x: min(a, b, c), y: 1}", (1, 8), '{x: "min(a, b, c)"}'),
        ("a: {x: dot(a, [1, 2]) + 1}", (1, 8), '{x: "dot(a, [1, 2]) + 1"}'),
        ("a: {x: 2*(u[0] + 1)}", (1, 8), '{x: "2*(u[0] + 1)"}'),
        ("a: {x: u[0]*(1 - x)}", (1, 8), '{x: "u[0]*(1 - x)"}'),
        ("a:\n  {x: u[0]*(1 - x)}", (2, 7), '{x: "u[0]*(1 - x)"}'),
        ("a: {x: A[0, 1] @ y}", (1, 8), '{x: "A[0, 1] @ y"}'),
        ("a: {x: u[0] > 1}", (1, 8), '{x: "u[0] > 1"}'),
        ("a: {x: u{0}}", (1, 8), '{x: "u{0}"}'),
        ("a: {x: u [0]}", (1, 8), '{x: "u [0]"}'),
        ("a: [u[0] @ x, 2]", (1, 5), '["u[0] @ x"]'),
        ("a: [1, u[0]*(x)]", (1, 8), '["u[0]*(x)"]'),
        ("a:\n- {x: [v, u[0]]}", (2, 11), '["u[0]"]'),
        ("a: {x: min(a,\n  b)}", (1, 8), '{x: "min(a, b)"}'),
        ('a: {x: min(a, "b")}', (1, 8), "{x: 'min(a, \"b\")'}"),
        ("{min(a, b): 1}", (1, 2), '{"min(a, b)": ...}'),
        ("a: {\n  y: 1,\n  x: u[0] @ v\n}", (3, 6), '{x: "u[0] @ v"}'),
    ],
)
def test_expressions_to_be_quoted(
    parser: None, text: str, where: tuple[int, int], quoted: str
) -> None:
    error = refusal(text)
    assert places(text) == [where]
    assert error.complaints[0].message.endswith(f": quote the expression, {quoted}")


@pytest.mark.parametrize(
    "text", ["a: {x: u[0}", "a: {x: u[0", "a: {x: b), y: 1}", "a: [(b, c", "a: {'x': 'min(a', b)}"]
)
def test_brackets_that_never_match_are_said_once(parser: None, text: str) -> None:
    (complaint,) = refusal(text).complaints
    assert "do not match" in complaint.message


def test_all_complaints_are_raised_together(parser: None) -> None:
    text = """\
a: {x: min(a, b), y: max(c, b), z: v[0]}
b: {p: u[0] <= 1, p: 2}
c: !foo 1
c: 2
d: &e [1]
f: *e
g: 'open
"""
    expected = [(1, 8), (1, 22), (1, 36), (2, 8), (2, 19), (3, 4), (4, 1), (5, 4), (6, 4), (7, 4)]
    assert places(text) == expected


def test_no_parser_speaks_through(parser: None) -> None:
    for text in [*GOLDEN, "%FOO\na: 1", "a: ? b", "{a: , , b}", "a: !e!x y", 'a: "\\q"', "a: *(b)"]:
        message = str(refusal(text))
        for phrase in ("while ", "block mapping", "token", "scalar", "flow ", "did not", "<"):
            assert phrase not in "".join(message.splitlines()[::3]), message


def test_an_escape_cannot_reach_the_terminal() -> None:
    assert "\x1b" not in str(refusal('"\\e[31m": 1\n"\\e[31m": 2'))
    assert "\x1b" not in str(refusal('{"\\e[31m": min(a, b)}'))


def test_a_lone_surrogate_is_refused() -> None:
    assert places("a: \udc80") == [(1, 4)]


def test_too_long_a_text_is_refused_unread() -> None:
    message = "f.yaml: the file has 1,000,001 characters; at most 1,000,000 are read"
    assert str(refusal("[" * 1_000_001)) == message
    assert read("a: '" + "x" * 999_995 + "'", "f").data["a"] == "x" * 999_995


# What is meant to do harm


HOSTILE: dict[str, str] = {
    "brackets": "[" * 10_000,
    "braces": "{" * 10_000,
    "lists": "- " * 10_000,
    "keys": "? " * 10_000,
    "value of brackets": "a: " + "[" * 10_000 + "]" * 10_000,
    "deep indentation": "".join(f"{' ' * depth}a:\n" for depth in range(1_300)),
    "unclosed": "a: [" + "(, " * 200_000,
    "cut short": "a: [" + "u[0], " * 100_000 + "]",
    "tags": "- !x 1\n" * 50_000,
    "blanks": "a:" + " " * 900_000 + "@",
    "colons": ":" * 900_000,
}


@pytest.mark.parametrize("text", HOSTILE.values(), ids=HOSTILE.keys())
def test_hostile_texts_are_refused_in_seconds(text: str) -> None:
    with within(60):
        error = refusal(text)
    assert len(str(error)) < 20_000


@pytest.mark.parametrize("opening", ["[", "- "])
def test_the_nesting_cap(parser: None, opening: str) -> None:
    shut = "]" if opening == "[" else ""
    assert read("a:\n " + opening * 19 + "1" + shut * 19, "f").data["a"]
    (complaint,) = refusal("a:\n " + opening * 20 + "1" + shut * 20).complaints
    assert complaint.message == "nested more than 20 levels deep"
    assert complaint.position == Position(2, 2 + 19 * len(opening))


def test_an_alias_bomb_is_a_list_of_complaints(parser: None) -> None:
    names = "abcdefghi"
    text = "a: &a [lol, lol]\n" + "".join(
        f"{name}: &{name} [{', '.join([f'*{before}'] * 9)}]\n" for before, name in pairwise(names)
    )
    error = refusal(text)
    assert len(error.complaints) == 9 + 8 * 9
    assert str(error).endswith(f"\n... and {9 + 8 * 9 - 20} more")


YAML_ISH = st.text(
    st.sampled_from(list("ab01:,-?[]{}()&*!|>'\"%@`#.~ \t\n\r\\<=_\x00é\u2028\ufeff"))
)


@settings(max_examples=400, deadline=timedelta(seconds=5))
@given(st.one_of(st.text(), YAML_ISH, st.lists(YAML_ISH).map("\n".join)))
def test_any_text_is_read_or_refused(text: str) -> None:
    with suppress(ProblemError):
        assert isinstance(read(text, "f").data, dict)


# PyYAML's own reader, where libyaml is missing, misreads folded lines beside these.
EXOTIC_BREAKS = "\x85\u2028\u2029"


def _texts(alphabet: Callable[[str], bool]) -> st.SearchStrategy[str]:
    """Texts that mean the same in YAML 1.1, in which they are dumped, and in 1.2."""

    def same(text: str) -> bool:
        if "\0" in text:  # refused
            return False
        try:
            float(text)
        except ValueError:
            return True
        return False

    return st.one_of(st.text(), YAML_ISH).map(lambda s: "".join(filter(alphabet, s))).filter(same)


def _documents(texts: st.SearchStrategy[str]) -> st.SearchStrategy[dict[str, Any]]:
    numbers = st.one_of(st.integers(), st.floats(allow_nan=False))
    leaves = st.one_of(st.none(), st.booleans(), numbers, texts)
    values = st.recursive(
        leaves,
        lambda inner: st.one_of(st.lists(inner), st.dictionaries(texts, inner)),
        max_leaves=12,
    )
    return st.dictionaries(texts, values)


class _NoAliases(yaml.SafeDumper):
    def ignore_aliases(self, data: object) -> bool:
        return True


def _typed(data: object) -> object:
    """The data with its types: 1, 1.0 and True are equal otherwise, and so are 0.0 and -0.0."""
    if isinstance(data, dict):
        return {key: _typed(inner) for key, inner in data.items()}
    if isinstance(data, list):
        return [_typed(inner) for inner in data]
    return type(data), repr(data)


def _check_dump(data: dict[str, Any], flow: bool, width: int) -> None:
    text = yaml.dump(data, Dumper=_NoAliases, default_flow_style=flow, width=width)
    assert _typed(read(text, "f").data) == _typed(data)


@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(_documents(_texts(lambda character: character not in EXOTIC_BREAKS)), st.integers(10, 120))
def test_dumped_blocks_are_read_back(data: dict[str, Any], width: int) -> None:
    _check_dump(data, False, width)


@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    _documents(_texts(lambda character: character not in "()" + EXOTIC_BREAKS)),
    st.integers(10, 120),
)
def test_dumped_braces_are_read_back(data: dict[str, Any], width: int) -> None:
    _check_dump(data, True, width)


@settings(max_examples=200, deadline=None)
@given(
    st.text(st.sampled_from("ab+*( )\n'\"\\é"), min_size=1),
    st.sampled_from(["'", '"', "|", ">"]),
    st.integers(10, 120),
)
def test_offsets_are_monotonic_in_every_style(expression: str, style: str, width: int) -> None:
    text = yaml.dump({"k": expression}, default_style=style, width=width, allow_unicode=True)
    found = read(text, "f")
    assert found.data == {"k": expression}
    lines = text.split("\n")
    seen = []
    for offset, character in enumerate(expression):
        place = found.position(("k",), offset)
        if character not in " \n":
            assert lines[place.line - 1][place.column - 1] in (character, "\\")
            seen.append(place)
    assert seen == sorted(set(seen))


# Complaints of the stages that follow


SOURCE = read("states:\n  x1: 0\ndynamics:\n  x2: mu*(1 - x3^2)\n", "problems/a.yaml")


def test_a_complaint_points_into_an_expression() -> None:
    complaint = Complaint(("dynamics", "x2"), "unknown name 'x3'", offset=8, length=2)
    assert str(ProblemError([complaint], SOURCE)) == (
        "problems/a.yaml:4:15: unknown name 'x3'\n"
        "    4 |   x2: mu*(1 - x3^2)\n"
        "      |               ^~"
    )


def test_complaints_are_sorted_and_know_their_positions() -> None:
    error = ProblemError(
        [
            Complaint(("dynamics", "x2"), "later"),
            Complaint(("states", "x1"), "of the key", key=True),
            Complaint(("dynamics",), "position wins", position=Position(1, 1)),
            Complaint(None, "of the file"),
        ],
        SOURCE,
    )
    assert [complaint.message for complaint in error.complaints] == [
        "of the file",
        "position wins",
        "of the key",
        "later",
    ]
    assert [complaint.position for complaint in error.complaints] == [
        None,
        Position(1, 1),
        Position(2, 3),
        Position(4, 7),
    ]
    assert str(error).startswith("problems/a.yaml: of the file\nproblems/a.yaml:1:1: position")
    assert isinstance(error, UsageError)
    assert error.exit_code == 2


def test_a_problem_without_a_file_names_the_path() -> None:
    complaints = [
        Complaint(("dynamics", "x2"), "unknown name"),
        Complaint(("states", "x", "initial", 2), "too long"),
        Complaint(None, "no states"),
        Complaint((), "no dynamics"),
    ]
    assert str(ProblemError(complaints, None)).splitlines() == [
        "dynamics.x2: unknown name",
        "states.x.initial[2]: too long",
        "no states",
        "no dynamics",
    ]


@pytest.mark.parametrize(("count", "lines"), [(20, 20), (21, 21), (120, 21)])
def test_twenty_complaints_are_printed(count: int, lines: int) -> None:
    error = ProblemError([Complaint(None, f"number {k}") for k in range(count)], None)
    printed = str(error).splitlines()
    assert len(printed) == lines
    assert len(error.complaints) == count
    assert printed[19] == "number 19"
    if count > 20:
        assert printed[20] == f"... and {count - 20} more"


@pytest.mark.parametrize("offset", [0, 30, 60, 150, 380, 399])
def test_long_lines_are_shortened_around_the_caret(offset: int) -> None:
    expression = "".join(chr(ord("a") + k % 26) for k in range(400))
    found = read(f"a: {expression}", "f")
    error = ProblemError([Complaint(("a",), "here", offset=offset, length=500)], found)
    _, shown, caret = str(error).splitlines()
    assert len(shown) <= 8 + 100 + 6
    assert shown[caret.index("^")] == expression[offset]
    assert len(caret) <= len(shown)
    assert shown.endswith("...") == (offset < 300)
    assert (shown[8:11] == "...") == (offset > 47)


def test_the_underline_ends_with_the_line() -> None:
    error = ProblemError([Complaint(("states", "x1"), "here", offset=0, length=9)], SOURCE)
    assert str(error).splitlines()[2] == "      |       ^"


def test_tabs_do_not_move_the_caret() -> None:
    found = read("a:\tb +\tc", "f")
    error = ProblemError([Complaint(("a",), "here", offset=4)], found)
    assert str(error).splitlines()[1:] == ["    1 | a: b + c", "      |        ^"]


def test_high_line_numbers_keep_the_gutter_straight() -> None:
    found = read("\n" * 123_455 + "a: b", "f")
    error = ProblemError([Complaint(("a",), "here")], found)
    assert str(error).splitlines()[1:] == ["123456 | a: b", "       |    ^"]


def test_errors_and_sources_travel_between_processes() -> None:
    error = ProblemError([Complaint(("states", "x1"), "here")], SOURCE)
    copy = pickle.loads(pickle.dumps(error))
    assert str(copy) == str(error)
    assert copy.complaints == error.complaints


@pytest.mark.parametrize(
    ("name", "known", "expected"),
    [
        ("x3", ["x1", "x2"], "x1"),
        ("dynamcs", ["states", "dynamics"], "dynamics"),
        ("Initial", ["initial", "final"], "initial"),
        ("T", ["t", "u"], "t"),
        ("lagrang", ["mayer", "lagrange"], "lagrange"),
        ("q", ["x", "y"], None),
        ("velocity", ["x", "mass"], None),
        ("x", [], None),
        ("", ["x"], None),
        ("a" * 1_000_000, ["b" * 1_000_000], None),
    ],
)
def test_suggestions(name: str, known: list[str], expected: str | None) -> None:
    assert suggest(name, known) == (f"; did you mean {expected!r}?" if expected else "")
