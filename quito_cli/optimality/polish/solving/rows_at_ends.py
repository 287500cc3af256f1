"""Equations at the ends of the horizon: values that hold, and transversality of the others."""

from __future__ import annotations

import numpy as np

from quito_cli.optimality.polish.solving.rows import Linear, Point
from quito_cli.optimality.polish.solving.rows_at_junctions import changed
from quito_cli.optimality.polish.solving.rows_at_points import add_steps


def final(point: Point) -> Linear:
    """Return all that vanishes at the ends, as equations of the last node and of g.

    The arguments of `Ends.function` are (x₀, λ₀), y_f, (t₀, t_f, p, ν, ω, H₀) and H_f: entries of
    g, the node after what happens there, entries of g, and H by the law of the last phase.
    """
    layout, g = point.system.layout, point.at.shared
    times = layout.place("times")
    first = np.r_[layout.entries("state"), layout.entries("costate")]
    others = np.r_[
        [times.start, times.stop - 1],
        layout.entries("parameters"),
        layout.entries("integral"),
        layout.entries("boundary"),
        layout.place("energies").start,
    ].astype(int)
    energy = point.energy(len(point.lasts) - 1, False)
    change = changed(point, len(point.lasts), point.lasts[-1].y)
    e = np.concatenate([g[first], point.lasts[-1].y + change.value, g[others], energy.value])
    value, by_e = (np.array(v) for v in point.system.ends.function(e))
    by_first, by_node, by_others, by_energy = np.split(
        by_e, np.cumsum([len(first), layout.size, len(others)]), axis=1
    )
    by_shared = by_energy @ energy.by_shared + by_node @ change.by_shared
    by_node = by_node @ (np.eye(layout.size) + change.by_node)
    by_shared[:, first] += by_first
    by_shared[:, others] += by_others
    found = Linear(value[:, 0], by_node + by_energy @ energy.by_node, by_shared)
    add_steps(point, found)
    return found
