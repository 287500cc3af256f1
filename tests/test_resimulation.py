"""Re-simulation against SciPy's DOP853, and systems that no integrator holds."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from quito_cli.problem.model import Model
from quito_cli.solution.resimulation import Control, resimulate
from quito_cli.transcription.control import ControlBasis
from quito_cli.transcription.generating import GENERATING_FUNCTIONS
from quito_cli.transcription.mesh import Mesh

Array = NDArray[np.float64]
Build = Callable[[str], Model]


def one_state(dynamics: str, lagrange: str = "0", final: float = 2, mayer: str = "0") -> str:
    return f"""
time: {{initial: 0, final: {final}}}
states: {{x: {{initial: 1}}}}
controls: {{u: {{}}}}
dynamics: {{x: {dynamics}}}
cost: {{lagrange: {lagrange}, mayer: {mayer}}}
"""


def constant(value: float, cells: int = 20) -> Control:
    basis = ControlBasis(GENERATING_FUNCTIONS["box"], cells, 1.0, True)
    return Control(basis, Mesh.uniform(cells), np.full((cells, 1), value))


def ends(substeps: int) -> Array:
    return np.linspace(0, 1, substeps + 1)


def wave(function: str, cells: int, controls: int = 1) -> Control:
    row = GENERATING_FUNCTIONS[function]
    basis = ControlBasis(row, cells, 2.0 if row.scaled else 1.0, True)
    mesh = Mesh(np.linspace(0, 1, cells + 1) ** 1.4)
    c = np.random.default_rng(3).uniform(-1, 1, (basis.count, controls))
    return Control(basis, mesh, c)


def by_scipy(
    model: Model, control: Control, times: tuple[float, float], start: Array, substeps: int
) -> tuple[Array, float]:
    """States at the ends of the substeps and the cost, cell by cell: jumps fall on nodes."""
    nodes = times[0] + (times[1] - times[0]) * control.mesh.fractions
    states, y = [start], np.append(start, 0.0)
    for k, (a, b) in enumerate(itertools.pairwise(nodes)):

        def flow(t: float, y: Array, k: int = k, a: float = a, b: float = b) -> Array:
            offset = np.array([min(max((t - a) / (b - a), 0.0), 1.0)])
            u = control.basis.evaluate(control.coefficients, np.array([k]), offset)[0]
            xdot, cost = model.right_hand_side(y[:-1], u, [], t)
            return np.append(np.array(xdot).ravel(), float(cost))

        at = np.linspace(a, b, substeps + 1)[1:]
        found = solve_ivp(flow, (a, b), y, "DOP853", t_eval=at, rtol=1e-12, atol=1e-13)
        states += list(found.y[:-1].T)
        y = found.y[:, -1]
    mayer = float(model.end_cost(start, times[0], y[:-1], times[1], []))
    return np.array(states), float(y[-1]) + mayer


@pytest.mark.parametrize("function", ["gaussian", "laguerre4", "box", "hat"])
@pytest.mark.parametrize("substeps", [1, 3])
def test_it_agrees_with_another_integrator(function: str, substeps: int, model: Build) -> None:
    given, control = model("van_der_pol"), wave(function, 12)
    start = np.array([0.0, 1.0])
    found = resimulate(given, control, ends(substeps), (0.0, 4.0), start, np.zeros(0))
    states, cost = by_scipy(given, control, (0.0, 4.0), start, substeps)
    assert found.states.shape == (12 * substeps + 1, 2)
    limit = 1e-6 if function == "box" else 1e-7
    assert found.states == pytest.approx(states, abs=limit)
    assert found.cost == pytest.approx(cost, abs=limit)
    assert found.accuracy < 1e-6


def test_it_agrees_on_a_problem_of_time_with_both_costs(model: Build) -> None:
    text = """
time: {initial: 1, final: 2.5}
states: {x: {size: 2, initial: [1, 0]}, y: {}}
controls: {u: {size: 2}}
dynamics: {x: ["x[1] + u[0]*t", "-x[0] + u[1]"], y: "x[0]*u[0] - t*y"}
cost: {lagrange: "dot(x, x) + u[0]*t", mayer: "y*t + initial(x)[0]"}
"""
    given, control = model(text), wave("gaussian", 10, controls=2)
    start = np.array([1.0, 0.0, 0.4])
    found = resimulate(given, control, ends(2), (1.0, 2.5), start, np.zeros(0))
    states, cost = by_scipy(given, control, (1.0, 2.5), start, 2)
    assert found.states == pytest.approx(states, abs=1e-8)
    assert found.cost == pytest.approx(cost, abs=1e-8)


def test_closed_form(model: Build) -> None:
    given = model(one_state("u*x*cos(t)", "x*cos(t)", mayer="x"))
    found = resimulate(given, constant(1.0), ends(2), (0.0, 2.0), np.ones(1), np.zeros(0))
    t = np.linspace(0, 2, 41)
    assert found.states[:, 0] == pytest.approx(np.exp(np.sin(t)), abs=1e-10)
    assert found.cost == pytest.approx(2 * np.exp(np.sin(2)) - 1, abs=1e-10)
    assert found.accuracy < 1e-9


def test_the_accuracy_is_told_honestly(model: Build) -> None:
    """Stiff beyond the finest step: the figure says that the result is not to be trusted."""
    given = model(one_state("-3e4*(x - cos(t)) + u"))
    found = resimulate(given, constant(0.0, 5), ends(1), (0.0, 2.0), np.ones(1), np.zeros(0))
    assert found.accuracy > 1e-3


@pytest.mark.parametrize("dynamics", ["x^2 + u", "exp(x) + u", "1/(1.5 - t) * x^3 + u", "2000*x"])
def test_an_explosion_is_infinite_and_silent(dynamics: str, model: Build) -> None:
    given = model(one_state(dynamics, "x^2"))
    found = resimulate(given, constant(1.0), ends(2), (0.0, 2.0), np.ones(1), np.zeros(0))
    assert found.accuracy == np.inf
    assert not np.isfinite(found.states[-1]).all()


def test_undefined_dynamics_are_infinite_and_silent(model: Build) -> None:
    given = model(one_state("-1 - sqrt(x)", "log(x)"))
    found = resimulate(given, constant(1.0), ends(2), (0.0, 2.0), np.ones(1), np.zeros(0))
    assert found.accuracy == np.inf


def test_an_unstable_system_is_solved_and_its_gap_told(solve: Any) -> None:
    """x' = 10 x + u over ten units of time: rounding grows by e^100 under a fixed control."""
    text = one_state("10*x + u", "x^2 + u^2", final=10)
    solution = solve(text, steps=100)
    assert solution.success
    assert solution.evidence.resimulation_gap > 1e3
    assert any("re-simulated states differ" in warning for warning in solution.evidence.warnings)


def test_a_coarse_mesh_is_told_by_the_gap(solve: Any) -> None:
    text = one_state("sin(20*t)*x*3 + u", "x^2 + u^2", final=5)
    coarse, fine = solve(text, steps=8, substeps=1), solve(text, steps=400)
    assert coarse.evidence.resimulation_gap > 1e-2
    assert any("too coarse" in warning for warning in coarse.evidence.warnings)
    assert fine.evidence.resimulation_gap < 1e-6
    assert fine.evidence.warnings == ()


def test_the_gap_is_the_distance_to_scipys_trajectory(solve: Any, model: Build) -> None:
    solution = solve("van_der_pol", steps=20, discretization="euler")
    control = Control(solution.basis, solution.mesh, solution.coefficients)
    states, cost = by_scipy(model("van_der_pol"), control, (0.0, 4.0), np.array([0.0, 1.0]), 2)
    ours = solution.trajectory.states
    gap = (np.abs(states - ours) / np.abs(ours).max(axis=0)).max()
    assert gap > 1e-2
    assert solution.evidence.resimulation_gap == pytest.approx(gap, rel=1e-5)
    assert solution.evidence.resimulated_cost == pytest.approx(cost, rel=1e-6)
