"""The whole problem language, solved: every answer against a closed form or an independent one."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

import quito_cli as quito
from quito_cli.problem.load import load_text
from quito_cli.problem.model import Model
from quito_cli.transcription.cells import Discretization, PathPoints
from quito_cli.transcription.control import ControlBasis
from quito_cli.transcription.generating import GENERATING_FUNCTIONS
from quito_cli.transcription.mesh import Mesh
from quito_cli.transcription.schemes import SCHEMES
from quito_cli.transcription.transcribe import Nlp, transcribe

Array = NDArray[np.float64]
Solve = Callable[..., quito.Solution]
Build = Callable[[str], Model]


def scalar(
    states: str = "x: {initial: 0}",
    controls: str = "u: {}",
    dynamics: str = "x: u",
    cost: str = "lagrange: u^2",
    time: str = "initial: 0, final: 1",
    more: str = "",
) -> str:
    """A problem in a few words."""
    return f"""
time: {{{time}}}
states: {{{states}}}
controls: {{{controls}}}
dynamics: {{{dynamics}}}
cost: {{{cost}}}
{more}
"""


def path(constraint: str) -> str:
    return f'constraints: {{path: {{limit: "{constraint}"}}}}'


def transcribed(
    model: Model, path_points: PathPoints | None = None, cells: int = 6, substeps: int = 2
) -> Nlp:
    basis = ControlBasis(GENERATING_FUNCTIONS["gaussian"], cells, 2.0, True)
    points = np.array([c.at for c in model.constraints.point], dtype=float)
    method = Discretization(Mesh.through(cells, points), basis, SCHEMES["rk4"], substeps)
    return transcribe(model, method, None, path_points)


def violation(solution: quito.Solution, name: str) -> float:
    """What the evidence says of one condition."""
    found = [v for v in solution.evidence.violations if v.constraint.startswith(name)]
    assert len(found) == 1, [v.constraint for v in solution.evidence.violations]
    return found[0].amount


# Free times

SHORTEST = scalar(
    "x: {initial: 0, final: 1}, v: {initial: 0, final: 0}",
    "u: {lower: -1, upper: 1}",
    "x: v, v: u",
    "mayer: t",
    "initial: 0, final: {lower: 0.1}",
)
BRACHISTOCHRONE = """
title: Fastest slide from (0, 0) to (10, -5); the angle is that from the vertical
constants: {g: 9.81}
time: {initial: 0, final: {lower: 0.1}}
states: {x: {initial: 0, final: 10}, y: {initial: 0, final: -5}, v: {initial: 0}}
controls: {a: {lower: -1, upper: pi}}
dynamics: {x: v*sin(a), y: -v*cos(a), v: g*cos(a)}
cost: {mayer: t}
"""


def test_the_shortest_time_of_the_double_integrator(solve: Solve) -> None:
    """T = 2 √distance, so that dT/dx0 = −1 and dT/dv0 = −1 (v helps for one unit of time)."""
    exact = solve(SHORTEST, steps=20, control="piecewise-constant", tolerance=1e-11)
    assert exact.success
    assert exact.cost == pytest.approx(2, abs=1e-9)
    assert exact.times == pytest.approx(np.linspace(0, 2, 21), abs=1e-9)
    assert exact.control(np.array([0.5, 1.5]))[:, 0] == pytest.approx([1, -1], abs=1e-9)
    t = exact.times
    assert exact.costates == pytest.approx(np.column_stack([-np.ones(21), t - 1]), abs=1e-6)
    assert exact.origin.free_times
    smooth = solve(SHORTEST, steps=100)
    assert smooth.success
    assert 2 - 1e-9 <= smooth.cost <= 2.001  # a jump is a few cells wide
    assert smooth.evidence.resimulation_gap < 1e-5


def cycloid() -> tuple[float, float, float]:
    """Radius, final angle and time of the cycloid through (10, −5)."""
    angle: float = brentq(lambda a: (a - math.sin(a)) - 2 * (1 - math.cos(a)), 1, 6, xtol=1e-14)
    radius = 5 / (1 - math.cos(angle))
    return radius, angle, angle * math.sqrt(radius / 9.81)


@pytest.mark.parametrize("guess", ["", ", guess: 5*t"], ids=["none", "given"])
def test_the_brachistochrone_is_a_cycloid(guess: str, solve: Solve) -> None:
    radius, angle, time = cycloid()
    assert time == pytest.approx(1.80129548301372, abs=1e-13)
    text = BRACHISTOCHRONE.replace("v: {initial: 0}", f"v: {{initial: 0{guess}}}")
    found = solve(text, steps=40)
    assert found.success
    assert found.cost == pytest.approx(time, abs=1e-8)
    t = np.linspace(0, time, 101)
    phi = angle * t / time
    x, y = radius * (phi - np.sin(phi)), -radius * (1 - np.cos(phi))
    expected = np.column_stack([x, y, np.sqrt(-2 * 9.81 * y)])
    assert found.state(t) == pytest.approx(expected, abs=1e-4)
    assert found.control(t[5:-5])[:, 0] == pytest.approx(phi[5:-5] / 2, abs=1e-2)
    if guess:
        assert (found.statistics.iterations or 0) < 40


def test_a_free_initial_time(solve: Solve) -> None:
    """½∫u² over h = 2 − t0 costs 1/(2h); with (t0 − 0.3)² the best t0 is a root."""
    text = scalar(
        "x: {initial: 0, final: 1}",
        cost="lagrange: 0.5*u^2, mayer: (initial(t) - 0.3)^2",
        time="initial: {lower: -3, upper: 1.5}, final: 2",
    )
    start: float = brentq(lambda a: 1 / (2 * (2 - a) ** 2) + 2 * (a - 0.3), -3, 1, xtol=1e-14)
    found = solve(text, steps=10, tolerance=1e-11)
    assert found.success
    assert found.times[0] == pytest.approx(start, abs=1e-8)
    assert found.times[-1] == 2
    assert found.cost == pytest.approx(1 / (2 * (2 - start)) + (start - 0.3) ** 2, abs=1e-11)
    assert found.control(1.0)[0, 0] == pytest.approx(1 / (2 - start), abs=1e-7)


def test_both_times_free_and_time_in_the_cost(solve: Solve) -> None:
    """From 1 − s to 1 + s at 1/(4s) + 4 s³/3: s = ½, cost ⅔."""
    text = scalar(
        "x: {initial: 0, final: 1}",
        cost="lagrange: 0.5*u^2 + 2*(t - 1)^2",
        time="initial: {lower: -2, upper: 3, guess: 0}, final: {lower: 3.5, upper: 9, guess: 4}",
    )
    # Its lower bound keeps the final time from the optimum: first without, then with.
    free = solve(text.replace("lower: 3.5, upper: 9, guess: 4", "lower: -1, guess: 2"), steps=10)
    assert free.success
    assert free.times[[0, -1]] == pytest.approx([0.5, 1.5], abs=1e-6)
    assert free.cost == pytest.approx(2 / 3, abs=1e-10)
    held = solve(text, steps=10)
    assert held.times[-1] == pytest.approx(3.5, abs=1e-7)
    # From a to 3.5: 1/(2(3.5 − a)) + ⅔(2.5³ + (1 − a)³); its slope in a vanishes.
    start: float = brentq(lambda a: 1 / (2 * (3.5 - a) ** 2) - 2 * (1 - a) ** 2, 0, 1, xtol=1e-14)
    assert held.times[0] == pytest.approx(start, abs=1e-6)


GODDARD = """
title: Goddard's rocket, as high as its fuel takes it
constants: {b: 2, D0: 310, beta: 500}
time: {initial: 0, final: {lower: 0.05, guess: 0.2}}
states:
  h: {initial: 1, lower: 1}
  v: {initial: 0, lower: 0, guess: 0.1*t}
  m: {initial: 1, final: 0.6, lower: 0.6, upper: 1}
controls: {T: {lower: 0, upper: 3.5}}
expressions: {drag: D0*v^2*exp(-beta*(h - 1))}
dynamics: {h: v, v: (T - drag)/m - 1/h^2, m: -b*T}
sense: maximize
cost: {mayer: h}
"""


def test_a_rocket_as_high_as_it_goes(solve: Solve) -> None:
    """1.01283 in E. D. Dolan, J. J. Moré and T. S. Munson, COPS 3.0 (2004), and elsewhere."""
    found = solve(GODDARD, steps=100)
    assert found.success
    assert found.cost == pytest.approx(1.01283, abs=1e-5)
    assert found.state(found.times[-1])[0, 1] == pytest.approx(0, abs=1e-3)  # at the top
    assert found.evidence.resimulated_cost == pytest.approx(found.cost, abs=1e-7)


def test_a_time_scale_of_days_changes_nothing(solve: Solve) -> None:
    """x'' = u/T², over about 2 T = 172 800 seconds."""
    text = SHORTEST.replace("x: v, v: u", "x: v/86400, v: u/86400").replace("0.1", "1000")
    found = solve(text, steps=20, control="piecewise-constant", tolerance=1e-10)
    assert found.success
    assert found.cost == pytest.approx(2 * 86400, rel=1e-9)


# Matrices, and costates by Riccati's equation

QUADRATIC = """
constants:
  A: [[0, 1, 0], [-1, -0.2, 0.5], [0, 0, -1]]
  B: [[0, 0], [1, 0.3], [0, 1]]
  Q: [[2, 0.5, 0], [0.5, 1, 0], [0, 0, 1]]
  R: [[1, 0.2], [0.2, 0.5]]
  S: diag([1, 2, 0.5])
time: {initial: 0, final: 2}
states: {x: {size: 3, initial: [1, -0.5, 2]}}
controls: {u: {size: 2}}
dynamics: {x: A @ x + B @ u}
cost: {lagrange: "0.5*(dot(x, Q @ x) + dot(u, R @ u))", mayer: "0.5*dot(x, S @ x)"}
"""


def test_a_linear_quadratic_problem_and_its_riccati_equation(solve: Solve) -> None:
    A = np.array([[0, 1, 0], [-1, -0.2, 0.5], [0, 0, -1]])
    B = np.array([[0, 0], [1, 0.3], [0, 1]])
    Q, S = np.array([[2, 0.5, 0], [0.5, 1, 0], [0, 0, 1]]), np.diag([1, 2, 0.5])
    gain = np.linalg.solve(np.array([[1, 0.2], [0.2, 0.5]]), B.T)

    def riccati(_: float, flat: Array) -> Array:
        P = flat.reshape(3, 3)
        return np.asarray(A.T @ P + P @ A - P @ B @ gain @ P + Q).ravel()

    exact = {"rtol": 1e-12, "atol": 1e-13, "dense_output": True}
    back = solve_ivp(riccati, (0, 2), S.ravel().astype(float), "DOP853", **exact).sol

    def P(t: float) -> Array:
        return np.asarray(back(2 - t)).reshape(3, 3)

    start = np.array([1, -0.5, 2])
    forward = solve_ivp(lambda t, x: (A - B @ gain @ P(t)) @ x, (0, 2), start, "DOP853", **exact)
    found = solve(QUADRATIC, steps=80, tolerance=1e-12)
    t = found.times
    x = forward.sol(t).T
    costates = np.array([P(at) @ state for at, state in zip(t, x, strict=True)])
    assert found.success
    assert found.cost == pytest.approx(0.5 * start @ P(0) @ start, abs=1e-8)
    assert found.state(t) == pytest.approx(x, abs=1e-6)
    assert found.costates == pytest.approx(costates, abs=1e-6)
    assert found.control(t) == pytest.approx(-costates @ gain.T, abs=1e-3)


# Integral constraints

AREA = scalar(
    "x: {initial: 0, final: 0}",
    "u: {guess: 1 - 2*t}",
    cost="lagrange: x",
    more="""
constants: {L: 1.2}
sense: maximize
constraints: {integral: {length: sqrt(1 + u^2) == L}}
""",
)


def test_the_largest_area_is_under_a_circular_arc(solve: Solve) -> None:
    """Chord 2 R sin φ = 1, arc 2 R φ = 1.2, area R²(φ − sin φ cos φ); d area / d length = R."""
    phi: float = brentq(lambda a: a / math.sin(a) - 1.2, 0.1, 3, xtol=1e-14)
    radius = 0.6 / phi
    area = radius**2 * (phi - math.sin(phi) * math.cos(phi))
    found = solve(AREA, steps=40)
    assert found.success
    assert found.cost == pytest.approx(area, abs=1e-6)
    t = np.linspace(0, 1, 101)
    arc = np.sqrt(radius**2 - (t - 0.5) ** 2) - radius * math.cos(phi)
    assert found.state(t)[:, 0] == pytest.approx(arc, abs=1e-4)
    (multiplier,) = found.multipliers["integral constraint length"].ravel()
    assert multiplier == pytest.approx(radius, abs=1e-4)  # of minimising −area
    assert violation(found, "length") < 1e-6


FUEL = scalar(
    "x: {initial: 0, final: 1}, v: {initial: 0, final: 0}",
    dynamics="x: v, v: u",
    cost="mayer: t",
    time="initial: 0, final: {lower: 0.1}",
    more="constraints: {integral: {fuel: u^2 <= 1.5}}",
)


def test_a_budget_of_fuel(solve: Solve) -> None:
    """From rest to rest over one in time T takes ∫u² = 12/T³; with a budget E, dT/dE = −T/(3E)."""
    found = solve(FUEL, steps=20, tolerance=1e-11)
    assert found.success
    assert found.cost == pytest.approx(2, abs=1e-6)
    (multiplier,) = found.multipliers["integral constraint fuel"].ravel()
    assert multiplier == pytest.approx(2 / 4.5, abs=1e-5)
    t = np.linspace(0, 2, 51)
    assert found.control(t)[:, 0] == pytest.approx(1.5 * (1 - t), abs=1e-3)


@pytest.mark.parametrize(
    "text", ["1.5 >= u^2", "0 <= u^2 <= 1.5", "u^2 + v*0 <= E", "E >= u^2 >= 0.1"]
)
def test_an_integral_on_either_side_or_between(text: str, solve: Solve) -> None:
    other = FUEL.replace("u^2 <= 1.5", text) + "constants: {E: 3/2}"
    given = {"steps": 20, "tolerance": 1e-11}
    assert solve(other, **given).cost == pytest.approx(solve(FUEL, **given).cost, abs=1e-9)


def test_an_integral_constraint_that_cannot_be_met_is_named(solve: Solve) -> None:
    found = solve(FUEL.replace("{lower: 0.1}", "{lower: 0.1, upper: 1}"), steps=10)
    assert not found.success
    assert found.evidence.diagnosis


# Parameters and tables


def fit(method: str, x: Array, y: Array, dynamics: str = "p", start: float = 0.0) -> str:
    return f"""
time: {{initial: 0, final: 2}}
states: {{x: {{initial: {start}}}}}
parameters: {{p: {{lower: -5, upper: 5}}}}
tables: {{data: {{x: {x.tolist()}, y: {y.tolist()}, method: {method}}}}}
dynamics: {{x: "{dynamics}"}}
cost: {{lagrange: "(x - interpolate(t, data))^2"}}
"""


def test_a_parameter_fitted_to_a_linear_table(solve: Solve) -> None:
    """∫(p t − y)² least: p = ∫t y / ∫t² = (17/6)/(8/3), and 11/3 − p 17/6 is left."""
    text = fit("linear", np.array([0, 1, 2]), np.array([0, 2, 1]))
    found = solve(text, steps=10, tolerance=1e-12)
    assert found.success
    assert found.parameters == pytest.approx([17 / 16], abs=1e-9)
    assert found.cost == pytest.approx(11 / 3 - 17 / 16 * 17 / 6, abs=1e-9)
    assert [q.name for q in found.origin.parameters] == ["p"]


def test_a_rate_fitted_to_a_cubic_table(solve: Solve) -> None:
    """Samples of e^(−0.7 t): the rate comes back to the accuracy of the spline."""
    t = np.linspace(0, 2, 21)
    text = fit("cubic", t, np.exp(-0.7 * t), "-p*x", 1.0)
    found = solve(text, steps=20, tolerance=1e-12)
    assert found.success
    assert found.parameters == pytest.approx([0.7], abs=1e-6)
    assert found.cost == pytest.approx(0, abs=1e-7)
    coarse = solve(fit("linear", t, np.exp(-0.7 * t), "-p*x", 1.0), steps=20, tolerance=1e-12)
    assert 1e-5 < abs(coarse.parameters[0] - 0.7) < 1e-2  # chords lie above a convex curve


def test_a_vector_of_parameters_at_its_bounds(solve: Solve) -> None:
    """x' = p[0] + p[1] t against 1 + t: free, then with p[0] held at 1/2 at most."""
    text = """
time: {initial: 0, final: 1}
states: {x: {initial: 0}}
parameters: {p: {size: 2, lower: [-1, null], upper: [3, .inf], guess: [0, 0], scale: [1, 100]}}
dynamics: {x: "p[0] + p[1]*t"}
cost: {lagrange: (x - t - t^2/2)^2}
"""
    free = solve(text, steps=20, tolerance=1e-12)
    assert free.parameters == pytest.approx([1, 1], abs=1e-5)
    held = solve(text.replace("upper: [3", "upper: [0.5"), steps=20, tolerance=1e-12)
    # ∫(t/2 + (1 − b) t²/2)²: with d = 1 − b, ∫(t²/2)(t + d t²)/2 = 0, so 1/4 + d/5 = 0.
    assert held.parameters == pytest.approx([0.5, 2.25], abs=1e-6)
    assert held.success


# The sense of the cost


def test_a_maximised_cost(solve: Solve) -> None:
    """max ∫x − u²/2: u = 1 − t, J = 1/6; costates are those of minimising −J."""
    text = scalar(cost="lagrange: x - u^2/2") + "sense: maximize"
    found = solve(text, steps=20, tolerance=1e-11)
    other = solve(scalar(cost="lagrange: u^2/2 - x"), steps=20, tolerance=1e-11)
    t = found.times
    assert found.success
    assert found.cost == pytest.approx(1 / 6, abs=1e-7)
    assert found.cost == pytest.approx(-other.cost, abs=1e-12)
    assert found.evidence.recomputed_cost == pytest.approx(found.cost, abs=1e-13)
    assert found.evidence.resimulated_cost == pytest.approx(1 / 6, abs=1e-7)
    assert found.costates[:, 0] == pytest.approx(t - 1, abs=1e-7)
    assert found.costates == pytest.approx(other.costates, abs=1e-9)
    assert found.history["objective"][-1] == pytest.approx(1 / 6, abs=1e-6)
    assert found.origin.maximize


def test_a_maximised_end_cost(solve: Solve) -> None:
    text = scalar(controls="u: {lower: -1, upper: 2}", cost="mayer: x + initial(x)")
    assert solve(text + "sense: maximize", steps=10).cost == pytest.approx(2, abs=1e-7)
    assert solve(text + "sense: minimize", steps=10).cost == pytest.approx(-1, abs=1e-7)


# Path constraints

DISC = scalar(
    "x: {size: 2, initial: 0}",
    "u: {size: 2}",
    cost='lagrange: "cos(t)*u[0] + sin(t)*u[1]"',
    time="initial: 0, final: 3",
    more=path("dot(u, u) <= 1"),
)


def test_a_disc_for_the_control(solve: Solve) -> None:
    """u = −(cos t, sin t), cost −3; d cost / d radius² = −3/2 is the sum of all multipliers."""
    found = solve(DISC, steps=30)
    assert found.success
    assert found.cost == pytest.approx(-3, abs=1e-4)
    t = np.linspace(0.3, 2.7, 50)
    expected = -np.column_stack([np.cos(t), np.sin(t)])
    assert found.control(t) == pytest.approx(expected, abs=5e-3)
    multipliers = found.multipliers["path constraint limit"]
    assert multipliers.shape == (30 * 4 + 1, 1)
    assert multipliers.sum() == pytest.approx(1.5, abs=1e-3)
    assert (multipliers >= -1e-9).all()
    assert violation(found, "limit") < 1e-4


RAYLEIGH_MIXED = """
time: {initial: 0, final: 4.5}
states: {x1: {initial: -5}, x2: {initial: -5}}
controls: {u: {}}
dynamics: {x1: x2, x2: -x1 + x2*(1.4 - 0.14*x2^2) + 4*u}
cost: {lagrange: x1^2 + u^2}
constraints: {path: {mixed: u + x1/6 <= 0}}
"""
VAN_DER_POL_STATE = """
time: {initial: 0, final: 5}
states: {x1: {initial: 1}, x2: {initial: 0LIMIT}}
controls: {u: {}}
dynamics: {x1: x2, x2: (1 - x1^2)*x2 - x1 + u}
cost: {lagrange: x1^2 + x2^2 + u^2}
"""


def test_a_mixed_constraint(solve: Solve, reference: Any) -> None:
    facts, samples = reference("rayleigh_mixed")
    found = solve(RAYLEIGH_MIXED, steps=150)
    assert found.success
    assert found.cost == pytest.approx(facts["cost"], abs=1e-3)
    assert found.state(samples["t"]) == pytest.approx(samples["x"], abs=2e-3)
    assert found.control(samples["t"]) == pytest.approx(samples["u"], abs=0.04)
    assert found.costates[0] == pytest.approx(facts["p0"], abs=2e-2)
    assert violation(found, "mixed") < 1e-3


def test_a_state_constraint_is_a_bound(solve: Solve, reference: Any) -> None:
    facts, samples = reference("van_der_pol_state")
    bound = solve(VAN_DER_POL_STATE.replace("LIMIT", ", lower: -0.4"), steps=100)
    text = VAN_DER_POL_STATE.replace("LIMIT", "") + path("x2 >= -0.4")
    found = solve(text, steps=100)
    assert found.success
    assert found.cost == pytest.approx(facts["cost"], abs=1e-3)
    assert found.cost == pytest.approx(bound.cost, abs=1e-9)
    assert found.state(samples["t"]) == pytest.approx(samples["x"], abs=5e-3)
    assert found.control(samples["t"]) == pytest.approx(bound.control(samples["t"]), abs=1e-5)
    assert violation(found, "limit") == pytest.approx(violation(bound, "x2 >="), abs=1e-7)


TWO = scalar(
    "x: {initial: 1}, y: {initial: 0}",
    dynamics='x: y, y: "-x + u"',
    cost="lagrange: x^2 + y^2 + 0.1*u^2",
    time="initial: 0, final: 3",
)


def together(constraints: str) -> str:
    return TWO + f"constraints: {{path: {{{constraints}}}}}"


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ('a: "-0.5 <= u + x <= 0.25"', 'a: "u + x >= -0.5", b: "u + x <= 0.25"'),
        ('a: "0.25 >= u + x >= -0.5"', 'a: "-0.5 <= u + x", b: "0.25 >= u + x"'),
        ('a: "u <= 0.3 - x"', 'a: "u + x - 0.3 <= 0"'),
        ('a: "y - 0.2 <= u <= x + 0.5"', 'a: "u - y >= -0.2", b: "x + 0.5 >= u"'),
        ('a: "[-0.2, x] <= [y, 1.5]"', 'a: "y >= -0.2", b: "x <= 1.5"'),
        ('a: "[x, y, u] >= -0.3"', 'a: "x >= -0.3", b: "y >= -0.3", c: "u >= -0.3"'),
        ('a: "-0.3 <= [u, y] <= [1.4, 0.9]"', 'a: "-0.3 <= u <= 1.4", b: "-0.3 <= y <= 0.9"'),
    ],
)
def test_the_same_said_in_another_way(one: str, other: str, solve: Solve) -> None:
    given: dict[str, Any] = {"steps": 20, "path_points": "substeps", "tolerance": 1e-10}
    free = solve(TWO, steps=20, tolerance=1e-10)
    first, second = solve(together(one), **given), solve(together(other), **given)
    assert first.success
    assert second.success
    assert first.cost == pytest.approx(second.cost, abs=1e-8)
    assert first.cost > free.cost + 1e-4  # it matters


def test_a_bound_written_as_a_path_constraint(solve: Solve) -> None:
    """Hats bound û by their coefficients, at the nodes."""
    given: dict[str, Any] = {"steps": 30, "control": "piecewise-linear", "tolerance": 1e-10}
    bound = solve(TWO.replace("u: {}", "u: {lower: -0.4, upper: 0.4}"), **given)
    said = solve(together('a: "-0.4 <= u <= 0.4"'), **given)
    assert said.cost == pytest.approx(bound.cost, abs=1e-8)
    assert violation(said, "a: ") < 1e-8


def test_an_equality_along_the_horizon(solve: Solve) -> None:
    """u = −x throughout: x = e^(−t), ∫x² = (1 − e⁻²)/2."""
    text = scalar("x: {initial: 1}", cost="lagrange: x^2", more=path("u == -x"))
    found = solve(text, steps=20)
    assert found.success
    assert found.cost == pytest.approx((1 - math.exp(-2)) / 2, abs=1e-6)
    t = np.linspace(0, 1, 101)
    assert found.control(t)[:, 0] == pytest.approx(-np.exp(-t), abs=1e-2)


def test_an_equality_of_two_controls(solve: Solve) -> None:
    """u + w = 1 whatever the weights: ∫u² + 4 w² with u = 4/5, w = 1/5."""
    text = scalar(controls="u: {}, w: {}", cost="lagrange: u^2 + 4*w^2", more=path("u + w == 1"))
    found = solve(text, steps=10)
    assert found.success
    assert found.cost == pytest.approx(0.8, abs=1e-8)
    u = found.control(np.linspace(0, 1, 33))
    assert u == pytest.approx(np.tile([0.8, 0.2], (33, 1)), abs=1e-4)


def block(nlp: Nlp, name: str) -> Any:
    (found,) = [rows for rows in nlp.blocks if rows.name == name]
    return found


def test_where_path_constraints_hold(model: Build) -> None:
    text = together('pure: "y >= -0.2", mixed: "u <= 1 - x", control: "u^2 <= 4"')
    nodes, offsets = np.linspace(0, 1, 7), np.linspace(0, 1, 25)
    expected: dict[PathPoints | None, tuple[Array, Array]] = {
        None: (nodes, offsets),
        "nodes": (nodes, nodes),
        "substeps": (offsets, offsets),
    }
    for given, (pure, mixed) in expected.items():
        nlp = transcribed(model(text), given)
        for name, places in (("pure", pure), ("mixed", mixed), ("control", mixed)):
            found = block(nlp, f"path constraint {name}").fractions
            assert found == pytest.approx(places, abs=1e-13), (given, name)


@pytest.mark.parametrize("function", ["gaussian", "laguerre4", "sech", "hat", "box"])
@pytest.mark.parametrize("substeps", [1, 2, 3])
def test_an_equality_has_as_many_rows_as_the_control_coefficients(
    function: str, substeps: int, model: Build
) -> None:
    given = model(scalar("x: {initial: 1}", more=path("u == -x")))
    row = GENERATING_FUNCTIONS[function]
    basis = ControlBasis(row, 20, 2.0 if row.scaled else 1.0, True)
    method = Discretization(Mesh.uniform(20), basis, SCHEMES["rk4"], substeps)
    limit = block(transcribe(given, method, None, None), "path constraint limit")
    assert np.isfinite(limit.lower).sum() == basis.count
    assert (limit.lower == limit.upper)[np.isfinite(limit.lower)].all()


@pytest.mark.parametrize("function", ["laguerre4", "sech"])
def test_an_equality_for_other_functions(function: str, solve: Solve) -> None:
    text = scalar("x: {initial: 1}", cost="lagrange: x^2", more=path("u == -x"))
    found = solve(text, steps=20, generating_function=function)
    assert found.success
    assert found.cost == pytest.approx((1 - math.exp(-2)) / 2, abs=1e-5)
    classical = solve(text, steps=20, control="piecewise-linear")
    assert classical.cost == pytest.approx((1 - math.exp(-2)) / 2, abs=1e-3)
    assert solve(text, steps=20, control="piecewise-constant").success


def test_path_points_between_nodes_hold_what_nodes_do_not(solve: Solve) -> None:
    text = "bryson_denham"
    limited = quito.load(text).text.replace(", upper: l", "")
    assert limited != quito.load(text).text
    limited += path("x1 <= l").replace("constraints:", "constraints:", 1)
    few = {"steps": 9, "control": "piecewise-constant"}
    at_nodes = solve(limited, path_points="nodes", **few)
    everywhere = solve(limited, path_points="substeps", **few)
    assert at_nodes.success
    assert everywhere.success
    assert everywhere.cost > at_nodes.cost
    times = np.linspace(0, 1, 37)
    assert everywhere.state(times)[:, 0].max() <= 1 / 9 + 1e-8
    assert at_nodes.state(times)[:, 0].max() > 1 / 9 + 1e-4
    assert at_nodes.state(at_nodes.times)[:, 0].max() <= 1 / 9 + 1e-8


def test_path_rows_are_the_constraint_along_the_trajectory(model: Build) -> None:
    """At a feasible point of the defects the rows are those of an accurate integration."""
    given = model(
        together(
            'pure: "x*y", mixed: "u*x + t"'.replace('"x*y"', '"x*y <= 9"').replace(
                '"u*x + t"', '"u*x + t <= 9"'
            )
        )
    )
    nlp = transcribed(given, "substeps", cells=40)
    layout, m = nlp.transcription.layout, nlp.transcription.method
    c = np.sin(np.arange(m.basis.count) / 7.0)[:, None]

    def u(t: float) -> float:
        return float(m.basis.evaluate(c, *m.mesh.locate(np.array([t / 3])))[0, 0])

    flow = solve_ivp(
        lambda t, x: [x[1], -x[0] + u(t)],
        (0, 3),
        [1, 0],
        "DOP853",
        dense_output=True,
        rtol=1e-11,
        atol=1e-12,
        max_step=0.05,
    ).sol
    w = np.concatenate([flow(3 * m.mesh.fractions).T.ravel(), c.ravel()])
    assert layout.size == len(w)
    rows = np.array(nlp.assembled.jacobian(w / nlp.unit, [])[0]).ravel() / nlp.row_scale
    for name in ("pure", "mixed"):
        found = block(nlp, f"path constraint {name}")
        times = 3 * found.fractions
        x, y = flow(times)
        v = np.array([u(t) for t in times])
        expected = x * y if name == "pure" else v * x + times
        assert rows[found.rows] == pytest.approx(expected, abs=1e-6)


HELD = scalar(
    "x: {initial: 0, final: 0}, v: {initial: 1, final: -1}",
    dynamics="x: v, v: u",
    cost="lagrange: u^2/2",
    more='constraints: {path: {top: "x <= 1/9", speed: "v^2 <= 1", mixed: "u + x <= 9"}}',
)


def test_rows_that_fixed_ends_settle_are_released(model: Build) -> None:
    nlp = transcribed(model(HELD))
    for name in ("top", "speed"):
        upper = block(nlp, f"path constraint {name}").upper[:, 0]
        assert np.isinf(upper[[0, -1]]).all()
        assert np.isfinite(upper[1:-1]).all()
    assert np.isfinite(block(nlp, "path constraint mixed").upper).all()
    free = transcribed(model(HELD.replace("final: 0}, v", "final: null}, v")))
    assert np.isfinite(block(free, "path constraint top").upper[-1]).all()
    assert np.isinf(block(free, "path constraint top").upper[0]).all()
    assert np.isinf(block(free, "path constraint speed").upper[-1]).all()


def test_a_constraint_that_is_active_at_fixed_ends_converges(solve: Solve) -> None:
    """Bryson and Denham with v² ≤ 1 active at both ends: cost 4 as without it."""
    found = solve(HELD, steps=60)
    assert found.success
    assert found.cost == pytest.approx(4, abs=2e-2)


def test_an_end_that_is_fixed_still_limits_a_parameter(solve: Solve) -> None:
    """The least p ≥ x(t) for x = e^(−t) is x(0) = 1, although x(0) is fixed."""
    text = """
time: {initial: 0, final: 1}
states: {x: {initial: 1}}
parameters: {p: {lower: -10, upper: 10}}
dynamics: {x: -x}
cost: {mayer: p}
constraints: {path: {top: x <= p}}
"""
    assert solve(text, steps=10).parameters == pytest.approx([1], abs=1e-7)


def test_an_end_that_is_fixed_still_limits_a_free_time(solve: Solve) -> None:
    text = """
time: {initial: {lower: -5, upper: 5, guess: 2}, final: {lower: 5.5, upper: 10, guess: 7}}
states: {x: {initial: 1}}
dynamics: {x: -0.1*x}
cost: {mayer: initial(t)}
constraints: {path: {late: x <= t}}
"""
    assert solve(text, steps=10).times[0] == pytest.approx(1, abs=1e-7)


def test_a_constraint_that_fails_at_a_fixed_end_is_no_success() -> None:
    text = scalar(more=path("x >= 0.5"))
    with suppress(quito.QuitoError):  # it may be refused
        found = quito.solve(load_text(text, "test.yaml"), steps=10)
        assert not found.success
        assert any("limit" in sentence for sentence in found.evidence.diagnosis)


def test_constraints_on_time_and_parameters_alone(solve: Solve) -> None:
    """p ≥ t for all t in [0, 2]: the least p is 2."""
    text = """
time: {initial: 0, final: 2}
states: {x: {initial: 1}}
parameters: {p: {lower: -10, upper: 10}}
dynamics: {x: -x}
cost: {mayer: p}
constraints: {path: {above: p >= t}}
"""
    found = solve(text, steps=4)
    assert found.success
    assert found.parameters == pytest.approx([2], abs=1e-7)


# Boundary constraints


def test_a_periodic_orbit(solve: Solve) -> None:
    """x' = −x + cos ωt has one: x(0) = 1/(1 + ω²); no control is needed on it."""
    text = scalar(
        "x: {guess: 3}",
        dynamics="x: -x + cos(2*pi*t) + u",
        more='constraints: {boundary: {closed: "final(x) == initial(x)"}}',
    )
    found = solve(text, steps=40)
    assert found.success
    omega = 2 * math.pi
    t = np.linspace(0, 1, 41)
    orbit = (np.cos(omega * t) + omega * np.sin(omega * t)) / (1 + omega**2)
    assert found.state(t)[:, 0] == pytest.approx(orbit, abs=1e-5)
    assert found.cost == pytest.approx(0, abs=1e-8)
    assert violation(found, "closed") < 1e-9


def test_a_rounding_error_is_no_violation(solve: Solve) -> None:
    """Both sides are of size one: that they differ by 1e-12 is no news."""
    text = scalar(
        "x: {guess: 2}, y: {initial: 0.5}",
        dynamics="x: sin(x) + u, y: cos(y)*u",
        cost="lagrange: u^2 + (x - 2)^2",
        more="""
constraints:
  boundary: {ends: "final(x)^3 == exp(initial(x)) + final(y)"}
  point: {half: {at: 0.5, holds: "x*y == sin(x) + y^2"}}
""",
    )
    found = solve(text, steps=20)
    assert found.success
    assert violation(found, "ends: ") < 1e-8
    assert not [w for w in found.evidence.warnings if w.startswith(("ends", "half"))]


def test_ends_and_times_in_boundary_constraints(solve: Solve) -> None:
    """∫½u² + ½ wants a horizon of one; it is held at two, starting anywhere near 5."""
    text = scalar(
        "x: {}",
        cost="lagrange: 0.5*u^2 + 0.5, mayer: (initial(t) - 5)^2 + initial(x)^2",
        time="initial: {lower: 0, upper: 9}, final: {lower: 9.5, guess: 12}",
        more="""
parameters: {p: {lower: 0, upper: 9}}
constraints:
  boundary:
    far: final(x) - initial(x) >= p
    long: final(t) - initial(t) == 2
    fixed: p == 1
    pair: "[initial(x), final(x)] <= [1, 20]"
""",
    ).replace("lower: 9.5, guess: 12", "lower: 0.5, guess: 7")
    text = text.replace("initial: {lower: 0, upper: 9}", "initial: {lower: 0, upper: 9, guess: 4}")
    found = solve(text, steps=10)
    assert found.success
    assert found.times[[0, -1]] == pytest.approx([5, 7], abs=1e-6)
    assert found.parameters == pytest.approx([1], abs=1e-8)
    assert found.state(found.times[[0, -1]])[:, 0] == pytest.approx([0, 1], abs=1e-6)
    assert found.cost == pytest.approx(1 / 4 + 1, abs=1e-8)
    # d cost / d length = ½ − 1/(2·4), and λ = −that.
    (multiplier,) = found.multipliers["boundary constraint long"].ravel()
    assert multiplier == pytest.approx(-(0.5 - 0.125), abs=1e-6)


# Point constraints

SPLINE = scalar(
    "x: {initial: 0, final: 0.5}, v: {}",
    dynamics="x: v, v: u",
    cost="lagrange: u^2/2",
    time="initial: 1, final: 3",
    more="""
constraints:
  point:
    a: {at: 1.3, holds: x == 1}
    b: {at: 1.77, holds: x - 0.2*t == -0.4 - 0.2*1.77}
    c: {at: 5/2, holds: "[x, 0] >= [1.5, -1]"}
""",
)


def test_the_smoothest_curve_through_points_is_a_natural_spline(solve: Solve) -> None:
    """Its knots lie on no uniform mesh of 7 cells; hats with kinks there make it exact."""
    knots = [1, 1.3, 1.77, 2.5, 3]
    curve = CubicSpline(knots, [0, 1, -0.4, 1.5, 0.5], bc_type="natural")
    found = solve(SPLINE, steps=7, control="piecewise-linear", tolerance=1e-11)
    assert found.success
    assert len(found.times) == 8
    assert np.abs(found.times[:, None] - knots).min(axis=0) == pytest.approx(0, abs=1e-12)
    t = np.linspace(1, 3, 101)
    assert found.state(t)[:, 0] == pytest.approx(curve(t), abs=1e-7)
    assert found.control(t)[:, 0] == pytest.approx(curve(t, 2), abs=1e-5)
    fine = np.linspace(1, 3, 20001)
    assert found.cost == pytest.approx(np.trapezoid(curve(fine, 2) ** 2 / 2, fine), rel=1e-6)
    for name in "abc":
        assert violation(found, f"{name}: ") < 1e-9


def test_points_take_a_cell_each(solve: Solve) -> None:
    assert solve(SPLINE, steps=4, control="piecewise-linear").success
    with pytest.raises(quito.UsageError, match=r"3 cells .* 3 inner points.*--steps"):
        quito.solve(load_text(SPLINE, "test.yaml"), steps=3)


def test_a_point_at_a_fraction_of_a_free_horizon(solve: Solve) -> None:
    """¼ of the way in half the time: cost 5/(8T) + T/2, so T² = 5/4."""
    text = scalar(
        "x: {initial: 0, final: 1}",
        cost="lagrange: 0.5*u^2 + 0.5",
        time="initial: 0, final: {lower: 0.1, guess: 3}",
        more="constraints: {point: {half: {at: 0.5, holds: x == 0.25}}}",
    )
    found = solve(text, steps=5, control="piecewise-constant", tolerance=1e-11)
    assert found.success
    assert found.cost == pytest.approx(math.sqrt(1.25), abs=1e-9)
    assert found.times[-1] == pytest.approx(math.sqrt(1.25), abs=1e-7)
    assert found.state(found.times[-1] / 2)[0, 0] == pytest.approx(0.25, abs=1e-9)


@pytest.mark.parametrize("at", ["0", "1", "1/4", "0.3"])
def test_a_point_that_limits_the_control(at: str, solve: Solve) -> None:
    """At the ends and inside, with a time and a state in it."""
    point = f'constraints: {{point: {{still: {{at: {at}, holds: "u + x == t - 2"}}}}}}'
    found = solve(scalar(cost="lagrange: (u - 1)^2", more=point), steps=12)
    assert found.success
    t = float(eval_fraction(at))
    value = found.control(t)[0, 0] + found.state(t)[0, 0]
    assert value == pytest.approx(t - 2, abs=1e-7)


def eval_fraction(text: str) -> float:
    above, _, below = text.partition("/")
    return float(above) / float(below or 1)


# Guesses


def guessed(nlp: Nlp) -> tuple[Array, Array]:
    layout, w = nlp.transcription.layout, nlp.guess * nlp.unit
    return layout.states(w), layout.coefficient_table(w)


GUESSES = """
constants: {a: 2}
time: {initial: 1, final: {lower: 2, upper: 9, guess: 4}}
states:
  x: {initial: 0, guess: a*sin(t)}
  y: {size: 2, guess: [t^2, a]}
  z: {guess: {times: [1, 2, 10], values: [0, 5, 13]}}
  w: {size: 2, guess: {times: [0, 10], values: [[0, 1], [10, -9]]}}
  s: {initial: 2, final: 8}
  b: {lower: 1, upper: 5}
controls: {u: {guess: t}, v: {lower: -3, upper: 1}}
parameters: {p: {guess: 0.25}, q: {lower: 0, upper: 3}}
dynamics: {x: u + v*p*q, y: [x, x], z: u, w: [u, v], s: u, b: v}
cost: {lagrange: "dot(y, y) + z^2"}
"""


def test_guesses_by_expression_list_and_table(model: Build) -> None:
    nlp = transcribed(model(GUESSES))
    states, controls = guessed(nlp)
    t = np.linspace(1, 4, 7)
    table = np.where(t < 2, 5 * (t - 1), 3 + t)
    expected = [2 * np.sin(t), t**2, 2 + 0 * t, table, t, 1 - t, 2 * t, 3 + 0 * t]
    expected[0][0] = 0  # the initial value is known
    assert states == pytest.approx(np.column_stack(expected), abs=1e-12)
    basis = nlp.transcription.method.basis
    assert isinstance(basis, ControlBasis)
    ghosts = basis.ghosts
    assert controls[ghosts : ghosts + 7] == pytest.approx(
        np.column_stack([t, -1 + 0 * t]), abs=1e-12
    )
    assert nlp.transcription.layout.times(nlp.guess * nlp.unit, nlp.transcription.model) == (1, 4)
    shared = nlp.transcription.layout.parameters(nlp.guess * nlp.unit)
    assert shared == pytest.approx([0.25, 1.5])
    assert nlp.notes == ()


def test_a_guess_outside_its_bounds_is_clipped_and_told(solve: Solve) -> None:
    text = scalar(
        "x: {initial: 0, upper: 0.5, guess: 3*t}",
        "u: {lower: -1, upper: 1, guess: -7}",
        more="parameters: {p: {lower: 0, upper: 1, guess: 4}}",
        cost="lagrange: u^2 + (p - 0.5)^2 - x",
    )
    found = solve(text, steps=10)
    assert found.success
    for name in ("x", "u", "p"):
        assert f"the guess of {name} was clipped to its bounds" in found.evidence.warnings
    within = solve(text.replace("3*t", "0.4*t").replace("-7", "0").replace("4}", "1}"), steps=10)
    assert within.evidence.warnings == ()
    assert within.cost == pytest.approx(found.cost, abs=1e-8)


EARLIER: dict[str, dict[str, Any]] = {
    "same": {},
    "coarse": {"steps": 17},
    "euler": {"steps": 70, "discretization": "euler"},
    "constant": {"control": "piecewise-constant", "steps": 33},
    "wide": {"variance": 8.0, "steps": 90},
}


@pytest.mark.parametrize("kind", EARLIER)
def test_an_earlier_result_is_a_guess(kind: str, solve: Solve, tmp_path: Path) -> None:
    plain = solve("rayleigh", steps=60)
    earlier = solve("rayleigh", **({"steps": 60} | EARLIER[kind]))
    file = tmp_path / "earlier.h5"
    earlier.save(file)
    for guess in (earlier, file, str(file)):
        found = quito.solve("rayleigh", steps=60, guess=guess)
        assert found.success
        assert found.cost == pytest.approx(plain.cost, abs=1e-7)
        assert (found.statistics.iterations or 99) <= (plain.statistics.iterations or 0)


def test_an_earlier_result_with_times_and_parameters(solve: Solve) -> None:
    text = scalar(
        "x: {initial: 0, final: 1}",
        cost="lagrange: 0.5*u^2 + 2*(t - p)^2 + (p - 1)^2",
        time="initial: {lower: -2, upper: 3, guess: -1}, final: {lower: -1.5, guess: 4}",
        more="parameters: {p: {lower: -5, upper: 5}}",
    )
    first = solve(text, steps=10)
    assert first.times[[0, -1]] == pytest.approx([0.5, 1.5], abs=1e-5)
    again = quito.solve(load_text(text, "test.yaml"), steps=25, guess=first)
    assert again.cost == pytest.approx(first.cost, abs=1e-7)
    assert (again.statistics.iterations or 99) <= (first.statistics.iterations or 0)


def test_a_result_of_another_problem_is_refused(solve: Solve) -> None:
    with pytest.raises(quito.UsageError, match="shares no state"):
        quito.solve("rayleigh", steps=10, guess=solve(scalar(), steps=10))


# Scaling

SCALED = """
time: {initial: 0, final: 4500}
states:
  X1: {initial: -5e6, final: 0, unit: um}
  X2: {initial: -5e-5, final: 0}
controls: {U: {lower: -1e3, upper: 1e3}}
dynamics:
  X1: 1e8*X2
  X2: 1e-8*(-1e-6*X1 + 1e5*X2*(1.4 - 0.14*(1e5*X2)^2) + 4e-3*U)
cost: {lagrange: 1e-3*((1e-6*X1)^2 + (1e-3*U)^2)}
constraints: {path: {sum: 1e-6*X1 + 1e5*X2 <= 1.8}}
"""
"""Rayleigh's problem: x1 in units of 1e-6, x2 of 1e5, u of 1e-3, t of 1e-3 (all but the cost)."""
UNSCALED = """
time: {initial: 0, final: 4.5}
states: {x1: {initial: -5, final: 0}, x2: {initial: -5, final: 0}}
controls: {u: {lower: -1, upper: 1}}
dynamics: {x1: x2, x2: -x1 + x2*(1.4 - 0.14*x2^2) + 4*u}
cost: {lagrange: x1^2 + u^2}
constraints: {path: {sum: x1 + x2 <= 1.8}}
"""


@pytest.mark.parametrize("said", ["", ", scale: 5e6", ", scale: 1e6"])
def test_units_do_not_matter(said: str, solve: Solve) -> None:
    good = solve(UNSCALED, steps=60)
    bad = solve(SCALED.replace(", unit: um", said), steps=60)
    assert good.success
    assert bad.success
    assert bad.cost == pytest.approx(good.cost, abs=1e-6)
    assert bad.trajectory.states * [1e-6, 1e5] == pytest.approx(good.trajectory.states, abs=1e-5)
    t = np.linspace(0, 4.5, 200)
    assert 1e-3 * bad.control(1e3 * t) == pytest.approx(good.control(t), abs=1e-4)
    assert bad.costates * [1e6, 1e-5] == pytest.approx(good.costates, abs=1e-4)
    assert good.multipliers["path constraint sum"].max() > 1e-3
    assert bad.multipliers["path constraint sum"] == pytest.approx(
        good.multipliers["path constraint sum"], abs=1e-4
    )
    assert bad.multipliers["dynamics"] * [1e6, 1e-5] == pytest.approx(
        good.multipliers["dynamics"], abs=1e-4
    )
    limit = 1.5 * (good.statistics.iterations or 0) + 3
    assert (bad.statistics.iterations or 999) <= limit
    assert bad.evidence.resimulation_gap == pytest.approx(good.evidence.resimulation_gap, abs=1e-6)
    assert bad.evidence.warnings == good.evidence.warnings == ()


def in_units(k: float, constraints: str) -> str:
    """From rest to rest over k, at (u/k)² a unit of time; K stands for k."""
    return f"""
time: {{initial: 0, final: 1}}
states: {{x: {{initial: 0, final: {k}}}, v: {{initial: 0, final: 0}}}}
controls: {{u: {{}}}}
dynamics: {{x: v, v: u}}
cost: {{lagrange: (u/{k})^2}}
constraints: {{{constraints.replace("K", str(k))}}}
"""


@pytest.mark.parametrize("k", [1e6, 1e-5])
@pytest.mark.parametrize(
    "constraints",
    [
        "",
        "path: {top: v <= 1.45*K, mixed: u + v <= 7*K}",
        "integral: {fuel: u^2 <= 30*K^2}",
        "integral: {moved: v*t >= 0.6*K}",
        "boundary: {far: final(x) - initial(v) >= 0.5*K}",
        "point: {early: {at: 0.4, holds: x <= 0.33*K}}",
    ],
    ids=["none", "path", "budget", "integral", "boundary", "point"],
)
def test_units_do_not_matter_where_nothing_is_bounded(
    constraints: str, k: float, solve: Solve
) -> None:
    good, bad = solve(in_units(1, constraints), steps=20), solve(in_units(k, constraints), steps=20)
    assert good.success
    assert bad.success
    assert bad.cost == pytest.approx(good.cost, rel=1e-7)
    assert bad.trajectory.states / k == pytest.approx(good.trajectory.states, abs=1e-5)
    assert bad.costates * k == pytest.approx(good.costates, abs=1e-3)
    for name, multipliers in good.multipliers.items():
        size = k**2 if "fuel" in name else k
        assert bad.multipliers[name] * size == pytest.approx(multipliers, abs=1e-3), name
    assert (bad.statistics.iterations or 999) <= 1.5 * (good.statistics.iterations or 0) + 5


@pytest.mark.parametrize("k", [1e3, 1e6, 1e9])
def test_units_do_not_matter_with_all_constraints_at_once(k: float, solve: Solve) -> None:
    constraints = """
path: {top: v <= 1.5*K, mixed: u + v <= 7*K},
boundary: {far: final(x) - initial(v) >= 0.5*K},
integral: {fuel: u^2 <= 30*K^2},
point: {early: {at: 0.4, holds: x <= 0.33*K}}"""
    good, bad = solve(in_units(1, constraints), steps=20), solve(in_units(k, constraints), steps=20)
    assert good.success
    assert bad.success
    assert bad.cost == pytest.approx(good.cost, rel=1e-8)
    assert (bad.statistics.iterations or 999) <= 1.5 * (good.statistics.iterations or 0) + 5


@pytest.mark.parametrize("k", [1e6, 1e-7])
def test_a_state_that_others_move_has_their_size(k: float, solve: Solve) -> None:
    """y is zero at the guess, moves nothing, and is moved by x alone, itself zero at the guess."""

    def text(k: float) -> str:
        return scalar(
            "x: {initial: 0}, y: {initial: 0}",
            f"u: {{lower: {0.5 * k}, upper: {2 * k}}}",
            "x: u, y: x",
            f"lagrange: (u/{k} - 1 - t)^2, mayer: (y/{k} - 0.3)^2",
        )

    good, bad = solve(text(1), steps=20), solve(text(k), steps=20)
    assert good.success
    assert bad.success
    assert bad.cost == pytest.approx(good.cost, rel=1e-7)
    assert bad.trajectory.states / k == pytest.approx(good.trajectory.states, abs=1e-6)


def test_scales_of_the_file_are_units_of_the_unknowns(model: Build) -> None:
    text = """
time: {initial: 0, final: {lower: 1, upper: 4000, guess: 3000}}
states: {x: {size: 2, scale: [3, null], guess: 100}, y: {initial: 0, scale: 0.05}}
controls: {u: {scale: 40}, v: {lower: -1000, upper: 10}}
parameters: {p: {guess: 1, scale: 7}, q: {lower: 0, upper: 1e-4}}
dynamics: {x: [u, v], y: p + q}
cost: {lagrange: "dot(x, x)"}
"""
    nlp = transcribed(model(text))
    layout = nlp.transcription.layout
    assert layout.states(nlp.unit)[3] == pytest.approx([3, 128, 0.05])
    assert layout.coefficient_table(nlp.unit)[0] == pytest.approx([40, 1024])
    assert layout.parameters(nlp.unit)[0] == 7
    assert layout.parameters(nlp.unit)[1] in (2.0**-14, 2.0**-13)
    assert nlp.unit[0] == pytest.approx(2048, rel=1.01)
    dynamics = nlp.blocks[0]
    assert nlp.row_scale[dynamics.rows][:3] == pytest.approx([1 / 3, 1 / 128, 20])


def test_rounding_in_the_dynamics_is_no_size(model: Build) -> None:
    """cos(π/2) is 6e-17, and says nothing about how large v will be."""
    nlp = transcribed(model(BRACHISTOCHRONE.replace("lower: -1,", "lower: 0,")))
    assert nlp.transcription.layout.states(nlp.unit).min() >= 1e-3


# Named expressions


def test_named_expressions_mean_the_same_everywhere(solve: Solve) -> None:
    named = """
constants: {k: 0.5}
time: {initial: 0, final: 2}
states: {x: {initial: 1}, y: {initial: 0}}
controls: {u: {}}
expressions:
  square: x^2 + k*y^2
  energy: square + 0*t
  push: u - k*x
dynamics: {x: y, y: push - k*square}
cost: {lagrange: energy + u^2, mayer: 0.1*energy + initial(square) + k}
constraints:
  path: {low: push >= -1.2, sum: square <= 5}
  boundary: {drop: final(energy) <= 0.15*initial(energy)}
  integral: {mean: energy <= 1.05}
  point: {half: {at: 1, holds: energy <= 0.45}}
"""
    plain = """
time: {initial: 0, final: 2}
states: {x: {initial: 1}, y: {initial: 0}}
controls: {u: {}}
dynamics: {x: y, y: u - 0.5*x - 0.5*(x^2 + 0.5*y^2)}
cost:
  lagrange: x^2 + 0.5*y^2 + u^2
  mayer: 0.1*(x^2 + 0.5*y^2) + initial(x)^2 + 0.5*initial(y)^2 + 0.5
constraints:
  path: {low: u - 0.5*x >= -1.2, sum: x^2 + 0.5*y^2 <= 5}
  boundary: {drop: final(x)^2 + 0.5*final(y)^2 <= 0.15*(initial(x)^2 + 0.5*initial(y)^2)}
  integral: {mean: x^2 + 0.5*y^2 <= 1.05}
  point: {half: {at: 1, holds: x^2 + 0.5*y^2 <= 0.45}}
"""
    one, other = solve(named, steps=20), solve(plain, steps=20)
    assert one.success
    assert one.cost == pytest.approx(other.cost, abs=1e-11)
    assert one.coefficients == pytest.approx(other.coefficients, abs=1e-8)
    for name in ("low", "drop", "mean", "half", "sum"):
        assert violation(one, f"{name}: ") == pytest.approx(violation(other, f"{name}: "), abs=1e-9)
        assert violation(one, f"{name}: ") < 2e-2
    active = [k for k, v in one.multipliers.items() if k != "dynamics" and np.abs(v).max() > 1e-4]
    assert len(active) >= 3  # the comparison means something


def test_the_initial_value_of_an_expression_of_time(solve: Solve) -> None:
    """mayer: E at the end, initial(E) at the start, t with each."""
    text = scalar(
        "x: {initial: 2}",
        cost="lagrange: u^2, mayer: E + 10*initial(E)",
        time="initial: 1, final: 3",
        more="expressions: {E: x*t}",
    )
    # u constant = −3/2: x(3) = −1, cost ∫ 9/4·2 − 3 + 20
    found = solve(text, steps=10)
    assert found.cost == pytest.approx(4.5 + 3 * (2 - 3) + 20, abs=1e-8)


# Time in dynamics and cost

TRACKING = """
title: Double integrator that follows a circle
time: {initial: 0, final: 10}
states: {x1: {initial: 0, lower: -6, upper: 6}, x2: {initial: 5, lower: -10, upper: 10}}
controls: {u: {lower: -4.7, upper: 4.7}}
dynamics: {x1: x2, x2: u}
cost: {lagrange: (x1 - 5*sin(t))^2 + (x2 - 5*cos(t))^2 + 1e-4*u^2}
"""


def test_tracking(solve: Solve, reference: Any) -> None:
    facts, samples = reference("double_integrator_tracking")
    found = solve(TRACKING, steps=200)
    assert found.success
    assert found.cost == pytest.approx(facts["cost"], abs=1e-4)
    assert found.state(samples["t"]) == pytest.approx(samples["x"], abs=5e-3)
    inside = samples["t"] < 9.8  # a layer at the end is thinner than the cells
    error = np.abs(found.control(samples["t"]) - samples["u"])[inside]
    assert error.max() < 0.3


def test_time_that_does_not_start_at_zero(solve: Solve) -> None:
    """x' = t x + u with ∫(u + t x − 1)²: u = 1 − t x makes x = t − 2, at no cost."""
    text = scalar(
        "x: {initial: 0}",
        dynamics="x: t*x + u",
        cost="lagrange: (u + t*x - 1)^2",
        time="initial: 2, final: 3.5",
    )
    found = solve(text, steps=30)
    assert found.success
    assert found.cost == pytest.approx(0, abs=1e-6)
    t = np.linspace(2, 3.5, 31)
    assert found.state(t)[:, 0] == pytest.approx(t - 2, abs=1e-3)
