"""The nonlinear program: values against a plain loop, derivatives against CasADi's own."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray

from quito_cli.problem.model import Bounds, Endpoints, Instant, Model, Variable
from quito_cli.solvers import Outcome, Status, minimise
from quito_cli.solvers.residuals import residuals
from quito_cli.transcription.cells import Discretization, PathPoints
from quito_cli.transcription.control import ControlBasis
from quito_cli.transcription.generating import GENERATING_FUNCTIONS
from quito_cli.transcription.mesh import Mesh
from quito_cli.transcription.schemes import SCHEMES, Scheme, Step
from quito_cli.transcription.transcribe import Nlp, transcribe

Array = NDArray[np.float64]
Build = Callable[[str], Model]

VECTORS = """
title: Vectors, matrices, both costs, an explicit time, bounds on some controls only
constants: {A: [[0, 1], [-2, -0.3]], B: [[1, 0.5], [0, 2]], Q: [[2, 0.5], [0.5, 1]]}
time: {initial: 0.5, final: 2}
states:
  x: {size: 2, initial: [0.3, null], lower: -4, upper: [4, .inf]}
  y: {final: 0.2}
controls:
  u: {size: 2, lower: [-1, -.inf], upper: [null, 3]}
  v: {}
dynamics:
  x: A @ x + B @ u * cos(t) + 0.1*x*y
  y: sin(x[0])*v - u[0]*u[1]*t
cost:
  lagrange: dot(x, Q @ x) + dot(u, u)*exp(-y) + t*v^2
  mayer: x[0]*y + initial(x)[1]^2*t + cos(final(x)[1])
"""
LANGUAGE = """
title: Both times free, parameters, every kind of constraint, tables, bad units
constants: {A: [[0, 1], [-2, -0.3]], c: 0.7}
time: {initial: {lower: -0.5, upper: 0.5, guess: 0.1}, final: {lower: 0.4, upper: 5, guess: 2}}
states:
  x: {size: 2, initial: [0.3, null], lower: -4, upper: [4, .inf], guess: [t, -t]SCALE}
  y: {final: 0.2, guess: 100*t}
controls:
  u: {size: 2, lower: [-1, -.inf], upper: [null, 3]}
  v: {guess: -40}
parameters: {p: {lower: -1, upper: 1}, q: {size: 2, guess: [0.2, 500]}}
tables: {wind: {x: [0, 1, 2, 3], y: [0, 1, 0.5, 2]}}
expressions: {drag: "p*dot(x, x)", power: "u[0]*v"}
dynamics:
  x: A @ x + u*cos(t) + drag
  y: sin(x[0])*v - u[0]*u[1]*t + q[0]*interpolate(t, wind)
cost:
  lagrange: dot(x, x) + dot(u, u)*exp(-0.01*y) + t*v^2 + q[0]*y
  mayer: x[0]*y + initial(x)[1]^2*t + cos(final(x)[1]) + p*initial(t)
constraints:
  path:
    disc: dot(u, u) <= 4
    mixed: -1 <= x[0]*v + p*t <= 3
    pure: x[0]*x[1] <= y
    moving: x <= [t, 2 + t]
    power: power == y
    settled: x[0]^2 <= 9
    parameters: q[0]*p <= t
  boundary:
    closed: final(x) == initial(x)
    length: final(t)*p - initial(t) <= 3*final(y)
  integral: {fuel: "dot(u, u)*y <= 5", work: -1 <= power + p <= 2}
  point:
    first: {at: 0, holds: "u[0]*x[1] + t >= p"}
    inner: {at: 0.3, holds: "[x[0]*y, v^2] <= [1, t]"}
    last: {at: 1, holds: "v*y == q[1]"}
"""
SCALED = LANGUAGE.replace("SCALE", ", scale: [1e-3, 50]").replace(
    "v: {guess", "v: {scale: 9, guess"
)
LANGUAGE = LANGUAGE.replace("SCALE", "")
LINEAR_END = """
time: {initial: 0, final: 1}
states: {x: {initial: 0}}
controls: {u: {lower: 0}}
dynamics: {x: u}
cost: {mayer: x}
"""


def implicit(step: Step) -> tuple[Any, Any]:
    """Hermite and Simpson, the state in the middle an unknown."""
    f, x0, x1, (xm,), u, t, h = step
    (f0, q0), (fm, qm), (f1, q1) = f(x0, u[0], t), f(xm, u[1], t + h / 2), f(x1, u[2], t + h)
    middle = (x0 + x1) / 2 + h / 8 * (f0 - f1) - xm
    defect = x0 + h / 6 * (f0 + 4 * fm + f1) - x1
    return ca.vertcat(middle, defect), h / 6 * (q0 + 4 * qm + q1)


ROWS = {
    **SCHEMES,
    "implicit": Scheme("implicit", "", 4, (0.0, 0.5, 1.0), 1, False, "cubic", implicit),
}


def method(
    scheme: str, substeps: int, function: str = "gaussian", normalised: bool = True, cells: int = 5
) -> Discretization:
    """A coarse method on a graded mesh."""
    nodes = np.linspace(0, 1, cells + 1) ** 1.7
    row = GENERATING_FUNCTIONS[function]
    basis = ControlBasis(row, cells, 1.3 if row.scaled else 1.0, normalised)
    return Discretization(Mesh(nodes), basis, ROWS[scheme], substeps)


def with_unknown_times_and_parameters(model: Model) -> Model:
    """The same problem with both times free and two parameters, in the dynamics and both costs."""
    p = ca.SX.sym("p", 2)
    parameters = (Variable("k", 2, 0, "", True),)
    ends: Endpoints = model.ends
    nothing = np.full(2, np.nan)
    return replace(
        model,
        parameters=parameters,
        p=p,
        xdot=model.xdot * (1 + p[0] ** 2) + p[1] * ca.cos(model.t),
        lagrange=model.lagrange + p[0] * p[1] * ca.sumsqr(model.x) * model.t,
        mayer=model.mayer + p[1] * ends.xf[0] * ends.tf**2 + ends.t0 * ends.tf * ca.sin(p[0]),
        parameter_bounds=Bounds(np.array([-1.0, -np.inf]), np.array([1.0, 2.0])),
        initial_time=Instant(-0.5, 0.5, 0.1),
        final_time=Instant(1.0, 5.0, 2.0),
        hints=replace(model.hints, parameters=nothing, parameter_scale=nothing),
    )


@dataclass(frozen=True)
class Case:
    """A problem and how it is made finite."""

    problem: str
    method: Discretization
    unknown: bool = False
    path_points: PathPoints | None = None

    def __str__(self) -> str:
        kind = {VECTORS: "vectors", LANGUAGE: "language", SCALED: "scaled"}.get(
            self.problem, self.problem
        )
        m = self.method
        parts = [kind, m.basis.function.name, m.scheme.name, f"R{m.substeps}"]
        parts += ["" if m.basis.normalised else "printed", "unknown" if self.unknown else ""]
        parts.append(self.path_points or "")
        return "-".join(part for part in parts if part)


CASES = [
    Case("van_der_pol", method("rk4", 2)),
    Case("van_der_pol", method("rk4", 1, "laguerre4")),
    Case("van_der_pol", method("rk4", 3, "sech", False)),
    Case("van_der_pol", method("euler", 2, "box")),
    Case("van_der_pol", method("rk4", 2, "hermite10", False), True),
    Case("van_der_pol", method("implicit", 2, "trigonometric"), True),
    Case("catalyst_mixing", method("rk4", 2, "laguerre6")),
    Case("catalyst_mixing", method("euler", 1, "hat"), True),
    Case("bang_bang", method("rk4", 2)),
    Case("bang_bang", method("implicit", 3, "gaussian", False)),
    Case("alychan", method("rk4", 1, "gaussian", False)),
    Case("bressan", method("rk4", 2, "hat"), True),
    Case("bryson_denham", method("implicit", 1, "laguerre4")),
    Case("rayleigh", method("euler", 3, "trigonometric")),
    Case(VECTORS, method("rk4", 2)),
    Case(VECTORS, method("rk4", 1, "laguerre4")),
    Case(VECTORS, method("implicit", 2, "laguerre6")),
    Case(VECTORS, method("rk4", 2, "hermite10"), True),
    Case(VECTORS, method("euler", 2, "gaussian", False), True),
    Case(VECTORS, method("implicit", 1, "box"), True),
]
CONSTRAINED = [
    Case(LANGUAGE, method("rk4", 2)),
    Case(LANGUAGE, method("rk4", 1)),
    Case(LANGUAGE, method("rk4", 2, "laguerre4"), path_points="substeps"),
    Case(LANGUAGE, method("rk4", 1, "hermite10", False), path_points="nodes"),
    Case(LANGUAGE, method("euler", 2)),
    Case(LANGUAGE, method("euler", 1, "box"), path_points="substeps"),
    Case(LANGUAGE, method("implicit", 2, "hat")),
    Case(LANGUAGE, method("implicit", 1, "sech"), path_points="substeps"),
    Case(SCALED, method("rk4", 2, "trigonometric")),
    Case(SCALED, method("rk4", 1), path_points="substeps"),
    Case(SCALED, method("euler", 2, "hat")),
    Case(SCALED, method("implicit", 2)),
]
CASES += CONSTRAINED
cases = pytest.mark.parametrize("case", CASES, ids=str)


def made(case: Case, build: Build, scale: float | None = 7.0) -> Nlp:
    model = build(case.problem)
    if case.unknown:
        model = with_unknown_times_and_parameters(model)
    return transcribe(model, case.method, scale, case.path_points)


def points(nlp: Nlp, count: int = 2) -> list[Array]:
    """Random points near the guess, where every expression is defined."""
    rng = np.random.default_rng(7)
    return [nlp.guess + rng.uniform(-0.4, 0.4, len(nlp.guess)) for _ in range(count)]


def dense(matrix: Any) -> Array:
    return np.array(ca.DM(matrix), dtype=float)


# Derivatives


@cases
def test_first_derivatives_are_those_of_casadi(case: Case, model: Build) -> None:
    nlp = made(case, model)
    a = nlp.assembled
    theirs = ca.Function(
        "theirs",
        [a.unknowns],
        [
            a.objective,
            a.constraints,
            ca.gradient(a.objective, a.unknowns),
            ca.jacobian(a.constraints, a.unknowns),
        ],
    )
    for w in points(nlp):
        f, g, gradient, jacobian = (dense(value) for value in theirs(w))
        ours_f, ours_gradient = a.gradient(w, [])
        ours_g, ours_jacobian = a.jacobian(w, [])
        assert np.isfinite(jacobian).all()
        assert float(ours_f) == pytest.approx(f.item(), rel=1e-13, abs=1e-13)
        assert ours_gradient.is_dense()  # IPOPT's interface reads garbage otherwise
        assert dense(ours_gradient) == pytest.approx(gradient, rel=1e-11, abs=1e-11)
        assert dense(ours_g) == pytest.approx(g, rel=1e-13, abs=1e-13)
        assert ours_jacobian.shape == (len(nlp.row_lower), len(nlp.guess))
        assert dense(ours_jacobian) == pytest.approx(jacobian, rel=1e-11, abs=1e-11)


@cases
def test_second_derivatives_are_those_of_casadi(case: Case, model: Build) -> None:
    nlp = made(case, model)
    a = nlp.assembled
    sigma, lam = ca.MX.sym("sigma"), ca.MX.sym("lam", len(nlp.row_lower))
    lagrangian = sigma * a.objective + ca.dot(lam, a.constraints)
    theirs = ca.Function("h", [a.unknowns, sigma, lam], [ca.hessian(lagrangian, a.unknowns)[0]])
    rng = np.random.default_rng(8)
    for w, weight in zip(points(nlp), (1.0, -0.3), strict=True):
        multipliers = rng.normal(size=len(nlp.row_lower))
        expected = dense(theirs(w, weight, multipliers))
        ours = a.hessian(w, [], weight, multipliers)
        assert ours.sparsity().is_triu()
        upper = dense(ours)
        assert np.isfinite(expected).all()
        assert upper == pytest.approx(np.triu(expected), rel=1e-10, abs=1e-10)
        assert np.triu(expected, 1) == pytest.approx(np.tril(expected, -1).T, abs=1e-10)


@pytest.mark.parametrize("case", [CASES[5], CASES[17], CONSTRAINED[0]], ids=str)
def test_derivatives_are_those_of_finite_differences(case: Case, model: Build) -> None:
    nlp = made(case, model)
    a, step = nlp.assembled, 1e-5
    large = 1e-6 if case in CONSTRAINED else None  # some of their rows are of size 1e4
    w = points(nlp, 1)[0]
    lam = np.random.default_rng(9).normal(size=len(nlp.row_lower))
    gradient, jacobian = dense(a.gradient(w, [])[1])[:, 0], dense(a.jacobian(w, [])[1])
    upper = dense(a.hessian(w, [], 0.7, lam))
    hessian = upper + np.triu(upper, 1).T
    for i in {0, 1, 2, 3, *np.random.default_rng(10).integers(0, len(w), 40).tolist()}:
        unit = step * np.eye(len(w))[i]
        f = [float(a.gradient(w + s * unit, [])[0]) for s in (1, -1)]
        g = [dense(a.jacobian(w + s * unit, [])[0])[:, 0] for s in (1, -1)]
        slopes = [
            0.7 * dense(a.gradient(w + s * unit, [])[1])[:, 0]
            + dense(a.jacobian(w + s * unit, [])[1]).T @ lam
            for s in (1, -1)
        ]
        assert gradient[i] == pytest.approx((f[0] - f[1]) / (2 * step), abs=1e-6, rel=1e-6)
        assert jacobian[:, i] == pytest.approx((g[0] - g[1]) / (2 * step), abs=1e-6, rel=large)
        assert hessian[:, i] == pytest.approx(
            (slopes[0] - slopes[1]) / (2 * step), abs=1e-6, rel=1e-6
        )


@cases
def test_the_patterns_hold_nothing_that_is_always_zero(case: Case, model: Build) -> None:
    """As sparse as CasADi's own: a full block would cost time and memory."""
    nlp = made(case, model)
    a = nlp.assembled
    theirs = ca.jacobian(a.constraints, a.unknowns).nnz()
    assert a.jacobian.nnz_out(1) <= 1.3 * theirs


# Values, by a plain loop over cells


def plain_program(model: Model, m: Discretization, nlp: Nlp, w: Array) -> tuple[float, Any]:
    """f and g of an explicit scheme, written out: û by its sum, one step after another."""
    layout, w = m.layout(model), w * nlp.unit
    t0, tf = layout.times(w, model)
    p, x = layout.parameters(w), layout.states(w)
    c = layout.coefficient_table(w)
    ghosts, root = m.basis.ghosts, math.sqrt(m.basis.variance)

    def control(s: float) -> Any:
        distances = s - np.arange(len(c), dtype=np.float64) + ghosts
        weights = m.basis.function.value(distances / root)
        return np.asarray(weights @ c / (weights.sum() if m.basis.normalised else root))

    def f(state: Any, u: Any, t: float) -> tuple[Any, float]:
        xdot, cost = model.right_hand_side(state, u, p, t)
        return dense(xdot)[:, 0], dense(cost)[0, 0]

    total, defects = 0.0, []
    for k, (a, b) in enumerate(itertools.pairwise(t0 + (tf - t0) * m.mesh.fractions)):
        h = (b - a) / m.substeps
        state: Any = x[k]
        for j in range(m.substeps):
            t, s = a + j * h, k + j / m.substeps
            half, one = 0.5 / m.substeps, 1 / m.substeps
            k1, q1 = f(state, control(s), t)
            if m.scheme.name == "euler":
                state, total = state + h * k1, total + h * q1
                continue
            k2, q2 = f(state + h / 2 * k1, control(s + half), t + h / 2)
            k3, q3 = f(state + h / 2 * k2, control(s + half), t + h / 2)
            k4, q4 = f(state + h * k3, control(s + one), t + h)
            state = state + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
            total += h / 6 * (q1 + 2 * q2 + 2 * q3 + q4)
        defects.append(state - x[k + 1])
    mayer = float(model.end_cost(x[0], t0, x[-1], tf, p))
    return nlp.objective_scale * (total + mayer), np.concatenate(defects)


@pytest.mark.parametrize(
    "case",
    [c for c in CASES if c.method.scheme.explicit and not c.method.basis.function.cellwise],
    ids=str,
)
def test_values_are_those_of_a_plain_loop(case: Case, model: Build) -> None:
    nlp = made(case, model)
    given = nlp.transcription.model
    for w in points(nlp):
        f, defects = plain_program(given, case.method, nlp, w)
        found = dense(nlp.assembled.jacobian(w, [])[0])[:, 0] / nlp.row_scale
        assert float(nlp.assembled.gradient(w, [])[0]) == pytest.approx(f, rel=1e-6)
        assert found[nlp.blocks[0].rows] == pytest.approx(defects, abs=1e-6)


def plain_constraints(model: Model, case: Case, nlp: Nlp, w: Array) -> dict[str, Array]:
    """Every constraint by name, (places, labels), with states stepped and joined by hand."""
    m, w = case.method, w * nlp.unit
    layout = m.layout(model)
    t0, tf = layout.times(w, model)
    p, x, c = layout.parameters(w), layout.states(w), layout.coefficient_table(w)
    names = [con.name for con in model.constraints.path]
    found: dict[str, list[Array]] = {name: [] for name in names}
    totals = np.zeros(len(model.constraints.integral))

    def f(state: Any, u: Any, t: float) -> tuple[Any, Any]:
        xdot, integrands = model.right_hand_side(state, u, p, t)
        return dense(xdot)[:, 0], dense(integrands)[1:, 0]

    def note(k: int, offset: float, state: Any, t: float) -> None:
        u = m.basis.evaluate(c, np.array([k]), np.array([offset]))[0]
        for con in model.constraints.path:
            inside = 1e-9 < offset < 1 - 1e-9
            everywhere = con.uses_control
            if case.path_points:
                everywhere = case.path_points == "substeps"
            if con.uses_control and con.bounds.fixed.all():  # it determines û: see below
                everywhere = abs(offset - 0.5) < 1e-9
            if everywhere or not inside:
                found[con.name].append(dense(model.function(con)(state, u, p, t))[:, 0])

    nodes = t0 + (tf - t0) * m.mesh.fractions
    for k, (a, b) in enumerate(itertools.pairwise(nodes)):
        h, state = (b - a) / m.substeps, x[k]
        for j in range(m.substeps):
            u = [
                m.basis.evaluate(c, np.array([k]), np.array([(j + s) / m.substeps]))[0]
                for s in (0, 0.5, 1)
            ]
            t, before = a + j * h, state
            note(k, j / m.substeps, before, t)
            k1, q1 = f(state, u[0], t)
            if m.scheme.name == "euler":
                state, totals = state + h * k1, totals + h * q1
                continue
            k2, q2 = f(state + h / 2 * k1, u[1], t + h / 2)
            k3, q3 = f(state + h / 2 * k2, u[1], t + h / 2)
            k4, q4 = f(state + h * k3, u[2], t + h)
            state = state + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
            totals = totals + h / 6 * (q1 + 2 * q2 + 2 * q3 + q4)
            middle = (before + state) / 2 + h / 8 * (k1 - f(state, u[2], t + h)[0])
            note(k, (j + 0.5) / m.substeps, middle, t + h / 2)
    note(m.mesh.cells - 1, 1.0, x[-1], tf)
    values = {f"path constraint {name}": np.array(rows) for name, rows in found.items()}
    for con, total in zip(model.constraints.integral, totals, strict=True):
        values[f"integral constraint {con.name}"] = np.array([[total]])
    ends = dense(model.boundary_values(x[0], t0, x[-1], tf, p)[0])[:, 0]
    for con in model.constraints.boundary:
        rows = len(con.bounds.lower)
        values[f"boundary constraint {con.name}"], ends = ends[None, :rows], ends[rows:]
    for con in model.constraints.point:
        node = int(np.argmin(np.abs(m.mesh.fractions - (con.at or 0))))
        cell, place = (node, 0.0) if node < m.mesh.cells else (node - 1, 1.0)
        u = m.basis.evaluate(c, np.array([cell]), np.array([place]))[0]
        value = dense(model.function(con)(x[node], u, p, nodes[node]))
        values[f"point constraint {con.name}"] = value.T
    return values


@pytest.mark.parametrize("case", [c for c in CONSTRAINED if c.method.scheme.explicit], ids=str)
def test_constraints_are_those_of_a_plain_loop(case: Case, model: Build) -> None:
    nlp = made(case, model)
    given = nlp.transcription.model
    for w in points(nlp):
        rows = dense(nlp.assembled.jacobian(w, [])[0])[:, 0] / nlp.row_scale
        expected = plain_constraints(given, case, nlp, w)
        said = {b.name for b in nlp.blocks} - {"dynamics", "control bounds", "horizon"}
        assert said == set(expected)
        for block in nlp.blocks:
            if block.name in expected:
                values = rows[block.rows].reshape(-1, len(block.labels))
                assert values == pytest.approx(expected[block.name], rel=1e-9, abs=1e-9), block.name


def test_units_leave_the_problem_as_it_is(model: Build) -> None:
    """The same point in other units: the same cost, rows, bounds and, once unscaled, slopes."""
    one, other = (made(Case(text, method("rk4", 2)), model) for text in (LANGUAGE, SCALED))
    assert np.abs(np.log2(other.unit / one.unit)).max() > 5
    w = points(one, 1)[0] * one.unit
    for name in ("lower", "upper"):
        a, b = (getattr(nlp, name) * nlp.unit for nlp in (one, other))
        assert a == pytest.approx(b, rel=1e-14)
        a, b = (getattr(nlp, f"row_{name}") / nlp.row_scale for nlp in (one, other))
        assert a == pytest.approx(b, rel=1e-14)
    f, g = (nlp.assembled.gradient(w / nlp.unit, []) for nlp in (one, other))
    assert float(f[0]) == pytest.approx(float(g[0]), rel=1e-12)
    assert dense(f[1])[:, 0] / one.unit == pytest.approx(dense(g[1])[:, 0] / other.unit, rel=1e-9)
    rows, slopes = [], []
    for nlp in (one, other):
        values, jacobian = nlp.assembled.jacobian(w / nlp.unit, [])
        rows.append(dense(values)[:, 0] / nlp.row_scale)
        slopes.append(dense(jacobian) / nlp.row_scale[:, None] / nlp.unit)
    assert rows[0] == pytest.approx(rows[1], rel=1e-10, abs=1e-10)
    assert slopes[0] == pytest.approx(slopes[1], rel=1e-9, abs=1e-9)


# Bounds and rows


def test_a_positive_function_bounds_its_coefficients(model: Build) -> None:
    nlp = made(Case("catalyst_mixing", method("rk4", 2)), model)
    first = nlp.transcription.layout.first_coefficient
    assert [block.name for block in nlp.blocks] == ["dynamics"]
    assert (nlp.lower[first:] == 0).all()
    assert (nlp.upper[first:] == 1).all()


@pytest.mark.parametrize(("function", "normalised"), [("laguerre4", True), ("gaussian", False)])
@pytest.mark.parametrize("substeps", [1, 2])
def test_the_others_are_bounded_at_nodes_and_offsets(
    function: str, normalised: bool, substeps: int, model: Build
) -> None:
    m = method("rk4", substeps, function, normalised)
    nlp = made(Case("catalyst_mixing", m), model)
    first = nlp.transcription.layout.first_coefficient
    # The bounds are 0 and 1; a range of room on either side is for ghosts that no row sees.
    assert (nlp.lower[first:] == -1).all()
    assert (nlp.upper[first:] == 2).all()
    block = nlp.blocks[1]
    inner = np.linspace(0, 1, 2 * substeps + 1)  # nodes, middles and ends of substeps
    nodes = m.mesh.fractions
    places = np.unique([a + (b - a) * s for a, b in itertools.pairwise(nodes) for s in inner])
    assert block.fractions == pytest.approx(places, abs=1e-12)
    assert (nlp.row_lower[block.rows] == 0).all()
    assert (nlp.row_upper[block.rows] == 1).all()
    w = points(nlp, 1)[0]
    rows = dense(nlp.assembled.jacobian(w, [])[0])[block.rows, 0]
    c = nlp.transcription.layout.coefficient_table(w)
    expected = m.basis.evaluate(c, *m.mesh.locate(places))[:, 0]
    assert rows == pytest.approx(expected, abs=1e-12)


def test_only_bounded_controls_have_rows(model: Build) -> None:
    nlp = made(Case(VECTORS, method("rk4", 2, "laguerre4")), model)
    block = nlp.blocks[1]
    assert block.labels == ("u[0]", "u[1]")
    assert (block.lower == [-1, -np.inf]).all()
    assert (block.upper == [np.inf, 3]).all()
    assert block.lower.shape == block.upper.shape == (len(block.fractions), 2)
    assert nlp.row_lower[block.rows].reshape(-1, 2)[3].tolist() == [-1, -np.inf]
    w = points(nlp, 1)[0]
    rows = dense(nlp.assembled.jacobian(w, [])[0])[block.rows, 0].reshape(-1, 2)
    c = nlp.transcription.layout.coefficient_table(w)
    m = nlp.transcription.method
    u = m.basis.evaluate(c, *m.mesh.locate(block.fractions))
    assert rows == pytest.approx(u[:, :2], abs=1e-12)


def test_bounds_of_the_states_and_ends(model: Build) -> None:
    nlp = made(Case(VECTORS, method("rk4", 2)), model)
    layout = nlp.transcription.layout
    lower, upper = layout.states(nlp.lower), layout.states(nlp.upper)
    assert lower[0].tolist() == [0.3, -4, -np.inf]
    assert upper[0].tolist() == [0.3, np.inf, np.inf]
    assert lower[2].tolist() == [-4, -4, -np.inf]
    assert upper[2].tolist() == [4, np.inf, np.inf]
    assert lower[-1].tolist() == [-4, -4, 0.2]
    assert upper[-1].tolist() == [4, np.inf, 0.2]


@cases
def test_the_guess_is_within_its_bounds(case: Case, model: Build) -> None:
    nlp = made(case, model)
    assert np.isfinite(nlp.guess).all()
    assert (nlp.guess >= nlp.lower).all()
    assert (nlp.guess <= nlp.upper).all()


def test_the_objective_is_scaled_to_a_hundred_at_most(model: Build) -> None:
    for problem in ("van_der_pol", "rayleigh"):
        nlp = made(Case(problem, method("rk4", 2)), model, None)
        value = float(nlp.assembled.gradient(nlp.guess, [])[0])
        cost = value / nlp.objective_scale
        assert nlp.objective_scale == pytest.approx(100 / max(1.0, abs(cost)), rel=1e-12)
    twice = made(Case("rayleigh", method("rk4", 2)), model, 2.0)
    assert twice.objective_scale == 2.0


# Free times and parameters are solved, too

SHORTEST = """
time: {initial: 0, final: {lower: 0.1, upper: 10, guess: 1}}
states: {x: {initial: 0, final: 1}, v: {initial: 0, final: 0}}
controls: {u: {lower: -1, upper: 1}}
dynamics: {x: v, v: u}
cost: {mayer: t}
"""
AVERAGE = """
time: {initial: 0, final: 1}
states: {x: {initial: 0}}
controls: {u: {lower: 1, upper: 1}}
parameters: {p: {guess: 0}}
dynamics: {x: u}
cost: {lagrange: (x - p)^2}
"""


def test_the_shortest_time_of_a_double_integrator_is_two(model: Build) -> None:
    free = model(SHORTEST)
    basis = ControlBasis(GENERATING_FUNCTIONS["box"], 10, 1.0, True)
    nlp = transcribe(free, Discretization(Mesh.uniform(10), basis, SCHEMES["rk4"], 2), None, None)
    outcome, _ = minimise(nlp, "ipopt", 1e-10, 200, {}, None, None)
    assert outcome.status is Status.SOLVED
    w = outcome.w * nlp.unit
    assert nlp.transcription.layout.times(w, free) == pytest.approx((0, 2), abs=1e-8)
    c = nlp.transcription.layout.coefficient_table(w)[:, 0]
    assert c == pytest.approx([1] * 5 + [-1] * 5, abs=1e-6)


def test_the_best_constant_is_the_average(model: Build) -> None:
    """min over p of ∫(t − p)² on [0, 1]: p = 1/2, cost 1/12."""
    free = model(AVERAGE)
    nlp = transcribe(free, method("rk4", 2, "box"), None, None)
    outcome, _ = minimise(nlp, "ipopt", 1e-10, 200, {}, None, None)
    found = nlp.transcription.layout.parameters(outcome.w * nlp.unit)
    assert found == pytest.approx([0.5], abs=1e-9)
    cost = float(nlp.assembled.gradient(outcome.w, [])[0]) / nlp.objective_scale
    assert cost == pytest.approx(1 / 12, abs=1e-10)


# The judgement of an answer


@pytest.fixture(scope="module")
def answer(model: Build) -> tuple[Nlp, Outcome]:
    nlp = transcribe(model("van_der_pol"), method("rk4", 2, cells=20), None, None)
    assert (nlp.unit == 1).all()  # sizes are ordinary here: scaled and unscaled are the same
    assert (nlp.row_scale == 1).all()
    outcome, found = minimise(nlp, "ipopt", 1e-9, 200, {}, None, None)
    assert outcome.status is Status.SOLVED
    assert found.largest <= 1e-8
    return nlp, outcome


def judged(nlp: Nlp, outcome: Outcome, monkeypatch: pytest.MonkeyPatch) -> Status:
    """What becomes of the answer of a solver that returns `outcome`."""
    monkeypatch.setattr("quito_cli.solvers.nlpsol.solve", lambda *_: outcome)
    return minimise(nlp, "ipopt", 1e-9, 200, {}, None, None)[0].status


def test_a_solver_that_lies_is_not_believed(
    answer: tuple[Nlp, Outcome], monkeypatch: pytest.MonkeyPatch
) -> None:
    nlp, outcome = answer
    free = int(np.argmax(nlp.upper - nlp.lower))
    moved = outcome.w.copy()
    moved[free] += 1e-4
    assert judged(nlp, replace(outcome, w=moved), monkeypatch) is Status.INACCURATE
    wrong = replace(outcome, lam_g=1.001 * outcome.lam_g)
    assert judged(nlp, wrong, monkeypatch) is Status.INACCURATE
    nothing = replace(outcome, w=np.full_like(outcome.w, np.nan))
    assert judged(nlp, nothing, monkeypatch) is Status.INACCURATE
    inside = nlp.guess.copy()
    none = replace(outcome, w=inside, lam_g=0 * outcome.lam_g, lam_w=0 * outcome.lam_w)
    assert judged(nlp, none, monkeypatch) is Status.INACCURATE


def test_a_solver_that_is_too_modest_is_believed_by_its_residuals(
    answer: tuple[Nlp, Outcome], monkeypatch: pytest.MonkeyPatch
) -> None:
    nlp, outcome = answer
    for said in (Status.ACCEPTABLE, Status.STUCK, Status.ITERATION_LIMIT):
        assert judged(nlp, replace(outcome, status=said), monkeypatch) is Status.SOLVED
    stopped = replace(outcome, status=Status.INTERRUPTED)
    assert judged(nlp, stopped, monkeypatch) is Status.INTERRUPTED


def test_feasibility_is_the_largest_violation(answer: tuple[Nlp, Outcome]) -> None:
    nlp, outcome = answer
    layout = nlp.transcription.layout
    last = layout.first_coefficient - 1  # the last state enters one defect only, as −x
    beyond = outcome.w.copy()
    beyond[last] += 0.25
    assert residuals(nlp, replace(outcome, w=beyond)).feasibility == pytest.approx(0.25, abs=1e-6)
    outside = outcome.w.copy()
    outside[layout.first_coefficient] = 1.5  # |u| ≤ 1
    assert residuals(nlp, replace(outcome, w=outside)).feasibility >= 0.5 - 1e-12


def test_multipliers_of_bounds_that_are_not_active_count(answer: tuple[Nlp, Outcome]) -> None:
    nlp, outcome = answer
    m = nlp.transcription.layout.first_coefficient
    c = outcome.w[m:]
    inner = m + int(np.argmin(np.abs(c)))
    lam = outcome.lam_w.copy()
    lam[inner] = 5.0
    found = residuals(nlp, replace(outcome, lam_w=lam))
    assert found.complementarity == pytest.approx(5 * (1 - outcome.w[inner]), rel=0.2)
    assert found.stationarity == pytest.approx(5, rel=0.2)


@pytest.mark.parametrize("function", ["hat", "laguerre4"])
def test_a_multiplier_of_a_bound_that_does_not_exist_counts(function: str, model: Build) -> None:
    """u ≥ 0 alone, and the end is to be large: u = 0 is no answer, whatever the multipliers say."""
    given = model(LINEAR_END)
    away = replace(given, mayer=-given.mayer)
    nlp = transcribe(away, method("euler", 1, function), 1.0, None)
    w = np.zeros(len(nlp.guess))
    gradient = dense(nlp.assembled.gradient(w, [])[1])[:, 0]
    jacobian = dense(nlp.assembled.jacobian(w, [])[1])
    free = nlp.lower < nlp.upper
    lam_g: Any = np.linalg.lstsq(jacobian.T[free], -gradient[free], rcond=None)[0]
    lam_w = np.where(free, -(gradient + jacobian.T @ lam_g), 0.0)
    claimed = Outcome(Status.SOLVED, w, lam_g, lam_w, 0, {}, 0.0, 0.0, "", "ipopt")
    assert residuals(nlp, claimed).largest > 1e-3
