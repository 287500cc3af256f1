"""Pontryagin's minimum condition: no other admissible control makes H less.

What another control gains is judged beside what H changes by along the controls. The answer
explains as much of it as its costates are off by, in the terms that differ, and what its controls
are off by: H_u off by g leaves ½ g²/H_uu of H, and g times the range at most.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.certificate.conditions import accumulated
from quito_cli.optimality.certificate.minimum import measured, named, slopes_say_all
from quito_cli.optimality.certificate.verdicts import SAFETY, SHARP, judged, not_applicable
from quito_cli.optimality.hamiltonian import sampled
from quito_cli.optimality.looking.dilation import positive
from quito_cli.optimality.looking.look import LOCAL, Look
from quito_cli.optimality.looking.marks import runs_of
from quito_cli.solution.optimal import MINIMUM, Condition

if TYPE_CHECKING:
    import casadi as ca

    from quito_cli.optimality.certificate.lesser import Found

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

MOMENTS = 50
"""Panels that are looked at, at most."""


def least_hamiltonian(look: Look) -> Iterator[Condition]:
    """H(x, λ, û) ≤ H(x, λ, v) for all admissible v."""
    enough = slopes_say_all(look.system, look.probe, look.point.curvature)
    if enough:
        yield not_applicable(MINIMUM, enough)
        return
    clear = np.flatnonzero(look.clear.all(axis=1))
    if not len(clear):
        yield not_applicable(MINIMUM, "there is no stretch away from the junctions")
        return
    at = clear[np.linspace(0, len(clear) - 1, min(MOMENTS, len(clear))).astype(int)]
    found = _searched(look, at)
    if not found.size.any():
        yield not_applicable(MINIMUM, "no other control was found that the constraints admit")
        return
    scale = np.maximum(found.size, LOCAL * found.size.max())
    row = judged(
        MINIMUM, found.lost, scale, look.flow.t[at], SHARP, lambda: _explained(look, at, found)
    )
    if row.verdict == "fails":
        row = replace(row, reason=_reason(look, at, found, scale, row.time))
    yield row


def _searched(look: Look, at: Indices) -> Found:
    """Return what is found at some panels."""
    from quito_cli.optimality.certificate.lesser import Search

    f, p, nu = look.flow, look.solution.parameters, look.impulses.integral
    function = measured(look.system, _summands(look))

    def evaluate(tried: int, controls: Array) -> Sequence[Array]:
        t, x, costate = (np.tile(v[at].T, tried).T for v in (f.t, f.x, f.costate))
        return sampled(function, (t, x, costate, controls, p, None, nu))

    return Search(look.system, f.u[at], evaluate).found(look.reach)


def _summands(look: Look) -> ca.SX:
    """Return L, λ_j f_j and ν_j q_j, stacked."""
    import casadi as ca

    system, m = look.system, look.system.model
    integrands = ca.vertcat(*(c.value for c in m.constraints.integral), ca.SX(0, 1))
    terms = system.costate * m.xdot, system.integral_multipliers * integrands
    return ca.vertcat(m.lagrange, *terms)


def _explained(look: Look, at: Indices, found: Found) -> Array:
    """What accuracy explains of H being less elsewhere, (moments,)."""
    why, controls = look.explained, range(len(look.names))
    changes = np.abs(found.least.summands - found.own.summands).sum(axis=1)
    blurred = why.uneven + np.array([accumulated(look, i) for i in controls]).T
    further = np.abs(found.least.controls - found.own.controls)
    bend = np.abs(np.diagonal(look.point.curvature, axis1=1, axis2=2))
    slope = bend * look.spans * why.unfollowed + blurred
    rest = np.minimum(SAFETY * slope**2 / (2 * positive(bend)), slope * look.spans)
    own = np.where(look.labels == 0, rest, 0.0)[at].sum(axis=1)
    return np.asarray(why.drift * changes + (blurred[at] * further).sum(axis=1) + own)


def _reason(look: Look, at: Indices, found: Found, scale: Array, time: float) -> str:
    """Say when another control is better, by how much, and which."""
    t = look.flow.t[at]
    allowed = np.maximum(SHARP * scale, SAFETY * _explained(look, at, found))
    k = int(np.argmin(np.abs(t - time)))
    less = ~(found.lost <= allowed)  # what is not finite too
    less[k] = True
    run = next(r for r in runs_of(less.astype(int)) if r.first <= k <= r.last)
    u, better = look.flow.u[at[k]], found.least.controls[k]
    which, own = named(look.system, better, u), named(look.system, u, better)
    first, last = look.panels.times[at[run.first]], look.panels.times[at[run.last] + 1]
    return (
        f"another control makes H less from t = {first:.6g} to {last:.6g}: at t = {t[k]:.6g} by "
        f"{found.lost[k]:.3g}, {which} instead of {own}"
    )
