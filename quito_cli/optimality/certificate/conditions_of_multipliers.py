"""Multipliers of constraints: they press against what is active, and are zero elsewhere."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.certificate.conditions import waves
from quito_cli.optimality.certificate.verdicts import PLAIN, judged, not_applicable
from quito_cli.optimality.looking.look import Look
from quito_cli.problem.model import Bounds, Constraint, labels
from quito_cli.solution.optimal import Condition
from quito_cli.solution.violations import Dense, integral_size

Array = NDArray[np.float64]


def path_multipliers(look: Look) -> Iterator[Condition]:
    """Multipliers press against active bounds, and are zero elsewhere."""
    at = 0
    for constraint in look.system.model.constraints.path:
        own = slice(at, at + len(constraint.labels))
        at = own.stop
        name = f"multipliers of {constraint.name}: sign and complementarity"
        values = look.solution.multipliers.get(f"path constraint {constraint.name}")
        if values is None or constraint.bounds.fixed.all():
            yield not_applicable(name, "an equality holds everywhere")
            continue
        times = look.solution.multiplier_axes[f"path constraint {constraint.name}"].times
        if not look.seen.pressed[:, own].any():
            yield not_applicable(name, "it is never active")
            continue
        x, u = look.solution.state(times), look.solution.control(times)
        rows = look.carrier.rows_at(times, x, u, look.solution.parameters)[0][:, own]
        off = wrong(values, rows, constraint.bounds)
        density = np.abs(values).max(axis=0)
        density = np.where(look.seen.pressed[:, own].any(axis=0), density, np.inf)
        yield judged(name, off, density, times, PLAIN, lambda: 0.0, "the multiplier")
    yield from _state_bounds(look)


def wrong(multipliers: Array, values: Array, bounds: Bounds, size: Array | None = None) -> Array:
    """Return what of multipliers has the wrong sign, or is away from its bound by its size."""
    lower, upper = bounds
    if size is None:
        size = np.maximum(np.ptp(values, axis=0), 1e-3 * np.abs(values).max(axis=0))
    size = np.where(size > 0, size, 1.0)
    with np.errstate(invalid="ignore"):
        distance = np.where(multipliers > 0, upper - values, values - lower)
    away = np.where(np.isfinite(distance), np.minimum(np.abs(distance) / size, 1.0), 1.0)
    return np.asarray(np.where(lower == upper, 0.0, np.abs(multipliers) * away))


def _state_bounds(look: Look) -> Iterator[Condition]:
    """What bounds of states do to costates pushes them the way that a bound can."""
    lower, upper = look.system.model.state_bounds
    if not look.system.model.state_bounds.present.any():
        return
    name = "multipliers of bounds on states: sign"
    found = look.flow.bounds
    if not any(a.kind == "active" and a.of in labels(look.system.model.states) for a in look.arcs):
        yield not_applicable(name, "no state is at a bound")
        return
    x = look.panels.states[:-1]
    at_lower = x - lower <= upper - x
    off = np.where(at_lower, np.maximum(found, 0.0), np.minimum(found, 0.0))
    size = np.maximum(np.abs(found).max(axis=0), 1e-3 * np.abs(look.panels.costates).max(axis=0))
    h = look.panels.lengths[:, None]
    yield judged(
        name, off, size, look.panels.times[:-1], PLAIN,
        lambda: look.explained.local_errors[1] * h + _noise(look), "the multiplier",
    )  # fmt: skip


def _noise(look: Look) -> Array:
    """Collocated costates oscillate about their jumps."""
    given = look.panels
    if not given.collocated:
        return np.zeros((1, 1))
    return np.asarray(waves(look) * given.lengths[:, None])


def other_multipliers(look: Look) -> Iterator[Condition]:
    """Of boundary, integral and point constraints: sign, and zero away from their bounds."""
    return (_multiplier_of(look, *one) for one in _values(look))


def _multiplier_of(
    look: Look, kind: str, constraint: Constraint, value: Array, size: Array
) -> Condition:
    name = f"multipliers of {constraint.name}: sign and complementarity"
    lower, upper = constraint.bounds
    if constraint.bounds.fixed.all():
        return not_applicable(name, "an equality may have any")
    values = look.solution.multipliers[f"{kind} constraint {constraint.name}"].reshape(1, -1)
    # What is beyond a bound is a matter of feasibility.
    off = wrong(values, np.clip(value, lower, upper), constraint.bounds, size)
    largest = max(float(np.abs(values).max()), 1e-6)
    t = look.panels.times
    time = t[[-1]] if constraint.at is None else t[[0]] + constraint.at * (t[-1] - t[0])
    return judged(
        name, off, largest, time, PLAIN, lambda: look.explained.drift * largest, "the multiplier"
    )


def _values(look: Look) -> Iterator[tuple[str, Constraint, Array, Array]]:
    """Give each boundary, integral and point constraint with its kind, value and size, (rows,)."""
    m, given, f, p = look.system.model, look.panels, look.flow, look.solution.parameters
    x, t = given.states, given.times
    stacked = [np.array(v).ravel() for v in m.boundary_values(x[0], t[0], x[-1], t[-1], p)]
    at = 0
    for constraint in m.constraints.boundary:
        own = slice(at, at + len(constraint.bounds.lower))
        at = own.stop
        sizes = np.maximum(stacked[1][own], _limits(constraint))
        yield "boundary", constraint, stacked[0][own], sizes
    along = Dense(f.t, f.x, f.u, p)
    for constraint, value in zip(m.constraints.integral, f.integrals[1:], strict=True):
        sizes = np.maximum(integral_size(m, along, constraint)[0], _limits(constraint))
        yield "integral", constraint, np.array([value]), sizes
    for constraint in m.constraints.point:
        assert constraint.at is not None
        k = int(np.argmin(np.abs(t - (t[0] + constraint.at * (t[-1] - t[0])))))
        j = min(k, len(f.t) - 1)  # the panel that begins there, or the last one
        u = given.controls(look.solution, np.array([0.0, 1.0]))[j, k - j]
        found = Dense(t[[k]], x[[k]], u[None, :], p).values(m, constraint)
        yield "point", constraint, found[0][0], np.maximum(found[1][0], _limits(constraint))


def _limits(constraint: Constraint) -> Array:
    """Return the larger of a constraint's bounds in size, (rows,); 0 where there are none."""
    sizes = [np.where(np.isfinite(bound), np.abs(bound), 0.0) for bound in constraint.bounds]
    return np.asarray(np.maximum(*sizes))
