"""The references of the bundled problems against answers found by Pontryagin's principle."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad, solve_ivp

import quito_cli as quito
from quito_cli.problem.build import build
from quito_cli.problem.library import bundled
from quito_cli.problem.load import changed
from quito_cli.problem.model import Known, Model

Array = NDArray[np.float64]
Build = Callable[[str], Model]

PROBLEMS = (
    "alychan",
    "bang_bang",
    "bressan",
    "bryson_denham",
    "catalyst_mixing",
    "double_integrator_tracking",
    "inverted_pendulum",
    "rayleigh",
    "rayleigh_mixed",
    "siri",
    "van_der_pol",
    "van_der_pol_state",
)
WITHOUT_REFERENCE = ("auv_fleet", "robot_path")
WITHOUT_CONTROL = ("inverted_pendulum", "rayleigh", "rayleigh_mixed", "van_der_pol_state")
WITH_CONTROL = tuple(name for name in PROBLEMS if name not in WITHOUT_CONTROL)
WITH_STATE = ("alychan", "bressan", "bryson_denham", "catalyst_mixing")
GENERAL = ("bressan", "bryson_denham")


def known(model: Model) -> Known:
    assert model.known is not None
    return model.known


def test_all_fourteen_are_bundled() -> None:
    assert set(bundled()) >= {*PROBLEMS, *WITHOUT_REFERENCE}


@pytest.mark.parametrize("name", WITHOUT_REFERENCE)
def test_what_is_only_the_best_known_is_no_reference(name: str, model: Build) -> None:
    assert model(name).known is None


@pytest.mark.parametrize("name", PROBLEMS)
def test_cost_and_switching_times_are_the_verified_ones(
    name: str, model: Build, reference: Any
) -> None:
    facts, _ = reference(name)
    found = known(model(name))
    assert found.accuracy is not None
    assert found.cost == pytest.approx(facts["cost"], abs=max(found.accuracy, 1e-13))
    assert found.switching_times == pytest.approx(facts["switching_times"], abs=1e-14)
    instants = model(name)
    assert instants.final_time.lower == pytest.approx(facts["T"], abs=1e-15)


@pytest.mark.parametrize("name", WITH_CONTROL)
def test_controls_are_the_verified_ones(name: str, model: Build, reference: Any) -> None:
    given, (_, samples) = model(name), reference(name)
    t = samples["t"]
    found = Known.sample(known(given).controls, given.controls, t)
    far = np.ones(len(t), dtype=bool)
    for junction in known(given).switching_times:
        far &= np.abs(t - junction) > 1e-9
    assert far.sum() >= len(t) - 2
    assert found[far] == pytest.approx(samples["u"][far], abs=1e-10)


@pytest.mark.parametrize("name", WITH_STATE)
def test_states_are_the_verified_ones(name: str, model: Build, reference: Any) -> None:
    given, (_, samples) = model(name), reference(name)
    found = Known.sample(known(given).states, given.states, samples["t"])
    assert found == pytest.approx(samples["x"], abs=1e-10)


@pytest.mark.parametrize("name", WITH_CONTROL)
def test_the_known_control_yields_the_known_cost(name: str, model: Build) -> None:
    """Integrate the file's own dynamics and cost with the file's own control."""
    given = model(name)
    end = given.final_time.lower
    y = np.append(given.initial.lower, 0.0)
    junctions = [0.0, *known(given).switching_times, end]
    for a, b in itertools.pairwise(junctions):

        def flow(t: float, y: Array, a: float = a, b: float = b) -> Array:
            inside = np.array([min(max(t, a), b - 1e-13)])
            u = Known.sample(known(given).controls, given.controls, inside)[0]
            xdot, cost = given.right_hand_side(y[:-1], u, [], t)
            return np.append(np.array(xdot).ravel(), float(cost))

        y = solve_ivp(flow, (a, b), y, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    mayer = float(given.end_cost(given.initial.lower, 0.0, y[:-1], end, []))
    assert y[-1] + mayer == pytest.approx(known(given).cost, abs=1e-9)
    lower, upper = given.final
    assert (y[:-1] >= lower - 1e-9).all()
    assert (y[:-1] <= upper + 1e-9).all()


@pytest.mark.parametrize("name", PROBLEMS)
def test_known_functions_respect_bounds_and_are_continuous_from_the_right(
    name: str, model: Build
) -> None:
    given = model(name)
    t = np.linspace(0, given.final_time.lower, 1001)
    for functions, variables, bounds in (
        (known(given).controls, given.controls, given.control_bounds),
        (known(given).states, given.states, given.state_bounds),
    ):
        values = Known.sample(functions, variables, t)
        seen = np.isfinite(values)
        assert (values >= bounds.lower - 1e-12)[seen].all()
        assert (values <= bounds.upper + 1e-12)[seen].all()
        for junction in known(given).switching_times:
            at, after = Known.sample(functions, variables, junction + np.array([0, 1e-12]))
            assert at == pytest.approx(after, abs=1e-9, nan_ok=True)


@pytest.mark.parametrize("name", WITHOUT_CONTROL)
def test_where_nothing_is_known_it_says_so(name: str, model: Build) -> None:
    given = model(name)
    assert np.isnan(Known.sample(known(given).controls, given.controls, np.array([0.0, 1.0]))).all()


@pytest.mark.parametrize("name", PROBLEMS)
def test_a_changed_file_keeps_its_reference_only_where_it_is_general(name: str) -> None:
    key = {
        **{"bressan": "T", "bryson_denham": "l", "catalyst_mixing": "T"},
        **{"van_der_pol": "mu", "van_der_pol_state": "mu", "inverted_pendulum": "L"},
        **{"double_integrator_tracking": "r", "siri": "beta"},
    }.get(name, "time.final")
    value = 0.15 if key == "l" else 1.25
    found = build(changed(quito.load(name), {key: value})).known
    assert (found is not None) is (name in GENERAL)


@pytest.mark.parametrize("horizon", [1.5, 4.0, 10.0])
def test_the_general_reference_of_bressan(horizon: float) -> None:
    """−x3(T) = ∫(x1² − x2) with x1 = −t, then (t − T)/2."""
    given = build(changed(quito.load("bressan"), {"T": horizon}))
    a = horizon / 3

    def integrand(t: float) -> float:
        x1 = -t if t < a else (t - horizon) / 2
        return (x1 + (horizon - t) / 2) ** 2 - (horizon - t) ** 2 / 4

    cost = sum(quad(integrand, *ends, epsabs=1e-13)[0] for ends in ((0, a), (a, horizon)))
    assert known(given).cost == pytest.approx(cost, abs=1e-12)
    assert known(given).switching_times == pytest.approx((a,))


@pytest.mark.parametrize("ceiling", [0.05, 1 / 9, 0.16])
def test_the_general_reference_of_bryson_and_denham(ceiling: float) -> None:
    """4/(9 l), half the integral of its own control squared."""
    given = build(changed(quito.load("bryson_denham"), {"l": ceiling}))
    t = np.linspace(0, 1, 40_001)[:-1] + 1.25e-5
    u = Known.sample(known(given).controls, given.controls, t)[:, 0]
    assert known(given).cost == pytest.approx(float(np.mean(u**2)) / 2, rel=1e-5)
    assert given.state_bounds.upper[0] == pytest.approx(ceiling)
    x = Known.sample(known(given).states, given.states, t)[:, 0]
    assert x.max() == pytest.approx(ceiling, abs=1e-9)


def test_a_constant_beyond_the_reference_is_no_mistake() -> None:
    """Under a ceiling of 1/5 the arc vanishes and the reference with it; the problem is sound."""
    given = build(changed(quito.load("bryson_denham"), {"l": 0.2}))
    assert given.state_bounds.upper[0] == pytest.approx(0.2)
    assert given.known is None
