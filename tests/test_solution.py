"""Answers: against closed forms and verified references, with their evidence and their failures."""

from __future__ import annotations

import math
import os
import re
import signal
from collections.abc import Callable
from dataclasses import FrozenInstanceError, replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import quito_cli as quito
from quito_cli.problem.build import build
from quito_cli.problem.load import load_text
from quito_cli.problem.model import Known, Model
from quito_cli.solution.extract import extract
from quito_cli.solution.trajectory import Trajectory
from quito_cli.solution.violations import Dense, violations
from quito_cli.solvers import Progress, Status, minimise
from quito_cli.transcription.cells import Discretization
from quito_cli.transcription.control import ControlBasis
from quito_cli.transcription.generating import GENERATING_FUNCTIONS, QUASI_INTERPOLANTS
from quito_cli.transcription.mesh import Mesh
from quito_cli.transcription.schemes import SCHEMES
from quito_cli.transcription.transcribe import transcribe

Array = NDArray[np.float64]
Solve = Callable[..., quito.Solution]
Build = Callable[[str], Model]

POSITIVE = ("gaussian", "sech")


def one_state(
    dynamics: str,
    lagrange: str = "0",
    initial: str = "{initial: 1}",
    mayer: str = "0",
    bounds: str = "{lower: -1, upper: 1}",
) -> str:
    return f"""
time: {{initial: 0, final: 1}}
states: {{x: {initial}}}
controls: {{u: {bounds}}}
dynamics: {{x: "{dynamics}"}}
cost: {{lagrange: "{lagrange}", mayer: "{mayer}"}}
"""


DOUBLE_INTEGRATOR = """
time: {initial: 0, final: 1}
states: {x: {initial: 0, final: 10}, v: {initial: 0}}
controls: {u: {lower: -1, upper: 1}}
dynamics: {x: v, v: u}
cost: {lagrange: u^2}
"""
ROTATED = """
title: Two of the linear-quadratic problem at once, seen from a rotated frame
constants: {c: cos(0.7), s: sin(0.7), B: "[[c, -s], [s, c]]"}
time: {initial: 0, final: 1}
states: {x: {size: 2, initial: [1, -2]}}
controls: {u: {size: 2}}
dynamics: {x: B @ u}
cost: {lagrange: "0.5*(dot(x, x) + dot(u, u))"}
"""


# The figures that the first release must reach


def true_control(model: Model, t: Array) -> Array:
    assert model.known is not None
    return Known.sample(model.known.controls, model.controls, t)[:, 0]


def midpoints(end: float, count: int = 200_000) -> Array:
    return (np.arange(count) + 0.5) * end / count


def away(t: Array, junctions: Any, distance: float) -> NDArray[np.bool_]:
    return np.asarray(np.abs(t[:, None] - np.array(junctions)).min(axis=1) > distance)


def test_van_der_pol(solve: Solve, model: Build, reference: Any) -> None:
    facts, _ = reference("van_der_pol")
    solution = solve("van_der_pol", steps=300)
    t = midpoints(4)
    u = solution.control(t)[:, 0]
    error = np.abs(u - true_control(model("van_der_pol"), t))
    assert solution.success
    assert solution.cost == pytest.approx(facts["cost"], abs=5e-5)
    assert math.sqrt(4 * np.mean(error**2)) <= 0.12
    assert error[away(t, facts["switching_times"], 0.08)].max() <= 0.02
    assert np.abs(u).max() <= 1 + 1e-6
    assert solution.state(1.0)[0] == pytest.approx(sampled(reference, "van_der_pol", 1.0), abs=1e-3)


def sampled(reference: Any, name: str, t: float) -> Array:
    _, samples = reference(name)
    at = int(np.argmin(np.abs(samples["t"] - t)))
    assert samples["t"][at] == pytest.approx(t, abs=1e-9)
    return np.asarray(samples["x"][at])


def test_bressan(solve: Solve, reference: Any) -> None:
    facts, samples = reference("bressan")
    solution = solve("bressan", steps=300)
    assert solution.success
    assert solution.cost == pytest.approx(facts["cost"], abs=1e-4)
    far = away(samples["t"], facts["switching_times"], 0.5)
    error = np.abs(solution.control(samples["t"]) - samples["u"])[far]
    assert error.max() <= 0.02
    assert solution.state(samples["t"]) == pytest.approx(samples["x"], abs=5e-3)


def test_catalyst_mixing(solve: Solve, model: Build, reference: Any) -> None:
    facts, _ = reference("catalyst_mixing")
    solution = solve("catalyst_mixing", steps=300, tolerance=1e-12)
    t = midpoints(4)
    u = solution.control(t)[:, 0]
    error = np.abs(u - true_control(model("catalyst_mixing"), t))
    assert solution.success
    assert solution.cost == pytest.approx(facts["cost"], abs=1e-5)
    assert error[away(t, facts["switching_times"], 0.05 * 4)].max() <= 2e-3
    assert error[away(t, facts["switching_times"], 0.10 * 4)].max() <= 2e-4
    assert np.abs(np.diff(u)).sum() <= 1.8
    assert solution.evidence.total_variation[0] <= 1.8


@pytest.mark.parametrize("name", ["bryson_denham", "rayleigh"])
def test_two_problems_at_two_hundred_steps(name: str, solve: Solve, reference: Any) -> None:
    facts, samples = reference(name)
    solution = solve(name, steps=200)
    assert solution.success
    assert solution.cost == pytest.approx(facts["cost"], abs=1e-3)
    assert solution.state(samples["t"]) == pytest.approx(samples["x"], abs=2e-3)
    assert solution.control(samples["t"]) == pytest.approx(samples["u"], abs=0.05)


def test_alychan(solve: Solve) -> None:
    """The cost only: the horizon is the focal point, and the control hardly matters."""
    solution = solve("alychan", steps=100, tolerance=1e-12)
    assert solution.success
    assert solution.cost == pytest.approx(0, abs=1e-8)


def test_bang_bang(solve: Solve, reference: Any) -> None:
    facts, samples = reference("bang_bang")
    solution = solve("bang_bang", steps=200)
    assert solution.success
    assert solution.cost == pytest.approx(facts["cost"], abs=2e-5)
    far = away(samples["t"], facts["switching_times"], 0.02)
    assert np.abs(solution.control(samples["t"]) - samples["u"])[far].max() <= 1e-3


# Bounds


@pytest.mark.parametrize("name", QUASI_INTERPOLANTS)
@pytest.mark.parametrize("problem", ["van_der_pol", "catalyst_mixing", "bang_bang"])
def test_controls_are_within_their_bounds_everywhere(
    name: str, problem: str, solve: Solve, model: Build
) -> None:
    solution = solve(problem, steps=80, generating_function=name)
    assert solution.success
    bounds = model(problem).control_bounds
    u = solution.control(np.linspace(solution.times[0], solution.times[-1], 80 * 41 + 1))
    over = float(max((u - bounds.upper).max(), (bounds.lower - u).max()))
    assert over <= (1e-6 if name in POSITIVE else 5e-3)
    told = [v.amount for v in solution.evidence.violations if v.constraint.startswith("u ")]
    assert len(told) == 2
    assert max(told) == pytest.approx(max(over, 0), rel=0.2, abs=1e-9)


@pytest.mark.parametrize("control", ["piecewise-constant", "piecewise-linear"])
def test_the_classical_controls_are_within_their_bounds(control: str, solve: Solve) -> None:
    solution = solve("van_der_pol", steps=80, control=control)
    assert solution.success
    assert solution.cost == pytest.approx(0.7576179286593919, abs=5e-4)
    assert np.abs(solution.control(np.linspace(0, 4, 2000))).max() <= 1 + 1e-9


def test_state_bounds_hold_at_the_nodes(solve: Solve) -> None:
    solution = solve("bryson_denham", steps=60)
    assert solution.trajectory(solution.times)[:, 0].max() <= 1 / 9 + 1e-8
    worst = next(v for v in solution.evidence.violations if v.constraint.startswith("x1 <="))
    dense = solution.state(np.linspace(0, 1, 6001))[:, 0]
    assert worst.amount == pytest.approx(max(dense.max() - 1 / 9, 0), rel=0.05, abs=1e-9)


def test_a_control_held_by_its_bounds_is_held_for_every_function(solve: Solve) -> None:
    """lower = upper leaves no freedom, however many rows say so: x = e^t."""
    text = one_state("u*x", "x", bounds="{lower: 1, upper: 1}")
    for name in QUASI_INTERPOLANTS:
        solution = solve(text, steps=10, generating_function=name)
        assert solution.success, (name, solution.evidence.diagnosis)
        assert solution.cost == pytest.approx(math.e - 1, abs=1e-5)


# Costates: λ = ∂V/∂x of the minimisation


def test_costates_of_the_linear_quadratic_problem(lq: str, solve: Solve) -> None:
    solution = solve(lq, steps=40, tolerance=1e-12)
    t = np.linspace(0, 1, 41)
    assert solution.costates.shape == (41, 1)
    riccati = np.tanh(1 - t) * np.cosh(1 - t) / math.cosh(1)
    assert solution.costates[:, 0] == pytest.approx(riccati, abs=1e-8)
    assert solution.costate(t)[:, 0] == pytest.approx(riccati, abs=1e-8)
    assert solution.control(t)[:, 0] == pytest.approx(-riccati, abs=1e-5)


def test_costates_of_alychan(solve: Solve) -> None:
    solution = solve("alychan", steps=100, tolerance=1e-12)
    t = solution.times
    assert solution.costates[:, 2] == pytest.approx(np.ones(101), abs=1e-9)
    assert solution.costates[:, 1] == pytest.approx(np.zeros(101), abs=2e-3)
    assert solution.costates[:, 0] == pytest.approx(-np.cos(t), abs=2e-2)


def test_costates_of_bressan(solve: Solve) -> None:
    solution = solve("bressan", steps=300)
    t = solution.times
    assert solution.costates[:, 2] == pytest.approx(-np.ones(301), abs=1e-9)
    assert solution.costates[:, 1] == pytest.approx(t - 10, abs=1e-7)
    singular = t > 10 / 3 + 0.5
    assert solution.costates[singular, 0] == pytest.approx(np.zeros(singular.sum()), abs=1e-3)
    bang = solution.costates[t < 10 / 3 - 0.5, 0]
    assert (bang > 0).all()  # u = −1 minimises p1 u


@pytest.mark.parametrize(("name", "limit"), [("van_der_pol", 2e-2), ("rayleigh", 2e-2)])
def test_initial_costates_are_those_of_the_boundary_value_problem(
    name: str, limit: float, solve: Solve, reference: Any
) -> None:
    facts, _ = reference(name)
    solution = solve(name, steps=300)
    assert solution.costates[0] == pytest.approx(facts["p0"], abs=limit)


@pytest.mark.parametrize("state", ["x1", "x2"])
def test_costates_are_the_slope_of_the_optimal_cost(state: str, solve: Solve) -> None:
    given: dict[str, Any] = {"steps": 60, "tolerance": 1e-11}
    here = solve("van_der_pol", **given)
    at, step = {"x1": 0.0, "x2": 1.0}[state], 1e-4
    costs = [
        quito.solve("van_der_pol", constants={f"states.{state}.initial": at + s}, **given).cost
        for s in (step, -step)
    ]
    slope = (costs[0] - costs[1]) / (2 * step)
    assert here.costates[0, {"x1": 0, "x2": 1}[state]] == pytest.approx(slope, abs=1e-5)


def test_inner_costates_are_the_slope_of_the_cost_to_go(lq: str, solve: Solve) -> None:
    """From the middle on: the same cells, a problem of its own."""
    whole = solve(lq, steps=40, control="piecewise-constant", tolerance=1e-12)
    x = whole.state(0.5)[0, 0]
    late = load_text(lq.replace("{initial: 0, final: 1}", "{initial: 0.5, final: 1}"), "late.yaml")
    costs = [
        quito.solve(
            late,
            constants={"states.x.initial": x + s},
            steps=20,
            control="piecewise-constant",
            tolerance=1e-12,
        ).cost
        for s in (1e-3, -1e-3)
    ]
    assert whole.costates[20, 0] == pytest.approx((costs[0] - costs[1]) / 2e-3, abs=1e-8)


def test_costates_do_not_depend_on_the_scale_of_the_objective(solve: Solve) -> None:
    one, other = (
        solve("rayleigh", steps=60, objective_scale=scale, tolerance=1e-10) for scale in (1.0, 50.0)
    )
    assert one.costates == pytest.approx(other.costates, abs=1e-5)
    assert one.multipliers["dynamics"] == pytest.approx(other.multipliers["dynamics"], abs=1e-5)
    assert one.cost == pytest.approx(other.cost, abs=1e-8)


def test_a_maximised_cost_is_reported_in_the_sense_of_the_file(lq: str, model: Build) -> None:
    problem = load_text(lq, "test.yaml")
    given = replace(model(lq), sense=-1)
    basis = ControlBasis(GENERATING_FUNCTIONS["hat"], 20, 1.0, True)
    nlp = transcribe(given, Discretization(Mesh.uniform(20), basis, SCHEMES["rk4"], 2), None, None)
    outcome, found = minimise(nlp, "ipopt", 1e-10, 100, {}, None, None)
    solution = extract(problem, nlp, outcome, found, {"tolerance": 1e-10}, 0.0)
    assert solution.cost == pytest.approx(-math.tanh(1) / 2, abs=1e-7)
    assert solution.evidence.recomputed_cost == pytest.approx(solution.cost, abs=1e-12)
    assert solution.evidence.resimulated_cost == pytest.approx(solution.cost, abs=1e-7)
    assert solution.costates[0, 0] == pytest.approx(math.tanh(1), abs=1e-6)
    assert solution.origin.maximize


# States as functions of time


def wave(cells: int, interpolation: Any) -> Trajectory:
    t = np.linspace(0, 2, cells + 1)
    x, slope = np.sin(3 * t)[:, None], 3 * np.cos(3 * t)[:, None]
    return Trajectory(t, x, slope[:-1], slope[1:], interpolation)


@pytest.mark.parametrize(("interpolation", "order"), [("linear", 2), ("cubic", 4)])
def test_the_order_of_the_interpolation(interpolation: str, order: int) -> None:
    t = np.linspace(0, 2, 3001)
    errors = [np.abs(wave(n, interpolation)(t)[:, 0] - np.sin(3 * t)).max() for n in (20, 40)]
    assert math.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.1)


def test_slopes_may_jump_at_nodes() -> None:
    """x' = 1, then −2 + 2 t: pieces up to cubics are exact."""
    times, states = np.array([0.0, 1.0, 3.0]), np.array([[0.0], [1.0], [5.0]])
    trajectory = Trajectory(
        times, states, np.array([[1.0], [0.0]]), np.array([[1.0], [4.0]]), "cubic"
    )
    t = np.linspace(0, 3, 50)
    assert trajectory(t)[:, 0] == pytest.approx(np.where(t < 1, t, 1 + (t - 1) ** 2), abs=1e-13)
    assert trajectory(np.array([-1.0, 4.0]))[:, 0].tolist() == [0, 5]


def test_states_between_the_nodes_are_of_the_order_of_the_scheme(lq: str, solve: Solve) -> None:
    t = np.linspace(0, 1, 2001)
    exact = np.cosh(1 - t) / math.cosh(1)
    errors = [
        np.abs(solve(lq, steps=n, tolerance=1e-12).state(t)[:, 0] - exact).max() for n in (8, 16)
    ]
    assert math.log2(errors[0] / errors[1]) == pytest.approx(4, abs=0.2)
    assert errors[1] < 1e-7


def test_nodes_and_ends_are_hit_exactly(solve: Solve) -> None:
    solution = solve("rayleigh", steps=60)
    assert solution.state(np.array([0.0, 4.5])) == pytest.approx(
        np.array([[-5, -5], [0, 0]]), abs=1e-9
    )
    assert solution.state(solution.trajectory.times) == pytest.approx(
        solution.trajectory.states, abs=1e-12
    )
    assert solution.times == pytest.approx(np.linspace(0, 4.5, 61), abs=1e-13)
    assert solution.dense_times[[0, -1]].tolist() == [0, 4.5]
    assert len(solution.dense_times) == 2001


# Several controls


def test_two_controls_and_two_states_as_vectors(solve: Solve) -> None:
    solution = solve(ROTATED, steps=40, tolerance=1e-12)
    c, s = math.cos(0.7), math.sin(0.7)
    x0, B = np.array([1.0, -2.0]), np.array([[c, -s], [s, c]])
    t = np.linspace(0, 1, 101)
    decay, pull = np.cosh(1 - t) / math.cosh(1), np.sinh(1 - t) / math.cosh(1)
    assert solution.success
    assert solution.cost == pytest.approx(math.tanh(1) / 2 * 5, abs=1e-8)
    assert solution.state(t) == pytest.approx(np.outer(decay, x0), abs=1e-6)
    assert solution.control(t) == pytest.approx(-np.outer(pull, B.T @ x0), abs=1e-4)
    nodes = solution.times
    pull = np.sinh(1 - nodes) / math.cosh(1)
    assert solution.costates == pytest.approx(np.outer(pull, x0), abs=1e-7)
    assert [q.name for q in solution.origin.states] == ["x[0]", "x[1]"]
    assert [q.name for q in solution.origin.controls] == ["u[0]", "u[1]"]
    assert len(solution.evidence.total_variation) == 2
    expected = np.abs(B.T @ x0) * math.tanh(1)
    assert solution.evidence.total_variation == pytest.approx(expected, rel=1e-3)


def test_a_problem_without_controls_is_a_free_initial_value(solve: Solve) -> None:
    """x = x0 e^(−t), ∫(x − 1)² least: x0 = (1 − e⁻¹) / ((1 − e⁻²)/2)."""
    text = """
time: {initial: 0, final: 1}
states: {x: {}}
dynamics: {x: -x}
cost: {lagrange: (x - 1)^2}
"""
    solution = solve(text, steps=20)
    assert solution.success
    best = (1 - math.exp(-1)) / ((1 - math.exp(-2)) / 2)
    assert solution.state(0.0)[0, 0] == pytest.approx(best, abs=1e-6)
    assert solution.control(np.array([0.0, 0.5])).shape == (2, 0)


def test_a_single_cell_will_do(lq: str, solve: Solve) -> None:
    solution = solve(lq, steps=1, substeps=4)
    assert solution.success
    assert solution.cost == pytest.approx(math.tanh(1) / 2, abs=1e-2)


# Evidence


@pytest.mark.parametrize("name", ["van_der_pol", "rayleigh", "bryson_denham", "bang_bang"])
def test_success_is_judged_by_residuals(name: str, solve: Solve) -> None:
    solution = solve(name, steps=60)
    evidence = solution.evidence
    assert solution.success
    assert solution.status is Status.SOLVED
    assert evidence.tolerance == solution.options["tolerance"]
    worst = max(evidence.stationarity, evidence.feasibility, evidence.complementarity)
    assert worst <= 10 * evidence.tolerance
    assert evidence.diagnosis == ()
    assert evidence.recomputed_cost == pytest.approx(solution.cost, abs=1e-14)
    assert evidence.resimulated_cost == pytest.approx(solution.cost, abs=1e-3)
    assert evidence.terminal_gap < 1e-3


def test_the_largest_violation_is_that_of_the_dense_grid(solve: Solve) -> None:
    solution = solve("van_der_pol", steps=40, generating_function="laguerre4")
    amounts = [violation.amount for violation in solution.evidence.violations]
    assert solution.evidence.maximum_violation == max(amounts) > 1e-6
    relative = [violation.relative for violation in solution.evidence.violations]
    assert relative == sorted(relative, reverse=True)
    worst = solution.evidence.violations[0]
    t = np.linspace(0, 4, 40 * 10 + 1)
    over = np.abs(solution.control(t)[:, 0]) - 1
    assert worst.amount == pytest.approx(over.max(), rel=1e-6)
    assert worst.time == pytest.approx(t[int(np.argmax(over))], abs=1e-9)


def test_violations_are_named_timed_and_measured(model: Build) -> None:
    given = model("""
time: {initial: 0, final: 4}
states:
  x: {initial: 1, final: {lower: 2, upper: 3}, lower: -0.5}
  y: {initial: {lower: 0}}
controls: {u: {lower: -1, upper: 2}}
dynamics: {x: u, y: x}
cost: {mayer: x}
""")
    t = np.array([0.0, 1.0, 2.0, 3.0, 4.0])
    x = np.array([1.25, 0.0, -0.75, 0.0, 3.5])
    y = np.array([-2.0, 0.0, 8.0, 0.0, 0.0])
    u = np.array([0.0, 2.5, 0.0, -1.0, 0.0])
    answer = Dense(t, np.column_stack([x, y]), u[:, None], np.zeros(0))
    found = violations(given, answer, np.zeros(1))
    told = {v.constraint: (v.time, v.amount) for v in found if v.amount > 0}
    assert told == {
        "x >= -0.5": (2.0, 0.25),
        "u <= 2": (1.0, 0.5),
        "initial(x) = 1": (0.0, 0.25),
        "final(x) <= 3": (4.0, 0.5),
        "initial(y) >= 0": (0.0, 2.0),
    }
    scales = {v.constraint: v.scale for v in found}
    assert scales["u <= 2"] == 3.0  # its range
    assert scales["x >= -0.5"] == 3.5  # its size
    assert found[0].constraint == "initial(y) >= 0"


def test_a_violation_that_is_undefined_is_infinite(model: Build) -> None:
    given = model("bressan")
    t, u = np.linspace(0, 10, 5), np.zeros((5, 1))
    u[2] = np.nan
    found = violations(given, Dense(t, np.zeros((5, 3)), u, np.zeros(0)), np.zeros(1))
    assert found[0].amount == np.inf
    assert found[0].time == 5.0


def test_counts_and_history(solve: Solve) -> None:
    solution = solve("van_der_pol", steps=60)
    statistics = solution.statistics
    assert statistics.unknowns == 61 * 2 + 61 + 2 * 3
    assert statistics.constraints == 60 * 2
    assert statistics.solver == "ipopt"
    assert statistics.build_seconds > 0
    assert statistics.solve_seconds > 0
    assert statistics.iterations is not None
    assert len(solution.history["objective"]) == statistics.iterations + 1
    assert solution.history["objective"][-1] == pytest.approx(solution.cost, rel=1e-6)
    assert solution.history["primal_infeasibility"][-1] <= 1e-8


def test_every_iteration_is_told(lq: str) -> None:
    told: list[Progress] = []
    solution = quito.solve(load_text(lq, "test.yaml"), steps=20, listener=told.append)
    assert [progress.iteration for progress in told] == list(range(len(told)))
    assert len(told) == (solution.statistics.iterations or 0) + 1
    assert told[-1].cost == pytest.approx(solution.cost, rel=1e-9)
    assert told[-1].violation <= 1e-9


def test_a_solve_says_nothing(capfd: pytest.CaptureFixture[str]) -> None:
    quito.solve("van_der_pol", steps=20)
    assert capfd.readouterr() == ("", "")


def test_an_answer_is_frozen(solve: Solve) -> None:
    solution = solve("van_der_pol", steps=60)
    for owner, name in (
        (solution, "cost"),
        (solution, "success"),
        (solution.evidence, "warnings"),
        (solution.statistics, "iterations"),
        (solution.origin, "name"),
        (solution.trajectory, "states"),
        (solution.basis, "variance"),
        (solution.evidence.violations[0], "amount"),
    ):
        with pytest.raises((FrozenInstanceError, AttributeError)):
            setattr(owner, name, None)


def test_the_resolved_options_are_kept(solve: Solve) -> None:
    options = solve("van_der_pol", steps=60).options
    assert options["steps"] == 60
    assert options["variance"] == 2.0
    assert options["substeps"] == 2
    assert options["generating_function"] == "gaussian"
    assert options["discretization"] == "rk4"


# Failures, in words


def test_an_infeasible_problem_names_constraint_time_and_amount(solve: Solve) -> None:
    solution = solve(DOUBLE_INTEGRATOR, steps=30)
    assert solution.status is Status.INFEASIBLE
    assert not solution.success
    worst, hint, ended = solution.evidence.diagnosis
    assert worst.startswith("Most violated: the dynamics of ")
    assert " t = " in worst
    assert "No trajectory was found" in hint
    assert ended == "Integrated with this control, x ends at 0.5 where 10 is asked for."
    layout = solution.multipliers["dynamics"].shape
    assert layout == (30, 2)
    assert solution.evidence.feasibility > 0.1
    assert solution.evidence.resimulation_gap > 0.5
    assert solution.evidence.terminal_gap > 0.5


def test_the_named_constraint_is_the_worst_one(solve: Solve) -> None:
    """x must move by 10 in no time at all: recompute the defects and find the same place."""
    text = one_state("u", "u^2", initial="{initial: 0, final: 10}")
    solution = solve(text, steps=7)
    trajectory = solution.trajectory
    nodes = trajectory.states[::2, 0]
    midtimes = (solution.times[:-1] + solution.times[1:]) / 2
    moved = [
        float(np.mean(solution.control(np.linspace(m - 1 / 14, m + 1 / 14, 2001)[1:-1]))) / 7
        for m in midtimes
    ]
    defects = np.abs(np.diff(nodes) - moved)
    said = re.fullmatch(
        r"Most violated: the dynamics of x, by ([\d.e+-]+) at t = ([\d.e+-]+)\.",
        solution.evidence.diagnosis[0],
    )
    assert said
    assert float(said[1]) == pytest.approx(defects.max(), rel=1e-2)
    assert defects[round(7 * float(said[2])) - 1] == pytest.approx(defects.max(), rel=1e-2)
    assert solution.evidence.feasibility == pytest.approx(defects.max(), rel=1e-2)


def test_the_iteration_limit_is_told(solve: Solve) -> None:
    solution = solve("van_der_pol", steps=40, max_iterations=3)
    assert solution.status is Status.ITERATION_LIMIT
    assert not solution.success
    assert solution.statistics.iterations == 3
    assert "--max-iterations" in solution.evidence.diagnosis[-1]
    assert np.isfinite(solution.control(np.linspace(0, 4, 9))).all()


def test_no_iteration_at_all_is_a_limit_too(solve: Solve) -> None:
    solution = solve("van_der_pol", steps=10, max_iterations=0)
    assert not solution.success
    assert solution.evidence.diagnosis


def undefined(solution: quito.Solution) -> str:
    assert solution.status is Status.NOT_FINITE
    assert not solution.success
    assert solution.evidence.diagnosis
    return " ".join(solution.evidence.diagnosis)


def test_undefined_dynamics_are_named_with_node_and_values(solve: Solve) -> None:
    text = one_state("log(x) + u", "u^2", initial="{initial: -1}")
    said = undefined(solve(text, steps=20))
    assert "dynamics.x is not finite at node 0, t = 0: x = -1, u = 0." in said


def test_dynamics_that_become_undefined_later_are_named_at_their_node(solve: Solve) -> None:
    """The line from 1 to −1 is the guess: at node 11 of 20 it is below zero."""
    text = one_state("sqrt(x) - 4 + u", "u^2", initial="{initial: 1, final: -1}")
    said = undefined(solve(text, steps=20))
    assert "dynamics.x is not finite at node 11, t = 0.55: x = -0.1, u = 0." in said


def test_an_undefined_running_cost_is_named(solve: Solve) -> None:
    said = undefined(solve(one_state("u", "sqrt(x) + u^2", initial="{initial: -1}"), steps=20))
    assert "cost.lagrange is not finite at node 0, t = 0" in said


def test_an_undefined_end_cost_is_named(solve: Solve) -> None:
    text = one_state("u", "u^2", initial="{initial: -1}", mayer="log(x)")
    assert "cost.mayer" in undefined(solve(text, steps=20))


def test_an_infinite_slope_is_named(solve: Solve) -> None:
    """√x is finite at its guess 0, its derivative is not."""
    said = undefined(solve(one_state("u", "sqrt(x) + u^2", initial="{initial: 0}"), steps=20))
    assert "cost.lagrange" in said


def test_dynamics_undefined_between_the_nodes_are_named(solve: Solve) -> None:
    text = one_state("u - 5*sqrt(x)", "(u + 1)^2", initial="{initial: 0.1}")
    assert "dynamics.x" in undefined(solve(text, steps=20))


def test_what_is_undefined_violates_nothing_that_holds(solve: Solve) -> None:
    """The slopes are undefined; the initial value stands where it was put."""
    text = one_state("log(x) + u", "u^2", initial="{initial: -1}")
    solution = solve(text, steps=20)
    assert solution.state(0.0)[0, 0] == -1
    initial = next(v for v in solution.evidence.violations if v.constraint == "initial(x) = -1")
    assert initial.amount == 0


@pytest.mark.parametrize(
    "text",
    [
        one_state("1/x + u", "u^2", initial="{initial: 0}"),
        one_state("exp(1000*x)*u", "u^2"),
        one_state("log(x)*u", "1/(x - 1)"),
        one_state("100*x^3 + u", "x^2 + u^2", initial="{initial: 1, final: 0}"),
    ],
)
def test_poles_and_overflow_end_in_an_answer_without_warnings(text: str, solve: Solve) -> None:
    solution = solve(text, steps=20)
    assert not solution.success
    assert solution.evidence.diagnosis


def test_more_conditions_than_controls_are_told_quietly(
    capfd: pytest.CaptureFixture[str],
) -> None:
    text = """
time: {initial: 0, final: 1}
states: {x: {initial: 1, final: 2}, y: {initial: 0, final: 1}}
controls: {u: {lower: 1, upper: 1}}
dynamics: {x: u*x, y: u}
cost: {lagrange: x^2 + u^2}
"""
    solution = quito.solve(load_text(text, "test.yaml"), steps=10)
    assert not solution.success
    assert solution.evidence.diagnosis
    assert capfd.readouterr() == ("", "")


def test_an_interruption_keeps_the_best_iterate() -> None:
    seen: list[Progress] = []

    def listen(progress: Progress) -> None:
        seen.append(progress)
        if progress.iteration == 8:
            os.kill(os.getpid(), signal.SIGINT)

    before = signal.getsignal(signal.SIGINT)
    solution = quito.solve("van_der_pol", steps=60, listener=listen)
    assert signal.getsignal(signal.SIGINT) is before
    assert solution.status is Status.INTERRUPTED
    assert not solution.success
    assert len(seen) < 15
    feasible = [progress.cost for progress in seen if progress.violation <= 1e-6]
    if feasible:
        assert solution.cost == pytest.approx(min(feasible), rel=1e-12)
    else:
        least = min(progress.violation for progress in seen)
        assert solution.evidence.feasibility == pytest.approx(least, rel=1e-6)


def test_an_option_that_the_solver_does_not_know_is_refused() -> None:
    for name, value in (("no_such_option", 1), ("mu_strategy", "sideways")):
        with pytest.raises(quito.UsageError, match="IPOPT"):
            quito.solve("bang_bang", steps=5, solver_options={name: value})


def test_options_reach_the_solver() -> None:
    solution = quito.solve("van_der_pol", steps=30, solver_options={"max_iter": 2})
    assert solution.statistics.iterations == 2


def test_a_built_model_is_what_was_solved(model: Build) -> None:
    """The same problem by name and by its own text gives the same answer."""
    text = quito.load("bang_bang").text
    one, other = (
        quito.solve("bang_bang", steps=20),
        quito.solve(load_text(text, "a.yaml"), steps=20),
    )
    assert one.cost == other.cost
    assert build(quito.load("bang_bang")).n_x == model("bang_bang").n_x == 1


def test_a_control_that_rings_is_told(solve: Solve) -> None:
    """Catalyst mixing with one substep, at a tolerance that lets it."""
    loud = solve("catalyst_mixing", substeps=1, tolerance=1e-12)
    assert loud.evidence.ringing[0] > 100
    (warning,) = (w for w in loud.evidence.warnings if w.startswith("u rings"))
    assert "--substeps" in warning
    calm = solve("catalyst_mixing", tolerance=1e-12)
    assert not [w for w in calm.evidence.warnings if "rings" in w]
