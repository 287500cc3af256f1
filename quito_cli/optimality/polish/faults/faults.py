"""What speaks against an extremal that solves the equations of its structure: every inequality.

    a phase has no length                                        its arcs are too many
    (H + ηᵀC)_u ≥ 0 at lower bounds, ≤ 0 at upper ones           an arc is missing
    its derivative where it is zero at an end of the horizon     the same
    lower ≤ u ≤ upper where it is free or singular               an arc at a bound is missing
    rows that are not held are within their bounds               an arc of theirs is missing
    S'' ≤ 0 at the touch of an upper bound, ≥ 0 of a lower one   it is an arc
    η ≥ 0 of rows held at upper bounds, ≤ 0 at lower ones; of a state constraint of order q
    (−1)^q dη^q/dt^q likewise, and the atoms where it begins     it does not hold there
    H_uu positive semidefinite among free controls, (−1)^q A among singular ones (Legendre, Clebsch)
    no formula jumps inside an arc                               what is solved is another problem
    multipliers of what holds at the ends have their signs, and what does not hold is within bounds

Each is looked at between the points of the segments too.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import chain
from typing import Final

from quito_cli.optimality.polish.faults.dense import Dense, Piece
from quito_cli.optimality.polish.faults.fault import OFFSETS, Fault
from quito_cli.optimality.polish.faults.faults_of_controls import beyond, signs, slopes_at_ends
from quito_cli.optimality.polish.faults.faults_of_curvature import chattering, clebsch, legendre
from quito_cli.optimality.polish.faults.faults_of_formulas import jumping
from quito_cli.optimality.polish.faults.faults_of_rows import atoms_of, bends, pulls, violated
from quito_cli.optimality.polish.faults.limits import limits
from quito_cli.optimality.polish.faults.minimum import lesser

EMPTY = 1e-9
"""Part of the horizon that is no length."""
FAMILIES: Final[tuple[Callable[[Dense, tuple[Piece, ...]], Iterator[Fault]], ...]] = (
    signs,
    slopes_at_ends,
    beyond,
    violated,
    bends,
    chattering,
    pulls,
    atoms_of,
    legendre,
    clebsch,
    limits,
    lesser,
    jumping,
)
"""What is looked at, given an extremal and its phases at `OFFSETS`."""


def faults(dense: Dense) -> list[Fault]:
    """Return what speaks against an extremal: vanished phases, or else all, the worst first."""
    gone = list(_vanished(dense))
    if gone:
        return gone
    pieces = dense.sampled(OFFSETS)
    found = chain.from_iterable(family(dense, pieces) for family in FAMILIES)
    return sorted(found, key=lambda fault: -fault.amount)


def _vanished(dense: Dense) -> Iterator[Fault]:
    for k, length in enumerate(dense.lengths):
        if length <= EMPTY * dense.horizon:
            says = f"the arc that was to begin at {dense.times[k]:.6g} has no length"
            amount = EMPTY - float(length) / dense.horizon
            yield Fault("vanished", 0.0, 0.0, amount, says, k)
