"""Whether the controls of an extremal minimise H, and not only among their neighbours.

Pontryagin's principle asks for more than H_u = 0 and H_uu ≥ 0, which the shallower of two wells has
too:

    H(x, λ, u) ≤ H(x, λ, v) for all admissible v

(L. S. Pontryagin and others, The Mathematical Theory of Optimal Processes, 1962). H is looked at
along each control and at points scattered over all together. What is found to be less refutes the
extremal; that nothing is found proves nothing. On an arc of a state constraint H is that of direct
adjoining: H + η S^(q), but for what is without u.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.polish.dense import Dense, Piece
from quito_cli.optimality.polish.fault import Fault, runs

if TYPE_CHECKING:
    import casadi as ca

    from quito_cli.optimality.polish.system import System

Array = NDArray[np.float64]

ALONG = 33
"""Values of each control that are tried while the others stay."""
SCATTERED = 64
"""Points of all controls together that are tried."""
MOMENTS = 50
"""Times of a phase that are looked at, about."""
LESS = 1e-6
"""Less by this much, over the size of H, is less."""
INSIDE = 1e-9
"""By how much constraints may be violated, over 1 + |bound|."""


def lesser(dense: Dense, pieces: tuple[Piece, ...]) -> Iterator[Fault]:
    """Give where H is less for other controls than those of an extremal."""

    setting, system = dense.system.setting, dense.system.setting.system
    if not system.curvature.nnz():  # the sign of H_u says all
        return
    for k, piece in enumerate(pieces):
        t, wrong, better = _compared(dense, k, piece)
        for run in runs(wrong, t):
            values = enumerate(better[run.worst])
            named = ", ".join(f"{setting.name(i)} = {value:.6g}" for i, value in values)
            says = f"H is less {run.when}: at {t[run.worst]:.6g} for {named}"
            yield Fault("curvature", run.start, run.end, run.amount, says, phase=k)


def _compared(dense: Dense, k: int, piece: Piece) -> tuple[Array, Array, Array]:
    """Return times, H minus the least that was found over its size, the controls of that."""
    t, y, z, u = piece.flat()
    some = np.unique(np.linspace(0, len(t) - 1, MOMENTS).astype(int))
    t, y, z, u = t[some], y[some], z[some], u[some]
    function = _measured(dense.system, k)

    def measured(controls: Array) -> Array:
        return dense.along(function, k, Piece(t[None], y[None], z[None], controls[None]))[0]

    here = measured(u)[:, 0]
    least, better, size = here.copy(), u.copy(), float(np.abs(here).max())
    for tried in _candidates(dense.system, u):
        found = measured(tried)
        value = np.where(_admissible(dense.system, found[:, 1:]), found[:, 0], np.nan)
        size = max(size, float(np.nan_to_num(np.abs(value - here), posinf=0.0).max()))
        less = value < least
        least = np.where(less, value, least)
        better = np.where(less[:, None], tried, better)
    return t, (here - least) / (size or 1.0) - LESS, better


def _measured(system: System, k: int) -> ca.Function:
    """Return H of direct adjoining, but for what is without u, and the rows that speak of u."""
    import casadi as ca

    setting, value = system.setting, system.setting.system.hamiltonian
    for held in system.laws[k].held:
        known = setting.active(held)
        if known.order:
            value = value + setting.system.multipliers[held[0]] * known.held
    rows = [row.value for row in setting.system.rows if row.mixed]
    return setting.system.function("minimum", [ca.densify(ca.vertcat(value, *rows))])


def _candidates(system: System, u: Array) -> Iterator[Array]:
    """Give controls to try, (n, n_u) each; of those without a bound, near what they are."""
    bounds = system.setting.system.model.control_bounds
    reach = 1 + np.ptp(u, axis=0)
    lower = np.where(np.isfinite(bounds.lower), bounds.lower, u.min(axis=0) - reach)
    upper = np.where(np.isfinite(bounds.upper), bounds.upper, u.max(axis=0) + reach)
    for i in np.flatnonzero(upper > lower):
        for value in np.linspace(lower[i], upper[i], ALONG):
            tried = u.copy()
            tried[:, i] = value
            yield tried
    count = u.shape[1]
    if count == 1:
        return
    # Halton's points would do as well; a seed makes the same answer of the same problem.
    shares = np.random.default_rng(0).random((SCATTERED, count))
    shares[: SCATTERED // 2] = np.round(shares[: SCATTERED // 2])  # corners
    for share in shares:
        yield np.tile(lower + share * (upper - lower), (len(u), 1))


def _admissible(system: System, values: Array) -> NDArray[np.bool_]:
    """Return whether the rows that speak of controls hold, (n,)."""
    rows = [row for row in system.setting.system.rows if row.mixed]
    inside = np.ones(len(values), dtype=bool)
    for value, row in zip(values.T, rows, strict=True):
        inside &= value >= row.lower - INSIDE * (1 + abs(row.lower))
        inside &= value <= row.upper + INSIDE * (1 + abs(row.upper))
    return inside
