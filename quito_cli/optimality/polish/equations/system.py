"""The boundary value problem of a structure: its laws, its conditions, its unknowns.

`assembly` says it about a point, as a chain of linear equations.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.looking.breaks import OFF
from quito_cli.optimality.polish.equations.ends import Ends
from quito_cli.optimality.polish.equations.gauss import Gauss
from quito_cli.optimality.polish.equations.junctions import conditions
from quito_cli.optimality.polish.equations.law import Law
from quito_cli.optimality.polish.equations.leaps import Leap, leaps
from quito_cli.optimality.polish.equations.setting import Setting
from quito_cli.optimality.polish.equations.structure import Structure
from quito_cli.optimality.polish.equations.unknowns import Layout

if TYPE_CHECKING:
    import casadi as ca

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Placed:
    """What vanishes at an end of a phase, by the law of that phase."""

    function: ca.Function
    """(v, z) ↦ value, derivatives in v, in z."""
    phase: int
    at_start: bool
    """Of its phase; else at its end."""


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
        return tuple(self.setting.law(phase) for phase in self.structure.phases)

    @cached_property
    def leaps(self) -> tuple[Leap | None, ...]:
        """By junction, 0 … phases."""
        return leaps(self.setting, self.structure)

    @cached_property
    def placed(self) -> tuple[Placed, ...]:
        """All conditions at junctions."""
        found = []
        for k in range(len(self.structure.phases)):
            for given in conditions(self.setting, self.structure, k):
                phase = k if given.side == "after" else k - 1
                function = self.laws[phase].compiled("condition", given.value)
                found.append(Placed(function, phase, given.side == "after"))
        return tuple(found)

    @cached_property
    def instants(self) -> tuple[tuple[int, float], ...]:
        """Junctions where point constraints are, and at which part of the horizon; each once."""
        given = self.setting.system.model.constraints.point
        parts = {k: given[which].at or 0.0 for k, which in self.structure.points}
        return tuple(sorted(parts.items()))

    def inside(self, phase: int, t: Array) -> Array:
        """Return times of a phase, those at breaks beside them, where formulas are its own."""
        at = dict(self.structure.breaks)
        low, high = at.get(phase, -np.inf), at.get(phase + 1, np.inf)
        off = OFF * max(abs(time) for time in self.structure.times)
        return np.asarray(np.clip(t, low + off, high - off))

    def as_given(self, shared: Array) -> Array:
        """Return g with the times that the problem fixes at their values to the last digit."""
        found, times = shared.copy(), self.layout.place("times")
        fixed = (self.ends.initial_time, self.ends.final_time)
        for place, value in zip((times.start, times.stop - 1), fixed, strict=True):
            if np.isfinite(value):
                found[place] = value
        return found

    @cached_property
    def layout(self) -> Layout:
        """Where the shared unknowns are."""
        system = self.setting.system
        return Layout(
            system.model.n_x,
            len(self.structure.times),
            system.model.n_p,
            system.integrals,
            len(self.ends.boundary),
            sum(leap.count for leap in self.leaps if leap),
            1 + 2 * len(self.instants),
        )
