"""`quito new`, `quito list` and `quito show`: the library, and a start of one's own."""

from __future__ import annotations

import contextlib
import io
import json
import os
import pty
import re
import shlex
import subprocess
import sys
import tempfile
import termios
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unicodedata import normalize
from urllib.parse import unquote, urlparse

import jsonschema
import numpy as np
import pytest
import yaml
from documents import Ran
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import quito_cli as quito
from quito_cli.check import check
from quito_cli.cli.app import main
from quito_cli.problem.build import build
from quito_cli.problem.library import bundled, data_folder
from quito_cli.problem.load import load_text
from quito_cli.problem.mathematics import render

ROOT = Path(__file__).parent.parent
REFERENCE = ROOT / "tests" / "reference"
TEMPLATE = ROOT / "quito_cli" / "problem" / "template.yaml"
SCHEMA = data_folder("schemas") / "problem.schema.json"
NAMES = sorted(bundled())

SMALL = """\
title: Push to one
source: >-
  A book with a title that is long enough for its line to be broken somewhere before its end,
  which is here
description: |
  First words.
  Second words.
constants: {k: 2}
time: {initial: 0, final: 1}
states: {x: {initial: 0, final: 1}}
controls: {u: {lower: -3, upper: 3}}
dynamics: {x: u}
cost: {lagrange: u^2}
reference:
  cost: k/2
  accuracy: 1.0e-12
  verified: By hand.
  constants: {a: 1/4}
  switching_times: [a, 2*a]
  control: {u: 1}
published:
  - {tool: pencil, steps: 10, error_norm: 0.25}
  - {tool: A better pencil, error_norm: 1.0e-3}
options: {steps: 50, normalised: true, variance: 2, solver_options: {mu_init: 1.0e-2}}
"""
SHOWN = """\
Push to one
A book with a title that is long enough for its line to be broken somewhere before its end, which is
here

First words.
Second words.

minimise   ∫₀¹ u² dt    (over u)
subject to ẋ = u
           x(0) = 0
           x(1) = 1
           |u(t)| ≤ 3
with       t ∈ [0, 1],  k = 2

known optimum    1 ± 1e-12
switching times  0.25, 0.5
known functions  u(t)
verified         By hand.
options          steps 50, variance 2, normalised yes, mu_init 0.01

published        steps  error norm
pencil           10     0.25
A better pencil  -      0.001
"""


Quito = Callable[..., Ran]


@pytest.fixture
def quito_(
    monkeypatch: pytest.MonkeyPatch, capfdbinary: pytest.CaptureFixture[bytes], tmp_path: Path
) -> Quito:
    """Run a command in this process, in an empty folder; line ends are left as they are."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments: str | Path) -> Ran:
        monkeypatch.setattr(sys, "argv", ["quito", *map(str, arguments)])
        capfdbinary.readouterr()
        code = 0
        try:
            main()
        except SystemExit as left:
            code = left.code if isinstance(left.code, int) else int(left.code is not None)
        printed = capfdbinary.readouterr()
        return Ran(code, printed.out.decode(), printed.err.decode())

    return run


def written(folder: Path) -> set[str]:
    return {str(p.relative_to(folder)) for p in folder.rglob("*") if not p.is_dir()}


def on_a_terminal(columns: int, *arguments: str) -> str:
    """What a terminal of that many columns is given."""
    mine, theirs = pty.openpty()
    termios.tcsetwinsize(theirs, (40, columns))
    environment = {k: v for k, v in os.environ.items() if k not in ("COLUMNS", "LINES")}
    with subprocess.Popen(
        [sys.executable, "-m", "quito_cli", *arguments],
        env={**environment, "PYTHONPATH": str(ROOT)},
        stdin=subprocess.DEVNULL,
        stdout=theirs,
    ) as running:
        os.close(theirs)
        seen = b""
        with contextlib.suppress(OSError):  # the other end is closed
            while chunk := os.read(mine, 65536):
                seen += chunk
        assert running.wait(60) == 0
    os.close(mine)
    return re.sub(r"\x1b\[[0-9;]*m|\r", "", seen.decode())


# new: the template


def test_the_template_is_written_checked_and_solved_as_it_says(
    quito_: Quito, tmp_path: Path
) -> None:
    ran = quito_("new", "rocket")
    assert ran == Ran(
        0,
        "Wrote rocket.yaml, a template that solves as it stands. Next:\n\n"
        "  quito check rocket.yaml\n"
        "  quito solve rocket.yaml\n",
        "",
    )
    assert written(tmp_path) == {"rocket.yaml"}
    checked = quito_("check", "rocket.yaml")
    assert (checked.code, checked.err) == (0, "")
    assert checked.out.endswith("\nrocket.yaml: no complaints\n")
    solved = quito_("solve", "rocket.yaml")
    assert (solved.code, solved.err) == (0, "")
    assert "Warning" not in solved.out
    assert written(tmp_path) == {"rocket.yaml", "results/rocket.h5", "results/rocket.png"}


def test_the_answer_of_the_template() -> None:
    """Without the motor's limit the speed is a parabola up to c at t1, constant, and falls again.

    u = F/m = a (1 − t/t1), a t1/2 = c, and the way 2 c − 2 c t1/3 = 1: J = m² 8 c²/(3 t1). With
    the limit J is larger, and the limit is reached: in that parabola F v is 0.88 at most.
    """
    mass, limit, c = 2, 0.8, 0.7
    t1 = 1.5 * (2 - 1 / c)
    solution = quito.solve(TEMPLATE)
    assert solution.success
    assert solution.evidence.warnings == ()
    assert mass**2 * 8 * c**2 / (3 * t1) < solution.cost
    unlimited = quito.load(TEMPLATE, {"P_max": 1})
    assert quito.solve(unlimited).cost == pytest.approx(mass**2 * 8 * c**2 / (3 * t1), rel=1e-4)
    times = np.linspace(0, 2, 2001)
    power = solution.control(times)[:, 0] * solution.state(times)[:, 1]
    assert power.max() == pytest.approx(limit, abs=1e-3)


def test_the_template_explains_what_is_commonly_used() -> None:
    text = TEMPLATE.read_text(encoding="utf-8")
    for key in (
        *("title", "description", "constants", "time", "states", "controls", "parameters"),
        *("expressions", "dynamics", "sense", "cost", "constraints", "options"),
    ):
        assert re.search(rf"^#?{key}:", text, re.MULTILINE), key
    for key in (
        *("initial", "final", "lower", "upper", "guess", "unit", "lagrange", "mayer"),
        *("path", "boundary", "integral", "point", "steps", "variance"),
    ):
        assert re.search(rf"\b{key}: ", text), key
    assert max(map(len, text.splitlines())) <= 100
    assert text.isascii()


def examples() -> str:
    """The template with its examples in use: a `#` that is not followed by a blank taken away.

    Two keys can stand only once: the examples of `time` and `x` replace the lines that are there.
    """
    text = TEMPLATE.read_text(encoding="utf-8")
    for line in re.findall(r"^# (time: .*|x: .*)$", text, re.MULTILINE):
        key = line.partition(":")[0]
        text = re.sub(rf"^( *){key}: \{{.*$", rf"\g<1>{line}", text, count=1, flags=re.MULTILINE)
    return re.sub(r"^#(?! \S)(?=.)", "", text, flags=re.MULTILINE)


def test_the_examples_of_the_template_are_right() -> None:
    problem = load_text(examples(), "examples.yaml")
    model = build(problem)
    assert [v.name for v in model.parameters] == ["drag"]
    assert not model.final_time.fixed
    assert problem.states["x"].guess == "t/2"
    constraints = problem.constraints
    assert set(constraints.path) | set(constraints.boundary) == {"motor", "ahead"}
    assert set(constraints.integral) | set(constraints.point) == {"heat", "gate"}
    assert problem.cost.model_fields_set == {"lagrange", "mayer"}
    assert (problem.sense, problem.options.steps) == ("minimize", 200)
    assert [c.message for c in check(problem)] == ["the parameter drag enters nowhere"]


def test_the_template_is_what_its_schema_says() -> None:
    schema = json.loads(SCHEMA.read_text(encoding="utf-8"))
    for text in (TEMPLATE.read_text(encoding="utf-8"), examples()):
        jsonschema.Draft7Validator(schema).validate(yaml.safe_load(text))


# new: the line for editors


def schema_of(file: Path) -> Path:
    """Where the YAML language server looks: from the file, or at a URI; a blank is the end."""
    line = file.read_text(encoding="utf-8").splitlines()[0]
    found = re.match(r"^#\s+yaml-language-server\s*:\s*\$schema=(\S+)", line)
    assert found
    assert found[0] == line
    if found[1].startswith("file:"):
        return Path(unquote(urlparse(found[1]).path))
    return file.parent / found[1]


@pytest.mark.parametrize("name", ["a", "b/c/a", "with a blank/ä/a.yml"])
@pytest.mark.parametrize("origin", [(), ("--from", "bressan")])
def test_editors_find_the_schema(
    quito_: Quito, tmp_path: Path, name: str, origin: tuple[str, ...]
) -> None:
    assert quito_("new", name, *origin).code == 0
    (file,) = (tmp_path / path for path in written(tmp_path))
    assert schema_of(file).samefile(SCHEMA)
    assert file.read_text(encoding="utf-8").count("yaml-language-server") == 1


@pytest.mark.parametrize("name", ["a", "problems/a", "deep/er/a", "../a"])
@pytest.mark.parametrize("home", ["checkout", "with blanks # and % in it"])
def test_within_a_checkout_the_schema_is_found_wherever_that_moves(
    quito_: Quito, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, home: str
) -> None:
    schemas = tmp_path / home / "schemas"
    schemas.mkdir(parents=True)
    (schemas / SCHEMA.name).write_bytes(SCHEMA.read_bytes())
    monkeypatch.setattr("quito_cli.problem.library.data_folder", lambda folder: schemas)
    monkeypatch.chdir(schemas.parent)
    assert quito_("new", name).code == 0
    file = schemas.parent / f"{name}.yaml"
    assert schema_of(file).samefile(schemas / SCHEMA.name)
    line = file.read_text(encoding="utf-8").splitlines()[0]
    assert ("file:" in line) == name.startswith("..")


# new: a copy


@pytest.mark.parametrize("name", NAMES)
def test_a_copy_of_a_bundled_problem_is_that_problem(
    quito_: Quito, tmp_path: Path, name: str
) -> None:
    ran = quito_("new", "mine", "--from", name)
    assert (ran.code, ran.err) == (0, "")
    assert ran.out.startswith(f"Wrote mine.yaml, a copy of {name}. Next:\n")
    copied, original = quito.load(tmp_path / "mine.yaml"), quito.load(name)
    assert copied.name == "mine"
    assert copied.model_dump() == original.model_dump()
    lines = bundled()[name].read_bytes().splitlines(keepends=True)
    assert (tmp_path / "mine.yaml").read_bytes().splitlines(keepends=True)[1:] == lines[1:]


@pytest.mark.parametrize("mark", ["", "\ufeff"])
@pytest.mark.parametrize("ends", ["\n", "\r\n"])
@pytest.mark.parametrize("head", ["", "# mine\n", "# mine\n#  yaml-language-server:  $schema=x\n"])
def test_a_copy_of_a_file_of_ones_own(
    quito_: Quito, tmp_path: Path, head: str, ends: str, mark: str
) -> None:
    text = (head + SMALL).replace("\n", ends)
    (tmp_path / "a.yaml").write_bytes((mark + text).encode())
    assert quito_("new", "b", "--from", "a.yaml").code == 0
    copied = (tmp_path / "b.yaml").read_bytes().decode()
    lines = copied.splitlines(keepends=True)
    (pointing,) = (line for line in lines if "yaml-language-server" in line)
    assert pointing == f"# yaml-language-server: $schema={SCHEMA.as_uri()}{ends}"
    if "schema" in head:
        assert copied == text.replace(f"#  yaml-language-server:  $schema=x{ends}", pointing)
    else:
        assert copied == pointing + text
    assert quito.load(tmp_path / "b.yaml").model_dump() == quito.load("a.yaml").model_dump()


def test_a_copy_of_what_is_not_there(quito_: Quito, tmp_path: Path) -> None:
    ran = quito_("new", "mine", "--from", "alychn")
    assert (ran.code, ran.out) == (2, "")
    assert "did you mean 'alychan'?" in ran.err
    (tmp_path / "bad.yaml").write_text(SMALL.replace("states", "sates"), encoding="utf-8")
    ran = quito_("new", "mine", "--from", "bad.yaml")
    assert (ran.code, ran.out) == (2, "")
    assert ran.err.startswith("bad.yaml:")
    assert "did you mean 'states'?" in ran.err
    assert written(tmp_path) == {"bad.yaml"}


# new: names and places


@pytest.mark.parametrize(
    ("given", "made"),
    [
        ("rocket.yaml", "rocket.yaml"),
        ("rocket.yml", "rocket.yml"),
        ("Rocket.v2", "Rocket.v2.yaml"),
        ("a/b/rocket", "a/b/rocket.yaml"),
        ("./rocket", "rocket.yaml"),
        ("my rocket's; rm $HOME", "my rocket's; rm $HOME.yaml"),
        ("Rakete-für-übermorgen", "Rakete-für-übermorgen.yaml"),
        ("2nd_try", "2nd_try.yaml"),
        ("alychan", "alychan.yaml"),
        ("-odd/rocket", "-odd/rocket.yaml"),
    ],
)
def test_the_commands_it_names_can_be_typed(
    quito_: Quito, tmp_path: Path, given: str, made: str
) -> None:
    ran = quito_("new", "--", given)
    assert (ran.code, ran.err) == (0, "")
    assert written(tmp_path) == {made}
    assert ran.out.startswith(f"Wrote {made}, ")
    commands = [shlex.split(line) for line in ran.out.splitlines() if line.startswith("  ")]
    assert [command[:2] for command in commands] == [["quito", "check"], ["quito", "solve"]]
    (_, *checking), (_, *solving) = commands
    assert quito_(*checking).code == 0
    assert quito_(*solving, "-N", "10", "--no-plot", "-o", "out").code == 0


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("", "such as: quito new rocket"),
        ("  ", "such as: quito new rocket"),
        ("there/", "such as: quito new there/rocket"),
        ("..", "starts with a letter, a digit or _"),
        (".hidden", "starts with a letter, a digit or _"),
        (".yaml", "starts with a letter, a digit or _"),
        (" x", "starts with a letter, a digit or _"),
        ("a:b", "has no : in it"),
        ("what?", "has no ? in it"),
        ("a\\b", "has no \\ in it"),
        ("x ", "does not end with a blank or a dot"),
        ("x..yaml", "does not end with a blank or a dot"),
        ("x" * 300, "too long"),
        ("x\x1b[2J", "cannot be printed"),
        ("\x1b/x", "cannot be printed"),
        ("a\nb", "cannot be printed"),
        ("taken.txt/x", "taken.txt is not a folder"),
        ("taken.txt/y/x", "taken.txt is not a folder"),
    ],
)
def test_names_that_are_refused(quito_: Quito, tmp_path: Path, given: str, said: str) -> None:
    (tmp_path / "taken.txt").write_text("a file")
    ran = quito_("new", given)
    assert (ran.code, ran.out) == (2, "")
    assert ran.err.startswith("quito: ")
    assert said in ran.err
    assert len(ran.err.splitlines()) == 1
    assert "\x1b" not in ran.err
    assert written(tmp_path) == {"taken.txt"}


@pytest.mark.skipif(os.geteuid() == 0, reason="nothing is forbidden to root")
def test_a_folder_that_is_forbidden(quito_: Quito, tmp_path: Path) -> None:
    (tmp_path / "kept").mkdir(mode=0o500)
    ran = quito_("new", "kept/x")
    assert ran == Ran(2, "", "quito: kept/x.yaml cannot be written: Permission denied\n")


def test_what_is_there_stays(quito_: Quito, tmp_path: Path) -> None:
    file = tmp_path / "rocket.yaml"
    file.write_text("precious")
    for arguments in (("rocket",), ("rocket.yaml", "--from", "alychan"), ("./rocket",)):
        ran = quito_("new", *arguments)
        assert ran == Ran(
            2,
            "",
            "quito: rocket.yaml is there already; choose another name, or --force to replace it\n",
        )
        assert file.read_text() == "precious"
    assert quito_("new", "rocket", "--force", "--from", "nothing").code == 2
    assert file.read_text() == "precious"
    assert quito_("new", "rocket", "--force").code == 0
    assert quito.load(file).title == "A cart with a weak motor"
    assert written(tmp_path) == {"rocket.yaml"}


def test_a_file_may_be_pointed_to_the_schema_in_place(quito_: Quito, tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text(SMALL, encoding="utf-8")
    assert quito_("new", "a", "--from", "a.yaml", "--force").code == 0
    assert (tmp_path / "a.yaml").read_text(encoding="utf-8").endswith(f"\n{SMALL}")
    assert schema_of(tmp_path / "a.yaml").samefile(SCHEMA)


def test_links_and_folders_in_the_way(quito_: Quito, tmp_path: Path) -> None:
    (tmp_path / "link.yaml").symlink_to("nowhere")
    assert quito_("new", "link").code == 2
    assert (tmp_path / "link.yaml").is_symlink()
    (tmp_path / "folder.yaml").mkdir()
    assert quito_("new", "folder").code == 2
    ran = quito_("new", "folder", "--force")
    assert ran.code == 2
    assert ran.err.startswith("quito: folder.yaml cannot be written: ")
    assert written(tmp_path) == {"link.yaml"}


# list


def listed(quito_: Quito, *arguments: str) -> list[dict[str, Any]]:
    ran = quito_("list", "--json", *arguments)
    assert (ran.code, ran.err) == (0, "")
    assert ran.out.count("\n") == 1
    rows: list[dict[str, Any]] = json.loads(ran.out)["problems"]
    return rows


def test_every_row_is_what_loading_says(quito_: Quito) -> None:
    rows = listed(quito_)
    assert [row["name"] for row in rows] == NAMES
    for row in rows:
        problem = quito.load(row["name"])
        model = build(problem)
        assert (row["states"], row["controls"], row["parameters"]) == (
            *(model.n_x, model.n_u),
            model.n_p,
        )
        for kind, number in row["constraints"].items():
            assert number == len(getattr(model.constraints, kind)), row["name"]
        assert row["state_bounds"] == bool(np.isfinite([*model.state_bounds]).any()), row["name"]
        assert (row["title"], row["tags"]) == (problem.title, list(problem.tags))
        assert row["singular"] is ("singular" in problem.tags)
        assert row["maximize"] is (model.sense < 0)
        cost = model.known.cost if model.known else None
        assert (row["optimum"], type(row["optimum"])) == (cost, type(cost))


@pytest.mark.parametrize("name", [n for n in NAMES if (REFERENCE / f"{n}.json").is_file()])
def test_the_optimum_is_the_verified_one(quito_: Quito, name: str) -> None:
    facts = json.loads((REFERENCE / f"{name}.json").read_text(encoding="utf-8"))
    (row,) = (row for row in listed(quito_) if row["name"] == name)
    assert row["optimum"] == pytest.approx(facts["cost"], rel=1e-8, abs=1e-12)


def test_the_table_says_the_same(quito_: Quito) -> None:
    ran = quito_("list")
    assert (ran.code, ran.err) == (0, "")
    head, *lines = ran.out.splitlines()
    names = ("name", "states", "controls", "constraints", "singular", "known optimum", "title")
    starts = [head.index(name) for name in names]
    assert head == "".join(
        name.ljust(end - start)
        for name, start, end in zip(names, starts, [*starts[1:], len(head)], strict=True)
    )
    rows = listed(quito_)
    assert len(lines) == len(rows)
    for line, row in zip(lines, rows, strict=True):
        cells = [
            line[start:end].strip() for start, end in zip(starts, [*starts[1:], None], strict=True)
        ]
        name, states, controls, constraints, singular, optimum, title = cells
        assert [name, int(states), int(controls), title] == [
            row[key] for key in ("name", "states", "controls", "title")
        ]
        assert singular == ("yes" if row["singular"] else "no")
        count = sum(row["constraints"].values())
        bounded = "states" if row["state_bounds"] else ""
        assert constraints == (" + ".join(filter(None, [bounded, str(count or "")])) or "-")
        number, _, accuracy = optimum.partition(" ± ")
        if row["optimum"] is None:
            assert optimum == "-"
        else:
            assert float(number) == pytest.approx(row["optimum"], rel=1e-7)
            assert float(accuracy) == pytest.approx(row["accuracy"], rel=0.5)


def test_a_row_by_hand(quito_: Quito) -> None:
    """J = -T^3/18 with T = 10; the ceiling x1 <= l, J = 4/(9 l) with l = 1/9."""
    out = quito_("list").out
    assert re.search(r"^bressan +3 +1 +- +yes +-55\.555556 ± 1e-13 +Bressan", out, re.MULTILINE)
    assert re.search(r"^bryson_denham +2 +1 +states +no +4 ± 1e-15 +Bryson", out, re.MULTILINE)


@pytest.mark.parametrize("columns", [80, 100, 120, 300])
def test_the_table_fits_a_terminal(quito_: Quito, columns: int) -> None:
    whole = quito_("list").out.splitlines()
    seen = on_a_terminal(columns, "list").splitlines()
    assert [line.split()[0] for line in seen] == [line.split()[0] for line in whole]
    assert max(map(len, seen)) <= columns
    if columns == 300:
        assert seen == whole
    if columns == 120:
        assert any(line.endswith("…") for line in seen)
        assert all(" ± " in line for line in seen if line.startswith(("alychan", "rayleigh ")))
    if columns == 80:
        assert seen[0].endswith("optimum")


def test_tags_choose(quito_: Quito) -> None:
    tags = {name: set(quito.load(name).tags) for name in NAMES}
    assert all(tags.values())
    singular = [row["name"] for row in listed(quito_, "--tag", "singular")]
    assert singular == [name for name in NAMES if "singular" in tags[name]]
    assert {"alychan", "bressan", "van_der_pol"} <= set(singular) < set(NAMES)
    both = [row["name"] for row in listed(quito_, "--tag", "singular", "--tag", "bang-bang")]
    assert both == [name for name in NAMES if {"singular", "bang-bang"} <= tags[name]]
    lines = quito_("list", "--tag", "singular").out.splitlines()
    assert [line.split()[0] for line in lines] == ["name", *singular]


def test_tags_that_choose_nothing(quito_: Quito) -> None:
    ran = quito_("list", "--tag", "singlar")
    assert (ran.code, ran.out) == (2, "")
    assert ran.err.startswith("quito: there is no tag 'singlar'; did you mean 'singular'?; the ")
    assert "bang-bang" in ran.err
    tags = {name: set(quito.load(name).tags) for name in NAMES}
    known = sorted(set().union(*tags.values()))
    apart = next(
        (a, b) for a in known for b in known if not any({a, b} <= had for had in tags.values())
    )
    chosen = ("--tag", apart[0], "--tag", apart[1])
    ran = quito_("list", *chosen)
    said = f"No bundled problem has all of these tags: {', '.join(apart)}.\n"
    assert ran == Ran(0, "", said)
    assert listed(quito_, *chosen) == []


# show


def test_show_a_problem_with_all_that_is_known(quito_: Quito, tmp_path: Path) -> None:
    (tmp_path / "small.yaml").write_text(SMALL, encoding="utf-8")
    ran = quito_("show", "small.yaml")
    assert (ran.code, normalize("NFC", ran.out), ran.err) == (0, SHOWN, "")
    tagged = SMALL.replace("constants: {k: 2}", "tags: [smooth, quadratic]\nconstants: {k: 2}")
    (tmp_path / "small.yaml").write_text(tagged, encoding="utf-8")
    options = "options          steps 50, variance 2, normalised yes, mu_init 0.01\n"
    expected = SHOWN.replace(options, f"{options}tags             smooth, quadratic\n")
    ran = quito_("show", "small.yaml")
    assert (ran.code, normalize("NFC", ran.out), ran.err) == (0, expected, "")


@pytest.mark.parametrize("name", NAMES)
def test_show_a_bundled_problem(quito_: Quito, name: str) -> None:
    ran = quito_("show", name)
    assert (ran.code, ran.err) == (0, "")
    problem = quito.load(name)
    assert ran.out.startswith(f"{problem.title}\n")
    assert f"\n\n{render(problem, latex=False)}\n\n" in ran.out
    said = " ".join(ran.out.split())
    for note in (problem.source, problem.description):
        assert " ".join(note.split()) in said
    known = build(problem).known
    if known and known.cost is not None:
        found = re.search(r"^known optimum +(\S+)( ± |$)", ran.out, re.MULTILINE)
        assert found
        assert float(found[1]) == pytest.approx(known.cost, rel=1e-15)
    if known and known.switching_times:
        found = re.search(r"^switching times +(.*(?:\n +.*)*)", ran.out, re.MULTILINE)
        assert found
        times = [float(time) for time in found[1].replace(",", " ").split()]
        assert times == pytest.approx(list(known.switching_times), rel=1e-9, abs=1e-12)
    for row in problem.published:
        assert re.search(rf"^{re.escape(row.tool)}  ", ran.out, re.MULTILINE)
    assert quito_("show", name, "--latex") == Ran(0, render(problem, latex=True) + "\n", "")


def test_show_keeps_within_a_terminal() -> None:
    seen = on_a_terminal(60, "show", "alychan").splitlines()
    words = [line for line in seen if not line.startswith(("QuITO", "ICLOCS2", "published"))]
    assert max(map(len, words)) <= 60


@pytest.mark.parametrize("name", NAMES)
def test_show_yaml_is_the_file(quito_: Quito, name: str) -> None:
    assert quito_("show", name, "--yaml") == Ran(0, bundled()[name].read_bytes().decode(), "")


@pytest.mark.parametrize("text", [SMALL.replace("\n", "\r\n"), f"\ufeff{SMALL}", SMALL.rstrip()])
def test_show_yaml_is_the_file_byte_for_byte(quito_: Quito, tmp_path: Path, text: str) -> None:
    (tmp_path / "a.yaml").write_bytes(text.encode())
    assert quito_("show", "a.yaml", "--yaml") == Ran(0, text, "")


def test_show_refuses(quito_: Quito, tmp_path: Path) -> None:
    (tmp_path / "bad.yaml").write_text(SMALL.replace("u^2", "w^2"), encoding="utf-8")
    ran = quito_("show", "bad.yaml")
    assert (ran.code, ran.out) == (2, "")
    assert "unknown name 'w'" in ran.err
    for flags in (("--yaml", "--json"), ("--yaml", "--latex"), ("--latex", "--json")):
        ran = quito_("show", "alychan", *flags)
        assert ran == Ran(2, "", "quito: --yaml, --latex and --json exclude each other\n")
    quito.solve(load_text(SMALL, "small.yaml"), steps=5).save(tmp_path / "r.h5")
    for flag in ("--yaml", "--latex"):
        ran = quito_("show", "r.h5", flag)
        assert ran == Ran(2, "", "quito: r.h5 is a result: --yaml and --latex are for problems\n")


def test_what_is_shown_cannot_steer_the_terminal(quito_: Quito, tmp_path: Path) -> None:
    steering = SMALL.replace("By hand.", r'"a\e[2Jb"').replace("pencil", r'"c\ad"')
    (tmp_path / "a.yaml").write_text(steering, encoding="utf-8")
    ran = quito_("show", "a.yaml")
    assert ran.code == 0
    assert not re.search(r"[\x00-\x09\x0b-\x1f]", ran.out)


# Whatever is given


def run_in(folder: Path, *arguments: str) -> Ran:
    out, err = io.TextIOWrapper(io.BytesIO(), "utf-8", newline="\n"), io.StringIO()
    code = 0
    before, here = sys.argv, Path.cwd()
    try:
        os.chdir(folder)
        sys.argv = ["quito", *arguments]
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            main()
    except SystemExit as left:
        code = left.code if isinstance(left.code, int) else int(left.code is not None)
    finally:
        sys.argv = before
        os.chdir(here)
    out.flush()
    printed = out.buffer.getvalue()
    return Ran(code, printed.decode(), err.getvalue())


ARGUMENTS = st.one_of(
    st.sampled_from(["..", "a/b", "a/", "~", "CON", "a.yaml", "%s", "alychan", "--", "-h", "a.h5"]),
    st.text(st.characters(exclude_characters="/"), max_size=12),
    st.text("ab. -_:*\x00\n\udcff\ud800é/".replace("/", ""), max_size=8),
)


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.sampled_from(["new", "show", "list"]), st.lists(ARGUMENTS, max_size=2), st.data())
def test_any_argument_is_taken_or_refused(command: str, given: list[str], data: Any) -> None:
    flags = {"new": "--from", "show": "--yaml", "list": "--tag"}
    flag = data.draw(st.sampled_from([[], [flags[command]]]))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name).resolve() / "here"
        folder.mkdir()
        ran = run_in(folder, command, *flag, *given)
        assert ran.code in {0, 2}
        assert "Traceback" not in ran.out + ran.err
        assert "bug in quito" not in ran.err
        files = written(folder.parent)
        assert all(file.startswith("here/") for file in files)
        assert len(files) == (command == "new" and ran.out.startswith("Wrote "))


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.sampled_from(NAMES), st.data())
def test_any_file_is_shown_or_refused(name: str, data: Any) -> None:
    text = bundled()[name].read_text(encoding="utf-8")
    start = data.draw(st.integers(0, len(text)))
    end = min(len(text), start + data.draw(st.integers(0, 40)))
    text = text[:start] + data.draw(st.sampled_from(["", "\x1b", ": ", "[]", "1"])) + text[end:]
    with tempfile.TemporaryDirectory() as path:
        folder = Path(path)
        (folder / "cut.yaml").write_bytes(text.encode())
        for arguments in (("show", "cut.yaml"), ("new", "copy", "--from", "cut.yaml")):
            ran = run_in(folder, *arguments)
            assert ran.code in {0, 2}
            assert "Traceback" not in ran.out + ran.err
            assert "bug in quito" not in ran.err
