"""Integration schemes: observed orders, stage times, and implicit schemes through the same door."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_bvp

import quito_cli as quito
from quito_cli.problem.build import build
from quito_cli.problem.load import load_text
from quito_cli.solution.extract import extract
from quito_cli.solvers import Status, minimise
from quito_cli.transcription.cells import Discretization
from quito_cli.transcription.control import ControlBasis
from quito_cli.transcription.generating import GENERATING_FUNCTIONS
from quito_cli.transcription.mesh import Mesh
from quito_cli.transcription.schemes import SCHEMES, Scheme, scheme
from quito_cli.transcription.transcribe import transcribe

Array = NDArray[np.float64]
SIZES = (8, 16, 32, 64)

GROWTH = """
title: The control is held fixed, so that x = exp(sin t) and the cost is exp(sin 2) − 1
time: {initial: 0, final: 2}
states: {x: {initial: 1}}
controls: {u: {lower: 1, upper: 1}}
dynamics: {x: u*x*cos(t)}
cost: {lagrange: x*cos(t)}
"""
RAMP = """
title: The optimal control is u = t − 1 and costs nothing, so that x = exp(t²/2 − t)
time: {initial: 0, final: 2}
states: {x: {initial: 1}}
controls: {u: {}}
dynamics: {x: u*x}
cost: {lagrange: (u - (t - 1))^2}
"""
NONLINEAR = """
title: Van der Pol's oscillator, control unbounded and paid for
time: {initial: 0, final: 2}
states: {x1: {initial: 1}, x2: {initial: 0}}
controls: {u: {}}
dynamics: {x1: x2, x2: (1 - x1^2)*x2 - x1 + u}
cost: {lagrange: 0.5*(x1^2 + x2^2 + u^2)}
"""


STIFF = """
title: A state that is drawn to cos t a thousand times faster than the horizon
constants: {rate: 1000}
time: {initial: 0, final: 1}
states: {x: {initial: 2}}
controls: {u: {}}
dynamics: {x: -rate*(x - cos(t)) - sin(t) + u}
cost: {lagrange: (x - cos(t))^2 + u^2}
"""
"""e = x − cos t has e' = −rate e + u, and V = e²/(rate + √(rate² + 1)) but for e^(−2 rate)."""
ORDERS = {"euler": 1, "trapezoidal": 2, "rk4": 4, "hermite-simpson": 4, "radau": 5}
IMPLICIT = ("trapezoidal", "hermite-simpson", "radau")


def solved(
    text: str, cells: int, row: Scheme, substeps: int, function: str = "hat", mesh: Any = None
) -> quito.Solution:
    """Solve by the stages themselves: options know only the schemes of the table."""
    problem = load_text(text, "test.yaml")
    basis = ControlBasis(GENERATING_FUNCTIONS[function], cells, 2.0, True)
    method = Discretization(mesh or Mesh.uniform(cells), basis, row, substeps)
    nlp = transcribe(build(problem), method, None, None)
    outcome, residuals = minimise(nlp, "ipopt", 1e-12, 200, {}, None, None)
    assert outcome.status is Status.SOLVED
    return extract(problem, nlp, outcome, residuals, {"tolerance": 1e-12}, 0.0)


def orders(errors: list[float]) -> Array:
    return np.asarray(np.log2(np.array(errors[:-1]) / np.array(errors[1:])))


def observed(measure: Callable[[int], float], sizes: tuple[int, ...] = SIZES) -> Array:
    return orders([measure(cells) for cells in sizes])


def few(order: int) -> tuple[int, int]:
    """Two numbers of cells, few enough that rounding does not show."""
    return (6, 12) if order > 4 else (12, 24)


# The table


def test_the_table() -> None:
    assert {name: row.order for name, row in SCHEMES.items()} == ORDERS
    assert [name for name, row in SCHEMES.items() if not row.explicit] == list(IMPLICIT)
    assert scheme("rk4") is SCHEMES["rk4"]
    for row in SCHEMES.values():
        assert list(row.offsets) == sorted(row.offsets)
        assert min(row.offsets) >= 0
        assert max(row.offsets) <= 1


def test_an_unknown_scheme_is_refused_with_the_list() -> None:
    with pytest.raises(quito.UsageError, match=r"rk5.*euler.*rk4"):
        scheme("rk5")


@pytest.mark.parametrize(
    ("name", "substeps", "expected"),
    [
        ("euler", 1, [0]),
        ("euler", 2, [0, 1 / 2]),
        ("rk4", 1, [0, 1 / 2, 1]),
        ("rk4", 2, [0, 1 / 4, 1 / 2, 3 / 4, 1]),
        ("rk4", 3, [0, 1 / 6, 1 / 3, 1 / 2, 2 / 3, 5 / 6, 1]),
        ("trapezoidal", 2, [0, 1 / 2, 1]),
        ("radau", 1, [0, 0.4 - 0.06**0.5, 0.4 + 0.06**0.5, 1]),
    ],
)
def test_the_offsets_of_the_substeps(name: str, substeps: int, expected: list[float]) -> None:
    basis = ControlBasis(GENERATING_FUNCTIONS["hat"], 3, 1.0, True)
    method = Discretization(Mesh.uniform(3), basis, SCHEMES[name], substeps)
    assert method.offsets == pytest.approx(expected, abs=1e-13)


# Orders


@pytest.mark.parametrize("substeps", [1, 2, 3])
@pytest.mark.parametrize(("name", "order"), ORDERS.items())
def test_order_of_the_integrator_by_itself(
    name: str, order: int, substeps: int, solve: Any
) -> None:
    def answer(cells: int) -> quito.Solution:
        found: quito.Solution = solve(GROWTH, steps=cells, discretization=name, substeps=substeps)
        assert found.success
        return found

    def state_error(cells: int) -> float:
        found = answer(cells)
        return float(
            np.abs(found.trajectory.states[:, 0] - np.exp(np.sin(found.trajectory.times))).max()
        )

    def cost_error(cells: int) -> float:
        return abs(answer(cells).cost - math.expm1(math.sin(2)))

    assert observed(state_error)[-1] == pytest.approx(order, abs=0.25)
    assert observed(cost_error)[-1] == pytest.approx(order, abs=0.25)


@pytest.mark.parametrize("name", ORDERS)
def test_substeps_are_steps(name: str, solve: Any) -> None:
    """With the control held, 3 substeps in 10 cells are 30 cells of one."""
    few = solve(GROWTH, steps=10, discretization=name, substeps=3)
    many = solve(GROWTH, steps=30, discretization=name, substeps=1)
    assert few.cost == pytest.approx(many.cost, abs=1e-11)
    assert few.trajectory.times == pytest.approx(many.times, abs=1e-13)
    assert few.trajectory.states == pytest.approx(many.trajectory.states, abs=1e-11)


@pytest.mark.parametrize("substeps", [1, 2, 3])
@pytest.mark.parametrize(("name", "order"), ORDERS.items())
def test_the_control_is_taken_at_the_true_stage_times(
    name: str, order: int, substeps: int, solve: Any
) -> None:
    """A control linear in time is exact with hats: a wrong stage time would cost the order."""

    def error(cells: int) -> float:
        found = solve(
            RAMP,
            steps=cells,
            discretization=name,
            substeps=substeps,
            control="piecewise-linear",
            tolerance=1e-12,
        )
        assert found.cost == pytest.approx(0, abs=1e-12)
        t = found.times
        seen = t[:-1] if name == "euler" and substeps == 1 else t  # it never looks at the end
        assert found.control(seen)[:, 0] == pytest.approx(seen - 1, abs=1e-6)
        exact = np.exp(t**2 / 2 - t)
        return float(np.abs(found.trajectory(t)[:, 0] - exact).max())

    assert observed(error, few(order))[-1] == pytest.approx(order, abs=0.3)


@pytest.mark.parametrize("name", ORDERS)
def test_the_order_on_a_graded_mesh(name: str) -> None:
    """Nodes at τ²: steps that differ from cell to cell, one formula of t for all."""

    def error(cells: int) -> float:
        mesh = Mesh(np.linspace(0, 1, cells + 1) ** 2)
        found = solved(RAMP, cells, SCHEMES[name], 2, mesh=mesh)
        t = found.times
        return float(np.abs(found.trajectory(t)[:, 0] - np.exp(t**2 / 2 - t)).max())

    assert observed(error)[-1] == pytest.approx(SCHEMES[name].order, abs=0.3)


CONTROLS: list[dict[str, Any]] = [
    {},
    {"control": "piecewise-linear"},
    {"generating_function": "hermite10", "variance": 4.0},
]


@pytest.mark.parametrize("control", CONTROLS, ids=["gaussian", "hat", "hermite10"])
@pytest.mark.parametrize("substeps", [1, 2])
def test_the_optimal_cost_converges_with_order_four(
    control: dict[str, Any], substeps: int, lq: str, solve: Any
) -> None:
    def answer(cells: int) -> Any:
        return solve(lq, steps=cells, substeps=substeps, tolerance=1e-12, **control)

    def state_error(cells: int) -> float:
        found = answer(cells)
        exact = np.cosh(1 - found.times) / math.cosh(1)
        return float(np.abs(found.trajectory(found.times)[:, 0] - exact).max())

    cost = observed(lambda cells: abs(answer(cells).cost - math.tanh(1) / 2), (4, 8, 16, 32))
    assert cost == pytest.approx(4, abs=0.15)
    assert observed(state_error, (8, 16, 32))[-1] == pytest.approx(4, abs=0.4)
    assert abs(answer(32).cost - math.tanh(1) / 2) < 1e-8


@pytest.mark.parametrize("substeps", [1, 2])
@pytest.mark.parametrize(("name", "order"), ORDERS.items())
def test_orders_of_a_whole_optimisation(
    name: str, order: int, substeps: int, lq: str, solve: Any
) -> None:
    """Cost and costates have the scheme's order, and the control in the inner half.

    In the first and last cells the control has an order or two less: a trapezoidal rule, for one,
    weighs the first value of û by the costate half a step later. States feel that in their last
    digits where coefficients reach over several cells, and not with hats.
    """

    def answer(cells: int, control: str) -> quito.Solution:
        options = {"steps": cells, "substeps": substeps, "discretization": name}
        found: quito.Solution = solve(lq, tolerance=1e-12, control=control, **options)
        return found

    def cost(cells: int) -> float:
        return abs(answer(cells, "quasi-interpolant").cost - math.tanh(1) / 2)

    def costate(cells: int) -> float:
        found = answer(cells, "quasi-interpolant")
        exact = np.sinh(1 - found.times) / math.cosh(1)
        return float(np.abs(found.costates[:, 0] - exact).max())

    def control(cells: int) -> float:
        t = np.linspace(0.25, 0.75, 501)
        error = answer(cells, "quasi-interpolant").control(t)[:, 0] + np.sinh(1 - t) / math.cosh(1)
        return float(np.abs(error).max())

    def state(cells: int) -> float:
        found = answer(cells, "piecewise-linear")
        exact = np.cosh(1 - found.times) / math.cosh(1)
        return float(np.abs(found.state(found.times)[:, 0] - exact).max())

    assert observed(cost, few(order))[-1] == pytest.approx(order, abs=0.25)
    assert observed(costate, (12, 24))[-1] == pytest.approx(order, abs=0.6 if order > 4 else 0.25)
    sizes, least = ((12, 24), 3) if order > 4 else ((24, 48), order)  # rounding is near
    assert observed(control, sizes)[-1] > least - 0.65
    assert observed(state, (12, 24))[-1] == pytest.approx(min(order, 4), abs=0.4)


@pytest.mark.parametrize("name", ORDERS)
def test_few_points_determine_few_ghosts(name: str, lq: str, solve: Any) -> None:
    """No coefficient is left to chance: none is far from the control's values."""
    for cells in (5, 20, 21):
        found = solve(lq, steps=cells, substeps=1, discretization=name, tolerance=1e-12)
        t = np.linspace(0, 1, 301)
        error = np.abs(found.control(t)[:, 0] + np.sinh(1 - t) / math.cosh(1)).max()
        assert error < (1 / cells if SCHEMES[name].order < 3 else 0.1)
    for substeps in (1, 2):
        found = solve(lq, steps=12, substeps=substeps, discretization=name, tolerance=1e-12)
        assert found.success
        assert np.abs(found.coefficients).max() < 60


# Stiff dynamics


def test_stiff_dynamics_need_an_l_stable_scheme(solve: Any) -> None:
    """Steps ten times longer than the fast time scale: rk4 explodes, the trapezoidal rule rings."""
    rate = 1000
    exact = 1 / (rate + math.sqrt(rate**2 + 1))
    t = np.linspace(0.1, 1, 500)

    def answer(name: str, steps: int = 50) -> quito.Solution:
        found: quito.Solution = solve(STIFF, steps=steps, discretization=name)
        return found

    def error(name: str) -> float:
        return float(np.abs(answer(name).state(t)[:, 0] - np.cos(t)).max())

    assert answer("radau").success
    assert error("radau") < 1e-8
    assert abs(answer("radau").cost - exact) < 0.5 * exact
    assert answer("radau").evidence.resimulated_cost == pytest.approx(exact, rel=0.05)
    assert error("trapezoidal") > 1e-2  # it rings
    assert abs(answer("trapezoidal").cost - exact) > 10 * exact
    assert abs(answer("rk4").cost - exact) > 1e5 * exact
    assert answer("radau", 200).cost == pytest.approx(exact, rel=1e-2)


def test_piecewise_constant_controls_limit_the_order_to_two(lq: str, solve: Any) -> None:
    def cost_error(cells: int) -> float:
        found = solve(lq, steps=cells, control="piecewise-constant", tolerance=1e-12)
        return float(abs(found.cost - math.tanh(1) / 2))

    assert observed(cost_error) == pytest.approx(2, abs=0.1)


def extremal() -> tuple[float, Any]:
    """Cost and (x, λ)(t) of NONLINEAR by its boundary value problem: u = −λ2."""

    def flow(t: Array, y: Array) -> Array:
        x1, x2, p1, p2 = y[:4]
        return np.array(
            [
                x2,
                (1 - x1**2) * x2 - x1 - p2,
                -x1 + p2 * (2 * x1 * x2 + 1),
                -x2 - p1 - p2 * (1 - x1**2),
                0.5 * (x1**2 + x2**2 + p2**2),
            ]
        )

    def ends(a: Array, b: Array) -> Array:
        return np.array([a[0] - 1, a[1], b[2], b[3], a[4]])

    mesh = np.linspace(0, 2, 81)
    found = solve_bvp(flow, ends, mesh, np.zeros((5, 81)), tol=1e-10, max_nodes=100_000)
    assert found.success
    return float(found.y[4, -1]), found.sol


def test_the_cost_of_a_nonlinear_problem_converges_with_order_four(solve: Any) -> None:
    cost, curve = extremal()

    def answer(cells: int) -> Any:
        return solve(NONLINEAR, steps=cells, tolerance=1e-12)

    assert observed(lambda cells: abs(answer(cells).cost - cost), (5, 10, 20)) == pytest.approx(
        4, abs=0.4
    )
    fine = answer(80)
    t = fine.times
    assert fine.state(t) == pytest.approx(curve(t)[:2].T, abs=1e-7)
    assert fine.costate(t) == pytest.approx(curve(t)[2:4].T, abs=1e-6)
    assert fine.control(t)[:, 0] == pytest.approx(-curve(t)[3], abs=1e-5)


# Implicit schemes


@pytest.mark.parametrize("name", IMPLICIT)
def test_an_implicit_scheme_on_a_graded_mesh_with_several_states(name: str) -> None:
    cost, curve = extremal()
    mesh = Mesh(np.linspace(0, 1, 31) ** 1.5)
    found = solved(NONLINEAR, 30, SCHEMES[name], 3, "gaussian", mesh)
    assert len(found.trajectory.times) == 30 * 3 + 1
    limit = 2e-3 if name == "trapezoidal" else 1e-5
    assert found.cost == pytest.approx(cost, abs=limit / 10 if limit < 1e-3 else limit)
    t = found.trajectory.times
    assert found.state(t) == pytest.approx(curve(t)[:2].T, abs=limit)
    t = found.times
    assert found.costates == pytest.approx(curve(t)[2:4].T, abs=limit)


CEILING = """
time: {initial: 0, final: 1}
states: {x1: {initial: 0, final: 0}, x2: {initial: 1, final: -1}}
controls: {u: {}}
dynamics: {x1: x2, x2: u}
cost: {lagrange: 0.5*u^2}
constraints: {path: {ceiling: x1 <= 1/9, effort: u*x2 <= 10}}
"""


@pytest.mark.parametrize("name", IMPLICIT)
@pytest.mark.parametrize("path_points", ["nodes", "substeps"])
def test_path_constraints_with_an_implicit_scheme(name: str, path_points: str, solve: Any) -> None:
    """Bryson and Denham's problem, its bound as a constraint: between the ends of steps too."""
    found = solve(CEILING, steps=60, discretization=name, path_points=path_points)
    assert found.success
    assert found.cost == pytest.approx(4, abs=2e-2 if name == "trapezoidal" else 5e-4)
    assert found.evidence.maximum_violation < 1e-3


# What one substep does to a control that the integrator does not resolve


def test_one_substep_lets_the_control_ring_and_two_do_not(solve: Any) -> None:
    """Catalyst mixing, scaled, at a tight tolerance: the true control varies by 1 in all."""
    common = {"steps": 300, "tolerance": 1e-12, "objective_scale": 100.0}
    one = solve("catalyst_mixing", substeps=1, **common)
    two = solve("catalyst_mixing", substeps=2, **common)
    t = np.linspace(0, 4, 6001)

    def variation(solution: Any) -> float:
        return float(np.abs(np.diff(solution.control(t)[:, 0])).sum())

    assert one.success
    assert two.success
    assert variation(one) > 5
    assert variation(two) <= 1.8
    assert one.evidence.total_variation[0] == pytest.approx(variation(one), rel=0.02)
    assert two.evidence.total_variation[0] == pytest.approx(variation(two), rel=0.02)
    assert one.evidence.ringing[0] > 1000 * two.evidence.ringing[0]
    assert two.evidence.ringing[0] < 2
    assert two.statistics.iterations < one.statistics.iterations
