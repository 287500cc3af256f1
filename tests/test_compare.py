"""`quito compare` and `quito.compare`: what is solved, what it is held against, what is said."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from documents import PUSH, Ran, run

import quito_cli as quito
from quito_cli.comparison.compare import FINER, OF_OUR_ROW
from quito_cli.comparison.gates import GATES
from quito_cli.comparison.measure import SAMPLES, ZONE
from quito_cli.comparison.methods import METHODS, Method, again, method, name_of, parse
from quito_cli.comparison.statement import differing
from quito_cli.comparison.table import COLUMNS
from quito_cli.options import Options
from quito_cli.problem.load import load_text
from quito_cli.solvers.outcome import Progress

Solve = Callable[..., quito.Solution]

KNOWN = PUSH + "reference: {cost: 1, control: {u: 1}, state: {x: t}}\n"
WRONG = PUSH + "reference: {cost: 2, control: {u: 0}, state: {x: 0}}\n"
"""e = 1 on [0, 1]: every norm is one, or √n."""
JUMPS = (
    PUSH
    + """\
reference:
  control: {u: [{until: 1/2, value: -1}, {value: 1}]}
  switching_times: [1/2]
"""
)
"""The jump is in the reference alone."""
TOO_FAR = KNOWN.replace("final: 1}}", "final: 5}}")
"""With |u| <= 3, x ends at 3 at most."""
LAGS = """\
title: A lag that is driven to one
time: {initial: 0, final: 1}
states: {x: {initial: 0, final: 1}}
controls: {u: {lower: -9, upper: 9}}
dynamics: {x: u - x^3}
cost: {lagrange: u^2}
"""


Compare = Callable[..., Ran]


@pytest.fixture
def compare(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> Compare:
    """Run `quito compare` in an empty folder but for problems of this file."""
    monkeypatch.chdir(tmp_path)
    for name, text in {
        **{"push": PUSH, "known": KNOWN, "wrong": WRONG, "too_far": TOO_FAR, "lags": LAGS},
        **{"other": LAGS.replace("x^3", "x"), "jumps": JUMPS},
    }.items():
        (tmp_path / f"{name}.yaml").write_text(text, encoding="utf-8")

    def ran(*arguments: str, plot: bool = False) -> Ran:
        capfd.readouterr()
        more = [] if plot else ["--no-plot"]
        code = run(["compare", *arguments, *more], monkeypatch)
        printed = capfd.readouterr()
        assert "Traceback" not in printed.err
        return Ran(code, printed.out, printed.err)

    return ran


def solved(problem: str, monkeypatch: pytest.MonkeyPatch, *options: str) -> None:
    assert run(["solve", problem, "-q", "--no-plot", *options], monkeypatch) == 0


# The claims of the method


def test_van_der_pol_on_300_cells() -> None:
    row = quito.compare("van_der_pol", steps=300, zone=0.02).rows[0]
    assert row.errors is not None
    assert row.errors.l2 <= 0.12
    assert row.errors.sup_outside <= 0.02
    assert np.abs(row.switching_errors).max() < 4 / 300


def test_catalyst_mixing_on_300_cells() -> None:
    """Further than 5 % of the horizon from the junctions."""
    row = quito.compare("catalyst_mixing", steps=300, zone=0.05).rows[0]
    assert row.errors is not None
    assert row.errors.sup_outside <= 2e-3


def test_samples_are_as_many_as_the_published_figures_are_of() -> None:
    """dft/norm = √n: 1200 for Van der Pol with N = 300, 400 for Aly and Chan with N = 100."""
    for problem, n in (("van_der_pol", 1200), ("alychan", 400)):
        found = quito.compare(problem)
        assert len(found.sample_times) == n
        assert len(found.published) == 2
        for row in found.published:
            assert row.error_norm is not None
            assert row.dft_norm is not None
            assert row.dft_norm / row.error_norm == pytest.approx(math.sqrt(n), rel=0.4)


# Numbers known by hand


def test_an_error_of_one_in_json(compare: Compare) -> None:
    found = compare("wrong.yaml", "-N", "10", "--json")
    assert found.code == 0
    assert found.err == ""
    said = found.json
    assert said["against"] == said["reference"]["title"] == "reference of the file"
    assert said["reference"]["cost"] == 2
    assert said["reference"]["total_variation"] == {"u": 0}
    assert said["notes"] == said["published"] == said["plots"] == []
    (row,) = said["rows"]
    assert row["method"] == "quasi-interpolant:gaussian"
    assert row["success"] is True
    for name in ("error_l1", "error_l2", "error_sup", "error_sup_outside"):
        assert row[name] == row["controls"]["u"][name] == pytest.approx(1, abs=1e-6)
    assert row["samples"] == said["samples"] == 40
    assert row["error_norm"] == pytest.approx(math.sqrt(40), abs=1e-5)
    assert row["dft_norm"] == pytest.approx(40, abs=1e-5)
    for cost in ("cost", "resimulated_cost"):
        assert row[cost] == pytest.approx(1, abs=1e-6)
        assert row[f"{cost}_error"] == pytest.approx(-1, abs=1e-6)
    assert row["total_variation"] == pytest.approx(0, abs=1e-5)
    assert row["states"]["x"]["error_sup"] == pytest.approx(1, abs=1e-6)
    assert row["switching_times"] == []
    assert row["seconds"] == pytest.approx(row["build_seconds"] + row["solve_seconds"])
    assert row["unknowns"] > 20
    assert row["violation"] < 1e-6


def test_json_has_what_the_design_lists(compare: Compare) -> None:
    row = compare("known.yaml", "-N", "5", "--json").json["rows"][0]
    wanted = (
        "method cost cost_error error_l2 error_sup error_sup_outside error_norm dft_norm samples "
        "total_variation ringing iterations seconds violation"
    )
    for name in wanted.split():
        assert isinstance(row[name], str if name == "method" else int | float), name


def test_samples_and_zone(compare: Compare) -> None:
    few = compare("wrong.yaml", "-N", "10", "--samples", "9", "--json").json["rows"][0]
    assert few["error_norm"] == pytest.approx(3, abs=1e-5)
    wide = compare("van_der_pol", "-N", "20", "--zone", "0.1", "--json").json
    assert wide["zones"][0] == pytest.approx([1.3667400310631783 - 0.4, 1.3667400310631783 + 0.4])
    assert quito.compare("van_der_pol", steps=20).zones[0][0] == pytest.approx(
        1.3667400310631783 - 4 * ZONE
    )


# Other methods


def test_each_method_is_a_row_named_as_it_was_asked_for(compare: Compare) -> None:
    asked = "hermite-simpson, piecewise-constant,laguerre6"
    found = compare(
        *("known.yaml", "-N", "12", "--json", "--against", asked),
        *("--against", "quasi-interpolant:sech", "--against", "laguerre6"),
    )
    assert found.code == 0
    rows = found.json["rows"]
    assert [row["method"] for row in rows] == [
        *("quasi-interpolant:gaussian", "hermite-simpson", "piecewise-constant", "laguerre6"),
        "quasi-interpolant:sech",
    ]
    assert [row["options"]["control"] for row in rows] == [
        *("quasi-interpolant", "piecewise-linear", "piecewise-constant"),
        *("quasi-interpolant", "quasi-interpolant"),
    ]
    assert [row["options"]["discretization"] for row in rows] == [
        *("rk4", "hermite-simpson", "rk4", "rk4", "rk4")
    ]
    assert all(row["options"]["steps"] == 12 for row in rows)
    assert all(row["error_sup"] < 1e-5 for row in rows)


def test_ours_is_not_solved_twice() -> None:
    for name in ("gaussian", "quasi-interpolant:gaussian", " gaussian , gaussian "):
        assert len(quito.compare("alychan", name, steps=5).rows) == 1
    found = quito.compare("alychan", ("gaussian", "laguerre4"), steps=5, generating_function=2)
    assert [row.method for row in found.rows] == ["quasi-interpolant:laguerre4", "gaussian"]


OURS: dict[str, Any] = {
    **{"steps": 40, "variance": 3.0, "generating_function": "gaussian", "normalised": True},
    **{"control": "quasi-interpolant", "discretization": "euler", "substeps": 1},
    **{"tolerance": 1e-7, "max_iterations": 77, "solver": "ipopt", "objective_scale": None},
    **{"path_points": "nodes", "guess": "a.h5", "warm_start": True, "solver_options": {}},
}


@pytest.mark.parametrize(
    ("name", "own"),
    [
        ("lgr", {"discretization": "lgr", "steps": 10, "degree": 4}),
        ("lgr:1x400", {"discretization": "lgr", "steps": 1, "degree": 400}),
        (
            "hermite-simpson",
            {
                **{"discretization": "hermite-simpson", "control": "piecewise-linear"},
                **{"substeps": 1, "steps": 40, "path_points": "nodes"},
            },
        ),
        (
            "piecewise-constant",
            {
                **{"control": "piecewise-constant", "discretization": "euler"},
                **{"substeps": 1, "steps": 40, "path_points": "nodes"},
            },
        ),
        (
            "laguerre4",
            {
                **{"control": "quasi-interpolant", "generating_function": "laguerre4"},
                **{"discretization": "euler", "substeps": 1, "steps": 40, "path_points": "nodes"},
                "variance": 3.0,
            },
        ),
    ],
)
def test_what_a_method_takes_over_from_ours(name: str, own: dict[str, Any]) -> None:
    shared = {"tolerance": 1e-7, "max_iterations": 77, "solver": "ipopt"}
    shared |= {"mesh": "uniform", "polish": False}
    assert method(name).options(OURS) == shared | own


def test_a_mesh_that_follows_the_control_is_a_method() -> None:
    """The paper's norm at its 1200 samples: no uniform mesh of that step comes below 0.25."""
    found = quito.compare("van_der_pol", "adaptive", steps=300)
    assert [row.method for row in found.rows] == ["quasi-interpolant:gaussian", "adaptive"]
    assert len(found.sample_times) == 1200
    ours, adaptive = (row.errors for row in found.rows)
    assert ours is not None
    assert adaptive is not None
    assert adaptive.norm < 0.1
    assert ours.norm > 1.0


def test_ours_is_no_other_method_by_whatever_name() -> None:
    found = quito.compare("van_der_pol", "lgr,lgr:3x4,lgr:4x3", discretization="lgr", steps=3)
    assert [row.method for row in found.rows] == ["lgr:3x4", "lgr:4x3"]


def test_few_cells_leave_one_interval() -> None:
    assert method("lgr").options({**OURS, "steps": 3})["steps"] == 1


def test_where_ours_is_a_collocation_the_others_have_as_many_points() -> None:
    ours = {**OURS, "discretization": "lgr", "steps": 10, "degree": 4}
    assert name_of(ours) == "lgr:10x4"
    for name in ("piecewise-constant", "gaussian"):
        options = method(name).options(ours)
        assert (options["steps"], options["discretization"]) == (40, Options.discretization)
    assert method("lgr").options(ours)["steps"] == 10
    assert again(ours)["degree"] == 4


def test_a_classical_control_is_solved_again_without_what_it_does_not_know() -> None:
    ours = {**OURS, "control": "piecewise-constant"}
    assert not set(again(ours)) & {"variance", "generating_function", "normalised", "guess"}
    assert name_of(ours) == "piecewise-constant"
    assert name_of({**ours, "discretization": "hermite-simpson"}) == "piecewise-constant"
    linear = {**ours, "control": "piecewise-linear"}
    assert name_of(linear) == "piecewise-linear"
    assert name_of({**linear, "discretization": "hermite-simpson"}) == "hermite-simpson"
    assert name_of({**OURS, "normalised": False}) == "quasi-interpolant:gaussian, as printed"


def test_collocation_rows() -> None:
    found = quito.compare("van_der_pol", "lgr,lgr:1x20", steps=40)
    assert [row.method for row in found.rows[1:]] == ["lgr", "lgr:1x20"]
    assert all(row.errors is not None for row in found.rows)


def test_parse() -> None:
    methods, against_self = parse(["lgr:2x3, self", "", "lgr:2x3,lgr"])
    assert [m.name for m in methods] == ["lgr:2x3", "lgr"]
    assert against_self
    assert parse([]) == ((), False)
    for row in METHODS:
        if "K" not in row:
            assert isinstance(method(row), Method)


@pytest.mark.parametrize(
    "name",
    ["lgr:0x4", "lgr:4", "lgr:4x0", "lgr:-1x4", "lgr:1e3x4", "Gaussian", "quasi-interpolant:"],
)
def test_what_is_no_method(name: str) -> None:
    with pytest.raises(quito.UsageError, match=f"there is no method '{name}'"):
        method(name)


# The truth


def test_a_problem_without_a_reference_is_held_against_itself(compare: Compare) -> None:
    found = compare("lags.yaml", "-N", "10", "--json").json
    assert found["against"] == f"a solve on {FINER * 10} cells"
    assert found["notes"] == ["the problem has no reference: held against a finer solve of itself"]
    finer = quito.solve("lags.yaml", steps=FINER * 10)
    assert found["reference"]["cost"] == finer.cost
    row, t = found["rows"][0], np.linspace(0, 1, 2001)
    ours = quito.solve("lags.yaml", steps=10)
    error = np.abs(ours.control(t) - finer.control(t)).max()
    assert row["error_sup"] == pytest.approx(error, rel=0.02)
    assert row["cost_error"] == pytest.approx(ours.cost - finer.cost, abs=1e-12)
    text = compare("lags.yaml", "-N", "10").out
    assert "The problem has no reference: held against a finer solve of itself." in text


def test_self_wins_over_the_reference(compare: Compare) -> None:
    found = compare("wrong.yaml", "-N", "5", "--against", "self", "--json").json
    assert found["against"] == "a solve on 20 cells"
    assert found["notes"] == []
    assert found["reference"]["cost"] == pytest.approx(1, abs=1e-6)
    assert found["rows"][0]["error_sup"] < 1e-5


def test_a_reference_of_the_cost_alone_is_used_for_the_cost() -> None:
    text = LAGS + "reference: {cost: 7}\n"
    found = quito.compare(load_text(text, "cost.yaml"), steps=8)
    assert found.truth is not None
    assert found.truth.title == "a solve on 32 cells"
    assert found.truth.cost == 7
    assert "no reference of its control" in found.notes[0]
    assert found.rows[0].cost_error == pytest.approx(found.rows[0].solution.cost - 7)


def test_what_was_set_has_no_reference(compare: Compare) -> None:
    found = compare("known.yaml", "-N", "5", "--set", "states.x.final=0.5", "--json").json
    assert found["against"] == "a solve on 20 cells"
    assert found["rows"][0]["cost"] == pytest.approx(0.25, abs=1e-6)


def test_a_problem_without_controls_is_compared_by_its_states() -> None:
    text = """
time: {initial: 0, final: 1}
states: {x: {initial: 1}}
dynamics: {x: -x}
cost: {mayer: x}
reference: {cost: exp(-1), state: {x: exp(-t)}}
"""
    row = quito.compare(load_text(text, "decay.yaml"), steps=20).rows[0]
    assert row.errors is None
    assert row.state_errors[0] < 1e-6
    assert row.cost_error == pytest.approx(0, abs=1e-8)


def test_horizons_that_differ_a_little() -> None:
    """A free final time: held against the reference on the horizon of the answer."""
    found = quito.compare("minimum_time", steps=40)
    assert found.rows[0].errors is not None
    assert math.isfinite(found.rows[0].errors.l2)
    assert found.sample_times[-1] < found.rows[0].solution.times[-1]
    against_self = quito.compare("minimum_time", "self", steps=40)
    ends = [against_self.rows[0].solution.times[-1]]
    assert against_self.truth is not None
    assert against_self.truth.horizon is not None
    last = min(*ends, against_self.truth.horizon[1])
    assert against_self.sample_times[-1] == pytest.approx(last * (1 - 0.5 / 160))


# Saved results


def test_a_saved_result_is_our_row(compare: Compare, monkeypatch: pytest.MonkeyPatch) -> None:
    solved("known.yaml", monkeypatch, "-N", "7", "--generating-function", "sech")
    found = compare(
        "known.yaml", "--result", "results/known.h5", "--against", "laguerre4", "--json"
    ).json
    assert [row["method"] for row in found["rows"]] == ["quasi-interpolant:sech", "laguerre4"]
    assert [row["options"]["steps"] for row in found["rows"]] == [7, 7]
    assert found["samples"] == 7 * SAMPLES
    more = ["--against", "sech,self,laguerre4", "--tolerance", "1e-6"]
    found = compare("known.yaml", "--result", "results/known.h5", *more, "--json").json
    assert found["against"] == f"a solve on {FINER * 7} cells"
    assert [row["options"]["tolerance"] for row in found["rows"]] == [1e-9, 1e-6]
    solution = quito.Solution.load("results/known.h5")
    again = quito.compare("known.yaml", result=solution)
    assert again.rows[0].solution is solution


def test_a_result_of_another_problem(compare: Compare, monkeypatch: pytest.MonkeyPatch) -> None:
    solved("known.yaml", monkeypatch, "-N", "5")
    found = compare("lags.yaml", "--result", "results/known.h5")
    assert (found.code, found.err) == (
        2,
        "quito: results/known.h5 answers another problem: its `controls` differs; what was set for "
        "the result is set again with --set\n",
    )
    solved("known.yaml", monkeypatch, "-N", "5", "--set", "states.x.final=0.5")
    assert "its `states` differs" in compare("known.yaml", "--result", "results/known.h5").err
    again = compare("known.yaml", "--result", "results/known.h5", "--set", "states.x.final=0.5")
    assert again.code == 0


def test_an_option_of_a_solve_beside_a_result(
    compare: Compare, monkeypatch: pytest.MonkeyPatch
) -> None:
    solved("known.yaml", monkeypatch, "-N", "5")
    found = compare("known.yaml", "--result", "results/known.h5", "-N", "9")
    assert (found.code, found.err) == (
        2,
        "quito: steps belongs to a solve, and --result is solved already: leave one of them out\n",
    )
    assert set(OF_OUR_ROW) < set(vars(Options()))
    settled: list[dict[str, Any]] = [{"degree": 5}, {"control": "piecewise-constant"}]
    settled += [{"guess": "results/known.h5"}, {"warm_start": True}]
    for option in settled:
        name = next(iter(option)).replace("_", "-")
        with pytest.raises(quito.UsageError, match=f"{name} belongs to a solve"):
            quito.compare("known.yaml", result="results/known.h5", **option)


def test_statements() -> None:
    def of(text: str, **changes: float) -> quito.Problem:
        return load_text(text, "p.yaml", changes)

    same = (
        KNOWN.replace("Push to one", "Other")
        .replace("u^2", "u ^ 2")
        .replace("upper: 3", "upper: 3, guess: 1, scale: 2, unit: m")
    )
    assert differing(of(PUSH), of(same + "options: {steps: 3}\ntags: [easy]\n")) is None
    assert differing(of(PUSH), of(PUSH.replace("u^2", "u^4"))) == "cost"
    assert differing(of(PUSH), of(PUSH.replace("final: 1}\n", "final: 2}\n"))) == "time"
    assert differing(of(PUSH), of(PUSH + "sense: maximize\n")) == "sense"
    two = PUSH.replace("states: {x:", "constants: {a: 1}\nstates: {x:")
    assert differing(of(two), of(two, a=1.0)) is None
    assert differing(of(two), of(two, a=2.0)) == "constants"
    order = LAGS.replace("controls: {", "controls: {v: {lower: 0, upper: 1}, ")
    other = LAGS.replace("upper: 9}}", "upper: 9}, v: {lower: 0, upper: 1}}")
    assert differing(of(order), of(other)) == "controls"


def test_results_of_one_problem(compare: Compare, monkeypatch: pytest.MonkeyPatch) -> None:
    solved("wrong.yaml", monkeypatch, "-N", "5", "-o", "a")
    solved("wrong.yaml", monkeypatch, "-N", "8", "-o", "b")
    found = compare("a/wrong.h5", "b/wrong.h5", "--json")
    assert found.code == 0
    said = found.json
    assert [row["method"] for row in said["rows"]] == ["a/wrong.h5", "b/wrong.h5"]
    assert said["against"] == "reference of the file"
    assert said["samples"] == 5 * SAMPLES
    assert [row["error_l2"] for row in said["rows"]] == pytest.approx([1, 1], abs=1e-5)


def test_results_of_problems_that_differ(compare: Compare, monkeypatch: pytest.MonkeyPatch) -> None:
    """u = 1 and u = 1/2: held against the first of them, and it is said so."""
    solved("known.yaml", monkeypatch, "-N", "5")
    Path("half.yaml").write_text(KNOWN, encoding="utf-8")
    solved("half.yaml", monkeypatch, "-N", "5", "--set", "states.x.final=0.5")
    said = compare("results/known.h5", "results/half.h5", "--json").json
    assert said["against"] == "the first result, known"
    assert said["notes"] == [
        "another problem is answered by half: its `states` differs",
        "no ringing: some of the results have it relative to a reference, others not",
    ]
    first, second = said["rows"]
    assert first["error_sup"] == 0
    assert second["error_sup"] == pytest.approx(0.5, abs=1e-5)
    assert second["cost_error"] == pytest.approx(0.25 - 1, abs=1e-5)
    assert first["ringing"] is second["ringing"] is None


def test_results_without_a_reference(compare: Compare, monkeypatch: pytest.MonkeyPatch) -> None:
    solved("lags.yaml", monkeypatch, "-N", "40")
    Path("results/lags.h5").rename("fine.h5")
    solved("lags.yaml", monkeypatch, "-N", "5")
    said = compare("fine.h5", "results/lags.h5", "--json").json
    assert said["against"] == "the first result, fine"
    assert said["notes"] == []
    assert 0 < said["rows"][1]["error_sup"] < 0.5
    assert all(row["ringing"] is not None for row in said["rows"])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["results/known.h5"], "name two results or more; one alone is compared by quito compare"),
        (["results/known.h5", "none.h5"], "there is no file none.h5"),
        (["results/known.h5", "damaged.h5"], "damaged.h5 is no result of quito, or damaged"),
        (["results/known.h5", "known.yaml"], "did you mean results/known.h5?"),
        (["results/known.h5", "results/known.h5", "-N", "5"], "--steps belongs to a problem"),
        (["results/known.h5", "results/known.h5", "--against", "lgr"], "--against belongs to a"),
        (["results/known.h5", "vectors.h5"], "its states are x, y, not x"),
        (["known.yaml", "wrong.yaml"], "one problem at a time: known.yaml, wrong.yaml are 2"),
    ],
)
def test_results_that_cannot_be_compared(
    arguments: list[str], message: str, compare: Compare, monkeypatch: pytest.MonkeyPatch
) -> None:
    solved("known.yaml", monkeypatch, "-N", "5")
    two = PUSH.replace("final: 1}}", "final: 1}, y: {initial: 0}}").replace("x: u", "x: u, y: u")
    quito.solve(load_text(two, "two.yaml"), steps=5).save("vectors.h5")
    Path("damaged.h5").write_text("nothing", encoding="utf-8")
    found = compare(*arguments)
    assert found.code == 2
    assert message in found.err


# What is refused


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["known.yaml", "--against", "dircol"],
            "quito: there is no method 'dircol'; there are lgr, lgr:KxD, adaptive, polished, "
            "hermite-simpson, piecewise-constant, gaussian, laguerre4, laguerre6, hermite10, "
            "trigonometric, sech; and self, a finer solve as the truth\n",
        ),
        (
            ["known.yaml", "--against", "hermite-simson"],
            "quito: there is no method 'hermite-simson'; did you mean 'hermite-simpson'?; there "
            "are lgr, lgr:KxD, adaptive, polished, hermite-simpson, piecewise-constant, gaussian, "
            "laguerre4, laguerre6, hermite10, trigonometric, sech; and self, a finer solve as the "
            "truth\n",
        ),
        (
            ["known.yaml", "--against", "hermite10", "--variance", "0.1", "-N", "5"],
            "quito: variance 0.1 is too small for the generating function gaussian: between the "
            "nodes its sum of weights falls to 0.093; take at least 0.31\n",
        ),
        (
            ["known.yaml", "--zone", "0.7"],
            "quito: zone: a fraction of the horizon from 0 to below 0.5, got 0.7\n",
        ),
        (
            ["known.yaml", "--samples", "1"],
            "quito: samples: a number from 2 to 1000000 is expected, got 1\n",
        ),
        (
            ["known.yaml", "--max-ringing", "-1"],
            "quito: max-ringing: a limit of zero or more is expected, got -1\n",
        ),
        (
            ["known.yaml", "--max-error-l2", "nan"],
            "quito: max-error-l2: a limit of zero or more is expected, got nan\n",
        ),
        (
            ["known.yaml", "--json", "--latex"],
            "quito: --json, --markdown and --latex exclude each other\n",
        ),
        (["known.yaml", "--format", "bmp"], "quito: format: expected png, pdf or svg, got 'bmp'\n"),
        (["known.yaml", "--result", "known.yaml"], None),
    ],
)
def test_refused(arguments: list[str], message: str | None, compare: Compare) -> None:
    found = compare(*arguments)
    assert found.code == 2
    assert found.out == ""
    assert found.err == message if message else found.err.startswith("quito: ")


def test_a_method_that_cannot_do_the_problem_is_named(compare: Compare) -> None:
    """The Gaussian takes a variance of 0.5, the function of order ten does not."""
    found = compare("known.yaml", "-N", "8", "--variance", "0.5", "--against", "hermite10")
    assert found.code == 2
    assert found.err.startswith("quito: hermite10: variance 0.5 is too small")


# How it ends


def test_a_method_that_does_not_converge_stays_in_the_table(compare: Compare) -> None:
    found = compare("too_far.yaml", "-N", "5", "--against", "piecewise-constant")
    assert found.code == 1
    assert "quasi-interpolant:gaussian (not solved)" in found.out
    assert "piecewise-constant (not solved)" in found.out
    assert re.search(r"^Not solved: piecewise-constant: ", found.out, re.MULTILINE)
    said = compare("too_far.yaml", "-N", "5", "--json")
    assert said.code == 1
    assert said.json["rows"][0]["success"] is False
    assert said.json["rows"][0]["error_l2"] > 1


def test_a_truth_that_does_not_converge(compare: Compare) -> None:
    found = compare("lags.yaml", "-N", "5", "--max-iterations", "1", "--json")
    assert found.code == 1
    assert found.json["against"] is None
    assert found.json["rows"][0]["error_l2"] is None
    assert "that did not converge" in found.json["notes"][1]


LIMITS = [
    ("error-l2", 0.99),
    ("error-l1", 0.99),
    ("error-sup", 0.99),
    ("error-sup-outside", 0.99),
    ("error-norm", 4.4),
    ("cost-error", 0.99),
    ("state-error", 0.99),
]


@pytest.mark.parametrize(("gate", "limit"), LIMITS)
def test_gates(gate: str, limit: float, compare: Compare) -> None:
    """Every error is one, the norm √20 = 4.47."""
    held = compare("wrong.yaml", "-N", "5", f"--max-{gate}", str(limit * 1.1), "-q")
    assert (held.code, held.out, held.err) == (0, "", "")
    failed = compare("wrong.yaml", "-N", "5", f"--max-{gate}", str(limit), "-q")
    assert failed.code == 3
    column = gate.replace("-", "_")
    above = re.fullmatch(
        rf"quito: quasi-interpolant:gaussian: {column} is ([\d.]+), above {limit:g}\n", failed.err
    )
    assert above
    assert float(above[1]) == pytest.approx(math.sqrt(20) if limit > 1 else 1, abs=1e-4)


def test_gates_are_of_our_row_alone_and_all_are_told(compare: Compare) -> None:
    limits = ["--max-violation", "1e-3", "--max-total-variation", "1e-3"]
    found = compare("known.yaml", "-N", "6", "--against", "hermite10", *limits)
    assert found.code == 0
    found = compare("alychan", "-N", "6", "--against", "lgr:5x4", "--max-total-variation", "1")
    assert found.code == 0, "ours is within, the other is not"
    assert " 1.02" in found.out
    both = compare("wrong.yaml", "-N", "5", "--max-error-l2", "0.5", "--max-error-sup", "0.4")
    assert both.code == 3
    assert both.err.count("above") == 2
    assert "Error of the control" in both.out, "the table is printed all the same"


def test_a_gate_is_looked_at_where_another_method_fails(compare: Compare) -> None:
    asked = ("minimum_time", "-N", "50", "--against", "lgr:10x5", "-q")
    assert compare(*asked, "--max-error-l2", "9").code == 1, "the other has not converged"
    found = compare(*asked, "--max-error-l2", "0.01")
    assert found.code == 3
    assert "quasi-interpolant:gaussian: error_l2 is" in found.err


def test_a_gate_without_a_figure(compare: Compare) -> None:
    found = compare("known.yaml", "-N", "5", "--max-switching-error", "1")
    assert found.code == 2
    assert found.err == (
        "quito: max-switching-error: nothing is known to measure it by; leave it out, or give the "
        "problem a reference\n"
    )


def test_a_switch_that_is_not_made_keeps_no_gate(compare: Compare) -> None:
    """The reference jumps at 1/2, the answer never."""
    found = compare("jumps.yaml", "-N", "5", "--max-switching-error", "1000", "--json")
    assert found.code == 3
    assert "switching_error is inf, above 1000" in found.err
    (switch,) = found.json["rows"][0]["switching_times"]
    assert switch == {"known": 0.5, "found": None, "error": None}
    assert r"$\infty$" in compare("jumps.yaml", "-N", "5", "--latex").out


def test_a_gate_of_what_lies_outside_of_zones_that_are_everywhere(compare: Compare) -> None:
    limits = ["--zone", "0.4", "--max-error-sup-outside", "1"]
    found = compare("van_der_pol", "-N", "20", *limits)
    assert found.code == 2
    assert found.err.startswith("quito: max-error-sup-outside: nothing is known to measure it by")


def test_gates_of_results_are_not_kept_by_the_truth_alone(compare: Compare) -> None:
    """Held against the first of them, the first has no error: the others are what is judged."""
    quito.solve("lags.yaml", steps=20).save("fine.h5")
    quito.solve("lags.yaml", steps=4).save("coarse.h5")
    found = compare("fine.h5", "coarse.h5", "--max-error-l2", "1e-9")
    assert found.code == 3
    assert re.fullmatch(r"quito: coarse: error_l2 is [\d.e-]+, above 1e-09\n", found.err)
    assert compare("fine.h5", "coarse.h5", "--max-error-l2", "1").code == 0


def test_every_gate_is_an_option_and_a_column(compare: Compare) -> None:
    keys = {column.key for given in COLUMNS.values() for column in given}
    assert {gate.column for gate in GATES} <= keys
    text = " ".join(compare("--help").out.split())
    for gate in GATES:
        assert f"--max-{gate.name}" in text
    for row in METHODS:
        assert row in text
    assert f"[default: {ZONE}]" in text
    assert FINER == 4
    assert "four times the cells" in text


def test_pictures(compare: Compare, tmp_path: Path) -> None:
    found = compare("wrong.yaml", "-N", "5", "--format", "svg", "-o", "out", "--json", plot=True)
    assert found.code == 0
    drawn = found.json["plots"]
    assert drawn
    for path in drawn:
        assert re.fullmatch(r"out/wrong-compare[\w-]*\.svg", path)
        assert (tmp_path / path).read_text(encoding="utf-8").startswith("<?xml")
    assert {path.name for path in (tmp_path / "out").iterdir()} == {Path(p).name for p in drawn}


def test_nothing_is_written_without_pictures(compare: Compare, tmp_path: Path) -> None:
    before = set(tmp_path.rglob("*"))
    assert compare("known.yaml", "-N", "5").code == 0
    assert set(tmp_path.rglob("*")) == before


def test_an_interruption_ends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """At the first iteration of the second method, as Ctrl-C does it."""
    import signal

    told: list[str] = []

    def listener(name: str, progress: Progress) -> None:
        if name not in told:
            told.append(name)
            if name == "piecewise-constant":
                signal.raise_signal(signal.SIGINT)

    found = quito.compare(
        "van_der_pol", "piecewise-constant,laguerre6,sech", steps=30, listener=listener
    )
    assert told == ["quasi-interpolant:gaussian", "piecewise-constant"]
    assert [row.method for row in found.rows] == told
    assert found.interrupted
    assert not found.rows[1].solution.success
    import quito_cli.comparison.compare as module

    monkeypatch.setattr(module, "compare", lambda *_, **__: found)
    assert run(["compare", "van_der_pol", "--no-plot", "-q"], monkeypatch) == 130
