"""Ranges at the ends: what holds there has a multiplier of the right sign, the rest is within.

A multiplier is ≥ 0 where what it is of is at its upper bound, ≤ 0 at its lower one; that of an end
of a range is what its transversality condition leaves: the derivative of the cost by it is ≤ 0 at
an upper end.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.polish.faults.dense import Dense, Piece
from quito_cli.optimality.polish.faults.fault import SLIGHT, Fault
from quito_cli.optimality.polish.solving.flow import inputs
from quito_cli.optimality.polish.solving.pointwise import evaluated
from quito_cli.optimality.polish.solving.rows import pointed
from quito_cli.optimality.polish.solving.rows_at_junctions import changed
from quito_cli.problem.model import Bounds, Constraint, Instant, labels

Array = NDArray[np.float64]

LEAST = 1e-3
"""Size that values have at least."""


@dataclass(frozen=True, eq=False)
class Range:
    """Values with ranges, some of which hold at an end of theirs."""

    names: tuple[str, ...]
    bounds: Bounds
    held: Array
    """Bounds that hold; NaN where none does."""
    value: Array
    slope: Array
    """Derivatives of the cost."""
    size: Array
    """Of values."""
    slope_size: float

    def wrong(self) -> Iterator[tuple[str, float]]:
        """Give entries out of range, and those held at an end that the cost pulls away from it."""
        lower, upper = self.bounds
        for i in np.flatnonzero(~self.bounds.fixed):
            name, value, held = self.names[i], self.value[i], self.held[i]
            if np.isnan(held):
                over = max(value - upper[i], lower[i] - value) / self.size[i]
                if over > SLIGHT:
                    yield f"{name} would be {value:.6g}, outside its range", float(over)
            else:
                pull = (1.0 if held == upper[i] else -1.0) * self.slope[i] / self.slope_size
                if pull > SLIGHT:
                    yield f"{name} is at an end of its range that it is not pressed to", float(pull)


@dataclass(frozen=True, eq=False)
class _Ends:
    """An extremal at its ends."""

    dense: Dense
    first: Array
    """x₀, λ₀, before what happens there; (2 n_x,)."""
    last: Array
    """y_f, (n_y,)."""
    energies: tuple[float, float]
    """H₀, H_f."""

    @property
    def integrals(self) -> Array:
        """(integrals,)."""
        n, count = self.dense.system.layout.states, self.dense.system.layout.integrals
        return np.asarray(self.last[2 * n : 2 * n + count])

    @property
    def inputs(self) -> list[Array | float]:
        """x₀, t₀, x_f, t_f, p."""
        n, times = self.dense.system.layout.states, self.dense.times
        return [self.first[:n], times[0], self.last[:n], times[-1], self.dense.shared("parameters")]

    def slopes(self) -> list[Array]:
        """Return derivatives of the cost by x₀, x_f, t₀, t_f and p."""
        layout, n = self.dense.system.layout, self.dense.system.layout.states
        by_p = self.last[2 * n + layout.integrals :]
        costates = [self.first[n:], self.last[n : 2 * n]]
        omega = self.dense.shared("boundary")
        residuals = self.dense.system.ends.conditions.residuals
        given = [*self.inputs, *costates, *self.energies, by_p, omega]
        of_x0, of_xf, of_t0, of_tf, of_p = (np.array(v).ravel() for v in residuals.call(given))
        at_t0, at_tf = _steps(self.dense)
        return [of_x0, of_xf, of_t0 + at_t0, of_tf + at_tf, of_p]


def limits(dense: Dense, _: tuple[Piece, ...]) -> Iterator[Fault]:
    """Give what is wrong at the ends."""
    first = np.concatenate([dense.shared("state"), dense.shared("costate")])
    energies = float(dense.shared("energies")[0]), _energy(dense)
    ends = _Ends(dense, first, _last(dense), energies)
    for given in (*_ranges(ends), *_constraints(ends)):
        for sentence, amount in given.wrong():
            yield Fault("end", 0.0, 0.0, amount, sentence)


def _last(dense: Dense) -> Array:
    """Return y at the final time, after what happens there, (n_y,)."""
    y = dense.at.phases[-1].nodes[-1]
    change = changed(pointed(dense.system, dense.at), len(dense.at.phases), y)
    return np.asarray(y + change.value)


def _steps(dense: Dense) -> Array:
    """Return what point constraints add to the derivatives by initial and final time, (2,)."""
    e, found = dense.shared("energies"), np.zeros(2)
    for j, (_, f) in enumerate(dense.system.instants):
        found += (e[1 + 2 * j] - e[2 + 2 * j]) * np.array([1 - f, f])
    return found


def _energy(dense: Dense) -> float:
    """Return H at the final time."""
    segments, law = dense.at.phases[-1], dense.system.laws[-1]
    v = inputs(dense.times[-1:], segments.nodes[-1][None], dense.at.shared, dense.system.layout)
    return float(evaluated(law.energy, v, segments.last[None])[0][0, 0, 0])


def _ranges(ends: _Ends) -> Iterator[Range]:
    """Give the ranges of states, times and parameters."""
    dense, held = ends.dense, ends.dense.system.ends
    m, n, slopes = dense.system.setting.system.model, dense.system.layout.states, ends.slopes()
    names, times, p = labels(m.states), dense.times, dense.shared("parameters")
    both = np.abs(np.vstack([dense.at.phases[0].nodes[0][: 2 * n], ends.last[: 2 * n]]))
    size, costates = np.maximum(both[:, :n].max(axis=0), LEAST), float(both[:, n:].max()) or 1.0
    for end, bounds, at, value, slope in (
        ("initial", m.initial, held.initial, ends.first[:n], slopes[0]),
        ("final", m.final, held.final, ends.last[:n], slopes[1]),
    ):
        given = tuple(f"{end} {name}" for name in names)
        yield Range(given, bounds, at, value, slope, size, costates)
    power = max(*np.abs(ends.energies), LEAST)
    horizon = np.array([dense.horizon])
    for end, instant, time, value, slope in (
        ("initial time", m.initial_time, held.initial_time, times[:1], slopes[2]),
        ("final time", m.final_time, held.final_time, times[-1:], slopes[3]),
    ):
        yield Range((end,), _bounds(instant), np.array([time]), value, slope, horizon, power)
    size = np.maximum(np.abs(p), LEAST)
    by_p = slopes[4]
    largest = float(np.abs(by_p).max(initial=LEAST))
    yield Range(labels(m.parameters), m.parameter_bounds, held.parameters, p, by_p, size, largest)


def _bounds(instant: Instant) -> Bounds:
    return Bounds(np.array([instant.lower]), np.array([instant.upper]))


def _constraints(ends: _Ends) -> Iterator[Range]:
    """Give the ranges of boundary and integral constraints."""
    dense, held = ends.dense, ends.dense.system.ends
    m = dense.system.setting.system.model
    boundary, integral = m.constraints.boundary, m.constraints.integral
    if boundary:
        values = np.array(m.boundary_values(*ends.inputs)[0]).ravel()
        yield _constrained(boundary, held.boundary, values, dense.shared("boundary"))
    if integral:
        yield _constrained(integral, held.integrals, ends.integrals, dense.shared("integral"))


def _constrained(
    given: tuple[Constraint, ...], held: Array, values: Array, multipliers: Array
) -> Range:
    names = tuple(label for c in given for label in c.labels)
    bounds = Bounds(*(np.concatenate(s) for s in zip(*(c.bounds for c in given), strict=True)))
    size, pull = np.maximum(np.abs(values), LEAST), float(np.abs(multipliers).max()) or 1.0
    return Range(names, bounds, held, values, -multipliers, size, pull)
