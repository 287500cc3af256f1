"""The largest violation of every bound, end condition and constraint, between the nodes too."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from quito_cli.problem.model import Bounds, Constraint, Model, labels

Array = NDArray[np.float64]
ROUNDING = 1e-12
"""Part of the largest size of all that counts as one."""


@dataclass(frozen=True)
class Violation:
    """The worst point of one condition."""

    constraint: str
    """In the words of the problem file, such as "x2 >= -0.4"."""
    time: float
    amount: float
    """How much it is violated, in the unit of the quantity; 0 where it holds everywhere."""
    scale: float
    """Size of the quantity, to judge the amount by."""

    @property
    def relative(self) -> float:
        """Amount over scale."""
        return self.amount / self.scale


@dataclass(frozen=True)
class Dense:
    """An answer on a grid much finer than the cells."""

    times: Array
    """(points,) increasing, from the initial to the final time."""
    states: Array
    """(points, n_x)."""
    controls: Array
    """(points, n_u)."""
    parameters: Array
    """(n_p,)."""

    def values(self, model: Model, constraint: Constraint) -> tuple[Array, Array]:
        """Return a path constraint's value and size on the grid, (points, rows) each."""
        p = np.tile(self.parameters[:, None], (1, len(self.times)))
        at = (self.states.T, self.controls.T, p, self.times)
        functions = (model.function(constraint), model.size(constraint))
        value, size = (np.array(f.map(len(self.times))(*at)).T for f in functions)
        return value, size


def beyond_tables(model: Model, dense: Dense) -> tuple[str, ...]:
    """Say which tables are read beyond their ends, where, and how far."""
    p = np.tile(dense.parameters[:, None], (1, len(dense.times)))
    said = []
    for lookup in model.lookups:
        f = model.argument(lookup).map(len(dense.times))
        at = np.array(f(dense.states.T, dense.controls.T, p, dense.times))
        room = 1e-9 * (lookup.last - lookup.first)
        outside = np.maximum(lookup.first - at, at - lookup.last).max(axis=0)
        worst = int(np.argmax(outside))
        if outside[worst] > room:
            entry = int(np.argmax(np.maximum(lookup.first - at, at - lookup.last)[:, worst]))
            said.append(
                f"the table {lookup.table} is read at {at[entry, worst]:.6g}, beyond its ends "
                f"{lookup.first:g} and {lookup.last:g} (at t = {dense.times[worst]:.6g}): there it "
                "goes on as a straight line"
            )
    return tuple(said)


def violations(model: Model, dense: Dense, integrals: Array) -> tuple[Violation, ...]:
    """Return the worst point of every condition, worst first.

    Args:
        model: the problem.
        dense: the answer on a dense grid.
        integrals: (n_q,) of the running cost and the integral constraints.
    """
    return worst_first(_all(model, dense, integrals))


def worst_first(found: Iterable[Violation]) -> tuple[Violation, ...]:
    """Return violations ordered by their amount over their scale."""
    return tuple(sorted(found, key=lambda violation: -violation.relative))


def _all(model: Model, dense: Dense, integrals: Array) -> Iterator[Violation]:
    times, states = dense.times, dense.states
    first, last = slice(0, 1), slice(-1, None)
    names, controls = labels(model.states), labels(model.controls)
    initial = tuple(f"initial({name})" for name in names)
    final = tuple(f"final({name})" for name in names)
    yield from _bounds(names, model.state_bounds, times, states, states)
    yield from _bounds(controls, model.control_bounds, times, dense.controls, dense.controls)
    yield from _bounds(initial, model.initial, times[first], states[first], states)
    yield from _bounds(final, model.final, times[last], states[last], states)
    parameters = dense.parameters[None, :]
    yield from _bounds(
        labels(model.parameters), model.parameter_bounds, times[first], parameters, parameters
    )
    for constraint in model.constraints.path:
        yield _constraint(constraint, times, *dense.values(model, constraint))
    for constraint in model.constraints.point:
        assert constraint.at is not None
        at = int(np.argmin(np.abs(times - (times[0] + constraint.at * (times[-1] - times[0])))))
        values, sizes = dense.values(
            model, constraint
        )  # like a state's, its size is that of all times
        yield _constraint(constraint, times[[at]], values[[at]], sizes)
    least = ROUNDING * float(np.abs(states).max(initial=0.0))
    ends = (states[0], times[0], states[-1], times[-1], dense.parameters)
    stacked = [np.array(side).reshape(1, -1) for side in model.boundary_values(*ends)]
    at = 0
    for constraint in model.constraints.boundary:
        rows = slice(at, at + len(constraint.bounds.lower))
        value, size = (side[:, rows] for side in stacked)
        yield _constraint(constraint, times[last], value, np.maximum(size, least))
        at = rows.stop
    for constraint, value in zip(model.constraints.integral, integrals[1:], strict=True):
        integral = np.array([[value]])
        yield _constraint(
            constraint, times[last], integral, integral_size(model, dense, constraint)
        )


def integral_size(model: Model, dense: Dense, constraint: Constraint) -> Array:
    """Return the integral of an integrand's size, (1, 1): terms may cancel, as where ∫u dt = 0."""
    sizes = dense.values(model, constraint)[1]
    steps = np.diff(dense.times)[:, None] / 2
    return np.asarray(((sizes[1:] + sizes[:-1]) * steps).sum(axis=0, keepdims=True))


def _bounds(
    names: tuple[str, ...], bounds: Bounds, times: Array, values: Array, everywhere: Array
) -> Iterator[Violation]:
    least = ROUNDING * float(np.abs(everywhere).max(initial=0.0))  # what is always zero has no size
    for i, name in enumerate(names):
        lower, upper = float(bounds.lower[i]), float(bounds.upper[i])
        scale = max(_scale(lower, upper, everywhere[:, i]), least)
        if lower == upper:
            yield _worst(f"{name} = {lower:g}", times, np.abs(values[:, i] - lower), scale)
            continue
        if np.isfinite(lower):
            yield _worst(f"{name} >= {lower:g}", times, lower - values[:, i], scale)
        if np.isfinite(upper):
            yield _worst(f"{name} <= {upper:g}", times, values[:, i] - upper, scale)


def _constraint(constraint: Constraint, times: Array, values: Array, sizes: Array) -> Violation:
    lower, upper = constraint.bounds
    outside = np.maximum(lower - values, values - upper)
    limits = np.where(np.isfinite(lower), np.abs(lower), 0.0)
    limits = np.maximum(limits, np.where(np.isfinite(upper), np.abs(upper), 0.0))
    size = np.maximum(sizes.max(axis=0), limits)
    worst = int(np.argmax(np.nan_to_num(outside.max(axis=0) / np.where(size > 0, size, 1.0))))
    name = f"{constraint.name}: {' '.join(constraint.text.split())}"
    return _worst(name, times, outside[:, worst], float(size[worst]) or 1.0)


def _scale(lower: float, upper: float, values: Array) -> float:
    size = float(np.max(np.abs(values)))
    return max(upper - lower if np.isfinite(upper - lower) else 0.0, size) or 1.0


def _worst(name: str, times: Array, amounts: Array, scale: float) -> Violation:
    if not np.isfinite(amounts).all():
        return Violation(name, float(times[np.argmin(np.isfinite(amounts))]), np.inf, scale)
    worst = int(np.argmax(amounts))
    return Violation(name, float(times[worst]), max(float(amounts[worst]), 0.0), scale)
