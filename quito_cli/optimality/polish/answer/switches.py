"""Where the controls of an extremal jump or have kinks: known, not looked for."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.polish.answer.exact import Exact, Sampled
from quito_cli.problem.model import Model, labels
from quito_cli.solution.junctions import Junction, ranges
from quito_cli.solution.structure import by_quantity
from quito_cli.solution.variation import largest_bounds

Array = NDArray[np.float64]

JUMPS = 1e-6
"""Part of a control's range that a jump has, at least; less is a kink."""


def junctions_of(model: Model, exact: Exact, values: Sampled) -> tuple[Junction, ...]:
    """Return the ends of arcs of every control, and other nodes at which it jumps, by time.

    Args:
        model: the problem.
        exact: the extremal.
        values: it at offsets of its segments, both ends among them.
    """
    names, u = labels(model.controls), values.controls
    size = ranges(
        u.reshape(u.shape[0] * u.shape[1], u.shape[2]), largest_bounds(*model.control_bounds)
    )
    arcs, _ = by_quantity(exact.arcs, names)
    inner = exact.nodes[1:-1]
    before, after = u[:-1, -1], u[1:, 0]
    found: list[Junction] = []
    for i, name in enumerate(names):
        doubts = np.full(len(inner), np.nan)
        for arc in arcs.get(name, [])[:-1]:
            if len(inner):
                doubts[int(np.argmin(np.abs(inner - arc.end)))] = arc.end_uncertainty
        jumps = np.abs(after[:, i] - before[:, i]) > JUMPS * size[i]
        for k in np.flatnonzero(jumps | ~np.isnan(doubts)):
            found.append(
                Junction(
                    i,
                    "jump" if jumps[k] else "kink",
                    float(inner[k]),
                    float(np.nan_to_num(doubts[k])),
                    float(before[k, i]),
                    float(after[k, i]),
                    0.0,
                )
            )
    return tuple(sorted(found, key=lambda junction: junction.time))
