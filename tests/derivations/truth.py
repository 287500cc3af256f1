"""What a derivation returns, and the tools they share: integrate arcs, solve for the unknowns.

A derivation solves Pontryagin's conditions by shooting: the unknowns are switching times, initial
costates and the like, each arc is integrated by DOP853, and Newton's method closes the equations.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Array = NDArray[np.float64]
Flow = Callable[[float, Array], Array]
"""(t, y) ↦ ẏ; y holds the states first, whatever follows them."""
Law = Callable[[float, Array], Array]
"""(t, y) ↦ u, (n_u,)."""


@dataclass(frozen=True)
class Truth:
    """An answer found independently of quito.

    `times` ascend, and every switching time is in them twice: first with the controls before it,
    then with those after it. Between times that stand twice the samples are smooth and dense
    enough for a cubic spline.
    """

    cost: float
    """In the file's sense."""
    accuracy: float
    """Absolute, of the cost, as the checks of the derivation support it."""
    switching_times: tuple[float, ...]
    horizon: tuple[float, float]
    times: Array
    """(m,)."""
    states: Array
    """(m, n_x), in the file's order."""
    controls: Array
    """(m, n_u), in the file's order."""
    parameters: tuple[float, ...] = ()
    """The file's unknowns that are constant in time; left out where the cost is the only one."""


@dataclass(frozen=True)
class Arc:
    """A piece of a trajectory on which controls are smooth."""

    start: float
    end: float
    begin: Array
    """y at the start."""
    flow: Flow
    law: Law


def integrate(flow: Flow, start: float, end: float, begin: Array, rtol: float = 1e-12) -> Array:
    """Return y at the end of [start, end]; backwards too."""
    if start == end:
        return np.array(begin, dtype=float)
    found = solve_ivp(flow, (start, end), begin, "DOP853", rtol=rtol, atol=rtol * 1e-2)
    if not found.success:
        raise ArithmeticError(found.message)
    return np.array(found.y[:, -1])


def newton(
    residual: Callable[[Array], Array],
    guess: Sequence[float] | Array,
    limit: float = 1e-10,
    steps: int = 60,
) -> Array:
    """Return a root of `residual`, by damped Newton steps with central differences.

    It stops when steps no longer reduce the residual, which rounding and the integrator decide.

    Raises:
        ArithmeticError: the largest residual is then still above `limit`.
    """
    z = np.array(guess, dtype=float)
    r = residual(z)
    jacobian, fresh = _jacobian(residual, z), True
    for _ in range(steps):
        step = np.linalg.lstsq(jacobian, -r, rcond=None)[0]
        before = np.linalg.norm(r)
        for damping in (1.0, 0.5, 0.25, 0.1, 0.03, 0.01) if fresh else (1.0,):
            there = residual(z + damping * step)
            if np.linalg.norm(there) < before:
                z, r = z + damping * step, there
                break
        if np.linalg.norm(r) <= before / 10:
            fresh = False
        elif np.max(np.abs(r)) <= limit / 10 or (fresh and np.linalg.norm(r) == before):
            break
        else:
            jacobian, fresh = _jacobian(residual, z), True
    if not np.max(np.abs(r)) <= limit:
        raise ArithmeticError(f"the residual stays at {np.max(np.abs(r)):.1e}")
    return z


def _jacobian(residual: Callable[[Array], Array], z: Array) -> Array:
    columns = []
    for i, h in enumerate(1e-6 * np.maximum(1.0, np.abs(z))):
        move = np.where(np.arange(len(z)) == i, h, 0.0)
        columns.append((residual(z + move) - residual(z - move)) / (2 * h))
    return np.column_stack(columns)


def require(holds: bool | np.bool_, what: str) -> None:
    """Raise an ArithmeticError that says `what` should have held."""
    if not holds:
        raise ArithmeticError(f"not so: {what}")


def sample(arcs: Sequence[Arc], n_x: int, points: int = 400) -> tuple[Array, Array, Array]:
    """Return times, states and controls of consecutive arcs, each at `points` uniform times."""
    times, states, controls = [], [], []
    for arc in arcs:
        t = np.linspace(arc.start, arc.end, points)
        found = solve_ivp(
            arc.flow, (arc.start, arc.end), arc.begin, "DOP853", t, rtol=1e-12, atol=1e-14
        )
        times.append(t)
        states.append(found.y[:n_x].T)
        controls.append([arc.law(a, y) for a, y in zip(t, found.y.T, strict=True)])
    return np.concatenate(times), np.concatenate(states), np.concatenate(controls)
