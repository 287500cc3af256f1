"""Ranges at the ends: what holds there has a multiplier of the right sign, the rest is within.

A multiplier is ≥ 0 where what it is of is at its upper bound, ≤ 0 at its lower one; that of an end
of a range is what its transversality condition leaves: the derivative of the cost by it is ≤ 0 at
an upper end.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.polish.law import evaluated
from quito_cli.problem.model import labels

if TYPE_CHECKING:
    from quito_cli.optimality.polish.system import System
    from quito_cli.optimality.polish.unknowns import Unknowns

Array = NDArray[np.float64]

SLIGHT = 1e-7
"""Wrong by this much of its size is rounding."""


def limits(system: System, at: Unknowns) -> Iterator[tuple[str, float]]:
    """Give what is wrong at the ends, in a sentence, and by how much."""
    m, ends, g = system.setting.system.model, system.ends, at.shared
    part = {name: g[system.layout.place(name)] for name in system.layout.sizes}
    n = m.n_x
    first, last = at.phases[0].nodes[0], at.phases[-1].nodes[-1]
    integrals = last[2 * n : 2 * n + system.setting.system.integrals]
    inputs = [part["x0"], part["T"][0], last[:n], part["T"][-1], part["p"]]
    energies = part["e"][0], _energy(system, at)
    by_p = last[2 * n + system.setting.system.integrals :]
    slopes = [
        np.array(v).ravel()
        for v in ends.conditions.residuals.call(
            [*inputs, part["l0"], last[n : 2 * n], *energies, by_p, part["omega"]]
        )
    ]
    names = labels(m.states)
    horizon = float(np.ptp(part["T"]))
    x_size = np.maximum(np.abs(np.vstack([first[:n], last[:n]])).max(axis=0), 1e-3)
    l_size = float(np.abs([first[n : 2 * n], last[n : 2 * n]]).max()) or 1.0
    yield from _ranged(
        [f"initial {v}" for v in names],
        m.initial.lower,
        m.initial.upper,
        ends.initial,
        part["x0"],
        slopes[0],
        x_size,
        l_size,
    )
    yield from _ranged(
        [f"final {v}" for v in names],
        m.final.lower,
        m.final.upper,
        ends.final,
        last[:n],
        slopes[1],
        x_size,
        l_size,
    )
    power = max(abs(energies[0]), abs(energies[1]), 1e-3)
    for name, instant, value, k in (
        ("initial time", m.initial_time, ends.initial_time, 0),
        ("final time", m.final_time, ends.final_time, -1),
    ):
        yield from _ranged(
            [name],
            np.array([instant.lower]),
            np.array([instant.upper]),
            np.array([value]),
            part["T"][[k]],
            slopes[2 if k == 0 else 3],
            np.array([horizon]),
            power,
        )
    yield from _ranged(
        list(labels(m.parameters)),
        m.parameter_bounds.lower,
        m.parameter_bounds.upper,
        ends.parameters,
        part["p"],
        slopes[4],
        np.maximum(np.abs(part["p"]), 1e-3),
        float(np.abs(slopes[4]).max(initial=1e-3)),
    )
    boundary = m.constraints.boundary
    values = np.array(m.boundary_values(*inputs)[0]).ravel() if boundary else np.zeros(0)
    groups = [
        ("boundary", boundary, ends.boundary, values, part["omega"]),
        ("integral", m.constraints.integral, ends.integrals, integrals, part["nu"]),
    ]
    for _, given, active, found, multipliers in groups:
        if given:
            names = tuple(label for c in given for label in c.labels)
            lower, upper = (
                np.concatenate([getattr(c.bounds, s) for c in given]) for s in ("lower", "upper")
            )
            size = np.maximum(np.abs(found), 1e-3)
            yield from _ranged(
                list(names),
                lower,
                upper,
                active,
                found,
                -multipliers,
                size,
                float(np.abs(multipliers).max()) or 1.0,
            )


def _energy(system: System, at: Unknowns) -> float:
    """Return H at the final time."""
    from quito_cli.optimality.polish.flow import inputs

    k, segments = len(at.phases) - 1, at.phases[-1]
    time = at.shared[system.layout.place("T")][-1:]
    v = inputs(time, segments.nodes[-1][None], at.shared, system.layout)
    return float(evaluated(system.hamiltonians[k], v, segments.last[None])[0][0, 0])


def _ranged(
    names: list[str],
    lower: Array,
    upper: Array,
    held: Array,
    value: Array,
    slope: Array,
    size: Array,
    slope_size: float,
) -> Iterator[tuple[str, float]]:
    """Give entries out of range, and those held at a bound that the cost pulls away from it."""
    for i, name in enumerate(names):
        if lower[i] == upper[i]:
            continue
        if np.isnan(held[i]):
            over = max(value[i] - upper[i], lower[i] - value[i]) / size[i]
            if over > SLIGHT:
                yield f"{name} would be {value[i]:.6g}, outside its range", float(over)
            continue
        sign = 1.0 if held[i] == upper[i] else -1.0
        wrong = sign * slope[i] / slope_size
        if wrong > SLIGHT:
            yield f"{name} is at an end of its range that it is not pressed to", float(wrong)
