"""Tables: values and derivatives against SciPy, the ends, the knots, speed, and complaints."""

from __future__ import annotations

import math
import pickle

import casadi
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from processor import within
from scipy.interpolate import CubicSpline

from quito_cli.problem.language.expressions import evaluate, parse
from quito_cli.problem.language.tables import MAX_POINTS, Method, TableData, check

Array = NDArray[np.float64]


def values(table: TableData, at: Array) -> tuple[Array, Array, Array]:
    """Give the values and the first and second derivatives by AD."""
    z = casadi.SX.sym("z")
    value = table(z)
    hessian, gradient = casadi.hessian(value, z)
    function = casadi.Function("f", [z], [value, gradient, hessian])
    first, second, third = function.map(at.size)(at.reshape(1, -1))
    return first.full()[0], second.full()[0], third.full()[0]


def sample(points: int, seed: int = 0) -> tuple[Array, Array]:
    """Give points with uneven distances, from a tenth to one."""
    random = np.random.default_rng(seed)
    x = np.cumsum(random.uniform(0.1, 1.0, points)) - 2.0
    return x, random.normal(size=points)


def inside(x: Array, seed: int = 1) -> Array:
    """Give places in every part of a table: between the points, the points, and next to them."""
    between = np.random.default_rng(seed).uniform(x[0], x[-1], 300)
    return np.concatenate([between, x, np.nextafter(x, x[0])[1:], np.nextafter(x, x[-1])[:-1]])


def line(x: Array, y: Array, at: Array) -> tuple[Array, Array]:
    """Give the piecewise linear interpolant and its slope, end segments continued."""
    i = np.clip(np.searchsorted(x, at, side="right") - 1, 0, x.size - 2)
    slope = (np.diff(y) / np.diff(x))[i]
    return y[i] + slope * (at - x[i]), slope


SIZES = [2, 3, 4, 5, 6, 30, 1000]


@pytest.mark.parametrize("points", SIZES)
def test_cubic_equals_scipy(points: int) -> None:
    x, y = sample(points)
    spline, at = CubicSpline(x, y), inside(x)
    for order, ours in enumerate(values(TableData("d", x, y, "cubic"), at)):
        theirs = spline(at, order)
        scale = np.abs(theirs).max()
        np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-10 * scale + 1e-12)


@pytest.mark.parametrize("points", SIZES)
def test_linear_equals_numpy(points: int) -> None:
    x, y = sample(points)
    at = inside(x)
    value, slope, curvature = values(TableData("d", x, y, "linear"), at)
    np.testing.assert_allclose(value, np.interp(at, x, y), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(slope, line(x, y, at)[1], rtol=1e-12)
    assert not curvature.any()


@pytest.mark.parametrize("method", ["linear", "cubic"])
@pytest.mark.parametrize("points", SIZES)
def test_points_are_met(points: int, method: Method) -> None:
    x, y = sample(points)
    value, *_ = values(TableData("d", x, y, method), x)
    np.testing.assert_allclose(value, y, rtol=1e-13, atol=1e-14)
    if points > 2:
        np.testing.assert_array_equal(value[:-1], y[:-1])


@pytest.mark.parametrize(("points", "degree"), [(2, 1), (3, 2), (4, 3), (5, 3), (40, 3)])
def test_polynomials_are_reproduced(points: int, degree: int) -> None:
    polynomial = np.polynomial.Polynomial([0.5, -1.0, 2.0, -0.25][: degree + 1])
    x, _ = sample(points)
    at = inside(x)
    for order, ours in enumerate(values(TableData("d", x, polynomial(x), "cubic"), at)):
        exact = polynomial.deriv(order)(at)
        np.testing.assert_allclose(ours, exact, rtol=1e-9, atol=1e-9 * np.abs(exact).max())


def test_cubic_is_smooth_at_its_points() -> None:
    x, y = sample(12)
    table = TableData("d", x, y, "cubic")
    step = 1e-9
    for left, right in zip(values(table, x - step), values(table, x + step), strict=True):
        np.testing.assert_allclose(left[1:-1], right[1:-1], rtol=1e-6, atol=1e-6)
    for left, right in zip(values(table, x - step)[:2], values(table, x + step)[:2], strict=True):
        np.testing.assert_allclose(left, right, rtol=1e-6, atol=1e-6)


def test_third_derivative_is_that_of_the_piece() -> None:
    x, y = sample(8)
    z = casadi.SX.sym("z")
    third = casadi.jacobian(casadi.hessian(TableData("d", x, y)(z), z)[0], z)
    function = casadi.Function("f", [z], [third])
    middle = (x[:-1] + x[1:]) / 2
    ours = np.array([float(function(place)) for place in middle])
    np.testing.assert_allclose(ours, CubicSpline(x, y)(middle, 3), rtol=1e-9)


def test_linear_turns_at_its_points() -> None:
    table = TableData("d", np.array([0.0, 1.0, 3.0]), np.array([0.0, 2.0, 0.0]), "linear")
    value, slope, _ = values(table, np.array([np.nextafter(1, 0), 1.0, np.nextafter(1, 2)]))
    np.testing.assert_allclose(value, 2.0)
    assert slope.tolist() == [2.0, -1.0, -1.0]


FAR = np.array([1e-9, 1e-3, 1.0, 1e6, 1e100, 1e200, 1e300])


@pytest.mark.parametrize("points", [2, 3, 4, 30])
def test_cubic_continues_along_its_end_tangents(points: int) -> None:
    x, y = sample(points)
    spline, table = CubicSpline(x, y), TableData("d", x, y, "cubic")
    for end, at in ((x[0], x[0] - FAR), (x[-1], x[-1] + FAR)):
        value, slope, curvature = values(table, at)
        np.testing.assert_allclose(slope, spline(end, 1), rtol=1e-10)
        np.testing.assert_allclose(value, spline(end) + spline(end, 1) * (at - end), rtol=1e-10)
        assert not curvature.any()


@pytest.mark.parametrize("points", [2, 3, 30])
def test_linear_continues_its_end_segments(points: int) -> None:
    x, y = sample(points)
    at = np.concatenate([x[0] - FAR, x[-1] + FAR])
    value, slope, curvature = values(TableData("d", x, y, "linear"), at)
    expected, rise = line(x, y, at)
    np.testing.assert_allclose(value, expected, rtol=1e-12)
    np.testing.assert_allclose(slope, rise, rtol=1e-12)
    assert not curvature.any()


def test_end_points_have_the_curvature_of_the_spline() -> None:
    x, y = sample(9)
    *_, curvature = values(TableData("d", x, y, "cubic"), x[[0, -1]])
    np.testing.assert_allclose(curvature, CubicSpline(x, y)(x[[0, -1]], 2), rtol=1e-10)


@pytest.mark.parametrize("method", ["linear", "cubic"])
def test_entry_by_entry(method: Method) -> None:
    table = TableData("d", *sample(9), method)
    at = np.array([[-3.0, 0.0], [0.5, 1.0], [2.0, 99.0]])
    symbols = casadi.SX.sym("z", 3, 2)
    ours = casadi.Function("f", [symbols], [table(symbols)])(at).full()
    np.testing.assert_array_equal(ours.ravel(), values(table, at.ravel())[0])
    assert float(table(casadi.SX(0.5))) == ours[1, 0]


def test_no_number_gives_no_number() -> None:
    table = TableData("d", *sample(5))
    assert math.isnan(values(table, np.array([math.nan]))[0][0])


def test_table_can_be_pickled() -> None:
    table = TableData("d", *sample(5), "linear")
    at = np.linspace(-3, 5, 11)
    twin = pickle.loads(pickle.dumps(table))
    np.testing.assert_array_equal(values(twin, at)[0], values(table, at)[0])


gaps = st.floats(0.05, 10.0)  # SciPy loses the square of their ratio in its slopes
heights = st.floats(-1e3, 1e3, allow_subnormal=False)
tables = st.lists(st.tuples(gaps, heights), min_size=2, max_size=25)


@settings(deadline=None)
@given(tables, st.floats(-1e4, 1e4), st.lists(st.floats(0, 1), min_size=1, max_size=10))
def test_random_tables(
    points: list[tuple[float, float]], start: float, shares: list[float]
) -> None:
    x = start + np.cumsum([gap for gap, _ in points])
    y = np.array([height for _, height in points])
    assert check(x, y) == []
    at = np.concatenate([x, np.minimum(x[0] + np.array(shares) * (x[-1] - x[0]), x[-1])])
    spline = CubicSpline(x, y)
    h = np.diff(x)
    steepest = max(np.abs(np.diff(y) / h).max(), np.abs(spline(x, 1)).max())
    sizes = (steepest * h.max(), steepest, steepest / h.min())
    for size, order, ours in zip(sizes, range(3), values(TableData("d", x, y), at), strict=True):
        np.testing.assert_allclose(ours, spline(at, order), rtol=1e-9, atol=1e-9 * size)
    value, slope, _ = values(TableData("d", x, y, "linear"), at)
    np.testing.assert_allclose(value, np.interp(at, x, y), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(slope, line(x, y, at)[1], rtol=1e-12)


@settings(deadline=None, max_examples=50)
@given(st.lists(st.floats(), max_size=6), st.lists(st.floats(), max_size=6))
def test_what_passes_the_check_is_finite(x: list[float], y: list[float]) -> None:
    if not check(x, y):
        places, heights = np.array(x), np.array(y)
        value, *_ = values(TableData("d", places, heights, "linear"), places[:-1])
        np.testing.assert_allclose(value, heights[:-1])


@pytest.mark.parametrize("method", ["linear", "cubic"])
def test_long_table_is_quick(method: Method) -> None:
    with within(10):
        table = TableData("d", *sample(MAX_POINTS), method)
        z = casadi.SX.sym("z", 2)
        total = sum(casadi.sin(table(z[0] * i + z[1])) for i in range(5))
        hessian, gradient = casadi.hessian(total, z)
        function = casadi.Function("f", [z], [total, gradient, hessian])
        assert all(np.isfinite(part.full()).all() for part in function([0.3, 7.0]))


@pytest.mark.parametrize("method", ["linear", "cubic"])
@pytest.mark.parametrize("points", [2, 10, 1000])
def test_operations_are_counted(points: int, method: Method) -> None:
    table = TableData("d", *sample(points), method)
    z = casadi.SX.sym("z")
    function = casadi.Function("f", [z], [table(z)])
    kinds = [function.instruction_id(i) for i in range(function.n_instructions())]
    written = sum(kind != casadi.OP_CONST for kind in kinds)
    assert 0.9 * table.operations - 20 < written < table.operations + 20
    assert table.operations <= 12 * points + 12


def test_in_an_expression() -> None:
    x, y = sample(20)
    wind = {"wind": TableData("wind", x, y, "cubic")}
    position = casadi.SX.sym("p", 2)
    value = evaluate(parse("2*interpolate(p/3, wind)^2 + p"), {"p": position}, tables=wind)
    ours = casadi.Function("f", [position], [value])([1.0, 5.0]).full()[:, 0]
    at = np.array([1.0, 5.0])
    np.testing.assert_allclose(ours, 2 * CubicSpline(x, y)(at / 3) ** 2 + at, rtol=1e-12)


COMPLAINTS: list[tuple[list[float], list[float], list[tuple[int | None, str]]]] = [
    ([0, 1], [5, -5], []),
    ([], [], [(None, "a table has at least 2 points, not 0")]),
    ([1], [2], [(None, "a table has at least 2 points, not 1")]),
    ([0, 1], [0, 1, 4], [(None, "x has 2 entries and y has 3 entries")]),
    (
        [0],
        [0, 1],
        [
            (None, "x has 1 entry and y has 2 entries"),
            (None, "a table has at least 2 points, not 1"),
        ],
    ),
    (
        [0, 2, 1.5, 3, 3],
        [0, 1, 2, 3, 4],
        [
            (2, "entry 2 of x, 1.5, is not above the one before, 2.0"),
            (4, "entry 4 of x, 3.0, is not above the one before, 3.0"),
        ],
    ),
    ([1, 0], [0, 1], [(1, "entry 1 of x, 0.0, is not above the one before, 1.0")]),
    ([3, 2, 1], [0, 1, 2], [(None, "x decreases: give the points in the opposite order")]),
    (
        [0, math.inf, 2, 1],
        [math.nan, 0, 0, 0],
        [
            (1, "entry 1 of x is not finite: inf"),
            (3, "entry 3 of x, 1.0, is not above the one before, 2.0"),
            (0, "entry 0 of y is not finite: nan"),
        ],
    ),
    (
        [0, 1e-300, 1],
        [0, 1e10, 0],
        [(None, "the points are too close together, or the values too large, to join")],
    ),
    (
        list(range(1001)),
        [0.0] * 1001,
        [(None, "a table has at most 1000 points, not 1001")],
    ),
]


@pytest.mark.parametrize(("x", "y", "messages"), COMPLAINTS)
def test_complaints(x: list[float], y: list[float], messages: list[tuple[int | None, str]]) -> None:
    assert check(x, y) == messages


def test_a_table_in_no_order_is_told_briefly() -> None:
    x = [0.0, 1.0] * 200
    assert [entry for entry, _ in check(x, x)] == [2, 4, 6, 8, 10]
    assert len(check(range(20), [math.nan] * 20)) == 5
