"""What holds at the junctions of a structure, and where singular arcs and constraint arcs start.

    bound to bound                    H(u⁻) = H(u⁺)
    free (regular) to or from a bound H_u = 0 at the bound
    singular arc                      σ = σ' = … = 0 where it starts, all derivatives without u
    mixed constraint, regular control η = 0 on the side where it is held
      from or to a bound              C(x, bound) = 0; with the bound opposite, H_u = 0
    state constraint of order q       S = … = S^(q−1) = 0 where it begins, with
                                      λ⁺ = λ⁻ − Σ π_i ∇S^(i) and H(λ⁻, u⁻) = H(λ⁻, u⁺): C = 0 before
                                      of a regular control, which is continuous, H_u = 0 of one that
                                      H is affine in; η = 0 where it ends
    touch of a state constraint       S = S' = 0, λ⁺ = λ⁻ − π ∇S
    point constraint                  c = its bound, λ⁺ = λ⁻ − Σ ρ ∇c; its time is known
    break (formulas of time jump)     its time is known

(A. E. Bryson and Y.-C. Ho, Applied Optimal Control, 1975, sections 3.7 to 3.13; H. Maurer, SIAM J.
Control Optim. 15, 1977.) The time of a junction that has no condition, such as the end of a
singular arc, follows from the conditions elsewhere.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from quito_cli.optimality.polish.equations.setting import Setting, UnsupportedError
from quito_cli.optimality.polish.equations.structure import Held, Phase, Structure

if TYPE_CHECKING:
    import casadi as ca

Side = Literal["before", "after"]


@dataclass(frozen=True, eq=False)
class Condition:
    """Expressions of Pontryagin's arguments that vanish beside a junction."""

    what: str
    """For a reader."""
    side: Side
    """Which phase's law it is evaluated with."""
    value: ca.SX
    """(rows, 1)."""


@dataclass(frozen=True, eq=False)
class Jump:
    """λ⁺ = λ⁻ − `gradients` · multipliers at a junction."""

    held: Held | None
    """The state constraint; None of a point constraint."""
    point: int | None
    values: ca.SX
    """(count, 1): what multiplies; S, S', … or the rows of the point constraint."""

    @property
    def count(self) -> int:
        """How many multipliers it has."""
        return int(self.values.numel())


def conditions(setting: Setting, structure: Structure, k: int) -> list[Condition]:
    """Return what vanishes at junction k, 0 … number of phases."""
    if k == len(structure.phases):
        return []
    after = structure.phases[k]
    if k == 0:
        return list(_starts(setting, None, after))
    before = structure.phases[k - 1]
    found = [*_starts(setting, before, after)]
    if not structure.known(k):
        found += _switches(setting, before, after)
        for held in sorted(after.held - before.held):
            found += _begun(setting, held, before, after)
        for held in sorted(before.held - after.held):
            found += _ended(setting, held, before, after)
    for at, held in structure.touches:
        if at == k:
            found.append(_touched(setting, held))
    return found


def jumps(setting: Setting, structure: Structure, k: int) -> list[Jump]:
    """Return what the costate may jump by at junction k."""
    import casadi as ca

    before = structure.phases[k - 1].held if k else frozenset()
    after = structure.phases[k].held if k < len(structure.phases) else frozenset()
    found = []
    for held in sorted(after - before):
        known = setting.active(held)
        if known.order and not (k == 0 and setting.system.model.initial.fixed.all()):
            found.append(Jump(held, None, ca.vertcat(*known.derivatives)))
    for at, held in structure.touches:
        if at == k:
            found.append(Jump(held, None, setting.active(held).derivatives[0]))
    for at, point in structure.points:
        if at == k:
            value = setting.system.model.constraints.point[point].value
            if ca.depends_on(value, setting.system.model.u):
                raise UnsupportedError("a point constraint speaks of a control")
            found.append(Jump(None, point, value))
    return found


def _starts(setting: Setting, before: Phase | None, after: Phase) -> Iterator[Condition]:
    """Give what vanishes where singular arcs and arcs on state constraints start."""
    import casadi as ca

    arc = setting.singular(after)
    if arc is not None:
        for i, own in zip(arc.controls, arc.derivatives, strict=True):
            if own and (before is None or before.kinds[i] != "singular"):
                what = f"dH/d{setting.name(i)} and its derivatives where it is singular"
                yield Condition(what, "after", ca.vertcat(*own))
    for held in sorted(after.held - (before.held if before else frozenset())):
        known = setting.active(held)
        fixed = before is None and setting.system.model.initial.fixed.all()
        if known.order and not fixed:
            what = f"{setting.system.rows[held[0]].label} where it becomes active"
            yield Condition(what, "after", ca.vertcat(*known.derivatives))


def _switches(setting: Setting, before: Phase, after: Phase) -> Iterator[Condition]:
    """Give what vanishes where controls leave a bound, or come to one, by themselves."""
    changed = before.held ^ after.held
    spoken = {i for held in changed for i in setting.active(held).controls}
    ends = ("lower", "upper")
    for i, (a, b) in enumerate(zip(before.kinds, after.kinds, strict=True)):
        if a == b or (i in spoken and "free" in (a, b)):
            continue
        if a in ends and b in ends:
            yield Condition(
                f"H where {setting.name(i)} switches", "before", _difference(setting, i)
            )
        elif "free" in (a, b) and (a in ends or b in ends):
            side: Side = "before" if a in ends else "after"
            what = f"dH/d{setting.name(i)} where it meets its bound"
            yield Condition(what, side, _slope(setting, before if a in ends else after, i))


def _difference(setting: Setting, i: int) -> ca.SX:
    """Return (H(upper) − H(lower)) / (upper − lower): of an affine control H_u."""
    import casadi as ca

    m = setting.system.model
    if setting.controls.kinds[i] == "affine":
        return setting.system.switching[i]
    low, high = (float(side[i]) for side in m.control_bounds)
    pair = [ca.substitute(setting.system.hamiltonian, m.u[i], ca.SX(v)) for v in (low, high)]
    return (pair[1] - pair[0]) / (high - low)


def _slope(setting: Setting, phase: Phase, i: int) -> ca.SX:
    """Return (H + ηᵀC)_u of the rows that a phase holds."""
    import casadi as ca

    value = setting.system.switching[i]
    for held in sorted(phase.held):
        value += setting.system.multipliers[held[0]] * ca.gradient(
            setting.active(held).held, setting.system.model.u[i]
        )
    return value


def _begun(setting: Setting, held: Held, before: Phase, after: Phase) -> Iterator[Condition]:
    """Give the condition that the time has at which a row begins to be held."""
    yield from _ruled(setting, held, before, after, "before")


def _ended(setting: Setting, held: Held, before: Phase, after: Phase) -> Iterator[Condition]:
    """Give the condition that the time has at which a row ends to be held."""
    yield from _ruled(setting, held, after, before, "after")


def _ruled(setting: Setting, held: Held, off: Phase, on: Phase, side: Side) -> Iterator[Condition]:
    """Give the condition between a phase without a row, on `side`, and one with it.

    The control that is the row's on the one side tells by what it is on the other.
    """
    known, label = setting.active(held), setting.system.rows[held[0]].label
    other: Side = "after" if side == "before" else "before"
    regular = set(setting.controls.of_kind("regular"))
    involved = [i for i in known.controls if on.kinds[i] == "free"]
    changed = [i for i in involved if off.kinds[i] != "free"]
    multiplier = Condition(f"multiplier of {label}", other, setting.system.multipliers[held[0]])
    begins_on_state = bool(known.order) and side == "before"
    if changed:
        i = changed[0]
        if off.kinds[i] == "singular":
            return
        if i not in regular and known.order:
            slope = Condition(f"dH/d{setting.name(i)} at {label}", side, _slope(setting, off, i))
            yield slope if begins_on_state else multiplier
        elif _same_side(setting, held, i, off.kinds[i] == "upper"):
            yield Condition(f"{label} at the bound of {setting.name(i)}", side, known.held)
        else:
            yield Condition(f"dH/d{setting.name(i)} at {label}", side, _slope(setting, off, i))
    elif begins_on_state and any(i in regular for i in involved):
        yield Condition(f"{label} before it becomes active", side, known.held)
    else:
        yield multiplier


def _same_side(setting: Setting, held: Held, i: int, at_upper: bool) -> bool:
    """Whether a row limits a control on the side of its bound; of a state constraint it may not."""
    import numpy as np

    known = setting.active(held)
    if known.order:
        return True
    values, _ = setting.probe.sizes(known.slope[i])
    pushes_down = bool(np.nanmedian(values) > 0) == held[1]
    return pushes_down == at_upper


def _touched(setting: Setting, held: Held) -> Condition:
    """Return S = S' = 0 of a state constraint of order two or more."""
    import casadi as ca

    known = setting.active(held)
    label = setting.system.rows[held[0]].label
    return Condition(f"{label} where it is touched", "after", ca.vertcat(*known.derivatives[:2]))
