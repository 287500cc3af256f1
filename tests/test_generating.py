"""The generating functions: moment conditions by quadrature, look-up, cut, smallest variance."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

import quito_cli as quito
from quito_cli.transcription.generating import (
    CUT,
    GENERATING_FUNCTIONS,
    QUASI_INTERPOLANTS,
    check_variance,
    generating_function,
    partition_floor,
    reach,
)

ORDERS = {
    "gaussian": 2,
    "laguerre4": 4,
    "laguerre6": 6,
    "hermite10": 10,
    "trigonometric": 4,
    "sech": 2,
}
NUMBERS = dict(enumerate(ORDERS, start=1))


def printed(name: str, x: float) -> float:
    """The formulas of DESIGN 3.1, written out once more."""
    e = math.exp(-x * x) / math.sqrt(math.pi)
    return {
        "gaussian": e,
        "laguerre4": (3 / 2 - x**2) * e,
        "laguerre6": (15 / 8 - 5 * x**2 / 2 + x**4 / 2) * e,
        "hermite10": (315 / 128 - 105 * x**2 / 16 + 63 * x**4 / 16 - 3 * x**6 / 4 + x**8 / 24) * e,
        "trigonometric": math.sqrt(math.e / math.pi)
        * math.exp(-x * x)
        * math.cos(math.sqrt(2) * x),
        "sech": 1 / (math.pi * math.cosh(x)),
    }[name]


def moment(name: str, k: int) -> float:
    """∫ x^k ψ(x) dx by the trapezoidal rule: exact to rounding where analytic and decaying."""
    x = np.arange(-50, 50, 1 / 16)
    return math.fsum(x**k * GENERATING_FUNCTIONS[name].value(x)) / 16


def test_the_table_has_the_six_of_the_paper_in_its_order() -> None:
    assert tuple(ORDERS) == QUASI_INTERPOLANTS
    assert {row.number: row.name for row in GENERATING_FUNCTIONS.values() if row.number} == NUMBERS


@pytest.mark.parametrize("name", ORDERS)
def test_values_are_those_of_the_formula(name: str) -> None:
    x = np.linspace(-8, 8, 161)
    expected = [printed(name, float(a)) for a in x]
    assert GENERATING_FUNCTIONS[name].value(x) == pytest.approx(expected, rel=1e-12, abs=1e-16)


@pytest.mark.parametrize("name", ORDERS)
def test_moment_conditions_hold_up_to_the_order(name: str) -> None:
    row = GENERATING_FUNCTIONS[name]
    assert row.order == ORDERS[name]
    assert moment(name, 0) == pytest.approx(1, abs=1e-10)
    for k in range(1, row.order):
        assert moment(name, k) == pytest.approx(0, abs=1e-9), f"moment {k}"


@pytest.mark.parametrize("name", ORDERS)
def test_the_order_is_not_higher_than_said(name: str) -> None:
    assert abs(moment(name, ORDERS[name])) > 0.1


@pytest.mark.parametrize("name", GENERATING_FUNCTIONS)
def test_positivity_is_as_said(name: str) -> None:
    row = GENERATING_FUNCTIONS[name]
    values = row.value(np.linspace(-12, 12, 20001))
    assert row.positive is bool((values >= 0).all())


def test_extreme_arguments_give_zero_without_warnings() -> None:
    for row in GENERATING_FUNCTIONS.values():
        values = row.value(np.array([-1e4, -300.0, 300.0, 1e4]))
        assert np.abs(values).max() <= 1e-100, row.name


@pytest.mark.parametrize(("number", "name"), NUMBERS.items())
def test_look_up_by_number_and_by_name(number: int, name: str) -> None:
    for key in (number, str(number), name):
        assert generating_function(key) is GENERATING_FUNCTIONS[name]


@pytest.mark.parametrize("name", [0, "0", 7, "", "gausian", "box", "hat", "Gaussian "])
def test_an_unknown_one_is_refused_with_the_list(name: str | int) -> None:
    with pytest.raises(quito.UsageError) as caught:
        generating_function(name)
    message = str(caught.value)
    assert repr(name) in message
    for number, known in NUMBERS.items():
        assert f"{number} {known}" in message


@pytest.mark.parametrize("name", ORDERS)
def test_it_is_cut_where_it_stays_negligible(name: str) -> None:
    row, radius = GENERATING_FUNCTIONS[name], reach(name)
    x = np.linspace(0, 60, 600_001)
    values = np.abs(row.value(x)) / np.abs(row.value(x)).max()
    assert values[x > radius + 1 / 128].max() < CUT
    last = x[values >= CUT].max()
    assert radius == pytest.approx(last, abs=1 / 128)


@pytest.mark.parametrize(("name", "radius"), [("gaussian", math.sqrt(8 * math.log(10)))])
def test_the_cut_of_the_gaussian(name: str, radius: float) -> None:
    assert reach(name) == pytest.approx(radius, abs=1 / 128)  # e^(−r²) = 1e-8


def sums(name: str, variance: float) -> list[float]:
    """Σ_j ψ((s−j)/√D) over a cell, by the plain formula."""
    root = math.sqrt(variance)
    width = math.ceil(25 * root) + 2
    return [
        sum(printed(name, (s - j) / root) for j in range(-width, width + 2))
        for s in np.linspace(0, 1, 41)
    ]


@pytest.mark.parametrize("name", ORDERS)
@pytest.mark.parametrize("variance", [0.15, 0.3, 0.8, 2.0, 5.0])
def test_the_least_sum_of_weights(name: str, variance: float) -> None:
    expected = min(sums(name, variance))
    assert partition_floor(GENERATING_FUNCTIONS[name], variance) == pytest.approx(
        expected, abs=2e-3
    )


@pytest.mark.parametrize("name", ORDERS)
@pytest.mark.parametrize("variance", [1e-6, 0.01, 0.1])
def test_too_small_a_variance_is_refused_and_the_least_is_named(name: str, variance: float) -> None:
    row = GENERATING_FUNCTIONS[name]
    with pytest.raises(quito.UsageError) as caught:
        check_variance(row, variance)
    message = str(caught.value)
    assert name in message
    assert f"variance {variance:g}" in message
    found = re.search(r"take at least ([0-9.]+)$", message)
    assert found
    least = float(found[1])
    assert min(sums(name, least)) >= 0.5
    assert min(sums(name, 0.95 * least - 0.01)) < 0.5
    check_variance(row, least)


@pytest.mark.parametrize("name", ORDERS)
def test_ordinary_variances_pass(name: str) -> None:
    for variance in (1.0, 2.0, 10.0, 100.0):
        check_variance(GENERATING_FUNCTIONS[name], variance)


def test_a_solve_refuses_it_too() -> None:
    with pytest.raises(quito.UsageError, match="take at least"):
        quito.solve("alychan", variance=0.05, steps=5)


def test_the_classical_controls_take_no_variance() -> None:
    for control in ("piecewise-constant", "piecewise-linear"):
        with pytest.raises(quito.UsageError, match="variance"):
            quito.solve("alychan", control=control, variance=2.0, steps=5)
