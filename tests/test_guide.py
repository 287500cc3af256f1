"""The guide is true: its commands run, print what it shows, and give the figures of its tables."""

from __future__ import annotations

import json
import math
import os
import re
import shlex
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from unicodedata import normalize
from xml.etree import ElementTree

import numpy as np
import pytest
from documents import COMMANDS, Block, blocks, code_spans, prose, run
from scipy.optimize import brentq

import quito_cli as quito
from quito_cli.options import Options
from quito_cli.problem.library import bundled

ROOT = Path(__file__).parent.parent
FOLDER = ROOT / "problems"
PAGES = {path.name: path.read_text(encoding="utf-8") for path in sorted(FOLDER.glob("*.md"))}
NO_FAMILY = {
    *("README.md", "options.md", "adaptive-mesh.md", "polish.md", "batch.md", "sweeps.md"),
    "page.md",
}
HOME = {"sweeps.md": "sweep", "batch.md": "batch", "page.md": "gui"}
"""Commands whose options a page names without saying so."""
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


# What a page shows, step by step


@dataclass(frozen=True)
class Row:
    """A row of a table whose first column is a command."""

    command: str
    figures: dict[str, str]
    """What the table says of it, by column."""


def tables(page: str) -> list[tuple[int, Row]]:
    """Return the rows with commands, each with its place in the page."""
    found = []
    for table in re.finditer(r"^\| command \|(.*)\|\n\|[-|]+\|\n((?:\|.*\|\n)+)", page, re.M):
        columns = [column.strip() for column in table[1].split("|")]
        for line in re.finditer(r"^\| `(.+?)` \|(.*)\|$", table[2], re.M):
            cells = [cell.strip() for cell in line[2].split("|")]
            figures = dict(zip(columns, cells, strict=True))
            found.append((table.start(2) + line.start(), Row(line[1], figures)))
    return found


def steps(page: str) -> list[Block | Row]:
    """Return blocks and rows of tables in the order of the page."""
    places: list[tuple[int, Block | Row]] = list(tables(page))
    start = 0
    for block in blocks(page):
        start = page.index(block.text, start)
        places.append((start, block))
    return [step for _, step in sorted(places, key=lambda place: place[0])]


# What is shown, against what is printed


def close(shown: str, actual: str, factor: float) -> bool:
    """Tell whether a figure is right to the digits shown, or small ones within a factor."""
    a, b = float(shown), float(actual)
    if abs(a) < 1e-8:  # left over by the solver
        factor = 10.0
    if abs(a) < 1e-3 or factor > 2:
        return a == b or (a * b > 0 and 1 / factor < b / a < factor)
    mantissa = shown.lower().split("e")[0]
    digits = len(re.sub(r"\D", "", mantissa).lstrip("0"))
    return abs(a - b) <= 1.5 * 10.0 ** (math.floor(math.log10(abs(a))) + 1 - min(digits, 7))


EXACT = ("  cost", "  horizon", "  parameters", "  method", "  set")
"""Figures in these lines are right to the digits shown; others are of the machine, or tiny."""


def same_line(shown: str, actual: str) -> bool:
    if NUMBER.sub("#", shown).split() != NUMBER.sub("#", actual).split():
        return False
    if not shown.startswith(EXACT):
        return True
    pairs = zip(NUMBER.findall(shown), NUMBER.findall(actual), strict=True)
    return all(close(a, b, 1.5) for a, b in pairs)


def assert_shown(shown: list[str], printed: str) -> None:
    """Compare line by line; a line of three dots stands for any lines."""
    actual, at, gap = normalize("NFC", printed).splitlines(), 0, False
    for line in shown:
        if line == "...":
            gap = True
            continue
        while gap and at < len(actual) and not same_line(line, actual[at]):
            at += 1
        assert at < len(actual), f"not printed: {line}"
        assert same_line(line, actual[at]), f"{line!r} is shown, {actual[at]!r} printed"
        at, gap = at + 1, False
    assert gap or not "".join(actual[at:]).strip(), "more is printed than shown"


def conversation(text: str) -> list[tuple[str, list[str]]]:
    """Return the commands of a console block, each with what is shown below it."""
    assert text.startswith("$ ")
    found: list[tuple[str, list[str]]] = []
    for line in text.splitlines():
        if line.startswith("$ "):
            found.append((line[2:], []))
        else:
            found[-1][1].append(line)
    return found


def judge(row: Row, printed: str, code: int) -> None:
    """Compare the figures of a row with those of `--json`."""
    answer = json.loads(printed)
    numbers: dict[str, Callable[[], list[float]]] = {
        "difference": lambda: [answer["cost"] - answer["reference_cost"]],
        "re-simulated": lambda: [answer["resimulated_cost"] - answer["reference_cost"]],
        "cost": lambda: [answer["cost"]],
        "iterations": lambda: [answer["iterations"]],
        "violation": lambda: [answer["maximum_violation"]],
        "warnings": lambda: [len(answer["warnings"])],
        "total variation": lambda: list(answer["total_variation"].values()),
        "ringing index": lambda: list(answer["ringing"].values()),
    }
    factors = {
        "difference": 1.5,
        "re-simulated": 2.0,
        "iterations": 1.6,
        "violation": 3.0,
        "ringing index": 10.0,
    }
    assert code == (1 if row.figures.get("outcome") == "not solved" else 0), row.command
    for column, shown in row.figures.items():
        if column == "outcome":
            assert shown == ("solved" if answer["success"] else "not solved")
            continue
        assert column in numbers, column
        if not shown:
            continue
        values, figures = numbers[column](), shown.split(", ")
        assert len(values) == len(figures)
        for figure, value in zip(figures, values, strict=True):
            what = f"{row.command}: {column} {figure} is {value:.4g}"
            if column == "iterations":
                assert int(figure) / 1.6 <= value <= int(figure) * 1.6, what
            elif column == "warnings":
                assert int(figure) == value, what
            else:
                assert close(figure, f"{value:.12g}", factors.get(column, 1.5)), what


@pytest.mark.parametrize("name", PAGES)
def test_what_a_page_shows_is_what_happens(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for step in steps(PAGES[name]):
        if isinstance(step, Row):
            words = shlex.split(step.command)
            code = run([*words[1:], "--json", "--no-plot"], monkeypatch)
            judge(step, capsys.readouterr().out, code)
        elif step.language == "console":
            expected = int(step.mark.removeprefix("exit: ") or 0)
            for command, shown in conversation(step.text):
                program, *words = shlex.split(command)
                assert program == "quito"
                if words[0] == "gui":
                    assert_shown(shown, served(words))
                    continue
                assert run(words, monkeypatch) == expected, command
                assert_shown(shown, capsys.readouterr().out)
        elif step.language == "python":
            exec(compile(step.text, name, "exec"), {})
            said = re.findall(r"print\(.*# (\S+)", step.text)
            printed = capsys.readouterr().out.split()
            for figure, value in zip(said, printed, strict=True):
                assert float(figure) / 3 < float(value) < float(figure) * 3
        else:
            assert step.language == "yaml"
            kind, _, file = step.mark.partition(": ")
            if kind == "file":
                (tmp_path / file).write_text(step.text, encoding="utf-8")
                assert quito.load(tmp_path / file).title
            elif kind == "from":
                assert_part_of(step.text, FOLDER / file)
            else:
                assert kind == "baseline", f"a block of {name} is of no file"  # see test_baseline


def served(words: list[str]) -> str:
    """Run a command that serves until Ctrl-C; return what it prints."""
    pytest.importorskip("nicegui", reason="the page needs its extra: gui")
    alone = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST")}
    process = subprocess.Popen(
        [sys.executable, "-m", "quito_cli", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=alone,
        start_new_session=True,
    )
    assert process.stdout is not None
    with process.stdout:
        said = process.stdout.readline()
        process.send_signal(signal.SIGINT)
        said += process.stdout.read()
    assert process.wait() == 0, said
    return said


def assert_part_of(text: str, file: Path) -> None:
    """Lines of a bundled problem, in its order; some may be left out."""
    lines = iter(file.read_text(encoding="utf-8").splitlines())
    for line in text.splitlines():
        assert line in lines, f"{line!r} does not follow in {file.name}"


# Words, links, options


def test_there_is_a_page_a_family() -> None:
    families = {"bang-bang", "singular", "state-constrained", "free-time", "tracking"}
    assert {f"{family}.md" for family in families} <= PAGES.keys()
    for page in PAGES.values():
        assert page.startswith("# ")
        assert len(page.splitlines()) < 180


@pytest.mark.parametrize("name", PAGES)
def test_links_lead_somewhere(name: str) -> None:
    targets = re.findall(r"\]\(([^)]+)\)", prose(PAGES[name]))
    assert targets
    for target in targets:
        file, _, section = target.partition("#")
        assert (FOLDER / file).is_file(), target
        if section:
            text = (FOLDER / file).read_text(encoding="utf-8")
            headings = re.findall(r"^#+ (.+)$", text, re.M)
            assert section in [heading.lower().replace(" ", "-") for heading in headings], target


def test_the_readme_leads_to_the_guide() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    targets = re.findall(r"\]\((problems/[^)]+)\)", readme)
    assert {f"problems/{name}" for name in PAGES} <= set(targets)
    assert "problems/flow.svg" in targets
    for target in targets:
        page, _, place = target.partition("#")
        assert (ROOT / page).is_file(), target
        if place:
            heads = re.findall(r"^#+ (.+)$", (ROOT / page).read_text(encoding="utf-8"), re.M)
            assert place in {head.lower().replace(" ", "-") for head in heads}, target


def families() -> list[tuple[str, list[str], list[str]]]:
    """Return the rows of the table of families: page, tags, problems."""
    table = PAGES["README.md"].split("## The families\n")[1]
    rows = re.findall(r"^\| \[[^]]+\]\(([\w-]+\.md)\)(?:.*?) \| (.*?) \| (.*?) \|$", table, re.M)
    return [
        (page, re.findall(r"`([\w-]+)`", tags), re.findall(r"\((\w+)\.yaml\)", names))
        for page, tags, names in rows
    ]


def test_every_problem_is_in_the_table_of_families() -> None:
    assert {page for page, _, _ in families()} == PAGES.keys() - NO_FAMILY
    assert {name for _, _, names in families() for name in names} == set(bundled())


@pytest.mark.parametrize("page", sorted(PAGES.keys() - NO_FAMILY))
def test_a_family_holds_what_its_tags_say_and_its_page_names_all_of_it(page: str) -> None:
    ((tags, names),) = [(tags, names) for of, tags, names in families() if of == page]
    for name in names:
        given = quito.load(name).tags
        assert not given or set(given) & set(tags), f"{name} has the tags {given}"
        assert f"({name}.yaml)" in PAGES[page], name


def test_every_option_that_is_named_is_one(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    helps = {}
    for command in COMMANDS:
        assert run([command, "--help"], monkeypatch) == 0
        helps[command] = capsys.readouterr().out
    for name, page in PAGES.items():
        for span in code_spans(page):
            program, *words = span.split()
            of_page = HOME.get(name, "solve")
            command = words[0] if program == "quito" else of_page
            assert command in helps, span
            home = helps["new" if program == "--from" else command]
            for word in span.split() if span.startswith(("-", "quito ")) else ():
                if re.match(r"--?[A-Za-z]", word):
                    assert re.search(rf"(?<![\w-]){word}(?![\w-])", home), span


VARIANTS = sorted(
    span
    for span in set(code_spans(PAGES["README.md"].split("## Which option when")[1]))
    if span.startswith("-") and len(span.split()) == 2
)


@pytest.mark.parametrize("variant", VARIANTS)
def test_the_options_of_the_table_run(
    variant: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert len(VARIANTS) > 7
    monkeypatch.chdir(tmp_path)
    few = [] if variant.startswith("-N") else ["-N", "10"]
    arguments = ["solve", "bang_bang", "--quiet", "--no-plot", *few, *variant.split()]
    assert run(arguments, monkeypatch) == 0


# What is said in words


def test_the_first_problem_has_ten_lines() -> None:
    (room,) = [block for block in blocks(PAGES["README.md"]) if block.mark == "file: room.yaml"]
    assert len(room.text.splitlines()) == 10


def test_the_room_is_heated_as_theory_says(tmp_path: Path) -> None:
    """With z = T − 5 the heat is c exp(0.2 t) until it meets 5 at t1: c = 5 exp(−0.2 t1).

    z(t1) = 7 exp(−0.2 t1) + c (exp(0.2 t1) − exp(−0.2 t1))/0.4, then z → 25 at the rate 0.2.
    """
    a = 0.2

    def miss(t1: float) -> float:
        rise = 5 * np.exp(-a * t1) * (np.exp(a * t1) - np.exp(-a * t1)) / (2 * a)
        z1 = 7 * np.exp(-a * t1) + rise
        return float(25 + (z1 - 25) * np.exp(-a * (8 - t1)) - 15)

    t1 = brentq(miss, 5, 8)
    cost = 25 * (1 - np.exp(-2 * a * t1)) / (2 * a) + 25 * (8 - t1)
    assert float(said(r"cost +(77\.\d+)", "README.md")) == pytest.approx(cost, rel=1e-6)
    assert float(said(r"within a cell: at (\d\.\d+)", "README.md")) == pytest.approx(t1, abs=5e-3)
    full = 12 - 5 + (25 - 7) * (1 - np.exp(-a * 2)) + 5
    assert full == pytest.approx(float(said(r"ends at (17\.\d+) where", "README.md")), abs=1e-4)
    assert "reaches 17.9 °C" in PAGES["README.md"]


def said(pattern: str, page: str) -> str:
    found = re.search(pattern, PAGES[page])
    assert found, pattern
    return found[1]


def words(page: str) -> str:
    return " ".join(PAGES[page].split())


def test_defaults_that_are_stated() -> None:
    assert Options.substeps == 2
    assert "`--substeps 2`" in PAGES["README.md"]
    assert "Two substeps, the default" in PAGES["singular.md"]


def test_jumps_and_zeros_of_the_costate_in_bang_bang() -> None:
    assert "about three cells at variance 2, two at variance 1" in words("bang-bang.md")
    t = np.linspace(0.1, 0.4, 30_001)
    for variance, cells in ((2.0, 3), (1.0, 2)):
        solution = quito.solve("bang_bang", variance=variance)
        inside = t[np.abs(solution.control(t)[:, 0]) < 0.9]
        assert np.ptp(inside) * solution.mesh.cells == pytest.approx(cells, abs=0.5)
    assert "sign at 0.194 and 0.518. The exact switching times, 0.195 and 0.517," in (
        words("bang-bang.md")
    )
    solution = quito.solve("bang_bang")
    assert solution.reference is not None
    assert solution.reference.switching_times == pytest.approx([0.195, 0.517], abs=5e-4)
    t = np.linspace(0, 1, 10_001)
    costate = solution.costate(t)[:, 0]
    changes = t[np.flatnonzero(np.diff(np.sign(costate)))]
    assert changes == pytest.approx([0.194, 0.518], abs=1.5e-3)
    assert costate[0] > 0


def test_the_singular_arc_of_catalyst_mixing() -> None:
    assert "further than a tenth of the horizon from them the control is right to 1.2e-4" in (
        words("singular.md").lower()
    )
    solution = quito.solve("catalyst_mixing")
    assert solution.reference is not None
    t1, t2 = solution.reference.switching_times
    t = np.linspace(t1 + 0.4, t2 - 0.4, 1001)
    u = solution.control(t)[:, 0]
    assert u == pytest.approx(np.full(len(t), 0.2271), abs=2.5e-4)
    known = solution.reference.controls[len(solution.dense_times) // 2, 0]
    assert known == pytest.approx(0.2271, abs=5e-5)
    assert np.abs(u - known).max() < 1.3e-4


def test_the_ceilings_of_bryson_and_denham() -> None:
    """2 + 6 (1 − 4 l)² where it is touched, 4/(9 l) where it is followed; both at l = 1/6."""
    found = {}
    for _, row in tables(PAGES["state-constrained.md"]):
        if "bryson_denham" in row.command and "cost" in row.figures:
            ceiling = float(Fraction(row.command.partition("l=")[2] or "1/9"))
            found[ceiling] = float(row.figures["cost"])
    assert len(found) == 3
    for ceiling, cost in found.items():
        theory = 4 / (9 * ceiling) if ceiling < 1 / 6 else 2 + 6 * (1 - 4 * ceiling) ** 2
        assert cost == pytest.approx(theory, abs=1e-4)


def test_the_costate_of_bryson_and_denham_jumps_by_18() -> None:
    assert "18 before the arc, 0 on it, −18 after it" in words("state-constrained.md")
    costate = quito.solve("bryson_denham").costate([0.2, 0.5, 0.8])[:, 0]
    assert costate == pytest.approx([18, 0, -18], abs=0.05)


def test_the_end_of_tracking() -> None:
    solution = quito.solve("double_integrator_tracking")
    assert solution.costate([10.0]) == pytest.approx(np.zeros((1, 2)), abs=1e-9)
    t = np.linspace(0.9, 1.0, 1001)
    u = solution.control(t)[:, 0]
    assert u.min() == pytest.approx(-4.7, abs=1e-3)
    assert u[0] == pytest.approx(-4.0, abs=0.15)
    assert u[t > 0.98].max() < -4.68
    assert "from about 4.1 to its bound of 4.7" in words("tracking.md")


def test_columns_carry_what_is_said() -> None:
    assert "π² = 9.87; this one carries 18 % more" in words("parameters-and-integrals.md")
    assert np.pi**2 == pytest.approx(9.87, abs=5e-3)
    assert quito.solve("strongest_column").cost / np.pi**2 == pytest.approx(1.18, abs=5e-3)


# The picture


def test_the_picture_is_drawn_for_light_and_dark_and_can_be_read_aloud() -> None:
    text = (FOLDER / "flow.svg").read_text(encoding="utf-8")
    assert "prefers-color-scheme: dark" in text
    picture = ElementTree.fromstring(text)
    space = {"svg": "http://www.w3.org/2000/svg"}
    assert picture.find("svg:title", space) is not None
    assert picture.find("svg:desc", space) is not None
    written = [found.text or "" for found in picture.findall("svg:text", space)]
    stages = ["Problem file", "Check", "Discretize", "Solve", "Evidence", "Answer"]
    assert [entry for entry in written if entry in stages] == stages
    assert {entry for entry in written if entry.startswith("quito ")} == {
        *("quito new", "quito check", "quito solve", "quito show, plot"),
    }
