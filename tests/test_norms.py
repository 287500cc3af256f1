"""Norms, spectra, variation and switching times of errors that are known by hand."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import quad

import quito_cli as quito
from quito_cli.comparison import norms
from quito_cli.comparison.comparison import Comparison, Errors, Truth
from quito_cli.comparison.measure import Setting, measured
from quito_cli.comparison.switching import switching_times
from quito_cli.comparison.truth import from_reference, from_solution, with_variation
from quito_cli.problem.model import Model

Array = NDArray[np.float64]
Solve = Callable[..., quito.Solution]
MakeModel = Callable[[str], Model]

STEP = """
title: A step of height 3 at one
time: {initial: 0, final: 2}
states: {x: {initial: 0}, y: {initial: 0}}
controls: {u: {lower: -5, upper: 5}, v: {lower: -5, upper: 5}}
dynamics: {x: u, y: v}
cost: {lagrange: (u - 1)^2 + (v - 1)^2}
reference:
  cost: 4
  switching_times: [1]
  control:
    u: [{until: 1, value: 0}, {value: 3}]
    v: 2
  state: {y: 2*t}
"""
"""Not the answer of its problem: what is held against it is made up too."""


@pytest.fixture(scope="module")
def held(solve: Solve, model: MakeModel) -> Callable[..., Comparison]:
    """Hold piecewise constant controls on ten cells against the reference of STEP."""
    any_answer = solve(STEP, control="piecewise-constant", steps=10)
    truth = from_reference(model(STEP))

    def compare(u: list[float], v: list[float], zone: float = 0.0, n: int = 40) -> Comparison:
        made_up = replace(any_answer, coefficients=np.column_stack([u, v]).astype(float))
        return measured([("made up", made_up)], truth, Setting(n, zone), (), ())

    return compare


def row_of(comparison: Comparison) -> Any:
    return comparison.rows[0]


# Of errors that are known


def test_the_error_of_a_constant(held: Callable[..., Comparison]) -> None:
    """v − 2 = 1 on [0, 2], u without error: every norm by hand."""
    row = row_of(held([0] * 5 + [3] * 5, [3] * 10))
    u, v = row.by_control
    assert v.l1 == pytest.approx(2, rel=1e-13)
    assert v.l2 == pytest.approx(math.sqrt(2), rel=1e-13)
    assert v.sup == v.sup_outside == 1
    assert v.norm == pytest.approx(math.sqrt(40), rel=1e-13)
    assert v.dft_norm == pytest.approx(40, rel=1e-13), "all in the mean: n times one"
    assert row.spectrum[0, 1] == pytest.approx(40)
    assert row.spectrum[1:, 1].max() < 1e-12
    assert u == Errors(*[0.0] * 7)
    assert row.cost_error == pytest.approx(row.solution.cost - 4)


def test_a_jump_that_comes_late(held: Callable[..., Comparison]) -> None:
    """By δ = 0.2: L2 = 3 √δ, L1 = 3 δ, sup = 3, wherever the jump zones end."""
    u = row_of(held([0] * 6 + [3] * 4, [2] * 10)).by_control[0]
    assert u.l2 == pytest.approx(3 * math.sqrt(0.2), rel=1e-12)
    assert u.l1 == pytest.approx(3 * 0.2, rel=1e-12)
    assert u.sup == 3
    near = held([0] * 6 + [3] * 4, [2] * 10, zone=0.05)
    np.testing.assert_allclose(near.zones, [(0.9, 1.1)])
    assert row_of(near).by_control[0].l2_outside == pytest.approx(3 * math.sqrt(0.1), rel=1e-12)
    assert row_of(near).by_control[0].sup_outside == 3
    far = row_of(held([0] * 6 + [3] * 4, [2] * 10, zone=0.11)).by_control[0]
    assert far.l2_outside == far.sup_outside == 0


def test_a_jump_is_seen_from_both_sides(held: Callable[..., Comparison]) -> None:
    """One cell wrong by 1 just before the jump, one by −2 just after it: each is a supremum."""
    before = row_of(held([0] * 4 + [1] + [3] * 5, [2] * 10)).by_control[0]
    assert before.sup == 1
    after = row_of(held([0] * 5 + [1] + [3] * 4, [2] * 10)).by_control[0]
    assert after.sup == 2


def test_controls_together(held: Callable[..., Comparison]) -> None:
    """u is wrong by 3 for 0.2, v by 1 for 2."""
    row = row_of(held([0] * 6 + [3] * 4, [3] * 10))
    assert row.errors.l2 == pytest.approx(math.sqrt(9 * 0.2 + 2), rel=1e-12)
    assert row.errors.l1 == pytest.approx(0.6 + 2, rel=1e-12)
    assert row.errors.sup == 3
    norm = math.hypot(row.by_control[0].norm, row.by_control[1].norm)
    assert row.errors.norm == pytest.approx(norm, rel=1e-14)


def test_samples_are_the_middles_of_equal_parts(held: Callable[..., Comparison]) -> None:
    """So that norm = √(n/T) L2 where the error is constant in each of them."""
    comparison = held([0] * 6 + [3] * 4, [3] * 10, n=40)
    np.testing.assert_allclose(comparison.sample_times, 0.025 + 0.05 * np.arange(40))
    row = row_of(comparison)
    assert row.errors.norm == pytest.approx(math.sqrt(40 / 2) * row.errors.l2, rel=1e-12)
    np.testing.assert_allclose(comparison.frequencies, np.arange(21) / 2)


def test_variation_of_both(held: Callable[..., Comparison]) -> None:
    comparison = held([0, 1] * 5, [2] * 10)
    assert comparison.truth is not None
    assert comparison.truth.total_variation == pytest.approx((3, 0))
    assert row_of(comparison).total_variation == pytest.approx((9, 0))


def test_switching_times(held: Callable[..., Comparison]) -> None:
    for late in (4, 5, 6):
        row = row_of(held([0] * late + [3] * (10 - late), [2] * 10))
        assert row.switching_times == pytest.approx((0.2 * late,), abs=1e-4)
        assert row.switching_errors == pytest.approx((0.2 * late - 1,), abs=1e-4)
    never = row_of(held([0] * 10, [2] * 10))
    assert np.isinf(never.switching_times).all()
    backwards = row_of(held([3] * 5 + [0] * 5, [2] * 10))
    assert np.isinf(backwards.switching_times).all(), "the jump of the truth is upwards"


def test_what_is_not_known_has_no_error(solve: Solve, model: MakeModel) -> None:
    partly = STEP.replace("    v: 2\n", "")
    truth = from_reference(model(partly))
    answer = solve(STEP, control="piecewise-constant", steps=10)
    row = measured([("some", answer)], truth, Setting(8, 0.0), (), ()).rows[0]
    known, unknown = row.by_control
    assert np.isnan([unknown.l2, unknown.sup, unknown.norm]).all()
    assert row.errors is not None
    assert row.errors.l2 == known.l2
    assert math.isnan(row.state_errors[0])
    assert row.state_errors[1] == pytest.approx(2, abs=1e-6), "y = t is held against 2 t"
    assert row.state_error == pytest.approx(0.5, abs=1e-6), "y* is 4 at most"


# The quadrature


def test_a_polynomial_of_degree_400_in_one_cell() -> None:
    """∫₀¹ T_n(2t − 1)² dt = (1 − 1/(4n² − 1))/2."""
    n = 400
    on = norms.grid(np.array([0.0, 1.0]), np.zeros(0), (0.0, 1.0))

    def chebyshev(t: Array) -> Array:
        return np.asarray(np.cos(n * np.arccos(np.clip(2 * t - 1, -1, 1)))[:, None])

    (found,) = norms.errors(on.sample(chebyshev), on, chebyshev(np.linspace(0, 1, 10)))
    assert found.l2**2 == pytest.approx((1 - 1 / (4 * n**2 - 1)) / 2, rel=1e-9)
    assert found.sup == pytest.approx(1, abs=1e-4)


@given(
    nodes=st.lists(st.floats(0.05, 2.95), min_size=0, max_size=6, unique=True),
    at=st.floats(0.1, 2.9),
)
def test_panels_end_where_functions_jump(nodes: list[float], at: float) -> None:
    """A jump between the nodes costs no accuracy, wherever it is, if its place is known."""
    mesh = np.array([0.0, *sorted(nodes), 3.0])
    on = norms.grid(mesh, np.array([at]), (0.0, 3.0))

    def jump(t: Array) -> Array:
        return np.where(t < at, np.sin(t), 2 + np.cos(3 * t))[:, None]

    (found,) = norms.errors(on.sample(jump), on, jump(np.array([1.0])))
    before, _ = quad(lambda t: math.sin(t) ** 2, 0, at)
    after, _ = quad(lambda t: (2 + math.cos(3 * t)) ** 2, at, 3)
    assert found.l2**2 == pytest.approx(before + after, rel=1e-9)
    assert on.weights.sum() == pytest.approx(3, rel=1e-13)
    assert (np.diff(on.times.ravel()) >= 0).all()


def test_the_horizon_may_be_shorter_than_the_mesh() -> None:
    on = norms.grid(np.linspace(0, 1, 4), np.array([-1.0, 7.0]), (0.1, 0.9), ((0.2, 0.4),))
    assert on.times.min() >= 0.1
    assert on.times.max() <= 0.9
    assert on.weights.sum() == pytest.approx(0.8)
    assert on.weights[on.outside].sum() == pytest.approx(0.6)


@given(
    samples=st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=60).filter(
        lambda values: max(map(abs, values)) > 1e-3
    )
)
def test_parseval(samples: list[float]) -> None:
    """‖DFT e‖ = √n ‖e‖, and the half of the spectrum that is kept has all of it."""
    column = np.array(samples)[:, None]
    n = len(samples)
    on = norms.grid(np.array([0.0, 1.0]), np.zeros(0), (0.0, 1.0))
    (found,) = norms.errors(on.sample(lambda t: np.zeros((len(t), 1))), on, column)
    assert found.dft_norm == pytest.approx(math.sqrt(n) * found.norm, rel=1e-12)
    kept = norms.spectrum(column)[:, 0] ** 2
    assert len(kept) == n // 2 + 1
    twice = np.full(len(kept), 2.0)
    twice[0] = 1.0
    if n % 2 == 0:
        twice[-1] = 1.0
    assert float(twice @ kept) == pytest.approx(found.dft_norm**2, rel=1e-9)


def test_zones_that_overlap_are_one() -> None:
    merged = norms.jump_zones((1.0, 1.5, 9.9), (0.0, 10.0), 0.03)
    np.testing.assert_allclose(merged, [(0.7, 1.8), (9.6, 10.0)])
    assert norms.jump_zones((1.0,), (0.0, 10.0), 0.0) == ()


# References of the library


def test_variation_of_the_van_der_pol_reference(model: MakeModel) -> None:
    """−1 to 1, down to the singular arc, and along it to u(4) = 0: monotone pieces, by hand."""
    truth = from_reference(model("van_der_pol"))
    assert truth is not None
    t2, c = truth.switching_times[1], 0.0970199608658935

    def singular(t: Array) -> Array:
        z = 4 - t
        return np.asarray(
            2 * c * np.cosh(z) + (1 - (c * np.cosh(z)) ** 2) * c * np.sinh(z), dtype=float
        )

    arc = singular(np.linspace(t2, 4, 100_001))
    expected = 2 + (1 - arc[0]) + np.abs(np.diff(arc)).sum()
    found = with_variation(truth, (0.0, 4.0)).total_variation
    assert found == pytest.approx((expected,), abs=1e-6)


@pytest.mark.parametrize(
    ("name", "expected"),
    [("siri", (0.9, 0.9, 0.9)), ("catalyst_mixing", (1.0,)), ("alychan", (1.0,))],
)
def test_variation_of_references(name: str, expected: tuple[float, ...], model: MakeModel) -> None:
    """Steps of 0.9; from 1 over us to 0; −sin on a quarter of its period."""
    known = model(name)
    truth = from_reference(known)
    assert truth is not None
    horizon = known.initial_time.lower, known.final_time.lower
    assert with_variation(truth, horizon).total_variation == pytest.approx(expected, abs=1e-8)


def test_a_corner_of_the_truth_is_no_jump(model: MakeModel) -> None:
    """Bryson and Denham's control is continuous: nothing crosses the middle of nothing."""
    truth = from_reference(model("bryson_denham"))
    assert truth is not None
    assert len(truth.switching_times) == 2
    assert np.isnan(switching_times(truth.control, truth, (0.0, 1.0))).all()


def test_a_corner_of_a_solve_is_no_jump_either(solve: Solve, model: MakeModel) -> None:
    """Rayleigh's control is continuous; as a solve, its corners are looked at from some way off."""
    known = model("rayleigh").known
    finer = from_solution(solve("rayleigh", steps=100), "a solve", known)
    assert len(finer.switching_times) == 3
    assert np.isnan(switching_times(finer.control, finer, (0.0, 4.5))).all()


def test_the_truth_switches_when_it_does(model: MakeModel) -> None:
    for name in ("van_der_pol", "siri", "catalyst_mixing"):
        known = model(name)
        truth = from_reference(known)
        assert isinstance(truth, Truth)
        horizon = known.initial_time.lower, known.final_time.lower
        found = switching_times(truth.control, truth, horizon)
        assert found == pytest.approx(truth.switching_times, abs=1e-3 * horizon[1])


def test_switching_times_against_a_solve(solve: Solve, model: MakeModel) -> None:
    """Its jumps are spread over some cells: what they jump by is found all the same."""
    known = model("siri").known
    finer = from_solution(solve("siri", steps=200), "a solve", known)
    for quantity in (finer, from_reference(model("siri"))):
        assert quantity is not None
        found = switching_times(solve("siri", steps=50).control, quantity, (0.0, 20.0))
        assert found == pytest.approx(finer.switching_times, abs=20 / 50)
