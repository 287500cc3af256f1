"""Suite files: what they may say, what is said of mistakes, and the cases that they come to."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

import pytest
from documents import run
from jsonschema import Draft7Validator
from pydantic import BaseModel

import quito_cli as quito
from quito_cli.batch import suite as suites
from quito_cli.batch.case import Case, Expectation
from quito_cli.batch.expansion import OPTIONS
from quito_cli.batch.figures import FIGURES
from quito_cli.batch.gathering import gather, selected
from quito_cli.batch.limits import Limits, bytes_of
from quito_cli.batch.schema_expect import Expect
from quito_cli.batch.schema_suite import CaseLimits, Entry, Shared, SuiteFile, suite_schema_text
from quito_cli.batch.suite import Suite, load_suite
from quito_cli.errors import UsageError
from quito_cli.problem.library import bundled, bundled_suites
from quito_cli.problem.options import FileOptions
from quito_cli.problem.text.complaints import ProblemError
from quito_cli.problem.text.strict_yaml import read

ROOT = Path(__file__).parent.parent
COMMITTED = ROOT / "schemas" / "suite.schema.json"
CART = """\
title: Cart
constants: {k: 1, steps: 2}
time: {initial: 0, final: 1}
states: {x: {initial: 0, final: 1}}
controls: {u: {}}
dynamics: {x: k*u}
cost: {lagrange: u^2}
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a problem, which is the working one."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cart.yaml").write_text(CART, encoding="utf-8")
    return tmp_path


def suite(folder: Path, text: str, name: str = "nightly.yaml") -> Suite:
    (folder / name).write_text(text, encoding="utf-8")
    return load_suite(name)


def complaints(folder: Path, text: str) -> list[str]:
    """What is said of a suite, a line for each mistake, without the file's name."""
    with pytest.raises(ProblemError) as raised:
        suite(folder, text)
    source = raised.value.source
    assert source is not None
    return [
        line.removeprefix(f"{source.name}:")
        for line in str(raised.value).splitlines()
        if line.startswith(f"{source.name}:")
    ]


def names(made: Suite) -> list[str]:
    return [case.name for case in made.cases]


# What a suite comes to


def test_a_problem_by_itself_is_a_case(folder: Path) -> None:
    made = suite(folder, "title: All\ncases: [cart.yaml, van_der_pol]\n")
    assert (made.name, made.title) == ("nightly", "All")
    path = str((folder / "cart.yaml").resolve())
    assert made.cases == (Case("cart", path), Case("van_der_pol", "van_der_pol"))
    assert made.limits == {"cart": Limits(None, None), "van_der_pol": Limits(None, None)}


def test_defaults_lie_under_cases_and_null_takes_them_back(folder: Path) -> None:
    made = suite(
        folder,
        """
        defaults:
          options: {steps: 20, variance: 2, solver: ipopt}
          set: {k: 3, constants.steps: 4}
          expect: {ringing: <= 2, iterations: 5}
          limits: {seconds: 60, memory: 2 GB}
        cases:
          - cart.yaml
          - problem: cart.yaml
            name: other
            options: {steps: 30, solver: null}
            set: {k: "1/2"}
            expect: {ringing: null, cost: 1 ± 1e-3}
            limits: {seconds: 5, memory: null}
        """,
    )
    first, other = made.cases
    assert first.options == {"steps": 20, "variance": 2.0, "solver": "ipopt"}
    assert first.constants == {"k": 3, "constants.steps": 4}
    assert other.options == {"steps": 30, "variance": 2.0}
    assert other.constants == {"k": "1/2", "constants.steps": 4}
    assert {one.figure for one in first.expectations} == {"ringing", "iterations"}
    assert {one.figure for one in other.expectations} == {"cost", "iterations"}
    assert made.limits == {
        "cart": Limits(60.0, 2 * 10**9),
        "other": Limits(5.0, None),
    }


def test_a_matrix_is_every_combination(folder: Path) -> None:
    made = suite(
        folder,
        """
        cases:
          - problem: cart.yaml
            options: {steps: 7, variance: 3}
            matrix: {steps: [50, 100], k: [0.1, "1/3"], normalised: [true]}
        """,
    )
    assert names(made) == [
        "cart[steps=50,k=0.1,normalised=true]",
        "cart[steps=50,k=1/3,normalised=true]",
        "cart[steps=100,k=0.1,normalised=true]",
        "cart[steps=100,k=1/3,normalised=true]",
    ]
    last = made.cases[-1]
    assert last.axes == {"steps": 100, "k": "1/3", "normalised": True}
    assert last.options == {"steps": 100, "variance": 3.0, "normalised": True}
    assert last.constants == {"k": "1/3"}, "a constant called steps is set by its path"


def test_includes_are_problems_and_suites(folder: Path) -> None:
    (folder / "more").mkdir()
    (folder / "more" / "b.yaml").write_text(CART, encoding="utf-8")
    (folder / "more" / "a.yml").write_text(CART, encoding="utf-8")
    (folder / "more" / "c.txt").write_text("neither", encoding="utf-8")
    (folder / ".hidden.yaml").write_text("half a file", encoding="utf-8")
    inner = "defaults: {options: {steps: 5}}\ncases: [b.yaml, {problem: b.yaml, name: again}]\n"
    (folder / "more" / "inner.yaml").write_text(inner, encoding="utf-8")
    made = suite(
        folder,
        """
        cases:
          - include: more/?.y*ml
            options: {steps: 9}
            matrix: {k: [1, 2]}
          - include: more/inner.yaml
          - include: "*.yaml"
        """,
    )
    of_glob = ["a[k=1]", "a[k=2]", "b[k=1]", "b[k=2]"]
    assert names(made) == [*of_glob, "inner/b", "inner/again", "cart"], "not itself"
    assert [case.options.get("steps") for case in made.cases] == [9, 9, 9, 9, 5, 5, None]
    assert made.cases[4].problem == str((folder / "more" / "b.yaml").resolve())


def test_expectations_in_all_their_forms(folder: Path) -> None:
    made = suite(
        folder,
        """
        cases:
          - problem: cart.yaml
            expect:
              cost: 0.75 ± 1e-6
              cost_error: -1 +- 0.5
              relative_cost_error: 2 ± 10 %
              error_l2: <= 0.01
              error_sup: ">=.5"
              state_error: {value: 3, absolute: 1, relative: 0.1, most: 3.5, least: 2}
              switching_times: {value: [1, 2.5], absolute: 0.1}
              iterations: 14
              cells: <= 200
              warnings: {most: 0}
              status: infeasible
              success: false
              certificate: passed
        """,
    )
    assert {one.figure: one for one in made.cases[0].expectations} == {
        one.figure: one
        for one in (
            Expectation("cost", 0.75, absolute=1e-6),
            Expectation("cost_error", -1.0, absolute=0.5),
            Expectation("relative_cost_error", 2.0, relative=0.1),
            Expectation("error_l2", most=0.01),
            Expectation("error_sup", least=0.5),
            Expectation("state_error", 3.0, 1.0, 0.1, 3.5, 2.0),
            Expectation("switching_times", (1.0, 2.5), absolute=0.1),
            Expectation("iterations", 14),
            Expectation("cells", most=200.0),
            Expectation("warnings", most=0.0),
            Expectation("status", "infeasible"),
            Expectation("success", False),
            Expectation("certificate", "passed"),
        )
    }


def test_every_figure_may_be_expected() -> None:
    assert list(FIGURES) == [*dict.fromkeys([*FIGURES, *Expect.model_fields])]
    assert set(Expect.model_fields) == set(FIGURES)


# Mistakes


STRUCTURE = """\
title: Wrong
defaults:
  options: {varience: 2, tol: 1e-6}
  expects: {ringing: <= 2}
  limits: {seconds: -1, memory: 2 XB}
cases:
  - problem: cart.yaml
    matrix: {steps: [50, [3]], k: 3}
    expect: {cost: 0.75, iterations: <= x, error_l3: <= 2, switching_times: [1, 2]}
  - problem: cart.yaml
    expect: {status: solve, violation: {value: 3}, ringing: {absolute: 1}, cost: {least: 2,
      most: 1}}
  - nothing
  - problem: cart.yaml
    set: {k: [1]}
    name: a/b
  - 5
"""


def test_all_mistakes_are_told_at_once_each_at_its_place(folder: Path) -> None:
    said = complaints(folder, STRUCTURE)
    near = "expected a value with its tolerance, or a limit: 0.75 ± 1e-6"
    assert said == [
        "3:13: unknown key 'varience'; did you mean 'variance'?",
        "3:26: unknown key 'tol'; did you mean 'tolerance'?",
        "4:3: unknown key 'expects'; did you mean 'expect'?",
        "5:21: expected a number above 0, got -1",
        "5:33: expected a size such as 500 MB or 2 GB, got '2 XB'",
        "8:26: expected a number, a word, an expression, or true or false, got a list",
        "8:35: expected a list of values, such as [50, 100], got 3",
        f"9:20: {near}, <= 0.01 or {{most: 0.01}}, got 0.75",
        f"9:38: {near}, 0.75 ± 0.1 %, <= 0.01 or '>= 2', got '<= x'",
        "9:44: unknown key 'error_l3'; did you mean 'error_l2'?",
        "9:77: expected times with a tolerance, such as {value: [0.5, 1], absolute: 0.01}, "
        "got a list",
        "11:22: expected solved, inaccurate, acceptable, infeasible, iteration_limit, time_limit, "
        "not_finite, stuck, diverged, too_few_freedoms or failed, got 'solve'; did you mean "
        "'solved'?",
        "11:40: say how near to the value: `absolute`, `relative`, or both",
        "11:61: a tolerance is of a `value`: say which, or write `most` or `least`",
        "11:82: `least` is above `most`: nothing can be between them",
        "13:5: there is no file nothing beside the suite, and no bundled problem of that name",
        "15:14: expected a number or an expression, got a list",
        "16:11: a name has letters, digits, '_', '.', '+' and '-', at most 80, got 'a/b'",
        "17:5: expected a problem, or a mapping such as {problem: cart.yaml}, got 5",
    ]


MEANING = """\
cases:
  - bang_bag
  - problem: cart.yaml
    matrix: {steps: [50, 0], kk: [1], mesh: [adaptiv], k: [1, 1]}
  - van_der_pol
  - van_der_pol
  - problem: cart.yaml
    set: {variance: 2, states.x.lower: 3, foo: 3, steps: 1}
  - include: x*.yaml
  - include: nightly.yaml
  - include: "../*/x*.yaml"
  - include: "**"
  - problem: nightly.yaml
  - problem: cart.txt
  - {problem: cart.yaml, include: cart.yaml}
  - {options: {steps: 3}}
  - {include: cart.yaml, name: x}
  - {include: inner.yaml, options: {steps: 3}, expect: {cost: <= 2}}
"""


def test_what_makes_no_sense_is_told_as_well(folder: Path) -> None:
    (folder / "cart.txt").write_text(CART, encoding="utf-8")
    (folder / "inner.yaml").write_text("cases: [cart.yaml]", encoding="utf-8")
    paths = "; other values are set by their path, such as states.x1.upper"
    both = "a case has a `problem`, or else an `include`"
    folders = "`*` and `?` stand in the name of the file only, not in that of a folder"
    assert complaints(folder, MEANING) == [
        "2:5: there is no file bang_bag beside the suite, and no bundled problem of that name; did "
        "you mean 'bang_bang'?",
        "4:26: expected at least 1, got 0",
        "4:30: the problem has no constant or option 'kk'; did you mean 'k'?",
        "4:46: expected uniform or adaptive, got 'adaptiv'; did you mean 'adaptive'?",
        "4:63: k takes this value already",
        "6:5: another case is called van_der_pol: give this one a `name`",
        "8:11: the problem has no constant 'variance'; that is an option: it belongs under "
        "`options:`",
        f"8:43: the problem has no constant 'foo'{paths}",
        "9:14: no problem or suite is called x*.yaml",
        "10:14: nightly.yaml includes itself",
        f"11:14: {folders}",
        f"12:14: {folders}",
        "13:14: nightly.yaml is a suite: write `include: nightly.yaml`",
        "14:14: cart.txt is no problem file: those end in .yaml or .yml",
        f"15:5: {both}",
        f"16:5: {both}",
        "17:26: what is included has its own names: leave `name` out",
        "18:15: inner.yaml is a suite, whose cases are taken as they stand there: leave `expect` "
        "and `options` out",
    ]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("cases: [{problem: wide.yaml, options: {steps: 20000}}]", "1:47: 20000 cells"),
        ("cases: [{problem: wide.yaml, matrix: {steps: [50, 9999]}}]", "1:46: 9999 cells"),
        ("cases: [{problem: wide.yaml, over: {steps: '9:9999:2'}}]", "1:44: 9999 cells"),
        (
            "defaults: {options: {mesh: adaptive, mesh_limit: 9999}}\ncases: [wide.yaml]",
            "1:50: 9999 cells",
        ),
        (
            "cases: [{problem: wide.yaml, options: {discretization: lgr, degree: 200}}]",
            "1:69: 100 cells of 200 points with 102 states and controls, which may take hours and "
            "all memory: take fewer",
        ),
        ("cases: [{problem: cart.yaml, options: {steps: 20001}}]", "1:47: expected at most 20000"),
    ],
)
def test_a_suite_asks_for_no_more_than_a_problem_file_may(
    text: str, said: str, folder: Path
) -> None:
    """102 states and controls with 9999 cells of two steps are two million unknowns."""
    wide = "time: {initial: 0, final: 1}\nstates: {x: {size: 100, initial: 0}, y: {initial: 0}}\n"
    wide += "controls: {u: {lower: -1, upper: 1}}\ndynamics: {x: -x, y: u}\ncost: {lagrange: u^2}\n"
    (folder / "wide.yaml").write_text(wide, encoding="utf-8")
    (found,) = complaints(folder, text)
    assert found.startswith(said)
    problem = folder / "wide.yaml"
    problem.write_text(wide + "options: {steps: 9999}\n", encoding="utf-8")
    with pytest.raises(UsageError, match=r"^the file asks for 9999 cells of 2 steps with 102"):
        quito.solve(problem)


HOSTILE = {
    "limits: {memory: '" + "9" * 400 + " GB'}": "is more than there is",
    "over: {k: '0." + "1" * 20_000 + ":2:3'}": "is no number: the expression is too long",
    "over: {k: '0:1:1000000000'}": "the number of points is from 2 to 10,000",
    "over: {k: '0:1:9999', states.x.lower: '0:1:9', time.final: '1:2:9'}": "and more, and 10,000",
    "expect: {cost: '" + "9" * 20_000 + "'}": "expected a value with its tolerance",
    "name: a, include: " + "a" * 300: "no file has so long a name",
    "name: a, include: " + "a/" * 600: "expected a path of at most 1000 characters",
}


@pytest.mark.parametrize("beside", HOSTILE, ids=lambda text: text[:30])
def test_what_is_meant_to_do_harm_is_refused_in_a_line(beside: str, folder: Path) -> None:
    found = complaints(folder, f"cases: [{{problem: cart.yaml, {beside}}}]")
    assert HOSTILE[beside] in found[0]
    assert len(found[0]) < 400


def test_a_suite_cannot_fill_the_memory(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By many values in many cases, nor by many files, each of which is small enough."""
    many = ", ".join(f"states.s{i}.lower: 1" for i in range(400))
    text = (
        f"defaults: {{set: {{{many}}}}}\ncases: [{{problem: cart.yaml, over: {{k: '0:1:2000'}}}}]"
    )
    assert complaints(folder, text)[0].startswith("2:9: its cases set more than 500,000 values")
    monkeypatch.setattr(suites, "MOST_TEXT", 3 * len(CART))
    for i in range(9):
        (folder / f"link{i}.yaml").symlink_to(folder / "cart.yaml")
    assert len(suite(folder, "cases: [{include: link*.yaml}]").cases) == 9
    for i in range(3):
        (folder / f"copy{i}.yaml").write_text(CART, encoding="utf-8")
    found = complaints(folder, "cases: [{include: copy*.yaml}]")
    assert "characters: name fewer" in found[0]


def test_mistakes_of_an_included_suite_are_told_at_its_own_lines(folder: Path) -> None:
    (folder / "inner.yaml").write_text("cases: [{problm: cart.yaml}]", encoding="utf-8")
    (said,) = complaints(folder, "cases: [{include: inner.yaml}]")
    assert said == "1:10: unknown key 'problm'; did you mean 'problem'?"


def test_suites_that_include_one_another_come_to_an_end(folder: Path) -> None:
    (folder / "other.yaml").write_text("cases: [{include: nightly.yaml}]", encoding="utf-8")
    (said,) = complaints(folder, "cases: [{include: other.yaml}]")
    assert said.endswith("nightly.yaml includes itself")
    for i in range(suites.DEEPEST + 1):
        text = f"cases: [{{include: s{i + 1}.yaml}}]"
        (folder / f"s{i}.yaml").write_text(text, encoding="utf-8")
    (said,) = complaints(folder, "cases: [{include: s0.yaml}]")
    assert said.endswith("that is too deep")


def test_includes_may_not_explode(folder: Path) -> None:
    """Each file is read once, however often it is included: here 20^6 times."""
    for i in range(6):
        again = f"{{include: s{i + 1}.yaml}}"
        text = f"cases: [cart.yaml, {', '.join([again] * 20)}]"
        (folder / f"s{i}.yaml").write_text(text, encoding="utf-8")
    (folder / "s6.yaml").write_text("cases: [cart.yaml]", encoding="utf-8")
    began = time.process_time()
    said = complaints(folder, "cases: [{include: s0.yaml}]")
    assert time.process_time() - began < 10
    assert said[0].endswith("another case is called s6/cart: give this one a `name`")


def test_a_matrix_may_not_explode(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    many = f"[{', '.join(map(str, range(1, 300)))}]"
    text = f"cases: [{{problem: cart.yaml, matrix: {{steps: {many}, k: {many}}}}}]"
    (said,) = complaints(folder, text)
    assert said.endswith("this matrix has 89,401 combinations, and 10,000 are the most")
    monkeypatch.setattr(suites, "MAX_CASES", 3)
    (said,) = complaints(folder, "cases: [{problem: cart.yaml, matrix: {k: [1, 2, 3, 4]}}]")
    assert said.endswith("more than 3 cases are too many")


@pytest.mark.parametrize("wrong", ["", ", set: {nothing: 1}"])
def test_a_suite_of_huge_sweeps_is_soon_given_up(folder: Path, wrong: str) -> None:
    """One of them takes a tenth of a second to spell out: all would take minutes."""
    sweep = "{{problem: cart.yaml, name: n{}, over: {{k: '0:1:9999'}}{}}}"
    text = f"cases: [{', '.join(sweep.format(i, wrong) for i in range(1000))}]"
    began = time.process_time()
    said = complaints(folder, text)
    assert said
    assert time.process_time() - began < 20


@pytest.mark.parametrize(
    "text",
    [
        "cases: [/etc/passwd]",
        "cases: [{include: /etc/*}]",
        "cases: [{include: /**/*.yaml}]",
        "cases: [{include: '/*/*/*/*.yaml'}]",
        "cases: [/dev/stdin]",
        "cases: [{problem: cart.yaml, options: {solver_options: {hsllib: evil.so}}}]",
        "cases: [{problem: cart.yaml, options: {solver_options: {output_file: /tmp/x}}}]",
        "cases: [{problem: cart.yaml, options: {guess: /etc/passwd}}]",
        "cases: [{problem: cart.yaml, options: {steps: 10000000}}]",
        "cases: [{problem: cart.yaml, set: {options.steps: 10000000}}]",
        "cases: [{problem: cart.yaml, name: ../../x}]",
        "cases: [{problem: cart.yaml, matrix: {guess: [x.h5]}}]",
        f"cases: [{{problem: cart.yaml, matrix: {{k: [{'1+' * 200}1]}}}}]",
        "cases: []",
        "cases: {}",
        "cases:",
        "cases: [a\0]",
    ],
)
def test_what_a_suite_from_elsewhere_may_not_do(folder: Path, text: str) -> None:
    with pytest.raises(ProblemError):
        suite(folder, text)


def test_a_wrong_problem_file_is_the_matter_of_its_case(folder: Path) -> None:
    (folder / "wrong.yaml").write_text("states: {x: {}", encoding="utf-8")
    made = suite(folder, "cases: [{problem: wrong.yaml, set: {anything: 1}}, cart.yaml]")
    assert names(made) == ["wrong", "cart"]


@pytest.mark.parametrize(
    ("text", "size"),
    [("2GB", 2 * 10**9), ("500 mb", 5 * 10**8), ("1.5 GB", 15 * 10**8), (123456789, 123456789)],
)
def test_sizes(text: str | int, size: int) -> None:
    assert bytes_of(text) == size


@pytest.mark.parametrize("text", ["2 XB", "GB", "-1 GB", "1 kB", "", "1e9", "10**9"])
def test_what_is_no_size(text: str) -> None:
    with pytest.raises(UsageError, match=r"size|too little"):
        bytes_of(text)


# Where cases come from


def test_problems_and_suites_of_a_command_line(folder: Path) -> None:
    suite(folder, "cases: [cart.yaml]")
    made = gather(["cart.yaml", "bang_bang"], {"steps": 9}, {"k": "2"})
    path = str((folder / "cart.yaml").resolve())
    assert made.cases == (
        Case("cart", path, {"steps": 9}, {"k": "2"}),
        Case("bang_bang", "bang_bang", {"steps": 9}, {"k": "2"}),
    )
    assert made.name == "batch"
    assert gather(["cart.yaml"], {}, {}).name == "cart"
    assert gather(["nightly.yaml"], {}, {}) == load_suite("nightly.yaml")
    (folder / "more").mkdir()
    (folder / "more" / "cart.yaml").write_text(CART, encoding="utf-8")
    assert names(gather(["cart.yaml", "more/cart.yaml", "bang_bang"], {}, {})) == [
        f"{folder.name}/cart",
        "more/cart",
        "bang_bang",
    ]
    mixed = gather(["nightly.yaml", "bang_bang"], {}, {})
    assert names(mixed) == ["nightly/cart", "bang_bang"]
    assert set(mixed.limits) == {"nightly/cart"}
    with pytest.raises(UsageError, match=r"steps: options and constants are for problems"):
        gather(["bang_bang", "nightly.yaml"], {"steps": 9}, {})
    with pytest.raises(UsageError, match=r"there is no file nonsense"):
        gather(["nonsense"], {}, {})
    with pytest.raises(UsageError, match=r"there is no suite regresion; did you mean"):
        load_suite("regresion")


def test_cases_are_chosen_with_those_that_they_follow() -> None:
    cases = (
        Case("a[mu=1]", "a"),
        Case("a[mu=2]", "a", follows="a[mu=1]"),
        Case("a[mu=3]", "a", follows="a[mu=2]"),
        Case("b", "b"),
    )
    made = Suite("x", "", cases, {})
    assert names(selected(made, ["mu=2"])) == ["a[mu=1]", "a[mu=2]"]
    assert names(selected(made, ["?"])) == ["b"]
    assert names(selected(made, ["a[*]"])) == names(made)[:3]
    assert names(selected(made, ["b", "mu=1"])) == ["a[mu=1]", "b"]
    assert selected(made, []) is made
    with pytest.raises(UsageError, match=r"no case is called c"):
        selected(made, ["c"])


def test_a_suite_is_no_problem() -> None:
    assert set(bundled_suites()) == {"regression"}
    assert "regression" not in bundled()
    from quito_cli.problem.load import load

    with pytest.raises(UsageError, match=r"is a suite of cases, no problem: `quito batch "):
        load(bundled_suites()["regression"])


def test_the_name_of_a_bundled_suite(tmp_path: Path) -> None:
    """In the place of a file, also beside problems; and the nearest one where it is mistyped."""
    assert names(gather(["regression"], {}, {})) == names(load_suite("regression"))
    both = names(gather(["regression", "bang_bang"], {}, {}))
    assert both[-1] == "bang_bang"
    assert {name.partition("/")[0] for name in both[:-1]} == {"regression"}
    for mistyped in ("regresion", str(tmp_path / "regression.yml")):
        with pytest.raises(UsageError, match=r"no bundled problem or suite .* 'regression'\?"):
            gather([mistyped], {}, {})


def test_the_library_is_covered_by_its_suite() -> None:
    made = load_suite("regression")
    assert {case.problem for case in made.cases} == set(bundled())
    for case in made.cases:
        figures = {one.figure for one in case.expectations}
        without = {"auv_fleet", "robot_path"}  # no reference
        assert "relative_cost_error" in figures or case.problem in without, case.name
    assert all(limits.seconds and limits.memory for limits in made.limits.values())


# The schema


@pytest.fixture(scope="module")
def schema() -> dict[str, Any]:
    loaded = json.loads(COMMITTED.read_text(encoding="utf-8"))
    assert isinstance(loaded, dict)
    return loaded


def test_the_committed_schema_is_the_generated_one(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert COMMITTED.read_text(encoding="utf-8") == suite_schema_text()
    assert run(["schema", "--suite"], monkeypatch) == 0
    assert capsys.readouterr().out == suite_schema_text()


def test_every_key_is_explained(schema: dict[str, Any]) -> None:
    Draft7Validator.check_schema(schema)
    models: list[type[BaseModel]] = [SuiteFile, Entry, Shared, CaseLimits, Expect, FileOptions]
    for model in models:
        part = schema if model is SuiteFile else schema["$defs"][model.__name__]
        assert set(part["properties"]) == set(model.model_fields)
        for name, field in part["properties"].items():
            assert field.get("description"), name


def test_the_schema_says_what_the_reader_says(schema: dict[str, Any], folder: Path) -> None:
    check = Draft7Validator(schema)
    good = ROOT / "problems" / "regression.yaml"
    assert not list(check.iter_errors(read(good.read_text(encoding="utf-8"), "x").data))
    first = good.read_text(encoding="utf-8").splitlines()[0]
    assert first == "# yaml-language-server: $schema=../schemas/suite.schema.json"
    data = read(STRUCTURE, "x").data
    told = {tuple(error.path)[:2] for error in check.iter_errors(data)}
    assert told == {("defaults", "options"), ("defaults",), ("defaults", "limits")} | {
        ("cases", i) for i in (0, 1, 3, 4)
    }
    alone = {"cases": [{"problem": "a", "include": "b"}]}
    assert list(check.iter_errors(alone))


def test_options_are_those_of_problem_files() -> None:
    assert set(OPTIONS) == set(FileOptions.model_fields) - {"solver_options"}
