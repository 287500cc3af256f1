"""Controls with kinks taken apart: where kinks are found, what formulas and answers become."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray

import quito_cli as quito
from quito_cli.optimality.hamiltonian import pontryagin
from quito_cli.optimality.looking.controls import controls
from quito_cli.optimality.parts.apart import (
    concave,
    faithful,
    in_order,
    merged_extremal,
    mixed,
    split_answer,
)
from quito_cli.optimality.parts.branches import Stretch, branch, sites, terms
from quito_cli.optimality.parts.parted import parted
from quito_cli.optimality.parts.parts import Cut, Parts
from quito_cli.optimality.symbols.probes import Probe
from quito_cli.problem.model import Model
from quito_cli.solution.optimal import Arc, Extremal
from quito_cli.solution.trajectory import Polynomials

Array = NDArray[np.float64]
Solve = Callable[..., quito.Solution]
Build = Callable[[str], Model]


def small(cost: str, force: str = "u", given: str = "{u: {lower: -1, upper: 2}}") -> str:
    return f"""
title: small
time: {{initial: 0, final: 1}}
states: {{x: {{initial: 1}}, y: {{initial: 2}}}}
controls: {given}
dynamics: {{x: "{force}", y: x}}
cost: {{lagrange: "{cost}"}}
"""


def taken(model: Model) -> Parts:
    parts = parted(model)
    assert parts is not None
    return parts


CUTS = [Cut("u", "", -1, 2, (0.0,)), Cut("u", "", -np.inf, np.inf, (-0.5, 0.0, 0.7))]


@pytest.mark.parametrize("cut", CUTS, ids=["one", "three"])
def test_parts_are_filled_in_order_and_add_up(cut: Cut) -> None:
    u = np.linspace(-1, 2, 31)
    v = cut.split(u)
    assert v.shape == (31, cut.count)
    assert cut.merged(v) == pytest.approx(u, abs=1e-15)
    assert (v >= cut.bounds.lower).all()
    assert (v <= cut.bounds.upper).all()
    assert cut.disorder(v) == pytest.approx(np.zeros(31), abs=1e-15)
    v[3, :] = 0.25
    assert cut.disorder(v)[3] == pytest.approx(0.25)


def test_parts_have_names_that_say_where_they_are() -> None:
    assert CUTS[0].labels == ("u⁻", "u⁺")
    assert CUTS[1].labels == ("(u + 0.5)⁻", "u(-0.5…0)", "u(0…0.7)", "(u - 0.7)⁺")
    assert CUTS[0].told == "u = -u⁻ + u⁺"
    assert CUTS[1].told == "u = -0.5 - (u + 0.5)⁻ + u(-0.5…0) + u(0…0.7) + (u - 0.7)⁺"


@pytest.mark.parametrize(
    ("cost", "found"),
    [
        ("abs(u)", (0.0,)),
        ("x^2 - 3*abs(2*u - 1)", (0.5,)),
        ("max(u, 0) + 2*max(0, -u)", (0.0,)),
        ("min(u, 1/4)*exp(x)", (0.25,)),
        ("if_else(u > 0, 2*u + x, 3*u + x)", (0.0,)),
        ("if_else(u <= 1/2, 1, 2*u)", (0.5,)),
        ("abs(abs(u) - 1/2)", (-0.5, 0.0, 0.5)),
        ("u*sign(u)", (0.0,)),
        ("abs(u*y)", (0.0,)),
        ("abs(u)^3 + sqrt(abs(u - 1) + 1)", (1.0,)),
    ],
)
def test_kinks_are_where_slopes_jump_and_values_do_not(
    cost: str, found: tuple[float, ...], model: Build
) -> None:
    assert taken(model(small(cost))).cuts[0].sites == pytest.approx(found)


@pytest.mark.parametrize(
    "cost",
    [
        "u^2",
        "abs(x) + u^2",
        "sign(u)*x + u^2",  # a jump
        "if_else(u > 0, 1 + u, u)",
        "abs(u) + sign(u)*y",
        "if_else(abs(u) > 0, 3/10 + abs(u), 0)",  # a price of being on: only zero has none
        "abs(u - x)",  # it moves
        "if_else(abs(u) < 1, u^2, 2*abs(u) - 1)",  # smooth
        "norm([u, 1e-3])",
        "abs(u^3)",
    ],
)
def test_what_has_no_kink_that_stays_is_left_whole(cost: str, model: Build) -> None:
    assert parted(model(small(cost))) is None


def test_a_table_read_at_a_control_has_too_many(model: Build) -> None:
    points = ", ".join(str(k / 10 - 1) for k in range(31))
    values = ", ".join(str((k % 2) / 10) for k in range(31))
    text = small("interpolate(u, price)")
    text += f"tables: {{price: {{x: [{points}], y: [{values}], method: linear}}}}\n"
    assert parted(model(text)) is None


def test_beyond_its_bounds_a_kink_leaves_one_side(model: Build) -> None:
    """|u| with u ≥ 0 is u, at zero too, where abs itself has the slope 0."""
    parts = taken(model(small("abs(u)", given="{u: {lower: 0, upper: 2}}")))
    assert parts.cuts[0].labels == ("u",)
    assert float(ca.evalf(ca.jacobian(parts.model.lagrange, parts.model.u))) == 1
    assert parts.told == ""


GIVEN = "{u: {size: 2, lower: -1, upper: 2}, w: {}}"
COSTS = [
    "abs(u[0]) + 2*abs(u[1] - 0.3)/(1 + x^2) - u[0]*w + w^2",
    "max(0, u[0])^2 + exp(u[0]) + if_else(u[0] > 1, u[0]*x, x) + abs(u[1])*u[1]*abs(u[0])",
    "(abs(u[0]) + u[1])*(abs(u[1]) - u[0]) + sin(abs(u[0])*x)",
    "min(u[0], 0.5)*max(u[1], w) + abs(u[0])",
    "abs(u[0]*y) + abs(x)*abs(u[1]) + abs(abs(u[0]) - 0.5)",
    "max(0, abs(u[0]) - 0.2) + x*max(0.1, abs(u[1] - 0.3))",
    "abs(u[0]) + if_else(abs(u[0]) < 1, u[0]^2, 2*abs(u[0]) - 1)*abs(u[1])",
]


@pytest.mark.parametrize("cost", COSTS)
def test_in_order_formulas_have_the_values_they_had(cost: str, model: Build) -> None:
    whole = model(small(cost, "if_else(u[0] > 0, 2*u[0], u[0]) + u[1]*w", GIVEN))
    parts, random = taken(whole), np.random.default_rng(1)
    u = random.uniform(-1, 2, (200, 3))
    u[:20, 0], u[20:40, 1], u[40:50, :2] = 0.0, 0.3, [0.5, -1]
    x, t = random.uniform(-2, 2, (2, 200)), np.zeros(200)
    p = np.zeros((0, 200))
    wanted = whole.right_hand_side.map(200)(x, u.T, p, t)
    found = parts.model.right_hand_side.map(200)(x, parts.split(u).T, p, t)
    for a, b in zip(wanted, found, strict=True):
        assert np.array(b) == pytest.approx(np.array(a), abs=1e-13)


def test_parts_have_the_slopes_of_their_side(model: Build) -> None:
    parts = taken(model(small("max(0, u) + 2*max(0, -u) + u^2/2", "if_else(u > 0, 3*u, u)")))
    system = pontryagin(parts.model)
    found = controls(system, Probe(system))
    assert found.kinds == ("regular", "regular")
    point = system.along(
        np.zeros(1), np.ones((1, 2)), np.array([[-2.0, 0]]), np.zeros((1, 2)), np.zeros(0)
    )
    assert point.gradient[0] == pytest.approx([2 + 2, 1 - 6])  # −(−2 − 2) below, 1 + 3λ above


def test_corners_that_are_no_kinks_hide_none(model: Build) -> None:
    """max(0, |u| − 0.2) is 0 between its kinks, whose slopes 0 and ±1 are those of their sides."""
    parts = taken(model(small("max(0, abs(u) - 0.2)", given="{u: {}}")))
    assert parts.cuts[0].sites == pytest.approx([-0.2, 0.2])
    slopes = ca.Function("f", [parts.model.u], [ca.gradient(parts.model.lagrange, parts.model.u)])
    for v in ([0, 0, 0], [0, 0.2, 0], [0, 0.4, 0], [0.3, 0, 0]):
        assert np.array(slopes(v)).ravel() == pytest.approx([1, 0, 1])


def test_a_sum_is_taken_apart_into_terms() -> None:
    u, x = ca.SX.sym("u", 2), ca.SX.sym("x")
    formula = 3 * (ca.fabs(u[0]) - ca.fabs(u[1]) / x) - x * ca.if_else(u[0] > 0, u[0] + 1, 1)
    found = list(terms(formula, u))
    assert len(found) == 3
    assert [sorted(sites(term, [x, u], u)) for term in found] == [[0], [1], [0]]
    function = ca.Function("f", [x, u], [formula - sum(found)])
    assert float(function(0.7, [0.4, -0.3])) == pytest.approx(0, abs=1e-15)


def test_a_branch_has_the_corners_of_its_ends_alone_replaced() -> None:
    u = ca.SX.sym("u")
    formula = ca.fabs(u) + ca.fabs(u - 1)
    own = branch(formula, [u], u, Stretch(0, 0.0, 2.0))
    assert sites(own, [u], u) == {0: [1.0]}
    assert float(ca.evalf(ca.substitute(own, u, 1.5))) == pytest.approx(2.0)


def test_sums_that_double_are_not_followed_for_ever() -> None:
    """e = e + e, sixty times: 2^60 terms."""
    u = ca.SX.sym("u")
    formula = ca.fabs(u)
    for k in range(60):
        formula = ca.sin(formula) + formula * (k + 2)
    assert 1 < len(list(terms(formula, u))) < 1000


# Answers


FUEL = """
title: fuel
time: {initial: 0, final: 3}
states: {x: {initial: 1, final: 0}, v: {initial: 0, final: 0}}
controls: {u: {lower: -1, upper: 1}}
dynamics: {x: v, v: u}
cost: {lagrange: abs(u)}
"""


@pytest.mark.parametrize("options", [{"mesh": "uniform"}, {"polish": True, "mesh": "uniform"}])
def test_an_answer_split_is_the_same(options: dict[str, Any], solve: Solve, model: Build) -> None:
    whole, parts = solve(FUEL, steps=60, **options), taken(model(FUEL))
    apart = split_answer(parts, whole)
    t = np.linspace(0, 3, 500)
    assert parts.merged(apart.control(t)) == pytest.approx(whole.control(t), abs=1e-14)
    assert [q.name for q in apart.origin.controls] == ["u⁻", "u⁺"]
    assert apart.control(t).min() >= -1e-14
    if whole.polished:
        assert apart.extremal is not None
        assert merged_extremal(parts, apart.extremal).arcs == whole.arcs
        assert mixed(parts, apart, whole) == ""
        both = replace(apart, coefficients=np.maximum(apart.coefficients, 0.1))
        assert "both sides of a kink" in mixed(parts, both, whole)


def test_arcs_of_parts_are_arcs_of_the_control(model: Build) -> None:
    parts = taken(model(FUEL.replace("abs(u)", "'abs(u) + max(0, u - 0.5)'")))
    low, middle, high = parts.cuts[0].labels

    def arcs(label: str, *given: tuple[Any, float, float]) -> list[Arc]:
        starts = [(0.0, 0.0), *((end, doubt) for _, end, doubt in given)]
        return [
            Arc(label, kind, starts[k][0], end, starts[k][1], doubt)
            for k, (kind, end, doubt) in enumerate(given)
        ]

    found = merged_extremal(
        parts,
        Extremal(
            (
                *arcs(low, ("upper", 0.5, 0.01), ("interior", 1.0, 0.1), ("lower", 3.0, 0.0)),
                *arcs(middle, ("lower", 1.1, 0.1), ("upper", 3.0, 0.0)),
                *arcs(high, ("lower", 2.0, 0.0), ("singular", 2.5, 0.0), ("upper", 3.0, 0.0)),
                Arc("v", "inactive", 0.0, 3.0, 0.0, 0.0),
            ),
            (),
            np.zeros(0),
            {},
        ),
    ).arcs
    assert [(arc.of, arc.kind) for arc in found] == [
        *(("u", kind) for kind in ("lower", "interior", "kink", "singular", "upper")),
        ("v", "inactive"),
    ]
    # What may be at once, is: the end of the interior arc, and the jump over the kink at zero.
    assert [arc.end for arc in found[:5]] == pytest.approx([0.5, 1.05, 2.0, 2.5, 3.0])


def test_a_jump_that_random_points_do_not_meet_is_seen_along_an_answer(
    solve: Solve, model: Build
) -> None:
    """The branches agree where x < 3: random points are about x = 1."""
    text = FUEL.replace("cost: {lagrange: abs(u)}", "cost: {lagrange: %s}")
    jumps = '"if_else(u > 0, u + max(x - 3, 0), -u)"'
    parts = taken(model(text % jumps))
    answer = solve(FUEL, steps=60, mesh="uniform")
    assert faithful(parts, answer)
    states = answer.trajectory.states + 4.0
    high = Polynomials(answer.trajectory.times, states, 1)
    assert not faithful(parts, replace(answer, trajectory=high))


def test_a_concave_kink_is_seen(solve: Solve, model: Build) -> None:
    answer = solve(FUEL, steps=60, mesh="uniform")
    assert not concave(taken(model(FUEL)), answer)
    assert concave(taken(model(FUEL.replace("abs(u)", "-abs(u)"))), answer)


def test_parts_out_of_order_are_no_answer(model: Build) -> None:
    """|u| for nothing of a control that must be 0: −|u| fills both parts at once."""
    from quito_cli.options import Options
    from quito_cli.solvers import minimise
    from quito_cli.solving.on_mesh import method_on
    from quito_cli.transcription.mesh import Mesh
    from quito_cli.transcription.transcribe import transcribe

    text = FUEL.replace("initial: 1,", "initial: 0,").replace("abs(u)", "-abs(u)")
    for given, wanted in ((text, False), (text.replace("-abs", "abs"), True)):
        parts = taken(model(given))
        method = method_on(Options(steps=20), Mesh.through(20, np.zeros(0)))
        nlp = transcribe(parts.model, method, None, None)
        outcome, _ = minimise(nlp, "ipopt", 1e-9, 300, {}, None, None)
        assert in_order(parts, nlp, outcome) is wanted
