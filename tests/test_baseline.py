"""Baselines: what is better and what worse, and files that reviewers can read."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest
from documents import blocks
from finished import answered, finished, outside
from hypothesis import given, settings
from hypothesis import strategies as st

from quito_cli.batch.judging import baseline_file, calibration
from quito_cli.batch.judging.baseline import Baseline, measured, rounded, updated
from quito_cli.batch.judging.comparing import (
    ENDING,
    Difference,
    Verdict,
    compare,
    judged,
    maximises,
    same,
)
from quito_cli.batch.judging.figures import COSTLY, FIGURES, TIMES
from quito_cli.batch.judging.rules import RULES, Better, Rule, Tolerance
from quito_cli.batch.suite.case import Case, Ending, Figure, Finished
from quito_cli.errors import ResultFileError, UsageError
from quito_cli.problem.text.complaints import ProblemError
from quito_cli.problem.text.strict_yaml import read

WORSE, BETTER, SAME = Verdict.WORSE, Verdict.BETTER, Verdict.SAME
NEW, MISSING = Verdict.NEW, Verdict.MISSING


def minimised(_: Case) -> bool:
    return False


def maximised(_: Case) -> bool:
    return True


def against(
    before: dict[str, Figure],
    after: dict[str, Figure],
    baseline: Baseline | None = None,
    *,
    maximize: bool = False,
) -> dict[str, Difference]:
    """The verdict on each figure of a case that had others before."""
    given = baseline or Baseline()
    kept = Baseline({"a": before}, given.tolerances, given.exceptions)
    sense = maximised if maximize else minimised
    run = [answered("a", after)]
    rows = compare(kept, run, None, sense, ["a"])
    return {row.figure: row for row in rows}


def verdicts(rows: dict[str, Difference]) -> dict[str, Verdict]:
    return {name: row.verdict for name, row in rows.items()}


# Rules


def test_there_is_a_rule_for_every_figure() -> None:
    assert {rule.of or name for name, rule in RULES.items()} == set(FIGURES)
    assert {rule.of for rule in RULES.values() if rule.of} == TIMES


def test_the_same_is_within_the_larger_tolerance_the_limit_included() -> None:
    rule = Rule(Better.SMALLER, Tolerance(0.5, 0.25))
    for before, after, verdict in (
        (1.0, 1.5, SAME),  # absolute: 0.5 > 0.25
        (1.0, 1.5000001, WORSE),
        (1.0, 0.4999999, BETTER),
        (4.0, 5.0, SAME),  # relative: 1 > 0.5
        (4.0, 5.0000001, WORSE),
        (4.0, 2.9, BETTER),
        (-4.0, 4.0, SAME),  # errors are judged by their size
        (math.inf, math.inf, SAME),
        (math.inf, 1e9, BETTER),
        (1e9, math.inf, WORSE),
        (0, 1, WORSE),
    ):
        assert judged(before, after, rule.tolerance, rule)[0] is verdict, (before, after)


def test_larger_is_better_only_where_the_rule_says_so() -> None:
    exact = Tolerance(0, 0)
    assert judged(False, True, exact, Rule(Better.LARGER, exact))[0] is BETTER
    assert judged(True, False, exact, Rule(Better.LARGER, exact))[0] is WORSE
    assert judged(1, 2, exact, Rule(Better.NEITHER, exact))[0] is WORSE
    assert judged(2, 1, exact, Rule(Better.NEITHER, exact))[0] is WORSE


def test_words_have_an_order_where_the_rule_gives_one() -> None:
    rule = RULES["certificate"]
    assert judged("passed", "passed", rule.tolerance, rule)[0] is SAME
    assert judged("passed", "fails", rule.tolerance, rule)[0] is WORSE
    assert judged("fails", "passed", rule.tolerance, rule)[0] is BETTER
    status = RULES["status"]
    assert judged("solved", "infeasible", status.tolerance, status)[0] is WORSE
    assert judged("infeasible", "solved", status.tolerance, status)[0] is WORSE


def test_lists_are_compared_entry_by_entry() -> None:
    rule = Rule(Better.NEITHER, Tolerance(0.01, 0))
    for before, after, verdict in (
        ((1.0, 2.0), (1.009, 1.991), SAME),
        ((1.0, 2.0), (1.0, 2.011), WORSE),
        ((1.0, 2.0), (1.0, 2.0, 3.0), WORSE),
        ((), (), SAME),
        ((math.inf,), (math.inf,), SAME),
        ((math.nan,), (math.nan,), SAME),
        ((1.0,), (math.nan,), WORSE),
    ):
        assert judged(before, after, rule.tolerance, rule)[0] is verdict, (before, after)


def test_what_is_of_another_kind_is_worse() -> None:
    rule = RULES["switching_times"]
    assert judged((1.0,), 1.0, rule.tolerance, rule)[0] is WORSE
    assert judged("passed", 1.0, rule.tolerance, rule)[0] is WORSE


@settings(deadline=None)
@given(
    st.floats(allow_nan=False),
    st.floats(allow_nan=False),
    st.floats(0, 1e6),
    st.floats(0, 10),
    st.sampled_from([Better.SMALLER, Better.LARGER]),
)
def test_what_is_better_one_way_is_worse_the_other(
    a: float, b: float, absolute: float, relative: float, better: Better
) -> None:
    rule = Rule(better, Tolerance(absolute, 0))
    there, back = judged(a, b, rule.tolerance, rule)[0], judged(b, a, rule.tolerance, rule)[0]
    assert {there, back} in ({SAME}, {BETTER, WORSE})
    wide = Rule(better, Tolerance(absolute, relative))
    assert judged(a, a, wide.tolerance, wide)[0] is SAME
    assert judged(a, b, wide.tolerance, wide)[0] in (SAME, there)


# Costs


def test_without_a_reference_the_lower_cost_is_better_in_a_minimisation() -> None:
    before: dict[str, Figure] = {"cost": 2.0, "violation": 1e-9, "resimulation_gap": 1e-7}
    lower, higher = {**before, "cost": 1.9}, {**before, "cost": 2.1}
    assert against(before, lower)["cost"].verdict is BETTER
    assert against(before, higher)["cost"].verdict is WORSE
    assert against(before, lower, maximize=True)["cost"].verdict is WORSE
    assert against(before, higher, maximize=True)["cost"].verdict is BETTER
    assert against(before, {**before, "cost": 2.000001})["cost"].verdict is SAME


@pytest.mark.parametrize("evidence", ["violation", "resimulation_gap"])
def test_a_cost_is_no_better_where_its_evidence_is_worse(evidence: str) -> None:
    before: dict[str, Figure] = {"cost": 2.0, "violation": 1e-9, "resimulation_gap": 1e-7}
    rows = against(before, {**before, "cost": 1.9, evidence: 0.01})
    assert rows["cost"].verdict is WORSE
    assert evidence.replace("_", " ") in rows["cost"].note
    lost = {name: value for name, value in before.items() if name != evidence}
    assert against(before, {**lost, "cost": 1.9})["cost"].verdict is WORSE


@pytest.mark.parametrize(
    ("before", "after", "verdict", "claims"),
    [
        (1.001, 1.0001, BETTER, False),  # towards the optimum from above
        (1.0001, 1.001, WORSE, False),
        (0.999, 0.9999, BETTER, False),  # from below: the cost rises, and is better
        (0.9999, 0.999, WORSE, True),
        (1.0001, 0.999, WORSE, True),  # from above the optimum to below it, and further off
        (1.001, 0.9999, BETTER, False),
    ],
)
def test_with_a_reference_the_cost_nearer_to_it_is_better(
    before: float, after: float, verdict: Verdict, claims: bool
) -> None:
    rows = against(
        {"cost": before, "cost_error": float(f"{abs(before - 1):.2g}")},
        {"cost": after, "cost_error": abs(after - 1)},
    )
    assert rows["cost"].verdict is verdict
    assert ("claims more than can be had" in rows["cost"].note) is claims
    if claims:
        assert rows["cost"].note.startswith("below")


def test_of_a_maximisation_the_optimum_is_exceeded_from_above() -> None:
    rows = against(
        {"cost": 1.0001, "cost_error": 1e-4}, {"cost": 1.01, "cost_error": 0.01}, maximize=True
    )
    assert rows["cost"].verdict is WORSE
    assert rows["cost"].note.startswith("above the known optimum")


def test_the_sense_is_that_of_the_problem() -> None:
    assert maximises(Case("a", "orbit_transfer"))
    assert not maximises(Case("a", "van_der_pol"))
    assert not maximises(Case("a", "no_such_problem"))
    text = """
        time: {initial: 0, final: 1}
        states: {x: {initial: 0}}
        controls: {u: {lower: 0, upper: 1}}
        dynamics: {x: u}
        cost: {mayer: x}
        sense: maximize
    """
    assert maximises(Case("a", "elsewhere.yaml", text=text))


# Cases


def test_figures_and_cases_that_one_side_alone_has() -> None:
    rows = against({"cost": 1.0, "iterations": 10}, {"cost": 1.0, "violation": 0.0})
    assert verdicts(rows) == {"cost": SAME, "iterations": MISSING, "violation": NEW}
    assert "not looked for" in rows["iterations"].note
    assert against({"error_l2": 1.0}, {"error_l2": None})["error_l2"].note == ""
    assert against({"cost": 1.0}, {"cost": math.nan})["cost"].verdict is MISSING
    kept = Baseline({"gone": {"cost": 1.0}, "a": {"cost": 1.0}})
    run = [finished("a", cost=1.0), finished("b", cost=1.0)]
    rows_of = compare(kept, run, None, minimised, ["a", "b"])
    assert [(row.case, row.figure, row.verdict) for row in rows_of] == [
        ("a", "cost", SAME),
        ("b", ENDING, NEW),
        ("gone", ENDING, MISSING),
    ]
    part = compare(kept, run, None, minimised, None)
    assert [row.verdict for row in part] == [SAME, NEW]


@pytest.mark.parametrize("ending", Ending)
def test_an_ending_without_an_answer_is_worse_than_an_answer(ending: Ending) -> None:
    kept = Baseline({"a": {"cost": 1.0}})
    figures: dict[str, Figure] = {"cost": 1.0} if ending in (Ending.PASSED, Ending.OUTSIDE) else {}
    found = compare(kept, [answered("a", figures, ending)], None, minimised, ["a"])
    expected = {
        Ending.PASSED: [("cost", SAME)],
        Ending.OUTSIDE: [("cost", SAME)],
        Ending.INTERRUPTED: [],
    }.get(ending, [(ENDING, WORSE)])
    assert [(row.figure, row.verdict) for row in found] == expected
    assert compare(Baseline(), [finished("a", ending)], None, minimised, ["a"]) == (
        (Difference("a", ENDING, NEW, None, "solved"),)
        if ending in (Ending.PASSED, Ending.OUTSIDE)
        else ()
    )


def test_tolerances_of_a_case_win_over_those_of_the_baseline() -> None:
    before: dict[str, Figure] = {"iterations": 20, "cost": 1.0, "violation": 0.0}
    after: dict[str, Figure] = {"iterations": 30, "cost": 1.5, "violation": 1.0}
    assert verdicts(against(before, after)) == dict.fromkeys(before, WORSE)
    declared: dict[str, Tolerance | None] = {"iterations": Tolerance(10, 0), "violation": None}
    given = Baseline({}, declared, {"a": {"violation": Tolerance(1, 0)}, "b": {"cost": None}})
    assert verdicts(against(before, after, given)) == {
        "iterations": SAME,
        "cost": WORSE,
        "violation": SAME,
    }
    ignoring = Baseline({}, {"violation": None}, {"a": {"cost": None, "iterations": None}})
    assert against(before, after, ignoring) == {}


# Recording


def test_times_are_recorded_in_calibration_solves() -> None:
    case = finished("a", solve_seconds=0.3, processor_seconds=0.1, cost=1.0)
    found = measured(Baseline(), case, 0.05)
    assert found == pytest.approx({"cost": 1.0, "processor_time": 2.0})
    clocked = Baseline({}, {"solve_time": Tolerance(1, 1)})
    assert measured(clocked, case, 0.05)["solve_time"] == pytest.approx(6.0)
    assert measured(Baseline(), case, None) == {"cost": 1.0}


def test_without_a_calibration_times_are_left_alone() -> None:
    kept = Baseline({"a": {"cost": 1.0, "processor_time": 5.0}})
    run = [finished("a", cost=2.0, processor_seconds=0.3)]
    rows = compare(kept, run, None, minimised, ["a"])
    assert [(row.figure, row.verdict) for row in rows] == [("cost", WORSE)]
    made = updated(kept, run, same(rows), None, ["a"])
    assert made.cases["a"] == {"cost": 2.0, "processor_time": 5.0}


def test_a_certificate_that_fails_is_recorded_without_its_figures() -> None:
    told = "dH/du = 0, by 1e-02 of its scale at t = 1.25"
    assert measured(Baseline(), finished("a", certificate=told), None) == {"certificate": "fails"}
    passed = measured(Baseline(), finished("a", certificate="passed"), None)
    assert passed == {"certificate": "passed"}


def test_a_case_that_is_expected_to_fail_has_no_figures() -> None:
    case = finished("a", cost=1.0, success=False)
    made = recorded(Baseline(), [case])
    assert made.cases == {"a": {}}
    again = baseline_file.parse(baseline_file.text(made), "b.yaml")
    assert compare(again, [case], None, minimised, ["a"]) == ()
    solved = [finished("a", cost=1.0, success=True)]
    assert [row.verdict for row in compare(again, solved, None, minimised, ["a"])] == [NEW]


def test_a_figure_is_recorded_where_its_rule_or_a_tolerance_says_so() -> None:
    case = finished("a", cost=1.0, final_time=4.0, switching_times=(1.0,))
    assert measured(Baseline(), case, None) == {"cost": 1.0}
    named = Baseline({}, {"final_time": Tolerance(0, 1e-6), "cost": None})
    assert measured(named, case, None) == {"final_time": 4.0}
    own = Baseline({}, {}, {"a": {"switching_times": Tolerance(1e-3, 0)}})
    assert measured(own, case, None) == {"cost": 1.0, "switching_times": (1.0,)}


def test_what_it_takes_to_be_compared_is_known_before() -> None:
    usual = {name for name, rule in RULES.items() if rule.recorded}
    assert Baseline().costly == usual & COSTLY != frozenset()
    assert Baseline().timed
    off: dict[str, Tolerance | None] = dict.fromkeys(["processor_time", *COSTLY])
    assert not Baseline({}, off).timed
    assert Baseline({}, off).costly == frozenset()
    back = Baseline({}, off, {"a": {"build_time": Tolerance(1, 1), "error_l2": Tolerance(1, 1)}})
    assert back.timed
    assert back.costly == {"error_l2"}


def run_of(**figures: Figure) -> list[Finished]:
    return [answered("a", figures)]


def recorded(kept: Baseline, run: list[Finished], *, part: bool = False) -> Baseline:
    """The baseline after a run of the whole suite, or of a part of it."""
    everything = None if part else [case.case.name for case in run]
    rows = compare(kept, run, None, minimised, everything)
    return updated(kept, run, same(rows), None, everything)


def test_updating_keeps_what_is_the_same() -> None:
    first = recorded(Baseline(), run_of(cost=1.23456789, iterations=20))
    noisy = recorded(first, run_of(cost=1.23456789 + 1e-7, iterations=22))
    assert baseline_file.text(noisy) == baseline_file.text(first)
    moved = recorded(first, run_of(cost=1.24, iterations=22))
    assert moved.cases["a"] == {"cost": 1.24, "iterations": 20}


def test_a_figure_cannot_creep_from_update_to_update() -> None:
    kept = recorded(Baseline(), run_of(error_l2=0.1))
    for step in range(1, 6):  # 5 % each: the tolerance is 20 %
        run = run_of(error_l2=0.1 * 1.05**step)
        worse = [r for r in compare(kept, run, None, minimised, ["a"]) if r.verdict is WORSE]
        kept = recorded(kept, run)
        if worse:
            break
    assert step == 4


def test_a_case_without_answer_keeps_its_record_and_one_that_is_gone_loses_it() -> None:
    kept = Baseline({"a": {"cost": 1.0}, "b": {"cost": 2.0}}, {}, {"b": {"cost": None}})
    run = [finished("a", Ending.CRASHED), finished("c", Ending.TIMED_OUT), finished("d", cost=3.0)]
    made = recorded(kept, run)
    assert made.cases == {"a": {"cost": 1.0}, "d": {"cost": 3.0}}
    assert made.exceptions == {}
    part = recorded(kept, run[2:], part=True)
    assert part.cases == {**kept.cases, "d": {"cost": 3.0}}
    assert part.exceptions == kept.exceptions


def test_tolerances_that_people_have_changed_stay() -> None:
    wide = Tolerance(0.5, 0.5)
    kept = Baseline({}, {"cost": wide, "violation": None})
    made = recorded(kept, run_of(cost=1.0, violation=0.1, iterations=5))
    assert made.tolerances == {
        "cost": wide,
        "violation": None,
        "iterations": RULES["iterations"].tolerance,
    }
    assert made.cases["a"] == {"cost": 1.0, "iterations": 5}


def test_an_answer_outside_its_expectations_is_recorded_all_the_same() -> None:
    run = [finished("a", Ending.OUTSIDE, checks=(outside(),), cost=2.0)]
    assert recorded(Baseline(), run).cases == {"a": {"cost": 2.0}}


@settings(deadline=None)
@given(
    st.floats(-1e12, 1e12, allow_subnormal=False),
    st.floats(0, 1, allow_subnormal=False),
    st.floats(0, 1, allow_subnormal=False),
)
def test_rounding_takes_a_twentieth_of_the_tolerance_at_most(
    value: float, absolute: float, relative: float
) -> None:
    tolerance = Tolerance(absolute, relative)
    short = rounded(value, tolerance)
    assert isinstance(short, float)
    assert abs(short - value) <= tolerance.of(value) / 20


def test_figures_have_sensible_digits() -> None:
    assert rounded(0.023456789, Tolerance(0, 0.2)) == 0.0235  # within 2.3e-4
    assert rounded(0.7576179286593919, Tolerance(0, 1e-6)) == 0.7576179
    assert rounded(1234567.89, Tolerance(1e5, 0)) == 1.23e6
    assert rounded(17, Tolerance(3, 0.2)) == 17
    assert rounded(4.5e-13, Tolerance(0.5, 0.2)) == 0
    assert rounded((1.23456, 23.4567), Tolerance(0.1, 0)) == (1.23, 23.46)
    assert rounded(math.inf, Tolerance(0, 1)) == math.inf
    assert rounded("passed", Tolerance(0, 0)) == "passed"


# Files

TEXT = """\
format: 1
tolerances:
  cost: {absolute: 1.0e-09, relative: 1.0e-06}
  iterations: {absolute: 3, relative: 0.2}
  solve_time: ignore
exceptions:
  "a[steps=50]":
    cost: {absolute: 0.5, relative: 0}
cases:
  a:
    certificate: passed
    cost: -1.5
    iterations: 12
    success: true
    switching_times: [0.5, 1.0e-05]
  "a[steps=50]":
    cost: .inf
    switching_times: []
"""
WRITTEN = Baseline(
    {
        "a[steps=50]": {"switching_times": (), "cost": math.inf},
        "a": {
            "cost": -1.5,
            "iterations": 12,
            "certificate": "passed",
            "switching_times": (0.5, 1e-5),
            "success": True,
        },
    },
    {
        "solve_time": None,
        "iterations": Tolerance(3, 0.2),
        "cost": Tolerance(1e-9, 1e-6),
    },
    {"a[steps=50]": {"cost": Tolerance(0.5, 0)}},
)


def test_a_file_is_sorted_and_reads_well() -> None:
    comment, _, rest = baseline_file.text(WRITTEN).partition("format:")
    assert f"format:{rest}" == TEXT
    assert all(line.startswith("#") for line in comment.splitlines())


def test_what_is_written_is_read() -> None:
    assert baseline_file.parse(baseline_file.text(WRITTEN), "b.yaml") == WRITTEN
    empty = Baseline()
    assert baseline_file.parse(baseline_file.text(empty), "b.yaml") == empty


NAMES = st.text(
    st.characters(exclude_categories=["Cs"], exclude_characters="\0"), min_size=1, max_size=40
)
NUMBERS = st.floats(allow_nan=False) | st.integers(-(10**12), 10**12) | st.booleans()


@settings(deadline=None)
@given(
    st.dictionaries(
        NAMES,
        st.fixed_dictionaries(
            {"cost": NUMBERS, "switching_times": st.lists(st.floats(allow_nan=False)).map(tuple)}
        ),
        max_size=4,
    )
)
def test_any_name_and_number_comes_back(cases: dict[str, dict[str, Figure]]) -> None:
    kept = Baseline(cases)
    text = baseline_file.text(kept)
    assert baseline_file.parse(text, "b.yaml") == kept
    assert text.isprintable() or {c for c in text if not c.isprintable()} == {"\n"}
    assert list(read(text, "b").data["cases"] or {}) == sorted(cases)


WRONG = [
    ("cases: {}", "`format: 1` is missing"),
    ("format: 2\ncases: {}", "1:9: format 2 is unknown; this quito reads 1"),
    ("format: true", "format True is unknown"),
    ("format: 1\ncase:\n  a: {}", "2:1: there is no section 'case'; did you mean 'cases'?"),
    ("format: 1\ncases: [1]", "2:8: expected names"),
    ("format: 1\ncases:\n  a: 3", "3:6: expected names"),
    ("format: 1\ncases:\n  a: {csot: 3}", "3:7: there is no figure 'csot'; did you mean 'cost'?"),
    ("format: 1\ncases:\n  a: {cost: {b: 3}}", "3:13: expected a number, a word or a list"),
    ("format: 1\ncases:\n  a: {cost: }", "3:13: expected a number, a word or a list"),
    ("format: 1\ncases:\n  a: {switching_times: [1, b]}", "expected a number"),
    ("format: 1\ncases:\n  a: {cost: 3}\n  a: {cost: 3}", "4:3: duplicate key 'a'"),
    ("format: 1\ntolerances: {cost: 1}", "expected {absolute: 1e-6, relative: 0.1}, one of them"),
    ("format: 1\ntolerances: {cost: {}}", "expected {absolute: 1e-6"),
    ("format: 1\ntolerances: {cost: {absolut: 1}}", "did you mean 'absolute'?"),
    ("format: 1\ntolerances: {cost: {absolute: -1}}", "expected a number of zero or more"),
    ("format: 1\ntolerances: {cost: {relative: .nan}}", "expected a number of zero or more"),
    ("format: 1\ntolerances: {cost: {relative: yes}}", "expected a number of zero or more"),
    ("format: 1\nexceptions: {b: {}}\ncases: {a: {}}", "2:14: there is no case 'b'"),
    ("format: 1\ncases: &x {}", "anchors are not read"),
    ("", "the file is empty"),
]


@pytest.mark.parametrize(("text", "message"), WRONG, ids=range(len(WRONG)))
def test_mistakes_are_told_with_their_place(text: str, message: str) -> None:
    with pytest.raises(ProblemError) as refused:
        baseline_file.parse(text, "b.yaml")
    assert message in str(refused.value)
    assert str(refused.value).startswith("b.yaml:")
    assert refused.value.exit_code == 2


def test_all_mistakes_are_told_at_once() -> None:
    with pytest.raises(ProblemError) as refused:
        baseline_file.parse("format: 3\ntolerances: {a: 1}\ncases: {a: {b: 1}}", "b.yaml")
    assert len(refused.value.complaints) == 3


def test_files_are_written_whole_and_refused_plainly(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "baseline.yaml"
    with pytest.raises(UsageError, match="--update-baseline makes one"):
        baseline_file.read(path)
    baseline_file.write(WRITTEN, path)
    assert baseline_file.read(path) == WRITTEN
    assert [entry.name for entry in path.parent.iterdir()] == ["baseline.yaml"]
    long = Baseline({"a" * 1001: {"cost": 1.0}})
    with pytest.raises(UsageError, match="too long"):
        baseline_file.write(long, path)
    assert baseline_file.read(path) == WRITTEN
    with pytest.raises(UsageError, match="too long"):
        baseline_file.write(Baseline({"\n" * 100: {"cost": 1.0}}), path)
    longest = Baseline({"\n" * 99: {"cost": 1.0}})
    baseline_file.write(longest, path)
    assert baseline_file.read(path) == longest
    path.write_bytes(b"\xff\xfe")
    with pytest.raises(UsageError, match="UTF-8"):
        baseline_file.read(path)
    with pytest.raises(UsageError, match="cannot be read"):
        baseline_file.read(tmp_path)
    with pytest.raises(ResultFileError, match="cannot be written"):
        baseline_file.write(WRITTEN, path / "below")


# Calibration


def test_the_calibration_solve_is_a_solve() -> None:
    """Of the Van der Pol oscillator, whose optimum is known; controls constant in 50 cells."""
    assert calibration.solve() == pytest.approx(0.7576179286593919, abs=1e-3)


def test_a_calibration_is_the_fastest_of_its_solves(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first one, which loads IPOPT, does not count."""
    took = iter([0.01, 0.5, 0.4, 0.3, 0.7, 7.0])
    clock = 0.0

    def solve() -> float:
        nonlocal clock
        clock += next(took)
        return 0.0

    monkeypatch.setattr(calibration, "solve", solve)
    monkeypatch.setattr(calibration, "processor_seconds", lambda: clock)
    assert calibration.calibrate() == pytest.approx(0.3)
    assert next(took, None) is None


# The guide

GUIDE = (Path(__file__).parent.parent / "problems" / "batch.md").read_text(encoding="utf-8")


def test_the_guide_has_the_tolerances() -> None:
    said = {}
    for names, absolute, relative, better in re.findall(
        r"^\| (`\w+`(?:, `\w+`)*) \| (\S+) \| (\S+) \| (.+) \|$", GUIDE, re.M
    ):
        for name in re.findall(r"\w+", names):
            said[name] = (Tolerance(float(absolute), float(relative)), better)
    recorded_by_default = {name: rule for name, rule in RULES.items() if rule.recorded}
    assert {name: given[0] for name, given in said.items()} == {
        name: rule.tolerance for name, rule in recorded_by_default.items()
    }
    for name, (_, better) in said.items():
        is_smaller = RULES[name].better is Better.SMALLER
        assert (better == "smaller") is is_smaller, name
    assert [v.value for v in Verdict if f"| {v.value} |" in GUIDE] == [v.value for v in Verdict]
    fails = re.findall(r"^\| (\w+) \| .* \| ends with 3 \|$", GUIDE, re.M)
    assert fails == [v.value for v in Verdict if v.fails]


def test_the_tolerances_shown_in_the_guide_are_read() -> None:
    (text,) = [block.text for block in blocks(GUIDE) if block.mark == "baseline: tolerances"]
    given = baseline_file.parse(f"format: 1\n{text}cases: {{van_der_pol: {{}}}}\n", "b.yaml")
    assert given.tolerance("van_der_pol", "iterations") == Tolerance(20, 0)
    assert given.tolerance("other", "iterations") == RULES["iterations"].tolerance
    assert given.tolerance("other", "cost") == Tolerance(0, 1e-4)
    assert given.tolerance("other", "switching_times") == Tolerance(0.01, 0)
    assert not given.timed
