"""What the page shows of an answer, what can be taken away, and the table of runs."""

from __future__ import annotations

import asyncio
import csv
import json
import re
from collections.abc import Iterator
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from documents import run

import quito_cli as quito
from quito_cli.comparison.compare import compare
from quito_cli.errors import QuitoError, ResultFileError, UsageError
from quito_cli.gui import charts, exports
from quito_cli.gui.answer import Answer, Chart
from quito_cli.gui.answering import of_comparison, of_solution
from quito_cli.gui.exports import MEDIA_TYPES, Exporter, export
from quito_cli.gui.report import report
from quito_cli.gui.runs import MOST_RUNS, Run, Runs
from quito_cli.problem.load import load_text
from quito_cli.solution.tally import CAVEAT

EVIL = "<script>alert(1)</script>&\"'"
TEXT = f"""\
title: {json.dumps("Rest to rest " + EVIL)}
description: {json.dumps(EVIL)}
source: {json.dumps(EVIL)}
time: {{initial: 0, final: 1}}
states:
  x: {{initial: 0, final: 1, unit: m}}
  v: {{initial: 0, final: 0, upper: 2, unit: {json.dumps("m/s" + EVIL)}}}
controls: {{u: {{lower: -7, upper: 7, unit: m/s²}}}}
dynamics: {{x: v, v: u}}
cost: {{lagrange: u^2}}
reference:
  cost: 12
  accuracy: 1.0e-9
  verified: by hand
  state: {{x: 3*t^2 - 2*t^3, v: 6*t - 6*t^2}}
  control: {{u: 6 - 12*t}}
"""
"""u = 6 − 12 t."""
BANG = """\
title: As quick as can be
time: {initial: 0, final: {lower: 0.1, upper: 9, guess: 3}}
states: {x: {initial: 0, final: 1}, v: {initial: 0, final: 0}}
controls: {u: {lower: -1, upper: 1}}
dynamics: {x: v, v: u}
cost: {mayer: t}
plots:
  plan:
    curves: {cart: [x, v]}
    circles: [{centre: [0.5, 2], radius: 0.5}]
    boxes: [{centre: [0, 3], half: [1, 2]}]
"""
"""t_f = 2, and u jumps from 1 to −1 at t = 1."""


@pytest.fixture(scope="module")
def solution() -> quito.Solution:
    return quito.solve(load_text(TEXT, "rest.yaml"), steps=40)


@pytest.fixture(scope="module")
def bang() -> quito.Solution:
    return quito.solve(load_text(BANG, "bang.yaml"), mesh="adaptive")


@pytest.fixture(scope="module")
def answer(solution: quito.Solution) -> Answer:
    return of_solution(solution, {"steps": 40})


@pytest.fixture
def folder(tmp_path: Path, solution: quito.Solution, answer: Answer) -> Path:
    solution.save(tmp_path / "result.h5")
    answer.save(tmp_path)
    return tmp_path


def chart(answer: Answer, kind: str, name: str) -> Chart:
    (found,) = [one for one in answer.charts if (one.kind, one.name) == (kind, name)]
    return found


# An answer for the page


def test_an_answer_survives_its_file(answer: Answer, tmp_path: Path) -> None:
    answer.save(tmp_path)
    again = Answer.load(tmp_path)
    assert again.charts == answer.charts
    assert again.rows == answer.rows
    assert again.certificate == answer.certificate
    with pytest.raises(ResultFileError, match="run it again"):
        Answer.load(tmp_path / "gone")
    (tmp_path / "answer.json").write_text("{}")
    with pytest.raises(ResultFileError, match="run it again"):
        Answer.load(tmp_path)


def test_the_words_are_those_of_the_command(
    answer: Answer,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("rest.yaml").write_text(TEXT, encoding="utf-8")
    assert run(["solve", "rest.yaml", "-N", "40", "--no-plot"], monkeypatch) == 0
    printed = capsys.readouterr().out
    for label, said in answer.rows:
        if label not in {"iterations", ""}:  # seconds differ from run to run
            assert re.search(rf"^  {re.escape(label)} +{re.escape(said)}$", printed, re.M), label
    assert f"Solved. {answer.said}" in printed
    assert answer.verdict is not None
    assert answer.verdict in printed
    assert answer.caveat == CAVEAT


def test_charts_show_values_bounds_and_the_reference(answer: Answer) -> None:
    u = chart(answer, "controls", "u")
    assert (u.label, u.across, u.bounds) == ("u [m/s²]", "t", (-7.0, 7.0))
    ours, known = u.lines
    assert (ours.role, known.role, known.name) == ("answer", "reference", "reference")
    times = np.array(known.x, dtype=float)
    assert np.array(known.y, dtype=float) == pytest.approx(6 - 12 * times, abs=1e-7)
    times = np.array(ours.x, dtype=float)
    assert np.array(ours.y, dtype=float) == pytest.approx(6 - 12 * times, abs=0.02)
    assert (times[0], times[-1]) == (0, 1)
    v = chart(answer, "states", "v")
    assert v.bounds == (2.0,)
    assert {one.kind for one in answer.charts} == {"states", "controls", "costates", "switching"}


def test_switching_times_and_arcs_are_marked(bang: quito.Solution) -> None:
    answer = of_solution(bang, {"mesh": "adaptive"})
    u = chart(answer, "controls", "u")
    (mark,) = u.marks
    assert mark.time == pytest.approx(1, abs=1e-3)
    assert "u jumps 1 → -1" in mark.said
    assert [(span.kind, span.said) for span in u.spans] == [
        ("upper", "at upper bound"),
        ("lower", "at lower bound"),
    ]
    assert u.spans[0].end == pytest.approx(1, abs=1e-3)
    assert mark.own
    others = [one for one in answer.charts if one.kind != "plan" and one != u]
    assert {one.kind for one in others} == {"states", "costates", "switching"}
    for one in others:  # it is marked there too, as another's
        assert [(each.time, each.said, each.own) for each in one.marks] == [
            (mark.time, mark.said, False)
        ]


def test_what_is_no_shape_of_the_hamiltonian_is_not_drawn_as_one(
    answer: Answer, solution: quito.Solution
) -> None:
    """H = u² + λ_x v + λ_v u is constant, here −36: its terms are of that size."""
    drawn = chart(answer, "switching", "Hamiltonian")
    assert drawn.low is not None
    assert drawn.high is not None
    ys = np.array(drawn.lines[0].y, dtype=float)
    assert ys == pytest.approx(-36, rel=1e-2)
    assert drawn.low < ys.min() < ys.max() < drawn.high
    assert 0.1 < drawn.high - drawn.low < 10


def test_each_control_has_its_own_switching_times_and_constraints_theirs() -> None:
    text = BANG.replace("controls: {u:", "controls: {w: {lower: 0, upper: 1}, u:")
    text = text.replace("v: u}", "v: u + 0*w}").replace(
        "cost: {mayer: t}", "cost: {mayer: t, lagrange: w}"
    )
    text = text.replace("v: {initial: 0, final: 0}", "v: {initial: 0, final: 0, upper: 0.5}")
    found = of_solution(quito.solve(load_text(text, "slow.yaml"), mesh="adaptive"), {})
    u, w = (chart(found, "controls", name) for name in "uw")
    # at full speed 1/2 from t = 1/2 until 2 (0.125 of the way each to get there and to stop)
    assert [each.time for each in u.marks] == pytest.approx([0.5, 2], abs=5e-3)
    assert all(each.own for each in u.marks)
    assert not any(each.own for each in w.marks)
    assert "v becomes active" in u.marks[0].said
    assert "v is left" in u.marks[1].said


def test_a_polished_answer_has_the_reference_at_its_own_times() -> None:
    reference = """\
reference:
  cost: 2
  accuracy: 1.0e-9
  verified: by hand
  switching_times: [1]
  control: {u: [{until: 1, value: 1}, {value: -1}]}
"""
    polished = quito.solve(load_text(BANG + reference, "bang.yaml"), polish=True)
    assert polished.polished
    ours, known = chart(of_solution(polished, {}), "controls", "u").lines
    for line in (ours, known):  # both jump at 1, one at the node, the other in between
        times, values = np.array(line.x, dtype=float), np.array(line.y, dtype=float)
        assert values[times < 0.99] == pytest.approx(1, abs=1e-6)
        assert values[times > 1.01] == pytest.approx(-1, abs=1e-6)


def test_plans_have_their_obstacles(bang: quito.Solution) -> None:
    plan = next(one for one in of_solution(bang, {}).charts if one.kind == "plan")
    (cart,) = plan.lines
    assert (cart.name, cart.x[0], cart.y[0]) == ("cart", 0, 0)
    circle, box = (np.array(outline, dtype=float) for outline in plan.outlines)
    assert np.hypot(circle[0] - 0.5, circle[1] - 2) == pytest.approx(0.5)
    assert (box.min(axis=1).tolist(), box.max(axis=1).tolist()) == ([-1, 1], [1, 5])
    assert np.array_equal(box[:, 0], box[:, -1])


def test_plans_in_space_are_seen_along_every_axis() -> None:
    text = BANG.replace("cart: [x, v]", "cart: [x, v, x + v]")
    text = text.replace("circles: [{centre: [0.5, 2]", "spheres: [{centre: [0.5, 2, 1]")
    text = text.replace("centre: [0, 3], half: [1, 2]", "centre: [0, 3, 0], half: [1, 2, 3]")
    solution = quito.solve(load_text(text, "space.yaml"), steps=20)
    plans = [one for one in of_solution(solution, {}).charts if one.kind == "plan"]
    assert len({(one.across, one.label) for one in plans}) == 3
    assert len({one.name for one in plans}) == 3
    box = np.array(plans[-1].outlines[1], dtype=float)  # the second and the third coordinate
    assert (box.min(axis=1).tolist(), box.max(axis=1).tolist()) == ([1, -3], [5, 3])


def test_what_is_not_finite_is_a_gap(answer: Answer, tmp_path: Path) -> None:
    times, values = np.arange(4.0), np.array([1.0, np.nan, np.inf, 1e300])
    line = charts._line("x", 0, times, values)
    assert line.y == (1.0, None, None, None)
    gap = replace(answer, charts=(replace(answer.charts[0], lines=(line,)),))
    gap.save(tmp_path)
    assert "NaN" not in (tmp_path / "answer.json").read_text(encoding="utf-8")
    assert Answer.load(tmp_path).charts == gap.charts


def test_a_long_line_is_thinned_to_the_same_picture() -> None:
    times = np.linspace(0, 1, 50_001)
    values = np.sin(40 * times)
    values[12_345] = 7.0  # a single peak
    line = charts._line("x", 0, times, values)
    assert len(line.x) < 2_500
    assert (line.x[0], line.x[-1], max(y for y in line.y if y is not None)) == (0, 1, 7)


def test_a_comparison_has_the_tables_of_the_command() -> None:
    found = compare(load_text(TEXT, "rest.yaml"), "lgr", steps=20)
    answer = of_comparison(found, {"steps": 20})
    assert answer.kind == "compare"
    titles = [table.title for table in answer.tables]
    assert titles[:3] == ["Solve", "Cost", "Error of the control"]
    for table in answer.tables:
        assert [row[0] for row in table.rows] == ["quasi-interpolant:gaussian", "lgr"]
        assert len(table.heads) == len(table.helps) == len(table.rows[0])
    assert answer.notes[0].startswith("Held against: reference of the file (cost 12")
    u = next(one for one in answer.charts if one.kind == "controls")
    numbers = {line.name: line.number for line in u.lines}
    assert numbers == {"quasi-interpolant:gaussian": 0, "lgr": 1, "reference": -1}
    assert json.dumps(answer.figures)


def test_a_chart_of_a_comparison_is_the_plot_it_was_made_of() -> None:
    found = compare(load_text(TEXT, "rest.yaml"), "lgr", steps=20)
    made = of_comparison(found, {}).charts
    plots = [panel for view in charts.VIEWS.values() for panel in view(found)]
    assert len(made) == len(plots) > 4
    for one, panel in zip(made, plots, strict=True):
        again = charts.panel_of(one)
        assert replace(again, traces=()) == replace(panel, traces=())
        for a, b in zip(again.traces, panel.traces, strict=True):
            assert (a.method, a.rough) == (b.method, b.rough)
            assert a.x == pytest.approx(b.x, rel=1e-8)
            assert a.y == pytest.approx(b.y, rel=1e-8, nan_ok=True)


# Taking away


def test_everything_can_be_taken_away_and_is_made_once(folder: Path) -> None:
    for form, media in MEDIA_TYPES.items():
        made = export(folder, form)
        assert made.filename == f"rest.{form}"
        assert made.media_type == media
        before = made.path.stat().st_mtime_ns
        assert export(folder, form).path.stat().st_mtime_ns == before
    assert (folder / "export.png").read_bytes()[:4] == b"\x89PNG"
    assert (folder / "export.pdf").read_bytes()[:5] == b"%PDF-"
    assert "<svg" in (folder / "export.svg").read_text()
    assert (folder / "export.yaml").read_text() == TEXT
    assert quito.Solution.load(export(folder, "h5").path).cost == pytest.approx(12, rel=1e-4)
    assert quito.load(folder / "export.yaml").title.startswith("Rest to rest")


def test_a_comparison_can_be_taken_away(tmp_path: Path, solution: quito.Solution) -> None:
    found = compare(load_text(TEXT, "rest.yaml"), "lgr", result=solution)
    answer = of_comparison(found, {})
    answer.save(tmp_path)
    solution.save(tmp_path / "result.h5")
    for form, begins in (("png", b"\x89PNG"), ("pdf", b"%PDF-"), ("svg", b"<?xml")):
        made = export(tmp_path, form)
        assert made.filename == f"rest-compare.{form}"
        assert made.path.read_bytes().startswith(begins)
    drawn = (tmp_path / "export.svg").read_text("utf-8")
    for said in ("quasi-interpolant:gaussian", "lgr", "reference of the file", "error of u"):
        assert f"<!-- {said}" in drawn, said  # matplotlib says in comments what it draws as paths
    with export(tmp_path, "csv").path.open(encoding="utf-8", newline="") as file:
        ours, lgr = csv.DictReader(file)
    assert (ours["method"], lgr["method"]) == ("quasi-interpolant:gaussian", "lgr")
    assert float(ours["cost"]) == solution.cost
    assert found.rows[1].errors is not None
    assert float(lgr["error_l2"]) == found.rows[1].errors.l2
    assert float(lgr["controls.u.error_l2"]) == found.rows[1].by_control[0].l2
    assert (ours["options.steps"], lgr["options.discretization"]) == ("40", "lgr")


def test_the_table_has_units_and_all_digits(folder: Path, solution: quito.Solution) -> None:
    with export(folder, "csv").path.open(encoding="utf-8", newline="") as file:
        head, *rows = csv.reader(file)
    assert head[:2] == ["t", "x [m]"]
    assert head[2].startswith("v [m/s")
    assert head[3:] == ["u [m/s²]", "costate of x", "costate of v"]
    values = np.array(rows, dtype=float)
    assert np.array_equal(values[:, 0], solution.times)
    assert np.array_equal(values[:, 1:3], solution.state(solution.times))
    assert np.array_equal(values[:, 3:4], solution.control(solution.times))
    assert np.array_equal(values[:, 4:], solution.costates)


@pytest.mark.parametrize("form", ["exe", "", "../result", "h5/../../x"])
def test_other_formats_are_refused(folder: Path, form: str) -> None:
    with pytest.raises(UsageError, match="there is no format"):
        export(folder, form)


def test_what_is_gone_or_damaged_is_told(folder: Path, tmp_path: Path) -> None:
    (folder / "result.h5").write_bytes(b"no HDF5")
    with pytest.raises(ResultFileError, match="damaged"):
        export(folder, "csv")
    assert not (folder / "export.csv").exists()
    (folder / "result.h5").unlink()
    for form in ("h5", "png"):
        with pytest.raises(ResultFileError):
            export(folder, form)
    with pytest.raises(ResultFileError, match="run it again"):
        export(tmp_path / "nowhere", "h5")


@pytest.mark.parametrize(
    ("name", "filename"),
    [("../../etc/passwd", "etc_passwd"), ('a"\r\nb', "a_b"), ("", "problem"), ("日本", "problem")],
)
def test_names_of_downloads_are_names(
    tmp_path: Path, answer: Answer, solution: quito.Solution, name: str, filename: str
) -> None:
    replace(answer, name=name).save(tmp_path)
    solution.save(tmp_path / "result.h5")
    assert export(tmp_path, "h5").filename == f"{filename}.h5"


@pytest.fixture
def exporter() -> Iterator[Exporter]:
    made = Exporter(60.0, 10**9)
    yield made
    made.close()


def test_exports_are_made_in_another_process(
    folder: Path, exporter: Exporter, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(exports, "export", None)  # not here
    assert asyncio.run(exporter.export(folder, "csv")).filename == "rest.csv"
    with pytest.raises(UsageError, match="there is no format"):
        asyncio.run(exporter.export(folder, "exe"))
    with pytest.raises(ResultFileError):
        asyncio.run(exporter.export(folder / "nowhere", "h5"))


def hang(folder: Path, form: str, tell: object) -> None:
    import time

    time.sleep(600)


def test_an_export_that_takes_too_long_is_ended(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(exports, "_export", hang)
    exporter = Exporter(1.0, 10**9)
    try:
        with pytest.raises(QuitoError, match="not made within 1 seconds"):
            asyncio.run(exporter.export(folder, "csv"))
    finally:
        exporter.close()


# The report


class Tags(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.links: list[str] = []
        self.text = ""
        self.handlers: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.links += [value or "" for name, value in attrs if name in {"src", "href"}]
        self.handlers += [name for name, _ in attrs if name.startswith("on")]

    def handle_data(self, data: str) -> None:
        self.text += data


def read(page: str) -> Tags:
    parsed = Tags()
    parsed.feed(page)
    parsed.close()
    return parsed


def test_a_report_says_everything_and_runs_nothing(
    answer: Answer, solution: quito.Solution
) -> None:
    page = report(answer, solution)
    parsed = read(page)
    assert not {"script", "iframe", "object", "link", "form", "a"} & set(parsed.tags)
    assert parsed.handlers == []
    assert all(link.startswith("data:image/png;base64,") for link in parsed.links)
    assert len(parsed.links) == 2
    assert "default-src 'none'" in page.replace("&#x27;", "'")
    assert EVIL not in page
    for said in (
        EVIL,
        "Solved.",
        "12, reference 12",
        "x\u0307 = v",
        CAVEAT,
        "quito solve rest.yaml -N 40",
    ):
        assert said in parsed.text
    for condition in answer.certificate:
        if condition.verdict != "not applicable":
            assert condition.condition in parsed.text
    assert TEXT in parsed.text


def test_a_report_of_a_comparison_has_its_tables(solution: quito.Solution) -> None:
    found = compare(load_text(TEXT, "rest.yaml"), "lgr", steps=20)
    parsed = read(report(of_comparison(found, {}), solution))
    for said in ("Error of the control", "lgr", "Held against"):
        assert said in parsed.text
    assert "quito solve" not in parsed.text


def test_a_report_of_a_failure_says_so() -> None:
    text = TEXT.replace("upper: 2", "upper: 0.5")  # the mean speed has to be 1
    text = text.partition("reference:")[0]
    solution = quito.solve(load_text(text, "rest.yaml"), steps=10)
    assert not solution.success
    parsed = read(report(of_solution(solution, {}), solution))
    assert "Not solved." in parsed.text
    assert solution.evidence.diagnosis
    assert all(sentence in parsed.text for sentence in solution.evidence.diagnosis)


# Runs


def a_run(number: int, **given: object) -> Run:
    figures = {
        "status": "solved",
        "cost": 12.0,
        "steps": 40,
        "iterations": 7,
        "maximum_violation": 1e-9,
        "resimulation_gap": None,
        "total_variation": {"u": 12.0, "w": 0.5},
        "build_seconds": 0.1,
        "solve_seconds": 0.2,
        "options": {"variance": 2.0, "steps": 40} | given,
    }
    return Run(f"job{number}", number, "rest", given, Path("nowhere"), figures)


def test_five_earlier_runs_are_kept_and_those_taken_away() -> None:
    runs = Runs()
    dropped: list[str] = []
    for number in range(1, 10):
        dropped += runs.add(a_run(number))
        if number == 2:
            runs.taken("job2")
    assert dropped == ["job1", "job3"]
    assert [run.number for run in runs.kept()] == [2, 4, 5, 6, 7, 8, 9]
    assert len(runs.kept()) == 1 + MOST_RUNS + 1
    runs.remove("job2")
    runs.remove("job2")
    assert runs.add(a_run(10)) == ("job4",)


def test_a_run_is_called_by_what_is_special_about_it() -> None:
    assert a_run(3).label == "3: rest"
    label = a_run(4, steps=300, generating_function="sech", normalised=False).label
    assert label == "4: rest, steps 300, generating function sech, normalised no"


def test_the_table_has_what_was_set_and_found() -> None:
    runs = Runs()
    runs.add(a_run(1))
    runs.add(a_run(2, variance=3.5))
    heads, rows = runs.table()
    first, second = (dict(zip(heads, row, strict=True)) for row in rows)
    assert (first["run"], first["problem"], first["variance"]) == ("1", "rest", "2")
    assert (second["run"], second["variance"]) == ("2", "3.5")
    assert "steps" not in heads  # nobody set it; what it came to is there
    assert first["cells"] == "40"
    assert first["cost"] == "12"
    assert first["violation"] == "1.0e-09"
    assert first["gap"] == "–"
    assert first["variation"] == "12.5"
    assert first["seconds"] == "0.3"
    assert Runs().table()[1] == ()


def test_a_setting_that_means_nothing_to_a_run_is_not_known() -> None:
    runs = Runs()
    runs.add(a_run(1, variance=3.5))
    collocation = a_run(2, discretization="lgr")
    collocation.figures["options"].pop("variance")
    runs.add(collocation)
    heads, rows = runs.table()
    assert [row[heads.index("variance")] for row in rows] == ["3.5", "–"]
