"""What quito's speed is measured against: the same two problems, written by hand and by the book.

`script` is the CasADi script that a user of the field writes in an afternoon: SX, direct multiple
shooting, one step of Kutta's classical scheme a cell, piecewise constant control, `nlpsol` with
IPOPT and CasADi's own derivatives (compare `direct_multiple_shooting` among CasADi's examples).

`original` builds the nonlinear program as the published QuITO 1 does (MATLAB,
github.com/Gdarthsid/QuITO-Version-1, `src/problemTranscription/solveProblem.m`): `casadi.Opti`, û
at every node a sum over all N+1 basis functions assigned into a matrix of its own, the dynamics
stepped by Kutta's scheme with û held, the Lagrange cost by Euler's rule (the examples' setting),
every defect and every bound a constraint of its own. Options of IPOPT are those of its examples.

Nothing is measured here; run `pytest -m benchmark tests/benchmarks/test_speed.py`.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import casadi as ca

Expression = Any
"""A CasADi SX, MX or DM, or a number."""


@dataclass(frozen=True)
class Case:
    """A problem with fixed initial state, free final state and one bounded control in [−1, 1]."""

    name: str
    """Of the bundled problem file."""
    initial: tuple[float, ...]
    horizon: float
    right_hand_side: Callable[[Expression, Expression], list[Expression]]
    lagrange: Callable[[Expression], Expression]
    mayer: Callable[[Expression], Expression]

    @property
    def size(self) -> int:
        """Number of states."""
        return len(self.initial)


ALY_CHAN = Case(
    "alychan",
    (0.0, 1.0, 0.0),
    math.pi / 2,
    lambda x, u: [x[1], u, 0.5 * (x[1] ** 2 - x[0] ** 2)],
    lambda x: 0.0,
    lambda x: x[2],
)
VAN_DER_POL = Case(
    "van_der_pol",
    (0.0, 1.0),
    4.0,
    lambda x, u: [x[1], (1 - x[0] ** 2) * x[1] - x[0] + u],
    lambda x: 0.5 * (x[0] ** 2 + x[1] ** 2),
    lambda x: 0.0,
)


@dataclass(frozen=True)
class Run:
    """One build and solve."""

    build_seconds: float
    solve_seconds: float
    cost: float
    iterations: int
    solved: bool

    @property
    def seconds(self) -> float:
        """Of build and solve."""
        return self.build_seconds + self.solve_seconds


def script(case: Case, steps: int) -> Run:
    """Build and solve `case` on `steps` cells as a hand-written CasADi script does."""
    started = time.perf_counter()
    program, bounds = _shooting(case, steps)
    options: dict[str, Any] = {"print_time": False, "ipopt": {"print_level": 0, "sb": "yes"}}
    solver = ca.nlpsol("script", "ipopt", program, options)
    built = time.perf_counter()
    found = solver(**bounds)
    solved = time.perf_counter()
    said = solver.stats()
    return Run(
        built - started, solved - built, float(found["f"]), said["iter_count"], said["success"]
    )


def _shooting(case: Case, steps: int) -> tuple[dict[str, ca.SX], dict[str, Any]]:
    """Return the multiple shooting program in SX, and its bounds and guess."""
    step = _step(case, case.horizon / steps)
    x = ca.SX.sym("x0", case.size)
    unknowns, rows, cost = [x], [], ca.SX(0)
    lower, upper, guess = list(case.initial), list(case.initial), list(case.initial)
    for k in range(steps):
        u = ca.SX.sym(f"u{k}")
        after, running = step(x, u)
        cost += running
        x = ca.SX.sym(f"x{k + 1}", case.size)
        unknowns += [u, x]
        rows.append(after - x)
        lower += [-1.0] + [-math.inf] * case.size
        upper += [1.0] + [math.inf] * case.size
        guess += [0.0, *case.initial]
    program = {"x": ca.vertcat(*unknowns), "f": cost + case.mayer(x), "g": ca.vertcat(*rows)}
    return program, {"x0": guess, "lbx": lower, "ubx": upper, "lbg": 0, "ubg": 0}


def _step(case: Case, h: float) -> ca.Function:
    """Return (x, u) ↦ (x, cost) one step of Kutta's classical scheme later, u held."""
    x, u = ca.SX.sym("x", case.size), ca.SX.sym("u")

    def slope(at: Expression) -> Expression:
        return ca.vertcat(*case.right_hand_side(at, u), case.lagrange(at))

    n = case.size
    k1 = slope(x)
    k2 = slope(x + h / 2 * k1[:n])
    k3 = slope(x + h / 2 * k2[:n])
    k4 = slope(x + h * k3[:n])
    rise = h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return ca.Function("step", [x, u], [x + rise[:n], rise[n]])


def original(case: Case, steps: int, variance: float) -> Run:
    """Build and solve `case` on `steps` cells as the published QuITO 1 does."""
    started = time.perf_counter()
    opti, cost = _original_program(case, steps, variance)
    built = time.perf_counter()
    ipopt = {"tol": 1e-9, "max_iter": 5000, "mu_strategy": "adaptive"}
    quiet = {"print_level": 0, "sb": "yes"}
    options: dict[str, Any] = {"print_time": False, "ipopt": ipopt | quiet}
    opti.solver("ipopt", options)
    with suppress(RuntimeError):  # raised where IPOPT does not converge; the statistics tell
        opti.solve()
    solved = time.perf_counter()
    said = opti.stats()
    return Run(
        built - started,
        solved - built,
        float(opti.debug.value(cost)),
        said["iter_count"],
        said["success"],
    )


def _original_program(case: Case, steps: int, variance: float) -> tuple[ca.Opti, ca.MX]:
    """Return the program, built node by node, and its cost."""
    h = case.horizon / steps
    times = [k * h for k in range(steps + 1)]
    opti = ca.Opti()
    X = opti.variable(case.size, steps + 1)
    coefficients = opti.variable(1, steps + 1)
    U = opti.variable(1, steps + 1)
    for k, t in enumerate(times):
        U[:, k] = _dense_sum(coefficients, t, times, h, variance)
    x, u = ca.SX.sym("x", case.size), ca.SX.sym("u")
    slope = ca.Function("slope", [x, u], [ca.vertcat(*case.right_hand_side(x, u))])
    lagrange = ca.Function("lagrange", [x, u], [case.lagrange(x)])
    cost = ca.MX(0)
    for k in range(steps):
        cost += lagrange(X[:, k], U[:, k]) * h
    cost += case.mayer(X[:, steps])
    for k in range(steps):
        k1 = slope(X[:, k], U[:, k])
        k2 = slope(X[:, k] + h / 2 * k1, U[:, k])
        k3 = slope(X[:, k] + h / 2 * k2, U[:, k])
        k4 = slope(X[:, k] + h * k3, U[:, k])
        opti.subject_to(X[:, k + 1] == X[:, k] + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4))
    _bound_one_by_one(opti, case, steps, X, U)
    opti.minimize(cost)
    return opti, cost


def _dense_sum(coefficients: ca.MX, t: float, times: list[float], h: float, D: float) -> ca.MX:
    """Return (πD)^(−1/2) Σ_j c_j exp(−(t − t_j)²/(D h²)), every j of it."""
    total = ca.MX(0)
    for j, node in enumerate(times):
        weight = math.exp(-(((t - node) / h) ** 2) / D) / math.sqrt(math.pi * D)
        total = total + coefficients[:, j] * weight
    return total


def _bound_one_by_one(opti: ca.Opti, case: Case, steps: int, X: ca.MX, U: ca.MX) -> None:
    """Add the ends and every bound, infinite ones too, one constraint each."""
    for i, value in enumerate(case.initial):
        opti.subject_to(X[i, 0] == value)
        opti.subject_to(X[i, steps] >= -math.inf)
        opti.subject_to(X[i, steps] <= math.inf)
    for i in range(case.size):
        for k in range(steps + 1):
            opti.subject_to(X[i, k] >= -math.inf)
            opti.subject_to(X[i, k] <= math.inf)
    for k in range(steps + 1):
        opti.subject_to(U[:, k] >= -1)
        opti.subject_to(U[:, k] <= 1)
