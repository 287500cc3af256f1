"""What a polish knows of a problem before any structure: Pontryagin's system and its parts.

Everything symbolic is derived here once, and kept: how each control enters H, what each row says
where it is active, which feedback singular controls follow.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.constraints import Active, active
from quito_cli.optimality.hamiltonian import Pontryagin, sampled
from quito_cli.optimality.looking.breaks import breaks
from quito_cli.optimality.looking.controls import Controls, controls
from quito_cli.optimality.polish.equations.law import Law
from quito_cli.optimality.singular import Singular, singular
from quito_cli.optimality.symbols.probes import MOST_OPERATIONS, Probe
from quito_cli.solution.kinks import corners

if TYPE_CHECKING:
    import casadi as ca

    from quito_cli.optimality.polish.equations.structure import Held, Phase
    from quito_cli.solution.solution import Solution

Array = NDArray[np.float64]


MOST_BREAKS = 40
"""Known times at which formulas jump that are taken on as junctions."""


class UnsupportedError(Exception):
    """Why a structure cannot be polished, in a sentence."""


@dataclass(frozen=True, eq=False)
class Corners:
    """Where formulas of a problem may jump, as functions of Pontryagin's arguments."""

    arguments: ca.Function
    """What is zero there, (corners, 1)."""
    formulas: ca.Function
    """Integrands, x' and rows."""


@dataclass(frozen=True, eq=False)
class Setting:
    """Pontryagin's system of a problem, with its parts."""

    system: Pontryagin

    @cached_property
    def probe(self) -> Probe:
        """Random points."""
        return Probe(self.system)

    @cached_property
    def controls(self) -> Controls:
        """How each control enters H."""
        return controls(self.system, self.probe)

    def first_row_arc(self, direct: Solution) -> int:
        """Return where the arcs of rows begin in an answer: they follow those of the controls."""
        names = {label for v in self.system.model.controls for label in v.labels}
        arcs = direct.arcs
        count = 0
        while count < len(arcs) and arcs[count].of in names:
            count += 1
        return count

    @cached_property
    def row_function(self) -> ca.Function:
        """Arguments ↦ values of all rows."""
        import casadi as ca

        stacked = ca.vertcat(*(row.value for row in self.system.rows))
        return self.system.function("rows", [ca.densify(stacked)])

    def rows(self, t: Array, x: Array, u: Array, p: Array) -> Array:
        """Return values of rows, (points, rows)."""
        if not self.system.rows:
            return np.zeros((len(t), 0))
        return sampled(self.row_function, (t, x, np.zeros_like(x), u, p, None, None))[0]

    @cached_property
    def breaks(self) -> Callable[[float, float], tuple[float, ...]]:
        """Known times, between an initial and a final one, at which formulas jump.

        Raises:
            UnsupportedError: there are too many.
        """
        return cache(self._breaks)

    def _breaks(self, start: float, end: float) -> tuple[float, ...]:
        found = breaks(self.system, self.probe, start, end)
        if len(found) > MOST_BREAKS:
            raise UnsupportedError(
                f"formulas jump, or have kinks, at {len(found)} known times: each is a junction, "
                f"and more than {MOST_BREAKS} are not taken on; a smooth table (method: cubic) has "
                "none"
            )
        return found

    @cached_property
    def corners(self) -> Corners | None:
        """Corners of the problem's formulas that are not of time alone; None where there are none.

        None, too, of formulas that are too long to be worked on.
        """
        import casadi as ca

        system, m = self.system, self.system.model
        integrands = [c.value for c in m.constraints.integral]
        given = [m.lagrange, m.xdot, *integrands, *(row.value for row in system.rows)]
        formulas = system.function("formulas", [ca.densify(ca.vertcat(*given))])
        if formulas.n_instructions() > MOST_OPERATIONS:
            return None
        inputs = formulas.sx_in()
        others = ca.vertcat(*inputs[:4])
        own = [value for _, value in corners(formulas) if ca.depends_on(value, others)]
        if not own:
            return None
        return Corners(ca.Function("corners", inputs, [ca.vertcat(*own)]), formulas)

    @cached_property
    def active(self) -> Callable[[Held], Active]:
        """What holds where a row is at a bound."""
        return cache(lambda held: active(self.system, self.probe, held[0], upper=held[1]))

    @cached_property
    def law(self) -> Callable[[Phase], Law]:
        """The law of a phase: equal phases of all structures share it."""
        return cache(lambda phase: Law(self, phase))

    @cached_property
    def singular(self) -> Callable[[Phase], Singular | None]:
        """The feedback of a phase's singular controls; None where there are none.

        Raises:
            UnsupportedError: there is no feedback.
        """
        return cache(self._singular)

    def _singular(self, phase: Phase) -> Singular | None:
        which = tuple(i for i, kind in enumerate(phase.kinds) if kind == "singular")
        if not which:
            return None
        interior = tuple(i for i, kind in enumerate(phase.kinds) if kind == "free")
        held = tuple(self.active(h) for h in sorted(phase.held))
        found = singular(self.system, self.probe, which, interior, held)
        if found.coefficient is None:
            names = ", ".join(self.name(i) for i in which)
            raise UnsupportedError(
                f"{names} has no singular feedback: {found.reason or 'none was found'}"
            )
        return found

    def name(self, i: int) -> str:
        """Return the label of a control."""
        return [label for v in self.system.model.controls for label in v.labels][i]

    def consistent(self, phase: Phase) -> Phase:
        """Return a phase in which every free control has what determines it.

        A row whose controls are all at bounds is not held by any of them, and says nothing. A
        control that H is affine in is free only where a row takes it; else it is singular. There is
        nothing at a bound that is infinite.

        Raises:
            UnsupportedError: a control is between its bounds and nothing determines it.
        """
        kinds, affine = list(phase.kinds), set(self.controls.of_kind("affine"))
        for kind, bound in zip(("lower", "upper"), self.system.model.control_bounds, strict=True):
            kinds = [
                "free" if own == kind and np.isinf(value) else own
                for own, value in zip(kinds, bound, strict=True)
            ]
        for i in (*self.controls.of_kind("kinked"), *self.controls.of_kind("absent")):
            if kinds[i] in ("free", "singular"):
                kinked = self.controls.kinds[i] == "kinked"
                why = "has a jump in it, or a kink that moves" if kinked else "is without it"
                raise UnsupportedError(
                    f"{self.name(i)} is between its bounds where the Hamiltonian {why}"
                )
        between = {i for i, kind in enumerate(kinds) if kind in ("free", "singular")}
        taken = self._taken(phase, between, affine)
        for i in between & affine:
            kinds[i] = "free" if i in taken.values() else "singular"
        for i in between - affine:
            kinds[i] = "free"
        return replace(phase, kinds=tuple(kinds), held=frozenset(taken))

    def _taken(self, phase: Phase, between: set[int], affine: set[int]) -> dict[Held, int]:
        """Return which control each row determines, by row; what it can of none is left out."""
        taken: dict[Held, int] = {}
        # Those that speak of the fewest controls choose first.
        for row in sorted(phase.held, key=lambda h: (len(self.active(h).controls), h)):
            known = self.active(row)
            if known.order is None:
                continue
            candidates = sorted(
                (i for i in known.controls if i in between - set(taken.values())),
                key=lambda i: (i not in affine, i),
            )
            if candidates:
                taken[row] = candidates[0]
        return taken
