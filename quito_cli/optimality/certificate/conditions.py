"""Pontryagin's conditions along the horizon, one function each, as rows of a table.

Each takes a `Look` and gives the rows of the certificate that it stands for. Controls that H is
affine in are in `conditions_of_switching`, ends and feasibility in `conditions_at_ends`,
multipliers in `conditions_of_multipliers`.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.certificate.verdicts import PLAIN, SHARP, SOLVED, judged, not_applicable
from quito_cli.optimality.looking.dilation import dilated
from quito_cli.optimality.looking.look import Look
from quito_cli.solution.median import median
from quito_cli.solution.optimal import UNRESOLVED, Condition

Array = NDArray[np.float64]


def state_equation(look: Look) -> Iterator[Condition]:
    """x' = f(x, û, t), integrated over every panel; the defect by its length."""
    given = look.panels
    yield judged(
        "state equation",
        look.flow.state_defects / look.spells,
        look.state_rates,
        given.times[:-1],
        PLAIN,
        lambda: look.explained.local_errors[0],
        "x' = f",
    )


def costate_equation(look: Look) -> Iterator[Condition]:
    """λ' = −(H + μᵀc)_x, integrated over every panel; the defect by its length."""
    given = look.panels
    calm = _calm(look)
    yield judged(
        "costate equation",
        np.where(calm[:, None], look.flow.costate_defects / look.spells, 0.0),
        look.costate_rates,
        given.times[:-1],
        PLAIN,
        lambda: look.explained.local_errors[1] + _struck(look),
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


ROUGH = 2
"""Degree of a collocation at most, of which costates' rates are right to first order only."""


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
    # Polynomials oscillate about what is not smooth, in their own cell and the next ones.
    degree = int((look.panels.cells == 0).sum())
    struck = dilated(np.abs(total).sum(axis=1, keepdims=True), 2 * degree) > 0
    if degree <= ROUGH:
        struck[:] = True
    return dilated(np.abs(change) + np.where(struck, waves(look), 0.0), 2)


def waves(look: Look) -> Array:
    """How much the rates of costates change from one panel to the next, (P, n_x)."""
    rates = np.diff(look.panels.costates, axis=0) / look.panels.lengths[:, None]
    return np.abs(np.diff(rates, axis=0, prepend=rates[[0]]))


def interior(look: Look) -> Iterator[Condition]:
    """H_u = 0 where a regular control is between its bounds; its error over H_uu and the range."""
    return (_interior_of(look, i) for i in look.controls.of_kind("regular"))


def _interior_of(look: Look, i: int) -> Condition:
    name = f"dH/du = 0 on interior arcs of {look.names[i]}"
    inside = look.clear[:, i] & (look.labels[:, i] == 0)
    if not inside.any():
        return not_applicable(name, f"{look.names[i]} has no interior arc {UNRESOLVED}")
    curvature = np.abs(look.point.curvature[:, i, i])
    span, why = float(look.spans[i]), look.explained
    return judged(
        name,
        np.where(inside, look.gradient[:, i], 0.0),
        float(median(curvature[inside])) * span,
        look.flow.t,
        PLAIN,
        lambda: curvature * span * why.unfollowed[:, i] + accumulated(look, i) + why.uneven[:, i],
        f"dH/d{look.names[i]}",
    )


def accumulated(look: Look, i: int) -> Array:
    """What the errors of the whole horizon do to H_u, (P,)."""
    return look.explained.drift * look.switching_sizes[:, i]


def signs(look: Look) -> Iterator[Condition]:
    """H_u ≥ 0 on arcs at a lower bound, ≤ 0 at an upper one."""
    return (_sign_of(look, i) for i in range(len(look.names)))


def _sign_of(look: Look, i: int) -> Condition:
    label = look.names[i]
    name = f"sign of dH/du on arcs of {label} at its bounds"
    if look.controls.kinds[i] == "absent":
        return not_applicable(name, f"H does not depend on {label}")
    bounds = look.system.model.control_bounds
    if not np.isfinite([bounds.lower[i], bounds.upper[i]]).any():
        return not_applicable(name, f"{label} has no bounds")
    if bounds.fixed[i]:
        return not_applicable(name, f"{label} has no choice")
    at_bound = look.clear[:, i] & (look.labels[:, i] != 0)
    if not at_bound.any():
        return not_applicable(name, f"{label} has no arc at a bound {UNRESOLVED}")
    return judged(
        name,
        np.where(at_bound, look.gradient[:, i], 0.0),
        look.switching_sizes[:, i],
        look.flow.t,
        SHARP,
        lambda: accumulated(look, i),
        f"dH/d{label} has the wrong sign: it",
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
        h = h - look.moved
    # Where formulas jump, H does: it is looked at between.
    spells = np.searchsorted(look.breaks, t) if timely else np.zeros(len(t))
    off = np.zeros(len(t))
    for spell in set(spells[calm].tolist()):
        own = calm & (spells == spell)
        off[own] = h[own] - median(h[own])
    yield judged(
        name,
        off,
        look.power,
        t,
        PLAIN,
        lambda: look.explained.drift * look.power + blurred(look) + unfollowed(look),
        "H",
    )


def blurred(look: Look) -> float:
    """What H' adds up to, at most, from û' where H_u is not zero, and from impulses.

    An impulse m of a constraint c changes H by m c': nothing on an arc, but a touch at a node is
    not where the constraint is tangent.
    """
    f = look.flow
    moves = np.abs(np.diff(f.u, axis=0, prepend=f.u[[0]]))
    blur = np.where(look.clear, 0.0, np.abs(look.point.gradient) * moves).sum()
    path = np.abs(look.impulses.path.sum(axis=1))
    bounds = np.abs(f.bounds[:, look.system.model.state_bounds.present])
    struck = np.hstack([path, bounds])
    if not struck.any() or len(f.t) < 2:
        return float(blur)
    rates = np.abs(np.gradient(look.rows[0], f.t, axis=0))
    return float(blur + (struck * rates).sum())


def unfollowed(look: Look) -> Array:
    """What û is off by where its functions cannot follow it, in H; (P,)."""
    return np.asarray((look.sizes[2] * look.explained.unfollowed * look.spans).sum(axis=1))


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
