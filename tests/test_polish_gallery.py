"""A gallery of what the language can say, polished from coarse answers and held against theory.

Expected values are closed forms; whatever is polished is verified besides by means that share
nothing with the polish: states and costates integrated anew by an integrator of scipy, the cost by
its quadrature, H against its values for other admissible controls, signs of multipliers.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad, solve_ivp
from scipy.optimize import minimize_scalar

import quito_cli as quito
from quito_cli.optimality.polish.answer.written import exact
from quito_cli.optimality.polish.polish import sought
from quito_cli.optimality.polish.search.attempts import Log
from quito_cli.problem.build import build
from quito_cli.problem.load import load_text
from quito_cli.problem.model import Model
from quito_cli.solution.optimal import Arc, Kind
from quito_cli.solution.tally import failing

Array = NDArray[np.float64]
COARSE: dict[str, Any] = {"steps": 50, "mesh": "uniform"}


@cache
def polished(text: str, **options: object) -> quito.Solution:
    given = load_text("title: A problem of the gallery\n" + text, "gallery.yaml")
    return quito.solve(given, polish=True, **(options or COARSE))


def account(solution: quito.Solution) -> str:
    how = solution.polishing
    assert how is not None
    return "\n".join([how.outcome, *(f"{s.action}: {s.sentence}" for s in how.steps)])


# The verifier


@dataclass(frozen=True)
class Symbols:
    """H and what is beside it, written down from the Model anew."""

    model: Model
    hamiltonian: ca.Function
    """(x, λ, u, p, t, ν) ↦ H and the rows that are held at all times."""
    flow: ca.Function
    """(x, λ, u, p, t, ν, μ) ↦ x', λ', integrand of the cost."""
    lower: Array
    upper: Array

    @classmethod
    def of(cls, model: Model) -> Symbols:
        m = model
        rates = m.right_hand_side(m.x, m.u, m.p, m.t)
        costate, nu = ca.SX.sym("l", m.n_x), ca.SX.sym("nu", rates[1].numel() - 1)
        h = rates[1][0] + ca.dot(nu, ca.vec(rates[1][1:])) + ca.dot(costate, rates[0])
        rows = [c.value for c in m.constraints.path]
        low = [c.bounds.lower for c in m.constraints.path]
        high = [c.bounds.upper for c in m.constraints.path]
        for i, (a, b) in enumerate(zip(*m.state_bounds, strict=True)):
            if np.isfinite(a) or np.isfinite(b):
                rows.append(m.x[i])
                low, high = [*low, np.array([a])], [*high, np.array([b])]
        value = ca.vertcat(*rows)
        mu = ca.SX.sym("mu", value.numel())
        given = [m.x, costate, m.u, m.p, m.t, nu]
        slope = -ca.gradient(h + ca.dot(mu, value), m.x)
        return cls(
            m,
            ca.Function("H", given, [h, value]),
            ca.Function("flow", [*given, mu], [rates[0], slope, rates[1][0]]),
            np.concatenate([*low, np.zeros(0)]),
            np.concatenate([*high, np.zeros(0)]),
        )


def assert_extremal(solution: quito.Solution, text: str) -> None:
    """Pontryagin's conditions hold along an answer, and its cost is its own."""
    symbols = Symbols.of(
        build(load_text("title: A problem of the gallery\n" + text, "gallery.yaml"))
    )
    m, p = symbols.model, solution.parameters
    named = [solution.multipliers[f"integral constraint {c.name}"] for c in m.constraints.integral]
    nu = np.concatenate([np.ravel(v) for v in named]) if named else np.zeros(0)
    assert solution.densities is not None
    total, n = 0.0, m.n_x
    sizes = 1 + np.abs(solution.costates).max()
    rng = np.random.default_rng(1)
    for a, b in zip(solution.times[:-1], solution.times[1:], strict=True):
        first, last = a + 1e-9 * (b - a), b - 1e-9 * (b - a)

        def rates(t: float, y: Array) -> Array:
            u, mu = solution.control([t])[0], solution.densities.curve(np.array([t]))[0]  # type: ignore[union-attr]
            found = symbols.flow(y[:n], y[n : 2 * n], u, p, t, nu, mu)
            return np.concatenate([np.array(v).ravel() for v in found])

        y = np.concatenate([solution.state([first])[0], solution.costate([first])[0], [0.0]])
        end = solve_ivp(rates, (first, last), y, method="DOP853", rtol=1e-10, atol=1e-12).y[:, -1]
        np.testing.assert_allclose(end[:n], solution.state([last])[0], rtol=1e-7, atol=1e-8)
        np.testing.assert_allclose(
            end[n:-1], solution.costate([last])[0], rtol=1e-7, atol=1e-7 * sizes
        )
        total += end[-1]
        for t in np.linspace(first, last, 4)[1:-1]:
            assert_least(symbols, solution, float(t), nu, rng)
    x, ends = solution.state(solution.times[[0, -1]]), solution.times[[0, -1]]
    total += float(m.end_cost(x[0], ends[0], x[-1], ends[-1], p))
    assert (-total if solution.origin.maximize else total) == pytest.approx(
        solution.cost, rel=1e-7, abs=1e-8
    )


def assert_least(
    symbols: Symbols, solution: quito.Solution, t: float, nu: Array, rng: np.random.Generator
) -> None:
    """H is least among admissible controls, and multipliers press the way they may."""
    m, p, u = symbols.model, solution.parameters, solution.control([t])[0]
    x, costate = solution.state([t])[0], solution.costate([t])[0]
    low, high = m.control_bounds
    low, high = np.where(np.isfinite(low), low, u - 2), np.where(np.isfinite(high), high, u + 2)
    tries = [u, *(low + (high - low) * rng.random(m.n_u) for _ in range(40))]
    tries += [
        np.clip(u + 0.02 * (high - low) * rng.standard_normal(m.n_u), low, high) for _ in range(20)
    ]
    found = [symbols.hamiltonian(x, costate, v, p, t, nu) for v in tries]
    values = np.array([float(h) for h, _ in found])
    rows = np.array([np.array(r).ravel() for _, r in found])
    slack = 1e-8 * (1 + np.abs(rows[0]))
    inside = ((rows >= symbols.lower - slack) & (rows <= symbols.upper + slack)).all(axis=1)
    assert inside[0], f"constraints at {t}: {rows[0]}"
    size = np.abs(values).max() + 1
    assert values[0] - values[inside].min() <= 1e-7 * size, f"H is less at {t}"
    assert solution.densities is not None
    mu = solution.densities.curve(np.array([t]))[0]
    most = 1e-6 * (1 + np.abs(mu).max(initial=0.0))
    assert not np.any((mu > most) & (rows[0] < symbols.upper - 1e-6)), "μ > 0 below an upper bound"
    assert not np.any((mu < -most) & (rows[0] > symbols.lower + 1e-6)), "μ < 0 above a lower bound"


# Problems whose answers are known


@dataclass(frozen=True)
class Case:
    text: str
    cost: float | None = None
    junctions: tuple[float, ...] | None = None


FIRST = math.atan2(math.sqrt(63) / 8, 31 / 8)
LAST = math.atan2(math.sqrt(63) / 8, 1 / 8)
"""Times on the first and the last circle about ∓1: the switch lies where (x + 1)² + v² = 16 and
(x − 3)² + v² = 1, at x = 23/8; half a turn later the last arc begins."""
TANGENT = math.sqrt(0.2)
"""Where a straight line from the origin touches the hill 0.2 − 4 (t − 0.5)²."""
HILL = (8 * (0.5 - TANGENT)) ** 2 * TANGENT + 64 / 3 * (0.5 - TANGENT) ** 3
CAP = 4 ** (1 / 3)
"""u = 0, then p: 1/(2p) + p²/16 is least where p³ = 4."""
MIXED = -1 + 0.2 * (0.008 / 3 + quad(lambda s: (1.2 - math.exp(-s)) ** 2, 0, math.log(5))[0])
"""x = 0, then u = 1 to x = 0.2, then x = 1.2 − e^−s, for so long that 0.2 (1.2 − e^−s)² = e^−s."""
DECAY = float(
    minimize_scalar(
        lambda p: (math.exp(-p) - 0.5) ** 2 + 0.1 * p**2, bounds=(0, 3), options={"xatol": 1e-12}
    ).fun
)

SHARE = (
    quad(lambda t: 0.2 * t + 0.8 * (1.5 - t), 0, 0.75)[0]
    + quad(lambda t: 0.8 * t + 0.2 * (1.5 - t), 0.75, 1.5)[0]
    + quad(lambda t: 0.8 * t, 1.5, 3)[0]
)

KNOWN: dict[str, Case] = {
    "share": Case(
        """
sense: maximize
time: {initial: 0, final: 3}
states: {x: {initial: 0}}
controls: {a: {lower: 0, upper: 0.8}, b: {lower: 0, upper: 0.8}}
dynamics: {x: a*t + b*(1.5 - t)}
cost: {mayer: x}
constraints: {path: {both: a + b <= 1}}
""",
        SHARE,
        (0.75, 1.5),
    ),
    "param_point": Case(
        """
time: {initial: 0, final: 1}
states: {x: {initial: 0}}
controls: {u: {}}
parameters: {p: {lower: 0, upper: 3, guess: 0.5}}
dynamics: {x: u}
cost: {lagrange: u^2/2, mayer: 0.5*(p - 2)^2}
constraints: {point: {half: {at: 0.5, holds: x == p}, end: {at: 1, holds: x >= p}}}
""",
        4 / 3,
        (0.5,),
    ),
    "close": Case(
        """
time: {initial: 0, final: 1}
states: {x: {initial: 0}, y: {initial: 0}}
controls: {u: {lower: -1, upper: 1}, v: {lower: -1, upper: 1}}
dynamics: {x: u, y: v}
cost: {lagrange: x*cos(2*pi*t) + y*cos(2*pi*t + 0.004)}
""",
        None,
        (0.5 - 0.004 / math.pi, 0.5),
    ),
    "coast": Case(
        """
time: {initial: 0, final: {lower: 0.1, upper: 20, guess: 5}}
states: {x: {initial: 0, final: 3}, v: {initial: 0, final: 0, upper: 1}}
controls: {u: {lower: -1, upper: 1}}
dynamics: {x: v, v: u}
cost: {mayer: t}
""",
        4,
        (1, 3),
    ),
    "disc": Case(
        """
time: {initial: 0, final: {lower: 0.1, upper: 20, guess: 3}}
states: {x: {initial: 0, final: 3}, y: {initial: 0, final: 4}}
controls: {a: {}, b: {}}
dynamics: {x: a, y: b}
cost: {mayer: t}
constraints: {path: {round: a^2 + b^2 <= 1}}
""",
        5,
        (),
    ),
    "oscillator": Case(
        """
time: {initial: 0, final: {lower: 1, upper: 12, guess: 5}}
states: {x: {initial: 3, final: 0, guess: 3*cos(t)}, v: {initial: 0, final: 0, guess: -3*sin(t)}}
controls: {u: {lower: -1, upper: 1}}
dynamics: {x: v, v: -x + u}
cost: {mayer: t}
""",
        FIRST + math.pi + LAST,
        (FIRST, FIRST + math.pi),
    ),
    "fuel_split": Case(
        """
time: {initial: 0, final: 4}
states: {x: {initial: 1, final: 0}, v: {initial: 0, final: 0}}
controls: {a: {lower: 0, upper: 1}, b: {lower: 0, upper: 1}}
dynamics: {x: v, v: a - b}
cost: {lagrange: a + b}
""",
        2 * (2 - math.sqrt(3)),
        (2 - math.sqrt(3), 2 + math.sqrt(3)),
    ),
    "isoperimetric": Case(
        """
time: {initial: 0, final: 1}
states: {x: {initial: 0, final: 0, guess: t*(1-t)*5}}
controls: {u: {}}
dynamics: {x: u}
cost: {lagrange: u^2}
constraints: {integral: {norm: x^2 == 1}}
""",
        math.pi**2,
        (),
    ),
    "bd_border": Case(
        """
time: {initial: 0, final: 1}
states: {x: {initial: 0, final: 0, upper: 1/6}, v: {initial: 1, final: -1}}
controls: {u: {}}
dynamics: {x: v, v: u}
cost: {lagrange: u^2/2}
""",
        8 / 3,
        None,
    ),
    "held_to_end": Case(
        """
time: {initial: 0, final: 3}
states: {x: {initial: 0, upper: 1}}
controls: {u: {lower: -1, upper: 1}}
dynamics: {x: u}
cost: {lagrange: (x - 2)^2}
""",
        7 / 3 + 2,
        (1,),
    ),
    "held_always": Case(
        """
time: {initial: 0, final: 3}
states: {x: {initial: 1, upper: 1}}
controls: {u: {lower: -1, upper: 1}}
dynamics: {x: u}
cost: {lagrange: (x - 2)^2}
""",
        3,
        (),
    ),
    "held_then_singular": Case(
        """
time: {initial: 0, final: 3}
states: {x: {initial: 1, upper: 1}}
controls: {u: {lower: -2, upper: 2}}
dynamics: {x: u}
cost: {lagrange: (x - 2 + t)^2}
""",
        1 / 3,
        (1,),
    ),
    "singular_then_held": Case(
        """
time: {initial: 0, final: 2}
states: {x: {initial: 0.5, upper: 1}}
controls: {u: {lower: -1, upper: 2}}
dynamics: {x: u}
cost: {lagrange: (x - t)^2}
""",
        0.5**3 / 6 + 1 / 3,
        (0.25, 1),
    ),
    "obstacle": Case(
        """
time: {initial: 0, final: 1}
states: {x: {initial: 0, final: 0}}
controls: {u: {}}
dynamics: {x: u}
cost: {lagrange: u^2/2}
constraints: {path: {hill: "x >= 0.2 - 4*(t - 0.5)^2"}}
""",
        HILL,
        (TANGENT, 1 - TANGENT),
    ),
    "two_obstacles": Case(
        """
time: {initial: 0, final: 1}
states: {x: {initial: 0, final: 0}, y: {initial: 0, final: 0}}
controls: {u: {}, v: {}}
dynamics: {x: u, y: v}
cost: {lagrange: (u^2 + v^2)/2}
constraints: {path: {hill: "x >= 0.2 - 4*(t - 0.5)^2", dale: "y <= 4*(t - 0.5)^2 - 0.2"}}
""",
        2 * HILL,
        (TANGENT, 1 - TANGENT),
    ),
    "stiff": Case(
        """
time: {initial: 0, final: 1}
states: {x: {initial: 1, final: 1}}
controls: {u: {}}
dynamics: {x: u}
cost: {lagrange: 10000*x^2 + u^2}
""",
        200 * math.tanh(50),
        (),
    ),
    "fixed_control": Case(
        """
time: {initial: 0, final: 1}
states: {x: {initial: 0, final: 1}}
controls: {u: {}, w: {lower: 0.5, upper: 0.5}}
dynamics: {x: u + w}
cost: {lagrange: u^2}
""",
        0.25,
        (),
    ),
    "no_control": Case(
        """
time: {initial: 0, final: 1}
states: {x: {initial: 1}}
parameters: {p: {guess: 0.5, lower: 0, upper: 3}}
dynamics: {x: -p*x}
cost: {mayer: (x - 0.5)^2 + 0.1*p^2}
""",
        DECAY,
        (),
    ),
    "late_bound": Case(
        """
time: {initial: {lower: -0.5, upper: 0, guess: -0.2}, final: 1}
states: {x: {initial: 0, final: 2}}
controls: {u: {}}
dynamics: {x: u}
cost: {lagrange: u^2/2 + 0.5}
""",
        4 / 3 + 0.75,
        (),
    ),
    "late_free": Case(
        """
time: {initial: {lower: -3, upper: 0, guess: -0.2}, final: 1}
states: {x: {initial: 0, final: 2}}
controls: {u: {}}
dynamics: {x: u}
cost: {lagrange: u^2/2 + 0.5}
""",
        2,
        (),
    ),
    "end_range": Case(
        """
time: {initial: 0, final: 1}
states: {x: {initial: {lower: -2, upper: 0.5}, final: {lower: 1, upper: 2}}}
controls: {u: {}}
dynamics: {x: u}
cost: {lagrange: u^2/2}
""",
        0.125,
        (),
    ),
    "param_path": Case(
        """
time: {initial: 0, final: 1}
states: {x: {initial: 0, final: 1}}
controls: {u: {lower: 0, upper: 10}}
parameters: {p: {lower: 0.5, upper: 5, guess: 2}}
dynamics: {x: u}
cost: {lagrange: x, mayer: p^2/16}
constraints: {path: {cap: u <= p}}
""",
        1 / (2 * CAP) + CAP**2 / 16,
        (1 - 1 / CAP,),
    ),
    "param_bound": Case(
        """
time: {initial: 0, final: 1}
states: {x: {initial: 0, final: 1}}
controls: {u: {lower: 0, upper: 10}}
parameters: {p: {lower: 0.5, upper: 1.25, guess: 1.1}}
dynamics: {x: u}
cost: {lagrange: x, mayer: p^2/16}
constraints: {path: {cap: u <= p}}
""",
        0.4 + 1.25**2 / 16,
        (0.2,),
    ),
    "boundary": Case(
        """
time: {initial: 0, final: 1}
states: {x: {}}
controls: {u: {}}
dynamics: {x: u}
cost: {lagrange: u^2/2, mayer: initial(x)^2}
constraints: {boundary: {rise: final(x) - initial(x) >= 1, roof: final(x) <= 5}}
""",
        0.5,
        (),
    ),
    "products": Case(
        """
time: {initial: 0, final: 1}
states: {x: {initial: 0, final: 1}}
controls: {a: {}, b: {}}
dynamics: {x: a + b + 0.5*a*b}
cost: {lagrange: a^2 + 2*b^2 + 0.1*x^2}
""",
        None,
        (),
    ),
    "saddle": Case(
        """
time: {initial: 0, final: 1}
states: {x: {initial: 0}}
controls: {a: {lower: -1, upper: 1, guess: 1}, b: {lower: -1, upper: 1, guess: 1}}
dynamics: {x: a*b}
cost: {lagrange: x*cos(2*pi*t)}
""",
        -1 / math.pi**2,
        (0.5,),
    ),
    "symmetry": Case(
        """
time: {initial: 0, final: 1}
states: {x: {initial: 0}, y: {initial: 0}}
controls: {u: {lower: -1, upper: 1}, v: {lower: -1, upper: 1}}
dynamics: {x: u, y: v}
cost: {lagrange: (x + y)*cos(2*pi*t)}
""",
        -2 / math.pi**2,
        (0.5,),
    ),
    "two_singular": Case(
        """
time: {initial: 0, final: 2}
states: {x: {initial: 1}, y: {initial: 1}}
controls: {a: {lower: -1, upper: 1}, b: {lower: -1, upper: 1}}
dynamics: {x: a, y: b}
cost: {lagrange: x^2 + y^2}
""",
        2 / 3,
        (1,),
    ),
    "two_singular_apart": Case(
        """
time: {initial: 0, final: 2}
states: {x: {initial: 1}, y: {initial: -0.5}}
controls: {a: {lower: -1, upper: 1}, b: {lower: -1, upper: 1}}
dynamics: {x: a, y: b}
cost: {lagrange: x^2 + y^2 + x*y}
""",
        None,
        None,
    ),
    "mixed_affine": Case(
        """
time: {initial: 0, final: 2}
states: {x: {initial: 0}}
controls: {u: {lower: -1, upper: 1}}
dynamics: {x: u}
cost: {mayer: -x, lagrange: 0.2*x^2}
constraints: {path: {m: u + x <= 1.2}}
""",
        MIXED,
        (1.8 - math.log(5), 2 - math.log(5)),
    ),
    "eqpath": Case(
        """
time: {initial: 0, final: 1}
states: {x: {initial: 1}, y: {initial: 0}}
controls: {a: {}, b: {}}
dynamics: {x: a, y: b}
cost: {lagrange: x^2 + y^2 + a^2 + 2*b^2}
constraints: {path: {tie: a + b == x*y}}
""",
        None,
        (),
    ),
    "saturated": Case(
        """
time: {initial: 0, final: 3}
states: {x: {initial: 1}, v: {initial: 0}}
controls: {u: {lower: -0.4, upper: 0.4}}
dynamics: {x: v, v: u + 0.3*(1 - x^2)*v}
cost: {lagrange: x^2 + u^2}
""",
        None,
        None,
    ),
    "twostate": Case(
        """
time: {initial: 0, final: 4}
states: {x: {initial: 0, final: 1.9, upper: 2}, v: {initial: 0, final: 0, upper: 0.7, lower: -1}}
controls: {u: {lower: -2, upper: 2}}
dynamics: {x: v, v: u - 0.2*v}
cost: {lagrange: u^2 - x}
""",
        None,
        None,
    ),
    "periodic": Case(
        """
time: {initial: 0, final: 2*pi}
states: {x: {}, y: {}}
controls: {u: {lower: -0.3, upper: 0.3}}
dynamics: {x: y, y: -x/2 + u}
cost: {lagrange: (x - cos(t))^2 + u^2}
constraints: {boundary: {px: final(x) == initial(x), py: final(y) == initial(y)}}
""",
        None,
        None,
    ),
    "twosing": Case(
        """
time: {initial: 0, final: 3}
states: {x: {initial: 1}, y: {initial: -1}, z: {initial: 0.5}}
controls: {a: {lower: -1, upper: 1}, b: {lower: -1, upper: 1}}
dynamics: {x: a + 0.2*z, y: b + 0.1*x, z: -z + x*y}
cost: {lagrange: x^2 + y^2 + z^2 + 0.3*x*y}
""",
        None,
        None,
    ),
    "slack_integral": Case(
        """
time: {initial: 0, final: 1}
states: {x: {initial: 0, final: 1}}
controls: {u: {}}
dynamics: {x: u}
cost: {lagrange: u^2/2}
constraints: {integral: {budget: u^2 <= 100, other: x <= 3}}
""",
        0.5,
        (),
    ),
    "point_at_1": Case(
        """
time: {initial: 0, final: 1}
states: {x: {initial: 0, final: 0}, v: {initial: 0}}
controls: {u: {}}
dynamics: {x: v, v: u}
cost: {lagrange: u^2/2}
constraints: {point: {end: {at: 1, holds: v == 1}}}
""",
        2,
        (),
    ),
    "point_at_0": Case(
        """
time: {initial: 0, final: 1}
states: {x: {final: 0}, v: {final: 1}}
controls: {u: {}}
dynamics: {x: v, v: u}
cost: {lagrange: u^2/2}
constraints: {point: {start: {at: 0, holds: "[x, v] == [0, 0]"}}}
""",
        2,
        (),
    ),
    "gate_late": Case(
        """
time: {initial: 0, final: {lower: 0.5, upper: 2, guess: 1}}
states: {x: {initial: 0, final: 0}}
controls: {u: {}}
dynamics: {x: u}
cost: {lagrange: u^2/2 + 0.1}
constraints: {point: {gate: {at: 0.5, holds: x == 1}}}
""",
        1.2,
        (1,),
    ),
    "gate_moves": Case(
        """
time: {initial: 0, final: {lower: 0.5, upper: 20, guess: 3}}
states: {x: {initial: 0}}
controls: {u: {}}
dynamics: {x: u}
cost: {lagrange: u^2/2 + 0.5}
constraints: {point: {gate: {at: 0.5, holds: x == 1 + t}, end: {at: 1, holds: x == 4 - 0.5*t}}}
""",
        2 * math.sqrt(17.5) - 5,
        (math.sqrt(10 / 7),),
    ),
    "twice": Case(
        """
time: {initial: 0, final: {lower: 0.5, upper: 20, guess: 3}}
states: {x: {initial: 0}, y: {initial: 0}}
controls: {u: {}, v: {}}
dynamics: {x: u, y: v}
cost: {lagrange: u^2/2 + v^2/2 + 0.5}
constraints:
  point:
    gate: {at: 0.5, holds: x == 1 + t}
    low: {at: 0.5, holds: y <= -1}
    slack: {at: 0.5, holds: y >= -2}
    end: {at: 1, holds: x == 4 - 0.5*t}
    back: {at: 1, holds: y == 0}
""",
        2 * math.sqrt(21) - 5,
        (math.sqrt(12 / 7),),
    ),
    "end_range_point": Case(
        """
time: {initial: 0, final: 1}
states: {x: {initial: 0, final: {lower: 0, upper: 0.8}}, y: {initial: 0}}
controls: {u: {}, v: {}}
dynamics: {x: u, y: v}
cost: {lagrange: (u^2+v^2)/2}
constraints: {point: {end: {at: 1, holds: x + y == 2}}}
""",
        1.04,
        (),
    ),
    "end_range_point_slack": Case(
        """
time: {initial: 0, final: 1}
states: {x: {initial: 0, final: {lower: 0, upper: 1.8}}, y: {initial: 0}}
controls: {u: {}, v: {}}
dynamics: {x: u, y: v}
cost: {lagrange: (u^2+v^2)/2}
constraints:
  point:
    end: {at: 1, holds: x + y >= 2}
    slack: {at: 1, holds: x <= 5}
    before: {at: 0, holds: x + y <= 1}
""",
        1,
        (),
    ),
    "point_at_0_free": Case(
        """
time: {initial: {lower: -3, upper: 0, guess: -0.5}, final: {lower: 0.5, upper: 3, guess: 1}}
states: {x: {}}
controls: {u: {}}
dynamics: {x: u}
cost: {lagrange: u^2/2 + 0.5, mayer: 0.5*(final(t)-1)^2}
constraints: {point: {start: {at: 0, holds: x == 3*t + 2}, end: {at: 1, holds: x >= 3}}}
""",
        None,
        (),
    ),
}


@pytest.mark.parametrize("name", KNOWN)
def test_what_is_polished_from_fifty_equal_cells_is_exact(name: str) -> None:
    case = KNOWN[name]
    solution = polished(case.text)
    assert solution.polished, account(solution)
    assert solution.success
    assert failing(solution.certificate) == []
    if case.cost is not None:
        assert solution.cost == pytest.approx(case.cost, rel=1e-9, abs=1e-10)
    if case.junctions is not None:
        assert solution.switching_times == pytest.approx(case.junctions, abs=1e-8)
    assert_extremal(solution, case.text)


def test_an_arc_of_hardly_any_length_is_dropped() -> None:
    """From a staircase the touch of the border case comes as an arc, whose length turns out 0."""
    staircase = {"discretization": "euler", "control": "piecewise-constant"}
    solution = polished(KNOWN["bd_border"].text, mesh="uniform", steps=100, **staircase)
    assert solution.polished, account(solution)
    assert solution.cost == pytest.approx(8 / 3, rel=1e-9)


# What must not be polished

REFUSED: dict[str, str] = {
    "of two wells the shallower": """
time: {initial: 0, final: 1}
states: {x: {initial: 0, guess: t}}
controls: {u: {lower: -2, upper: 2, guess: 1}}
dynamics: {x: u}
cost: {lagrange: (u^2 - 1)^2 + 0.5*u}
""",
    "of two bounds the dearer": """
time: {initial: 0, final: 1}
states: {x: {initial: 0, guess: t}}
controls: {u: {lower: -1, upper: 1, guess: 1}}
dynamics: {x: u}
cost: {lagrange: -u^2 + 0.5*u}
""",
    "between wells": """
time: {initial: 0, final: 1}
states: {x: {initial: 0}}
controls: {u: {lower: -2, upper: 2}}
dynamics: {x: u}
cost: {lagrange: (u^2 - 1)^2 + x^2}
""",
    "Fuller": """
time: {initial: 0, final: 3}
states: {x: {initial: 1, final: 0}, v: {initial: 0, final: 0}}
controls: {u: {lower: -1, upper: 1}}
dynamics: {x: v, v: u}
cost: {lagrange: x^2}
""",
    "any control is optimal": """
time: {initial: 0, final: 2}
states: {x: {initial: 0, final: 0.5}}
controls: {u: {lower: -1, upper: 1}}
dynamics: {x: u}
cost: {lagrange: u}
""",
    "abnormal": """
time: {initial: 0, final: 1}
states: {x: {initial: 0, final: 0}, y: {initial: 0}}
controls: {u: {lower: -1, upper: 1}}
dynamics: {x: u^2, y: u}
cost: {mayer: y}
""",
    "a gear that shifts where x = 0.5": """
time: {initial: 0, final: 1}
states: {x: {initial: 0, final: 1}}
controls: {u: {guess: 0.8}}
dynamics: {x: "if_else(x < 0.5, u, 2*u)"}
cost: {lagrange: u^2}
""",
    "a kink at a time that is not known": """
time: {initial: 0, final: 2}
states: {x: {initial: 1, final: -1}}
controls: {u: {lower: -1, upper: 1}}
dynamics: {x: "u*(1 + 0.5*abs(x - 0.123))"}
cost: {lagrange: u^2/2}
""",
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_extremal_or_no_isolated_one_is_refused(name: str) -> None:
    solution = polished(REFUSED[name])
    how = solution.polishing
    assert how is not None
    assert not solution.polished, account(solution)
    assert how.reason


# Structures that are wrong

Arcs = list[Arc]


def shifted(arcs: Arcs, span: float, rng: np.random.Generator) -> Arcs:
    """Move every junction by up to a part of the horizon."""
    ends = {a.end for a in arcs if a.end < max(b.end for b in arcs)}
    moved = {t: t + span * rng.uniform(-1, 1) for t in sorted(ends)}
    placed = [
        replace(a, start=moved.get(a.start, a.start), end=moved.get(a.end, a.end)) for a in arcs
    ]
    return [a for a in placed if a.end > a.start]


def without(arcs: Arcs, k: int) -> Arcs | None:
    """Give an arc to the one beside it."""
    own = [a for a in arcs if a.of == arcs[k].of]
    if len(own) == 1:
        return None
    at = own.index(arcs[k])
    beside = own[at - 1] if at else own[1]
    first, last = min(beside.start, arcs[k].start), max(beside.end, arcs[k].end)
    wider = replace(beside, start=first, end=last)
    return [wider if a is beside else a for a in arcs if a is not arcs[k]]


def spurious(arcs: Arcs, k: int, kind: Kind) -> Arcs:
    """Put an arc of another kind into the middle of one."""
    a = arcs[k]
    start, end = a.start + 0.4 * (a.end - a.start), a.start + 0.7 * (a.end - a.start)
    parts = [replace(a, end=start), replace(a, kind=kind, start=start, end=end)]
    return [*arcs[:k], *parts, replace(a, start=end), *arcs[k + 1 :]]


def hostile(arcs: Arcs, horizon: float) -> Iterator[tuple[str, Arcs]]:
    rng = np.random.default_rng(3)
    for part in (0.03, 0.1):
        yield f"shifted by {part:.0%}", shifted(arcs, part * horizon, rng)
    for k, arc in enumerate(arcs):
        less = without(arcs, k)
        if less is not None:
            yield f"without {arc}", less
        kinds: tuple[Kind, ...] = ("active",)
        if arc.kind not in ("active", "inactive"):
            kinds = ("upper", "singular")
        for kind in kinds:
            if kind != arc.kind:
                yield f"{arc} with an arc {kind}", spurious(arcs, k, kind)


@pytest.mark.parametrize("name", ["singular_then_held", "obstacle", "saturated", "gate_moves"])
def test_a_wrong_structure_is_mended_or_refused(name: str) -> None:
    case = KNOWN[name]
    problem = load_text("title: A problem of the gallery\n" + case.text, "gallery.yaml")
    model, direct = build(problem), quito.solve(problem, **COARSE)
    right = polished(case.text).cost
    assert direct.extremal is not None
    mended, tried = 0, 0
    for what, arcs in hostile(list(direct.arcs), float(np.ptp(direct.times))):
        given = replace(direct, extremal=replace(direct.extremal, arcs=tuple(arcs)))
        ended = sought(model, given, Log())
        tried += 1
        if ended.extremal is None:
            assert ended.reason, what
            continue
        mended += 1
        assert exact(ended.extremal, ended.residual).cost == pytest.approx(right, rel=1e-9), what
    assert mended > tried / 2
