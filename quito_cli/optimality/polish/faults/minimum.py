"""Whether the controls of an extremal minimise H, and not only among their neighbours.

H is looked at by the search that certificates use. On an arc of a state constraint it is that of
direct adjoining: H + η S^(q), but for what is without u.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.certificate.lesser import Found, Search
from quito_cli.optimality.certificate.minimum import measured, named
from quito_cli.optimality.polish.faults.dense import Dense, Piece
from quito_cli.optimality.polish.faults.fault import Fault, runs

if TYPE_CHECKING:
    import casadi as ca

    from quito_cli.optimality.polish.equations.system import System

Array = NDArray[np.float64]

MOMENTS = 50
"""Times of a phase that are looked at, about."""
LESS = 1e-6
"""Less by this much, over the size of H, is less."""


def lesser(dense: Dense, pieces: tuple[Piece, ...]) -> Iterator[Fault]:
    """Give where H is less for other controls than those of an extremal."""
    setting, system = dense.system.setting, dense.system.setting.system
    if not (system.curvature.nnz() or setting.controls.of_kind("kinked")):
        return  # the sign of H_u says all
    for k, piece in enumerate(pieces):
        t, found = _searched(dense, k, piece)
        size = max(float(np.abs(found.own.hamiltonian).max()), float(found.size.max())) or 1.0
        for run in runs(found.lost / size - LESS, t):
            own, better = (best.controls[run.worst] for best in (found.own, found.least))
            which = named(system, better, own)
            says = f"H is less {run.when}: at {t[run.worst]:.6g} for {which}"
            yield Fault("curvature", run.start, run.end, run.amount, says, phase=k)


def _searched(dense: Dense, k: int, piece: Piece) -> tuple[Array, Found]:
    """Return times of a phase, and what is found there."""
    flat = piece.flat()
    some = np.linspace(0, len(flat[0]) - 1, min(MOMENTS, len(flat[0]))).astype(int)
    t, y, z, u = (part[some] for part in flat)
    function = _measured(dense.system, k)

    def evaluate(tried: int, controls: Array) -> Sequence[Array]:
        again = [np.tile(part.T, tried).T[None] for part in (t, y, z)]
        return dense.along(function, k, Piece(again[0], again[1], again[2], controls[None]))

    none = np.zeros(u.shape[1])
    return t, Search(dense.system.setting.system, u, evaluate).found(none)


def _measured(system: System, k: int) -> ca.Function:
    """Return H of direct adjoining, but for what is without u, and the rows that speak of u."""
    setting, value = system.setting, system.setting.system.hamiltonian
    for held in system.laws[k].held:
        known = setting.active(held)
        if known.order:
            value = value + setting.system.multipliers[held[0]] * known.held
    return measured(setting.system, value)
