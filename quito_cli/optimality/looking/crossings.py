"""Junctions of regular controls with their bounds, where H_u at the bound changes its sign."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from quito_cli.solution.optimal import Arc

if TYPE_CHECKING:
    from quito_cli.optimality.looking.look import Look


def sharpened(look: Look, found: tuple[Arc, ...]) -> tuple[Arc, ...]:
    """Return arcs that begin and end where H_u at a bound says so.

    Where H is not affine in a control, the unbounded control meets the bound at a zero of H_u
    there: one sign change within the uncertainty of a kink is its time, to a panel.
    """
    arcs = list(found)
    for k in range(len(arcs) - 1):
        one, next_ = arcs[k], arcs[k + 1]
        kinds = {one.kind, next_.kind}
        if one.of != next_.of or "interior" not in kinds or len(kinds & {"lower", "upper"}) != 1:
            continue
        i = look.names.index(one.of)
        at = _crossing(look, i, "lower" in kinds, one.end, one.end_uncertainty)
        if at is not None and one.start < at[0] < next_.end:
            arcs[k] = replace(one, end=at[0], end_uncertainty=at[1])
            arcs[k + 1] = replace(next_, start=at[0], start_uncertainty=at[1])
    return tuple(arcs)


def _crossing(
    look: Look, i: int, lower: bool, time: float, uncertainty: float
) -> tuple[float, float] | None:
    """Return where H_u at a bound of control i crosses zero near a time, and how sure that is."""
    f, bounds = look.flow, look.system.model.control_bounds
    jumps = [j for j in look.solution.junctions if j.control == i and j.kind == "jump"]
    if any(abs(j.time - time) <= j.uncertainty for j in jumps):
        return None
    length = float(np.interp(time, f.t, look.panels.lengths))
    (here,) = np.nonzero(np.abs(f.t - time) <= uncertainty + 2 * length)
    if len(here) < 2:
        return None
    u = f.u[here]
    u[:, i] = (bounds.lower if lower else bounds.upper)[i]
    at = (f.t[here], f.x[here], f.costate[here], u, look.solution.parameters)
    slope = look.system.along(*at, nu=look.impulses.integral).gradient[:, i]
    (changes,) = np.nonzero(slope[1:] * slope[:-1] < 0)
    if len(changes) != 1:
        return None
    k = int(changes[0])
    t = f.t[here]
    share = slope[k] / (slope[k] - slope[k + 1])
    return float(t[k] + share * (t[k + 1] - t[k])), float(t[k + 1] - t[k])
