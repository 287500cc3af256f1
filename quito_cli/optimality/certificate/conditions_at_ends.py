"""Pontryagin's conditions at the ends of the horizon; feasibility."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.certificate.conditions import blurred, unfollowed
from quito_cli.optimality.certificate.verdicts import PLAIN, judged, not_applicable
from quito_cli.optimality.hamiltonian import sampled
from quito_cli.optimality.looking.look import Look
from quito_cli.optimality.transversality import Freedom, point_jumps, transversality
from quito_cli.problem.model import Bounds, labels
from quito_cli.solution.optimal import Condition
from quito_cli.solution.violations import Dense, violations

Array = NDArray[np.float64]
AT_END = 1e-4
"""Part of its size within which an end value is at its bound."""


def transversal(look: Look) -> Iterator[Condition]:
    """λ, H and parameters at the ends, where they are not fixed."""
    m, p = look.system.model, look.solution.parameters
    ends = transversality(look.system)
    given, f = look.panels, look.flow
    start = given.costates[0] + _at_points(look, 0)
    last = _last_costate(look) - _at_points(look, len(given.times) - 1)
    x, t = given.states, given.times
    h = look.point.hamiltonian
    found = ends.residuals(
        x[0],
        t[0],
        x[-1],
        t[-1],
        p,
        start,
        last,
        h[0],
        h[-1],
        f.by_parameters,
        look.impulses.boundary,
    )
    of_x0, of_xf, of_t0, of_tf, of_p = (np.array(v).ravel() for v in found)
    for share, step in _steps_of_h(look):
        of_t0, of_tf = of_t0 + (1 - share) * step, of_tf + share * step
    of_p = of_p + _parameters_at_points(look)
    size = np.maximum(np.abs(given.costates).max(axis=0), look.least_costates)
    size = np.where(size > 1e-6 * size.max(), size, size.max())
    names = labels(m.states)
    yield from _end("initial", ends.initial, of_x0, x[0], m.initial, size, names, look, 0)
    yield from _end("final", ends.final, of_xf, x[-1], m.final, size, names, look, -1)
    whole = np.array([look.power])
    for name, freedom, value, instant, k in (
        ("initial time", ends.initial_time, of_t0, m.initial_time, 0),
        ("final time", ends.final_time, of_tf, m.final_time, -1),
    ):
        bounds = Bounds(np.array([instant.lower]), np.array([instant.upper]))
        yield from _end(name, (freedom,), value, t[[k]], bounds, whole, (name,), look, k)
    if m.n_p:
        size_p = np.maximum(np.abs(of_p - f.by_parameters), np.abs(f.by_parameters))
        size_p = np.maximum(size_p, _parameter_sizes(look))
        terms = ends.parameter_terms(x[0], t[0], x[-1], t[-1], p, look.impulses.boundary)
        size_p = np.maximum(size_p, np.array(terms).ravel())
        freedoms = ends.parameters
        yield from _end("parameter", freedoms, of_p, p, m.parameter_bounds, size_p,
                        labels(m.parameters), look, 0)  # fmt: skip


def _steps_of_h(look: Look) -> Iterator[tuple[float, float]]:
    """Give where in the horizon each point constraint is, and H⁻ + ρᵀ c_t − H⁺ there.

    Its time moves with those of the ends, so that M_t_f + H(t_f) + Σ share · step = 0 and
    M_t₀ − H(t₀) + Σ (1 − share) · step = 0.
    """
    import casadi as ca

    m, h, f = look.system.model, look.point.hamiltonian, look.flow
    seen = {0, len(h)}  # at the ends H has one side, at each other time it jumps once
    for (k, rho), point in zip(look.impulses.points, m.constraints.point, strict=True):
        inputs = [m.x, m.u, m.p, m.t]
        by_t = ca.Function("by_t", inputs, [ca.densify(ca.jacobian(point.value, m.t))])
        u = f.u[min(k, len(h) - 1)]
        at = (look.panels.states[k], u, look.solution.parameters, look.panels.times[k])
        slope = float(np.array(by_t(*at)).ravel() @ rho)
        step = 0.0 if k in seen else float(h[k - 1] - h[k])
        seen.add(k)
        yield point.at or 0.0, step + slope


def _parameters_at_points(look: Look) -> Array:
    """Return Σ ρᵀ c_p of point constraints, (n_p,)."""
    import casadi as ca

    m, p, f = look.system.model, look.solution.parameters, look.flow
    found = np.zeros(m.n_p)
    for (k, rho), point in zip(look.impulses.points, m.constraints.point, strict=True):
        inputs = [m.x, m.u, m.p, m.t]
        by_p = ca.Function("by_p", inputs, [ca.densify(ca.jacobian(point.value, m.p))])
        at = (look.panels.states[k], f.u[min(k, len(f.u) - 1)], p, look.panels.times[k])
        found += rho @ np.array(by_p(*at)).reshape(len(rho), m.n_p)
    return found


def _at_points(look: Look, k: int) -> Array:
    """Return what point constraints at an end take from the costate there, (n_x,): ρᵀ c_x."""
    given, p = look.panels, look.solution.parameters
    u = given.controls(look.solution, np.array([0.0, 1.0]))[[min(k, len(given.cells) - 1)]]
    found = np.zeros(given.states.shape[1])
    for (at, rho), f in zip(look.impulses.points, point_jumps(look.system), strict=True):
        if at == k:
            x, costate = given.states[[k]], given.costates[[k]]
            values = (given.times[[k]], x, costate, u[:, int(k > 0)], p, None, None)
            found += sampled(f, values)[1].reshape(len(found), -1) @ rho
    return found


def _last_costate(look: Look) -> Array:
    """λ(t_f) after the impulses of path constraints there."""
    given, last = look.panels, look.panels.costates[-1].copy()
    x, t = given.states[[-1]], given.times[[-1]]
    u = given.controls(look.solution, np.array([1.0]))[-1]
    if look.impulses.last.any():
        by_x = look.carrier.rows_at(t, x, u, look.solution.parameters)[1]
        last -= look.impulses.last @ by_x[0, : len(look.impulses.last)]
    return np.asarray(last)


def _parameter_sizes(look: Look) -> Array:
    """∫ of the sizes of the terms of H_p, (n_p,)."""
    return np.asarray((look.sizes[3] * look.panels.lengths[:, None]).sum(axis=0))


def _end(
    where: str,
    freedoms: Sequence[Freedom],
    residuals: Array,
    values: Array,
    bounds: Bounds,
    size: Array,
    names: Sequence[str],
    look: Look,
    k: int,
) -> Iterator[Condition]:
    """Judge one end: free values have residual 0, those at a bound the sign that it asks for."""
    name = f"transversality: {where}"
    free = np.array([freedom != "fixed" for freedom in freedoms], dtype=bool)
    if not free.any():
        yield not_applicable(name, "fixed by the problem")
        return
    reach = AT_END * np.maximum(np.abs(values), 1.0)
    upper, lower = bounds.upper - values <= reach, values - bounds.lower <= reach
    off = np.where(upper & (residuals < 0), 0.0, residuals)
    off = np.where(lower & (off > 0), 0.0, off)
    off = np.where(free, off, 0.0)
    worst = names[int(np.argmax(np.abs(off) / np.where(size > 0, size, 1.0)))]
    time = look.panels.times[[k]]
    times = time if where != "parameter" else np.array([np.nan])
    yield judged(
        name,
        off[None, :],
        size,
        times,
        PLAIN,
        lambda: look.explained.drift * size[None, :] + _of_time(look, where),
        f"the condition of {worst}",
    )


def _of_time(look: Look, where: str) -> float:
    """What a blurred control does to H at an end; in the answer it is H's mean that is right."""
    return blurred(look) + float(unfollowed(look)[[0, -1]].max()) if "time" in where else 0.0


def feasibility(look: Look) -> Iterator[Condition]:
    """Bounds, end conditions and constraints, at the nodes and between them."""
    f, given, p = look.flow, look.panels, look.solution.parameters
    ends = given.controls(look.solution, np.array([0.0, 1.0]))
    u = np.empty((2 * len(f.t) + 1, f.u.shape[1]))
    u[:-1:2], u[1::2], u[-1] = ends[:, 0], f.u, ends[-1, 1]
    x = np.empty((len(u), f.x.shape[1]))
    x[::2], x[1::2] = given.states, f.x
    t = np.empty(len(u))
    t[::2], t[1::2] = given.times, f.t
    every = violations(look.system.model, Dense(t, x, u, p), f.integrals)
    given_at = slice(None, -1 if given.collocated else None, 2)  # no point at the end has a control
    nodes = violations(
        look.system.model, Dense(t[given_at], x[given_at], u[given_at], p), f.integrals
    )
    own = {v.constraint: v.relative for v in nodes}
    late = _outside_times(look)
    off = np.array([late, *(v.relative for v in every)])
    times = np.array([given.times[-1], *(v.time for v in every)])
    # What holds at the nodes is violated between them as far as the cells let it.
    between = np.array([0.0, *(v.relative if own[v.constraint] <= PLAIN else 0.0 for v in every)])
    names = ["the horizon", *(v.constraint for v in every)]
    worst = names[int(np.argmax(np.where(off > PLAIN, off - between, 0.0)))]
    yield judged("feasibility", off, 1.0, times, PLAIN, lambda: between, worst)


def _outside_times(look: Look) -> float:
    """How far initial and final time are from where the problem has them, over the horizon."""
    m, t = look.system.model, look.panels.times
    pairs = ((m.initial_time, t[0]), (m.final_time, t[-1]))
    outside = max(max(one.lower - at, at - one.upper) for one, at in pairs)
    return max(float(outside) / float(t[-1] - t[0]), 0.0)
