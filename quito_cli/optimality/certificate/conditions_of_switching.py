"""Conditions of controls that H is affine in: on singular arcs, and where they switch."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.certificate.conditions import accumulated
from quito_cli.optimality.certificate.verdicts import PLAIN, SHARP, judged, not_applicable
from quito_cli.optimality.looking.look import Look
from quito_cli.solution.optimal import UNRESOLVED, Condition

FEEDBACK = 5 * PLAIN
"""What is expected of a singular control: it is the second derivative, or a higher one, of what the
answer has settled, and is the last to come right."""


def singular_arcs(look: Look) -> Iterator[Condition]:
    """H_u = 0 where a control that H is affine in is between its bounds."""
    kinds = look.controls
    return (_singular_of(look, i) for i in (*kinds.of_kind("affine"), *kinds.of_kind("kinked")))


def _singular_of(look: Look, i: int) -> Condition:
    name = f"dH/du = 0 on singular arcs of {look.names[i]}"
    inside = look.clear[:, i] & (look.labels[:, i] == 0)
    if not inside.any():
        return not_applicable(name, f"{look.names[i]} has no singular arc {UNRESOLVED}")
    return judged(
        name,
        np.where(inside, look.gradient[:, i], 0.0),
        float(look.switching_sizes[:, i].max()),
        look.flow.t,
        SHARP,
        lambda: accumulated(look, i).max() + look.explained.uneven[:, i],
        f"dH/d{look.names[i]}",
    )


def switching(look: Look) -> Iterator[Condition]:
    """H_u = 0 where a control that H is affine in goes from bound to bound."""
    return (_switching_of(look, i) for i in look.controls.of_kind("affine"))


def _switching_of(look: Look, i: int) -> Condition:
    label, t = look.names[i], look.flow.t
    name = f"dH/du = 0 where {label} switches"
    own = [a for a in look.arcs if a.of == label]
    both = {"lower", "upper"}
    ends = [(a.end, a.end_uncertainty) for a, b in pairwise(own) if {a.kind, b.kind} == both]
    if not ends:
        return not_applicable(name, f"{label} never goes from bound to bound")
    if any(row.mixed for row in look.system.rows):
        return not_applicable(name, "a constraint with controls shares its switches")
    times, doubt = (np.array(v) for v in zip(*ends, strict=True))
    given = look.point.gradient[:, i]
    steep = np.interp(times, t, np.abs(np.gradient(given, t)))
    length = np.interp(times, t, look.panels.lengths)
    # A blurred step is where its integral says, to a fraction of its width.
    return judged(
        name,
        look.switched(i, times),
        np.interp(times, t, look.switching_sizes[:, i]),
        times,
        SHARP,
        lambda: steep * (doubt + length) / 5 + np.interp(times, t, accumulated(look, i)),
        f"dH/d{label}",
    )


def generalised_clebsch(look: Look) -> Iterator[Condition]:
    """(−1)^q ∂/∂u d^2q(H_u)/dt^2q ≥ 0 on singular arcs, and û the feedback that follows."""
    for i in look.controls.of_kind("affine"):
        yield from _feedback_of(look, i)


def _feedback_of(look: Look, i: int) -> Iterator[Condition]:
    from quito_cli.optimality.hamiltonian import sampled
    from quito_cli.optimality.singular import singular

    label, f = look.names[i], look.flow
    clebsch = f"generalised Legendre-Clebsch on singular arcs of {label}"
    feedback = f"singular arcs of {label} follow the feedback"
    inside = look.clear[:, i] & (look.labels[:, i] == 0) & _alone(look, i)
    if not inside.any():
        reason = f"{label} has no singular arc of its own"
        yield from (not_applicable(name, reason) for name in (clebsch, feedback))
        return
    arc = singular(look.system, look.probe, (i,), look.controls.of_kind("regular"))
    if arc.order is None:
        reason = f"there is no singular feedback: {arc.reason or 'odd degree'}"
        yield from (not_applicable(name, reason) for name in (clebsch, feedback))
        return
    values = (f.t, f.x, f.costate, f.u, look.solution.parameters, None, look.impulses.integral)
    _, slope, rest, _ = sampled(arc.functions, values)
    sign = 1.0 if arc.order % 2 == 0 else -1.0
    least = np.where(inside, np.minimum(sign * slope[:, 0], 0.0), 0.0)
    size = float(np.abs(slope[inside]).max())
    yield judged(clebsch, least, size, f.t, PLAIN, lambda: 0.0, "its coefficient")
    off = np.where(inside, (rest[:, 0] + slope[:, 0] * f.u[:, i]) / (size or 1.0), 0.0)
    span, why = float(look.spans[i]), look.explained
    yield judged(
        feedback,
        off,
        span,
        f.t,
        FEEDBACK,
        lambda: span * (why.unfollowed[:, i] + why.drift),
        f"{label} times its coefficient",
    )


def _alone(look: Look, i: int) -> NDArray[np.bool_]:
    """Where control i is singular and no other one is, nor a constraint active, (P,)."""
    others = [j for j in look.controls.of_kind("affine") if j != i]
    regular = list(look.controls.of_kind("regular"))
    alone = ~(look.labels[:, others] == 0).any(axis=1)
    alone &= ~(look.labels[:, regular] != 0).any(axis=1)
    return np.asarray(alone & ~(look.active != 0).any(axis=1))
