"""An answer looked at through Pontryagin's system: all that its conditions are judged by.

Conditions hold along arcs. Around a junction û is the answer's blur of a jump or kink, so that as
many cells as a jump takes are left out on either side, and where û bends too much for its cells. What is small is so beside the terms that it
is made of: H_u beside |L_u| + Σ|λ_j f_j,u|, and likewise H_x and H.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.arcs import Looked, arcs, at_bounds, marked
from quito_cli.optimality.controls import Controls, controls
from quito_cli.optimality.flow import Carrier, Flow, Impulses, Panels, explained, flow, panels
from quito_cli.optimality.hamiltonian import Point, Pontryagin, sampled
from quito_cli.optimality.impulses import impulses
from quito_cli.optimality.pressing import pressed_gradient
from quito_cli.optimality.probes import Probe
from quito_cli.problem.model import labels
from quito_cli.solution.junctions import ranges, width
from quito_cli.solution.optimal import Arc
from quito_cli.transcription.control import ControlBasis

if TYPE_CHECKING:
    import casadi as ca

    from quito_cli.solution.solution import Solution

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

ORDERS = {"euler": 1, "trapezoidal": 2}
"""Schemes whose errors are those of a method of lower order than Kutta's."""
PRESSES = 1e-3
"""What a multiplier does to λ' or H_u, beside the size of their terms, that is not nothing."""
STEEP = 0.02
"""Second differences of û over its range, above which the cells do not show what it does."""
SLIGHT = 0.01
"""Part of what a costate could move by over the horizon that counts as its size."""
_GRID = 4
"""Points a panel that labels are given on."""


@dataclass(frozen=True, eq=False)
class Look:
    """An answer, its panels, and Pontryagin's system of its Model."""

    system: Pontryagin
    solution: Solution
    panels: Panels
    impulses: Impulses
    flow: Flow
    probe: Probe
    controls: Controls

    @classmethod
    def at(cls, system: Pontryagin, solution: Solution) -> Look:
        """Look at an answer.

        Raises:
            TooLargeError: the Hamiltonian is too long to be worked on.
        """
        given, probe, carrier = panels(solution), Probe(system), Carrier(system)
        steps = 2 if given.collocated else max(4, 2 * int(solution.options["substeps"]))
        struck = impulses(system, solution, given, steps)
        carried = flow(carrier, solution, given, struck, steps)
        found = controls(system, probe)
        return cls(system, solution, given, struck, carried, probe, found)

    @property
    def names(self) -> tuple[str, ...]:
        """Labels of the controls."""
        return labels(self.system.model.controls)

    @cached_property
    def carrier(self) -> Carrier:
        """The functions that carry an answer."""
        return Carrier(self.system)

    @cached_property
    def point(self) -> Point:
        """Pontryagin's system at the middles of panels, without multipliers of rows."""
        f = self.flow
        nu = self.impulses.integral
        return self.system.along(f.t, f.x, f.costate, f.u, self.solution.parameters, nu=nu)

    @cached_property
    def rows(self) -> tuple[Array, Array, Array, Array]:
        """Values of rows at the middles, and derivatives in x, u, p; (P, rows, …)."""
        f = self.flow
        return self.carrier.rows_at(f.t, f.x, f.u, self.solution.parameters)

    @cached_property
    def sizes(self) -> tuple[Array, Array, Array]:
        """Sizes of the terms of H (P,), H_x (P, n_x) and H_u (P, n_u)."""
        f, m = self.flow, self.system.model
        values = (f.t, f.x, f.costate, f.u, self.solution.parameters, None, self.impulses.integral)
        found = sampled(_sizes(self.system), values)[0]
        return found[:, 0], found[:, 1 : 1 + m.n_x], found[:, 1 + m.n_x :]

    @cached_property
    def switching_sizes(self) -> Array:
        """Sizes of the terms of H_u over the horizon, (n_u,).

        A costate that is zero on an arc as long as the horizon has the size that it moves to.
        """
        found = self.sizes[2].max(axis=0, initial=0.0)
        horizon = self.panels.times[-1] - self.panels.times[0]
        moved = np.tile(SLIGHT * horizon * self.costate_rates, (len(self.flow.t), 1))
        return np.maximum(found, self._pulled(moved).max(axis=0, initial=0.0))

    def _pulled(self, moved: Array) -> Array:
        """Return what changes of costates (P, n_x) do to H_u at most, (P, n_u)."""
        f, p, nu = self.flow, self.solution.parameters, self.impulses.integral
        with_, without = (
            sampled(_sizes(self.system), (f.t, f.x, costate, f.u, p, None, nu))[0]
            for costate in (moved, np.zeros_like(moved))
        )
        return np.asarray((with_ - without)[:, 1 + self.system.model.n_x :])

    @cached_property
    def uneven(self) -> Array:
        """What impulses that differ from one panel to the next do to H_u, (P, n_u)."""
        path = self.impulses.path.sum(axis=1)
        total = self.flow.bounds.copy()
        if path.any():
            total += np.einsum("pr,prx->px", path, self.rows[1][:, : path.shape[1]])
        if not total.any():
            return np.zeros((len(total), len(self.names)))
        change = np.abs(np.diff(total, axis=0, prepend=total[[0]]))
        return self._pulled(dilated(change, 1))

    @cached_property
    def spans(self) -> Array:
        """Ranges of the controls: between their bounds, or what they move by; (n_u,)."""
        lower, upper = self.system.model.control_bounds
        with np.errstate(invalid="ignore"):
            wide = upper - lower
        return np.where(np.isfinite(wide) & (wide > 0), wide, ranges(self.flow.u))

    @cached_property
    def seen(self) -> Looked:
        """The answer on the grid that labels are given on."""
        given, solution, rows = self.panels, self.solution, len(self.system.rows)
        offsets = np.arange(_GRID + 1) / _GRID
        u = given.controls(solution, offsets).reshape(-1, self.system.model.n_u)
        t = (given.times[:-1, None] + given.lengths[:, None] * offsets).ravel()
        values, pressed = np.zeros((len(t), 0)), np.zeros((len(t), 0), dtype=bool)
        if rows:
            x, p = solution.state(t), solution.parameters
            values = self.carrier.rows_at(t, x, u, p)[0]
            pressed = np.repeat(_pressed(self), _GRID + 1, axis=0)
        return Looked(solution, t, u, values, pressed, _GRID + 1)

    @cached_property
    def arcs(self) -> tuple[Arc, ...]:
        """The structure."""
        affine = np.array([kind in ("affine", "absent") for kind in self.controls.kinds], bool)
        found = arcs(self.system, affine, self.seen)
        return sharpened(self, found)

    @cached_property
    def active(self) -> NDArray[np.int_]:
        """−1 or +1 where a row is at its lower or upper bound, at the middles; (P, rows)."""
        grid = at_bounds(self.system, self.seen)
        return grid.reshape(len(self.flow.t), _GRID + 1, -1)[:, _GRID // 2]

    def labels_of(self, i: int) -> Array:
        """Return −1, 0 or +1 of control i at its lower bound, between, at its upper; (P,)."""
        found = np.zeros(len(self.flow.t))
        for arc in self.arcs:
            if arc.of == self.names[i] and arc.kind in ("lower", "upper"):
                inside = (self.flow.t >= arc.start) & (self.flow.t <= arc.end)
                found[inside] = -1.0 if arc.kind == "lower" else 1.0
        return found

    @cached_property
    def labels(self) -> Array:
        """`labels_of` all controls, (P, n_u)."""
        found = [self.labels_of(i) for i in range(len(self.names))]
        return np.array(found).reshape(len(found), len(self.flow.t)).T

    @cached_property
    def clear(self) -> Flags:
        """Middles away from junctions of each control, and of constraints; (P, n_u)."""
        found = np.ones((len(self.flow.t), len(self.names)), dtype=bool)
        end = self.solution.times[-1]
        for arc in self.arcs:
            if arc.end < end:
                own = [arc.of] if arc.of in self.names else list(self.names)
                for name in own:
                    found[self.near(arc.end, arc.end_uncertainty), self.names.index(name)] = False
        for j in self.solution.junctions:
            found[self.near(j.time, j.uncertainty), j.control] = False
        return found & ~self.unresolved & (self.bends <= STEEP)

    @cached_property
    def unresolved(self) -> Flags:
        """Middles in and beside what is too short for these cells to be an arc, (P, n_u)."""
        marks = marked(self.system, self.seen).reshape(len(self.flow.t), _GRID + 1, -1)
        off = (marks[:, _GRID // 2] != self.labels).astype(float)
        return dilated(off, width(self.solution.basis)) > 0

    def near(self, time: float, uncertainty: float) -> Flags:
        """Return middles so near to a time that a jump there would blur û, (P,)."""
        nodes, cells = self.solution.times, self.panels.cells
        at = [np.searchsorted(nodes, time + s * uncertainty, side="right") - 1 for s in (-1, 1)]
        most = width(self.solution.basis)
        return np.asarray((cells >= at[0] - most) & (cells <= at[1] + most))

    @cached_property
    def gradient(self) -> Array:
        """What is left of H_u, (P, n_u): by the best multipliers of active rows with controls."""
        return pressed_gradient(self)

    @cached_property
    def local_errors(self) -> tuple[Array, Array]:
        """How fast the scheme errs in x and λ by theory, a unit of time, (P, n_x) each."""
        options, given = self.solution.options, self.panels
        order = ORDERS.get(options["discretization"], 4)
        steps = 1 if given.collocated else int(options["substeps"])
        args = (self.carrier, self.solution, given, self.impulses, order, steps)
        by_x, by_costate = (
            dilated(e / given.lengths[:, None], 2) for e in explained(*args)
        )
        if order < 4:  # costates are those of the adjoint scheme, whose errors are others
            by_costate = by_costate + dilated(self._adjoint_moves(order), 2)
        if given.collocated:  # polynomials meet the equations at points only
            wrong = self.unfollowed.max(axis=1, initial=0.0)[:, None]
            by_x = by_x + _last_terms(given, given.states) + wrong * self.state_rates
            by_costate = by_costate + _last_terms(given, given.costates)
            by_costate = by_costate + wrong * self.costate_rates
        return by_x, by_costate

    def _adjoint_moves(self, order: int) -> Array:
        """How much λ' changes over a panel with x alone and with λ alone, (P, n_x).

        Of order 2, how much that change does.
        """
        f, p, nu = self.flow, self.solution.parameters, self.impulses.integral
        here = self.point.adjoint[:-1]
        moves = [
            self.system.along(f.t[:-1], x, costate, f.u[:-1], p, nu=nu).adjoint - here
            for x, costate in ((f.x[1:], f.costate[:-1]), (f.x[:-1], f.costate[1:]))
        ]
        for _ in range(order - 1):
            moves = [np.diff(move, axis=0, prepend=move[[0]]) for move in moves]
        total = np.abs(np.array(moves)).sum(axis=0)
        return np.vstack([total, total[[-1]]])

    @cached_property
    def bends(self) -> Array:
        """Second differences of û over its range, the largest of the neighbourhood; (P, n_u)."""
        return dilated(self._differences(2), width(self.solution.basis))

    @cached_property
    def unfollowed(self) -> Array:
        """What û may be off by, over its range, because its functions cannot do better; (P, n_u).

        They follow whatever is a cubic over a few cells; fourth differences see the rest. Those of
        a wave of two cells are 16 times its amplitude. Polynomials are off by what they do between
        their points.
        """
        found = self._differences(4) / 16
        if self.panels.collocated:
            u = self.panels.controls(self.solution, np.array([0.0, 0.5, 1.0])) / self.spans
            found = np.maximum(found, np.abs(u[:, 1] - (u[:, 0] + u[:, 2]) / 2))
        elif isinstance(basis := self.solution.basis, ControlBasis) and not basis.function.scaled:
            found = np.maximum(found, self._differences(2) / 8)
        return dilated(found, width(self.solution.basis))

    def _differences(self, order: int) -> Array:
        """Differences of û over its range from panel to panel, of even order, (P, n_u)."""
        u = self.flow.u / self.spans
        if len(u) <= order:
            return np.ones_like(u)
        change = np.abs(np.diff(u, order, axis=0))
        return np.pad(change, ((order // 2, order // 2), (0, 0)), mode="edge")

    @cached_property
    def state_rates(self) -> Array:
        """How fast states move at most, (n_x,)."""
        f = np.abs(np.diff(self.panels.states, axis=0)) / self.panels.lengths[:, None]
        horizon = self.panels.times[-1] - self.panels.times[0]
        return np.asarray(
            np.maximum(f.max(axis=0), np.abs(self.panels.states).max(axis=0) / horizon)
        )

    @cached_property
    def costate_rates(self) -> Array:
        """How fast costates could move by the terms of H_x, (n_x,)."""
        horizon = self.panels.times[-1] - self.panels.times[0]
        size = np.abs(self.panels.costates).max(axis=0) / horizon
        return np.asarray(np.maximum(self.sizes[1].max(axis=0), size))

    @cached_property
    def drift(self) -> float:
        """Relative error that local errors add up to over the horizon, by theory."""
        by_x, by_costate = self.local_errors
        h = self.panels.lengths[:, None]
        total = (h * by_x).sum(axis=0) / _positive(np.abs(self.panels.states).max(axis=0))
        other = (h * by_costate).sum(axis=0) / _positive(np.abs(self.panels.costates).max())
        return float(max(total.max(), other.max()))


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


def dilated(values: Array, most: int) -> Array:
    """Return the largest value within `most` points, along the first axis."""
    padded = np.pad(values, ((most, most), (0, 0)), mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * most + 1, axis=0)
    return np.asarray(windows.max(axis=-1))


def _last_terms(given: Panels, values: Array) -> Array:
    """Return the slopes of the last terms of the polynomials of cells, at most, (P, n).

    The leading coefficient is a divided difference; a monic polynomial of degree D is at least
    2 · 4^(−D) somewhere on the unit interval (Chebyshev), and its slope 2D² times that (Markov).
    """
    each = int((given.cells == 0).sum())
    at = np.append(given.begins[:each], 1.0)
    apart = at[:, None] - at + np.eye(len(at))
    # Products of distances on [0, 4] do not underflow: the capacity of that interval is one.
    weights = 2.0 / np.prod(4 * apart, axis=1) * 4.0
    cells = (np.arange(0, len(values) - 1, each)[:, None] + np.arange(each + 1)).ravel()
    top = np.abs(np.einsum("d,kdx->kx", weights, values[cells].reshape(-1, each + 1, values.shape[1])))
    lengths = given.lengths.reshape(-1, each).sum(axis=1)[:, None]
    return np.repeat(2 * each**2 * top / lengths, each, axis=0)


def _positive(values: Array) -> Array:
    return np.where(values > 0, values, 1.0)


def _pressed(look: Look) -> Flags:
    """Return where multipliers are not nothing beside H_x or H_u, (P, rows), neighbours included."""
    h, path = look.panels.lengths[:, None], look.impulses.path
    density = np.abs(path.sum(axis=1)) / h
    by_x, by_u = (np.abs(slopes[:, : path.shape[2]]) for slopes in look.rows[1:3])
    # An impulse may stand for all there is of μ: then it is its jump of λ that counts.
    effect = [(density[:, :, None] * by_x / _positive(look.costate_rates)).max(axis=2, initial=0)]
    sizes = _positive(look.sizes[2].max(axis=0, initial=0.0))
    effect[0] = np.maximum(effect[0], (density[:, :, None] * by_u / sizes).max(axis=2, initial=0))
    bounds = np.abs(look.flow.bounds) / h / _positive(look.costate_rates)
    effect.append(bounds[:, bounded_states(look.system)])
    return dilated((np.hstack(effect) > PRESSES).astype(float), 1) > 0


def bounded_states(system: Pontryagin) -> Flags:
    """Return which states have bounds: the rows of states are in this order."""
    lower, upper = system.model.state_bounds
    return np.asarray(np.isfinite(lower) | np.isfinite(upper))


def _sizes(system: Pontryagin) -> ca.Function:
    """Return arguments ↦ sizes of the terms of H, H_x and H_u, stacked."""
    import casadi as ca

    m = system.model
    integrands = ca.vertcat(*(c.value for c in m.constraints.integral))
    terms = ca.vertcat(m.lagrange, m.xdot, integrands)
    weights = ca.vertcat(1, ca.fabs(system.costate), ca.fabs(system.integral_multipliers))
    whole = [ca.dot(weights, ca.fabs(terms))]
    for by in (m.x, m.u):
        whole.append(ca.fabs(ca.densify(ca.jacobian(terms, by))).T @ weights)
    return system.function("sizes", [ca.densify(ca.vertcat(*whole))])
