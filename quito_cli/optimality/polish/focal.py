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

from quito_cli.optimality.polish.chain import solved
from quito_cli.optimality.polish.newton import Scales, linear
from quito_cli.optimality.polish.structure import Kind, Phase
from quito_cli.optimality.polish.system import System
from quito_cli.optimality.polish.unknowns import Segments, Unknowns

OPEN = 1e-7
"""Smallest singular value, over what it is without the arc, of equations that leave it open."""


def focal_point(system: System, at: Unknowns, scales: Scales) -> str:
    """Say that an extremal is degenerate; empty where it is not, or is not singular at first."""
    before = linear(system, at, scales)
    least = solved(before, system.size, system.layout.count).singular_values
    first = system.structure.phases[0]
    bounds = system.setting.system.model.control_bounds
    for i, kind in enumerate(first.kinds):
        if kind != "singular":
            continue
        sides: tuple[tuple[Kind, float], ...] = (
            ("lower", bounds.lower[i]),
            ("upper", bounds.upper[i]),
        )
        for side, bound in sides:
            if not np.isfinite(bound):
                continue
            phase = Phase((*first.kinds[:i], side, *first.kinds[i + 1 :]), first.held)
            longer, start = _preceded(system, at, phase)
            rows = linear(longer, start, _longer(scales, system, longer))
            values = solved(rows, longer.size, longer.layout.count).singular_values
            if values[-1] / values[0] < OPEN * least[-1] / least[0]:
                name = system.setting.name(i)
                return (
                    f"an arc of {name} at its {side} bound may come first, and nothing determines "
                    "its length: the final time is a focal point"
                )
    return ""


def _preceded(system: System, at: Unknowns, phase: Phase) -> tuple[System, Unknowns]:
    """Return the system with a phase of no length before the first, and where it holds."""
    structure = system.structure
    longer = replace(
        structure,
        phases=(phase, *structure.phases),
        times=(structure.times[0], *structure.times),
        touches=tuple((k + 1, held) for k, held in structure.touches),
        points=tuple((k + 1, point) for k, point in structure.points),
    )
    made = System(system.setting, longer, system.ends, system.method)
    first, two = at.phases[0], 2 * system.layout.states
    stages = np.tile(first.nodes[0][:two], (1, len(system.method.points), 1))
    law, count = made.laws[0], len(system.laws[0].between)
    # The singular control is gone from z; the others stand as they are.
    kept = [j for j, i in enumerate(system.laws[0].between) if i in law.between]
    kept += list(range(count, len(first.first)))
    z = first.first[kept]
    inner = np.tile(z, (1, len(system.method.points), 1))
    empty = Segments(np.array([0.0, 1.0]), np.tile(first.nodes[0], (2, 1)), stages, inner, z, z)
    old, new = system.layout, made.layout
    g = np.zeros(new.count)
    for name in old.sizes:
        if name != "T":
            g[new.place(name)] = at.shared[old.place(name)]
    times = at.shared[old.place("T")]
    g[new.place("T")] = np.concatenate([times[:1], times])
    return made, Unknowns((empty, *at.phases), g)


def _longer(scales: Scales, system: System, longer: System) -> Scales:
    """Return scales with one for the time more."""
    place = system.layout.place("T").start
    return Scales(scales.nodes, np.insert(scales.shared, place, scales.shared[place]))
