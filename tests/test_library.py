"""Every bundled problem, solved as its file asks: against its reference, or for want of one against
its own conditions, written down here a second time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar

import quito_cli as quito
from quito_cli.problem.library import bundled

Array = NDArray[np.float64]
Solve = Callable[..., quito.Solution]

REFERENCE = Path(__file__).parent / "reference"

COST = 1e-4
"""Relative tolerance of the cost: a jump of the control costs a uniform mesh about that much."""
OTHER_COST = {
    "lotka_volterra_fishing": 5e-4,  # several jumps, the last onto a singular arc
}
CONTROL = 5e-3
"""Tolerance of the control away from its junctions, over its range."""
OTHER_CONTROL = {
    "alychan": 2e-2,  # nearly degenerate: a control error of c costs as little as c^3/6
    "double_integrator_tracking": 5e-2,  # falls to zero in a last layer thinner than a cell
}
AWAY = 0.03
"""How far from a junction that is, over the horizon."""
EXPECTED_WARNINGS = {
    # Unstable: an error grows by e^22 over the horizon; the description explains it.
    "inverted_pendulum": ("re-simulated states differ", "misses the final conditions"),
}
FEASIBLE = 1e-3
"""By how much of its size an obstacle may be cut into between the points of the program."""


@pytest.mark.parametrize("name", bundled())
def test_a_bundled_problem_solves_by_itself(name: str, solve: Solve) -> None:
    problem, solution = quito.load(name), solve(name)
    assert solution.success
    assert problem.title
    assert problem.source
    assert problem.description
    expected = EXPECTED_WARNINGS.get(name, ())
    for warning in solution.evidence.warnings:
        assert any(text in warning for text in expected), warning
    assert not expected or "warn" in problem.description
    known = solution.reference
    if known is None or known.cost is None:
        return
    tolerance = OTHER_COST.get(name, COST) * (abs(known.cost) or 1.0)
    assert solution.cost == pytest.approx(known.cost, abs=tolerance, rel=0)
    if expected:  # what warns of its re-simulation is right at the points of the program alone
        return
    assert solution.evidence.resimulated_cost == pytest.approx(known.cost, abs=tolerance, rel=0)


@pytest.mark.parametrize("name", bundled())
def test_its_control_is_the_known_one_away_from_the_junctions(name: str, solve: Solve) -> None:
    solution = solve(name)
    if solution.reference is None:
        return
    t, u = known_control(name, solution)
    far = np.ones(len(t), dtype=bool)
    for junction in solution.reference.switching_times:
        far &= np.abs(t - junction) > AWAY * (solution.times[-1] - solution.times[0])
    assert far.mean() > 0.5
    for i in np.flatnonzero(np.isfinite(u).all(axis=0)):
        size = np.ptp(u[:, i]) or 1.0
        error = np.abs(solution.control(t[far])[:, i] - u[far, i]).max() / size
        assert error < OTHER_CONTROL.get(name, CONTROL), solution.origin.controls[i].name


def known_control(name: str, solution: quito.Solution) -> tuple[Array, Array]:
    """Return times and what is known of the control then: verified samples, or the file's own."""
    assert solution.reference is not None
    if not (REFERENCE / f"{name}.npz").exists():
        return solution.dense_times, solution.reference.controls
    with np.load(REFERENCE / f"{name}.npz") as samples:
        return samples["t"], samples["u"]


def simulated(
    solution: quito.Solution, flow: Callable[[Array, Array], tuple[Array, float]]
) -> tuple[Array, float]:
    """Integrate (x, u) ↦ (x', running cost) with the answer's control; return final x and cost."""

    def along(t: float, y: Array) -> Array:
        return np.append(*flow(y[:-1], solution.control(t)[0]))

    start = np.append(solution.state(solution.times[0])[0], 0.0)
    y = solve_ivp(along, solution.times[[0, -1]], start, "DOP853", rtol=1e-8, atol=1e-8).y[:, -1]
    return y[:-1], float(y[-1])


def assert_within(values: Array, lower: float, upper: float) -> None:
    slack = FEASIBLE * (upper - lower)
    assert values.min() >= lower - slack
    assert values.max() <= upper + slack


# The robot


def test_the_robot_keeps_clear_of_the_discs(solve: Solve) -> None:
    solution = solve("robot_path")
    x = solution.state(np.linspace(0, 10, 20_001))
    for centre in ((40, 20), (55, 40), (45, 65)):
        distance = np.hypot(x[:, 0] - centre[0], x[:, 1] - centre[1])
        assert distance.min() >= 10 * (1 - FEASIBLE)
        assert distance.max() <= 80
    assert_within(x[:, :2], 0, 80)
    assert_within(x[:, 2:], -10, 10)
    assert x[0, :2] == pytest.approx([40, 5], abs=1e-8)
    assert x[-1, :2] == pytest.approx([55, 70], abs=1e-8)
    assert solution.evidence.resimulation_gap < 1e-6
    end, cost = simulated(solution, lambda x, u: (np.append(x[2:], u), float(u @ u)))
    assert end[:2] == pytest.approx([55, 70], abs=1e-4)
    assert cost == pytest.approx(solution.cost, rel=1e-4)


def test_the_path_of_the_robot_is_the_spline_over_the_second_disc(solve: Solve) -> None:
    """Least ∫|x''|² through one point p at time s: two cubics, 3 T |p − c(s)|²/(s²(T − s)²).

    c is the straight way. The best point of contact is where the path has the disc's tangent, so
    that p − c(s) points through its centre; the best time of contact is the one of least cost.
    """
    start, way, centre = np.array([40, 5]), np.array([15, 65]), np.array([55, 40])

    def cost(s: float) -> float:
        detour = 10 + float(np.linalg.norm(start + way * s / 10 - centre))
        return 3 * 10 * detour**2 / (s * (10 - s)) ** 2

    best = minimize_scalar(cost, bounds=(3, 8), method="bounded", options={"xatol": 1e-9})
    solution = solve("robot_path")
    assert solution.cost == pytest.approx(best.fun, rel=2e-4)
    assert np.abs(solution.control([0.0, 10.0])).max() < 0.05  # the velocities are free
    t = np.linspace(0, 10, 2001)
    bend = t[np.linalg.norm(solution.control(t), axis=1).argmax()]
    assert bend == pytest.approx(best.x, abs=0.05)


def test_the_path_of_the_robot_does_not_hang_on_the_mesh(solve: Solve) -> None:
    coarse = solve("robot_path")
    fine = quito.solve("robot_path", steps=2 * coarse.mesh.cells, guess=coarse)
    assert fine.success
    assert coarse.cost == pytest.approx(fine.cost, rel=2e-4)


# The fleet

STARTS = ((10, 10, 10), (6, 10, 6), (10, 6, 10))
ENDS = ((0, 0, 0), (2, 0, 0), (0, 2, 0))
SPHERES = (*(((8.3, 8.3, 8), 1.7), ((3, 6.5, 5), 2.7), ((7.3, 2.7, 5), 2.7), ((10, 10, 2), 2.7)),)
SECOND_ONLY = ((1.7, 1.7, 2), 1.7)
BOXES = (((1.7, 1.7, 2), (2, 2, 2)), ((2, 8.5, 5), (2, 3, 5)), ((14, 1, 7.5), (2, 3, 10)))
INERTIA = np.array([[3.45, 0, 1.28e-15], [0, 3.45, 0], [1.28e-15, 0, 2.2]])


def hat(x: Array) -> Array:
    return np.array([[0, x[2], -x[1]], [-x[2], 0, x[0]], [x[1], -x[0], 0]])


def fleet(x: Array, u: Array) -> tuple[Array, float]:
    """Return x' and the running cost, the vehicles one after another."""
    derivatives: list[Array] = []
    for j in range(3):
        s, r = x[6 * j : 6 * j + 3], x[6 * j + 3 : 6 * j + 6]
        f, q = u[6 * j : 6 * j + 3], u[6 * j + 3 : 6 * j + 6]
        derivatives.append((hat(s) @ r - np.array([0.1, 5, 5]) * s + f) / 10)
        moment = hat(INERTIA @ r) @ r - np.array([5, 5, 0.1]) * r + q
        derivatives.append(np.linalg.solve(INERTIA, moment))
    price = np.tile([1, 1, 1, 50, 50, 50], 3) @ x**2 + np.tile([1, 10, 10, 1, 5, 10], 3) @ u**2
    return np.concatenate(derivatives), float(price)


def test_hat_is_the_cross_product_turned_round() -> None:
    x, y = np.array([1.0, 2.0, -3.0]), np.array([0.5, -1.0, 4.0])
    assert hat(x) @ y == pytest.approx(np.cross(y, x))


def clearances(x: Array) -> Iterator[tuple[str, float]]:
    """Yield the least distances from every obstacle, over what they have to be."""
    places = [x[:, 6 * j : 6 * j + 3] for j in range(3)]
    for j, s in enumerate(places):
        for centre, radius in (*SPHERES, *((SECOND_ONLY,) if j == 1 else ())):
            distance = np.linalg.norm(s - np.array(centre), axis=1)
            yield f"sphere at {centre}, vehicle {j + 1}", float(distance.min()) / radius
        for centre, sides in BOXES:
            inside = np.linalg.norm((s - np.array(centre)) / np.array(sides), ord=10, axis=1)
            yield f"box at {centre}, vehicle {j + 1}", float(inside.min())
    for i, j in ((0, 1), (0, 2), (1, 2)):
        apart = np.linalg.norm(places[i] - places[j], axis=1)
        yield f"vehicles {i + 1} and {j + 1}", float(apart.min()) / np.sqrt(2)


def test_the_fleet_keeps_clear_of_obstacles_and_of_one_another(solve: Solve) -> None:
    solution, t = solve("auv_fleet"), np.linspace(0, 10, 10_001)
    x, u = solution.state(t), solution.control(t)
    for what, clearance in clearances(x):
        assert clearance >= 1 - FEASIBLE, what
    for j in range(3):
        assert_within(x[:, 6 * j : 6 * j + 3], 0, 15)
        assert_within(x[:, 6 * j + 3 : 6 * j + 6], -np.pi, np.pi)
    assert_within(u, -100, 100)
    nothing = (0, 0, 0)
    ends = [np.concatenate([(*s, *nothing) for s in given]) for given in (STARTS, ENDS)]
    assert x[[0, -1]] == pytest.approx(np.array(ends), abs=1e-6)


def test_the_fleet_moves_by_its_dynamics(solve: Solve) -> None:
    solution = solve("auv_fleet")
    assert solution.evidence.resimulation_gap < 1e-4
    end, cost = simulated(solution, fleet)
    assert end == pytest.approx(solution.state(10.0)[0], abs=1e-3)
    assert cost == pytest.approx(solution.cost, rel=1e-4)


def test_the_cost_of_the_fleet_does_not_hang_on_the_mesh(solve: Solve) -> None:
    """Twice the cells with the obstacles at nodes alone, which are then closer together."""
    coarse = solve("auv_fleet")
    cells = 2 * coarse.mesh.cells
    fine = quito.solve("auv_fleet", steps=cells, path_points="nodes", guess=coarse)
    assert fine.success
    assert coarse.cost == pytest.approx(fine.cost, rel=1e-3)
