"""First-order and feasibility residuals, recomputed at the returned point: never believe a solver.

    stationarity     ‖∇f + (∂g)ᵀλ_g + λ_w‖∞ / s     over unknowns that are free
    feasibility      largest violation of a bound or a row
    complementarity  largest |multiplier · distance to its bound| / s
    sign             a multiplier of a bound that does not exist counts as nothing

with s = max(100, mean |λ|)/100, as in Wächter and Biegler, *Math. Program.* 106 (2006), section
2.1. All are of the scaled nonlinear program, like the tolerance they are compared with. Where
the objective's scale is far smaller than the cost calls for, stationarity and complementarity are
raised in proportion: a small scale buys no success.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from quito_cli.solvers.outcome import Outcome
from quito_cli.transcription.transcribe import FAR_TOO_SMALL, Nlp, wanted_scale

Array = NDArray[np.float64]

JUDGED_AT = 10.0
"""An answer is a success where its residuals are within this many tolerances."""
TOUCHING = 1e-6
"""Scaled distance from a bound within which a value is at it."""


@dataclass(frozen=True)
class Residuals:
    """How far a point is from satisfying the first-order conditions."""

    stationarity: float
    feasibility: float
    complementarity: float
    violations: Array
    """(n_g,) by row."""
    cost: float
    """Of the minimisation, at that point."""

    @property
    def largest(self) -> float:
        """The one number to compare with the tolerance; inf where anything is undefined."""
        worst = np.max([self.stationarity, self.feasibility, self.complementarity])
        return float(worst) if np.isfinite(worst) else float("inf")


def _violation(values: Array, lower: Array, upper: Array) -> Array:
    return np.maximum(np.maximum(lower - values, values - upper), 0.0)


def _of_bounds(multipliers: Array, lower: Array, upper: Array) -> Array:
    """Return multipliers with those of bounds that do not exist set to zero."""
    exists = np.where(multipliers > 0, np.isfinite(upper), np.isfinite(lower))
    return np.where(exists, multipliers, 0.0)


def _slackness(values: Array, lower: Array, upper: Array, multipliers: Array) -> Array:
    """Return |multiplier · distance| to the bound that the multiplier's sign speaks of."""
    distance = np.where(multipliers > 0, upper - values, values - lower)
    bounded = np.isfinite(distance) & (lower < upper)
    return np.where(bounded, np.abs(multipliers * np.where(bounded, distance, 0.0)), 0.0)


def at_its_bound(
    values: Array, lower: Array, upper: Array, multipliers: Array
) -> NDArray[np.bool_]:
    """Return where a value is at the bound that its multiplier's sign speaks of."""
    distance = np.where(multipliers > 0, upper - values, values - lower)
    return np.asarray(np.abs(distance) <= TOUCHING)


def residuals(nlp: Nlp, outcome: Outcome) -> Residuals:
    """Return the residuals of `outcome`, computed afresh from the nonlinear program."""
    assembled, w = nlp.assembled, outcome.w
    objective, slopes = assembled.gradient(w, [])
    rows, jacobian = assembled.jacobian(w, [])
    g = np.array(rows).ravel()
    lam_g = _of_bounds(outcome.lam_g, nlp.row_lower, nlp.row_upper)
    lam_w = _of_bounds(outcome.lam_w, nlp.lower, nlp.upper)
    gradient = np.array(slopes).ravel() + np.array(jacobian.T @ lam_g).ravel()
    free = nlp.lower < nlp.upper
    multipliers = np.concatenate([lam_g, lam_w])
    cost = float(objective) / nlp.objective_scale
    scale = max(100.0, float(np.mean(np.abs(multipliers)))) / 100.0
    scale *= min(1.0, nlp.objective_scale / (FAR_TOO_SMALL * wanted_scale(cost)))
    violations = _violation(g, nlp.row_lower, nlp.row_upper)
    slackness = np.concatenate(
        [
            _slackness(w, nlp.lower, nlp.upper, lam_w),
            _slackness(g, nlp.row_lower, nlp.row_upper, lam_g),
        ]
    )
    return Residuals(
        float(np.max(np.abs(gradient + lam_w)[free], initial=0.0)) / scale,
        float(np.max(np.concatenate([violations, _violation(w, nlp.lower, nlp.upper)]))),
        float(np.max(slackness, initial=0.0)) / scale,
        violations,
        cost,
    )
