"""The singular feedback in the state alone: costates eliminated by what is zero on the arc.

On a singular arc σ = σ' = … = 0, equations linear in λ,

    M(x, t) λ + b(x, t) = 0.

Gauss eliminates a costate by each row. Where all others are multiples of the last costate, and so
is a row, its coefficient is a condition on the state: were that costate zero, so would all be. It
is the singular surface; the control keeps the state on it. What remains of λ often cancels in
u = −B/A: where the cost is a Mayer one all rows are homogeneous in λ, and its length goes out of
the quotient. Where time is free and H is therefore known, this is a further row.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.hamiltonian import Pontryagin
from quito_cli.optimality.singular import Singular
from quito_cli.optimality.symbols.probes import Probe, TooLargeError

if TYPE_CHECKING:
    import casadi as ca


@dataclass(frozen=True, eq=False)
class Eliminated:
    """A singular arc with the costates eliminated that its conditions determine."""

    system: Pontryagin
    costates: dict[int, ca.SX]
    """Entries of λ, in terms of x, u, p, t and the entries that are not here."""
    surface: ca.SX | None
    """Zero on the arc: a condition on the state, where there is one."""
    feedback: ca.SX
    """The singular controls, (controls, 1)."""
    clebsch: ca.SX | None
    """(−1)^q A, as of the arc, with the same costates eliminated."""
    left: tuple[int, ...]
    """Entries of λ that the feedback still depends on; none where the state determines it."""

    @cached_property
    def function(self) -> ca.Function:
        """Pontryagin's arguments ↦ the feedback; of λ only `left` is read."""
        return self.system.function("feedback", [self.feedback])


def eliminated(arc: Singular, probe: Probe) -> Eliminated | None:
    """Return the arc's feedback with costates eliminated; None where there is no feedback.

    Of several singular controls the others' values do not enter the rows, by their conditions.
    """
    feedback = arc.feedback
    if feedback is None:
        return None
    system = arc.system
    rows = [value for found in arc.derivatives for value in found]
    try:
        costates, surface = _gauss(system, probe, rows)
        if _degenerate(arc, probe, costates):
            costates, surface = {}, None
        found = _substituted(arc, probe, feedback, costates, surface)
        known = known_hamiltonian(system)
        one_left = len(costates) == system.model.n_x - 1
        if known is not None and (found.left or one_left) and surface is None:
            row = _without(system.hamiltonian - known, system.model.u[list(arc.controls)])
            costates, surface = _gauss(system, probe, [*rows, row])
            if not _degenerate(arc, probe, costates):
                found = _substituted(arc, probe, feedback, costates, surface)
    except TooLargeError:
        left = _depends(system, probe, feedback)
        return Eliminated(system, {}, None, feedback, arc.clebsch, left)
    return found


def known_hamiltonian(system: Pontryagin) -> float | None:
    """Return the constant that H is along any extremal, where the problem says so.

    It does where nothing depends on time, one end of the horizon is free and no boundary constraint
    speaks of it, and the Mayer cost is at most affine in it: H(t_f) = −∂M/∂t_f.
    """
    import casadi as ca

    m = system.model
    rows = ca.vertcat(*(row.value for row in system.rows))
    if ca.depends_on(ca.vertcat(system.hamiltonian, rows), m.t) or m.constraints.point:
        return None
    ends, boundary = m.ends, ca.vertcat(*(c.value for c in m.constraints.boundary))
    for instant, time, sign in ((m.final_time, ends.tf, -1), (m.initial_time, ends.t0, 1)):
        slope = sign * ca.jacobian(m.mayer, time)
        spoken_of = boundary.numel() and ca.depends_on(boundary, time)
        if not instant.fixed and slope.is_constant() and not spoken_of:
            return float(ca.DM(slope))
    return None


def _without(row: ca.SX, controls: ca.SX) -> ca.SX:
    """Leave out controls whose coefficient is zero on the arc."""
    import casadi as ca

    return ca.substitute(row, controls, ca.SX.zeros(*controls.shape))


def _gauss(
    system: Pontryagin, probe: Probe, rows: list[ca.SX]
) -> tuple[dict[int, ca.SX], ca.SX | None]:
    """Return costates in terms of the others, and the condition on the state that may be left."""
    import casadi as ca

    found: dict[int, ca.SX] = {}
    for given in rows:
        row = _replaced(system, given, found)
        slopes = ca.densify(ca.jacobian(row, system.costate))
        if ca.depends_on(slopes, system.costate):
            continue
        there = np.flatnonzero(~probe.zeros(slopes))
        offset = ca.substitute(row, system.costate, ca.SX.zeros(system.model.n_x))
        alone = probe.vanishes(offset)
        if not there.size:
            if not alone:
                return found, offset
            continue
        last = there.size == 1 and len(found) == system.model.n_x - 1
        if last and alone and _homogeneous(system, probe, found):
            return found, slopes[int(there[0])]
        i = _pivot(slopes, there)
        others = [j for j in there.tolist() if j != i]
        rest = sum((slopes[j] * system.costate[j] for j in others), ca.SX(0))
        rest = rest if alone else rest + offset
        solved = -rest / slopes[i]
        found = {
            j: ca.substitute(value, system.costate[i], solved) for j, value in found.items()
        } | {i: solved}
    return found, None


def _degenerate(arc: Singular, probe: Probe, costates: dict[int, ca.SX]) -> bool:
    """Whether the conditions leave nothing of A: then they hold together on a surface at most."""
    import casadi as ca

    if arc.coefficient is None:
        return True
    determinant = _replaced(arc.system, ca.det(arc.coefficient), costates)
    values, _ = probe.sizes(determinant)
    return not np.isfinite(values).any() or probe.vanishes(determinant)


def _homogeneous(system: Pontryagin, probe: Probe, found: dict[int, ca.SX]) -> bool:
    """Whether all costates found so far are proportional to those left."""
    import casadi as ca

    none = ca.SX.zeros(system.model.n_x)
    return all(
        probe.vanishes(ca.substitute(value, system.costate, none)) for value in found.values()
    )


def _pivot(slopes: ca.SX, there: NDArray[np.int_]) -> int:
    """Choose a number if there is one, else the coefficient of the fewest operations."""
    import casadi as ca

    def cost(i: int) -> tuple[bool, int]:
        entry = slopes[i]
        length = ca.Function("length", [ca.vertcat(*ca.symvar(entry))], [entry]).n_instructions()
        return not entry.is_constant(), int(length)

    return int(min(there.tolist(), key=cost))


def _replaced(system: Pontryagin, value: ca.SX, costates: dict[int, ca.SX]) -> ca.SX:
    import casadi as ca

    if not costates:
        return value
    symbols = ca.vertcat(*(system.costate[i] for i in costates))
    return ca.substitute(value, symbols, ca.vertcat(*costates.values()))


def _substituted(
    arc: Singular,
    probe: Probe,
    feedback: ca.SX,
    costates: dict[int, ca.SX],
    surface: ca.SX | None,
) -> Eliminated:
    """Put the costates into the feedback; what cancels in it is set to one."""
    import casadi as ca

    system = arc.system
    value = _replaced(system, feedback, costates)
    left = _depends(system, probe, value)
    cancelled = [i for i in range(system.model.n_x) if i not in costates and i not in left]
    if cancelled:
        value = ca.substitute(value, system.costate[cancelled], ca.SX.ones(len(cancelled)))
    clebsch = None if arc.clebsch is None else _replaced(system, arc.clebsch, costates)
    return Eliminated(system, costates, surface, value, clebsch, left)


def _depends(system: Pontryagin, probe: Probe, value: ca.SX) -> tuple[int, ...]:
    import casadi as ca

    if not ca.depends_on(value, system.costate):
        return ()
    zeros = probe.zeros(ca.jacobian(value, system.costate)).all(axis=0)
    return tuple(int(i) for i in np.flatnonzero(~zeros))
