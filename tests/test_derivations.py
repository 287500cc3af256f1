"""The answers that problem files state, and quito's own, against derivations that use neither.

Every module of `derivations` is named after a problem and solves its optimality conditions.
"""

from __future__ import annotations

import importlib
import itertools
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import derivations
import numpy as np
import pytest
from derivations.truth import Array, Truth
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from quito_cli.problem.model import Constraint, Known, Model

Build = Callable[[str], Model]

NAMES = sorted({module.name for module in pkgutil.iter_modules(derivations.__path__)} - {"truth"})


@dataclass(frozen=True)
class Tolerance:
    """How far quito's answer may be from the derived one."""

    cost: float
    """Absolute, beside the digits that both have."""
    control: float
    """As a fraction of the control's range, away from switching times."""
    zone: float = 0.03
    """What is near a switching time, as a fraction of the horizon."""


SMOOTH = Tolerance(1e-9, 1e-3)
TOLERANCES = {
    # The thrust is hard to find where the height is flat in it, but then the height is not.
    "goddard": Tolerance(2e-8, 1e-3),
    # A jump is spread over a few cells: time is lost, whatever else the control does right.
    "lotka_volterra_fishing": Tolerance(3e-4, 4e-3),
    "minimum_fuel": Tolerance(3e-4, 1e-6),
    "minimum_time": Tolerance(2e-4, 1e-6),
    "moon_lander": Tolerance(2e-4, 1e-6),
    "robot_arm": Tolerance(7e-4, 1e-6),
    # A kink is rounded off over a few cells.
    "sir_vaccination": Tolerance(2e-5, 2e-3),
    "strongest_column": Tolerance(2e-5, 1e-3),
    # In the first cell u2 may leave its arc: a state is bounded at the nodes only.
    "container_crane": Tolerance(2e-9, 5e-3),
    # The layers are a few cells wide.
    "hypersensitive": Tolerance(5e-6, 1e-3),
}
"""About twice what is measured. Where the control is smooth, `SMOOTH` is met."""


@cache
def truth(name: str) -> Truth:
    found: Truth = importlib.import_module(f"derivations.{name}").derive()
    return found


def known(model: Model) -> Known:
    assert model.known is not None
    return model.known


def parameters(of: Truth, given: Model) -> tuple[float, ...]:
    return of.parameters or (of.cost,) * given.n_p


def far_from_switches(of: Truth, zone: float) -> NDArray[np.bool_]:
    """Whether samples are further from all switching times than `zone` of the horizon."""
    away = np.ones(len(of.times), dtype=bool)
    for instant in of.switching_times:
        away &= np.abs(of.times - instant) > zone * (of.horizon[1] - of.horizon[0])
    return away


def scales(states: Array) -> Array:
    return np.array(np.max(np.abs(states), axis=0) + 1e-3)


@pytest.mark.parametrize("name", NAMES)
def test_the_samples_are_what_a_truth_promises(name: str, model: Build) -> None:
    of, given = truth(name), model(name)
    assert of.states.shape == (len(of.times), given.n_x)
    assert of.controls.shape == (len(of.times), given.n_u)
    assert len(parameters(of, given)) == given.n_p
    assert given.n_p <= 1 or of.parameters
    assert (np.diff(of.times) >= 0).all()
    assert (of.times[0], of.times[-1]) == pytest.approx(of.horizon, abs=1e-14)
    twice = of.times[:-1][np.diff(of.times) == 0]
    for instant in of.switching_times:
        assert np.min(np.abs(twice - instant)) < 1e-13


@pytest.mark.parametrize("name", NAMES)
def test_the_file_states_what_is_derived(name: str, model: Build) -> None:
    of, stated = truth(name), known(model(name))
    assert stated.accuracy is not None
    assert stated.cost is not None
    assert of.accuracy <= 1e-9
    assert abs(stated.cost - of.cost) <= stated.accuracy + of.accuracy
    assert stated.switching_times == pytest.approx(of.switching_times, abs=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_closed_forms_of_the_file_are_what_is_derived(name: str, model: Build) -> None:
    of, given = truth(name), model(name)
    away = far_from_switches(of, 1e-9)
    for functions, variables, values in (
        (known(given).states, given.states, of.states),
        (known(given).controls, given.controls, of.controls),
    ):
        stated = Known.sample(functions, variables, of.times[away])
        there = np.isfinite(stated)
        gap = np.abs(stated - values[away]) / scales(values)
        assert np.max(gap[there], initial=0.0) < 1e-8
        for variable in variables:
            functions_of = {**known(given).states, **known(given).controls}
            assert there[:, variable.entries].all() == (variable.name in functions_of)


@pytest.mark.parametrize("name", NAMES)
def test_the_derived_control_yields_states_and_cost_in_the_file_s_own_dynamics(
    name: str, model: Build
) -> None:
    of, given = truth(name), model(name)
    size, p = scales(of.states), parameters(of, given)
    y = np.concatenate([of.states[0], np.zeros(given.n_q)])
    cuts = [0, *(np.flatnonzero(np.diff(of.times) == 0) + 1), len(of.times)]
    for a, b in itertools.pairwise(cuts):
        control = CubicSpline(of.times[a:b], of.controls[a:b])

        def flow(t: float, y: Array, control: Any = control) -> Array:
            rates = given.right_hand_side(y[: given.n_x], control(t), p, t)
            found = np.concatenate([np.array(rate).ravel() for rate in rates])
            assert np.isfinite(found).all()  # the integrator would not end
            return found

        at = of.times[a:b]
        found = solve_ivp(flow, (at[0], at[-1]), y, "DOP853", at, rtol=1e-11, atol=1e-13)
        assert np.max(np.abs(found.y[: given.n_x].T - of.states[a:b]) / size) < 1e-7
        y = found.y[:, -1]
    start, end = of.horizon
    mayer = float(given.end_cost(of.states[0], start, y[: given.n_x], end, p))
    cost = given.sense * (float(y[given.n_x]) + mayer)
    assert cost == pytest.approx(of.cost, abs=1e-8 * max(1.0, abs(of.cost)))
    for constraint, integral in zip(given.constraints.integral, y[given.n_x + 1 :], strict=True):
        assert constraint.bounds.lower[0] - 1e-8 <= integral <= constraint.bounds.upper[0] + 1e-8


@pytest.mark.parametrize("name", NAMES)
def test_the_derived_answer_satisfies_the_file_s_conditions(name: str, model: Build) -> None:
    of, given = truth(name), model(name)
    size, p = scales(of.states), parameters(of, given)
    start, end = of.horizon
    for bounds, values, tolerance in (
        (given.state_bounds, of.states, 1e-8 * size),
        (given.control_bounds, of.controls, 1e-8),
        (given.parameter_bounds, np.array([p]), 1e-8),
        (given.initial, of.states[0], 1e-12 * size),
        (given.final, of.states[-1], 1e-8 * size),
        (given.initial_time, start, 1e-12),
        (given.final_time, end, 1e-12),
    ):
        assert np.all(values >= bounds.lower - tolerance)
        assert np.all(values <= bounds.upper + tolerance)

    def holds(constraint: Constraint, at: slice) -> None:
        function = given.function(constraint)
        samples = zip(of.states[at], of.controls[at], of.times[at], strict=True)
        values = np.array([np.array(function(x, u, p, t)) for x, u, t in samples])
        assert (values[..., 0] >= constraint.bounds.lower - 1e-8).all()
        assert (values[..., 0] <= constraint.bounds.upper + 1e-8).all()

    for constraint in given.constraints.path:
        holds(constraint, slice(None))
    for constraint in given.constraints.point:
        assert constraint.at is not None
        nearest = int(np.argmin(np.abs(of.times - (start + constraint.at * (end - start)))))
        holds(constraint, slice(nearest, nearest + 1))
    row = 0
    for constraint in given.constraints.boundary:
        both = (of.states[0], start, of.states[-1], end, p)
        values = np.array(given.boundary_values(*both)[0]).ravel()
        rows = values[row : row + len(constraint.bounds.lower)]
        assert (rows >= constraint.bounds.lower - 1e-8).all()
        assert (rows <= constraint.bounds.upper + 1e-8).all()
        row += len(rows)


@pytest.mark.parametrize("name", NAMES)
def test_quito_finds_the_derived_answer(name: str, solve: Any) -> None:
    of, found = truth(name), solve(name)
    tolerance = TOLERANCES.get(name, SMOOTH)
    assert found.success
    assert found.evidence.warnings == ()
    assert found.cost == pytest.approx(of.cost, abs=tolerance.cost)
    fractions = (of.times - of.horizon[0]) / (of.horizon[1] - of.horizon[0])
    control = found.control(found.times[0] + fractions * (found.times[-1] - found.times[0]))
    bounded = np.array([c.upper - c.lower for c in found.origin.controls])
    ranges = np.where(np.isfinite(bounded), bounded, np.ptp(of.controls, axis=0))
    error = np.max(np.abs(control - of.controls) / ranges, axis=1)
    assert np.max(error[far_from_switches(of, tolerance.zone)]) < tolerance.control
