"""Pontryagin's system against closed forms, references, derivations and finite differences."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import quito_cli as quito
from quito_cli.optimality import Pontryagin, pontryagin
from quito_cli.optimality.constraints import Active, active
from quito_cli.optimality.hamiltonian import sampled
from quito_cli.optimality.looking.controls import controls
from quito_cli.optimality.singular import Singular, singular
from quito_cli.optimality.symbols.elimination import eliminated, known_hamiltonian
from quito_cli.optimality.symbols.probes import Probe
from quito_cli.optimality.transversality import point_jumps, transversality
from quito_cli.problem.build import build
from quito_cli.problem.library import bundled
from quito_cli.problem.load import load_text
from quito_cli.problem.model import Known, Model

Array = NDArray[np.float64]
Build = Callable[[str], Model]

ROOT = Path(__file__).parent.parent
BUNDLED = sorted(bundled())
DERIVED = sorted(
    path.stem
    for path in (ROOT / "tests" / "derivations").glob("*.py")
    if path.stem not in ("__init__", "truth")
)


@cache
def system(problem: str) -> tuple[Pontryagin, Probe]:
    given = load_text(problem, "test.yaml") if "\n" in problem else quito.load(problem)
    found = pontryagin(build(given))
    return found, Probe(found)


def arc(problem: str, *which: int, interior: tuple[int, ...] = ()) -> Singular:
    return singular(*system(problem), which or (0,), interior)


def feedback(problem: str, x: Array, which: int = 0) -> Array:
    """The singular control in the state alone, with NaN for every costate."""
    found = eliminated(arc(problem, which), system(problem)[1])
    assert found is not None
    assert found.left == ()
    n, m = len(x), found.system.model
    values = (np.zeros(n), x, np.full((n, m.n_x), np.nan), np.full((n, m.n_u), np.nan))
    return sampled(found.function, (*values, np.zeros(m.n_p), None, None))[0]


def small(text: str) -> str:
    """A problem of two free states on [0, 1] with what `text` adds."""
    states = "time: {initial: 0, final: 1}\nstates: {x: {initial: 1}, y: {initial: 0}}\n"
    return f"title: small\n{states}{text}\n"


# Hamiltonian and adjoint equations


def test_the_linear_quadratic_problem_against_riccati(lq: str) -> None:
    found, _ = system(lq)
    t = np.linspace(0, 1, 11)
    x, costate = np.cosh(1 - t) / np.cosh(1), np.sinh(1 - t) / np.cosh(1)
    columns = (x[:, None], costate[:, None], -costate[:, None])
    point = found.along(t, *columns, np.zeros(0))
    assert point.hamiltonian == pytest.approx(np.full(11, 0.5 / np.cosh(1) ** 2), abs=1e-15)
    assert point.adjoint[:, 0] == pytest.approx(-np.cosh(1 - t) / np.cosh(1), abs=1e-15)
    assert point.gradient == pytest.approx(np.zeros((11, 1)), abs=1e-15)
    assert point.curvature == pytest.approx(np.ones((11, 1, 1)))
    assert point.rate == pytest.approx(np.zeros(11))
    (regular,) = controls(*system(lq)).regular
    assert regular.closed is not None
    law = regular.along(t, *columns, np.zeros(0))
    assert law[:, 0] == pytest.approx(-costate, abs=1e-15)


@pytest.mark.parametrize("name", BUNDLED)
def test_derivatives_are_those_of_the_hamiltonian(name: str) -> None:
    found, probe = system(name)
    m = found.model
    x, costate, u, p, t, mu, nu, _ = (values[:, 0] for values in probe.points)

    def point(x: Array, u: Array, p: Array, t: float = float(t[0])) -> Any:
        given = found.along(
            *(np.array([t]), x[None], costate[None], u[None], p), mu=mu[None], nu=nu
        )
        values = [np.array(m.function(c)(x, u, p, t)).ravel() for c in m.constraints.path]
        bounded = np.isfinite(m.state_bounds.lower) | np.isfinite(m.state_bounds.upper)
        rows = np.concatenate([*values, x[bounded]])
        return given, given.hamiltonian[0] + mu @ rows

    values = point(x, u, p)[0]
    scale = 1 + abs(values.hamiltonian[0])
    for slopes, place, size, sign in (
        (values.adjoint[0], 0, m.n_x, -1),
        (values.gradient[0], 1, m.n_u, 1),
        (values.parameters[0], 2, m.n_p, 1),
    ):
        for i in range(size):
            sides = []
            step = 1e-5
            for shift in (step, -step):
                moved = [x.copy(), u.copy(), p.copy()]
                moved[place][i] += shift
                sides.append(point(moved[0], moved[1], moved[2])[1])
            slope = sign * (sides[0] - sides[1]) / (2 * step)
            assert slopes[i] == pytest.approx(slope, rel=1e-5, abs=1e-5 * scale)
    gap = point(x, u, p, float(t[0]) + 1e-5)[1] - point(x, u, p, float(t[0]) - 1e-5)[1]
    assert values.rate[0] == pytest.approx(gap / 2e-5, rel=1e-5, abs=1e-5 * scale)


# Singular controls


def test_aly_chan_van_der_pol_and_bressan_as_papers_state_them() -> None:
    x = np.random.default_rng(1).uniform(-2, 2, (20, 3))
    assert feedback("alychan", x)[:, 0] == pytest.approx(-x[:, 0], abs=1e-14)
    assert feedback("bressan", x)[:, 0] == pytest.approx(np.full(20, 0.5))
    x1, x2 = x[:, 0], x[:, 1]
    law = 2 * x1 - (1 - x1**2) * x2
    assert feedback("van_der_pol", x[:, :2])[:, 0] == pytest.approx(law, abs=1e-13)


def test_catalyst_mixing_has_a_surface_and_a_constant_on_it() -> None:
    found = eliminated(arc("catalyst_mixing"), system("catalyst_mixing")[1])
    assert found is not None
    y = (10 - np.sqrt(10)) / 90
    x1 = np.linspace(0.5, 1, 5)
    x = np.column_stack([x1, y * x1])
    us = y / (1 - 8 * y - 10 * y**2)
    assert feedback("catalyst_mixing", x)[:, 0] == pytest.approx(np.full(5, us), abs=1e-13)
    surface = found.system.function("surface", [found.surface])
    for row in x:
        assert float(surface(row, 0, 0, [], 0, [], [])) == pytest.approx(0, abs=1e-14)
    assert abs(float(surface(x[0] + [0, 0.1], 0, 0, [], 0, [], []))) > 0.1


def test_goddard_s_surface_is_the_known_one() -> None:
    found = eliminated(arc("goddard"), system("goddard")[1])
    assert found is not None
    surface = found.system.function("surface", [found.surface])
    h, v, c = 1.005, 0.08, 0.5
    drag = 310 * v**2 * np.exp(-500 * (h - 1))
    on = [h, v, drag * (1 + v / c) * h**2]
    values = [float(surface(x, 0, 0, [], 0, [], [])) for x in (on, [h, v, 1.1 * on[2]])]
    assert abs(values[0]) < 1e-13 < abs(values[1])


@pytest.mark.parametrize("name", ["alychan", "bressan", "van_der_pol", "catalyst_mixing"])
def test_feedback_along_the_reference(name: str, reference: Any) -> None:
    _, samples = reference(name)
    m = system(name)[0].model
    law, u = feedback(name, samples["x"])[:, 0], samples["u"][:, 0]
    low, high = (float(side[0]) for side in m.control_bounds)
    inside = (u > low + 1e-6) & (u < high - 1e-6) | (name == "alychan")
    assert inside.sum() > 40
    assert law[inside] == pytest.approx(u[inside], abs=1e-9)


@pytest.mark.parametrize("name", ["goddard", "lotka_volterra_fishing"])
def test_feedback_along_a_derived_answer(name: str) -> None:
    truth = importlib.import_module(f"derivations.{name}").derive()
    law, u = feedback(name, truth.states)[:, 0], truth.controls[:, 0]
    low, high = (float(side[0]) for side in system(name)[0].model.control_bounds)
    inside = (u > low + 1e-9) & (u < high - 1e-9)
    assert inside.sum() > 20
    assert law[inside] == pytest.approx(u[inside], abs=1e-6)


ORDERS = [
    ("alychan", 0, 1),
    ("bressan", 0, 1),
    ("van_der_pol", 0, 1),
    ("catalyst_mixing", 0, 1),
    ("goddard", 0, 1),
    ("lotka_volterra_fishing", 0, 1),
    ("minimum_time", 0, None),
    ("moon_lander", 0, None),
    ("siri", 0, 1),
    ("siri", 2, 1),
]


@pytest.mark.parametrize(("name", "control", "order"), ORDERS)
def test_orders_and_kinds(name: str, control: int, order: int | None) -> None:
    assert controls(*system(name)).kinds[control] == "affine"
    found = arc(name, control)
    assert found.order == order
    assert found.reason == ("" if order else "no finite order")
    assert (found.coefficient is None) == (order is None)


@pytest.mark.parametrize("name", ["van_der_pol", "siri", "goddard", "lotka_volterra_fishing"])
def test_derivatives_of_the_switching_function_along_an_integrated_flow(name: str) -> None:
    """The flow is integrated by Runge's method with constant controls, and σ differenced."""
    found, probe = system(name)
    m = found.model
    switching = arc(name)
    assert switching.coefficient is not None
    rows = [*switching.derivatives[0]]
    last = switching.coefficient[0] * m.u[0] + switching.remainder[0]  # type: ignore[index]
    function = found.function("rows", [*rows, last])
    x, costate, u, _, t, _, _, _ = (values[:, 3] for values in probe.points)
    y = np.concatenate([x, costate])

    def rate(y: Array, t: float) -> Array:
        x, costate = y[: m.n_x], y[m.n_x :]
        xdot = np.array(m.right_hand_side(x, u, [], t)[0]).ravel()
        free = found.function("free", [found.free_adjoint])
        return np.concatenate(
            [xdot, np.array(free(x, costate, u, [], t, np.zeros(len(found.rows)), [])).ravel()]
        )

    def values(h: float) -> Array:
        a = rate(y, t[0])
        b = rate(y + h / 2 * a, t[0])
        c = rate(y + h / 2 * b, t[0])
        z = y + h / 6 * (a + 2 * b + 2 * c + rate(y + h * c, t[0]))
        given = function(z[: m.n_x], z[m.n_x :], u, [], t[0], np.zeros(len(found.rows)), [])
        return np.array([float(value) for value in given])

    h = 1e-4
    slopes = (values(h) - values(-h)) / (2 * h)
    now = values(0.0)
    for slope, derivative in zip(slopes[:-1], now[1:], strict=True):
        assert derivative == pytest.approx(slope, rel=1e-4, abs=1e-6 * np.abs(now).max())


@pytest.mark.parametrize(
    ("name", "sign"), [("bressan", 2.0), ("van_der_pol", 1.0), ("alychan", 1.0)]
)
def test_legendre_clebsch(name: str, sign: float) -> None:
    found = eliminated(arc(name), system(name)[1])
    assert found is not None
    m = found.system.model
    clebsch = found.system.function("clebsch", [found.clebsch])
    costate = np.zeros(m.n_x)
    # The costate of the state that is the Mayer cost of its problem.
    costate[-1] = {"bressan": -1.0, "alychan": 1.0}.get(name, 0.0)
    value = float(clebsch(np.full(m.n_x, 0.3), costate, 0, [], 0, [], []))
    assert value == pytest.approx(2.0 if name == "bressan" else sign)


def test_a_maximum_has_the_other_sign() -> None:
    text = small("controls: {u: {}}\ndynamics: {x: u, y: 0}\ncost: {lagrange: -x^2}")
    found = arc(text)
    assert (found.order, float(found.clebsch)) == (1, -2.0)  # type: ignore[arg-type]


TWO = """
title: Two controls that are singular together
time: {initial: 0, final: 1}
states: {x: {initial: 1}, y: {initial: 2}, z: {initial: 0}}
controls: {u: {lower: -9, upper: 9}, v: {lower: -9, upper: 9}}
dynamics: {x: u, y: v, z: DRIFT}
cost: {lagrange: x^2 + x*y + y^2 + z^2}
"""


def test_several_controls_are_singular_together() -> None:
    """σ = (λx, λy), σ'' = (2u + v, u + 2v) but for the drift of z, which gives its own part."""
    text = TWO.replace("DRIFT", "x")
    found = arc(text, 0, 1)
    assert found.order == 1
    clebsch = np.array(
        found.system.function("c", [found.clebsch])([0] * 3, [0] * 3, 0, [], 0, [], [])
    )
    assert clebsch == pytest.approx(np.array([[2.0, 1.0], [1.0, 2.0]]))
    law = eliminated(found, system(text)[1])
    assert law is not None
    # (x² + xy + y²)-part at rest: 2u + v = −λz' = 2z and u + 2v = 0 on the arc.
    value = np.array(law.function([0.3, 0.4, 0.6], [0, 0, 0], [0, 0], [], 0, [], [])).ravel()
    assert value == pytest.approx([0.8, -0.4])


def test_goh_s_condition_shows_in_an_odd_degree() -> None:
    found = arc(TWO.replace("DRIFT", "x*v - y*u"), 0, 1)
    assert found.degrees == (1, 1)
    assert found.order is None
    assert found.clebsch is None


def test_a_product_of_controls_determines_them_at_once() -> None:
    text = small(
        "controls: {u: {lower: -1, upper: 1}, v: {lower: -1, upper: 1}}\n"
        "dynamics: {x: u, y: v}\ncost: {lagrange: u*v + x^2}"
    )
    assert controls(*system(text)).kinds == ("affine", "affine")
    found = arc(text, 0, 1)
    assert (found.degrees, found.order) == ((0, 0), 0)
    assert np.array(
        found.system.function("c", [found.clebsch])([0, 0], [0, 0], [0, 0], [], 0, [], [])
    ) == pytest.approx(np.array([[0.0, 1.0], [1.0, 0.0]]))
    assert found.feedback is not None
    # λx + v = 0, λy + u = 0
    law = found.functions([0, 0], [3, 4], [9, 9], [], 0, [], [])[0]
    assert np.array(law).ravel() == pytest.approx([-4.0, -3.0])


def test_costates_jump_at_point_constraints_along_gradients(solve: Any) -> None:
    """Through x(1/2) = 1 with least effort: u = 2, then −2, and λ = −2u jumps along ∇x."""
    text = (
        "title: gate\ntime: {initial: 0, final: 1}\nstates: {x: {initial: 0, final: 0}}\n"
        "controls: {u: {}}\ndynamics: {x: u}\ncost: {lagrange: u^2}\n"
        "constraints: {point: {gate: {at: 0.5, holds: x == 1}}}\n"
    )
    (jump,) = point_jumps(system(text)[0])
    value, gradient = jump([1.0], [0], [0], [], 0.5, [], [])
    assert (float(value), float(gradient)) == (1.0, 1.0)
    solution = solve(text, steps=40)
    # u = 2, then −2: λ = −4, then 4, so that ρ = −8.
    before, after = solution.costate(np.array([0.25, 0.75]))[:, 0]
    assert (before, after) == (pytest.approx(-4, rel=2e-2), pytest.approx(4, rel=2e-2))


def test_a_regular_control_follows_along_a_singular_arc() -> None:
    """Here w is not in σ': whether it follows in its bounds or rests on one, σ'' is the same."""
    text = small(
        "controls: {u: {lower: -1, upper: 1}, w: {}}\n"
        "dynamics: {x: u + w^2, y: w - x^2}\ncost: {lagrange: x^2 + w^2 + y^2}"
    )
    found, probe = system(text)
    assert controls(found, probe).kinds == ("affine", "regular")
    values = []
    for interior in ((1,), ()):
        given = arc(text, 0, interior=interior)
        assert given.order == 1
        values.append(float(given.functions([0.3, 0.2], [0.1, 0.5], [0.4, 0.7], [], 0, [], [])[2]))
    # σ' = −2x + 2 λy x: σ'' = (2 λy − 2) x' + 2 λy' x, and λy' = −2y whatever w is.
    assert values[0] == pytest.approx((2 * 0.5 - 2) * 0.49 + 2 * (-0.4) * 0.3)
    assert values[0] == pytest.approx(values[1])


def test_a_regular_control_in_the_switching_function_itself() -> None:
    """σ = λx + w·x, with H = w² + λy w + …: w' = −(λy' + x' u + x u')/2 comes in."""
    text = small(
        "controls: {u: {lower: -1, upper: 1}, w: {}}\n"
        "dynamics: {x: u, y: w}\ncost: {lagrange: x^2 + x*w + w^2 + y^2}"
    )
    inside, fixed = (arc(text, 0, interior=interior) for interior in ((1,), ()))
    at: tuple[Any, ...] = ([0.3, 0.2], [0.1, 0.5], [0.4, 0.7], [], 0, [], [])
    # λx' = −2x − w, so that σ'' = −2u − w', w' = −(x' + λy')/2 = −(u − 2y)/2.
    assert float(fixed.functions(*at)[1]) == pytest.approx(-2.0)
    assert float(inside.functions(*at)[1]) == pytest.approx(-1.5)
    assert float(inside.functions(*at)[2]) == pytest.approx(-0.2)


def test_what_has_no_singular_arc_says_why() -> None:
    never = small("controls: {u: {}}\ndynamics: {x: u, y: 0}\ncost: {lagrange: x}")
    assert arc(never).reason == "no finite order"
    flat = small("controls: {u: {}}\ndynamics: {x: 0, y: x}\ncost: {lagrange: u + x}")
    assert arc(flat).reason == "constant"


def test_controls_with_corners_and_without_effect() -> None:
    text = small(
        "controls: {u: {}, v: {}, w: {}, s: {}}\n"
        "dynamics: {x: u, y: v*(sin(w)^2 + cos(w)^2)}\ncost: {lagrange: abs(u) + v^4}"
    )
    assert controls(*system(text)).kinds == ("kinked", "regular", "absent", "absent")


def test_cancellation_is_found_by_numbers() -> None:
    """The coefficient of u in σ' is sin² + cos² − 1 times something: zero, but not to see."""
    text = small(
        "controls: {u: {}}\ndynamics: {x: u*(sin(y)^2 + cos(y)^2 - 1) + y, y: u}\n"
        "cost: {lagrange: x^2}"
    )
    plain = text.replace("u*(sin(y)^2 + cos(y)^2 - 1) + ", "")
    assert arc(text).order == arc(plain).order == 2


# Regular controls


REGULAR = {
    "bryson_denham": 1e-2,
    "container_crane": 1e-2,
    "double_integrator_tracking": 1e-2,
    "hypersensitive": 1e-2,
    "inverted_pendulum": 1e-2,
    "rayleigh": 1e-2,
    "rayleigh_mixed": 1e-2,
    "sir_vaccination": 1e-2,
    "van_der_pol_state": 1e-2,
    "brachistochrone": 1e-2,
    "hanging_chain": 1e-2,
    "orbit_transfer": 1e-2,
    "strongest_column": 1e-2,
}
"""Largest error beside the control's range away from the ends of arcs."""
CLOSED = 9
"""So many of them are quadratic in their controls."""


@pytest.mark.parametrize("name", REGULAR)
def test_regular_controls_along_a_solution(name: str, solve: Any) -> None:
    """H_u = 0 at the costates of a solve is the control where nothing is active.

    The control is the reference's or the derivation's where there is one, else the solve's own.
    """
    found, probe = system(name)
    # The costates of this one are magnified by 1/(2r) = 5000.
    steps = 400 if name == "double_integrator_tracking" else 100
    m, solution = found.model, solve(name, steps=steps)
    groups = controls(found, probe).regular
    assert sorted(i for group in groups for i in group.controls) == list(range(m.n_u))
    closed = list(REGULAR).index(name) < CLOSED
    assert all((group.closed is not None) == closed for group in groups)
    t = solution.times[1:-1]
    x, u, costate = solution.state(t), solution.control(t), solution.costate(t)
    truth = control_of(name, m, t, u)
    integrals = [f"integral constraint {c.name}" for c in m.constraints.integral]
    nu = np.array([solution.multipliers[name] for name in integrals]).ravel()
    law = np.zeros_like(u)
    for group in groups:
        found_ = group.along(t, x, costate, u, solution.parameters, nu=nu)
        law[:, list(group.controls)] = found_
    inside = nothing_active(found, x, u, t)
    assert inside.sum() > 20
    assert np.max(np.abs(law - truth)[inside] / np.ptp(truth, axis=0)) < REGULAR[name]


def control_of(name: str, m: Model, t: Array, otherwise: Array) -> Array:
    """The known control at some times."""
    stated = Known.sample(m.known.controls if m.known else {}, m.controls, t)
    if np.isfinite(stated).all():
        return stated
    if name in DERIVED:
        truth = importlib.import_module(f"derivations.{name}").derive()
        return np.column_stack([np.interp(t, truth.times, column) for column in truth.controls.T])
    path = ROOT / "tests" / "reference" / f"{name}.npz"
    if path.exists():
        with np.load(path) as samples:
            return np.column_stack([np.interp(t, samples["t"], row) for row in samples["u"].T])
    return otherwise


def nothing_active(found: Pontryagin, x: Array, u: Array, t: Array) -> NDArray[np.bool_]:
    """Times at which no control and no row is near a bound, nor at their neighbours."""
    m, rows = found.model, found.rows
    values = [*u.T]
    pairs = list(zip(*m.control_bounds, strict=True))
    for row in rows:
        function = found.function("row", [row.value])
        values.append(sampled(function, (t, x, x, u, np.zeros(m.n_p), None, None))[0][:, 0])
        pairs.append((row.lower, row.upper))
    good = np.ones(len(t), dtype=bool)
    for value, (low, high) in zip(values, pairs, strict=True):
        room = 0.02 * (np.ptp(value) + 1e-12)
        good &= (value > low + room) & (value < high - room)
    return np.convolve(~good, np.ones(9), mode="same") < 0.5


def test_newton_says_where_it_does_not_settle() -> None:
    text = small("controls: {u: {}}\ndynamics: {x: u, y: 0}\ncost: {lagrange: u^4}")
    (group,) = controls(*system(text)).regular
    t, x = np.zeros(2), np.zeros((2, 2))
    costate = np.array([[-4.0, 0.0], [-32.0, 0.0]])
    law = group.along(t, x, costate, np.ones((2, 1)), np.zeros(0))
    assert law[:, 0] == pytest.approx([1.0, 2.0])
    exponential = text.replace("u^4", "exp(u)")
    (group,) = controls(*system(exponential)).regular
    law = group.along(t, x, -costate, np.ones((2, 1)), np.zeros(0))
    assert np.isnan(law).all()


def test_controls_that_are_coupled_are_found_together() -> None:
    text = small(
        "controls: {u: {}, v: {}, w: {}}\ndynamics: {x: u + w, y: v}\n"
        "cost: {lagrange: u^2 + u*v + v^2 + w^2}"
    )
    groups = controls(*system(text)).regular
    assert [group.controls for group in groups] == [(0, 1), (2,)]
    costate = np.array([[3.0, -6.0]])
    law = groups[0].along(np.zeros(1), costate, costate, np.zeros((1, 3)), np.zeros(0))
    # 2u + v = −3, u + 2v = 6
    assert law[0] == pytest.approx([-4.0, 5.0])


# Constraints


def active_row(problem: str, label: str, *, upper: bool) -> Active:
    found, probe = system(problem)
    place = [row.label for row in found.rows].index(label)
    return active(found, probe, place, upper=upper)


@pytest.mark.parametrize(
    ("name", "label", "upper", "order"),
    [
        ("bryson_denham", "x1", True, 2),
        ("van_der_pol_state", "x2", False, 1),
        ("rayleigh_mixed", "mixed", True, 0),
        ("container_crane", "x5", True, 1),
        ("robot_path", "disc1", False, 2),
        ("sir_vaccination", "I", False, 3),
    ],
)
def test_orders_of_constraints(name: str, label: str, upper: bool, order: int) -> None:
    assert active_row(name, label, upper=upper).order == order


@pytest.mark.parametrize(
    ("name", "label", "upper", "span"),
    [
        ("van_der_pol_state", "x2", False, (0.65, 1.45)),
        ("rayleigh_mixed", "mixed", True, (0.05, 1.2)),
        ("bryson_denham", "x1", True, (0.36, 0.64)),
    ],
)
def test_controls_and_multipliers_on_active_arcs(
    name: str, label: str, upper: bool, span: tuple[float, float], reference: Any, solve: Any
) -> None:
    arc_ = active_row(name, label, upper=upper)
    found, m = arc_.system, arc_.system.model
    _, samples = reference(name)
    there = (samples["t"] > span[0]) & (samples["t"] < span[1])
    t, x, u = (samples[key][there] for key in ("t", "x", "u"))
    closed = found.function("closed", [arc_.control(0)])
    nothing = np.zeros_like(x)
    law = sampled(closed, (t, x, nothing, 0 * u, np.zeros(0), None, None))[0]
    assert law == pytest.approx(u, abs=1e-7)
    solution = solve(name, steps=100)
    values = (t, x, solution.costate(t), u, np.zeros(m.n_p), None, None)
    step, eta, adjoint, zeros = sampled(arc_.function(0), values)
    assert step == pytest.approx(np.zeros_like(step), abs=1e-7)
    assert zeros == pytest.approx(np.zeros_like(zeros), abs=1e-7)
    gradient = found.along(*values[:5]).gradient
    slope = sampled(found.function("slope", [arc_.slope]), values)[0]
    assert gradient + eta * slope == pytest.approx(np.zeros_like(gradient), abs=1e-12)
    if arc_.order == 0:
        assert (eta > 0).all()
        # The mixed constraint's multiplier is in the costates of the solve, too.
        gained = solution.costate(t[[0, -1]])
        assert np.trapezoid(adjoint, t, axis=0) == pytest.approx(gained[1] - gained[0], rel=2e-3)


def test_jumps_are_along_gradients_and_rates() -> None:
    text = small(
        "controls: {u: {}}\ndynamics: {x: y, y: u}\ncost: {lagrange: u^2}\n"
        "constraints: {path: {moving: x <= 2 + t^2}}"
    )
    arc_ = active_row(text, "moving", upper=True)
    assert arc_.order == 2
    slopes, rates = arc_.jumps([0.1, 0.2], [0, 0], 0, [], 0.5, [0], [])
    assert np.array(slopes) == pytest.approx(np.eye(2))
    # S = x − 2 − t², S' = y − 2t
    assert np.array(rates).ravel() == pytest.approx([-1.0, -2.0])
    control = arc_.system.function("u", [arc_.control(0)])
    assert float(control([0, 0], [0, 0], 0, [], 0.5, [0], [])) == pytest.approx(2.0)


def test_a_constraint_that_no_control_reaches_is_said_to_have_no_order() -> None:
    text = small(
        "controls: {u: {}}\ndynamics: {x: 1, y: u}\ncost: {lagrange: u^2}\n"
        "constraints: {path: {far: x <= 9}}"
    )
    arc_ = active_row(text, "far", upper=True)
    assert arc_.order is None
    with pytest.raises(ValueError, match="no finite order"):
        _ = arc_.held


def test_a_mixed_constraint_that_is_not_linear_has_newton_s_step() -> None:
    text = small(
        "controls: {u: {}}\ndynamics: {x: u, y: 0}\ncost: {lagrange: u^2}\n"
        "constraints: {path: {thrust: x*u^3 <= 8}}"
    )
    arc_ = active_row(text, "thrust", upper=True)
    assert arc_.affine == (False,)
    assert arc_.control(0) is None
    u = 1.5
    for _ in range(20):
        u += float(arc_.function(0)([1, 0], [0, 0], u, [], 0, [0], [])[0])
    assert u == pytest.approx(2.0)


# Transversality


def test_kinds_of_ends_and_what_holds_there() -> None:
    found, _ = system("orbit_transfer")
    ends = transversality(found)
    assert ends.initial == ("fixed", "fixed", "fixed")
    assert ends.final[1] == "fixed"
    assert (ends.initial_time, ends.final_time, ends.parameters) == ("fixed", "fixed", ())
    # λ_r = −1 + ω v², λ_v = 2 ω r v at the end: made up numbers, as any costates may be given.
    values: tuple[Any, ...] = (
        [1, 0, 1],
        0,
        [1.5, 0, 0.8],
        3.32,
        [],
        [0, 0, 0],
        [-0.68, 7.0, 1.2],
        0,
        0,
        [],
        0.5,
    )
    residuals = [np.array(value).ravel() for value in ends.residuals(*values)]
    assert residuals[1][[0, 2]] == pytest.approx([0, 0])


def test_transversality_of_a_solution_with_a_boundary_constraint(solve: Any) -> None:
    found, _ = system("orbit_transfer")
    solution, m = solve("orbit_transfer", steps=100), found.model
    costate, x = solution.costate(solution.times[[0, -1]]), solution.state(solution.times[[0, -1]])
    omega = solution.multipliers["boundary constraint circular"].ravel()
    values: tuple[Any, ...] = (x[0], 0, x[1], 3.32, [], costate[0], costate[1], 0, 0, [], omega)
    final = np.array(transversality(found).residuals(*values)[1]).ravel()
    assert final[[0, 2]] == pytest.approx([0, 0], abs=1e-3)
    assert m.n_p == 0


@pytest.mark.parametrize(("name", "value"), [("brachistochrone", -1.0), ("minimum_time", -1.0)])
def test_the_hamiltonian_of_minimum_time_is_known(name: str, value: float, solve: Any) -> None:
    found, _ = system(name)
    assert known_hamiltonian(found) == value
    solution = solve(name, steps=100)
    t = solution.times[2:-2]
    given = (t, solution.state(t), solution.costate(t), solution.control(t), solution.parameters)
    along = found.along(*given).hamiltonian
    assert np.median(along) == pytest.approx(value, abs=2e-2)
    end = transversality(found).residuals(
        *(solution.state(t[:1])[0], 0, solution.state(t[-1:])[0], solution.times[-1], []),
        *(np.zeros(found.model.n_x), np.zeros(found.model.n_x), 0, value, [], []),
    )[3]
    assert float(end) == pytest.approx(0.0)


@pytest.mark.parametrize("name", ["van_der_pol", "double_integrator_tracking"])
def test_where_the_hamiltonian_is_not_known(name: str) -> None:
    assert known_hamiltonian(system(name)[0]) is None


def test_parameters_and_integral_constraints(solve: Any) -> None:
    """The strongest column: M_p + ∫ H_p dt = 0, and H_A = 0 with the multiplier of the volume."""
    found, _ = system("strongest_column")
    solution = solve("strongest_column", steps=100)
    t = np.linspace(0, 1, 2001)
    nu = solution.multipliers["integral constraint volume"].ravel()
    assert nu[0] > 0
    given = (t, solution.state(t), solution.costate(t), solution.control(t), solution.parameters)
    point = found.along(*given, nu=nu)
    integral = np.trapezoid(point.parameters[:, 0], t)
    ends = transversality(found)
    values: tuple[Any, ...] = (
        [0, 1],
        0,
        [0, -1],
        1,
        solution.parameters,
        [0, 0],
        [0, 0],
        0,
        0,
        integral,
        [],
    )
    assert float(ends.residuals(*values)[4]) == pytest.approx(0, abs=1e-2)
    assert ends.parameters == ("range",)


def test_the_sign_at_the_end_of_a_range(solve: Any) -> None:
    """x(1) ≤ 1/2 holds x back, whose cost wants it larger: the derivative of the cost is < 0."""
    text = (
        "title: t\ntime: {initial: 0, final: 1}\nstates: {x: {initial: 0, final: {upper: 0.5}}}\n"
        "controls: {u: {}}\ndynamics: {x: u}\ncost: {lagrange: u^2, mayer: -4*x}\n"
    )
    found, _ = system(text)
    solution = solve(text, steps=20)
    costate = solution.costate(np.array([0.0, 1.0]))
    values: tuple[Any, ...] = ([0], 0, [0.5], 1, [], costate[0], costate[1], 0, 0, [], [])
    ends = transversality(found)
    assert ends.final == ("range",)
    # u = 1/2, λ = −1, M_x = −4.
    assert float(ends.residuals(*values)[1]) == pytest.approx(-3.0, abs=1e-6)
