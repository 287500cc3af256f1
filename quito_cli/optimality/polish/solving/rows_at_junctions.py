"""Equations at junctions: conditions, and what links the end of a phase to the next one."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.polish.solving.rows import Linear, Point, none

Array = NDArray[np.float64]


def conditions(point: Point) -> Iterator[tuple[int, Linear]]:
    """Give the node of each condition, and what is to vanish there."""
    for placed in point.system.placed:
        node = point.node(placed.phase, placed.at_start)
        yield node, point.end(placed.phase, placed.at_start).linear(placed.function)


def begin(point: Point) -> Linear:
    """Return y_0 − (x₀, λ₀, 0) − the jump of what is active from the first."""
    layout, g = point.system.layout, point.at.shared
    n = layout.states
    y = np.zeros(layout.size)
    y[:n], y[n : 2 * n] = g[layout.place("state")], g[layout.place("costate")]
    change = changed(point, 0, y)
    by_y = np.eye(layout.size) + change.by_node
    by_shared = -change.by_shared
    by_shared[:, layout.place("state")] -= by_y[:, :n]
    by_shared[:, layout.place("costate")] -= by_y[:, n : 2 * n]
    return Linear(point.at.phases[0].nodes[0] - y - change.value, np.eye(layout.size), by_shared)


def across(point: Point, k: int) -> Linear:
    """Return y⁻ + its jump − y⁺ at junction k, with derivatives in y⁻ and g."""
    before, after = point.at.phases[k - 1].nodes[-1], point.at.phases[k].nodes[0]
    change = changed(point, k, before)
    by_before = np.eye(point.system.layout.size) + change.by_node
    return Linear(before + change.value - after, by_before, change.by_shared)


def changed(point: Point, k: int, y: Array) -> Linear:
    """Return what y changes by at junction k."""
    layout, g, leap = point.system.layout, point.at.shared, point.system.leaps[k]
    found, n = none(layout.size, layout), layout.states
    if leap is None:
        return found
    pull = leap.pull(y[:n], g, layout)
    used = slice(0, n + layout.parameters)  # of H nothing is in y
    places = np.r_[n : 2 * n, layout.size - layout.parameters : layout.size]
    signs = np.r_[-np.ones(n), np.ones(layout.parameters)]
    found.value[places] = signs * pull.value[used]
    found.by_node[places, :n] = signs[:, None] * pull.by_x[used]
    found.by_shared[places, layout.time(k)] = signs * pull.by_t[used, 0]
    for entries, slopes in (
        (layout.entries("parameters"), pull.by_p),
        (np.r_[leap.place(layout)], pull.by_m),
    ):
        found.by_shared[np.ix_(places, entries)] = signs[:, None] * slopes[used]
    return found
