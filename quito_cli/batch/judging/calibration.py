"""How long this machine takes for a fixed small solve: the unit that times are recorded in.

The solve is the Van der Pol oscillator of the library,

    min ½∫(x₁² + x₂²) dt,   x₁' = x₂,   x₂' = (1 − x₁²) x₂ − x₁ + u,   |u| <= 1,   0 <= t <= 4,

by multiple shooting on 50 cells with piecewise constant controls and one step of the classical
Runge-Kutta scheme in each, written out in CasADi here and given to IPOPT. It goes through none of
quito's own code, on purpose: were quito slower, a calibration by quito would be as much slower, and
their ratio would say nothing. What counts is the time of the processor, not that of the clock,
which has in it whatever else the machine does.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from quito_cli.batch.workers.solving import processor_seconds

REPEATS: Final = 5
"""Solves of which the fastest counts, after a first one that does not. What disturbs a solve makes
it slower and never faster, so that of several the fastest is known best."""
_CELLS: Final = 50
_HORIZON: Final = 4.0


def calibrate(_tell: Callable[[Any], None] | None = None) -> float:
    """Return the processor seconds that the calibration solve takes here, building included.

    As a job of a worker it has nothing to tell on its way.
    """
    times = []
    for _ in range(REPEATS + 1):
        used = processor_seconds()
        solve()
        times.append(processor_seconds() - used)
    return min(times[1:])


def solve() -> float:
    """Do the calibration solve; return its cost."""
    import casadi as ca

    unknowns, rows, cost = _program()
    quiet: dict[str, Any] = {"print_time": False, "ipopt": {"print_level": 0, "sb": "yes"}}
    program = {"x": ca.vertcat(*unknowns), "f": cost, "g": ca.vertcat(*rows)}
    solver = ca.nlpsol("calibration", "ipopt", program, quiet)
    upper = [0, 1] + [1, ca.inf, ca.inf] * _CELLS
    lower = [0, 1] + [-1, -ca.inf, -ca.inf] * _CELLS
    answer = solver(x0=[0, 1] + [0] * 3 * _CELLS, lbx=lower, ubx=upper, lbg=0, ubg=0)
    return float(answer["f"])


def _program() -> tuple[list[Any], list[Any], Any]:
    """Return unknowns, defects and cost of the discretized problem."""
    import casadi as ca

    step, state, cost = _HORIZON / _CELLS, ca.SX.sym("x0", 2), ca.SX(0)
    unknowns, rows = [state], []
    for cell in range(_CELLS):
        control, following = ca.SX.sym(f"u{cell}"), ca.SX.sym(f"x{cell + 1}", 2)
        reached = _rk4(ca.vertcat(state, cost), control, step)
        rows.append(reached[:2] - following)
        unknowns += [control, following]
        state, cost = following, reached[2]
    return unknowns, rows, cost


def _rk4(y: Any, u: Any, h: float) -> Any:
    k1 = _rate(y, u)
    k2 = _rate(y + h / 2 * k1, u)
    k3 = _rate(y + h / 2 * k2, u)
    k4 = _rate(y + h * k3, u)
    return y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def _rate(y: Any, u: Any) -> Any:
    """Return the rate of change of x₁, x₂ and the cost."""
    import casadi as ca

    return ca.vertcat(y[1], (1 - y[0] ** 2) * y[1] - y[0] + u, 0.5 * (y[0] ** 2 + y[1] ** 2))
