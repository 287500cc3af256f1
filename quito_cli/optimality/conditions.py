"""Pontryagin's conditions along the horizon, one function each, as rows of a table.

Each takes a `Look` and gives the rows of the certificate that it stands for. The ends are in
`conditions_at_ends`, multipliers in `conditions_of_multipliers`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.look import Look, bounded_states, dilated
from quito_cli.optimality.verdicts import PLAIN, SHARP, SOLVED, judged, not_applicable
from quito_cli.solution.optimal import Condition

Array = NDArray[np.float64]
Test = Callable[[Look], Iterator[Condition]]


def state_equation(look: Look) -> Iterator[Condition]:
    """x' = f(x, û, t), integrated over every panel; the defect by its length."""
    h, given = look.panels.lengths[:, None], look.panels
    yield judged(
        "state equation",
        look.flow.state_defects / h,
        look.state_rates,
        given.times[:-1],
        PLAIN,
        lambda: look.local_errors[0],
        "x' = f",
    )


def costate_equation(look: Look) -> Iterator[Condition]:
    """λ' = −(H + μᵀc)_x, integrated over every panel; the defect by its length."""
    h, given = look.panels.lengths[:, None], look.panels
    calm = _calm(look)
    yield judged(
        "costate equation",
        np.where(calm[:, None], look.flow.costate_defects / h, 0.0),
        look.costate_rates,
        given.times[:-1],
        PLAIN,
        lambda: look.local_errors[1] + _struck(look),
        "the costate's derivative",
    )


def _calm(look: Look) -> NDArray[np.bool_]:
    """Panels in which costates are known to be smooth: of a collocation not where they jump."""
    calm = np.ones(len(look.flow.t), dtype=bool)
    if look.panels.collocated:
        for arc in look.arcs:
            if arc.kind in ("active", "inactive") and arc.end < look.solution.times[-1]:
                calm &= ~look.near(arc.end, arc.end_uncertainty)
    return calm


INSIDE = 0.05
"""Part of an impulse that a scheme's interpolation inside a cell may lead elsewhere."""


def _struck(look: Look) -> Array:
    """How far costates are known where multipliers act, a unit of time; (P, n_x).

    Inside a cell an impulse acts on an interpolated state. In a collocation μ is known at points,
    and may differ as much from one to the next.
    """
    path, h = look.impulses.path, look.panels.lengths[:, None]
    by_x = look.rows[1][:, : path.shape[2]]
    if not look.panels.collocated:
        inside = np.einsum("pr,prx->px", np.abs(path[:, 1:]).sum(axis=1), np.abs(by_x))
        size = np.abs(look.panels.costates).max(axis=0)
        size = np.where(size > 0, size, 1.0)
        share = (inside / size).max(axis=1, initial=0.0)[:, None]
        return np.asarray(INSIDE * share * size / h)
    total = np.einsum("pr,prx->px", path.sum(axis=1), by_x) + look.flow.bounds
    change = np.diff(total / h, axis=0, prepend=total[[0]] / h[0])
    # Polynomials oscillate about what is not smooth.
    waves = np.diff(look.panels.costates, 2, axis=0, prepend=look.panels.costates[[0]]) / h
    return dilated(np.abs(change) + np.abs(waves), 2)


def interior(look: Look) -> Iterator[Condition]:
    """H_u = 0 where a regular control is between its bounds; its error over H_uu and the range."""
    for i in look.controls.of_kind("regular"):
        name = f"dH/du = 0 on interior arcs of {look.names[i]}"
        inside = look.clear[:, i] & (look.labels[:, i] == 0)
        if not inside.any():
            yield not_applicable(name, f"{look.names[i]} has no interior arc")
            continue
        bends = look.point.curvature[:, i, i]
        scale = float(np.median(np.abs(bends[inside]))) * look.spans[i]
        residual = np.where(inside, look.gradient[:, i], 0.0)
        yield judged(
            name,
            residual,
            scale,
            look.flow.t,
            PLAIN,
            lambda i=i, bends=bends: np.abs(bends) * look.spans[i] * look.unfollowed[:, i]
            + _accumulated(look, i)
            + look.uneven[:, i],
            f"dH/d{look.names[i]}",
        )


def _accumulated(look: Look, i: int) -> float:
    """What the errors of the whole horizon do to H_u."""
    return look.drift * float(look.switching_sizes[i])


def singular_arcs(look: Look) -> Iterator[Condition]:
    """H_u = 0 where a control that H is affine in is between its bounds."""
    for i in (*look.controls.of_kind("affine"), *look.controls.of_kind("kinked")):
        name = f"dH/du = 0 on singular arcs of {look.names[i]}"
        inside = look.clear[:, i] & (look.labels[:, i] == 0)
        if not inside.any():
            yield not_applicable(name, f"{look.names[i]} has no singular arc")
            continue
        yield judged(
            name,
            np.where(inside, look.gradient[:, i], 0.0),
            float(look.switching_sizes[i]),
            look.flow.t,
            SHARP,
            lambda i=i: _accumulated(look, i) + look.uneven[:, i],
            f"dH/d{look.names[i]}",
        )


def signs(look: Look) -> Iterator[Condition]:
    """H_u ≥ 0 on arcs at a lower bound, ≤ 0 at an upper one."""
    for i, label in enumerate(look.names):
        name = f"sign of dH/du on arcs of {label} at its bounds"
        at_bound = look.clear[:, i] & (look.labels[:, i] != 0)
        if look.controls.kinds[i] == "absent":
            yield not_applicable(name, f"H does not depend on {label}")
            continue
        if not at_bound.any():
            yield not_applicable(name, f"{label} has no arc at a bound")
            continue
        yield judged(
            name,
            np.where(at_bound, look.gradient[:, i], 0.0),
            float(look.switching_sizes[i]),
            look.flow.t,
            SHARP,
            lambda i=i: _accumulated(look, i),
            f"dH/d{label} has the wrong sign: it",
        )


def switching(look: Look) -> Iterator[Condition]:
    """H_u changes sign where a control that H is affine in switches: its value over its slope."""
    for i in look.controls.of_kind("affine"):
        label = look.names[i]
        name = f"dH/du = 0 where {label} switches"
        own = [a for a in look.arcs if a.of == label]
        ends = [(a.end, a.end_uncertainty) for a, b in zip(own, own[1:], strict=False)
                if {a.kind, b.kind} == {"lower", "upper"}]  # fmt: skip
        if not ends or any(row.mixed for row in look.system.rows):
            why = "a constraint with controls shares the switches" if ends else "it never switches"
            yield not_applicable(name, why)
            continue
        times, doubt = (np.array(v) for v in zip(*ends, strict=True))
        slope = np.gradient(look.point.gradient[:, i], look.flow.t)
        value = np.interp(times, look.flow.t, look.point.gradient[:, i])
        steep = np.interp(times, look.flow.t, np.abs(slope))
        length = np.interp(times, look.flow.t, look.panels.lengths)
        yield judged(
            name,
            value,
            float(look.switching_sizes[i]),
            times,
            SHARP,
            lambda i=i, s=steep, d=doubt, h=length: s * (d + h) / 5 + _accumulated(look, i),
            f"dH/d{label}",
        )


def hamiltonian(look: Look) -> Iterator[Condition]:
    """H' = H_t along the horizon, so that H is constant where nothing depends on time."""
    import casadi as ca

    m = look.system.model
    rows = ca.vertcat(*(row.value for row in look.system.rows))
    timely = ca.depends_on(ca.vertcat(look.system.hamiltonian, rows), m.t)
    name = "dH/dt = partial H / partial t" if timely else "H is constant"
    calm = look.clear.all(axis=1)
    if m.constraints.point:
        yield not_applicable(name, "H may jump at the times of point constraints")
        return
    if not calm.any():
        yield not_applicable(name, "there is no stretch away from the junctions")
        return
    h, t = look.point.hamiltonian, look.flow.t
    if timely:
        rate = look.point.rate + _row_rates(look)
        steps = np.diff(t) * (rate[1:] + rate[:-1]) / 2
        h = h - np.append(0.0, np.cumsum(steps))
    off = np.where(calm, h - np.median(h[calm]), 0.0)
    yield judged(
        name,
        off,
        float(look.sizes[0].max()),
        t,
        PLAIN,
        lambda: look.drift * float(look.sizes[0].max()) + blurred(look) + unfollowed(look),
        "H",
    )


def _row_rates(look: Look) -> Array:
    """μᵀ c_t at the middles, from impulses over lengths of panels."""
    import casadi as ca

    path = look.impulses.path.sum(axis=1)
    if not path.any():
        return np.zeros(len(look.flow.t))
    m = look.system.model
    stacked = ca.vertcat(*(row.value for row in look.system.rows if not row.state))
    slope = ca.Function("rates", [m.x, m.u, m.p, m.t], [ca.densify(ca.jacobian(stacked, m.t))])
    f, p = look.flow, look.solution.parameters
    n = len(f.t)
    by_t = np.array(slope.map(n)(f.x.T, f.u.T, np.tile(p[:, None], (1, n)), f.t)).reshape(-1, n)
    return np.asarray((path / look.panels.lengths[:, None] * by_t.T).sum(axis=1))


def blurred(look: Look) -> float:
    """What H' adds up to, at most, from û' where H_u is not zero, and from impulses.

    An impulse m of a constraint c changes H by m c': nothing on an arc, but a touch at a node is not
    where the constraint is tangent.
    """
    f = look.flow
    moves = np.abs(np.diff(f.u, axis=0, prepend=f.u[[0]]))
    blur = np.where(look.clear, 0.0, np.abs(look.point.gradient) * moves).sum()
    path = np.abs(look.impulses.path.sum(axis=1))
    bounds = np.abs(f.bounds[:, bounded_states(look.system)])
    struck = np.hstack([path, bounds])
    if not struck.any() or len(f.t) < 2:
        return float(blur)
    rates = np.abs(np.gradient(look.rows[0], f.t, axis=0))
    return float(blur + (struck * rates).sum())


def unfollowed(look: Look) -> Array:
    """What û is off by where its functions cannot follow it, in H; (P,)."""
    return np.asarray((look.sizes[2] * look.unfollowed * look.spans).sum(axis=1))


def legendre_clebsch(look: Look) -> Iterator[Condition]:
    """H_uu positive semidefinite among regular controls between their bounds."""
    name = "Legendre-Clebsch: H_uu >= 0"
    regular = look.controls.of_kind("regular")
    if not regular:
        yield not_applicable(name, "no control is regular")
        return
    curvature = look.point.curvature[:, list(regular)][:, :, list(regular)]
    free = (look.labels == 0)[:, list(regular)]
    held = curvature * (free[:, :, None] & free[:, None, :])
    least = np.linalg.eigvalsh(np.nan_to_num(held))[:, 0]
    size = float(np.abs(np.nan_to_num(curvature)).max())
    yield judged(
        name, np.minimum(least, 0.0), size, look.flow.t, SOLVED, lambda: 0.0, "the least eigenvalue"
    )


def generalised_clebsch(look: Look) -> Iterator[Condition]:
    """(−1)^q ∂/∂u d^2q(H_u)/dt^2q ≥ 0 on singular arcs, and û the feedback that follows."""
    from quito_cli.optimality.hamiltonian import sampled
    from quito_cli.optimality.singular import singular

    for i in look.controls.of_kind("affine"):
        label = look.names[i]
        names = [
            f"generalised Legendre-Clebsch on singular arcs of {label}",
            f"singular arcs of {label} follow the feedback",
        ]
        inside = look.clear[:, i] & (look.labels[:, i] == 0) & _alone(look, i)
        others = [j for j in look.controls.of_kind("regular")]
        reason = "" if inside.any() else f"{label} has no singular arc of its own"
        arc = singular(look.system, look.probe, (i,), tuple(others)) if inside.any() else None
        if arc is not None and (arc.clebsch is None or arc.order is None):
            reason = f"there is no singular feedback: {arc.reason or 'odd degree'}"
        if reason or arc is None:
            yield from (not_applicable(name, reason) for name in names)
            continue
        f = look.flow
        values = (f.t, f.x, f.costate, f.u, look.solution.parameters, None, look.impulses.integral)
        _, slope, rest, _ = sampled(arc.functions, values)
        sign = 1.0 if arc.order % 2 == 0 else -1.0
        least = np.where(inside, np.minimum(sign * slope[:, 0], 0.0), 0.0)
        size = float(np.abs(slope[inside]).max())
        yield judged(names[0], least, size, f.t, PLAIN, lambda: 0.0, "its coefficient")
        off = (rest[:, 0] + slope[:, 0] * f.u[:, i]) / size
        yield judged(
            names[1],
            np.where(inside, off, 0.0),
            look.spans[i],
            f.t,
            5 * PLAIN,
            lambda i=i: look.spans[i] * (look.unfollowed[:, i] + look.drift),
            f"{label} times its coefficient",
        )


def _alone(look: Look, i: int) -> NDArray[np.bool_]:
    """Where control i is singular and no other one is, nor a constraint active, (P,)."""
    others = [j for j in look.controls.of_kind("affine") if j != i]
    regular = list(look.controls.of_kind("regular"))
    alone = ~(look.labels[:, others] == 0).any(axis=1)
    alone &= ~(look.labels[:, regular] != 0).any(axis=1)
    return np.asarray(alone & ~(look.active != 0).any(axis=1))


ALONG: tuple[Test, ...] = (
    state_equation,
    costate_equation,
    interior,
    singular_arcs,
    signs,
    switching,
    hamiltonian,
    legendre_clebsch,
    generalised_clebsch,
)
"""In the order of the certificate."""
