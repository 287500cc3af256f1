"""JUnit XML: as the schema has it, whatever the texts are."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest
import xmlschema
from finished import OF_EACH, finished, outside, report
from hypothesis import given, settings
from hypothesis import strategies as st

from quito_cli.batch.judging.comparing import ENDING, Difference, Verdict
from quito_cli.batch.reports.junit import junit, write
from quito_cli.batch.reports.report import Report
from quito_cli.batch.suite.case import Ending

SCHEMA = xmlschema.XMLSchema(Path(__file__).parent / "schemas" / "junit.xsd")


def read(made: Report) -> ET.Element:
    """The XML of a run as a tree; it is as the schema has it."""
    text = junit(made)
    SCHEMA.validate(text)
    return ET.fromstring(text.encode())


def cases(root: ET.Element) -> dict[str, dict[str, Any]]:
    """By name of the case, what became of it, and its children."""
    found = {}
    for case in root.iter("testcase"):
        kinds = [child.tag for child in case if child.tag not in ("system-out", "properties")]
        found[case.attrib["name"]] = {"kinds": kinds, "case": case}
    return found


def test_each_ending_has_its_element() -> None:
    root = read(report(*OF_EACH))
    assert {name: found["kinds"] for name, found in cases(root).items()} == {
        "passed": [],
        "outside": ["failure"],
        "unsolved": ["error"],
        "refused": ["error"],
        "crashed": ["error"],
        "timed_out": ["error"],
        "out_of_memory": ["error"],
        "interrupted": ["skipped"],
    }
    suite = root.find("testsuite")
    assert suite is not None
    counts = {name: suite.attrib[name] for name in ("tests", "failures", "errors", "skipped")}
    assert counts == {"tests": "8", "failures": "1", "errors": "5", "skipped": "1"}
    assert root.attrib["tests"] == "8"
    assert root.attrib["time"] == "12.000"


def test_a_case_says_what_is_wrong_and_what_was_found() -> None:
    case = finished(
        "vdp[steps=50]",
        Ending.OUTSIDE,
        checks=(outside(),),
        cost=2.0,
        switching_times=(1.25, 2.5),
        seconds=1234.5678,
        result=Path("results/vdp.h5"),
        case={"options": {"steps": 50}, "constants": {"mu": 0.5}},
    )
    element = cases(read(report(case)))["vdp[steps=50]"]["case"]
    assert element.attrib["classname"] == "nightly.van_der_pol"
    assert element.attrib["time"] == "1234.568"
    failure = element.find("failure")
    assert failure is not None
    assert failure.attrib == {"type": "outside", "message": "cost is 2, expected 1 ± 1e-06"}
    said = element.findtext("system-out") or ""
    for line in (
        "- cost is 2, expected 1 ± 1e-06",
        "cost = 2",
        "switching_times = [1.25, 2.5]",
        "option steps = 50",
        "set mu = 0.5",
        "result results/vdp.h5",
    ):
        assert line in said.splitlines(), line


def test_what_is_worse_than_the_baseline_fails() -> None:
    worse = Difference("a", "iterations", Verdict.WORSE, 10, 20, 3.0)
    gone = Difference("b", ENDING, Verdict.MISSING, "solved", None)
    better = Difference("c", "cost", Verdict.BETTER, 2.0, 1.0, 0.1)
    given = {"baseline": Path("b.yaml"), "differences": (worse, gone, better)}
    run = (finished("a"), finished("c"))
    root = read(report(*run, **given))
    kinds = {name: found["kinds"] for name, found in cases(root).items()}
    assert kinds == {"a": ["failure"], "b": ["failure"], "c": []}
    assert root.attrib["tests"] == "3"
    assert root.attrib["failures"] == "2"
    message = root.find(".//testcase[@name='a']/failure")
    assert message is not None
    assert message.attrib["message"] == "iterations is 20, baseline 10 ± 3"
    properties = {p.attrib["name"]: p.attrib["value"] for p in root.iter("property")}
    assert properties["baseline"] == "b.yaml"
    assert properties["verdict"] == (
        "1 of 2 cases failed: 1 worse than the baseline. "
        "Against the baseline: 1 worse, 1 missing, 1 better."
    )
    accepted = read(report(*run, **given, recorded=True))
    assert {name: found["kinds"] for name, found in cases(accepted).items()} == {"a": [], "c": []}


def test_a_run_without_cases() -> None:
    root = read(report())
    assert root.attrib["tests"] == "0"


@settings(deadline=None)
@given(st.text(), st.text(), st.text(), st.text())
def test_any_text_is_legal_and_comes_back(
    name: str, message: str, sentence: str, suite: str
) -> None:
    case = finished(name, Ending.OUTSIDE, message, checks=(outside("cost", sentence),))
    root = read(report(case, suite=suite))
    element = next(root.iter("testcase"))
    failure = element.find("failure")
    assert failure is not None
    for given_text, found in (
        (name, element.attrib["name"]),
        (suite, root.attrib["name"]),
        (sentence, failure.attrib["message"]),
    ):
        plain = given_text.isprintable()
        assert not plain or found == given_text
        assert found.isprintable() or "\n" in given_text
    assert [child.tag for child in element] == ["failure", "system-out"]


@pytest.mark.parametrize("character", ["\0", "\x08", "\x1b", "\x7f", "\ud800", "\ufffe", "\u202e"])
def test_what_does_not_print_is_replaced(character: str) -> None:
    root = read(report(finished(f"a{character}b", message=f"]]>{character}<&\"'")))
    element = next(root.iter("testcase"))
    assert element.attrib["name"] == "a\ufffdb"
    assert (element.findtext("system-out") or "").startswith("]]>\ufffd<&\"'")


def test_the_schema_refuses_what_is_no_junit() -> None:
    """Each of these mistakes would be seen."""
    text = junit(report(*OF_EACH))
    for right, wrong in (
        ('time="12.000"', 'time="1.2e1"'),
        (' failures="1"', ""),
        ("failure", "broken"),
        (' name="passed"', ""),
        ("testsuites", "suites"),
        ('errors="5"', 'errors="five"'),
    ):
        assert right in text
        assert not SCHEMA.is_valid(text.replace(right, wrong)), right


def test_the_file_is_written_whole(tmp_path: Path) -> None:
    path = tmp_path / "reports" / "junit.xml"
    write(report(*OF_EACH), path)
    SCHEMA.validate(str(path))
    assert path.read_text(encoding="utf-8").startswith('<?xml version="1.0" encoding="UTF-8"?>\n')
    assert [entry.name for entry in path.parent.iterdir()] == ["junit.xml"]
