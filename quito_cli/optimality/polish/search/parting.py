"""Junctions at which several things change, taken apart.

Every change of its own has a condition, and with it a time. Where a direct answer is too coarse to
show which of two comes first, both are read at one junction, whose single time cannot meet both
conditions. Apart, each finds its time; an order that is wrong shows in a length below zero, and is
put right by `revise.dropped`.
"""

from __future__ import annotations

from dataclasses import replace

from quito_cli.optimality.polish.equations.setting import Setting
from quito_cli.optimality.polish.equations.structure import Phase, Structure

APART = 0.02
"""Part of the shorter phase beside a junction by which changes are put apart."""


def parted(setting: Setting, structure: Structure) -> Structure:
    """Return a structure with one change at each junction; itself where that is so already.

    Raises:
        UnsupportedError: a control would be between its bounds, and nothing determines it.
    """
    for k in reversed(range(1, len(structure.phases))):
        if not structure.named(k):
            structure = _at(setting, structure, k)
    return structure


def _at(setting: Setting, structure: Structure, k: int) -> Structure:
    """Return a structure with the changes at junction k one after the other."""
    before, after = structure.phases[k - 1 : k + 1]
    between = list(_between(setting, before, after))
    if not between:
        return structure
    t = structure.times
    step = APART * min(t[k] - t[k - 1], t[k + 1] - t[k]) / len(between)
    for j, phase in enumerate(between):
        structure, at = structure.cut(t[k] + (j + 1) * step)
        phases = (*structure.phases[: at - 1], phase, *structure.phases[at:])
        structure = replace(structure, phases=phases)
    return structure


def _between(setting: Setting, before: Phase, after: Phase) -> list[Phase]:
    """Return the phases between two, each with one change more: rows first, then controls."""
    rows = sorted(before.held ^ after.held)
    spoken = {i for held in rows for i in setting.active(held).controls}
    kinds = list(before.kinds)
    alone = [i for i, kind in enumerate(after.kinds) if kind != kinds[i] and i not in spoken]
    found, held = [], before.held
    for row in rows:
        held = held ^ {row}
        for i in setting.active(row).controls:
            kinds[i] = after.kinds[i]
        found.append(setting.consistent(Phase(tuple(kinds), held)))
    for i in alone:
        kinds[i] = after.kinds[i]
        found.append(setting.consistent(Phase(tuple(kinds), held)))
    return found[:-1]  # the last change leads to `after`
