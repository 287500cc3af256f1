"""The figures of a comparison: what is drawn, in which frame, and what a reader is told."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

import quito_cli as quito
from quito_cli.comparison.comparison import Comparison, Errors, Row, Truth
from quito_cli.plots.comparison import FIGURES, draw_all, figure, style
from quito_cli.plots.palette import OURS
from quito_cli.plots.panels import thinned
from quito_cli.problem.load import load_text

Array = NDArray[np.float64]
Solve = Callable[..., quito.Solution]

TEXT = """
title: A jump of $1$ at a half
time: {initial: 0, final: 1}
states: {x: {initial: 0, unit: m}, y: {initial: 1}}
controls: {u: {lower: -1, upper: 1, unit: m/s}, w: {}}
dynamics: {x: u, y: w - y}
cost: {lagrange: u^2 + w^2}
"""
TIMES = (np.arange(200) + 0.5) / 200
NONE = Errors(*[math.nan] * 7)


def step(t: Array) -> Array:
    """u = 0 until 1/2, then 1; w is unknown."""
    return np.column_stack([np.where(t < 0.5, 0.0, 1.0), np.full(len(t), np.nan)])


def unknown(t: Array) -> Array:
    return np.full((len(t), 2), np.nan)


TRUTH = Truth("reference of the file", 0.5, None, (0.5,), step, unknown)


def row(method: str, solution: quito.Solution, error: Array) -> Row:
    """A row with the error `error` of u at the sample times."""
    samples = np.column_stack([error, np.full(len(error), np.nan)])
    spectrum = np.abs(np.fft.rfft(samples, axis=0))
    nothing = (math.nan, math.nan)
    return Row(
        *(method, solution, NONE, (NONE, NONE), None, None, nothing, None, (), nothing, None),
        *(samples, spectrum),
    )


def comparison(solution: quito.Solution, *rows: Row) -> Comparison:
    quantities = solution.origin.controls, solution.origin.states
    zones = ((0.49, 0.51),)
    title = solution.origin.title
    frequencies = np.arange(101.0)
    return Comparison("step", title, *quantities, TRUTH, zones, TIMES, frequencies, rows, ())


def near_jump(size: float) -> Array:
    """One at the jump, `size` elsewhere."""
    return np.where(np.abs(TIMES - 0.5) < 0.01, 1.0, size)


@pytest.fixture(scope="module")
def solution(solve: Solve) -> quito.Solution:
    """u = w = 0."""
    return solve(TEXT, steps=10)


@pytest.fixture(scope="module")
def two(solution: quito.Solution) -> Comparison:
    ours = row("quasi-interpolant:gaussian", solution, near_jump(0.001))
    return comparison(solution, ours, row("piecewise-constant", solution, near_jump(0.002)))


def drawn(compared: Comparison, name: str) -> Figure:
    found = figure(compared, name)
    assert found is not None
    return found


def labels(found: Figure) -> list[str]:
    return [axes.get_ylabel() for axes in found.axes]


def legend(found: Figure) -> list[str]:
    (box,) = found.legends
    return [text.get_text() for text in box.get_texts()]


def line(axes: Axes, number: int) -> Line2D:
    """The line of a row's method."""
    (found,) = (a for a in axes.get_lines() if a.get_color() == style(number)["color"])
    return found


def values(line: Line2D) -> tuple[Array, Array]:
    x, y = (np.asarray(data, dtype=float) for data in line.get_data())
    return x, y


def test_the_plots_of_each_figure(two: Comparison) -> None:
    whole = "error of u [m/s]"
    curves = ["u [m/s]", "w", "x [m]", "y"]
    views = [whole, whole, "|error of u| [m/s]", "|DFT of error of u|"]
    assert labels(drawn(two, "trajectories")) == curves
    assert labels(drawn(two, "error")) == [whole, whole]
    assert labels(drawn(two, "error-log")) == ["|error of u| [m/s]"]
    assert labels(drawn(two, "spectrum")) == ["|DFT of error of u|"]
    assert labels(drawn(two, "sheet")) == curves + views


def test_the_legend_names_what_is_drawn(two: Comparison) -> None:
    methods = ["quasi-interpolant:gaussian", "piecewise-constant"]
    known = "reference of the file"
    assert legend(drawn(two, "trajectories")) == [*methods, known, "bound"]
    assert legend(drawn(two, "error")) == [*methods, "jump zones"]
    assert legend(drawn(two, "spectrum")) == methods
    assert legend(drawn(two, "sheet")) == [*methods, known, "bound", "jump zones"]


def test_the_reference_jumps_and_is_left_out_where_unknown(two: Comparison) -> None:
    u, w, x, y = drawn(two, "trajectories").axes
    (reference,) = (a for a in u.get_lines() if a.get_linewidth() > 4)
    t, height = values(reference)
    assert set(height) == {0.0, 1.0}
    assert np.all((height == 1) == (t >= 0.5))
    assert t[np.searchsorted(t, 0.5) - 1] == np.nextafter(0.5, 0)
    for axes in (w, x, y):
        assert all(a.get_linewidth() < 4 for a in axes.get_lines())


def test_times_stand_under_the_lowest_plot_of_their_kind(two: Comparison) -> None:
    under = [
        (axes.get_xlabel(), axes.xaxis.get_tick_params()["labelbottom"])
        for axes in drawn(two, "sheet").axes
    ]
    frequency = "frequency [cycles per unit of t]"
    assert under[:4] == [("", False)] * 3 + [("t", True)]  # below the fourth is the spectrum
    assert under[4:] == [("t", True)] * 3 + [(frequency, True)]
    limits = {axes.get_xlim() for axes in drawn(two, "sheet").axes[:7]}
    assert len(limits) == 1


def test_nothing_is_drawn_twice_and_ours_is_on_top(two: Comparison) -> None:
    for name in FIGURES:
        for axes in drawn(two, name).axes:
            lines = axes.get_lines()
            looks = {(a.get_color(), tuple(np.ravel(values(a)[1])[:1])) for a in lines}
            assert len(looks) == len(lines)
            top = max(lines, key=lambda a: a.get_zorder())
            assert (top.get_color(), top.get_linestyle()) == (OURS, "-")


def test_the_error_is_shown_on_the_whole_and_magnified(two: Comparison) -> None:
    whole, close = drawn(two, "error").axes
    assert whole.get_ylim()[1] > 1
    assert 0.002 < close.get_ylim()[1] < 0.01
    assert close.get_title(loc="right") == "magnified 330 times"
    for axes in (whole, close):
        t, error = values(line(axes, 0))
        np.testing.assert_array_equal(t, TIMES)
        calm = np.abs(t - 0.5) > 0.01
        np.testing.assert_array_equal(error[calm], 0.001)
        (zone,) = axes.patches
        corners = zone.get_extents().transformed(axes.transData.inverted())
        assert (corners.x0, corners.x1) == pytest.approx((0.49, 0.51))


def test_a_method_that_would_only_fill_the_magnified_plot_is_named_instead(
    two: Comparison, solution: quito.Solution
) -> None:
    rings = row("lgr", solution, 0.3 * np.sin(300 * TIMES))
    whole, close = drawn(replace(two, rows=(*two.rows, rings)), "error").axes
    assert len(whole.get_lines()) == 3
    assert len(close.get_lines()) == 2
    assert close.get_title(loc="right") == "magnified 330 times, lgr not shown: larger"


def test_an_error_that_is_as_large_everywhere_is_not_magnified(solution: quito.Solution) -> None:
    flat = comparison(solution, row("ours", solution, np.sin(40 * TIMES)))
    assert len(drawn(flat, "error").axes) == 1


def test_the_spectrum_is_over_the_frequency(solution: quito.Solution) -> None:
    """The transform of cos(2π·20 t) at n samples is n/2 at 20, and zero elsewhere."""
    wave = np.cos(2 * np.pi * 20 * TIMES)
    (axes,) = drawn(comparison(solution, row("ours", solution, wave)), "spectrum").axes
    f, modulus = values(line(axes, 0))
    assert (f[0], f[-1]) == (0, 100)
    assert f[modulus.argmax()] == 20
    assert modulus.max() == pytest.approx(100)
    assert axes.get_yscale() == "log"
    assert axes.get_xlabel() == "frequency [cycles per unit of t]"


def test_no_error_at_all_has_a_place_on_a_logarithmic_axis(solution: quito.Solution) -> None:
    exact = comparison(solution, row("ours", solution, near_jump(0.0)))
    (axes,) = drawn(exact, "error-log").axes
    _, error = values(line(axes, 0))
    low, high = axes.get_ylim()
    assert 0 < low <= error.min() < error.max() == 1 < high
    assert axes.get_title(loc="right") == "zero is drawn at the foot"
    (axes,) = drawn(comparison(solution, row("ours", solution, 0 * TIMES)), "error-log").axes
    assert axes.get_yscale() == "log"


def ringing(solution: quito.Solution, size: float) -> quito.Solution:
    signs = (-1.0) ** np.arange(len(solution.coefficients))
    return replace(solution, coefficients=solution.coefficients + size * signs[:, None])


def test_an_outlier_is_cut_off_and_that_is_said(solve: Solve, solution: quito.Solution) -> None:
    wild = ringing(solve(TEXT, steps=100, control="piecewise-constant"), 1000.0)
    rows = row("ours", solution, near_jump(0.1)), row("wild", wild, 1000 * np.sin(300 * TIMES))
    compared = comparison(solution, *rows)
    u = drawn(compared, "trajectories").axes[0]
    low, high = u.get_ylim()
    assert -4 < low < -1
    assert 1 < high < 4
    assert u.get_title(loc="right") == "cut off: wild from -1e+03 to 1e+03"
    assert line(u, 1).get_linewidth() < line(u, 0).get_linewidth()
    (reference,) = (a for a in u.get_lines() if a.get_linewidth() > 4)
    assert line(u, 1).get_zorder() < reference.get_zorder() < line(u, 0).get_zorder()
    whole = drawn(compared, "error").axes[0]
    assert whole.get_ylim()[1] < 2
    assert whole.get_title(loc="right").startswith("cut off: wild from -1e+03")


def test_failed_methods_are_marked(solution: quito.Solution, two: Comparison) -> None:
    failed = quito.solve(load_text(TEXT, "jump.yaml"), steps=5, max_iterations=0)
    assert not failed.success
    broken = replace(failed, coefficients=np.full_like(failed.coefficients, np.nan))
    compared = comparison(solution, two.rows[0], row("lgr", broken, TIMES * np.nan))
    for name in FIGURES:
        assert drawn(compared, name).axes
    assert legend(drawn(compared, "trajectories"))[1] == "lgr (NOT SOLVED)"
    assert "lgr (NOT SOLVED)" not in legend(drawn(compared, "error"))


def test_horizons_that_differ_share_an_axis(solve: Solve, solution: quito.Solution) -> None:
    longer = solve(TEXT.replace("final: 1}", "final: 3}"), steps=10)
    rows = row("ours", solution, near_jump(0.1)), row("longer", longer, near_jump(0.1))
    for axes in drawn(comparison(solution, *rows), "trajectories").axes:
        assert axes.get_xlim() == pytest.approx((-0.03, 3.03))
        assert values(line(axes, 1))[0][-1] == 3
        assert values(line(axes, 0))[0][-1] == 1


def test_without_a_truth_there_are_trajectories_only(two: Comparison, tmp_path: Path) -> None:
    rows = tuple(replace(r, errors=None) for r in two.rows)
    paths = draw_all(replace(two, truth=None, rows=rows), tmp_path, "png")
    assert [path.name for path in paths] == ["step-compare-trajectories.png"]
    assert [path.name for path in tmp_path.iterdir()] == ["step-compare-trajectories.png"]


@pytest.mark.parametrize(("ending", "smallest"), [("png", 10_000), ("svg", 10_000), ("pdf", 5_000)])
def test_files(two: Comparison, tmp_path: Path, ending: str, smallest: int) -> None:
    paths = draw_all(two, tmp_path / "new", ending)
    suffixes = ["-trajectories", "-error", "-spectrum", "-error-log", ""]
    assert [path.name for path in paths] == [f"step-compare{s}.{ending}" for s in suffixes]
    assert sorted(paths) == sorted((tmp_path / "new").iterdir())
    assert min(path.stat().st_size for path in paths) > smallest


def test_the_same_comparison_has_the_same_bytes(two: Comparison, tmp_path: Path) -> None:
    one, other = (draw_all(two, tmp_path / name, "png") for name in ("one", "other"))
    assert [p.read_bytes() for p in one] == [p.read_bytes() for p in other]


def test_eight_methods_differ_in_colour_in_lightness_or_dashes_and_in_marker() -> None:
    looks = [style(i) for i in range(8)]
    for one, other in combinations(looks, 2):
        distance = np.linalg.norm(np.subtract(to_rgb(one["color"]), to_rgb(other["color"])))
        assert distance > 0.25
        assert one["linestyle"] != other["linestyle"]
        assert one["marker"] != other["marker"]
    more = [tuple(map(str, style(i).values())) for i in range(24)]
    assert len(set(more)) == 24


LONG = "quasi-interpolant:trigonometric with a variance of two and a very long name indeed"


def test_many_methods_with_long_names_lay_out(solution: quito.Solution, tmp_path: Path) -> None:
    """Warnings are errors here: matplotlib warns where a layout does not fit."""
    names = ["ours", LONG, LONG, *(f"lgr:{i}x$4_$" for i in range(7))]
    rows = [row(name, solution, near_jump(0.1 / (i + 1))) for i, name in enumerate(names)]
    compared = comparison(solution, *rows)
    assert len(draw_all(compared, tmp_path, "png")) == 5
    for name, kind in FIGURES.items():
        found = drawn(compared, name)
        found.draw_without_rendering()
        width, height = found.get_size_inches() * found.dpi
        box = found.legends[0].get_window_extent()
        assert 0 <= box.x0 < box.x1 <= width
        assert len(set(legend(found))) >= len(names), kind
        for axes in found.axes:
            frame = axes.get_tightbbox()
            assert frame is not None
            assert frame.y0 >= box.y1 - 1
            assert frame.y1 <= height
        for one, other in combinations(found.axes, 2):
            assert not one.get_window_extent().overlaps(other.get_window_extent())


def test_many_states_share_plots_by_vector(solve: Solve) -> None:
    text = """
time: {initial: 0, final: 1}
states: {x: {size: 12, initial: 0}, y: {initial: 0}}
controls: {u: {lower: -1, upper: 1}}
dynamics: {x: "[u, 2*u, 0, 0, 0, 0, 0, 0, 0, 0, 0, t]", y: u}
cost: {lagrange: (u - t)^2}
"""
    solution = solve(text, steps=6)
    nothing = replace(row("ours", solution, TIMES), errors=None)
    compared = replace(comparison(solution, nothing), truth=None)
    assert labels(drawn(compared, "trajectories")) == ["u", "x", "y"]


def test_thinning_keeps_the_ends_and_the_extremes() -> None:
    x = np.linspace(0, 1, 100_003)
    y = np.sin(1e4 * x)
    y[77_777] = 5
    y[50_000:60_000] = np.nan
    few_x, few_y = thinned(x, y)
    assert len(few_x) < 2500
    assert (few_x[0], few_x[-1]) == (0, 1)
    assert np.all(np.diff(few_x) > 0)
    assert few_y.shape == few_x.shape
    assert np.nanmax(few_y) == 5
    assert np.nanmin(few_y) == np.nanmin(y)
    assert np.isnan(few_y[np.abs(few_x - 0.55) < 0.04]).all()
    np.testing.assert_array_equal(thinned(x[:900], y[:900])[1], y[:900])
