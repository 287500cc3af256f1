"""What must not be called solved, and what must not be refused: found by looking for it."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import minimize

import quito_cli as quito
from quito_cli.plots.figure import figure
from quito_cli.problem.load import load_text
from quito_cli.solution.kinks import corners

Solve = Callable[..., quito.Solution]


def solve(text: str, **options: Any) -> quito.Solution:
    return quito.solve(load_text(text, "case.yaml"), **options)


COSTLY_GUESS = """
time: {initial: 0, final: 1}
states: {x: {initial: 1, guess: "GUESS"}}
controls: {u: {}}
dynamics: {x: u}
cost: {lagrange: x^4 + u^2 + (u - sin(5*t))^4}
"""


def test_a_costly_guess_changes_nothing() -> None:
    """The scale of the objective comes from the guess; it must not decide what is optimal."""
    near = solve(COSTLY_GUESS.replace("GUESS", "1"))
    far = solve(COSTLY_GUESS.replace("GUESS", "1e4*t"))
    assert near.success
    assert far.success
    assert far.cost == pytest.approx(near.cost, abs=1e-7)


def test_a_landing_from_afar_is_the_linear_quadratic_one() -> None:
    """x'' = u, cost 1000 (x^4 + v^4) at the end: the cost of the exact two-point solution."""
    text = """
time: {initial: 0, final: 20}
states: {x: {initial: 1000}, v: {initial: 0}}
controls: {u: {}}
dynamics: {x: v, v: u}
cost: {lagrange: u^2, mayer: 1e3*x^4 + 1e3*v^4}
"""
    found = solve(text)
    T = 20.0

    def cost(end: np.ndarray) -> float:
        """Least energy from (1000, 0) to an end, by Hermite's cubic, and the cost of that end."""
        dx, v = end[0] - 1000, end[1]
        energy = 12 * dx**2 / T**3 - 12 * dx * v / T**2 + 4 * v**2 / T
        return float(energy + 1e3 * end[0] ** 4 + 1e3 * v**4)

    best = minimize(cost, [1.0, -1.0], method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-9})
    assert found.success
    assert found.cost == pytest.approx(best.fun, rel=1e-6)


def test_a_small_scale_buys_no_success() -> None:
    assert not solve(COSTLY_GUESS.replace("GUESS", "1"), objective_scale=1e-8).success


def test_a_cost_that_the_mesh_does_not_resolve_is_told() -> None:
    text = """
time: {initial: 0, final: 1}
states: {x: {initial: 0, final: 1}}
controls: {u: {}}
dynamics: {x: u}
cost: {lagrange: "u^2 + if_else(t > 0.503, 10, 0)"}
"""
    found = solve(text, steps=10)
    assert any("re-simulated cost" in warning for warning in found.evidence.warnings)


def test_a_law_may_leave_its_bound_at_once() -> None:
    """u = -x starts on its bound -1: coefficients within bounds could not follow."""
    text = """
time: {initial: 0, final: 1}
states: {x: {initial: 1}}
controls: {u: {lower: -1, upper: 1}}
dynamics: {x: u}
cost: {lagrange: x^2}
constraints: {path: {law: u == -x}}
"""
    found = solve(text)
    assert found.success
    assert found.cost == pytest.approx((1 - np.exp(-2)) / 2, abs=1e-7)


def test_dynamics_too_stiff_for_the_steps_are_called_so() -> None:
    text = """
time: {initial: 0, final: 1}
states: {x: {initial: 1}, y: {initial: 0}}
controls: {u: {lower: -1, upper: 1}}
dynamics: {x: -1000*(x - y), y: u}
cost: {lagrange: (x - 0.1)^2}
"""
    coarse = solve(text, steps=20, substeps=1, max_iterations=100)
    assert not coarse.success or coarse.evidence.warnings
    assert solve(text, substeps=6).success


def test_the_mesh_is_drawn_in_the_middle_of_its_picture() -> None:
    drawn = figure(quito.solve("bang_bang", steps=20), ("mesh",))
    (axes,) = drawn.axes
    low, high = axes.get_ylim()
    assert 0 < low < 1 / 20 < high
    assert np.sqrt(low * high) == pytest.approx(1 / 20, rel=0.1)


def test_no_control_at_all_does_not_ring() -> None:
    text = """
time: {initial: 0, final: 1}
states: {x: {initial: 0}}
controls: {u: {lower: -1, upper: 1}}
dynamics: {x: u}
cost: {lagrange: x^2 + u^2}
"""
    assert solve(text).evidence.ringing[0] < 1
    assert solve(text, control="piecewise-constant").evidence.ringing[0] < 1


def test_formulas_that_grow_together_are_refused_soon() -> None:
    """Each is within its own limit; sixty of them would take minutes and gigabytes."""
    size = 55
    rows = ", ".join(f"[{', '.join('0.1' for _ in range(size))}]" for _ in range(size))
    chain = "".join(f"  e{i}: e{i - 1} @ e0\n" for i in range(1, 60))
    text = f"""
constants: {{C: [{rows}]}}
time: {{initial: 0, final: 1}}
states: {{x: {{size: {size}, initial: 0}}}}
controls: {{u: {{size: {size}}}}}
dynamics: {{x: u}}
cost: {{lagrange: "e59[0, 0]"}}
expressions:
  e0: diag(x) + C
{chain}"""
    with pytest.raises(quito.ProblemError, match="together") as caught:
        solve(text)
    assert len(caught.value.complaints) == 1


def test_a_file_may_not_ask_for_more_than_a_machine_has() -> None:
    text = """
time: {initial: 0, final: 1}
states: {x: {size: 200, initial: 0}}
controls: {u: {size: 200}}
dynamics: {x: u}
cost: {lagrange: "dot(u, u)"}
options: {steps: 20000, substeps: 20}
"""
    with pytest.raises(quito.UsageError, match="say so with -N"):
        solve(text)


@pytest.mark.parametrize("function", ["laguerre4", "laguerre6", "hermite10", "trigonometric"])
def test_a_control_that_may_overshoot_does_so_by_little(function: str) -> None:
    found = quito.solve("van_der_pol", steps=100, generating_function=function)
    assert found.success
    assert np.abs(found.control(found.dense_times)).max() < 1.01


def test_solutions_travel_between_processes_and_are_short_in_print() -> None:
    found = quito.solve("alychan", steps=20)
    again = pickle.loads(pickle.dumps(found))
    assert again.control(0.3) == found.control(0.3)
    assert len(repr(found)) < 120


# Corners, and costs that run away


def scalar_problem(dynamics: str, cost: str, control: str = "{lower: -1, upper: 1}") -> str:
    return f"""
time: {{initial: 0, final: 2}}
states: {{x: {{initial: 1}}}}
controls: {{u: {control}}}
dynamics: {{x: "{dynamics}"}}
cost: {cost}
"""


@pytest.mark.parametrize(
    ("cost", "named"),
    [
        ("{lagrange: abs(x - 0.2) + abs(u)}", "cost.lagrange has a corner there: its abs"),
        ("{lagrange: abs(x) + 0.1*u^2}", "cost.lagrange has a corner there: its abs"),
    ],
)
def test_an_answer_on_a_corner_names_it(cost: str, named: str, solve: Solve) -> None:
    found = solve(scalar_problem("u", cost), max_iterations=60)
    assert not found.success
    assert [sentence for sentence in found.evidence.diagnosis if sentence.startswith(named)]
    assert any("sqrt(x^2 + 1e-6)" in sentence for sentence in found.evidence.diagnosis)


def test_rounded_off_it_is_solved(solve: Solve) -> None:
    """As the message says."""
    cost = "{lagrange: sqrt((x - 0.2)^2 + 1e-6) + sqrt(u^2 + 1e-6)}"
    assert solve(scalar_problem("u", cost)).success


def test_a_cost_that_runs_away_names_what_grows(solve: Solve) -> None:
    found = solve(scalar_problem("u", "{mayer: x}", "{}"), max_iterations=300)
    assert not found.success
    (sentence,) = (s for s in found.evidence.diagnosis if s.startswith("The cost runs away"))
    assert "x and u" in sentence
    assert not any("--max-iterations" in s for s in found.evidence.diagnosis)


def test_corners_are_found_in_a_formula() -> None:
    x, t = ca.SX.sym("x", 2), ca.SX.sym("t")
    value = ca.vertcat(
        ca.fabs(x[0] - t) + ca.fmin(x[1], 2), ca.if_else(x[0] > 1, x[1], t), ca.sin(x[0]) / t
    )
    function = ca.Function("f", [x, t], [value])
    found = corners(function)
    assert [name for name, _ in found] == ["abs", "min", "if_else"]
    zero = ca.Function("zero", function.sx_in(), [argument for _, argument in found])
    assert [float(v) for v in zero([3, 5], 0.5)] == [2.5, 3, -2]


def test_a_table_that_ends_before_the_horizon_is_told(solve: Solve) -> None:
    """Three of four hours are measured: 0 to 3, and the line goes on to 4."""
    text = """
time: {initial: 0, final: 4}
tables: {heat: {x: [0, 1, 3], y: [1, 2, 4], method: linear}}
states: {x: {initial: 1}}
controls: {u: {}}
dynamics: {x: "u + interpolate(t, heat)"}
cost: {lagrange: u^2 + x^2}
"""
    (warning,) = (w for w in solve(text, steps=40).evidence.warnings if "table" in w)
    assert "heat is read at 4, beyond its ends 0 and 3" in warning
    enough = text.replace("[0, 1, 3]", "[0, 1, 4]")
    assert not [w for w in solve(enough, steps=40).evidence.warnings if "table" in w]
    by_state = text.replace("interpolate(t, heat)", "interpolate(x - 1, heat)")
    (warning,) = (w for w in solve(by_state, steps=40).evidence.warnings if "table" in w)
    assert "beyond its ends 0 and 3" in warning


def test_a_corner_that_is_crossed_is_not_sat_on(solve: Solve) -> None:
    """Nor is a break of a table: with few cells one node is a large part of all."""
    text = """
time: {initial: 0, final: 1}
tables: {a: {x: [0, 0.25, 0.5, 2], y: [0, 1, 0, 1], method: linear}}
states: {x: {initial: 0, final: 9}}
controls: {u: {lower: -1, upper: 1}}
dynamics: {x: "u + 0.1*interpolate(t, a) + 0.1*abs(t - 0.5)"}
cost: {lagrange: u^2}
"""
    found = solve(text, steps=8, max_iterations=40)
    assert not found.success
    assert not [s for s in found.evidence.diagnosis if "corner" in s]
