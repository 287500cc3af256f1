"""A polished answer gone along: what its polynomials leave of x' = f and λ' = −(H + μᵀc)_x.

States, costates and multipliers are functions of time, smooth inside the cells, which end at the
junctions. In every panel, from one point of a cell to the next,

    x(b) − x(a) = ∫ f dt,      λ(b) − λ(a) = −∫ (H + μᵀc)_x dt,      ∫ (H + μᵀc)_t dt

are compared and found by Gauss' rule of three points in each half of it: away from the points that
the polynomials go through, exactly to the sixth order of what is short already. At nodes the
impulses of multipliers are λ⁻ − λ⁺. Nothing is integrated anew: the answer is to be right between
its points too, not near to one that is.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.hamiltonian import Pontryagin, sampled
from quito_cli.optimality.looking.breaks import OFF
from quito_cli.optimality.looking.flow import Carrier, Flow, Impulses
from quito_cli.optimality.looking.impulses import stacked
from quito_cli.optimality.looking.panels import Panels, panels
from quito_cli.optimality.transversality import point_jumps
from quito_cli.solution.trajectory import Polynomials
from quito_cli.transcription.legendre import radau

if TYPE_CHECKING:
    from quito_cli.solution.densities import Densities
    from quito_cli.solution.solution import Solution

Array = NDArray[np.float64]

_GAUSS, _WEIGHTS = (np.array(part) for part in np.polynomial.legendre.leggauss(3))


@dataclass(frozen=True, eq=False)
class Sampled:
    """An answer at the same offsets in each of its N cells, cell by cell; points = N · offsets."""

    t: Array
    """(points,)."""
    x: Array
    """(points, n_x)."""
    costate: Array
    """(points, n_x)."""
    u: Array
    """(points, n_u)."""
    mu: Array
    """(points, rows)."""


@dataclass(frozen=True, eq=False)
class Along:
    """What an answer says along the horizon, and what its equations leave."""

    panels: Panels
    impulses: Impulses
    flow: Flow
    """Looked at in the middles of panels, but at the ends of cells in the first and the last."""
    mu: Array
    """(P, rows) there."""
    moved: Array
    """(P,) what H moves by from the first place to each, with all explicit functions of time."""


def densities_of(solution: Solution) -> Densities:
    """Return the multipliers of a polished answer."""
    assert solution.densities is not None, "only a polished answer is gone along"
    return solution.densities


def at_offsets(solution: Solution, offsets: Array) -> Sampled:
    """Return an answer at offsets of [0, 1] in every cell, the limits from inside at its ends."""
    given, mesh, adjoint = densities_of(solution), solution.mesh, solution.adjoint
    assert isinstance(solution.trajectory, Polynomials)
    assert adjoint is not None
    steps = np.diff(solution.times)[:, None]
    weights = radau(adjoint.degree).state.weights(offsets)
    count = mesh.cells * len(offsets)
    x, costate, mu = (
        np.einsum("ow,kwx->kox", weights, curve.in_cells).reshape(count, curve.states.shape[1])
        for curve in (solution.trajectory, adjoint, given.curve)
    )
    u = solution.basis.evaluate(solution.coefficients, *mesh.points(offsets))
    t = solution.times[:-1, None] + steps * offsets
    off = OFF * np.abs(solution.times).max()  # at a node formulas may jump
    t = np.clip(t, solution.times[:-1, None] + off, solution.times[1:, None] - off)
    return Sampled(t.ravel(), x, costate, u, mu)


def places(degree: int) -> Array:
    """Return where the panels of a cell are looked at, (D,): its ends among them."""
    breaks = radau(degree).state.points
    middles = (breaks[1:] + breaks[:-1]) / 2
    if degree > 1:
        middles[0], middles[-1] = 0.0, 1.0
    return np.asarray(middles)


def along(carrier: Carrier, solution: Solution) -> Along:
    """Go along a polished answer."""
    m, given, adjoint = carrier.system.model, panels(solution), solution.adjoint
    assert isinstance(solution.trajectory, Polynomials)
    assert adjoint is not None
    degree, n, count = adjoint.degree, m.n_x, len(given.cells)
    halved = _integrated(carrier, solution, degree)
    last = np.cumsum([n, n, m.n_q, m.n_p, 1])
    f, by_x, integrals, by_p, by_t, mu = np.split(halved, last, axis=1)
    f, by_x, integrals, by_p, mu = (v[::2] + v[1::2] for v in (f, by_x, integrals, by_p, mu))
    moves = [np.diff(c.in_cells, axis=1).reshape(count, n) for c in (solution.trajectory, adjoint)]
    jumps = _jumps(carrier.system, solution)
    before = np.vstack([adjoint.states[[0]] + jumps.costate[[0]], adjoint.in_cells[:, -1]])
    defects, starts = by_x - moves[1], slice(degree, None, degree)
    missed = (before - jumps.costate - adjoint.states[::degree])[1:-1]
    inner = defects[starts]
    defects[starts] = np.where(np.abs(missed) > np.abs(inner), missed, inner)
    mu[::degree] += jumps.impulses[:-1]
    here = at_offsets(solution, places(degree))
    bounds = np.zeros((count, n))
    bounds[:, carrier.system.model.state_bounds.present] = mu[:, _path_rows(carrier.system) :]
    flow = Flow(
        here.x,
        here.costate,
        here.t,
        here.u,
        f - moves[0],
        defects,
        bounds,
        integrals.sum(axis=0),
        by_p.sum(axis=0) + jumps.parameters,
    )
    moved = np.cumsum(by_t)[::2]
    moved += np.repeat(np.cumsum(jumps.rates[:-1]), degree)
    costates = given.costates.copy()
    costates[::degree] = before
    return Along(
        replace(given, costates=costates),
        _impulses(carrier.system, solution, given, mu, jumps.impulses[-1]),
        flow,
        here.mu,
        moved - moved[0],
    )


def _integrated(carrier: Carrier, solution: Solution, degree: int) -> Array:
    """Integrate f, −(H + μᵀc)_x, integrands, (H + μᵀc)_p, (H + μᵀc)_t and μ, (2 P, …).

    From the start of each panel to where it is looked at, and from there to its end.
    """
    system, p, m = carrier.system, solution.parameters, carrier.system.model
    starts = np.column_stack([radau(degree).state.points[:-1], places(degree)])
    ends = np.append(starts.ravel(), 1.0)
    halves, middles = np.diff(ends) / 2, (ends[1:] + ends[:-1]) / 2
    s = at_offsets(solution, (middles[:, None] + halves[:, None] * _GAUSS).ravel())
    nu = stacked(solution, "integral", [c.name for c in m.constraints.integral])
    at = system.along(s.t, s.x, s.costate, s.u, p, mu=s.mu, nu=nu)
    free = sampled(carrier.slopes, (s.t, s.x, s.costate, s.u, p, None, nu))[0]
    f, integrands = free[:, : m.n_x], free[:, 2 * m.n_x : 2 * m.n_x + m.n_q]
    whole = np.hstack([f, at.adjoint, integrands, at.parameters, at.rate[:, None], s.mu])
    values = whole.reshape(-1, len(halves), len(_GAUSS), whole.shape[1])
    steps = np.diff(solution.times)[:, None, None]
    found = np.einsum("q,koqx->kox", _WEIGHTS, values) * halves[:, None] * steps
    return np.asarray(found.reshape(-1, whole.shape[1]))


@dataclass(frozen=True, eq=False)
class _Jumps:
    """What happens at nodes."""

    impulses: Array
    """(N+1, rows); of states not at the ends, where bounds are matters of transversality."""
    costate: Array
    """(N+1, n_x) λ⁻ − λ⁺; at the ends without point constraints, as in all answers."""
    rates: Array
    """(N+1,) of H."""
    parameters: Array
    """(n_p,) Σ impulses · c_p."""


def _jumps(system: Pontryagin, solution: Solution) -> _Jumps:
    m, given, t, p = system.model, densities_of(solution), solution.times, solution.parameters
    impulses, count = np.zeros((len(t), len(system.rows))), len(t)
    for one in given.impulses:
        if not system.rows[one.row].state or 0 < one.node < count - 1:
            impulses[one.node, one.row] += one.size
    x, u, none = solution.state(t), solution.control(t), np.zeros((count, m.n_x))
    costate, rates, parameters = np.zeros((count, m.n_x)), np.zeros(count), np.zeros(m.n_p)
    if impulses.any():
        struck, calm = (system.along(t, x, none, u, p, mu=mu) for mu in (impulses, None))
        costate, rates = calm.adjoint - struck.adjoint, struck.rate - calm.rate
        parameters = (struck.parameters - calm.parameters).sum(axis=0)
    for f, (k, rho) in zip(point_jumps(system), _points(system, solution, t), strict=True):
        if 0 < k < count - 1:
            values = (t[[k]], x[[k]], none[[k]], u[[k]], p, None, None)
            costate[k] += sampled(f, values)[1].reshape(m.n_x, -1) @ rho
    return _Jumps(impulses, costate, rates, parameters)


def _points(system: Pontryagin, solution: Solution, times: Array) -> Iterator[tuple[int, Array]]:
    """Give the entry of `times` at which each point constraint is, and its multipliers."""
    for point in system.model.constraints.point:
        name = f"point constraint {point.name}"
        at = solution.multiplier_axes[name].times[0]
        yield int(np.argmin(np.abs(times - at))), solution.multipliers[name][0]


def _impulses(
    system: Pontryagin, solution: Solution, given: Panels, mu: Array, last: Array
) -> Impulses:
    """Return multipliers as impulses at the starts of panels."""
    rows, constraints = _path_rows(system), system.model.constraints
    path = np.zeros((len(given.cells), 2, rows))
    path[:, 0] = mu[:, :rows]
    return Impulses(
        path,
        last[:rows],
        tuple(_points(system, solution, given.times)),
        stacked(solution, "integral", [c.name for c in constraints.integral]),
        stacked(solution, "boundary", [c.name for c in constraints.boundary]),
    )


def _path_rows(system: Pontryagin) -> int:
    return sum(not row.state for row in system.rows)
