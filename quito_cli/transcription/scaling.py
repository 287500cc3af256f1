"""Units for the unknowns, so that the solver sees numbers of size one; invisible in results.

What the file says of a variable's size is taken. Otherwise a state has the size of its guess; one
whose guess is zero, of what its dynamics make of it over the horizon, or of its bounds. A control
has the size of its bounds or its guess. What is left has the size that moves the others as far as
they go, |x_i| / (T |∂f_i/∂y|), or as they are moved. A constraint has the size of its sides. Sizes
between 1/10 and 10 count as one, others are rounded to a power of two, so that scaling itself
rounds nothing.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import takewhile

import numpy as np
from numpy.typing import NDArray

from quito_cli.problem.model import Bounds, Constraint, Model
from quito_cli.transcription.guess import Guess
from quito_cli.transcription.layout import Layout
from quito_cli.transcription.method import Method

Array = NDArray[np.float64]

_LEAST, _MOST = 1e-30, 1e30
_ROUNDING = 1e-12
"""A state that moves less at the guess does not move: sin(pi) is not zero in doubles."""


def unknown_scales(
    model: Model, method: Method, layout: Layout, guess: Guess
) -> tuple[Array, Array]:
    """Return the unit of every unknown (n_w,), and of every state (n_x,)."""
    said = model.hints
    bounded = _bound_sizes(model.control_bounds)
    by_name = np.concatenate(
        [
            np.where(np.isnan(said.state_scale), _state_sizes(model, guess), said.state_scale),
            np.where(
                np.isnan(said.control_scale),
                _first(bounded, np.abs(guess.controls).max(axis=0)),
                said.control_scale,
            ),
        ]
    )
    sizes = _propagated(model, guess, by_name)
    states = _chosen(said.state_scale, sizes[: model.n_x])
    controls = _chosen(said.control_scale, sizes[model.n_x :])
    bounded = _bound_sizes(model.parameter_bounds)
    parameters = _chosen(said.parameter_scale, _first(np.abs(guess.parameters), bounded))
    instants = zip((model.initial_time, model.final_time), guess.times, strict=True)
    horizon = guess.times[1] - guess.times[0]
    times = [_snapped(np.array([horizon]))[0] for instant, _ in instants if not instant.fixed]
    every = np.concatenate(
        [
            times,
            parameters,
            np.tile(states, layout.cells + 1 + layout.cells * layout.own),
            np.tile(controls, method.basis.count),
        ]
    )
    return every, states


def _chosen(said: Array, automatic: Array) -> Array:
    return np.where(np.isnan(said), _snapped(automatic), said)


def _snapped(sizes: Array) -> Array:
    """Return one for ordinary sizes, the nearest power of two for others."""
    sizes = np.where(np.isfinite(sizes) & (sizes > 0), sizes, 1.0)
    powers = 2.0 ** np.round(np.log2(np.clip(sizes, _LEAST, _MOST)))
    return np.where((sizes >= 0.1) & (sizes <= 10), 1.0, powers)


def _first(*choices: Array) -> Array:
    """Return the first choice above zero, entry by entry; zero where there is none."""
    found = np.zeros_like(choices[0])
    for choice in choices:
        found = np.where(found > 0, found, np.where(np.isfinite(choice), choice, 0.0))
    return found


def _bound_sizes(bounds: Bounds) -> Array:
    """Return the largest finite bound, zero where there is none."""
    sides = [np.where(np.isfinite(side), np.abs(side), 0.0) for side in bounds]
    return np.maximum(*sides)


def constraint_scale(model: Model, constraint: Constraint, guess: Guess) -> Array:
    """Return what the rows of a constraint are multiplied by, (rows,)."""
    arguments = _at_guess(guess)
    if constraint in model.constraints.boundary:
        ends = (guess.states[0], guess.times[0], guess.states[-1], guess.times[1])
        at = sum(len(c.bounds.lower) for c in _before(model.constraints.boundary, constraint))
        found = np.array(model.boundary_values(*ends, guess.parameters)[1]).T
        sizes = found[:, at : at + len(constraint.bounds.lower)]
    else:
        sizes = np.array(model.size(constraint).map(len(guess.fractions))(*arguments)).T
    sizes = np.where(np.isfinite(sizes), np.abs(sizes), 0.0).max(axis=0)
    if constraint in model.constraints.integral:
        sizes = np.zeros_like(sizes)  # of integrands, not of their integrals
    limits = _bound_sizes(constraint.bounds)
    return np.asarray(1 / _snapped(np.maximum(sizes, limits)))


def _before(constraints: tuple[Constraint, ...], constraint: Constraint) -> Iterator[Constraint]:
    return takewhile(lambda other: other is not constraint, constraints)


def _at_guess(guess: Guess) -> tuple[Array, Array, Array, Array]:
    start, end = guess.times
    t = start + (end - start) * guess.fractions
    p = np.tile(guess.parameters[:, None], (1, len(t)))
    return guess.states.T, guess.controls.T, p, t[None, :]


def _propagated(model: Model, guess: Guess, sizes: Array) -> Array:
    """Return sizes of [x, u] with those that are zero found from the states that they move."""
    import casadi as ca

    if np.all(sizes > 0):
        return sizes
    y = ca.vertcat(model.x, model.u)
    slopes = ca.Function(
        "slopes", [model.x, model.u, model.p, model.t], [ca.jacobian(model.xdot, y)]
    )
    start, end = guess.times
    t = start + (end - start) * guess.fractions
    strongest = np.zeros((model.n_x, y.numel()))
    for node in {0, len(t) // 2, len(t) - 1}:
        at = (guess.states[node], guess.controls[node], guess.parameters, t[node])
        strongest = np.fmax(strongest, np.abs(np.array(slopes(*at))))
    strongest = np.where(np.isfinite(strongest) & (strongest > _ROUNDING), strongest, 0.0)
    moves = (end - start) * strongest
    sizes = sizes.copy()
    for _ in range(model.n_x):
        reach = np.where(moves > 0, sizes[: model.n_x, None] / np.where(moves > 0, moves, 1), 0.0)
        needed = np.where(reach > 0, reach, np.inf).min(axis=0, initial=np.inf)
        sizes = np.where((sizes == 0) & np.isfinite(needed), needed, sizes)
        moved = (moves * sizes).max(axis=1, initial=0.0)
        sizes[: model.n_x] = np.where(sizes[: model.n_x] > 0, sizes[: model.n_x], moved)
    return sizes


def _state_sizes(model: Model, guess: Guess) -> Array:
    start, end = guess.times
    t = start + (end - start) * guess.fractions
    p = np.tile(guess.parameters[:, None], (1, len(t)))
    found = model.right_hand_side.map(len(t))(guess.states.T, guess.controls.T, p, t)
    rates = np.array(found[0]).T
    travelled = (end - start) * np.abs(np.where(np.isfinite(rates), rates, 0.0)).max(axis=0)
    bounded = _bound_sizes(model.state_bounds)
    travelled = np.where(bounded > 0, np.minimum(travelled, bounded), travelled)
    travelled = np.where(travelled > _ROUNDING, travelled, 0.0)
    return _first(np.abs(guess.states).max(axis=0), travelled, bounded)
