"""Where a problem comes from, what may be set in it, and files that use the language's corners."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import quito_cli as quito
from quito_cli.problem.build import build
from quito_cli.problem.library import bundled, data_folder
from quito_cli.problem.load import (
    MAX_BYTES,
    changed,
    find,
    load,
    load_text,
    parse_settings,
    refuse_problem,
)
from quito_cli.problem.model import Model, labels
from quito_cli.problem.schema import Problem
from quito_cli.problem.text.complaints import ProblemError

ACCEPTED = sorted((Path(__file__).parent / "problems" / "accepted").glob("*.yaml"))
FOURTEEN = {
    *("alychan", "van_der_pol", "van_der_pol_state", "bryson_denham", "catalyst_mixing", "siri"),
    *("double_integrator_tracking", "inverted_pendulum", "rayleigh", "rayleigh_mixed"),
    *("robot_path", "bang_bang", "bressan", "auv_fleet"),
}
EIGHT_MORE = 8
PUSH = """\
constants: {k: 2}
time: {initial: 0, final: k}
states: {x: {initial: 0, final: k}}
controls: {u: {lower: -k}}
dynamics: {x: u}
cost: {lagrange: u^2}
"""


def push(**changes: Any) -> Problem:
    return changed(load_text(PUSH, "push.yaml"), changes)


def same(one: Problem, other: Problem) -> bool:
    """Whether they say the same, wherever they come from."""
    return one.model_dump() == other.model_dump()


# Files that use the corners of the language


@pytest.mark.parametrize("file", ACCEPTED, ids=lambda path: path.stem)
def test_accepted_file_has_the_cost_known_in_closed_form(file: Path) -> None:
    solution = quito.solve(file, steps=20, discretization="rk4", substeps=2)
    assert solution.success
    assert solution.evidence.warnings == ()
    assert solution.reference is not None
    assert solution.reference.cost is not None
    assert solution.cost == pytest.approx(solution.reference.cost, rel=1e-5)
    assert solution.evidence.resimulated_cost == pytest.approx(solution.reference.cost, rel=1e-4)


def accepted(name: str) -> Model:
    return build(load(next(file for file in ACCEPTED if file.stem == name)))


def test_vectors_and_matrices() -> None:
    model = accepted("vectors_and_matrices")
    assert labels(model.states) == ("x[0]", "x[1]", "x[2]", "x[3]")
    assert labels(model.controls) == ("u[0]", "u[1]")
    assert model.control_bounds.lower.tolist() == [-10, -1]
    assert model.control_bounds.upper.tolist() == [10, 10]
    assert model.initial.lower.tolist() == model.initial.upper.tolist() == [0] * 4
    assert model.final.lower.tolist() == model.final.upper.tolist() == [1, 0, 0, 0]
    xdot, cost = model.right_hand_side([1, 2, 3, 4], [5, 6], [], 0)
    assert np.array(xdot).ravel().tolist() == [3, 4, 5, 6]
    assert float(cost) == 5**2 + 2 * 6**2


def test_entries_of_all_kinds() -> None:
    model, inf = accepted("entries_of_all_kinds"), math.inf
    assert model.state_bounds.lower.tolist() == [-inf, -1, -inf]
    assert model.initial.lower.tolist() == [0, -1, 1]
    assert model.initial.upper.tolist() == [0, inf, 2]
    assert model.final.lower.tolist() == [-inf, 1, 2.5]
    assert model.final.upper.tolist() == [inf, 1, 3]
    assert model.control_bounds.lower.tolist() == [-1, -0.5, -inf]


def test_a_vector_of_one_entry_is_still_a_vector() -> None:
    assert labels(accepted("matrices_from_matrices").controls) == ("u[0]",)


def test_times_by_expressions() -> None:
    model = accepted("time_by_expressions")
    assert model.initial_time.lower == model.initial_time.upper == -math.pi / 2
    assert model.final_time.guess == math.pi / 2


def test_initial_and_final_values_of_a_mayer_cost() -> None:
    """-2 x + x(t0) - x(tf) + t, where bare names are final values."""
    cost = accepted("no_lagrange").end_cost([3], 0.5, [7], 11, [])
    assert float(cost) == -2 * 7 + 3 - 7 + 11


def test_names_that_yaml_knows() -> None:
    model = accepted("names_that_yaml_knows")
    assert labels(model.states) == ("y", "n", "on")
    assert labels(model.controls) == ("off",)


def test_free_text_is_kept_as_written() -> None:
    problem = load(next(file for file in ACCEPTED if file.stem == "text_of_all_kinds"))
    assert problem.title == "Täglich grüßt das Murmeltier: größer, 更快, ещё раз \N{ROCKET}"
    assert problem.source == "https://example.org/a?b=c#d"
    assert problem.description.startswith("- not a list: {neither: [this]}\n* nor that")
    assert problem.states["x"].unit == "µm·s⁻¹"
    assert problem.states["x"].description == """the driver's "own" position"""
    assert problem.published[0].tool == "Ω (β)"


# Where a problem comes from


def test_the_bundled_problems() -> None:
    assert set(bundled()) >= FOURTEEN
    assert len(set(bundled()) - FOURTEEN) >= EIGHT_MORE
    assert list(bundled()) == sorted(bundled())
    for name in bundled():
        problem = load(name)
        assert problem.name == name
        assert problem.title
        assert problem.source
        build(problem)


def test_data_stands_inside_the_package_or_else_beside_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = tmp_path / "site-packages" / "quito_cli"
    (tmp_path / "site-packages" / "problems").mkdir(parents=True)
    monkeypatch.setattr("quito_cli.problem.library._PACKAGE", package)
    assert data_folder("problems") == tmp_path / "site-packages" / "problems"
    (package / "problems").mkdir(parents=True)
    assert data_folder("problems") == package / "problems"


def test_by_path_by_text_and_by_name_alike(tmp_path: Path) -> None:
    path = tmp_path / "push.yaml"
    path.write_text(PUSH, encoding="utf-8")
    problem = load(path)
    assert same(problem, load(str(path)))
    assert same(problem, load_text(PUSH, "push.yaml"))
    assert (problem.name, problem.text, problem.changes) == ("push", PUSH, ())
    assert problem.file is not None


def test_a_byte_order_mark_is_no_content(tmp_path: Path) -> None:
    path = tmp_path / "push.yaml"
    path.write_text(PUSH, encoding="utf-8-sig")
    assert same(load(path), load_text(PUSH, "push.yaml"))


def test_messages_name_the_file_as_it_was_given(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "p.yaml").write_text(PUSH.replace("x: u}", "x: v}"), encoding="utf-8")
    with pytest.raises(ProblemError, match=r"^sub/p\.yaml:5:15: unknown name 'v'"):
        build(load("sub/p.yaml"))


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("bresan", "did you mean 'bressan'?"),
        ("some/where/catalyst_mixing.yml", "did you mean 'catalyst_mixing'?"),
        ("nothing_like_it", "`quito list` shows the bundled problems"),
        ("regression", "is a suite of cases, no problem: `quito batch regression` runs it"),
        (".", "is a folder"),
    ],
)
def test_no_such_problem(given: str, said: str) -> None:
    with pytest.raises(quito.UsageError) as caught:
        find(given)
    assert said in str(caught.value)
    assert given in str(caught.value)


@pytest.mark.parametrize("ending", [".yaml", ".yml"])
def test_a_name_without_its_ending(
    ending: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sub").mkdir()
    for where in ("pend", "sub/pend"):
        (tmp_path / f"{where}{ending}").write_text(PUSH, encoding="utf-8")
        with pytest.raises(quito.UsageError) as caught:
            load(where)
        assert str(caught.value) == f"there is no file {where}; did you mean {where}{ending}?"


PROBLEMS_FOR_RESULTS = {
    "boat.yaml": "boat.yaml is a problem file",
    "boat": "there is no file boat; boat.yaml is a problem file",
    "bressan": "there is no file bressan; that is a bundled problem",
}


@pytest.mark.parametrize("where", PROBLEMS_FOR_RESULTS)
def test_a_problem_in_place_of_a_result(
    where: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "boat.yaml").write_text(PUSH, encoding="utf-8")
    said, result = PROBLEMS_FOR_RESULTS[where], f"results/{Path(where).stem}.h5"
    with pytest.raises(quito.UsageError) as caught:
        quito.solve("boat.yaml", steps=5, guess=where)
    assert str(caught.value) == f"{said}: solve it first, then start from {result}"
    (tmp_path / "results").mkdir()
    (tmp_path / result).touch()
    with pytest.raises(quito.UsageError) as caught:
        refuse_problem(where, "plot")
    assert str(caught.value) == f"{said}; did you mean {result}?"


def test_what_may_be_a_result_is_not_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bressan").touch()
    for where in ("bressan", "bressan.h5", "other", ".", "gone.yaml", "results/a.h5"):
        refuse_problem(where, "plot")


def test_a_result_in_place_of_a_problem(tmp_path: Path) -> None:
    (tmp_path / "a.h5").write_bytes(b"\x89HDF\r\n\xff")
    with pytest.raises(quito.UsageError, match="is a result; `quito show`"):
        load(tmp_path / "a.h5")


def test_what_is_no_text_or_too_long(tmp_path: Path) -> None:
    (tmp_path / "binary").write_bytes(b"\x89PNG\r\n\xff")
    with pytest.raises(quito.UsageError, match="is not text in UTF-8"):
        load(tmp_path / "binary")
    (tmp_path / "long").write_bytes(b"#" * (MAX_BYTES + 1))
    with pytest.raises(quito.UsageError, match="too large"):
        load(tmp_path / "long")
    (tmp_path / "zeros").write_bytes(b"\0" * 1000)
    with pytest.raises(ProblemError, match="unprintable character"):
        load(tmp_path / "zeros")


def test_a_problem_is_frozen() -> None:
    with pytest.raises(ValueError, match="frozen"):
        push().title = "another"  # type: ignore[misc]
    with pytest.raises(ValueError, match="frozen"):
        push().states["x"].lower = 0  # type: ignore[misc]


def test_a_problem_made_in_python_has_a_text_that_reads_the_same() -> None:
    data = load_text(PUSH, "push.yaml").model_dump(exclude_unset=True)
    problem = Problem.model_validate(data)
    assert problem.file is None
    assert same(load_text(problem.text, "again.yaml"), problem)
    assert quito.solve(problem, steps=5).cost == pytest.approx(2)


def test_mistakes_of_a_problem_made_in_python_are_told_by_path() -> None:
    data = load_text(PUSH, "push.yaml").model_dump(exclude_unset=True)
    data["dynamics"] = {"x": "u + v"}
    with pytest.raises(ProblemError) as caught:
        build(Problem.model_validate(data))
    assert str(caught.value) == "dynamics.x: unknown name 'v'"


# What may be set


def test_a_constant_is_set_by_name_for_all_that_use_it() -> None:
    model = build(push(k=3))
    assert model.final_time.lower == model.final.lower[0] == -model.control_bounds.lower[0] == 3
    assert build(push(k="1 + 2*3")).final_time.lower == 7
    assert build(push(k=" 5e-1 ")).final_time.lower == 0.5


def test_what_was_set_is_remembered_in_order_and_the_text_stays() -> None:
    problem = push(**{"time.final": 4, "k": "2.5"})
    assert problem.changes == (("time.final", "4"), ("k", "2.5"))
    assert problem.text == PUSH
    again = changed(problem, {"k": 1})
    assert again.changes == (("time.final", "4"), ("k", "2.5"), ("k", "1"))
    model = build(again)
    assert (model.final_time.lower, model.final.lower[0]) == (4, 1)
    assert build(problem).final.lower[0] == 2.5


def test_setting_nothing_is_the_same_problem() -> None:
    problem = load_text(PUSH, "push.yaml")
    assert changed(problem, {}) is problem


def test_setting_does_not_reach_back() -> None:
    problem = load_text(PUSH, "push.yaml")
    changed(problem, {"k": 3, "states.x.upper": 9})
    assert build(problem).final_time.lower == 2
    assert problem.states["x"].upper is None


def test_a_value_that_the_file_does_not_have_can_be_set() -> None:
    assert build(push(**{"states.x.upper": 9})).state_bounds.upper.tolist() == [9]
    text = PUSH.replace("states: {x: {initial: 0, final: k}}", "states: {x: {}}")
    problem = load_text(text, "push.yaml", {"states.x.initial": "k/2"})
    assert build(problem).initial.lower.tolist() == [1]


@pytest.mark.parametrize(
    ("key", "said"),
    [
        ("kk", "no constant 'kk'; did you mean 'k'?"),
        ("constants.kk", "no constant 'kk'"),
        ("states.y.upper", "there is no 'states.y'"),
        ("states.x.initial.lower", "'states.x.initial' is a single value"),
        ("dynamics.x", "only time, states, controls, parameters, tables, constants can be set"),
        ("cost.lagrange", "only time, states, controls, parameters, tables, constants can be set"),
        (
            "options.steps",
            "only time, states, controls, parameters, tables, constants can be set; options of "
            "the solve are given by name, such as --steps 100",
        ),
        (
            "constraints.path.a",
            "only time, states, controls, parameters, tables, constants can be set; what else a "
            "problem says is changed in its file",
        ),
        ("u.upper", "--set u.upper: did you mean controls.u.upper?"),
        ("x.final.lower", "--set x.final.lower: did you mean states.x.final.lower?"),
        ("title.x", "only time, states, controls, parameters, tables, constants can be set"),
        ("", "no constant ''"),
        (".", "only time, states, controls, parameters, tables, constants can be set"),
    ],
)
def test_what_cannot_be_set(key: str, said: str) -> None:
    with pytest.raises(quito.UsageError) as caught:
        push(**{key: 1})
    assert said in str(caught.value)


@pytest.mark.parametrize("value", ["u", "1/0", "x.y", "__import__('os')", "nan", "1e999", ""])
def test_a_value_that_is_none_is_refused_with_what_was_set(value: str) -> None:
    with pytest.raises(ProblemError) as caught:
        build(push(k=value))
    assert str(caught.value).startswith(f"with k={value} set:\npush.yaml:1:")


def test_settings_of_a_command_line() -> None:
    assert parse_settings(["a=1", " b = x=2 ", "a=3"], "--set") == {"a": "3", "b": "x=2"}
    for wrong in ("a", "=1", "a=", "", " = "):
        with pytest.raises(quito.UsageError, match=r"--set .*NAME=VALUE"):
            parse_settings([wrong], "--set")


# What a reference is worth once something is set


GENERAL_REFERENCE = """
constants: {a: 2, b: 1}
time: {initial: 0, final: b}
states: {x: {initial: 0, guess: t}}
controls: {u: {lower: -1, upper: 1}}
dynamics: {x: a*u}
cost: {mayer: x}
reference: {general: true, cost: -a*b, switching_times: [a/4], control: {u: -1}}
"""


@pytest.mark.parametrize(
    ("changes", "cost"),
    [
        ({"a": "1.5"}, -1.5),
        ({"constants.a": "1.5", "b": "2"}, -3),
        ({"states.x.guess": "2*t"}, -2),
        ({"a": "1.5", "states.x.scale": "3"}, -1.5),
        ({"controls.u.lower": "-2"}, None),
        ({"time.final": "2"}, None),
        ({"a": "1.5", "states.x.initial": "1"}, None),
        ({"a": "8"}, None),  # its junction lies beyond the horizon
    ],
    ids=str,
)
def test_a_general_reference_is_one_for_other_constants(
    changes: dict[str, str], cost: float | None
) -> None:
    problem = changed(load_text(GENERAL_REFERENCE, "test.yaml"), changes)
    found = build(problem).known
    assert (found.cost if found else None) == cost


def test_a_guess_is_no_other_problem() -> None:
    """A reference that is not general survives what does not concern the answer."""
    text = GENERAL_REFERENCE.replace("general: true, ", "")
    assert build(changed(load_text(text, "test.yaml"), {"states.x.guess": "2*t"})).known is not None
    assert build(changed(load_text(text, "test.yaml"), {"a": "2"})).known is None
