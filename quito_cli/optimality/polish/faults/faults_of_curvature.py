"""Conditions of second order: Legendre's, the generalised one of Clebsch, no chattering."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.polish.faults.dense import Dense, Piece
from quito_cli.optimality.polish.faults.fault import SLIGHT, Fault, finely, runs

Array = NDArray[np.float64]


def legendre(dense: Dense, pieces: tuple[Piece, ...]) -> Iterator[Fault]:
    """Give where H_uu is not positive semidefinite among free controls, as far as rows let them."""
    for k, (law, piece) in enumerate(zip(dense.system.laws, pieces, strict=True)):
        count = len(law.free)
        if not set(law.free) & set(dense.system.setting.controls.of_kind("regular")):
            continue
        matrix, normals = dense.along(law.curvature, k, piece)
        matrix = matrix.reshape(-1, count, count)
        least = _least(matrix, normals.reshape(len(matrix), -1, count))
        what = "H_uu is not positive semidefinite (Legendre-Clebsch)"
        yield from _bent(least, matrix, piece, k, what)


def clebsch(dense: Dense, pieces: tuple[Piece, ...]) -> Iterator[Fault]:
    """Give where (−1)^q A is not positive semidefinite among singular controls."""
    for k, (law, piece) in enumerate(zip(dense.system.laws, pieces, strict=True)):
        if law.clebsch is None:
            continue
        count = law.clebsch.size1_out(0)
        matrix = dense.along(law.clebsch, k, piece)[0].reshape(-1, count, count)
        least = np.linalg.eigvalsh((matrix + matrix.transpose(0, 2, 1)) / 2)[:, 0]
        what = "the generalised Legendre-Clebsch condition does not hold"
        yield from _bent(np.asarray(least), matrix, piece, k, what)


def chattering(dense: Dense, _: tuple[Piece, ...]) -> Iterator[Fault]:
    """Give singular arcs of even order that a control jumps to: there is no such junction.

    At a junction the order and the lowest derivative of u that jumps have an odd sum (J. P.
    McDanell and W. F. Powers, SIAM J. Control 9, 1971); where u itself jumps, the order is odd.
    """
    setting, phases = dense.system.setting, dense.system.structure.phases
    for k in range(1, len(phases)):
        for one, other in ((phases[k - 1], phases[k]), (phases[k], phases[k - 1])):
            arc = setting.singular(one)
            if arc is None or arc.order is None or arc.order % 2:
                continue
            for i in arc.controls:
                if other.kinds[i] in ("lower", "upper"):
                    time = float(dense.times[k])
                    says = (
                        f"{setting.name(i)} would come to a singular arc of order {arc.order} "
                        f"from a bound at {time:.6g}: it would chatter, and no such junction is "
                        "optimal"
                    )
                    yield Fault("curvature", time, time, 1.0, says, control=i)


def _least(matrix: Array, normals: Array) -> Array:
    """Return the least eigenvalue of matrices on the null spaces of normals, (n,)."""
    _, rows, count = normals.shape
    if rows >= count:
        return np.zeros(len(matrix))
    if not rows:
        return np.asarray(np.linalg.eigvalsh(matrix)[:, 0])
    basis, _ = np.linalg.qr(normals.transpose(0, 2, 1), mode="complete")
    null = basis[:, :, rows:]
    return np.asarray(np.linalg.eigvalsh(null.transpose(0, 2, 1) @ matrix @ null)[:, 0])


def _bent(least: Array, matrix: Array, piece: Piece, k: int, what: str) -> Iterator[Fault]:
    wrong = -least / max(float(np.abs(matrix).max()), 1e-300) - SLIGHT
    for run in runs(*finely(wrong, piece.t.ravel())):
        yield Fault("curvature", run.start, run.end, run.amount, f"{what} {run.when}", k)
