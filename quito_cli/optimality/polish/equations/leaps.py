"""What the costate and H jump by at a junction: multipliers m times the gradients of S.

    λ⁺ = λ⁻ − Σ m S_x,    w_p⁺ = w_p⁻ + Σ m S_p,    H⁺ = H⁻ + Σ m S_t,

with S the state constraint and its derivatives where one becomes active, the constraint alone
where it is touched, and the rows of a point constraint (A. E. Bryson and Y.-C. Ho, Applied Optimal
Control, 1975, sections 3.5 and 3.11).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.hamiltonian import Pontryagin
from quito_cli.optimality.polish.equations.junctions import Jump, jumps
from quito_cli.optimality.polish.equations.setting import Setting
from quito_cli.optimality.polish.equations.structure import Structure
from quito_cli.optimality.polish.equations.unknowns import Layout

if TYPE_CHECKING:
    import casadi as ca

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Pull:
    """Gradients of Σ m S, and their derivatives in x, t, p, m."""

    value: Array
    """(n_x + n_p + 1,): in x, in p, in t."""
    by_x: Array
    by_t: Array
    by_p: Array
    by_m: Array


@dataclass(frozen=True, eq=False)
class Values:
    """S, (rows,), and its derivatives, (rows, …)."""

    value: Array
    by_x: Array
    by_t: Array
    by_p: Array


@dataclass(frozen=True, eq=False)
class Leap:
    """All that jumps at a junction."""

    system: Pontryagin
    junction: int
    jumps: tuple[Jump, ...]
    first: int
    """Of its multipliers in those of all jumps."""

    @property
    def count(self) -> int:
        """How many multipliers it has."""
        return sum(jump.count for jump in self.jumps)

    def place(self, layout: Layout) -> slice:
        """Return where its multipliers are in g."""
        start = layout.place("jumps").start + self.first
        return slice(start, start + self.count)

    def parts(self, layout: Layout) -> Iterator[tuple[Jump, slice]]:
        """Give every jump with where its multipliers are in g."""
        at = self.place(layout).start
        for jump in self.jumps:
            yield jump, slice(at, at + jump.count)
            at += jump.count

    @cached_property
    def _stacked(self) -> ca.SX:
        import casadi as ca

        return ca.vertcat(*(jump.values for jump in self.jumps))

    @cached_property
    def _pull(self) -> ca.Function:
        import casadi as ca

        m, multipliers = self.system.model, ca.SX.sym("m", self.count)
        total = ca.dot(multipliers, self._stacked)
        value = ca.vertcat(*(ca.gradient(total, s) for s in (m.x, m.p, m.t)))
        symbols = [m.x, m.t, m.p, multipliers]
        return self._function(symbols, [value, *(ca.jacobian(value, s) for s in symbols)])

    @cached_property
    def _values(self) -> ca.Function:
        import casadi as ca

        m, value = self.system.model, self._stacked
        symbols = [m.x, m.t, m.p]
        return self._function(symbols, [value, *(ca.jacobian(value, s) for s in symbols)])

    def _function(self, symbols: list[ca.SX], outputs: list[ca.SX]) -> ca.Function:
        import casadi as ca

        k = self.system.constants
        whole = ca.Function("leap", [*symbols, k.symbols], [ca.densify(v) for v in outputs])
        return ca.Function("leap", symbols, whole.call([*symbols, ca.SX(k.values)]))

    def pull(self, x: Array, g: Array, layout: Layout) -> Pull:
        """Return the gradients of Σ m S at a state."""
        time, p = g[layout.time(self.junction)], g[layout.place("parameters")]
        found = [np.array(v) for v in self._pull(x, time, p, g[self.place(layout)])]
        return Pull(found[0][:, 0], *found[1:])

    def values(self, x: Array, g: Array, layout: Layout) -> Values:
        """Return S at a state."""
        time, p = g[layout.time(self.junction)], g[layout.place("parameters")]
        found = [np.array(v) for v in self._values(x, time, p)]
        return Values(found[0][:, 0], *found[1:])


def leaps(setting: Setting, structure: Structure) -> tuple[Leap | None, ...]:
    """Return what jumps by junction, 0 … phases; None where nothing does."""
    found: list[Leap | None] = []
    first = 0
    for k in range(len(structure.phases) + 1):
        own = jumps(setting, structure, k)
        leap = Leap(setting.system, k, tuple(own), first) if own else None
        found.append(leap)
        first += leap.count if leap else 0
    return tuple(found)
