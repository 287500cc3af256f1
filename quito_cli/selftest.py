"""A quick test of a solver on two small problems whose optimal costs are known in closed form."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

from quito_cli.errors import QuitoError

STEPS = 20
PROBLEMS = {
    "quadratic": (
        """
title: x = cosh(1 - t)/cosh(1), cost tanh(1)/2
time: {initial: 0, final: 1}
states: {x: {initial: 1}}
controls: {u: {}}
dynamics: {x: u}
cost: {lagrange: 0.5*(x^2 + u^2)}
""",
        math.tanh(1) / 2,
    ),
    "nonlinear": (
        """
title: log(x) is driven from 0 to 1 by u = 1, cost 1
time: {initial: 0, final: 1}
states: {x: {initial: 1, final: exp(1)}}
controls: {u: {lower: -3, upper: 3}}
dynamics: {x: u*x}
cost: {lagrange: u^2}
""",
        1.0,
    ),
}
"""Text and cost, by the kind of problem."""


@dataclass(frozen=True)
class Tested:
    """What came of one problem."""

    problem: str
    success: bool
    message: str
    iterations: int | None
    seconds: float
    cost_error: float
    """Relative to the cost in closed form; the error of the discretization is in it."""


def selftest(solver: str) -> tuple[Tested, ...]:
    """Return how `solver` does on the problems that it takes."""
    from quito_cli.solvers import backend

    taken = ["quadratic"] if backend(solver).takes == "QP" else list(PROBLEMS)
    return tuple(_tested(solver, kind) for kind in taken)


def _tested(solver: str, kind: str) -> Tested:
    from quito_cli.problem.load import load_text
    from quito_cli.solve import solve

    text, cost = PROBLEMS[kind]
    started = time.perf_counter()
    try:
        found = solve(load_text(text, f"{kind}.yaml"), steps=STEPS, solver=solver)
    except QuitoError as error:
        return Tested(kind, False, str(error), None, time.perf_counter() - started, math.nan)
    return Tested(
        kind,
        found.success,
        found.status.value,
        found.statistics.iterations,
        time.perf_counter() - started,
        abs(found.cost - cost) / cost,
    )
