"""Whether an extremal that is singular from the first is isolated: focal points of its surface.

Where a control is singular from the initial time, an arc at a bound may come before it, of no
length in this extremal. If the equations, with that arc's length as an unknown more, do not
determine the length, then neighbours of the extremal solve them to first order as well: the final
time is a focal point of the singular surface, the optimum is degenerate, and an extremal found by
solving equations is one of many (D. H. Jacobson, SIAM J. Control 8, 1970; for the conditions of
second order D. J. Bell and D. H. Jacobson, Singular Optimal Control Problems, 1975, chapter 4).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from quito_cli.optimality.polish.equations.structure import Kind, Phase
from quito_cli.optimality.polish.equations.system import System
from quito_cli.optimality.polish.equations.unknowns import Segments, Unknowns
from quito_cli.optimality.polish.faults.dense import Dense
from quito_cli.optimality.polish.solving.chain import solved
from quito_cli.optimality.polish.solving.newton import Scales, linear

OPEN = 1e-7
"""Smallest singular value, over what it is without the arc, of equations that leave it open."""


def focal_point(dense: Dense, scales: Scales) -> str:
    """Say that an extremal is degenerate; empty where it is not, or is not singular at first."""
    system, first = dense.system, dense.system.structure.phases[0]
    if "singular" not in first.kinds:
        return ""
    least = _condition(dense, scales)
    bounds = system.setting.system.model.control_bounds
    for i in (i for i, kind in enumerate(first.kinds) if kind == "singular"):
        sides: dict[Kind, float] = {"lower": bounds.lower[i], "upper": bounds.upper[i]}
        for side, bound in sides.items():
            if not np.isfinite(bound):
                continue
            phase = Phase((*first.kinds[:i], side, *first.kinds[i + 1 :]), first.held)
            if _condition(_preceded(dense, phase), _longer(scales, system)) < OPEN * least:
                return (
                    f"an arc of {system.setting.name(i)} at its {side} bound may come first, and "
                    "nothing determines its length: the final time is a focal point"
                )
    return ""


def _condition(dense: Dense, scales: Scales) -> float:
    """Return the smallest singular value of what is left of the equations, over the largest."""
    values = solved(linear(dense.system, dense.at, scales)).singular_values
    return float(values[-1] / values[0])


def _preceded(dense: Dense, phase: Phase) -> Dense:
    """Return an extremal with a phase of no length before its first."""
    system, structure, first = dense.system, dense.system.structure, dense.at.phases[0]
    longer = replace(
        structure,
        phases=(phase, *structure.phases),
        times=(structure.times[0], *structure.times),
        touches=tuple((k + 1, held) for k, held in structure.touches),
        points=tuple((k + 1, point) for k, point in structure.points),
        breaks=tuple((k + 1, time) for k, time in structure.breaks),
    )
    made = System(system.setting, longer, system.ends, system.method)
    law, old = made.laws[0], system.laws[0]
    # The singular control is gone from z; the others stand as they are.
    kept = [j for j, i in enumerate(old.between) if i in law.between]
    z = first.first[[*kept, *range(len(old.between), len(first.first))]]
    count, y = len(system.method.points), first.nodes[0]
    empty = Segments(
        np.array([0.0, 1.0]),
        np.tile(y, (2, 1)),
        np.tile(y[: 2 * system.layout.states], (1, count, 1)),
        np.tile(z, (1, count, 1)),
        z,
        z,
    )
    place = system.layout.time(0)
    g = np.insert(dense.at.shared, place, dense.at.shared[place])
    return Dense(made, Unknowns((empty, *dense.at.phases), g))


def _longer(scales: Scales, system: System) -> Scales:
    """Return scales with one for the time more."""
    place = system.layout.time(0)
    return Scales(scales.nodes, np.insert(scales.shared, place, scales.shared[place]))
