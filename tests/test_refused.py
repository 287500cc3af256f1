"""Every mistake of `problems/refused`, and what is said of it word for word.

A file `NAME.yaml` there has the whole message beside it in `NAME.expected`; adding the two adds a
test. The messages are read from the folder of the file, so that no path stands in them.
"""

from __future__ import annotations

import re
import shutil
import sys
from pathlib import Path

import pytest
from processor import within

from quito_cli.cli.app import main
from quito_cli.problem.build import build
from quito_cli.problem.load import load, load_text
from quito_cli.problem.text.complaints import ProblemError

REFUSED = Path(__file__).parent / "problems" / "refused"
FILES = sorted(REFUSED.glob("*.yaml"))
_HEAD = re.compile(r"(?P<file>[\w.]+):(?P<line>\d+):(?P<column>\d+): (?P<message>.+)")
_EXCERPT = re.compile(r" *(?P<line>\d+) \| ?(?P<text>.*)")
_CARET = re.compile(r" *\| (?P<blank> *)(?P<underline>\^~*)")
_NAMED = re.compile(r"(?:unknown (?:name|key)|duplicate key|there is no \w+) '(?P<name>[^']+'?)'")

refused = pytest.mark.parametrize("file", FILES, ids=lambda path: path.stem)


def blocks(message: str) -> list[tuple[re.Match[str], re.Match[str], re.Match[str]]]:
    """The complaints of a message: where and what, the line, and the caret under it."""
    lines = message.splitlines()
    if lines and lines[-1].startswith("... and "):
        lines.pop()
    assert len(lines) % 3 == 0
    found = []
    for i in range(0, len(lines), 3):
        head, excerpt = _HEAD.fullmatch(lines[i]), _EXCERPT.fullmatch(lines[i + 1])
        caret = _CARET.fullmatch(lines[i + 2])
        assert head, lines[i]
        assert excerpt, lines[i + 1]
        assert caret, lines[i + 2]
        found.append((head, excerpt, caret))
    return found


@refused
def test_message(
    file: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    shutil.copy(file, tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["quito", "solve", file.name, "-N", "5"])
    with within(60), pytest.raises(SystemExit) as left:
        main()
    printed = capfd.readouterr()
    assert printed.err == file.with_suffix(".expected").read_text(encoding="utf-8")
    assert printed.out == ""
    assert left.value.code == 2
    assert [path.name for path in tmp_path.iterdir()] == [file.name]


@refused
def test_same_message_from_python(
    file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(REFUSED)
    with pytest.raises(ProblemError) as caught:
        build(load(file.name))
    assert f"{caught.value}\n" == file.with_suffix(".expected").read_text(encoding="utf-8")
    assert all(complaint.position for complaint in caught.value.complaints)


@refused
def test_expected_message_is_sound(file: Path) -> None:
    """Of the expectations themselves: carets stand where the heads say, under what they name."""
    message = file.with_suffix(".expected").read_text(encoding="utf-8")
    assert "Traceback" not in message
    assert "pydantic" not in message
    text = re.split(r"\r\n|[\n\r\x85\u2028\u2029]", file.read_text(encoding="utf-8"))
    places = []
    for head, excerpt, caret in blocks(message):
        line, column = int(head["line"]), int(head["column"])
        places.append((line, column))
        assert head["file"] == file.name
        assert int(excerpt["line"]) == line
        at = len(caret["blank"])
        shown, meant = excerpt["text"][at : at + 1], text[line - 1][column - 1 : column]
        assert shown == (meant if meant.isprintable() else "\ufffd" if meant != "\t" else " ")
        if named := _NAMED.search(head["message"]):
            there = text[line - 1][column - 1 :]
            assert there.startswith(named["name"])
            assert len(caret["underline"]) == len(named["name"])
    assert places
    assert places == sorted(places)


SECTIONS = {
    "constants": "{k: 2}",
    "time": "{initial: 0, final: 2}",
    "states": "{x: {initial: 0, final: 1}}",
    "controls": "{u: {}}",
    "parameters": "{p: {lower: 0, upper: 1}}",
    "tables": "{wind: {x: [0, 1], y: [1, 2]}}",
    "expressions": "{f: k*x}",
    "dynamics": "{x: sinus(u)}",
    "cost": "{lagrange: u^2}",
    "constraints": "{path: {limit: p*f <= 1 +}, point: {gate: {at: 1.5, holds: u <= 1}}}",
    "plots": "{plan: {curves: {boat: [x, u]}}}",
    "reference": "{state: {x: t}, control: {u: [{until: 0.5, value: 1}, {value: 2}]}}",
    "published": "[{tool: another}]",
    "tags": "[smooth]",
    "options": "{steps: 10}",
}
IN_SECTIONS = {
    "dynamics": "'sinus' is not a function; did you mean 'sin'?",
    "constraints": "something is missing after '+'",
}


@pytest.mark.parametrize("value", ["T", "[T]", "3", "", "[[T]]", "[{T: 1}]"])
@pytest.mark.parametrize("section", SECTIONS)
def test_a_section_that_is_none_hides_no_mistake_elsewhere(section: str, value: str) -> None:
    written = {**SECTIONS, section: value}
    text = "".join(f"{name}: {said}\n" for name, said in written.items())
    with pytest.raises(ProblemError) as caught:
        build(load_text(text, "test.yaml"))
    line = list(SECTIONS).index(section) + 1
    told = {c.position.line: c.message for c in caught.value.complaints if c.position}
    for other, message in IN_SECTIONS.items():
        if other != section:
            assert told.pop(list(SECTIONS).index(other) + 1) == message
    for key in ("unknown name", "there is no", "is outside", "are missing"):
        assert not any(key in message for at, message in told.items() if at != line), told
    assert set(told) <= {line}


def test_every_file_has_its_message_and_no_other() -> None:
    assert {path.stem for path in FILES} == {path.stem for path in REFUSED.glob("*.expected")}
    assert {path.suffix for path in REFUSED.iterdir()} == {".yaml", ".expected"}
    assert len(FILES) > 100
