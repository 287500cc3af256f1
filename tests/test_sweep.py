"""Sweeps: axes, cases, continuation, the HDF5 and the plots, against answers known by formula."""

from __future__ import annotations

import ast
import json
import math
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import xarray
from documents import Ran
from documents import run as command
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

import quito_cli as quito
from quito_cli.batch import dataset
from quito_cli.batch.axes import MOST_CASES, Axis, axis, known, parse, shadowed, text_of
from quito_cli.batch.case import Case, Ending, Finished
from quito_cli.batch.figures import TIMES
from quito_cli.batch.run import Setting, run
from quito_cli.batch.solving import Keep
from quito_cli.batch.suite import Suite, load_suite
from quito_cli.batch.sweep import Sweep, Swept, collected, expand
from quito_cli.batch.sweeping import grids
from quito_cli.errors import UsageError
from quito_cli.plots.sweep import draw_all, figures
from quito_cli.plots.sweep_scales import edges
from quito_cli.plots.sweep_trajectories import trajectories
from quito_cli.problem.load import load_text
from quito_cli.problem.schema import Problem
from quito_cli.problem.text.complaints import ProblemError

Array = NDArray[np.float64]

TEXT = """\
title: Linear dynamics, quadratic cost, $both$ scaled
constants: {a: 1, T: 1, steps_of: 3}
time: {initial: 0, final: T}
states: {x: {initial: a, unit: m}}
controls: {u: {unit: m/s}}
dynamics: {x: u}
cost: {lagrange: 0.5*(x^2 + u^2)}
"""
"""V = a² tanh(T)/2 with x = a cosh(T − t)/cosh T and u = −a sinh(T − t)/cosh T."""
REACH = """\
constants: {goal: 0.5, steps: 1}
time: {initial: 0, final: 1}
states: {x: {initial: 0, final: goal}}
controls: {u: {lower: -1, upper: 1}}
dynamics: {x: u}
cost: {lagrange: u^2}
"""
"""V = goal², and no answer where |goal| > 1; the constant `steps` is called like an option."""


@pytest.fixture(scope="module")
def lq() -> Problem:
    return load_text(TEXT, "lq.yaml")


@pytest.fixture(scope="module")
def reach() -> Problem:
    return load_text(REACH, "reach.yaml")


def plan(problem: Problem, *over: str, **given: Any) -> Sweep:
    wanted: dict[str, Any] = {"options": {}, "constants": {}, "warm": False} | given
    sweep = expand(problem, "problem.yaml", parse(over, problem), **wanted)
    cases = tuple(replace(case, text=problem.text) for case in sweep.cases)
    return replace(sweep, cases=cases)


def swept_over(sweep: Sweep, folder: Path, jobs: int = 1) -> Swept:
    return collected(sweep, run(sweep.cases, Setting(jobs, folder, "all")))


def values(problem: Problem, over: str) -> tuple[Any, ...]:
    (found,) = parse([over], problem)
    return found.values


# Axes


@pytest.mark.parametrize(
    ("over", "expected"),
    [
        ("a=0.1:2:20", tuple((i + 1) / 10 for i in range(20))),
        ("a=2:0.5:4", (2.0, 1.5, 1.0, 0.5)),
        ("a=1e-3:1:4:log", (1e-3, 1e-2, 1e-1, 1.0)),
        ("a=-8:-1:4:log", (-8.0, -4.0, -2.0, -1.0)),
        ("a=1:2:2:lin", (1.0, 2.0)),
        ("T=pi/4, pi/2, 1/3", (math.pi / 4, math.pi / 2, 1 / 3)),
        ("T=0:pi:3", (0.0, math.pi / 2, math.pi)),
        ("states.x.initial=1,2", (1.0, 2.0)),
        ("steps=50,100,200", (50, 100, 200)),
        ("steps=50:200:4", (50, 100, 150, 200)),
        ("steps=10:1000:5:log", (10, 32, 100, 316, 1000)),
        ("variance=1:2:3", (1.0, 1.5, 2.0)),
        ("generating-function=gaussian,3", ("gaussian", "laguerre6")),
        ("normalised=yes,false", (True, False)),
        ("solver=ipopt,sqpmethod", ("ipopt", "sqp-qrqp")),
    ],
)
def test_values_of_an_axis(over: str, expected: tuple[Any, ...], lq: Problem) -> None:
    found = values(lq, over)
    assert found == expected  # to the last digit: a third of the way is what is nearest to it
    assert [type(value) for value in found] == [type(value) for value in expected]


@pytest.mark.parametrize(
    ("over", "words"),
    [
        ("a", "write NAME=VALUES"),
        ("=1,2", "write NAME=VALUES"),
        ("a=", "write NAME=VALUES"),
        ("a=1:2", "START:STOP:POINTS"),
        ("a=1:2:3:cubic", "START:STOP:POINTS:log"),
        ("a=1:2:1", "from 2 to 10,000, got '1'"),
        ("a=1:2:1e9", "from 2 to 10,000, got '1e9'"),
        ("a=1:2:" + "9" * 5000, "from 2 to 10,000"),
        ("a=1:1:3", "write a=1"),
        ("a=-1:1:3:log", "same side of zero"),
        ("a=0:1:3:log", "same side of zero"),
        ("a=1,,2", "a value is missing"),
        ("a=1,1.0", "1 stands there twice"),
        ("steps=1:3:9", "1 stands there twice"),
        ("a=x,1", "'x' is no number: unknown name 'x'"),
        ("a=inf,1", "'inf' is no number"),
        ("a=1/0,2", "'1/0' is no number"),
        ("b=1,2", "no constant 'b', nor is it an option (the constants are a, T, steps_of)"),
        ("step=1,2", "did you mean 'steps'?"),
        ("x=1,2", "'x' is neither a constant nor an option; did you mean states.x.upper?"),
        ("x.initial=1,2", "did you mean states.x.initial?"),
        ("tf=1,2", "sweep the horizon as time.final"),
        ("options.steps=1,2", "only time, states, controls"),
        ("steps=1.5,2", "1.5: expected a whole number"),
        ("steps=0,2", "0: expected"),
        ("generating_function=gauss", "did you mean 'gaussian'?"),
        ("generating_function=1:6:6", "has no values between others: list them with commas"),
        ("guess=a.h5", "guess is no axis: --warm starts each solve from its neighbour"),
        ("warm-start=true", "warm-start is no axis"),
        ("solver_options=1", "given with --solver-option"),
    ],
)
def test_what_is_no_axis_says_why(over: str, words: str, lq: Problem) -> None:
    with pytest.raises(UsageError, match=r"^--over ") as caught:
        parse([over], lq)
    assert words in str(caught.value)


def test_a_number_of_no_size_takes_no_time(lq: Problem) -> None:
    assert values(lq, "a=1e-999999999,1") == (0.0, 1.0)


def test_an_axis_from_a_file_is_that_of_the_command_line(lq: Problem) -> None:
    assert axis("a", "1:2:3", known(lq)) == axis("a", [1, 1.5, 2], known(lq))
    assert axis("steps", [50, 100], known(lq)) == parse(["steps=50,100"], lq)[0]
    assert axis("a", 2, known(lq)).values == (2.0,)
    with pytest.raises(UsageError, match="True is no number"):
        axis("a", [True], known(lq))
    with pytest.raises(UsageError, match="is no number"):
        axis("a", [[1]], known(lq))


def test_a_constant_is_meant_before_an_option(reach: Problem) -> None:
    (found,) = parse(["steps=1,2"], reach)
    assert not found.option
    assert shadowed([found]) == ("steps",)
    assert parse(["constants.steps=1,2"], reach) == (found,)
    assert shadowed(parse(["goal=1,2"], reach)) == ()


def test_names_twice_and_too_many_cases_are_refused(lq: Problem) -> None:
    with pytest.raises(UsageError, match="a is swept twice"):
        parse(["a=1,2", "constants.a=3,4"], lq)
    with pytest.raises(UsageError, match=r"200 x 101 are 20,200 cases, .* 10,000 at most"):
        parse(["a=0:1:200", "T=1:2:101"], lq)
    assert math.prod(len(one.values) for one in parse(["a=0:1:100", "T=1:2:100"], lq)) == MOST_CASES


def test_labels_are_short_and_each_is_its_own() -> None:
    assert Axis("a", (0.1, 1 / 3), False).labels == ("0.1", "0.333333")
    close = Axis("a", (1.0, 1.0000000001), False).labels
    assert close == ("1.0", "1.0000000001")
    assert text_of(True) == "true"


# Cases


def test_all_combinations_with_the_last_axis_fastest(lq: Problem) -> None:
    sweep = plan(lq, "a=1,2", "steps=20,40,80", options={"variance": 3.0, "mesh": None})
    names = [f"a={a},steps={n}" for a in (1, 2) for n in (20, 40, 80)]
    assert [case.name for case in sweep.cases] == names
    last = sweep.cases[-1]
    assert last.options == {"variance": 3.0, "steps": 80}
    assert last.constants == {"a": 2.0}
    assert last.axes == {"a": 2.0, "steps": 80}
    assert {case.follows for case in sweep.cases} == {None}


def test_each_case_follows_a_neighbour(lq: Problem) -> None:
    sweep = plan(lq, "a=1,2,3", "T=1,2", "steps=20,40,80", warm=True)
    places = {
        case.name: index for index, case in zip(np.ndindex(3, 2, 3), sweep.cases, strict=True)
    }
    first, *others = sweep.cases
    assert first.follows is None
    seen = {first.name}
    for case in others:
        assert case.follows in seen  # whatever comes before: no circle
        distance = np.subtract(places[case.name], places[str(case.follows)])
        assert sorted(distance) == [0, 0, 1]
        seen.add(case.name)
    chains = [case for case in sweep.cases if places[case.name][2] == 0]
    assert all(case.follows is None or places[case.follows][2] == 0 for case in chains)


@pytest.mark.parametrize(
    ("over", "given", "words"),
    [
        ("a=1,2", {"constants": {"constants.a": 3.0}}, "leave out --set constants.a"),
        ("steps=1,2", {"options": {"steps": 3}}, "leave out --steps"),
        (
            "control=quasi-interpolant,piecewise-constant",
            {"options": {"variance": 2.0}},
            "control=piecewise-constant: variance belongs to quasi-interpolants",
        ),
        ("a=1,2", {"constants": {"b": 1.0}}, "--over or --set b: the problem has no constant 'b'"),
        ("states.y.upper=1,2", {}, "there is no 'states.y'"),
    ],
)
def test_what_makes_no_sense_is_refused_before_a_solve(
    over: str, given: dict[str, Any], words: str, lq: Problem
) -> None:
    with pytest.raises(UsageError) as caught:
        plan(lq, over, **given)
    assert words in str(caught.value)


def test_a_file_that_makes_no_sense_at_the_first_point_shows_where(lq: Problem) -> None:
    with pytest.raises(ProblemError, match=r"lq.yaml:4:\d+: .*uper"):
        plan(lq, "states.x.uper=1,2")


def test_a_sweep_over_nothing_is_refused(lq: Problem) -> None:
    with pytest.raises(UsageError, match="goes over something"):
        plan(lq)


# What comes of it


@pytest.fixture(scope="module")
def lq_swept(lq: Problem, tmp_path_factory: pytest.TempPathFactory) -> Swept:
    """2 x 3 cases by two workers."""
    sweep = plan(lq, "a=1,2", "T=0.5:2:3:log", options={"steps": 20}, warm=True)
    return swept_over(sweep, tmp_path_factory.mktemp("lq"), 2)


@pytest.fixture(scope="module")
def reach_swept(reach: Problem, tmp_path_factory: pytest.TempPathFactory) -> Swept:
    """The third of four has no answer."""
    sweep = plan(reach, "goal=0.5,1,1.5,-1", options={"control": "piecewise-constant"}, warm=True)
    return swept_over(sweep, tmp_path_factory.mktemp("reach"))


def test_costs_over_the_axes_are_those_of_the_formula(lq_swept: Swept) -> None:
    cost = lq_swept.grid("cost")
    assert cost is not None
    known = [[a**2 * math.tanh(T) / 2 for T in (0.5, 1, 2)] for a in (1, 2)]
    assert cost == pytest.approx(np.array(known), rel=1e-6)


def test_what_is_not_solved_is_not_known(reach_swept: Swept) -> None:
    assert reach_swept.solved == (True, True, False, True)
    cost = reach_swept.grid("cost")
    assert cost == pytest.approx(np.array([0.25, 1, math.nan, 1]), rel=1e-6, nan_ok=True)
    assert reach_swept.figure("cost")[2] is None


def test_a_case_after_a_failure_starts_from_the_last_answer(reach_swept: Swept) -> None:
    last = reach_swept.finished[3]
    assert last is not None
    assert last.result is not None
    guess = quito.Solution.load(last.result).options["guess"]
    assert "goal=1." in str(guess)


def test_continuation_needs_fewer_iterations(tmp_path: Path) -> None:
    over, options = "mu=0.5:2:6", {"steps": 40}
    problem = quito.load("van_der_pol")
    axes = parse([over], problem)
    counts = []
    for warm in (False, True):
        sweep = expand(problem, "van_der_pol", axes, options=options, constants={}, warm=warm)
        iterations = swept_over(sweep, tmp_path).grid("iterations")
        assert iterations is not None
        counts.append(iterations)
    assert counts[0][0] == counts[1][0]
    assert counts[1].sum() < 0.9 * counts[0].sum()


def test_results_do_not_depend_on_the_number_of_jobs(lq_swept: Swept, tmp_path: Path) -> None:
    alone = swept_over(lq_swept.sweep, tmp_path, 1)
    for name in set(lq_swept.figures) - TIMES:
        assert alone.figure(name) == lq_swept.figure(name), name


def test_each_case_is_taken_once_in_whatever_order(reach_swept: Swept) -> None:
    finished = [one for one in reach_swept.finished if one is not None]
    again = collected(reach_swept.sweep, [*reversed(finished), finished[0]])
    assert again == reach_swept
    part = collected(reach_swept.sweep, finished[:1])
    assert part.finished[1:] == (None, None, None)
    assert part.solved == (True, False, False, False)


# The file


@pytest.fixture(scope="module")
def saved(lq_swept: Swept, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("saved") / "lq-sweep.h5"
    dataset.save(lq_swept, path)
    return path


def opened(path: Path, group: str = "/") -> xarray.Dataset:
    with xarray.open_dataset(path, engine="h5netcdf", group=group) as data:
        return data.load()


def test_xarray_finds_figures_over_the_axes(saved: Path) -> None:
    data = opened(saved)
    assert data["cost"].dims == data["iterations"].dims == data["success"].dims == ("a", "T")
    assert data["T"].values == pytest.approx([0.5, 1, 2], rel=1e-15)
    assert data["cost"].sel(a=2, T=1).item() == pytest.approx(2 * math.tanh(1), rel=1e-6)
    assert data["success"].dtype == bool
    assert data["success"].all()
    assert data["iterations"].sel(a=1, T=2).item() > 0
    assert data["ending"].values.tolist() == [["passed"] * 3] * 2
    assert data["status"].values.tolist() == [["solved"] * 3] * 2
    assert data.attrs["format"] == "quito sweep"
    assert data.attrs["format_version"] == 1


def test_xarray_finds_trajectories_over_normalised_time(saved: Path) -> None:
    data = opened(saved, "trajectory")
    assert data["state"].dims == ("a", "T", "normalised_time", "state_name")
    assert "time" in data.coords  # of states and controls
    assert data["time"].dims == ("a", "T", "normalised_time")
    assert data["state_unit"].sel(state_name="x").item() == "m"
    for a in (1, 2):
        for T in (0.5, 1, 2):
            one = data.sel(a=a, T=T)
            t = one["time"].values
            assert t[[0, -1]] == pytest.approx([0, T])
            x, u = one["state"].sel(state_name="x"), one["control"].sel(control_name="u")
            assert x.values == pytest.approx(a * np.cosh(T - t) / math.cosh(T), abs=1e-4)
            assert u.values == pytest.approx(-a * np.sinh(T - t) / math.cosh(T), abs=0.02)


def test_a_sweep_is_no_result_and_says_where_these_are(saved: Path) -> None:
    with pytest.raises(quito.ResultFileError, match="is a sweep: the result of each of its cases"):
        quito.Solution.load(saved)


def test_every_dimension_has_a_scale(saved: Path) -> None:
    with h5py.File(saved) as file:
        for group in (file, file["trajectory"]):
            for name, found in group.items():
                if isinstance(found, h5py.Dataset):
                    for dimension in found.dims:
                        assert found.is_scale or len(dimension) == 1, name


def test_without_an_answer_there_is_nan(reach_swept: Swept, tmp_path: Path) -> None:
    dataset.save(reach_swept, tmp_path / "a.h5")
    data, trajectory = opened(tmp_path / "a.h5"), opened(tmp_path / "a.h5", "trajectory")
    assert np.isnan(data["cost"].values).tolist() == [False, False, True, False]
    assert data["success"].values.tolist() == [True, True, False, True]
    assert data["ending"].values[2] == "unsolved"
    assert "goal" in data["message"].values[2] or "x" in data["message"].values[2]
    for name in ("time", "state", "control"):
        assert np.isnan(trajectory[name].values).any(
            axis=(1, 2) if name != "time" else 1
        ).tolist() == [*(False, False, True, False)]
    assert trajectory["state"].sel(goal=-1).values[-1, 0] == pytest.approx(-1)


def test_a_sweep_without_any_answer_has_no_trajectories(reach_swept: Swept, tmp_path: Path) -> None:
    finished = [
        replace(one, ending=Ending.CRASHED, figures={}) for one in reach_swept.finished if one
    ]
    nothing = collected(reach_swept.sweep, finished)
    dataset.save(nothing, tmp_path / "a.h5")
    assert opened(tmp_path / "a.h5")["ending"].values.tolist() == ["crashed"] * 4
    assert draw_all(nothing, ["cost"], tmp_path, "png") == ()


def finished_with(case: Case, **figures: Any) -> Finished:
    return Finished(case, Ending.PASSED, "", figures, (), 0.0, None)


def test_figures_with_several_numbers_and_words(reach: Problem, tmp_path: Path) -> None:
    sweep = plan(reach, "goal=0.1,0.2,0.3")
    times: list[tuple[float, ...]] = [(), (1.0,), (1.0, 2.0)]
    finished = [
        finished_with(case, switching_times=found, certificate=word, success=True)
        for case, found, word in zip(sweep.cases, times, ("passed", None, "failed"), strict=True)
    ]
    dataset.save(collected(sweep, finished), tmp_path / "a.h5")
    data = opened(tmp_path / "a.h5")
    assert data["switching_times"].dims == ("goal", "switching_times_number")
    found = data["switching_times"].values
    assert found == pytest.approx(
        np.array([[math.nan, math.nan], [1, math.nan], [1, 2]]), nan_ok=True
    )
    assert data["certificate"].values.tolist() == ["passed", "", "failed"]
    unknown = [finished_with(case, certificate=None, cost=None) for case in sweep.cases]
    dataset.save(collected(sweep, unknown), tmp_path / "b.h5")
    data = opened(tmp_path / "b.h5")
    assert data["certificate"].values.tolist() == ["", "", ""], "words whether there are any or not"
    assert np.isnan(data["cost"].values).all()


def test_axes_called_like_variables_go_by_their_paths(tmp_path: Path) -> None:
    text = REACH.replace("goal", "time")
    problem = load_text(text.replace("\ntime:", "\ntime:", 1), "reach.yaml")
    sweep = plan(problem, "constants.time=0.1,0.2", "control=piecewise-constant,piecewise-linear")
    finished = [finished_with(case, cost=1.0) for case in sweep.cases]
    dataset.save(collected(sweep, finished), tmp_path / "a.h5")
    assert opened(tmp_path / "a.h5")["cost"].dims == ("constants.time", "options.control")


def test_the_same_sweep_makes_the_same_bytes_but_for_times(
    reach_swept: Swept, tmp_path: Path
) -> None:
    timeless = tuple(
        one and replace(one, figures={k: v for k, v in one.figures.items() if k not in TIMES})
        for one in reach_swept.finished
    )
    for name in ("a.h5", "b.h5"):
        dataset.save(replace(reach_swept, finished=timeless), tmp_path / name)
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.h5", "b.h5"]


# Plots


def made_up(
    problem: Problem, over: Sequence[str], cost: Callable[[Case], float | None], **more: Any
) -> Swept:
    """A sweep with figures by formula; None: not solved."""
    sweep = plan(problem, *over)
    finished = []
    for case in sweep.cases:
        value = cost(case)
        ending = Ending.UNSOLVED if value is None else Ending.PASSED
        found = {} if value is None else {"cost": value, **more}
        finished.append(Finished(case, ending, "", found, (), 0.0, None))
    return collected(sweep, finished)


def drawn(swept: Swept, *names: str) -> Figure:
    found = figures(swept, names or ("cost",))
    assert found is not None
    found.draw_without_rendering()
    return found


def xs(line: Line2D) -> list[float]:
    return [float(x) for x in np.asarray(line.get_xdata())]


def ys(line: Line2D) -> list[float]:
    return [float(y) for y in np.asarray(line.get_ydata())]


def legend(figure: Figure) -> list[str]:
    return [text.get_text() for one in figure.legends for text in one.get_texts()]


def test_a_figure_over_one_axis_has_a_point_for_each_case(lq: Problem) -> None:
    swept = made_up(
        lq, ["a=1:5:5"], lambda c: None if c.axes["a"] == 3 else float(c.axes["a"]) ** 2
    )
    figure = drawn(swept)
    (plot,) = figure.axes
    curve, missing = plot.lines
    assert xs(curve) == [1, 2, 3, 4, 5]
    assert ys(curve) == pytest.approx([1, 4, math.nan, 16, 25], nan_ok=True)
    assert xs(missing) == [3]
    assert legend(figure) == ["not solved"]
    assert plot.get_xlabel() == "a"
    assert plot.get_yscale() == "linear"
    assert r"\$both\$" in figure.get_suptitle()
    assert "1 of 5 not solved" in figure.get_suptitle()


def test_scales_are_those_of_the_axis_and_of_the_figure(lq: Problem) -> None:
    swept = made_up(lq, ["a=0.01:1:5:log"], lambda c: float(c.axes["a"]) ** 2)
    (plot,) = drawn(swept).axes
    assert (plot.get_xscale(), plot.get_yscale()) == ("log", "log")


def test_names_stand_side_by_side(lq: Problem) -> None:
    swept = made_up(lq, ["solver=ipopt,uno,sleqp"], lambda c: 1.0)
    (plot,) = drawn(swept).axes
    assert [tick.get_text() for tick in plot.get_xticklabels()] == ["ipopt", "uno", "sleqp"]
    assert plot.lines[0].get_linestyle() == "None"  # there is nothing between two names


def test_two_fine_axes_make_a_map(lq: Problem) -> None:
    def cost(case: Case) -> float | None:
        a, T = float(case.axes["a"]), float(case.axes["T"])
        return None if (a, T) == (2, 3) else a + 10 * T

    figure = drawn(made_up(lq, ["a=1:4:4", "T=1:5:5"], cost))
    plot = figure.axes[0]
    mesh = plot.collections[0]
    array: Array = np.ma.filled(np.ma.asarray(mesh.get_array()), np.nan)
    array = array.reshape(5, 4)  # rows are the second axis
    assert array[0].tolist() == [11, 12, 13, 14]
    assert array[4].tolist() == [51, 52, 53, 54]
    assert np.isnan(array[2, 1])
    assert (plot.get_xlabel(), plot.get_ylabel()) == ("a", "T")
    assert (xs(plot.lines[0]), ys(plot.lines[0])) == ([2], [3])


def test_a_coarse_axis_makes_a_family_of_curves(lq: Problem) -> None:
    def cost(case: Case) -> float:
        return float(case.axes["T"]) * (2 if case.axes["generating_function"] == "sech" else 1)

    over = ["generating_function=gaussian,sech", "T=1:3:3"]
    figure = drawn(made_up(lq, over, cost))
    (plot,) = figure.axes
    assert [ys(line) for line in plot.lines] == [[1, 2, 3], [2, 4, 6]]
    colours = [line.get_color() for line in plot.lines]
    assert colours[0] != colours[1]
    assert legend(figure) == ["generating_function = gaussian", "generating_function = sech"]


def test_three_axes_are_told_by_colours_and_dashes(lq: Problem) -> None:
    over = ["a=1:9:9", "T=1:7:7", "generating_function=gaussian,sech"]
    figure = drawn(made_up(lq, over, lambda c: float(c.axes["a"])))
    plot, bar = figure.axes
    assert len(plot.lines) == 14
    assert bar.get_ylabel() == "T"
    assert legend(figure) == ["generating_function = gaussian", "generating_function = sech"]
    assert len({str(line.get_color()) for line in plot.lines}) == 7
    assert len({line.get_linestyle() for line in plot.lines}) == 2


def test_figures_with_several_numbers_are_points(lq: Problem) -> None:
    swept = made_up(lq, ["a=1,2,3"], lambda c: 1.0, switching_times=(1.0, 2.0), status="solved")
    plot = drawn(swept, "switching_times", "status").axes[0]
    assert [line.get_linestyle() for line in plot.lines] == ["None", "None"]
    assert figures(swept, ["status", "nothing"]) is None


def test_edges_lie_halfway() -> None:
    assert edges(Axis("a", (1.0, 2.0, 4.0), False)) == pytest.approx([0.5, 1.5, 3, 5])
    log = Axis("a", (1.0, 4.0, 16.0), False, logarithmic=True)
    assert edges(log) == pytest.approx([0.5, 2, 8, 32])


def test_trajectories_are_those_of_the_answers(lq_swept: Swept) -> None:
    figure = trajectories(lq_swept)
    assert figure is not None
    state, control = figure.axes
    assert (state.get_ylabel(), control.get_ylabel()) == ("x [m]", "u [m/s]")
    assert len(state.lines) == len(control.lines) == 6
    ends = sorted((xs(line)[-1], ys(line)[-1]) for line in state.lines)
    known = sorted((T, a / math.cosh(T)) for a in (1, 2) for T in (0.5, 1, 2))
    assert np.array(ends) == pytest.approx(np.array(known), rel=1e-4)
    assert legend(figure) == [*("T = 0.5", "T = 1", "T = 2"), *("a = 1", "a = 2")]


def test_a_bound_that_all_have_is_drawn(reach_swept: Swept) -> None:
    figure = trajectories(reach_swept)
    assert figure is not None
    _, control = figure.axes
    flat = {ys(line)[0] for line in control.lines if line.get_linestyle() == ":"}
    assert flat == {-1.0, 1.0}


def test_pictures_are_written(lq_swept: Swept, tmp_path: Path) -> None:
    for ending, magic in (("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF")):
        paths = draw_all(lq_swept, ["cost", "iterations"], tmp_path, ending)
        assert [path.name for path in paths] == [
            *(f"lq-sweep.{ending}", f"lq-sweep-trajectories.{ending}")
        ]
        assert all(path.read_bytes().startswith(magic) for path in paths)


# The command


def quito_sweep(
    arguments: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Ran:
    code = command(["sweep", *arguments], monkeypatch)
    said = capsys.readouterr()
    return Ran(code, said.out, said.err)


@pytest.fixture
def file(tmp_path: Path) -> str:
    path = tmp_path / "reach.yaml"
    path.write_text(REACH)
    return str(path)


def test_the_command_prints_a_table_and_writes_what_it_says(
    file: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = [file, "--over", "goal=0.5,1.5", "-o", str(tmp_path / "out"), "-j", "1"]
    ran = quito_sweep([*arguments, "--figures", "cost,switching_times"], monkeypatch, capsys)
    assert ran.code == 1
    lines = [line.split() for line in ran.out.splitlines()]
    assert ["goal", "cost", "switching", "times", "seconds", "ended"] in lines
    (first,) = (line for line in lines if line[:1] == ["0.5"])
    assert float(first[1]) == pytest.approx(0.25, rel=1e-4)
    assert first[-1] == "passed"
    (second,) = (line for line in lines if line[:1] == ["1.5"])
    assert second[1:3] == ["-", "-"]
    assert second[-1] == "unsolved"
    assert "Not all solved. 1 of 2 cases" in ran.out
    written = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert written == [
        *("reach-sweep", "reach-sweep-trajectories.png", "reach-sweep.h5", "reach-sweep.png")
    ]
    assert all(name in ran.out for name in written)
    assert (tmp_path / "out" / "reach-sweep" / "goal=0.5.h5").is_file()
    assert opened(tmp_path / "out" / "reach-sweep.h5")["cost"].dims == ("goal",)


def test_json_is_one_object_whatever_becomes_of_the_cases(
    file: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = [file, "--over", "goal=0.5,1.5", "--over", "constants.steps=1", "--json"]
    ran = quito_sweep(
        [*arguments, "--no-plot", "-N", "10", "-o", str(tmp_path)], monkeypatch, capsys
    )
    said = ran.json
    assert ran.code == said["exit_code"] == 1
    assert said["axes"] == [
        {"name": "goal", "option": False, "values": [0.5, 1.5]},
        {"name": "steps", "option": False, "values": [1.0]},
    ]
    assert said["solved"] == 1
    assert [case["ending"] for case in said["cases"]] == ["passed", "unsolved"]
    assert said["cases"][0]["figures"]["cells"] == 10  # -N is the option, not the constant
    assert said["cases"][0]["figures"]["cost"] == pytest.approx(0.25, rel=1e-2)
    assert said["notes"] == [
        "steps: a constant of the problem and an option of a solve; the constant was swept"
    ]
    assert (said["hdf5"], said["plots"]) == (str(tmp_path / "reach-sweep.h5"), [])


def test_a_figure_that_was_not_asked_for_at_first_is_told_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["bang_bang", "--over", "steps=10,20", "--no-plot", "-j", "1", "--json"]
    for more, notes in (([], 0), (["--resume", "--figures", "error_l2"], 1)):
        ran = quito_sweep([*arguments, *more, "-o", str(tmp_path)], monkeypatch, capsys)
        assert len(ran.json["notes"]) == notes
    assert ran.json["notes"][0].startswith("error_l2: not found of 2 cases done before")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "a sweep goes over something: add --over"),
        (["--over", "goal=1,2", "--figures", "costs"], "no figure 'costs'; did you mean 'cost'?"),
        (["--over", "goal=1,2", "-j", "0"], "jobs: a number from 1 to 1000"),
        (["--over", "goal=1,2", "--set", "goal=1"], "goal is swept over: leave out --set goal"),
        (["--over", "variance=1,2", "--variance", "3"], "leave out --variance"),
        (["--over", "goal=1,2", "--cluster", "tcp://a:1", "-j", "2"], "a cluster has its own"),
        (["--over", "goal=1,2", "--time-limit", "0"], "time-limit: a number of seconds above 0"),
        (["--over", "goal=1,2", "--memory-limit", "much"], "expected a size such as"),
        (["--over", "goal=1,2", "--format", "jpg"], "expected png, pdf or svg"),
        (["--over", "goal=1,2", "--resume"], "there is nothing to resume"),
        (["--over", "goals=1,2"], "--over goals=1,2: the problem has no constant 'goals'"),
    ],
)
def test_a_wrong_command_line_says_why(
    arguments: list[str],
    words: str,
    file: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    ran = quito_sweep([file, *arguments, "-o", str(tmp_path / "out")], monkeypatch, capsys)
    assert (ran.code, ran.out) == (2, "")
    assert words in ran.err


def test_interrupted_it_keeps_what_is_done_and_goes_on_from_there(
    file: str, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    arguments = ["sweep", file, "--over", "goal=0.01:0.99:24", "-j", "1", "-o", str(out)]
    line = [sys.executable, "-m", "quito_cli", *arguments, "--no-plot"]
    with subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as running:
        assert running.stdout is not None
        assert running.stdout.readline().startswith(b"passed")
        running.send_signal(signal.SIGINT)
        _, said = running.communicate(timeout=120)
    assert running.returncode == 130
    assert b"--resume goes on" in said
    before = opened(out / "reach-sweep.h5")
    done = int(before["success"].sum())
    assert 0 < done < 24
    assert (before["ending"].values[-1], np.isnan(before["cost"].values[-1])) == ("", True)
    times = {path: path.stat().st_mtime_ns for path in (out / "reach-sweep").glob("*.h5")}
    again = subprocess.run(
        [*line, "--resume", "--json"], capture_output=True, timeout=240, check=True
    )
    assert json.loads(again.stdout)["solved"] == 24
    first = out / "reach-sweep" / "goal=0.01.h5"
    assert first.stat().st_mtime_ns == times[first]
    cost = opened(out / "reach-sweep.h5")["cost"]
    assert cost.values == pytest.approx(np.linspace(0.01, 0.99, 24) ** 2, rel=1e-3)


def test_a_reference_is_not_held_against_other_problems(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "known.yaml"
    for general, applies in (("", False), (", general: true", True)):
        path.write_text(f"{REACH}reference: {{cost: goal^2, accuracy: 1.0e-9{general}}}\n")
        arguments = [str(path), "--over", "goal=0.25,0.75", "--json", "--no-plot", "-j", "1"]
        ran = quito_sweep([*arguments, "-o", str(tmp_path)], monkeypatch, capsys)
        errors = [case["figures"]["cost_error"] for case in ran.json["cases"]]
        assert [error is not None for error in errors] == [applies, applies]
        assert not applies or max(errors) < 1e-3


def test_from_python_it_is_the_same(tmp_path: Path) -> None:
    path = tmp_path / "lq.yaml"
    path.write_text(TEXT)
    swept = quito.sweep(
        path, {"a": "1:2:2", "steps": [10, 20]}, jobs=1, output=tmp_path, variance=3
    )
    cost = swept.grid("cost")
    assert cost is not None
    assert cost[1] == pytest.approx(2 * math.tanh(1), rel=1e-4)
    assert swept.sweep.options == {"variance": 3}
    with pytest.raises(UsageError, match="no constant 'b'"):
        quito.sweep(path, {"b": [1, 2]}, output=tmp_path)


# In suites


KEEPS: tuple[Keep, ...] = ("all", "none")
SUITE = """\
cases:
  - problem: reach.yaml
    set: {steps: 2}
    matrix: {variance: [2, 3]}
    over: {goal: "0.5:1:3", substeps: [1, 2]}
    warm: true
    expect: {cost: <= 1.1}
"""


def suite_at(folder: Path, text: str) -> Suite:
    (folder / "reach.yaml").write_text(REACH)
    (folder / "suite.yaml").write_text(text)
    return load_suite(folder / "suite.yaml")


def test_a_suite_has_the_cases_of_the_command_line(reach: Problem, tmp_path: Path) -> None:
    suite = suite_at(tmp_path, SUITE)
    sweep = plan(reach, "goal=0.5:1:3", "substeps=1,2", warm=True)
    for variance, cases in ((2, suite.cases[:6]), (3, suite.cases[6:])):
        for case, other in zip(cases, sweep.cases, strict=True):
            assert case.name == f"reach[variance={variance},{other.name}]"
            follows = other.follows and f"reach[variance={variance},{other.follows}]"
            assert case.follows == follows
            assert case.options == {"variance": variance, **other.options}
            assert case.constants == {"steps": 2, **other.constants}
            assert case.axes == {"variance": variance, **other.axes}


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("goal:", "gaol:", "suite.yaml:5:12: the problem has no constant 'gaol'"),
        ('"0.5:1:3"', "0.5:1", "suite.yaml:5:12: write START:STOP:POINTS"),
        ("substeps:", "variance:", "variance is in the matrix, too"),
        ("substeps: [1, 2]", "substeps: [1, 0.5]", "0.5: expected a whole number"),
        ("substeps: [1, 2]", "objective_scale: [1, 2]", "nor is it an option"),
        ("[1, 2]", "{from: 1}", "expected a range such as 0.1:2:20, or a list of values"),
        (
            '    over: {goal: "0.5:1:3", substeps: [1, 2]}\n',
            "",
            "suite.yaml:5:5: continuation goes",
        ),
        ("0.5:1:3", "0:1:6000", "this sweep has 24,000 combinations"),
    ],
)
def test_what_is_wrong_with_a_sweep_of_a_suite_is_shown(
    old: str, new: str, words: str, tmp_path: Path
) -> None:
    with pytest.raises(ProblemError) as caught:
        suite_at(tmp_path, SUITE.replace(old, new))
    assert words in str(caught.value)


def test_continuation_does_not_depend_on_what_is_kept(tmp_path: Path) -> None:
    suite = suite_at(tmp_path, SUITE)
    iterations = []
    for keep in KEEPS:
        found = run(suite.cases, Setting(1, tmp_path / keep, keep))
        iterations.append({one.case.name: one.figures["iterations"] for one in found})
    assert iterations[0] == iterations[1]


def test_sweeps_and_matrices_of_a_suite_are_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text = SUITE.replace("    matrix: {variance: [2, 3]}\n", "") + "  - van_der_pol\n"
    suite = suite_at(tmp_path, text)
    (grid,) = grids(suite.cases)
    assert [axis.name for axis in grid.axes] == ["goal", "substeps"]
    assert [axis.option for axis in grid.axes] == [False, True]
    assert grids(suite.cases[1:]) == ()  # a case is missing
    out = tmp_path / "out"
    arguments = [str(tmp_path / "suite.yaml"), "--sweeps", "-o", str(out), "-j", "1"]
    assert command(["batch", *arguments, "--filter", "reach"], monkeypatch) == 0
    assert "reach-sweep.h5" in capsys.readouterr().out
    data = opened(out / "reach-sweep.h5")
    assert data["cost"].dims == ("goal", "substeps")
    for goal in (0.5, 0.75, 1):
        assert data["cost"].sel(goal=goal).values == pytest.approx(goal**2, rel=1e-4)
    assert (out / "reach-sweep.png").is_file()


# What the README says


README = (Path(__file__).parent.parent / "README.md").read_text(encoding="utf-8")


def test_the_axes_of_the_readme_are_axes() -> None:
    rows = re.findall(r"^\| `--over (\S+)` \|", README, re.MULTILINE)
    assert len(rows) == 5
    problem = quito.load("van_der_pol")
    counts = [len(one.values) for row in rows for one in parse([row], problem)]
    assert counts == [20, 10, 3, 2, 5]


def test_the_sweep_of_the_readme_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On few cells, and over the first of its values."""
    (line,) = re.findall(r"<!-- command: sweep -->\n```sh\nquito (.*)\n```", README)
    assert "mu=1:8:8 " in line
    monkeypatch.chdir(tmp_path)
    words = line.replace("mu=1:8:8", "mu=1:2:2").split()
    assert command([*words, "-N", "20", "--quiet"], monkeypatch) == 0
    for name in re.findall(r"`results/(van_der_pol-sweep\S*)`", README):
        assert (tmp_path / "results" / name).exists(), name


def test_the_scripts_of_the_readme_are_python_and_name_what_there_is() -> None:
    (script,) = re.findall(r"```python\n(import subprocess\n.*?)```", README, re.DOTALL)
    ast.parse(script)
    assert '"--cluster", cluster.scheduler_address' in script
