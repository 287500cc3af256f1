"""Legendre-Gauss-Radau collocation: its rule, its program, and what comes of it."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from numpy.polynomial import Legendre, Polynomial
from numpy.typing import NDArray
from processor import within

import quito_cli as quito
from quito_cli.check import check
from quito_cli.cli.report import print_solution
from quito_cli.problem.load import load_text
from quito_cli.problem.model import Model
from quito_cli.solution.trajectory import Polynomials
from quito_cli.transcription.collocation import Collocation
from quito_cli.transcription.legendre import radau
from quito_cli.transcription.mesh import Mesh
from quito_cli.transcription.polynomial import PolynomialBasis
from quito_cli.transcription.transcribe import Nlp, transcribe

Array = NDArray[np.float64]
Build = Callable[[str], Model]
Solve = Callable[..., quito.Solution]

S6 = math.sqrt(6)


def lgr(steps: int, degree: int, **options: Any) -> dict[str, Any]:
    return {"discretization": "lgr", "steps": steps, "degree": degree, **options}


# The rule


@pytest.mark.parametrize(
    ("degree", "points", "weights"),
    [
        (1, [-1], [2]),
        (2, [-1, 1 / 3], [1 / 2, 3 / 2]),
        (3, [-1, (1 - S6) / 5, (1 + S6) / 5], [2 / 9, (16 + S6) / 18, (16 - S6) / 18]),
    ],
)
def test_known_points_and_weights(degree: int, points: list[float], weights: list[float]) -> None:
    rule = radau(degree)
    assert 2 * rule.points - 1 == pytest.approx(points, abs=1e-15)
    assert 2 * rule.weights == pytest.approx(weights, abs=1e-15)


@pytest.mark.parametrize("degree", [4, 7, 20])
def test_the_points_are_the_roots_of_two_neighbouring_legendre_polynomials(degree: int) -> None:
    both = Legendre.basis(degree) + Legendre.basis(degree - 1)
    assert 2 * radau(degree).points - 1 == pytest.approx(np.sort(both.roots().real), abs=1e-9)


@pytest.mark.parametrize("degree", [1, 2, 3, 5, 12, 60])
def test_the_quadrature_is_exact_to_degree_2d_minus_2_and_no_further(degree: int) -> None:
    rule = radau(degree)
    for k in range(2 * degree - 1):
        legendre = Legendre.basis(k)(2 * rule.points - 1)
        assert rule.weights @ legendre == pytest.approx(float(k == 0), abs=1e-13)
    assert abs(rule.weights @ Legendre.basis(2 * degree - 1)(2 * rule.points - 1)) > 1e-3 / degree


@pytest.mark.parametrize("degree", [1, 2, 3, 6, 15])
def test_differentiation_is_exact_to_the_degree(degree: int) -> None:
    nodes = radau(degree).state
    assert nodes.points[[0, -1]].tolist() == [0, 1]
    p = Polynomial(np.random.default_rng(degree).normal(size=degree + 1))
    assert nodes.differentiation @ p(nodes.points) == pytest.approx(p.deriv()(nodes.points))
    higher = nodes.points ** (degree + 1)
    slopes = (degree + 1) * nodes.points**degree
    assert np.abs(nodes.differentiation @ higher - slopes).max() > 1e-9


def test_four_hundred_points_are_as_good_as_few() -> None:
    rule = radau(400)
    c, D = rule.state.points, rule.state.differentiation
    assert (np.diff(c) > 0).all()
    assert (rule.weights > 0).all()
    assert rule.weights.sum() == pytest.approx(1, abs=1e-13)
    assert rule.weights @ np.cos(300 * rule.points) == pytest.approx(math.sin(300) / 300, abs=1e-13)
    assert np.abs(D.sum(axis=1)).max() < 1e-14 * np.abs(D).max()
    assert D @ np.exp(c) == pytest.approx(np.exp(c), abs=1e-9)
    assert D @ np.sin(20 * c) == pytest.approx(20 * np.cos(20 * c), abs=1e-9)
    s = np.linspace(0, 1, 3001)
    assert rule.state.weights(s) @ np.sin(20 * c) == pytest.approx(np.sin(20 * s), abs=1e-12)


def test_the_control_is_a_polynomial_in_each_cell() -> None:
    basis = PolynomialBasis(2, 3)
    assert basis.count == basis.pieces == 6
    c = radau(3).points
    assert basis.centres == pytest.approx([*c, *(1 + c)], abs=1e-15)
    pieces = Polynomial([1, -2, 3]), Polynomial([0, 5, -1])
    coefficients = np.concatenate([p(c) for p in pieces])[:, None]
    s = np.append(np.linspace(0, 1, 30), c)
    for cell, p in enumerate(pieces):
        found = basis.evaluate(coefficients, np.full(len(s), cell), s)
        assert found[:, 0] == pytest.approx(p(s), abs=1e-14)


def test_curves_are_polynomials_of_the_degree_and_hold_at_the_ends() -> None:
    nodes, c = np.array([1.0, 2.0, 4.0]), radau(3).points
    times = np.concatenate([1 + c, 2 + 2 * c, [4.0]])
    p = Polynomial([1, -2, 0.5, 0.25])
    curve = Polynomials(times, np.column_stack([p(times), times]), 3)
    t = np.concatenate([np.linspace(1, 4, 50), times, nodes])
    assert curve(t) == pytest.approx(np.column_stack([p(t), t]), abs=1e-12)
    assert curve(np.array([0.0, 9.0]))[:, 1] == pytest.approx([1, 4])


# The program

EVERYTHING = """
title: Free times, parameters, every kind of constraint, both costs
constants: {A: [[0, 1], [-2, -0.3]]}
time: {initial: {lower: -0.5, upper: 0.5, guess: 0.1}, final: {lower: 0.4, upper: 5, guess: 2}}
states:
  x: {size: 2, initial: [0.3, null], lower: -4, upper: [4, .inf], guess: [t, -t], scale: [1e-3, 50]}
  y: {final: 0.2, guess: 100*t}
controls:
  u: {size: 2, lower: [-1, -.inf], upper: [null, 3]}
  v: {guess: -40}
parameters: {p: {lower: -1, upper: 1}, q: {size: 2, guess: [0.2, 500]}}
dynamics:
  x: A @ x + u*cos(t) + p*dot(x, x)
  y: sin(x[0])*v - u[0]*u[1]*t + q[0]
cost:
  lagrange: dot(x, x) + dot(u, u)*exp(-0.01*y) + t*v^2 + q[0]*y
  mayer: x[0]*y + initial(x)[1]^2*t + cos(final(x)[1]) + p*initial(t)
constraints:
  path:
    mixed: -1 <= x[0]*v + p*t <= 3
    pure: x[0]*x[1] <= y
    moving: x <= [t, 2 + t]
    power: u[0]*v == y
  boundary: {closed: final(x) == initial(x)}
  integral: {fuel: "dot(u, u)*y <= 5", work: "-1 <= u[0]*v + p <= 2"}
  point:
    first: {at: 0, holds: "u[0]*x[1] + t >= p"}
    last: {at: 1, holds: "v*y == q[1]"}
"""
GRADED = Mesh(np.array([0, 0.2, 0.7, 1.0]))
METHODS = [Collocation(GRADED, 3), Collocation(GRADED, 1), Collocation(Mesh.uniform(1), 6)]
PROBLEMS = [EVERYTHING, "van_der_pol", "bressan"]
programs = pytest.mark.parametrize(
    ("problem", "method"),
    list(itertools.product(PROBLEMS, METHODS)),
    ids=lambda given: f"{given.mesh.cells}x{given.degree}" if hasattr(given, "mesh") else given[:6],
)


def dense(matrix: Any) -> Array:
    return np.array(ca.DM(matrix), dtype=float)


def near(nlp: Nlp) -> Array:
    """A random point near the guess."""
    return nlp.guess + np.random.default_rng(7).uniform(-0.4, 0.4, len(nlp.guess))


@programs
def test_derivatives_are_those_of_casadi(problem: str, method: Collocation, model: Build) -> None:
    nlp = transcribe(model(problem), method, 7.0, None)
    a, w = nlp.assembled, near(nlp)
    sigma, lam = ca.MX.sym("sigma"), ca.MX.sym("lam", len(nlp.row_lower))
    lagrangian = sigma * a.objective + ca.dot(lam, a.constraints)
    expressions = [
        ca.gradient(a.objective, a.unknowns),
        ca.jacobian(a.constraints, a.unknowns),
        ca.hessian(lagrangian, a.unknowns)[0],
    ]
    theirs = ca.Function("theirs", [a.unknowns, sigma, lam], expressions)
    multipliers = np.random.default_rng(8).normal(size=len(nlp.row_lower))
    gradient, jacobian, hessian = (dense(value) for value in theirs(w, 0.7, multipliers))
    assert np.isfinite(hessian).all()
    assert dense(a.gradient(w, [])[1]) == pytest.approx(gradient, rel=1e-11, abs=1e-11)
    assert dense(a.jacobian(w, [])[1]) == pytest.approx(jacobian, rel=1e-11, abs=1e-11)
    ours = dense(a.hessian(w, [], 0.7, multipliers))
    assert ours == pytest.approx(np.triu(hessian), rel=1e-10, abs=1e-10)
    assert a.jacobian.nnz_out(1) <= 1.3 * expressions[1].nnz()


def with_roots(roots: Array) -> Any:
    return Polynomial.fromroots(roots) if len(roots) else Polynomial([1.0])


def lagrange_slopes(nodes: Array) -> Array:
    """Derivatives at the nodes of the polynomials that are one at a node and zero at others."""
    rows = [with_roots(np.delete(nodes, j)) for j in range(len(nodes))]
    return np.array([(p / p(c)).deriv()(nodes) for p, c in zip(rows, nodes, strict=True)]).T


@pytest.mark.parametrize("path_points", [None, "substeps", "nodes"])
@pytest.mark.parametrize("method", METHODS[:2], ids=["3x3", "3x1"])
def test_values_are_those_of_a_plain_loop(
    method: Collocation, path_points: Any, model: Build
) -> None:
    given = model(EVERYTHING)
    nlp = transcribe(given, method, 7.0, path_points)
    D, layout, w = method.degree, method.layout(given), near(nlp)
    physical = w * nlp.unit
    both = Legendre.basis(D) + Legendre.basis(D - 1)
    tau = np.sort(both.roots().real)
    slopes = lagrange_slopes(np.append((1 + tau) / 2, 1))
    inside = [with_roots(np.delete(tau, j)) for j in range(D)]
    shares = np.array(
        [(p.integ()(1) - p.integ()(-1)) / p(c) / 2 for p, c in zip(inside, tau, strict=True)]
    )
    t0, tf = layout.times(physical, given)
    p, nodes = layout.parameters(physical), layout.states(physical)
    u = layout.coefficient_table(physical).reshape(method.mesh.cells, D, -1)
    own = physical[layout.first_own : layout.first_coefficient].reshape(len(u), D - 1, given.n_x)
    total, integrals, found = 0.0, np.zeros(2), []
    path: dict[str, list[Array]] = {c.name: [] for c in given.constraints.path}
    for k, (a, b) in enumerate(itertools.pairwise(t0 + (tf - t0) * method.mesh.fractions)):
        x = np.vstack([nodes[k], own[k], nodes[k + 1]])
        for i in range(D):
            t = a + (b - a) * (1 + tau[i]) / 2
            xdot, q = (dense(v)[:, 0] for v in given.right_hand_side(x[i], u[k, i], p, t))
            found.append(shares[i] * ((b - a) * xdot - slopes[i] @ x))
            total += shares[i] * (b - a) * q[0]
            integrals += shares[i] * (b - a) * q[1:]
            for c in given.constraints.path:
                if i == 0 or path_points != "nodes" or c.name == "power":
                    path[c.name].append(dense(given.function(c)(x[i], u[k, i], p, t))[:, 0])
    for c in given.constraints.path:
        if c.name in ("pure", "moving"):  # of states alone: at the final time, too
            path[c.name].append(dense(given.function(c)(nodes[-1], 0 * u[0, 0], p, tf))[:, 0])
    rows = dense(nlp.assembled.jacobian(w, [])[0])[:, 0] / nlp.row_scale
    values = {b.name: rows[b.rows].reshape(-1, len(b.labels)) for b in nlp.blocks}
    total += float(given.end_cost(nodes[0], t0, nodes[-1], tf, p))
    assert float(nlp.assembled.gradient(w, [])[0]) == pytest.approx(7 * total, rel=1e-10)
    size = np.abs(found).max()
    assert values["dynamics"] == pytest.approx(np.array(found), abs=1e-10 * size)
    for name, value in zip(("fuel", "work"), integrals, strict=True):
        assert values[f"integral constraint {name}"].item() == pytest.approx(value, rel=1e-9)
    for name, expected in path.items():
        assert values[f"path constraint {name}"] == pytest.approx(np.array(expected), rel=1e-9)
    first = dense(given.function(given.constraints.point[0])(nodes[0], u[0, 0], p, t0))
    assert values["point constraint first"] == pytest.approx(first.T, rel=1e-9)
    assert "control bounds" not in values


def test_bounds_hold_at_all_points(model: Build) -> None:
    method = Collocation(GRADED, 3)
    nlp = transcribe(model(EVERYTHING), method, None, None)
    layout = method.layout(model(EVERYTHING))
    for side, x, u in (
        (nlp.lower, [-4, -4, -np.inf], [-1, -np.inf, -np.inf]),
        (nlp.upper, [4, np.inf, np.inf], [np.inf, 3, np.inf]),
    ):
        physical = side * nlp.unit
        assert layout.states(physical)[1:-1].tolist() == [x, x]
        own = physical[layout.first_own : layout.first_coefficient].reshape(-1, 3)
        assert own.tolist() == [x] * 6
        assert layout.coefficient_table(physical).tolist() == [u] * 9


def test_the_guess_is_taken_at_the_points(model: Build) -> None:
    text = """
time: {initial: 0, final: 3}
states: {x: {guess: t^2}}
controls: {u: {guess: sin(t)}}
dynamics: {x: u}
cost: {lagrange: u^2}
"""
    method = Collocation(Mesh.uniform(1), 5)
    nlp = transcribe(model(text), method, None, None)
    layout, c = method.layout(model(text)), 3 * radau(5).points
    physical = nlp.guess * nlp.unit
    assert layout.states(physical)[:, 0] == pytest.approx([0, 9])
    own = physical[layout.first_own : layout.first_coefficient]
    assert own == pytest.approx(c[1:] ** 2)
    assert layout.coefficient_table(physical)[:, 0] == pytest.approx(np.sin(c))


def test_one_interval_of_many_points_is_built_at_once(model: Build) -> None:
    given = model("van_der_pol")
    with within(20):
        nlp = transcribe(given, Collocation(Mesh.uniform(1), 400), None, None)
    assert len(nlp.guess) == 2 * 401 + 400


# Convergence

NONLINEAR = """
time: {initial: 0, final: 1}
states: {x: {initial: 1}}
controls: {u: {}}
dynamics: {x: -x^3 + u + 0.3*sin(x)*t}
cost: {lagrange: 0.5*(x^2 + u^2) + 0.1*x^4, mayer: 0.3*x^3}
"""


def test_spectral_convergence(lq: str, solve: Solve) -> None:
    """Errors fall with the degree at a geometric rate, of everything, in one interval."""
    t = np.linspace(0, 1, 1001)
    x, u = np.cosh(1 - t) / math.cosh(1), -np.sinh(1 - t) / math.cosh(1)
    errors = []
    for degree in (2, 4, 6, 8, 10):
        found = solve(lq, **lgr(1, degree, tolerance=1e-12))
        assert found.success
        errors.append(
            [
                abs(found.cost - math.tanh(1) / 2),
                np.abs(found.state(t)[:, 0] - x).max(),
                np.abs(found.control(t)[:, 0] - u).max(),
                np.abs(found.costate(t)[:, 0] + u).max(),
            ]
        )
        assert found.evidence.resimulation_gap < 1e-11
        assert found.evidence.ringing[0] < 2
    rates = np.log(np.array(errors[:-2]) / np.array(errors[1:-1]))  # the last reach rounding
    assert (rates > math.log(50)).all()
    assert (np.array(errors[-1]) < 1e-11).all()


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_orders_of_a_whole_optimisation(degree: int, solve: Solve) -> None:
    """In h: Radau's 2D − 1 at the nodes, and between them what polynomials can.

    Hairer, Nørsett and Wanner, *Solving Ordinary Differential Equations I*, theorem II.7.9 with the
    stages of collocation; Hager, *Numer. Math.* 87 (2000), for the optimal control.
    """
    t = np.linspace(0, 1, 997)
    truth = solve(NONLINEAR, **lgr(4, 12, tolerance=1e-12))

    def errors(cells: int) -> Array:
        found = solve(NONLINEAR, **lgr(cells, degree, tolerance=1e-12))
        return np.array(
            [
                abs(found.cost - truth.cost),
                np.abs(found.costates - truth.costate(found.times)).max(),
                np.abs(found.state(found.times) - truth.state(found.times)).max(),
                np.abs(found.state(t) - truth.state(t)).max(),
                np.abs(found.control(t) - truth.control(t)).max(),
                np.abs(found.costate(t) - truth.costate(t)).max(),
            ]
        )

    orders = np.log2(errors(16) / errors(32))
    nodes, between = 2 * degree - 1, min(degree + 1, 2 * degree - 1)
    expected = [nodes, nodes, nodes, between, degree, degree]
    assert orders == pytest.approx(expected, abs=0.3)


def test_costates_at_all_points_and_between(solve: Solve) -> None:
    """Riccati's equation of x' = a x + u with cost ∫ x² + u² and 0.5 x(1)², λ = 2 P x."""
    text = """
time: {initial: 0, final: 1}
states: {x: {initial: 1.5}}
controls: {u: {}}
dynamics: {x: 0.7*x + u}
cost: {lagrange: x^2 + u^2, mayer: 0.5*x^2}
"""
    found = solve(text, **lgr(2, 9, tolerance=1e-12))
    t = np.linspace(0, 1, 400)
    a = np.array([[0.7, -0.5], [-2.0, -0.7]])  # of x and λ, u = −λ/2
    values, vectors = np.linalg.eig(a)

    def flow(s: float) -> Array:
        return np.asarray(vectors @ np.diag(np.exp(values * s)) @ np.linalg.inv(vectors))

    end = flow(1)
    start = -(end[1, 0] - end[0, 0]) / (end[1, 1] - end[0, 1]) * 1.5  # λ(1) = x(1)
    exact = np.array([(flow(s) @ [1.5, start])[1] for s in t])
    assert found.costates[0, 0] == pytest.approx(start, abs=1e-10)
    assert found.costate(t)[:, 0] == pytest.approx(exact, abs=1e-8)
    assert found.costate(found.times) == pytest.approx(found.costates, abs=1e-14)
    axes = found.multiplier_axes["dynamics"]
    assert axes.times == pytest.approx(
        np.concatenate([radau(9).points / 2, (1 + radau(9).points) / 2])
    )
    inner = found.multipliers["dynamics"][1:9]
    assert found.costate(axes.times[1:9]) == pytest.approx(inner, abs=1e-12)


# Kinds of problems


def test_a_free_final_time_and_a_mayer_cost(solve: Solve) -> None:
    """Least T + ∫u²/2 over one metre: u = √2, T = 1/√2, λ = −u."""
    found = solve(
        """
time: {initial: 0, final: {lower: 0.1, upper: 9, guess: 3}}
states: {x: {initial: 0, final: 1}}
controls: {u: {}}
dynamics: {x: u}
cost: {lagrange: u^2/2, mayer: t}
""",
        **lgr(2, 3),
    )
    assert found.success
    assert found.cost == pytest.approx(math.sqrt(2), abs=1e-9)
    assert found.times[-1] == pytest.approx(1 / math.sqrt(2), abs=1e-8)
    assert found.control(found.dense_times) == pytest.approx(math.sqrt(2), abs=1e-7)
    assert found.costates == pytest.approx(-math.sqrt(2), abs=1e-7)


def test_an_integral_constraint_and_its_multiplier(solve: Solve) -> None:
    """Least ∫u²/2 with ∫x = q from 0 to 0: x = 6 q t (1 − t), J = 6 q², dJ/dq = 12 q."""
    found = solve(
        """
time: {initial: 0, final: 1}
states: {x: {initial: 0, final: 0}}
controls: {u: {}}
dynamics: {x: u}
cost: {lagrange: u^2/2}
constraints: {integral: {area: x == 1/6}}
""",
        **lgr(1, 4),
    )
    t = found.dense_times
    assert found.statistics.program == "QP"
    assert found.cost == pytest.approx(1 / 6, abs=1e-9)
    assert found.state(t)[:, 0] == pytest.approx(t * (1 - t), abs=1e-9)
    assert found.control(t)[:, 0] == pytest.approx(1 - 2 * t, abs=1e-8)
    assert abs(found.multipliers["integral constraint area"].item()) == pytest.approx(2, abs=1e-7)
    assert found.evidence.maximum_violation < 1e-8


def test_a_path_equality_determines_the_control_at_every_point(solve: Solve) -> None:
    """u + v = t with the least ∫u² + v²: both are t/2; the cost is 1/6."""
    found = solve(
        """
time: {initial: 0, final: 1}
states: {x: {initial: 0}}
controls: {u: {upper: 0.6}, v: {}}
dynamics: {x: u - v}
cost: {lagrange: u^2 + v^2}
constraints: {path: {both: u + v == t}}
""",
        **lgr(3, 2, path_points="nodes"),
    )
    t = found.dense_times
    assert found.control(t) == pytest.approx(np.column_stack([t / 2, t / 2]), abs=1e-8)
    assert found.cost == pytest.approx(1 / 6, abs=1e-9)
    assert len(found.multipliers["path constraint both"]) == 6


def test_a_parameter_and_no_control(solve: Solve) -> None:
    found = solve(
        """
time: {initial: 0, final: 1}
states: {x: {initial: 1}}
parameters: {p: {guess: 0.5}}
dynamics: {x: p*x}
cost: {mayer: (x - 2)^2}
""",
        **lgr(1, 10, tolerance=1e-10),
    )
    assert found.parameters == pytest.approx([math.log(2)], abs=1e-8)
    assert found.state(0.5)[0, 0] == pytest.approx(math.sqrt(2), abs=1e-8)


def test_a_constraint_of_states_alone_holds_at_the_end_too(solve: Solve) -> None:
    found = solve(
        """
time: {initial: 0, final: 1}
states: {x: {initial: 0}}
controls: {u: {upper: 1}}
dynamics: {x: u}
cost: {lagrange: (u - 1)^2}
constraints: {path: {ceiling: 2*x <= 1}, point: {gate: {at: 0.5, holds: x <= 0.2}}}
""",
        **lgr(4, 3),
    )
    assert found.state(1.0)[0, 0] == pytest.approx(0.5, abs=1e-8)
    assert found.state(0.5)[0, 0] == pytest.approx(0.2, abs=1e-8)
    assert found.cost == pytest.approx(0.5 * 0.6**2 + 0.5 * 0.4**2, abs=1e-8)


@pytest.mark.parametrize(
    ("name", "tolerance"),
    [
        ("brachistochrone", 1e-12),
        ("orbit_transfer", 1e-6),
        ("container_crane", 1e-7),
        ("van_der_pol_state", 1e-6),
        ("strongest_column", 1e-6),
        ("alychan", 1e-9),
    ],
)
def test_bundled_problems_whose_control_is_continuous(
    name: str, tolerance: float, solve: Solve
) -> None:
    found = solve(name, **lgr(25, 4))
    assert found.success
    assert found.reference is not None
    assert found.cost == pytest.approx(found.reference.cost, rel=tolerance, abs=tolerance)


def test_two_quadratic_programs_solvers_agree(lq: str, solve: Solve) -> None:
    one, other = (solve(lq, **lgr(3, 4, solver=name)) for name in ("piqp", "ipopt"))
    assert one.statistics.program == "QP"
    assert one.success
    t = np.linspace(0, 1, 50)
    assert one.control(t) == pytest.approx(other.control(t), abs=1e-6)
    assert one.costate(t) == pytest.approx(other.costate(t), abs=1e-6)


def test_what_is_no_quadratic_program_is_named(lq: str) -> None:
    text = lq.replace("u^2)", "u^4)")
    with pytest.raises(quito.UsageError, match=r"cost\.lagrange is not quadratic"):
        quito.solve(load_text(text, "test.yaml"), **lgr(1, 1, solver="piqp"))
    text = lq.replace("dynamics: {x: u}", "dynamics: {x: u - x^2}")
    with pytest.raises(quito.UsageError, match=r"the dynamics of x is not linear"):
        quito.solve(load_text(text, "test.yaml"), **lgr(2, 3, solver="piqp"))


# The evidence


def test_the_ringing_of_a_singular_arc_is_told(solve: Solve) -> None:
    """The program reports a cost below the optimum, which its control does not attain."""
    found = solve("catalyst_mixing", **lgr(25, 4))
    assert found.reference is not None
    optimum = found.reference.cost
    assert optimum is not None
    assert found.cost < optimum - 1e-4
    assert found.evidence.resimulated_cost > optimum
    assert found.evidence.ringing[0] > 1e4
    assert found.evidence.total_variation[0] > 20
    said = " ".join(found.evidence.warnings)
    assert "collocation does at jumps and on singular arcs" in said
    assert "--degree" in said
    assert "--substeps" not in said


@pytest.mark.parametrize(("steps", "degree"), [(1, 20), (100, 4)])
def test_it_is_judged_between_its_points(steps: int, degree: int, solve: Solve) -> None:
    """Around a jump the polynomials leave the bounds that their values keep."""
    found = solve("van_der_pol", **lgr(steps, degree))
    assert np.abs(found.coefficients).max() < 1 + 1e-6
    u = found.control(np.linspace(0, 4, 100_003))[:, 0]
    outside = float(np.abs(u).max()) - 1
    assert outside > 0.05
    told = [v.amount for v in found.evidence.violations if v.constraint.startswith("u")]
    assert max(told) == pytest.approx(outside, rel=0.05)
    moves = np.abs(np.diff(u)).sum()
    assert found.evidence.total_variation[0] == pytest.approx(moves, rel=0.01)


def test_an_infeasible_problem_says_what_fails(solve: Solve) -> None:
    found = solve(
        """
time: {initial: 0, final: 1}
states: {x: {initial: 0, final: 2}}
controls: {u: {lower: -1, upper: 1}}
dynamics: {x: u + 0*x^2}
cost: {lagrange: u^2}
""",
        **lgr(3, 4),
    )
    assert not found.success
    said = " ".join(found.evidence.diagnosis)
    assert "the dynamics of x" in said
    assert "x ends at 1 where 2 is asked for" in said


# Starting from an earlier answer


@pytest.mark.parametrize(
    ("before", "after"),
    [({"steps": 30}, lgr(10, 5)), (lgr(10, 5), {"steps": 30}), (lgr(3, 20), lgr(20, 3))],
    ids=["shooting to lgr", "lgr to shooting", "lgr to lgr"],
)
def test_any_answer_is_a_guess_of_any_method(
    before: dict[str, Any], after: dict[str, Any], solve: Solve
) -> None:
    first = solve("container_crane", **before)
    found = quito.solve("container_crane", guess=first, **after)
    assert found.success
    assert found.cost == pytest.approx(first.cost, rel=1e-4)


def test_a_warm_start_at_the_answer_is_the_answer(solve: Solve) -> None:
    first = solve("container_crane", **lgr(10, 5))
    again = quito.solve("container_crane", guess=first, warm_start=True, **lgr(10, 5))
    assert again.success
    assert first.statistics.iterations is not None
    assert again.statistics.iterations is not None
    assert again.statistics.iterations <= first.statistics.iterations // 3
    assert again.cost == pytest.approx(first.cost, rel=1e-9)


# Result files and words


def test_a_result_comes_back_as_it_was(solve: Solve, tmp_path: Path) -> None:
    found = solve("van_der_pol_state", **lgr(5, 6))
    found.save(tmp_path / "a.h5")
    again = quito.Solution.load(tmp_path / "a.h5")
    t = np.linspace(-1, 6, 333)
    for values in ("state", "control", "costate"):
        assert np.array_equal(getattr(again, values)(t), getattr(found, values)(t))
    assert again.basis == found.basis
    assert isinstance(again.trajectory, Polynomials)
    assert again.trajectory.degree == 6
    assert np.array_equal(again.costates, found.costates)
    assert again.evidence == found.evidence
    assert again.options == found.options
    assert {"discretization": "lgr", "degree": 6, "steps": 5}.items() <= again.options.items()
    assert {"variance", "control", "substeps"}.isdisjoint(again.options)
    again.save(tmp_path / "b.h5")
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()


def test_the_summary_says_what_it_is(solve: Solve, capsys: pytest.CaptureFixture[str]) -> None:
    print_solution(solve("van_der_pol_state", **lgr(5, 6)), verbose=True)
    said = " ".join(capsys.readouterr().out.split())
    assert "method collocation at 6 Legendre-Gauss-Radau points in each of 5 cells" in said
    assert "degree 6" in said
    assert "variance" not in said


def test_few_cells_are_no_reason_to_warn(lq: str) -> None:
    """They are too few for bumps, not for polynomials."""
    few = {"": 1, "discretization: lgr, ": 0}
    for option, warnings in few.items():
        text = f"{lq}options: {{{option}steps: 2}}\n"
        assert len(check(load_text(text, "test.yaml"))) == warnings


def test_a_file_may_not_ask_for_dense_blocks_without_end() -> None:
    text = """
time: {initial: 0, final: 1}
states: {x: {size: 10, initial: 1}}
controls: {u: {}}
dynamics: {x: u*x}
cost: {lagrange: u^2}
options: {discretization: lgr, degree: 200, steps: 100}
"""
    with pytest.raises(quito.UsageError, match=r"100 cells of 200 points .* say so with -N"):
        quito.solve(load_text(text, "large.yaml"))
    small = text.replace("steps: 100", "steps: 2").replace("degree: 200", "degree: 5")
    assert quito.solve(load_text(small, "small.yaml")).success
