"""A polished answer looked at: its arcs are known, and it is judged as what it claims to be.

Junctions are nodes, so that controls are blurred nowhere and nothing is left out around them; both
sides of each are looked at. Multipliers of constraints are used as they are, none is looked for.
Labels are what û is, to rounding, and where an arc says that a bound holds, it does. There is no
discretization to explain a residual: what does not hold, fails.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.certificate.conditions_of_multipliers import wrong
from quito_cli.optimality.certificate.verdicts import SOLVED, judged, not_applicable
from quito_cli.optimality.hamiltonian import Pontryagin
from quito_cli.optimality.looking.along import Along, along, densities_of
from quito_cli.optimality.looking.controls import controls
from quito_cli.optimality.looking.dilation import positive
from quito_cli.optimality.looking.flow import Carrier
from quito_cli.optimality.looking.look import Look
from quito_cli.optimality.looking.pressing import left_of
from quito_cli.optimality.symbols.probes import Probe
from quito_cli.problem.model import Bounds
from quito_cli.solution.optimal import Arc, Condition
from quito_cli.solution.solution import Solution
from quito_cli.solution.structure import by_quantity

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

AT_BOUND = 1e-9
"""Part of a range within which a control, or a constraint, is at its bound."""
SHORTEST = 1e-6
"""Part of the horizon that the defect of a panel counts as the rate of, at least: in shorter ones
the rounding of states would be all there is."""
ROUNDING = 1e-13
"""Part of the largest time that a junction may be beside a time at which formulas jump."""
SLIGHT = 1e-3
"""Part of the largest effect on costates that multipliers are judged beside, at least."""


@dataclass(frozen=True, eq=False)
class Polished(Look):
    """A polished answer, and Pontryagin's system of its Model."""

    along: Along

    @classmethod
    def at(cls, system: Pontryagin, solution: Solution) -> Polished:
        """Look at a polished answer.

        Raises:
            TooLargeError: the Hamiltonian is too long to be worked on.
        """
        probe, carrier = Probe(system), Carrier(system)
        gone, kinds = along(carrier, solution), controls(system, probe)
        parts = (gone.panels, gone.impulses, carrier, gone.flow, probe, kinds)
        return cls(system, solution, *parts, gone)

    @cached_property
    def arcs(self) -> tuple[Arc, ...]:
        """The structure that was solved for."""
        return self.solution.arcs

    @cached_property
    def labels(self) -> Array:
        """−1, 0 or +1 of controls at their lower bounds, between, at their upper ones; (P, n_u)."""
        lower, upper = self.system.model.control_bounds
        u, reach = self.flow.u, AT_BOUND * self.spans
        return np.asarray((u >= upper - reach) * 1.0 - (u <= lower + reach) * 1.0)

    @property
    def reach(self) -> Array:
        """Controls are where they are said to be, (n_u,)."""
        return np.zeros(len(self.names))

    @cached_property
    def active(self) -> NDArray[np.int_]:
        """−1 or +1 where a row is at its lower or upper bound; (P, rows)."""
        values = self.rows[0]
        lower, upper = _limits(self.system)
        reach = AT_BOUND * _sizes_of(self)
        return np.where(values >= upper - reach, 1, np.where(values <= lower + reach, -1, 0))

    @cached_property
    def clear(self) -> Flags:
        """Everywhere, (P, n_u)."""
        return np.ones(self.flow.u.shape, dtype=bool)

    def near(self, time: float, uncertainty: float) -> Flags:
        """Nowhere is a jump blurred, (P,)."""
        return np.zeros(len(self.flow.t), dtype=bool)

    @property
    def spells(self) -> Array:
        """Lengths of the panels, (P, 1), those that rounding leaves something of."""
        horizon = float(self.panels.times[-1] - self.panels.times[0])
        return np.maximum(self.panels.lengths, SHORTEST * horizon)[:, None]

    @cached_property
    def moved(self) -> Array:
        """∫ (H + μᵀc)_t dt from the first place to each, (P,), with impulses."""
        return self.along.moved

    @cached_property
    def gradient(self) -> Array:
        """What is left of H_u, (P, n_u), by the answer's own multipliers."""
        pull = np.einsum("pr,pru->pu", self.along.mu, self.rows[2])
        return left_of(self)(pull)

    def switched(self, i: int, times: Array) -> Array:
        """Return H_u of control i at nodes at which it switches; where λ jumps, it may change sign.

        The last panel before a node is looked at in its end, the first one after in its start.
        """
        given, t = self.point.gradient[:, i], self.panels.times
        after = np.searchsorted((t[1:] + t[:-1]) / 2, times)
        left, right = given[after - 1], given[np.minimum(after, len(given) - 1)]
        least = np.where(np.abs(left) < np.abs(right), left, right)
        return np.asarray(np.where(left * right < 0, 0.0, least))


def _limits(system: Pontryagin) -> Bounds:
    rows = system.rows
    return Bounds(np.array([row.lower for row in rows]), np.array([row.upper for row in rows]))


def _sizes_of(look: Look) -> Array:
    """Return the sizes of rows by what they move by, or a part of their terms, (rows,)."""
    values, by_x, by_u = look.rows[:3]
    f = look.flow
    terms = np.abs(by_x * f.x[:, None, :]).sum(axis=2) + np.abs(by_u * f.u[:, None, :]).sum(axis=2)
    least = 1e-3 * np.maximum(np.abs(values), terms).max(axis=0)
    found = np.maximum(np.ptp(values, axis=0), least)
    return np.where(found > 0, found, 1.0)


def row_multipliers(look: Look) -> Iterator[Condition]:
    """Multipliers press against active bounds, and are zero elsewhere: densities and impulses."""
    assert isinstance(look, Polished)
    at = 0
    for constraint in look.system.model.constraints.path:
        own = slice(at, at + len(constraint.labels))
        at = own.stop
        name = f"multipliers of {constraint.name}: sign and complementarity"
        if constraint.bounds.fixed.all():
            yield not_applicable(name, "an equality holds everywhere")
        else:
            yield _signs(look, name, own, "it is never active")
    if at < len(look.system.rows):
        own = slice(at, len(look.system.rows))
        yield _signs(look, "multipliers of bounds on states: sign", own, "no state is at a bound")


def _signs(look: Polished, name: str, own: slice, never: str) -> Condition:
    """Judge the multipliers of some rows beside their sizes."""
    given, t = densities_of(look.solution), look.solution.times
    values, by_x = look.rows[0][:, own], np.abs(look.rows[1][:, own])
    mu, bounds = look.along.mu[:, own], Bounds(*(side[own] for side in _limits(look.system)))
    impulses = np.zeros((len(t), len(look.system.rows)))
    for one in given.impulses:
        impulses[one.node, one.row] += one.size
    struck = impulses[:, own]
    if not (mu.any() or struck.any()):
        return not_applicable(name, never)
    sizes = _sizes_of(look)[own]
    p, x, u = look.solution.parameters, look.solution.state(t), look.solution.control(t)
    at_nodes = look.carrier.rows_at(t, x, u, p)[0][:, own]
    off = []
    costate = np.maximum(np.abs(look.panels.costates).max(axis=0), look.least_costates)
    for found, beside, reach in (
        (mu, values, look.costate_rates),
        (struck, at_nodes, costate),
    ):
        pulls = positive((by_x / positive(reach)).max(axis=(0, 2), initial=0.0))
        scale = positive(np.maximum(np.abs(found).max(axis=0), SLIGHT / pulls))
        off.append(wrong(found, beside, bounds, sizes) / scale)
    return judged(
        name,
        np.vstack(off),
        1.0,
        np.concatenate([look.flow.t, t]),
        SOLVED,
        lambda: 0.0,
        "the multiplier",
    )


def arcs_kept(look: Look) -> Iterator[Condition]:
    """Arcs end at nodes, and controls and constraints are in them what they say."""
    assert isinstance(look, Polished)
    yield from _breaks_kept(look)
    name = "controls and constraints are what their arcs say"
    held = list(_held(look))
    if not held:
        yield not_applicable(name, "there are no arcs")
        return
    off = np.array([_off(look, arc, distance) for arc, distance in held]).T
    yield judged(
        name,
        off,
        1.0,
        look.flow.t,
        SOLVED,
        lambda: 0.0,
        held[int(np.argmax(off.max(axis=0)))][0].of,
    )


def _breaks_kept(look: Polished) -> Iterator[Condition]:
    """Formulas jump at nodes alone: inside a cell a jump may be between all that is looked at."""
    if not look.breaks:
        return
    nodes, t = look.solution.times, np.array(look.breaks)
    missed = np.abs(nodes[:, None] - t).min(axis=0)
    reach = ROUNDING * float(np.abs(nodes).max())
    missed = np.where(missed <= reach, 0.0, np.maximum(missed / np.ptp(nodes), 2 * SOLVED))
    name = "formulas of time jump at junctions"
    yield judged(name, missed, 1.0, t, SOLVED, lambda: 0.0, "the nearest junction")


def _off(look: Polished, arc: Arc, distance: Array) -> Array:
    """Return how far what an arc is of is from what it says, or its ends from nodes, (P,)."""
    t, nodes = look.panels.times, look.solution.times
    missed = max(float(np.abs(nodes - at).min()) for at in (arc.start, arc.end))
    inside = _inside(look, arc)
    return np.where(inside, np.maximum(distance, missed / (t[-1] - t[0])), 0.0)


def _inside(look: Polished, arc: Arc) -> Flags:
    """Panels in an arc, (P,)."""
    t = look.panels.times
    middles = (t[1:] + t[:-1]) / 2
    return np.asarray((middles > arc.start) & (middles < arc.end))


def _held(look: Polished) -> Iterator[tuple[Arc, Array]]:
    """Give each arc with how far it is from what it says, over its range, (P,).

    At a bound its distance; between bounds all of it where the whole arc is at one; of a
    constraint that is not active its multiplier.
    """
    of_controls, of_rows = by_quantity(look.arcs, look.names)
    (lower, upper), (low, high) = look.system.model.control_bounds, _limits(look.system)
    u, values, mu = look.flow.u, look.rows[0], np.abs(look.along.mu)
    sizes, most = _sizes_of(look), positive(mu.max(axis=0, initial=0.0))
    for i, label in enumerate(look.names):
        for arc in of_controls.get(label, []):
            bound = {"lower": lower[i], "upper": upper[i]}.get(arc.kind)
            if bound is not None:
                yield arc, np.abs(u[:, i] - bound) / look.spans[i]
            else:
                own = look.labels[_inside(look, arc), i]
                yield arc, np.full(len(u), float(own.size > 0 and own.all()))
    for j, row in enumerate(look.system.rows):
        nearest = np.minimum(np.abs(values[:, j] - low[j]), np.abs(values[:, j] - high[j]))
        for arc in of_rows.get(row.label, []):
            yield arc, nearest / sizes[j] if arc.kind == "active" else mu[:, j] / most[j]


def sharply(row: Condition) -> Condition:
    """Return a row of the certificate with what holds to discretization accuracy as failing."""
    if row.verdict != "holds to discretization accuracy":
        return row
    said = f"it is off by {row.residual:.2g} at t = {row.time:.6g}, of a scale of {row.scale:.2g}"
    return replace(row, verdict="fails", reason=said)
