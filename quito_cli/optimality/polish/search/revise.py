"""The next structure to try: arcs that have no length dropped, arcs that are missing inserted.

What each fault asks for is one row of a table. A fault says from when to when an inequality does
not hold; there a phase of its own is cut out, and does what the inequality asks for. Where that is
what the neighbouring phase does already, the two become one: with nothing else changed but when a
junction is, it is the structure that was solved, and there is none to try.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from quito_cli.optimality.polish.equations.setting import Setting, UnsupportedError
from quito_cli.optimality.polish.equations.structure import Held, Kind, Phase, Structure
from quito_cli.optimality.polish.faults.fault import Fault, What
from quito_cli.solution.polishing import Action

ADJACENT = 1e-6
"""Part of the horizon by which a fault may begin after a junction, and still begin at it."""
BRIEF = 0.01
"""Part of the horizon that an arc before a singular one is to start with."""
CROSSED = -1e-9
"""Part of the horizon that the length of an arc is below, where its junctions are in the wrong
order; nearer to nothing they are one."""


@dataclass(frozen=True)
class Revision:
    """A structure to try, and why."""

    structure: Structure
    action: Action
    sentence: str


def revised(setting: Setting, structure: Structure, fault: Fault) -> Revision | None:
    """Return the structure that a fault asks for; None where nothing is known to help.

    Args:
        setting: the problem.
        structure: with the times that were found.
        fault: the one to mend.
    """
    mend = _MENDS.get(fault.what)
    found = None if mend is None else mend(setting, structure, fault)
    if found is None:
        return None
    phases = tuple(setting.consistent(phase) for phase in found.structure.phases)
    whole = replace(found.structure, phases=phases).merged()
    if whole.phases == structure.phases and whole.touches == structure.touches:
        return None
    return replace(found, structure=whole)


def dropped(structure: Structure, k: int) -> Structure:
    """Return a structure without phase k: its neighbours meet in its middle.

    Where the junctions on either side are changes of different controls that were met in the wrong
    order, they are put in the other order instead.
    """
    if len(structure.phases) == 1:
        return structure
    return _swapped(structure, k) or _without(structure, k)


def _without(structure: Structure, k: int) -> Structure:
    """Return a structure of several phases without phase k."""
    last = len(structure.phases) - 1
    ends = [at for at in (k, k + 1) if 0 < at <= last]
    if all(structure.known(at) for at in ends):  # the junctions stay, the neighbour goes on
        beside = structure.phases[k - 1 if k else 1]
        return replace(
            structure, phases=(*structure.phases[:k], beside, *structure.phases[k + 1 :])
        )
    if k == 0:
        return structure.without(1, structure.phases[1:])
    if k == last:
        return structure.without(last, structure.phases[:-1])
    if structure.named(k + 1):
        return structure.without(k, structure.phases[:k] + structure.phases[k + 1 :])
    middle = (structure.times[k] + structure.times[k + 1]) / 2
    if structure.named(k):
        middle = structure.times[k]
    times = (*structure.times[:k], middle, *structure.times[k + 1 :])
    moved = replace(structure, times=times)
    return moved.without(k + 1, structure.phases[:k] + structure.phases[k + 1 :])


def _swapped(structure: Structure, k: int) -> Structure | None:
    """Return phase k with what changes before it and after it in the other order."""
    if not 0 < k < len(structure.phases) - 1:
        return None
    a, b, c = structure.phases[k - 1 : k + 2]
    first = {i for i in range(len(a.kinds)) if a.kinds[i] != b.kinds[i]}
    second = {i for i in range(len(a.kinds)) if b.kinds[i] != c.kinds[i]}
    rows_first, rows_second = a.held ^ b.held, b.held ^ c.held
    crossed = CROSSED * (structure.times[-1] - structure.times[0])
    length = structure.times[k + 1] - structure.times[k]
    if first & second or rows_first & rows_second or length >= crossed:
        return None
    kinds = tuple(c.kinds[i] if i in second else a.kinds[i] for i in range(len(a.kinds)))
    phase = Phase(kinds, a.held ^ rows_second)
    times = list(structure.times)
    times[k], times[k + 1] = times[k + 1], times[k]
    phases = (*structure.phases[:k], phase, *structure.phases[k + 1 :])
    return replace(structure, phases=phases, times=tuple(times))


def _vanished(setting: Setting, structure: Structure, fault: Fault) -> Revision:
    k = fault.phase
    phase = structure.phases[k]
    before = structure.phases[k - 1].held if k else frozenset()
    after = structure.phases[k + 1].held if k + 1 < len(structure.phases) else frozenset()
    own = [h for h in phase.held - before - after if (setting.active(h).order or 0) >= 2]
    found = dropped(structure, k)
    if own and 0 < k < len(structure.phases) - 1:
        found = replace(found, touches=(*found.touches, (k, own[0])))
        label = setting.system.rows[own[0][0]].label
        return Revision(found, "drop", f"the arc of {label} has no length: it is a touch")
    return Revision(found, "drop", fault.sentence)


def _sign(setting: Setting, structure: Structure, fault: Fault) -> Revision | None:
    """At the other bound an affine control has the sign that was found; a regular one is free.

    Where that only moves a junction, the control being there beside the fault already, dH/du has
    the wrong sign as soon as the control has switched: there is a singular arc between.
    """
    i, bounds = fault.control, setting.system.model.control_bounds
    name = setting.name(i)
    if i in setting.controls.of_kind("regular"):
        return _inserted(structure, fault, i, "free", f"{name} free")
    other = bounds.lower[i] if fault.upper else bounds.upper[i]
    kind: Kind = ("lower" if fault.upper else "upper") if np.isfinite(other) else "singular"
    found = _inserted(structure, fault, i, kind, f"{name} {kind}")
    if found.structure.merged().phases != structure.phases:
        return found
    if not _may_be_singular(setting, structure.phases[fault.phase], i):
        return None
    return _inserted(structure, fault, i, "singular", f"{name} singular")


def singular_instead(setting: Setting, structure: Structure, fault: Fault) -> Structure | None:
    """Return a structure with a singular arc where a sign is wrong; None where there can be none.

    Arcs at bounds in turn, each shorter than the last, would come near to a singular one.
    """
    i = fault.control
    if fault.what != "sign" or i in setting.controls.of_kind("regular"):
        return None
    if not _may_be_singular(setting, structure.phases[fault.phase], i):
        return None
    return _inserted(structure, fault, i, "singular", "").structure.merged()


def bang_before(setting: Setting, structure: Structure) -> list[Structure]:
    """Return structures with a control at a bound before the arc on which it is singular at first.

    What is singular from the first can be so only from some states.
    """
    start, horizon = structure.times[0], structure.times[-1] - structure.times[0]
    first, bounds, found = structure.phases[0], setting.system.model.control_bounds, []
    if structure.times[1] - start <= BRIEF * horizon:
        return []
    for i in (i for i, kind in enumerate(first.kinds) if kind == "singular"):
        sides: dict[Kind, float] = {"lower": bounds.lower[i], "upper": bounds.upper[i]}
        for kind in (kind for kind, bound in sides.items() if np.isfinite(bound)):
            kinds = (*first.kinds[:i], kind, *first.kinds[i + 1 :])
            wider, _ = structure.cut(start + BRIEF * horizon)
            phases = (replace(first, kinds=kinds), *wider.phases[1:])
            found.append(replace(wider, phases=phases))
    return found


def _may_be_singular(setting: Setting, phase: Phase, i: int) -> bool:
    """Whether a control has a feedback where it is neither at a bound nor determined by a row."""
    kinds: list[Kind] = list(phase.kinds)
    kinds[i] = "singular"
    try:
        return setting.singular(replace(phase, kinds=tuple(kinds))) is not None
    except UnsupportedError:
        return False


def _beyond(setting: Setting, structure: Structure, fault: Fault) -> Revision:
    kind: Kind = "upper" if fault.upper else "lower"
    name = setting.name(fault.control)
    return _inserted(structure, fault, fault.control, kind, f"{name} {kind}")


def _inserted(structure: Structure, fault: Fault, i: int, kind: Kind, what: str) -> Revision:
    kinds = structure.phases[fault.phase].kinds
    changed = (*kinds[:i], kind, *kinds[i + 1 :])
    found = structure.changed(
        *_snapped(structure, fault), lambda phase: replace(phase, kinds=changed)
    )
    return Revision(found, "insert", f"{fault.sentence}: an arc of {what} is put there")


def _snapped(structure: Structure, fault: Fault) -> tuple[float, float]:
    """Return when a fault begins and ends, within its phase."""
    first, last = structure.span(fault.phase, fault.phase)
    slack = ADJACENT * (structure.times[-1] - structure.times[0])
    start, end = max(fault.start, first), min(fault.end, last)
    return (first if start - first < slack else start), (last if last - end < slack else end)


def _violated(setting: Setting, structure: Structure, fault: Fault) -> Revision | None:
    held = _held(fault)
    known = setting.active(held)
    if known.order is None:
        return None
    start, end = _snapped(structure, fault)
    if known.order >= 2 and not any(_touches_near(structure, held, start, end)):
        found = structure.touched((start + end) / 2, held)
        return Revision(found, "insert", f"{fault.sentence}: a touch is put there")
    phase = structure.phases[fault.phase]
    kinds = list(phase.kinds)
    if not any(kinds[i] == "free" for i in known.controls):
        kinds[known.controls[0]] = "free"
    arc = Phase(tuple(kinds), phase.held | {held})
    found = structure.changed(start, end, lambda _: arc)
    gone = _touches_near(found, held, start, end)
    touches = tuple(at for at, near in zip(found.touches, gone, strict=True) if not near)
    found = replace(found, touches=touches)
    return Revision(found, "insert", f"{fault.sentence}: an arc on it is put there")


def _held(fault: Fault) -> Held:
    assert fault.held is not None, "the fault is of a row"
    return fault.held


def _touches_near(structure: Structure, held: Held, start: float, end: float) -> list[bool]:
    """Return which touches are of a row, within twice a stretch of time about it."""
    first, last = start - (end - start), end + (end - start)
    return [h == held and first <= structure.times[k] <= last for k, h in structure.touches]


def _pull(setting: Setting, structure: Structure, fault: Fault) -> Revision:
    held = _held(fault)
    known, phase = setting.active(held), structure.phases[fault.phase]
    start, end = _snapped(structure, fault)
    if known.order or end <= start:  # a state constraint holds from end to end or not at all
        start, end = structure.span(fault.phase, fault.phase)
    kinds = list(phase.kinds)
    affine = setting.controls.of_kind("affine")
    let_go = next((i for i in known.controls if kinds[i] == "free" and i in affine), None)
    if let_go is not None:
        kinds[let_go] = _released(setting, held, let_go)
    without = Phase(tuple(kinds), phase.held - {held})
    found = structure.changed(start, end, lambda _: without)
    if known.order and known.order >= 2:
        found = found.touched((start + end) / 2, held)
        return Revision(found, "release", f"{fault.sentence}: its arc is made a touch")
    label = setting.system.rows[held[0]].label
    return Revision(found, "release", f"{fault.sentence}: {label} is not held there")


def _released(setting: Setting, held: Held, i: int) -> Kind:
    """Return the bound that an affine control goes to when a row lets go of it."""
    values, _ = setting.probe.sizes(setting.active(held).slope[i])
    to_lower = bool(np.nanmedian(values) > 0) == held[1]
    bounds = setting.system.model.control_bounds
    other = bounds.lower[i] if to_lower else bounds.upper[i]
    return ("lower" if to_lower else "upper") if np.isfinite(other) else "singular"


_MENDS: Final[dict[What, Callable[[Setting, Structure, Fault], Revision | None]]] = {
    "vanished": _vanished,
    "sign": _sign,
    "beyond": _beyond,
    "violated": _violated,
    "pull": _pull,
}
