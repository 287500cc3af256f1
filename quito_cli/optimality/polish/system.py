"""The boundary value problem of a structure: all equations about a point, linearised.

A chain (see `chain`) whose nodes are those of the segments of all phases in order. Within a phase a
segment links its nodes; between phases the jump of the costate does. Conditions at junctions and
ends are rows of single nodes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.polish.chain import Rows
from quito_cli.optimality.polish.ends import Ends
from quito_cli.optimality.polish.flow import Linearised, inputs, linearised
from quito_cli.optimality.polish.gauss import Gauss
from quito_cli.optimality.polish.junctions import Condition, Jump, conditions, jumps
from quito_cli.optimality.polish.law import Law, evaluated
from quito_cli.optimality.polish.setting import Setting
from quito_cli.optimality.polish.structure import Structure
from quito_cli.optimality.polish.unknowns import Segments, Shared, Unknowns

if TYPE_CHECKING:
    import casadi as ca

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Placed:
    """A condition with the law it is evaluated by."""

    condition: Condition
    function: ca.Function
    """Compiled by the law of `phase`."""
    phase: int
    at_start: bool
    """Of its phase; else at its end."""


@dataclass(frozen=True, eq=False)
class Leap:
    """What the costate jumps by at a junction, m · ∇S."""

    jumps: tuple[Jump, ...]
    multipliers: slice
    """In π."""
    function: ca.Function
    """(x, t, p, m) ↦ Σ m ∇S stacked on Σ m S_p, and derivatives in x, t, p, m; then S and its
    derivatives in x, t, p, m."""


@dataclass(frozen=True, eq=False)
class System:
    """The equations of a structure."""

    setting: Setting
    structure: Structure
    ends: Ends
    method: Gauss

    @cached_property
    def laws(self) -> tuple[Law, ...]:
        """By phase; equal phases share one."""
        made = {phase: Law(self.setting, phase) for phase in self.structure.phases}
        return tuple(made[phase] for phase in self.structure.phases)

    @cached_property
    def leaps(self) -> tuple[Leap | None, ...]:
        """By junction, 0 … phases."""
        found: list[Leap | None] = []
        at = 0
        for k in range(len(self.structure.phases) + 1):
            own = jumps(self.setting, self.structure, k)
            if not own:
                found.append(None)
                continue
            count = sum(jump.values.numel() for jump in own)
            found.append(Leap(tuple(own), slice(at, at + count), _leap(self.setting, own)))
            at += count
        return tuple(found)

    @cached_property
    def placed(self) -> tuple[Placed, ...]:
        """All conditions at junctions."""
        found = []
        for k in range(len(self.structure.phases) + 1):
            for given in conditions(self.setting, self.structure, k):
                phase = k if given.side == "after" else k - 1
                function = self.laws[phase].compiled("condition", given.value)
                found.append(Placed(given, function, phase, given.side == "after"))
        return tuple(found)

    @cached_property
    def layout(self) -> Shared:
        """Where the shared unknowns are."""
        m, system = self.setting.system.model, self.setting.system
        return Shared(
            m.n_x,
            len(self.structure.times),
            m.n_p,
            system.integrals,
            len(self.ends.boundary),
            sum(leap.multipliers.stop - leap.multipliers.start for leap in self.leaps if leap),
            1 + 2 * len(self.structure.points),
        )

    @property
    def beside(self) -> int:
        """Length of w."""
        return self.setting.system.integrals + self.setting.system.model.n_p

    @property
    def size(self) -> int:
        """Length of y."""
        return 2 * self.setting.system.model.n_x + self.beside

    def as_given(self, shared: Array) -> Array:
        """Return g with what the problem fixes at its value to the last digit."""
        found, times = shared.copy(), self.layout.place("T")
        fixed = (self.ends.initial_time, self.ends.final_time)
        for place, value in zip((times.start, times.stop - 1), fixed, strict=True):
            if np.isfinite(value):
                found[place] = value
        return found

    @cached_property
    def hamiltonians(self) -> tuple[ca.Function, ...]:
        """H by each phase's law."""
        return tuple(law.compiled("H", self.setting.system.hamiltonian) for law in self.laws)

    def linearised(self, at: Unknowns) -> tuple[list[Linearised], list[list[Rows]], Unknowns]:
        """Return every phase about a point, the rows of the chain, and the point with z settled."""
        layout, g = self.layout, at.shared
        flows, phases = [], []
        for k, (law, segments) in enumerate(zip(self.laws, at.phases, strict=True)):
            flows.append(linearised(law, segments, g, layout, k, self.method))
            first, last = (
                law.settled(self._inputs(segments, k, start, g), z[None])[0][0]
                for start, z in ((True, segments.first), (False, segments.last))
            )
            phases.append(
                Segments(
                    segments.fractions,
                    segments.nodes,
                    segments.stages,
                    flows[-1].inner,
                    first,
                    last,
                )
            )
        settled = Unknowns(tuple(phases), g)
        chain: list[list[Rows]] = []
        for k, (segments, flow) in enumerate(zip(phases, flows, strict=True)):
            start = len(chain)
            chain += [[] for _ in range(len(segments.nodes))]
            for j in range(len(segments.stages)):
                right = flow.ends[j] - segments.nodes[j + 1]
                link = Rows(-flow.by_start[j], np.eye(self.size), -flow.by_shared[j], right)
                chain[start + j].append(link)
            if k == 0:
                chain[0].append(self._begin(settled))
            else:
                chain[start - 1].append(self._across(settled, k))
        firsts = np.cumsum([0, *(len(s.nodes) for s in phases)])
        for placed in self.placed:
            at_node = firsts[placed.phase] if placed.at_start else firsts[placed.phase + 1] - 1
            chain[at_node].append(self._row(settled, placed))
        for rows, node in self._energies(settled, firsts):
            chain[node].append(rows)
        chain[-1].append(self._final(settled))
        for k, leap in enumerate(self.leaps):
            if leap is not None:
                chain[firsts[min(k, len(phases) - 1)]] += self._point_rows(settled, k, leap)
        return flows, chain, settled

    def _inputs(self, segments: Segments, phase: int, start: bool, g: Array) -> Array:
        """Return v at an end of a phase, (1, n_v)."""
        y = segments.nodes[0 if start else -1]
        time = g[self.layout.place("T")][phase + (not start)]
        return inputs(np.array([time]), y[None], g, self.layout)

    def _row(self, at: Unknowns, placed: Placed) -> Rows:
        """Linearise conditions at an end of a phase."""
        return self._rows(at, placed.function, placed.phase, placed.at_start)

    def _rows(self, at: Unknowns, function: ca.Function, phase: int, start: bool) -> Rows:
        """Linearise a compiled function at an end of a phase."""
        segments, law = at.phases[phase], self.laws[phase]
        v = self._inputs(segments, phase, start, at.shared)
        z = (segments.first if start else segments.last)[None]
        _, z_by_v = law.settled(v, z)
        value, by_v, by_z = evaluated(function, v, z)
        slopes = (by_v + by_z @ z_by_v)[0]
        two, layout = 2 * self.layout.states, self.layout
        here = np.zeros((len(slopes), self.size))
        here[:, :two] = slopes[:, :two]
        shared = np.zeros((len(slopes), layout.count))
        shared[:, layout.place("T").start + phase + (not start)] = slopes[:, two]
        shared[:, layout.place("p")] = slopes[:, two + 1 : two + 1 + layout.parameters]
        shared[:, layout.place("nu")] = slopes[:, two + 1 + layout.parameters :]
        return Rows(here, None, shared, -value[0])

    def _jumped(self, at: Unknowns, k: int, y: Array) -> tuple[Array, Array, Array]:
        """Return what y changes by at junction k, and its derivatives in y and g."""
        n, layout, g = self.layout.states, self.layout, at.shared
        change, by_y = np.zeros(self.size), np.zeros((self.size, self.size))
        by_g, leap = np.zeros((self.size, layout.count)), self.leaps[k]
        if leap is None:
            return change, by_y, by_g
        time = layout.place("T").start + k
        own = slice(
            layout.place("pi").start + leap.multipliers.start,
            layout.place("pi").start + leap.multipliers.stop,
        )
        given = (y[:n], g[time], g[layout.place("p")], g[own])
        value, by_x, by_t, by_p, by_m = (np.array(v) for v in leap.function.call(given)[:5])
        places = np.r_[n : 2 * n, self.size - layout.parameters : self.size]
        signs = np.r_[-np.ones(n), np.ones(layout.parameters)]
        change[places] = signs * value[:, 0]
        by_y[places, :n] = signs[:, None] * by_x
        by_g[places, time] = signs * by_t[:, 0]
        by_g[np.ix_(places, np.arange(layout.count)[layout.place("p")])] = signs[:, None] * by_p
        by_g[np.ix_(places, np.arange(layout.count)[own])] = signs[:, None] * by_m
        return change, by_y, by_g

    def _begin(self, at: Unknowns) -> Rows:
        """y_0 = (x₀, λ₀, 0), and the jump of what is active from the first."""
        n, layout, g = self.layout.states, self.layout, at.shared
        y = np.concatenate([g[layout.place("x0")], g[layout.place("l0")], np.zeros(self.beside)])
        change, by_y, by_g = self._jumped(at, 0, y)
        shared = -by_g
        whole = np.eye(self.size) + by_y
        shared[:, layout.place("x0")] -= whole[:, :n]
        shared[:, layout.place("l0")] -= whole[:, n : 2 * n]
        right = y + change - at.phases[0].nodes[0]
        return Rows(np.eye(self.size), None, shared, right)

    def _across(self, at: Unknowns, k: int) -> Rows:
        """Link the end of a phase to the start of the next."""
        before, after = at.phases[k - 1].nodes[-1], at.phases[k].nodes[0]
        change, by_y, by_g = self._jumped(at, k, before)
        right = before + change - after
        return Rows(-np.eye(self.size) - by_y, np.eye(self.size), -by_g, right)

    def _energies(self, at: Unknowns, firsts: Array) -> list[tuple[Rows, int]]:
        """e = H at the initial time and on both sides of point constraints."""
        first = self.layout.place("e").start
        found = [self._energy(at, 0, True, first, None)]
        for j, (k, _) in enumerate(self.structure.points):
            found.append(self._energy(at, k - 1, False, first + 1 + 2 * j, k))
            found.append(self._energy(at, k, True, first + 2 + 2 * j, None))
        nodes = [
            int(firsts[0]),
            *(n for k, _ in self.structure.points for n in (firsts[k] - 1, firsts[k])),
        ]
        return [(rows, int(node)) for rows, node in zip(found, nodes, strict=True)]

    def _energy(self, at: Unknowns, phase: int, start: bool, place: int, k: int | None) -> Rows:
        rows = self._rows(at, self.hamiltonians[phase], phase, start)
        shared, right = -rows.shared, rows.right.copy() * -1.0
        leap = None if k is None else self.leaps[k]
        if leap is not None and k is not None:  # ρᵀ c_t
            layout, g = self.layout, at.shared
            n, y = layout.states, at.phases[phase].nodes[-1]
            own = slice(
                layout.place("pi").start + leap.multipliers.start,
                layout.place("pi").start + leap.multipliers.stop,
            )
            given = (y[:n], g[layout.place("T").start + k], g[layout.place("p")], g[own])
            by_t = np.array(leap.function.call(given)[7])[:, 0]
            right = right + g[own] @ by_t
            shared[0, own] -= by_t
        shared[:, place] += 1.0
        return Rows(-rows.here, None, shared, right - at.shared[place])

    def _final(self, at: Unknowns) -> Rows:
        """Everything that holds at the ends."""
        layout, g, n = self.layout, at.shared, self.layout.states
        last, phase = at.phases[-1].nodes[-1], len(self.laws) - 1
        energy = self._rows(at, self.hamiltonians[phase], phase, False)
        hf, times = -energy.right[0], layout.place("T")
        parts = [
            g[layout.place("x0")],
            g[layout.place("l0")],
            last,
            g[[times.start, times.stop - 1]],
        ]
        parts += [g[layout.place(name)] for name in ("p", "nu", "omega")]
        e = np.concatenate([*parts, g[[layout.place("e").start]], [hf]])
        value, by_e = (np.array(v) for v in self.ends.function(e))
        here, shared = np.zeros((len(value), self.size)), np.zeros((len(value), layout.count))
        at_column = 0
        for name in ("x0", "l0"):
            shared[:, layout.place(name)] += by_e[:, at_column : at_column + n]
            at_column += n
        here += by_e[:, at_column : at_column + self.size]
        at_column += self.size
        for place in (times.start, times.stop - 1):
            shared[:, place] += by_e[:, at_column]
            at_column += 1
        for name in ("p", "nu", "omega"):
            own = layout.place(name)
            shared[:, own] += by_e[:, at_column : at_column + own.stop - own.start]
            at_column += own.stop - own.start
        shared[:, layout.place("e").start] += by_e[:, at_column]
        here += by_e[:, [at_column + 1]] * energy.here
        shared += by_e[:, [at_column + 1]] * energy.shared
        right = -value[:, 0]
        self._pointed(g, shared, right)
        return Rows(here, None, shared, right)

    def _pointed(self, g: Array, shared: Array, right: Array) -> None:
        """Add what point constraints do to the conditions of free times."""
        first, n = self.layout.place("e").start + 1, self.layout.states
        for j, (_, which) in enumerate(self.structure.points):
            f = self.setting.system.model.constraints.point[which].at or 0.0
            step = g[first + 2 * j] - g[first + 1 + 2 * j]
            for row, time, share in (
                (2 * n, self.ends.initial_time, 1 - f),
                (2 * n + 1, self.ends.final_time, f),
            ):
                if np.isnan(time):
                    right[row] -= share * step
                    shared[row, first + 2 * j] += share
                    shared[row, first + 1 + 2 * j] -= share

    def _point_rows(self, at: Unknowns, k: int, leap: Leap) -> list[Rows]:
        """Return the rows of point constraints at junction k: values or multipliers, the time."""
        which = next((p for j, p in self.structure.points if j == k), None)
        if which is None:
            return []
        layout, g, n = self.layout, at.shared, self.layout.states
        f = self.setting.system.model.constraints.point[which].at or 0.0
        times = layout.place("T")
        time = np.zeros((1, layout.count))
        time[0, times.start + k] = 1.0
        time[0, times.start] -= 1 - f
        time[0, times.stop - 1] -= f
        found = [Rows(np.zeros((1, self.size)), None, time, -(time @ g))]
        own = slice(
            layout.place("pi").start + leap.multipliers.start,
            layout.place("pi").start + leap.multipliers.stop,
        )
        given = (at.phases[k].nodes[0][:n], g[times.start + k], g[layout.place("p")], g[own])
        values, by_x, by_t, by_p = (np.array(v) for v in leap.function.call(given)[5:9])
        bounds, at_row = self.ends.points[which], 0
        for jump in leap.jumps:
            for i in range(jump.values.numel()):
                row = at_row + i
                here, shared = np.zeros((1, self.size)), np.zeros((1, layout.count))
                right = np.zeros(1)
                if jump.point is not None and np.isnan(bounds[i]):
                    shared[0, own.start + row] = 1.0
                    right[0] = -g[own.start + row]
                elif jump.point is not None:
                    here[0, :n], shared[0, times.start + k] = by_x[row], by_t[row, 0]
                    shared[0, layout.place("p")] = by_p[row]
                    right[0] = bounds[i] - values[row, 0]
                else:
                    continue
                found.append(Rows(here, None, shared, right))
            at_row += jump.values.numel()
        return found


def _leap(setting: Setting, own: list[Jump]) -> ca.Function:
    import casadi as ca

    m, k = setting.system.model, setting.system.constants
    stacked = ca.vertcat(*(jump.values for jump in own))
    multipliers = ca.SX.sym("m", stacked.numel())
    total = ca.dot(multipliers, stacked)
    value = ca.vertcat(ca.gradient(total, m.x), ca.gradient(total, m.p))
    symbols = [m.x, m.t, m.p, multipliers]
    outputs = [value, *(ca.jacobian(value, s) for s in symbols)]
    outputs += [stacked, *(ca.jacobian(stacked, s) for s in symbols[:3])]
    whole = ca.Function("leap", [*symbols, k.symbols], [ca.densify(v) for v in outputs])
    return ca.Function("leap", symbols, whole.call([*symbols, ca.SX(k.values)]))
