"""Which multipliers press, and what is left of H_u once bounds and constraints took their part.

At a point of time u minimises H over its bounds and the active rows c(x, u) where there are
multipliers μ of the right signs with

    (H + μᵀc)_u = 0 between the bounds of a control,  ≥ 0 at its lower one,  ≤ 0 at its upper one.

The least Σ v² of what violates this is convex in μ and is found by Newton's steps, one μ after the
other. Where H has a kink in a control, zero lies between its one-sided derivatives.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.looking.dilation import dilated, positive

if TYPE_CHECKING:
    from quito_cli.optimality.looking.look import Look

Array = NDArray[np.float64]

PRESSES = 1e-3
"""What a multiplier does to λ' or H_u, beside the size of their terms, that is not nothing."""
SWEEPS = 60
"""Each μ in turn, so many times; they are few."""
KINK = 0.005
"""Part of a control's range from which both sides of a kink are looked at."""


def pressed_gradient(look: Look) -> Array:
    """Return the violations at the middles of panels, (P, n_u), signed."""
    violation = left_of(look)
    mixed = [i for i, row in enumerate(look.system.rows) if row.mixed]
    if not mixed or not look.active[:, mixed].any():
        return violation(np.zeros(look.flow.u.shape))
    active, by_u = look.active[:, mixed], look.rows[2][:, mixed]
    equal = np.array([look.system.rows[i].lower == look.system.rows[i].upper for i in mixed])
    mu = np.zeros((active.shape[0], active.shape[1]))
    for _ in range(SWEEPS):
        for j, free in enumerate(equal):
            v = violation(np.einsum("pr,pru->pu", mu, by_u))
            slope = (v * by_u[:, j]).sum(axis=1)
            bend = np.where(v != 0, by_u[:, j] ** 2, 0.0).sum(axis=1)
            new = mu[:, j] - np.where(bend > 0, slope / np.where(bend > 0, bend, 1.0), 0.0)
            # Of the sign of the bound that the row is at, and none where it is at none.
            signed = new if free else np.maximum(new * active[:, j], 0.0) * active[:, j]
            mu[:, j] = np.where(active[:, j] != 0, signed, 0.0)
    return violation(np.einsum("pr,pru->pu", mu, by_u))


def left_of(look: Look) -> Callable[[Array], Array]:
    """Return μᵀc_u ↦ what violates the conditions of H_u then, (P, n_u) each."""
    below, above = _sided(look)
    marks = look.labels
    counts = look.clear & ~look.system.model.control_bounds.fixed

    def violation(pull: Array) -> Array:
        low, high = below + pull, above + pull
        # Between the bounds H falls on the left and rises on the right, or does neither.
        left = np.where(marks > -1, np.maximum(low, 0.0), 0.0)
        right = np.where(marks < 1, np.minimum(high, 0.0), 0.0)
        return np.where(counts, left + right, 0.0)

    return violation


def _sided(look: Look) -> tuple[Array, Array]:
    """Return H_u just below and just above u, (P, n_u) each; they differ at kinks alone."""
    gradient = look.point.gradient
    below, above = gradient.copy(), gradient.copy()
    f, nu = look.flow, look.impulses.integral
    for i in look.controls.of_kind("kinked"):
        for side, into in ((-1, below), (1, above)):
            u = f.u.copy()
            u[:, i] += side * KINK * look.spans[i]
            at = look.system.along(f.t, f.x, f.costate, u, look.solution.parameters, nu=nu)
            into[:, i] = at.gradient[:, i]
    return below, above


def pressing_rows(look: Look) -> NDArray[np.bool_]:
    """Return where multipliers are not nothing beside H_x or H_u, (P, rows), with neighbours."""
    h, path = look.panels.lengths[:, None], look.impulses.path
    density = np.abs(path.sum(axis=1)) / h
    by_x, by_u = (np.abs(slopes[:, : path.shape[2]]) for slopes in look.rows[1:3])
    # An impulse may stand for all there is of μ: then it is its jump of λ that counts.
    effect = [(density[:, :, None] * by_x / positive(look.costate_rates)).max(axis=2, initial=0)]
    sizes = positive(look.sizes[2].max(axis=0, initial=0.0))
    effect[0] = np.maximum(effect[0], (density[:, :, None] * by_u / sizes).max(axis=2, initial=0))
    bounds = np.abs(look.flow.bounds) / h / positive(look.costate_rates)
    effect.append(bounds[:, look.system.model.state_bounds.present])
    return dilated((np.hstack(effect) > PRESSES).astype(float), 1) > 0
