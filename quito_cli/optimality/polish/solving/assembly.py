"""All equations of a structure about a point, linearised: a chain (see `chain`).

Its nodes are those of the segments of all phases in order. Within a phase a segment links its
nodes; between phases the jump of the costate does. Conditions at junctions, at point constraints
and at the ends are rows of single nodes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import chain as chained

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.polish.equations.system import System
from quito_cli.optimality.polish.equations.unknowns import Unknowns
from quito_cli.optimality.polish.solving.chain import Chain, Links, Rows
from quito_cli.optimality.polish.solving.flow import Linearised, linearised
from quito_cli.optimality.polish.solving.rows import Linear, Point, none, pointed
from quito_cli.optimality.polish.solving.rows_at_ends import final
from quito_cli.optimality.polish.solving.rows_at_junctions import across, begin, conditions
from quito_cli.optimality.polish.solving.rows_at_points import constraints, energies

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Assembled:
    """The equations about a point."""

    unknowns: Unknowns
    """The point, with z settled."""
    flows: tuple[Linearised, ...]
    """By phase."""
    chain: Chain


def assembled(system: System, at: Unknowns) -> Assembled:
    """Linearise all equations; what has no value is NaN."""
    flows = tuple(
        linearised(law, segments, at.shared, system.layout, k, system.method)
        for k, (law, segments) in enumerate(zip(system.laws, at.phases, strict=True))
    )
    point = pointed(system, at)
    phases = tuple(
        replace(segments, inner=flow.inner, first=start.z, last=last.z)
        for segments, flow, start, last in zip(
            at.phases, flows, point.starts, point.lasts, strict=True
        )
    )
    chain = Chain(_own(point), _links(point, flows))
    return Assembled(replace(at, phases=phases), flows, chain)


def _own(point: Point) -> list[Rows]:
    """Return the rows of every node."""
    nodes = int(point.at.firsts[-1])
    found: list[list[Linear]] = [[] for _ in range(nodes)]
    ends = [(0, begin(point)), (nodes - 1, final(point))]
    for node, rows in chained(ends, conditions(point), energies(point), constraints(point)):
        found[node].append(rows)
    nothing = none(0, point.system.layout)
    return [_stacked(own) if own else nothing.rows for own in found]


def _stacked(parts: list[Linear]) -> Rows:
    return Linear(
        np.concatenate([part.value for part in parts]),
        np.concatenate([part.by_node for part in parts]),
        np.concatenate([part.by_shared for part in parts]),
    ).rows


def _links(point: Point, flows: tuple[Linearised, ...]) -> Links:
    """Return what links every node to the next."""
    matrix, shared, right = [], [], []
    for k, (flow, segments) in enumerate(zip(flows, point.at.phases, strict=True)):
        if k:
            jump = across(point, k)
            matrix.append(jump.by_node[None])
            shared.append(jump.by_shared[None])
            right.append(jump.value[None])
        matrix.append(flow.by_start)
        shared.append(flow.by_shared)
        right.append(flow.ends - segments.nodes[1:])
    return Links(np.concatenate(matrix), np.concatenate(shared), np.concatenate(right))
