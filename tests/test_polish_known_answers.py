"""More problems polished from coarse answers: brief arcs, breaks, many switches, several locals.

Each row taught something. What is expected is in closed form, or integrated by scipy from a formula
of theory; where none is given the problem is convex, so that what `assert_extremal` verifies is the
one answer.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq
from test_polish_gallery import COARSE, Case, account, assert_extremal, polished

import quito_cli as quito
from quito_cli.optimality.hamiltonian import pontryagin
from quito_cli.optimality.looking.breaks import breaks
from quito_cli.optimality.polish.answer.answer import answer
from quito_cli.optimality.polish.answer.written import exact
from quito_cli.optimality.polish.polish import sought
from quito_cli.optimality.polish.search.attempts import Log
from quito_cli.optimality.symbols.probes import Probe
from quito_cli.options import Options
from quito_cli.problem.build import build
from quito_cli.problem.load import load_text
from quito_cli.solution.polishing import Polishing, PolishStatus
from quito_cli.solution.tally import failing

Array = NDArray[np.float64]


def riccati(p: float) -> float:
    """Cost of x' = u − p x from 1 over 2 units of time with ∫ x² + u²: P(0) of Riccati's."""

    def rate(_: float, v: Array) -> Array:
        return np.asarray(2 * p * v + v**2 - 1)

    found = solve_ivp(rate, (2, 0), [0.0], method="DOP853", rtol=1e-13, atol=1e-15)
    return float(found.y[0, -1])


ROOT = math.sqrt(2)
SWEPT = -sum(
    quad(lambda s: abs(math.sin(s)), a, b)[0]
    for a, b in ((0, math.pi), (math.pi, 2 * math.pi), (2 * math.pi, 3 * math.pi), (9.42477796, 10))
) - sum(
    quad(lambda s: max(-2 * math.sin(ROOT * s), math.sin(ROOT * s) / 2) / ROOT, a, b)[0]
    for a, b in zip(
        [k * math.pi / ROOT for k in range(5)],
        [*(k * math.pi / ROOT for k in range(1, 5)), 10],
        strict=True,
    )
)
"""Two oscillators, each pushed in step with its own end: the integrals of what pushes."""
SWITCHES = sorted(
    [*(10 - k * math.pi for k in (1, 2, 3)), *(10 - k * math.pi / ROOT for k in range(1, 5))]
)
LONGEST = float(brentq(lambda s: -1 / (2 * s * s) + s * s / 4 + 0.3, 0.1, 5, xtol=1e-15))
"""u = 1/T about t = 0: 1/(2T) + T³/12 + 0.3 T is least."""


def energy(k: float) -> float:
    """∫ u² of u = k (1 − 2t) cut at ±1.2."""
    cut = (1 - 1.2 / k) / 2
    rest = quad(lambda t: (k * (1 - 2 * t)) ** 2, cut, 0.5)[0]
    return float(2 * (1.44 * cut + rest))


SLOPE = float(brentq(lambda k: energy(k) - 1, 1.2, 10, xtol=1e-15))
CUT = (1 - 1.2 / SLOPE) / 2
AREA = 2 * (
    quad(lambda t: 1.2 * (0.5 - t), 0, CUT)[0]
    + quad(lambda t: 2 * SLOPE * (0.5 - t) ** 2, CUT, 0.5)[0]
)
GROWN = math.log(0.6 / 0.4 / (0.3 / 0.7))
LET_GO = 6 - (1 / 0.36 - 1 / 0.6)
"""Logistic growth to (1 + 0.2)/2; H = 0.4² there, so that the last stock is 0.36."""
CATCH = 0.16 * (LET_GO - GROWN) + quad(lambda s: 0.6 / (1 + 0.6 * s) - 0.2, 0, 6 - LET_GO)[0]
FLAT = 1 / 6 - 1e-5
CLIPPED = math.asin(1 - 1e-6)

KNOWN = {
    "interleaved": Case(
        """
time: {initial: 0, final: 10}
states: {x: {initial: 0}, v: {initial: 0}, y: {initial: 0}, w: {initial: 0}}
controls: {a: {lower: -1, upper: 1}, b: {lower: -0.5, upper: 2}}
dynamics: {x: v, v: -x + a, y: w, w: -2*y + b}
cost: {mayer: x + y}
""",
        SWEPT,
        tuple(SWITCHES),
    ),
    "bang, bound, singular": Case(
        """
time: {initial: 0, final: 3}
states: {x: {initial: 0, upper: 1}}
controls: {u: {lower: -2, upper: 2}}
dynamics: {x: u}
cost: {lagrange: (x - 2 + t)^2}
""",
        11 / 12,
        (0.5, 1),
    ),
    "order three": Case(
        """
time: {initial: 0, final: 1}
states:
  x: {initial: 0, final: 0, upper: 0.2}
  v: {initial: 1, final: -1}
  a: {initial: 0, final: 0}
controls: {u: {}}
dynamics: {x: v, v: a, a: u}
cost: {lagrange: u^2/2}
""",
        768 / 5,
        (0.5,),
    ),
    "an arc of 6e-5": Case(
        f"""
time: {{initial: 0, final: 1}}
states: {{x: {{initial: 0, final: 0, upper: {FLAT!r}}}, v: {{initial: 1, final: -1}}}}
controls: {{u: {{}}}}
dynamics: {{x: v, v: u}}
cost: {{lagrange: u^2/2}}
""",
        4 / (9 * FLAT),
        (3 * FLAT, 1 - 3 * FLAT),
    ),
    "area": Case(
        """
sense: maximize
time: {initial: 0, final: 1}
states: {x: {initial: 0, final: 0}}
controls: {u: {lower: -1.2, upper: 1.2}}
dynamics: {x: u}
cost: {lagrange: x}
constraints: {integral: {energy: u^2 <= 1}}
""",
        AREA,
        (CUT, 1 - CUT),
    ),
    "both ends free": Case(
        """
time: {initial: {lower: -5, upper: 0, guess: -1}, final: {lower: 0.1, upper: 5, guess: 1}}
states: {x: {initial: 0, final: 1}}
controls: {u: {}}
dynamics: {x: u}
cost: {lagrange: u^2/2 + t^2 + 0.3}
""",
        1 / (2 * LONGEST) + LONGEST**3 / 12 + 0.3 * LONGEST,
        (),
    ),
    "a parameter of the Mayer cost alone": Case(
        """
time: {initial: 0, final: 2}
states: {x: {initial: 1}}
controls: {u: {}}
parameters: {p: {lower: 0.1, upper: 0.5, guess: 0.3}, q: {lower: -1, upper: 1, guess: 0.3}}
dynamics: {x: -p*x + u}
cost: {lagrange: x^2 + u^2, mayer: (q - 0.7)^2}
""",
        riccati(0.5),
        (),
    ),
    "fishery": Case(
        """
sense: maximize
time: {initial: 0, final: 6}
states: {x: {initial: 0.3}}
controls: {u: {lower: 0, upper: 1}}
dynamics: {x: x*(1 - x) - u*x}
cost: {lagrange: (x - 0.2)*u}
""",
        CATCH,
        (GROWN, LET_GO),
    ),
    "periodic bang-bang": Case(
        """
time: {initial: 0, final: 2*pi}
states: {x: {}, y: {}}
controls: {u: {lower: -1, upper: 1}}
dynamics: {x: -x + u, y: -2*y + u}
cost: {lagrange: x*cos(t)}
constraints: {boundary: {px: final(x) == initial(x), py: final(y) == initial(y)}}
""",
        -2 * ROOT,
        (math.pi / 4, 5 * math.pi / 4),
    ),
    "singular for a last 1e-5": Case(
        """
time: {initial: 0, final: 1.00001}
states: {x: {initial: 1}}
controls: {u: {lower: -1, upper: 1}}
dynamics: {x: u}
cost: {lagrange: x^2}
""",
        1 / 3,
        (1,),
    ),
    "singular but for a first 1e-3": Case(
        """
time: {initial: 0, final: 1}
states: {x: {initial: 0.001}}
controls: {u: {lower: -1, upper: 1}}
dynamics: {x: u}
cost: {lagrange: x^2}
""",
        1e-9 / 3,
        (0.001,),
    ),
    "at its bound between two points": Case(
        """
time: {initial: 0, final: 3}
states: {x: {initial: 0}}
controls: {u: {upper: 0.999999}}
dynamics: {x: u}
cost: {lagrange: (u - sin(t))^2}
""",
        quad(lambda t: (math.sin(t) - 1 + 1e-6) ** 2, CLIPPED, math.pi - CLIPPED)[0],
        (CLIPPED, math.pi - CLIPPED),
    ),
    "a price that jumps": Case(
        """
time: {initial: 0, final: 1}
states: {x: {initial: 0}}
controls: {u: {lower: -1, upper: 1}}
dynamics: {x: u}
cost: {lagrange: "x*if_else(t < 0.37, 1, -0.4)"}
""",
        # σ = 0.118 − t, then −0.4 (1 − t)
        -(0.118**2 + 0.252**2) / 2 - 0.2 * 0.63**2,
        (0.118,),
    ),
    "a gear at a known time": Case(
        """
time: {initial: 0, final: 1}
states: {x: {initial: 0, final: 1}}
controls: {u: {}}
dynamics: {x: "u*if_else(t <= 0.37, 1, 2)"}
cost: {lagrange: u^2}
""",
        1 / (0.37 + 4 * 0.63),
        (0.37,),
    ),
    "a bound that jumps": Case(
        """
time: {initial: 0, final: 2}
states: {x: {initial: 0, final: 1}}
controls: {u: {}}
dynamics: {x: u}
cost: {lagrange: u^2}
constraints: {path: {cap: "u <= if_else(t < 0.7, 0.3, 2)"}}
""",
        0.063 + 0.79**2 / 1.3,
        (0.7,),
    ),
    "a blow that is over within 2e-5": Case(
        """
time: {initial: 0, final: 2}
states: {x: {initial: 0}}
controls: {u: {}}
dynamics: {x: "u + if_else(abs(t - 1.0003) < 1e-5, 1e4, 0)"}
cost: {lagrange: u^2, mayer: (x - 1)^2}
""",
        0.64 / 3,
    ),
    "a reference of straight lines": Case(
        """
time: {initial: 0, final: 2}
tables: {path: {x: [0, 0.8, 2], y: [0.56, 0, 0.84], method: linear}}
states: {x: {initial: 0}}
controls: {u: {lower: -1, upper: 1}}
dynamics: {x: u}
cost: {lagrange: "(x - interpolate(t, path))^2"}
"""
    ),
}


@pytest.mark.parametrize("name", KNOWN)
def test_what_is_polished_from_fifty_equal_cells_is_exact(name: str) -> None:
    case = KNOWN[name]
    solution = polished(case.text)
    assert solution.polished, account(solution)
    assert failing(solution.certificate) == []
    if case.cost is not None:
        assert solution.cost == pytest.approx(case.cost, rel=1e-9, abs=1e-12)
    if case.junctions is not None:
        assert solution.switching_times == pytest.approx(case.junctions, abs=1e-8)
    assert_extremal(solution, case.text)


def test_an_arc_that_is_not_there_is_not_left_as_a_remnant() -> None:
    """Newton's method only halves such an arc: it ended with 6e-7 of one, and the rest was off."""
    horizon = 8.0
    y = (10 - math.sqrt(10)) / 90
    rest = y / (1 - 8 * y - 10 * y**2) * (1 - 10 * y)
    known = (math.log((1 + y) / (1 - 10 * y)) / 11, horizon + math.log(rest / (y * (1 - rest))))
    solution = quito.solve("catalyst_mixing", constants={"T": horizon}, polish=True, **COARSE)
    assert solution.polished, account(solution)
    assert solution.switching_times == pytest.approx(known, abs=1e-10)


# What is not smooth

STEEP = """
time: {initial: 0, final: 1}
states: {x: {initial: 0}}
controls: {u: {}}
dynamics: {x: u}
cost: {lagrange: (u - sqrt(t))^2 + x^2}
"""


def test_what_is_infinitely_steep_is_refused_in_words() -> None:
    """The derivative of sqrt(t) has no value at 0: it was a traceback."""
    solution = polished(STEEP)
    assert not solution.polished
    assert "not smooth" in account(solution)


BAND = """
time: {initial: 0, final: 1}
states: {x: {initial: 0, final: 1}}
controls: {u: {}}
dynamics: {x: u}
cost: {lagrange: "u^2 + if_else(abs(x - 0.5003) < 0.0001, 1000, 0)"}
"""


def test_a_band_of_states_that_no_point_is_in_is_seen() -> None:
    """Passed in 2e-4 of the time, it would cost 0.2 more; no point was in it."""
    solution = polished(BAND)
    assert not solution.polished
    assert "a formula of the problem jumps at t = 0.5002" in account(solution)


def found_out(what: str, instead: str) -> list[str]:
    """Conditions that fail of the extremal of another problem, as an answer to one of `KNOWN`."""
    text = KNOWN[what].text
    old, new = instead.split(" -> ")
    assert old in text
    problem = load_text("title: A problem of the gallery\n" + text, "gallery.yaml")
    other = load_text("title: Another\n" + text.replace(old, new), "other.yaml")
    direct = quito.solve(other, **COARSE)
    ended = sought(build(other), direct, Log())
    assert ended.extremal is not None
    options = Options.resolve(problem.options, COARSE)
    made = exact(ended.extremal, ended.residual)
    account = Polishing(PolishStatus.POLISHED, "", (), 1e-15, 0.1, 1.0, 3, 3)
    solution = answer(problem, build(problem), options, made, direct, account, 0.1)
    if not solution.success:
        return [solution.status.value]
    return [row.condition for row in failing(solution.certificate)]


@pytest.mark.parametrize(
    ("what", "instead"),
    [
        ("a price that jumps", "0.37 -> 0.37001"),
        ("a gear at a known time", "0.37 -> 0.37001"),
        ("a bound that jumps", "0.3, 2 -> 0.29999, 2"),
        ("area", "<= 1} -> <= 1.00001}"),
        ("area", "upper: 1.2} -> upper: 1.19999}"),
        ("a parameter of the Mayer cost alone", "upper: 0.5, -> upper: 0.49999,"),
        ("fishery", "upper: 1} -> upper: 1.00001}"),
        ("order three", "upper: 0.2 -> upper: 0.200001"),
    ],
)
def test_the_extremal_of_another_problem_is_found_out(what: str, instead: str) -> None:
    """It is one in every respect, but for a number in the fifth digit."""
    assert found_out(what, instead)


@pytest.mark.parametrize(
    ("formula", "times"),
    [
        ("if_else(t < 0.37, 1, 2)*x", [0.37]),
        ("abs(t - 1) + max(t - 0.5, 0)", [0.5, 1]),
        ("sign(sin(5*t))", [math.pi / 5]),
        ("if_else(abs(t - 0.7003) < 1e-5, 9, 0)", [0.70029, 0.70031]),
        ("abs(t - 1)^3", []),  # smooth enough
        ("if_else(x < 0.37, 1, 2)*t", []),  # not of time alone
        ("abs(t - 3)", []),  # after the end
    ],
)
def test_breaks_are_where_formulas_of_time_jump(formula: str, times: list[float]) -> None:
    text = f"""
title: Breaks
time: {{initial: 0, final: 1.2}}
states: {{x: {{initial: 0}}}}
controls: {{u: {{}}}}
dynamics: {{x: u}}
cost: {{lagrange: "u^2 + {formula}"}}
"""
    system = pontryagin(build(load_text(text, "breaks.yaml")))
    assert breaks(system, Probe(system), 0.0, 1.2) == pytest.approx(times, abs=1e-14)
