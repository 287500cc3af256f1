"""Reports of a run: the verdict, tables, JSON, Markdown, the page."""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest
from finished import OF_EACH, answered, finished, outside, report
from hypothesis import given, settings
from hypothesis import strategies as st
from markdown_it import MarkdownIt

from quito_cli.batch.judging.comparing import ENDING, Difference, Verdict
from quito_cli.batch.reports import html, markdown
from quito_cli.batch.reports.dictionary import as_dictionary
from quito_cli.batch.reports.pictures import MOST, check_which, pictures
from quito_cli.batch.reports.report import Report
from quito_cli.batch.reports.table import (
    differences,
    figure,
    in_a_sentence,
    seconds,
    shown,
    table,
    text,
)
from quito_cli.batch.suite.case import Case, Ending, Finished
from quito_cli.errors import UsageError
from quito_cli.summary.dictionary import finite

WORSE = Difference("a", "iterations", Verdict.WORSE, 10, 20, 3.0)
BETTER = Difference("b", "error_l2", Verdict.BETTER, 0.1, 0.05, 0.02)
SAME = Difference("b", "cost", Verdict.SAME, 1.0, 1.0, 1e-6)
NEW = Difference("c", ENDING, Verdict.NEW, None, "solved")
GONE = Difference("old", ENDING, Verdict.MISSING, "solved", None)
ALL = (BETTER, SAME, NEW, GONE, WORSE)


def held(*cases: Finished, rows: tuple[Difference, ...] = ALL, **given: Any) -> Report:
    return report(*cases, baseline=Path("baseline.yaml"), differences=rows, **given)


ABC = tuple(answered(name, {"cost": 1.0, "iterations": 20}) for name in "abc")

# The verdict


@pytest.mark.parametrize(
    ("endings", "code", "verdict"),
    [
        ((), 0, "There was no case to run."),
        ((Ending.PASSED,), 0, "The one case passed."),
        ((Ending.PASSED,) * 3, 0, "All 3 cases passed."),
        ((Ending.OUTSIDE,), 3, "The one case failed: 1 outside."),
        ((Ending.PASSED, Ending.UNSOLVED), 1, "1 of 2 cases failed: 1 not solved."),
        ((Ending.OUTSIDE, Ending.CRASHED), 1, "2 of 2 cases failed: 1 outside, 1 crashed."),
        ((Ending.REFUSED, Ending.TIMED_OUT, Ending.OUTSIDE), 2, None),
        ((Ending.OUT_OF_MEMORY, Ending.OUTSIDE), 1, None),
        ((Ending.REFUSED, Ending.INTERRUPTED), 2, None),
        ((Ending.PASSED, Ending.INTERRUPTED), 0, "1 of 2 cases failed: 1 interrupted."),
    ],
)
def test_the_gravest_ending_is_that_of_the_run(
    endings: tuple[Ending, ...], code: int, verdict: str | None
) -> None:
    made = report(*(finished(str(i), ending) for i, ending in enumerate(endings)))
    assert made.exit_code == code
    assert verdict is None or made.verdict == verdict


def test_what_is_worse_than_the_baseline_fails_a_run_that_passed() -> None:
    made = held(*ABC)
    assert made.exit_code == 3
    assert made.verdict == (
        "1 of 3 cases failed: 1 worse than the baseline. "
        "Against the baseline: 1 worse, 1 missing, 1 better, 1 new."
    )
    assert made.gone == ("old",)
    missing = held(*ABC, rows=(GONE,))
    assert missing.exit_code == 3
    assert missing.verdict.startswith(
        "All 3 cases passed, but 1 that the baseline has is missing. "
    )
    assert held(*ABC, rows=(BETTER, SAME, NEW)).exit_code == 0
    assert held(*ABC, rows=(SAME,)).verdict == "All 3 cases passed. As the baseline has it."
    unlike = report(*ABC, baseline=Path("b.yaml"))
    assert unlike.verdict == "All 3 cases passed. The baseline knows none of them."
    accepted = held(*ABC, recorded=True)
    assert accepted.exit_code == 0
    assert accepted.verdict == "All 3 cases passed. The baseline was written anew."
    crashed = held(finished("a", Ending.CRASHED), rows=(WORSE,))
    assert crashed.exit_code == 1


def test_cases_that_had_not_begun_are_told() -> None:
    made = Report("nightly", "Every night", 5, ABC[:2], 1.0)
    assert made.verdict == "All 2 cases passed; 3 had not begun."
    assert made.heading == "Every night"
    assert Report("nightly", "", 5, (), 1.0).heading == "nightly"


# Tables


def test_rows_have_the_figures_that_are_known() -> None:
    made = table(
        report(
            answered("a", {"cost": 0.757617928659, "iterations": 12, "violation": 0.0}),
            answered("b", {"cost": float("nan"), "iterations": None}),
            finished("c", Ending.CRASHED, "killed by signal 11"),
        )
    )
    assert [column.heading for column in made.columns] == ["cost", "iterations", "violation"]
    assert [row.cells for row in made.rows] == [
        ("0.75761793", "12", "0"),
        ("-", "-", "-"),
        ("-", "-", "-"),
    ]
    assert [row.values for row in made.rows][:2] == [(0.757617928659, 12.0, 0.0), (None,) * 3]
    assert [row.name for row in made.failed] == ["c"]
    assert made.failed[0].reasons == ("killed by signal 11",)
    assert [row.name for row in made.passed] == ["a", "b"]
    assert made.passed[0].reasons == ()


def test_rows_say_why() -> None:
    made = table(held(*ABC[:2], finished("d", Ending.OUTSIDE, checks=(outside(),))))
    assert [(row.name, row.result, row.reasons) for row in made.failed] == [
        ("a", "worse", ("iterations is 20, baseline 10 ± 3",)),
        ("d", "outside", ("cost is 2, expected 1 ± 1e-06",)),
    ]


def test_differences_stand_worst_first_with_their_change() -> None:
    assert differences(held(*ABC)) == (
        ("worse", "a", "iterations", "10", "20", "+10 (+100 %)", "3", ""),
        ("missing", "old", "", "solved", "-", "", "", ""),
        ("better", "b", "error l2", "0.1", "0.05", "-0.05 (-50 %)", "0.02", ""),
        ("new", "c", "", "-", "solved", "", "", ""),
    )
    note = Difference("a", "cost", Verdict.WORSE, 0, -1e-4, 1e-9, "it claims more")
    assert differences(held(rows=(note,))) == (
        ("worse", "a", "cost", "0", "-0.0001", "-0.0001", "1e-09", "it claims more"),
    )


def test_differences_in_a_sentence() -> None:
    assert in_a_sentence(WORSE) == "iterations is 20, baseline 10 ± 3"
    lost = Difference("a", "error_l2", Verdict.MISSING, 0.1, None)
    assert in_a_sentence(lost) == "error l2 is not known any more, baseline 0.1"
    new = Difference("a", "warnings", Verdict.NEW, None, 2)
    assert in_a_sentence(new) == "warnings is 2, not in the baseline"


def test_figures_as_text() -> None:
    assert figure(True) == "yes"
    assert figure((1.0, 0.25)) == "[1, 0.25]"
    assert figure("passed") == "passed"
    assert figure(None) == "-"
    assert text(float("inf"), "d") == "inf"
    assert text(12.0, "d") == "12"
    assert text(0.0, ".1e") == "0"
    assert [seconds(t) for t in (0.0512, 9.94, 99.4, 3599.7)] == [
        "0.051 s",
        "9.9 s",
        "99 s",
        "60 min 0 s",
    ]


# JSON


def strict(made: Report) -> Any:
    """What `--json` prints, read by a reader that knows no NaN."""

    def refuse(word: str) -> None:
        raise AssertionError(word)

    written = json.dumps(finite(as_dictionary(made)), allow_nan=False)
    return json.loads(written, parse_constant=refuse)


def test_json_has_all_of_a_run() -> None:
    case = Finished(
        Case("a", "van_der_pol", {"steps": 50}, {"mu": 0.5}, axes={"steps": 50}),
        Ending.OUTSIDE,
        "Solved.",
        {"cost": 2.0, "error_l2": float("inf"), "switching_times": (1.0, float("nan"))},
        (outside(),),
        1.5,
        Path("results/a.h5"),
    )
    said = strict(held(case, rows=(WORSE, SAME, GONE)))
    assert said["suite"] == "nightly"
    assert said["verdict"].startswith("The one case failed: 1 outside. Against")
    assert said["exit_code"] == 3
    assert said["failed"] == 2
    assert said["counts"] == {"outside": 1}
    assert said["not_begun"] == 0
    (row,) = said["cases"]
    assert row["figures"] == {"cost": 2.0, "error_l2": None, "switching_times": [1.0, None]}
    assert row["checks"][0]["figure"] == "cost"
    assert row["checks"][0]["sentence"] == "cost is 2, expected 1 ± 1e-06"
    assert row["options"] == {"steps": 50}
    assert row["set"] == {"mu": 0.5}
    assert row["result"] == "results/a.h5"
    assert row["ending"] == "outside"
    baseline = said["baseline"]
    assert baseline["counts"] == {"worse": 1, "missing": 1, "same": 1}
    assert [row["figure"] for row in baseline["differences"]] == ["iterations", "ending"]
    assert strict(report())["baseline"] is None


def test_json_of_every_ending() -> None:
    said = strict(report(*OF_EACH))
    assert [case["ending"] for case in said["cases"]] == [e.name.lower() for e in Ending]
    assert sum(said["counts"].values()) == len(Ending)


# Markdown

RENDER = MarkdownIt("gfm-like", {"linkify": False})


class Words(HTMLParser):
    """The elements of a page, and its text by element."""

    def __init__(self) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[tuple[str, str]] = []
        self._open: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in ("br", "meta", "img", "input", "link"):
            self._open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts.append((self._open[-1] if self._open else "", data))


def parsed(page: str) -> Words:
    words = Words()
    words.feed(page)
    words.close()
    return words


def test_markdown_shows_the_failed_first_and_folds_the_rest() -> None:
    made = held(*ABC, finished("d", Ending.CRASHED, "killed by signal 11"))
    assert markdown.markdown(made) == (
        "## ❌ nightly\n\n"
        "2 of 4 cases failed: 1 crashed, 1 worse than the baseline. Against the baseline: "
        "1 worse, 1 missing, 1 better, 1 new. The run took 12 s.\n\n"
        "| case | result | why |\n"
        "| --- | --- | --- |\n"
        "| a | worse | iterations is 20, baseline 10 ± 3 |\n"
        "| d | crashed | killed by signal 11 |\n"
        "| old | missing | in the baseline, and not in the suite any more |\n\n"
        "### Against the baseline\n\n"
        "| verdict | case | figure | baseline | now | change | allowed | note |\n"
        "| --- | --- | --- | --- | --- | --- | --- | --- |\n"
        "| worse | a | iterations | 10 | 20 | +10 (+100 %) | 3 |  |\n"
        "| missing | old |  | solved | - |  |  |  |\n"
        "| better | b | error l2 | 0.1 | 0.05 | -0.05 (-50 %) | 0.02 |  |\n"
        "| new | c |  | - | solved |  |  |  |\n\n"
        "<details><summary>2 cases passed</summary>\n\n"
        "| case | cost | iterations | time |\n"
        "| --- | ---: | ---: | ---: |\n"
        "| b | 1 | 20 | 0.5 s |\n"
        "| c | 1 | 20 | 0.5 s |\n\n"
        "</details>\n"
    )
    assert markdown.markdown(report(*ABC)).startswith("## ✅ nightly\n\nAll 3 cases passed. ")


TRICKY = [
    "<script>alert(1)</script>",
    "a|b",
    "`code`",
    "**bold** _it_ ~~no~~",
    "[text](http://example.org)",
    "![](http://example.org/a.png)",
    "http://example.org www.example.org a@example.org",
    "<b>&lt;&amp;\\",
    "# heading",
    "- item",
    "$x^2$",
    "&copy;",
    "<!-- hidden -->",
    "\\|",
    "| --- |",
]


def shown_in_a_cell(given_text: str) -> Words:
    return parsed(RENDER.render(f"| head |\n| --- |\n| {markdown.escaped(given_text)} |\n"))


@pytest.mark.parametrize("tricky", TRICKY)
def test_markdown_takes_texts_for_texts(tricky: str) -> None:
    words = shown_in_a_cell(tricky)
    assert [tag for tag, _ in words.elements] == ["table", "thead", "tr", "th", "tbody", "tr", "td"]
    assert "".join(said for tag, said in words.texts if tag == "td") == tricky


@settings(deadline=None)
@given(st.text(max_size=60))
def test_markdown_takes_any_text_for_a_text(anything: str) -> None:
    words = shown_in_a_cell(anything)
    assert [tag for tag, _ in words.elements] == ["table", "thead", "tr", "th", "tbody", "tr", "td"]
    said = "".join(said for tag, said in words.texts if tag == "td")
    assert said == " ".join(shown(anything).split())


def test_links_are_made_of_no_text() -> None:
    """What GitHub makes of bare addresses, which a parser of another make does not."""
    said = markdown.escaped("see https://example.org, www.example.org or a@example.org")
    assert said == r"see https\://example.org, www\.example.org or a\@example.org"


def test_a_summary_is_never_too_large_for_github() -> None:
    long = "x" * 5000
    rows = tuple(
        Difference(f"{i}", "cost", Verdict.BETTER, 2.0, 1.0, 1.0, long) for i in range(3000)
    )
    many = [finished(f"case {i} {'é' * 300}", Ending.CRASHED, long) for i in range(3000)]
    good = [answered(f"good {i} {'é' * 300}", {"cost": 1.0}) for i in range(3000)]
    said = markdown.markdown(held(*many, *good, rows=rows))
    assert len(said.encode()) < markdown.MOST
    left = [int(n) for n in re.findall(r"\.\.\. and (\d+) more", said)]
    assert len(left) == 3
    assert all(0 < n < 3000 for n in left)
    assert said.count("\n| case ") == 3000 - left[0] + 2
    assert "</details>" in said


# The page


def page(made: Report, drawn: dict[str, str] | None = None) -> str:
    return "\n".join(html.page(made, drawn or {}))


def policy(words: Words) -> str:
    (meta,) = (
        given_attributes
        for tag, given_attributes in words.elements
        if tag == "meta" and given_attributes.get("http-equiv") == "Content-Security-Policy"
    )
    return meta["content"] or ""


def test_the_page_has_everything_in_it() -> None:
    made = held(*ABC, finished("d", Ending.CRASHED, "killed by signal 11"))
    words = parsed(page(made, {"d": "There is no picture: the file is damaged"}))
    texts = [said for _, said in words.texts]
    assert "nightly" in texts
    assert made.verdict in texts
    assert "killed by signal 11" in texts
    assert "There is no picture: the file is damaged" in texts
    assert any("iterations is 20" in said for said in texts)
    open_cases = [
        given_attributes["data-name"]
        for tag, given_attributes in words.elements
        if tag == "details" and "open" in given_attributes
    ]
    assert open_cases == ["a", "d"]
    identities = [a["id"] for _, a in words.elements if "id" in a]
    assert len(identities) == len(set(identities))
    links = [a["href"] or "" for tag, a in words.elements if tag == "a"]
    assert {link.removeprefix("#") for link in links} <= set(identities)
    assert len(links) == 4


def test_the_page_loads_nothing_and_runs_its_own_script_alone() -> None:
    import hashlib

    text_of_page = page(held(*ABC, *OF_EACH), {"crashed": "data:image/svg+xml;base64,AAAA"})
    words = parsed(text_of_page)
    said = policy(words)
    assert "default-src 'none'" in said
    assert "unsafe" not in said
    for kind in ("style", "script"):
        (source,) = re.findall(rf"<{kind}>(.*?)</{kind}>", text_of_page, re.DOTALL)
        digest = base64.b64encode(hashlib.sha256(source.encode()).digest()).decode()
        assert f"{kind}-src 'sha256-{digest}'" in said
        assert "http" not in source
        assert "url(" not in source
    for tag, given_attributes in words.elements:
        assert tag not in ("link", "iframe", "object", "form", "base")
        assert not {"style", "srcset", "action"} & set(given_attributes)
        assert not [name for name in given_attributes if name.startswith("on")]
        source_of = given_attributes.get("src") or given_attributes.get("href") or "#"
        assert source_of.startswith(("#", "data:image/svg+xml;base64,"))


@pytest.mark.parametrize(
    "tricky", [*TRICKY, '" onload="x', "' autofocus '", "</title>", "</style>"]
)
def test_the_page_takes_texts_for_texts(tricky: str) -> None:
    check_texts(tricky)


@settings(deadline=None)
@given(st.text(min_size=1, max_size=40))
def test_the_page_takes_any_text_for_a_text(anything: str) -> None:
    check_texts(anything)


def check_texts(anything: str) -> None:
    given_case = {"options": {anything: anything}, "constants": {anything: anything}}
    case = finished(
        anything,
        Ending.OUTSIDE,
        f"m{anything}",
        checks=(outside("cost", anything),),
        result=Path("a.h5"),
        case=given_case,
        cost=1.0,
        certificate=anything,
    )
    row = Difference(anything, "cost", Verdict.WORSE, 1.0, anything, 1.0, anything)
    gone = Difference(f"{anything}!", ENDING, Verdict.MISSING, "solved", None)
    made = held(case, rows=(row, gone), suite=anything)
    plain = finished("a", Ending.OUTSIDE, "m", checks=(outside(),), result=Path("a.h5"), cost=1.0)
    known = held(
        Finished(
            Case("a", "van_der_pol", {"o": "v"}, {"c": "v"}),
            plain.ending,
            "m",
            {"cost": 1.0, "certificate": "w"},
            plain.checks,
            0.5,
            Path("a.h5"),
        ),
        rows=(
            Difference("a", "cost", Verdict.WORSE, 1.0, "w", 1.0, "n"),
            Difference("b", ENDING, Verdict.MISSING, "solved", None),
        ),
    )
    words, expected = parsed(page(made, {anything: anything})), parsed(page(known, {"a": "s"}))
    assert [tag for tag, _ in words.elements] == [tag for tag, _ in expected.elements]
    assert [list(a) for _, a in words.elements] == [list(a) for _, a in expected.elements]


def test_a_picture_is_of_the_answer(solve: Callable[..., Any], tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    solve("van_der_pol", steps=10).save(path)
    damaged = tmp_path / "b.h5"
    damaged.write_bytes(b"no HDF5")
    run = report(
        finished("a", Ending.OUTSIDE, result=path),
        finished("b", Ending.OUTSIDE, result=damaged),
        finished("c", Ending.CRASHED),
        finished("d", result=path),
    )
    drawn = pictures(run, "failed")
    assert set(drawn) == {"a", "b"}
    assert drawn["b"].startswith("There is no picture: ")
    head, _, data = drawn["a"].partition(",")
    assert head == "data:image/svg+xml;base64"
    picture = base64.b64decode(data).decode()
    assert "<svg" in picture
    assert "<script" not in picture
    assert set(pictures(run, "all")) == {"a", "b", "d"}
    assert pictures(run, "none") == {}
    out = tmp_path / "page" / "run.html"
    html.write(run, out, "failed")
    words = parsed(out.read_text(encoding="utf-8"))
    sources = [a["src"] for tag, a in words.elements if tag == "img"]
    assert sources == [drawn["a"]]
    assert [entry.name for entry in out.parent.iterdir()] == ["run.html"]


def test_where_nearly_all_fail_not_all_are_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "quito_cli.batch.reports.pictures._picture", lambda case: "data:image/svg+xml,"
    )
    run = report(
        *(finished(f"{i}", Ending.OUTSIDE, result=Path("a.h5")) for i in range(MOST + 5)),
    )
    drawn = pictures(run, "failed")
    assert list(drawn) == [str(i) for i in range(MOST)]
    assert f"first {MOST} of these; 5 are not drawn" in page(run, dict(drawn))
    assert len(pictures(run, "all")) == MOST + 5


def test_which_pictures_there_are_to_choose_from() -> None:
    check_which("all")
    with pytest.raises(UsageError, match="expected failed, all or none, got 'some'"):
        check_which("some")
