"""The quasi-interpolant: its weights against the plain formula, its limits, its convergence."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from quito_cli.transcription.control import ControlBasis
from quito_cli.transcription.generating import GENERATING_FUNCTIONS, QUASI_INTERPOLANTS
from quito_cli.transcription.mesh import Mesh

Array = NDArray[np.float64]
ALL = tuple(GENERATING_FUNCTIONS)
POSITIVE = ("gaussian", "sech", "box", "hat")
FREQUENCY = 12.0
"""Of the smooth function that is approximated."""


def basis(name: str, cells: int, variance: float = 2.0, normalised: bool = True) -> ControlBasis:
    return ControlBasis(GENERATING_FUNCTIONS[name], cells, variance, normalised)


def graded(cells: int) -> Mesh:
    """Steps that grow by a factor of a thousand."""
    steps = np.geomspace(1, 1000, cells)
    return Mesh(np.concatenate([[0.0], np.cumsum(steps) / steps.sum()]))


def psi(name: str, x: Array) -> Array:
    """The generating function without any cut."""
    return GENERATING_FUNCTIONS[name].value(x)


def ghosts_of(variance: float) -> int:
    return math.ceil(2 * math.sqrt(variance))


def plain(name: str, c: Array, s: Array, variance: float, normalised: bool) -> Array:
    """Σ_m c_m ψ((s−m)/√D), m = −p … N+p, over the sum of weights or √D, one point at a time."""
    root, nodes = math.sqrt(variance), np.arange(len(c)) - ghosts_of(variance)
    values = np.empty(len(s))
    for i, place in enumerate(s):
        weights = psi(name, (place - nodes) / root)
        values[i] = math.fsum(weights * c) / (math.fsum(weights) if normalised else root)
    return values


# Weights


@pytest.mark.parametrize("name", QUASI_INTERPOLANTS)
@pytest.mark.parametrize("variance", [0.5, 1.0, 2.0, 7.5])
@pytest.mark.parametrize("normalised", [True, False])
def test_values_are_those_of_the_plain_sum(name: str, variance: float, normalised: bool) -> None:
    control = basis(name, 9, variance, normalised)
    assert control.count == 9 + 1 + 2 * ghosts_of(variance)
    c = np.random.default_rng(1).uniform(-1, 1, control.count)
    cells, offsets = Mesh.uniform(9).points(np.array([0, 0.17, 0.5, 0.99, 1.0]))
    found = control.evaluate(c[:, None], cells, offsets)[:, 0]
    expected = plain(name, c, cells + offsets, variance, normalised)
    assert found == pytest.approx(expected, abs=5e-7)


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("cells", [1, 2, 30])
def test_partition_of_unity_on_a_graded_mesh_edges_included(name: str, cells: int) -> None:
    mesh, control = graded(cells), basis(name, cells)
    fractions = np.sort(np.concatenate([np.linspace(0, 1, 500), mesh.fractions]))
    values = control.evaluate(np.full((control.count, 2), [3.0, -1.0]), *mesh.locate(fractions))
    assert values == pytest.approx(np.tile([3.0, -1.0], (len(fractions), 1)), abs=1e-12)


@pytest.mark.parametrize("name", ["gaussian", "laguerre4", "sech"])
@pytest.mark.parametrize("variance", [0.5, 1.0])
def test_the_printed_sum_misses_unity_by_the_saturation_error(name: str, variance: float) -> None:
    """Poisson: D^(−1/2) Σ ψ((s−m)/√D) = 1 + 2 Σ_k ψ^(√D k) cos(2πks), far from the ends."""
    transforms: dict[str, Callable[[float], float]] = {
        "gaussian": lambda w: math.exp(-((math.pi * w) ** 2)),
        "laguerre4": lambda w: (1 + (math.pi * w) ** 2) * math.exp(-((math.pi * w) ** 2)),
        "sech": lambda w: 1 / math.cosh(math.pi**2 * w),
    }
    control = basis(name, 60, variance, normalised=False)
    s = np.linspace(25, 35, 101)
    found = control.evaluate(np.ones((control.count, 1)), *locate(s))[:, 0]
    root = math.sqrt(variance)
    waves = [2 * transforms[name](root * k) * np.cos(2 * math.pi * k * s) for k in range(1, 6)]
    assert found == pytest.approx(1 + sum(waves), abs=2e-7)
    assert np.abs(found - 1).max() > 1e-5  # so it is no partition of unity


def locate(s: Array) -> tuple[NDArray[np.int64], Array]:
    cells = np.floor(s).astype(np.int64)
    return cells, s - cells


@pytest.mark.parametrize("name", ALL)
def test_weights_depend_on_the_offset_alone_in_inner_cells(name: str) -> None:
    control = basis(name, 80)
    offsets = np.array([0.25, 0.25, 0.25])
    indices, weights = control.weights(np.array([30, 40, 45]), offsets)
    assert weights[1] == pytest.approx(weights[0], abs=1e-15)
    used = np.abs(weights[0]) > 0
    assert (indices[1][used] - indices[0][used] == 10).all()
    assert (indices[2][used] - indices[0][used] == 15).all()


@pytest.mark.parametrize("name", ALL)
def test_indices_are_valid_and_weights_beyond_the_ends_vanish(name: str) -> None:
    control = basis(name, 2)
    cells, offsets = Mesh.uniform(2).points(np.linspace(0, 1, 7))
    indices, weights = control.weights(cells, offsets)
    assert indices.min() >= 0
    assert indices.max() < control.count
    for row, w in zip(indices, weights, strict=True):
        used = row[w != 0]
        assert len(set(used.tolist())) == len(used)  # a clipped index carries no weight twice


# Bounds


@settings(max_examples=60, deadline=None)
@given(data=st.data())
@pytest.mark.parametrize("name", POSITIVE)
def test_a_positive_function_stays_between_its_coefficients(name: str, data: Any) -> None:
    cells = data.draw(st.integers(1, 12))
    variance = data.draw(st.floats(0.5, 20))
    control = basis(name, cells, variance)
    assert control.convex
    size = st.floats(-1e6, 1e6)
    c = np.array(data.draw(st.lists(size, min_size=control.count, max_size=control.count)))
    places = np.array(data.draw(st.lists(st.floats(0, 1), min_size=1, max_size=20)))
    values = control.evaluate(c[:, None], *graded(cells).locate(places))
    slack = 1e-14 * np.abs(c).max()
    assert values.min() >= c.min() - slack
    assert values.max() <= c.max() + slack


@pytest.mark.parametrize("name", [n for n in ALL if n not in POSITIVE])
def test_the_others_do_not_and_do_not_say_so(name: str) -> None:
    control = basis(name, 20)
    assert not control.convex
    c = np.where(control.centres < 10, 0.0, 1.0)[:, None]
    values = control.evaluate(c, *Mesh.uniform(20).points(np.linspace(0, 1, 21)))
    assert values.max() > 1.01


def test_the_printed_sum_is_not_convex() -> None:
    assert not basis("gaussian", 10, normalised=False).convex


# The classical controls


def test_the_box_is_right_continuous_with_its_limit_from_the_left() -> None:
    control, mesh = basis("box", 4), graded(4)
    c = np.array([[1.0], [2.0], [4.0], [8.0]])
    assert (control.count, control.ghosts) == (4, 0)
    starts = control.evaluate(c, np.arange(4), np.zeros(4))
    ends = control.evaluate(c, np.arange(4), np.ones(4))
    inside = control.evaluate(c, np.arange(4), np.full(4, 0.37))
    assert (starts == c).all()
    assert (ends == c).all()
    assert (inside == c).all()
    at_nodes = control.evaluate(c, *mesh.locate(mesh.fractions))[:, 0]
    assert at_nodes.tolist() == [1, 2, 4, 8, 8]
    assert control.centres.tolist() == [0.5, 1.5, 2.5, 3.5]


def test_the_hat_is_linear_interpolation() -> None:
    control, mesh = basis("hat", 12), graded(12)
    assert (control.count, control.ghosts) == (13, 0)
    c = np.random.default_rng(2).normal(size=13)
    fractions = np.random.default_rng(3).uniform(0, 1, 300)
    found = control.evaluate(c[:, None], *mesh.locate(fractions))[:, 0]
    assert found == pytest.approx(np.interp(fractions, mesh.fractions, c), abs=1e-12)
    assert control.centres.tolist() == list(range(13))


# Convergence: approximate approximations


def quasi_interpolation_error(
    name: str, cells: int, variance: float, normalised: bool = True
) -> float:
    """Error of Σ f(m/N) w_m inside the interval, f smooth."""
    control = basis(name, cells, variance, normalised)
    c = np.cos(FREQUENCY * control.centres / cells)[:, None]
    t = np.linspace(0.4, 0.6, 2001)
    found = control.evaluate(c, *Mesh.uniform(cells).locate(t))[:, 0]
    return float(np.abs(found - np.cos(FREQUENCY * t)).max())


@pytest.mark.parametrize("normalised", [True, False])
@pytest.mark.parametrize(
    ("name", "order", "variance", "cells"),
    [
        ("gaussian", 2, 4.0, 100),
        ("laguerre4", 4, 4.0, 50),
        ("laguerre6", 6, 4.0, 25),
        ("hermite10", 10, 6.0, 25),
        ("trigonometric", 4, 4.0, 50),
        ("sech", 2, 4.0, 100),
    ],
)
def test_quasi_interpolation_converges_with_the_order_of_the_moments(
    name: str, order: int, variance: float, cells: int, normalised: bool
) -> None:
    coarse = quasi_interpolation_error(name, cells, variance, normalised)
    fine = quasi_interpolation_error(name, 2 * cells, variance, normalised)
    assert coarse > 3e-6  # far above the cut, so that an order can be seen
    assert math.log2(coarse / fine) == pytest.approx(order, abs=0.12 * order)


@pytest.mark.parametrize("name", QUASI_INTERPOLANTS)
def test_the_error_on_a_wave_is_one_minus_the_transform(name: str) -> None:
    """M cos(ωt) = cos(ωt) ∫ψ(x) cos(√D h ω x) dx, but for saturation: the size, not the order."""
    cells, variance = 50 if name == "sech" else 25, 6.0  # sech has long tails
    x = np.arange(-50, 50, 1 / 16)
    wave = np.cos(math.sqrt(variance) * FREQUENCY / cells * x)
    damping = 1 - math.fsum(psi(name, x) * wave) / 16
    largest = np.abs(np.cos(FREQUENCY * np.linspace(0.4, 0.6, 2001))).max()
    assert quasi_interpolation_error(name, cells, variance) == pytest.approx(
        abs(damping) * largest, rel=1e-3 if name == "sech" else 1e-4, abs=1e-7
    )


def test_convergence_stops_at_the_saturation_error() -> None:
    """2 e^(−π²D) of the function's size: the printed sum never gets below it."""
    variance = 0.8
    saturation = 2 * math.exp(-(math.pi**2) * variance)
    errors = [quasi_interpolation_error("gaussian", n, variance, False) for n in (20, 40, 4000)]
    assert errors[0] > 50 * saturation
    assert math.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.1)
    assert errors[2] == pytest.approx(saturation, rel=0.02)
    assert quasi_interpolation_error("gaussian", 4000, variance) < saturation / 50


# The same weights in an answer


@pytest.mark.parametrize("name", QUASI_INTERPOLANTS)
def test_control_of_a_solution_is_the_plain_sum(name: str, solve: Any) -> None:
    solution = solve("van_der_pol", steps=25, generating_function=name)
    t = np.linspace(0, 4, 101)
    c = solution.coefficients[:, 0]
    expected = plain(name, c, t * 25 / 4, 2.0, True)
    assert solution.control(t)[:, 0] == pytest.approx(expected, abs=1e-6 * np.abs(c).max())


@pytest.mark.parametrize("name", ["gaussian", "box", "hat"])
def test_control_of_a_solution_on_a_graded_mesh(name: str, solve: Any) -> None:
    solution = solve("van_der_pol", steps=25)
    control = basis(name, 8)
    c = np.random.default_rng(4).normal(size=(control.count, 1))
    times = 1 + 2 * graded(8).fractions
    moved = replace(solution, times=times, basis=control, coefficients=c)
    t = np.random.default_rng(5).uniform(1, 3, 200)
    s = np.interp(t, times, np.arange(9))
    if name == "gaussian":
        expected = plain(name, c[:, 0], s, 2.0, True)
    elif name == "box":
        expected = c[np.floor(s).astype(int), 0]
    else:
        expected = np.interp(s, np.arange(9), c[:, 0])
    assert moved.control(t)[:, 0] == pytest.approx(expected, abs=1e-7)
    assert moved.mesh.fractions == pytest.approx(graded(8).fractions, abs=1e-12)


def test_control_takes_a_number_and_holds_beyond_the_ends(solve: Any) -> None:
    solution = solve("van_der_pol", steps=25)
    assert solution.control(1.5).shape == (1, 1)
    assert solution.control([0.1, 0.2]).shape == (2, 1)
    assert solution.control([-3.0]) == solution.control([0.0])
    assert solution.control([9.0]) == solution.control([4.0])


def test_a_piecewise_constant_answer_is_continuous_from_the_right(solve: Any) -> None:
    solution = solve("van_der_pol", steps=25, control="piecewise-constant")
    nodes = solution.times
    after = solution.control(nodes[:-1] + 1e-9)
    assert (solution.control(nodes[:-1]) == after).all()
    assert (after[:, 0] == solution.coefficients[:, 0]).all()


@pytest.mark.parametrize("name", sorted(QUASI_INTERPOLANTS))
def test_within_a_cell_the_control_has_no_jump(name: str) -> None:
    """Where ψ is cut there is one of 1e-8: at a node, where a step of the integrator ends."""
    basis = ControlBasis(GENERATING_FUNCTIONS[name], 40, 2.0, True)
    coefficients = np.eye(basis.count)
    offsets = np.linspace(0, 1, 20_001)
    u = basis.evaluate(coefficients, np.full(len(offsets), 20), offsets)
    third = np.abs(np.diff(u, n=3, axis=0))
    assert third.max() < 1e-11
