"""`quito check`: every warning by one small file, no false alarms, and the command itself."""

from __future__ import annotations

import gc
import json
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from unicodedata import normalize

import pytest

import quito_cli as quito
from quito_cli.check import check
from quito_cli.cli.app import main
from quito_cli.problem.library import bundled
from quito_cli.problem.load import load_text
from quito_cli.problem.text.complaints import Complaint, ProblemError

Run = Callable[..., int]

SOUND = """\
title: A sound problem
constants: {k: 2}
time: {initial: 0, final: 1}
states: {x: {initial: 1}, y: {initial: 0}}
controls: {u: {lower: -1, upper: 1}}
dynamics: {x: y, y: u - k*x}
cost: {lagrange: x^2 + u^2, mayer: y^2}
"""


def warnings(text: str) -> tuple[Complaint, ...]:
    return check(load_text(text, "test.yaml"))


def changed(*replacements: str) -> str:
    """The sound problem with one text put in place of another, or appended."""
    text = SOUND
    for replacement in replacements:
        old, arrow, new = replacement.partition(" => ")
        assert not arrow or old in text
        text = text.replace(old, new) if arrow else text + replacement + "\n"
    return text


def test_a_sound_problem_has_no_warnings() -> None:
    assert warnings(SOUND) == ()


@pytest.mark.parametrize("name", sorted(bundled()))
def test_bundled_problems_have_no_warnings(name: str) -> None:
    assert check(quito.load(name)) == ()


CASES: dict[str, tuple[str, tuple[str | int, ...] | None, str]] = {
    "constant": (
        changed("{k: 2} => {k: 2, spare: 3}"),
        ("constants", "spare"),
        "the constant 'spare' is used nowhere",
    ),
    "constant used by itself alone": (
        changed("{k: 2} => {k: 2, a: 1, b: a}"),
        ("constants", "b"),
        "the constant 'b' is used nowhere",
    ),
    "table": (
        changed("tables: {wind: {x: [0, 1], y: [0, 1]}}"),
        ("tables", "wind"),
        "the table 'wind' is used nowhere",
    ),
    "cost of time alone": (
        changed("lagrange: x^2 + u^2, mayer: y^2 => lagrange: t^2, mayer: t"),
        ("cost",),
        "the cost is the same whatever is done",
    ),
    "table that is too short": (
        changed(
            "tables: {wind: {x: [0, 0.5], y: [0, 1]}}",
            "y: u - k*x => y: 'u - k*x + interpolate(t, wind)'",
        ),
        ("tables", "wind"),
        "the table wind is read at 1, beyond its ends 0 and 0.5",
    ),
    "expression": (
        changed("expressions: {energy: x^2}"),
        ("expressions", "energy"),
        "the expression 'energy' is used nowhere",
    ),
    "control": (
        changed("upper: 1}} => upper: 1}, w: {}}"),
        ("controls", "w"),
        "the control w enters nowhere",
    ),
    "control times zero": (
        changed("upper: 1}} => upper: 1}, w: {}}", "u - k*x => u - k*x + 0*w"),
        ("controls", "w"),
        "the control w enters nowhere",
    ),
    "parameter": (
        changed("parameters: {p: {lower: 0, upper: 1}}"),
        ("parameters", "p"),
        "the parameter p enters nowhere",
    ),
    "state": (
        changed("y: {initial: 0}} => y: {initial: 0}, z: {}}", "x: y, => x: y, z: u,"),
        ("states", "z"),
        "the state z enters nothing",
    ),
    "bound above": (
        changed("y: {initial: 0} => y: {initial: 0, upper: 4}", "u - k*x => k*u", "+ u^2 => + k*u"),
        ("states", "y", "upper"),
        "y cannot get beyond 2: the bound does nothing",
    ),
    "bound below": (
        changed("y: {initial: 0} => y: {initial: 0, lower: -1.5}", "u - k*x => u + k*0"),
        ("states", "y", "lower"),
        "y cannot get beyond -1: the bound does nothing",
    ),
    "guess of a state": (
        changed("y: {initial: 0} => y: {initial: 0, upper: 0.5, guess: 3*t}"),
        ("states", "y", "guess"),
        "the guess of y was clipped to its bounds",
    ),
    "guess of a control": (
        changed("upper: 1}} => upper: 1, guess: 4}}"),
        ("controls", "u", "guess"),
        "the guess of u was clipped to its bounds",
    ),
    "guess of a parameter": (
        changed("parameters: {p: {upper: 1, guess: 2}}", "k*x} => k*x*p}"),
        ("parameters", "p", "guess"),
        "the guess of p was clipped to its bounds",
    ),
    "guess that is infinite": (
        changed("y: {initial: 0} => y: {initial: 0, guess: 1/t}"),
        ("states", "y", "guess"),
        "the guess of y is not finite",
    ),
    "dynamics": (
        changed("u - k*x => u - k*log(y)"),
        ("dynamics", "y"),
        "the derivative of y is not finite at the guess, t = 0: x = 1, y = 0, u = 0",
    ),
    "slope of the dynamics": (
        changed("u - k*x => u - k*sqrt(y)"),
        ("dynamics", "y"),
        "the derivative of y is finite, but its slope is not finite",
    ),
    "running cost": (
        changed("x^2 + u^2 => 1/u"),
        ("cost", "lagrange"),
        "the running cost is not finite at the guess",
    ),
    "end cost": (
        changed("mayer: y^2 => mayer: log(y)"),
        ("cost", "mayer"),
        "not finite at the guess",
    ),
    "slope of the end cost": (
        changed("mayer: y^2 => mayer: sqrt(y)"),
        ("cost", "mayer"),
        "not finite at the guess",
    ),
    "path constraint": (
        changed("constraints: {path: {far: 1/y <= 3}}"),
        ("constraints", "path", "far"),
        "far is not finite at the guess",
    ),
    "integral constraint": (
        changed("constraints: {integral: {fuel: log(u) <= 3}}"),
        ("constraints", "integral", "fuel"),
        "fuel is not finite at the guess",
    ),
    "boundary constraint": (
        changed("constraints: {boundary: {ends: log(final(y)) <= 3}}"),
        ("constraints", "boundary", "ends"),
        "not finite at the guess",
    ),
    "point constraint": (
        changed("constraints: {point: {half: {at: 0.5, holds: log(y) <= 3}}}"),
        ("constraints", "point", "half"),
        "not finite at the guess",
    ),
    "sizes of states": (
        changed(
            "x: {initial: 1} => x: {initial: 1e8}",
            "y: {initial: 0} => y: {initial: 1}",
            "x^2 + u^2 => 1e-16*x^2",
        ),
        ("states",),
        "x is of size 1e+08, y of size 1: consider other units, or a `scale`",
    ),
    "sizes of costs": (
        changed("mayer: y^2 => mayer: 1e9*(y + 1)"),
        ("cost",),
        "one drowns the other",
    ),
    "few cells": (
        changed("options: {steps: 11}"),
        ("options", "steps"),
        "11 cells are few for a variance of 2",
    ),
    "few cells for a wide function": (
        changed("options: {steps: 20, variance: 8}"),
        ("options", "steps"),
        "20 cells are few for a variance of 8",
    ),
    "saturation": (
        changed("options: {variance: 0.7}"),
        ("options", "variance"),
        "with variance 0.7 the control is only accurate to",
    ),
}


@pytest.mark.parametrize("kind", CASES)
def test_a_warning_of_each_kind(kind: str) -> None:
    text, path, message = CASES[kind]
    found = warnings(text)
    assert [w.path for w in found] == [path], found
    assert message in found[0].message
    assert "'" not in found[0].message or found[0].message.count("'") == 2


QUIET = {
    "a constant of the reference": changed("{k: 2} => {k: 2, c: 3}", "reference: {cost: c}"),
    "a constant of a constant": changed("{k: 2} => {a: 2, k: 2*a}"),
    "a constant in a bound": changed("{k: 2} => {k: 2, l: 1}", "{lower: -1, => {lower: -l,"),
    "a constant in a time": changed("{k: 2} => {k: 2, T: 1}", "final: 1} => final: T}"),
    "a constant in a list": changed(
        "{k: 2} => {k: 2, A: '[[k, 1], [0, 1]]'}", "y: u - k*x => y: 'u - A[0, 0]*x'"
    ),
    "a constant in a guess": changed("{k: 2} => {k: 2, g: 1}", "{initial: 1} => {guess: g*t}"),
    "a constant at a point": changed(
        "{k: 2} => {k: 2, when: 0.5}", "constraints: {point: {a: {at: when, holds: x >= 0}}}"
    ),
    "a table in an expression": changed(
        "tables: {w: {x: [0, 1], y: [0, 1]}}",
        "expressions: {gust: 'interpolate(t, w)'}",
        "u - k*x => u - k*x + gust",
    ),
    "an expression in a constraint": changed(
        "expressions: {e: x^2}", "constraints: {boundary: {b: final(e) <= 9}}"
    ),
    "a control in a point constraint": changed(
        "upper: 1}} => upper: 1}, w: {}}", "constraints: {point: {a: {at: 0, holds: w >= x}}}"
    ),
    "a parameter in the end cost": changed(
        "parameters: {p: {guess: 1}}", "mayer: y^2 => mayer: (y - p)^2"
    ),
    "a state with an end": changed(
        "y: {initial: 0}} => y: {initial: 0}, z: {final: 0}}", "x: y, => x: y, z: u,"
    ),
    "a bound that is reached": changed(
        "y: {initial: 0} => y: {initial: 0, upper: 1, lower: -0.9}", "u - k*x => u + k*0"
    ),
    "sizes that are said": changed(
        "x: {initial: 1} => x: {initial: 1e8, scale: 1e8}",
        "y: {initial: 0} => y: {initial: 1}",
        "x^2 + u^2 => 1e-16*x^2",
    ),
    "enough cells": changed("options: {steps: 12}"),
    "no width at all": changed("options: {steps: 3, control: piecewise-constant}"),
    "a guess on its bounds": changed("upper: 1}} => upper: 1, guess: 1}}"),
}


@pytest.mark.parametrize("kind", QUIET)
def test_no_false_alarm(kind: str) -> None:
    assert warnings(QUIET[kind]) == ()


def test_mistakes_are_errors() -> None:
    for text, message in (
        (changed("u - k*x => u - q*x"), "q"),
        (changed("options: {control: piecewise-linear, variance: 2}"), "variance"),
        (changed("constraints: {path: {a: x < 1}}"), "write <="),
    ):
        with pytest.raises((ProblemError, quito.UsageError), match=message):
            check(load_text(text, "test.yaml"))


# The command


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch) -> Iterator[Run]:
    """Run `quito check` in this process, and return its exit code."""

    def check_(*arguments: str) -> int:
        monkeypatch.setattr(sys, "argv", ["quito", "check", *arguments])
        with pytest.raises(SystemExit) as stop:
            main()
        return int(stop.value.code or 0)

    yield check_
    gc.unfreeze()  # a command is the last thing its process does; here more is to come


@pytest.fixture
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    for name, text in (
        ("sound", SOUND),
        ("warned", CASES["constant"][0]),
        ("wrong", changed("u - k*x => u - q*x", "mayer: y^2 => mayer: u")),
        ("broken", "states: [\n"),
    ):
        (tmp_path / f"{name}.yaml").write_text(text, encoding="utf-8")
    return tmp_path


def test_it_prints_the_mathematics(
    files: Path, run: Run, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run("sound.yaml") == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert "A sound problem" in out
    assert "ẏ = u − k x" in normalize("NFC", out)
    assert "∫" in out
    assert "no complaints" in out
    assert sorted(path.name for path in files.iterdir()) == [
        "broken.yaml",
        "sound.yaml",
        "warned.yaml",
        "wrong.yaml",
    ]


@pytest.mark.usefixtures("files")
def test_latex(run: Run, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("sound.yaml", "--latex") == 0
    out, _ = capsys.readouterr()
    assert r"\dot" in out
    assert r"\int" in out
    assert "∫" not in out


@pytest.mark.usefixtures("files")
def test_a_warning_is_shown_with_its_place(run: Run, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("warned.yaml") == 0
    out, _ = capsys.readouterr()
    assert "1 warning" in out
    assert "warned.yaml:2:19: the constant 'spare' is used nowhere" in out
    line, carets = [row.partition("|")[2] for row in out.splitlines() if "|" in row][-2:]
    assert line[carets.index("^") :].startswith("spare")
    assert run("warned.yaml", "--quiet") == 0
    out, _ = capsys.readouterr()
    assert out.startswith("warned.yaml:2:19")
    assert run("sound.yaml", "-q") == 0
    assert capsys.readouterr() == ("", "")


@pytest.mark.usefixtures("files")
def test_mistakes_end_in_two_with_all_of_them_told(
    run: Run, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run("wrong.yaml") == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert "wrong.yaml:6:" in err
    assert "wrong.yaml:7:" in err
    assert "Traceback" not in err
    assert run("broken.yaml") == 2
    assert run("nothing.yaml") == 2
    assert "nothing.yaml" in capsys.readouterr().err


@pytest.mark.usefixtures("files")
def test_several_files_are_all_looked_at(run: Run, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("wrong.yaml", "sound.yaml", "broken.yaml", "bressan") == 2
    out, err = capsys.readouterr()
    assert "sound.yaml: no complaints" in out
    assert "bressan: no complaints" in out
    assert "wrong.yaml:6:" in err
    assert "broken.yaml" in err
    assert run("sound.yaml", "bressan", "warned.yaml") == 0


@pytest.mark.usefixtures("files")
def test_json(run: Run, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("wrong.yaml", "warned.yaml", "nothing.yaml", "sound.yaml", "--json") == 2
    out, err = capsys.readouterr()
    assert err == ""
    wrong, warned, nothing, sound = json.loads(out)["files"]
    for report, name, ok in (
        (wrong, "wrong.yaml", False),
        (warned, "warned.yaml", True),
        (nothing, "nothing.yaml", False),
        (sound, "sound.yaml", True),
    ):
        assert report["file"] == name
        assert report["ok"] is ok
        assert bool(report["errors"]) is not ok
    assert [e["line"] for e in wrong["errors"]] == [6, 7]
    complaint: dict[str, Any] = {
        "line": 2,
        "column": 19,
        "message": "the constant 'spare' is used nowhere",
    }
    assert warned["warnings"] == [complaint]
    assert sound["warnings"] == []
    assert sound["title"] == "A sound problem"
    assert "∫" in sound["mathematics"]
    assert nothing["errors"][0]["line"] is None
    assert run("sound.yaml", "--json", "--latex") == 0
    assert r"\int" in json.loads(capsys.readouterr().out)["files"][0]["mathematics"]
