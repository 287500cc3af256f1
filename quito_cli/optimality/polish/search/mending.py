"""What to try after a structure that does not fit: a simpler one, or one that a fault asks for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from quito_cli.optimality.polish.equations.setting import UnsupportedError
from quito_cli.optimality.polish.equations.structure import Structure
from quito_cli.optimality.polish.faults.fault import Fault
from quito_cli.optimality.polish.search.attempts import Attempt, Ending, Following, Going
from quito_cli.optimality.polish.search.parting import parted
from quito_cli.optimality.polish.search.revise import (
    Revision,
    bang_before,
    dropped,
    revised,
    singular_instead,
)
from quito_cli.solution.polishing import PolishStatus

AS_BAD = 0.1
"""Faults this much of the worst one are mended with it."""


def simpler(going: Going, found: Attempt) -> Ending | Following:
    """Take apart what changes at one junction, or leave out the arc that is known least."""
    structure, layout = found.dense.system.structure, found.dense.system.layout
    reason = f"the residual stays at {found.solved.residuals[-1]:.1e}"
    ended = Ending(PolishStatus.NOT_CONVERGED, reason)
    apart = _parted(going, structure)
    if apart is not None:
        going.log.tell("insert", "no extremal was found: what changes at one time is taken apart")
        going.assume(apart)
        return Following(apart, reason, None)
    for other in bang_before(going.direct.setting, structure):
        _else(going, other, None)
    if len(structure.phases) < 2 or found.solved.last is None:
        return ended
    weakest = np.abs(found.solved.last.weakest[layout.place("times")])[1:-1]
    k = int(np.argmax(weakest)) + 1
    lengths = np.diff(structure.times)
    left = dropped(structure, k if lengths[k] <= lengths[k - 1] else k - 1).merged()
    if left.phases in going.known:
        return ended
    going.log.tell(
        "drop",
        f"no extremal was found, and the junction at {structure.times[k]:.6g} is known least: the "
        "arc beside it is left out",
    )
    return Following(left, reason, None)


def _else(going: Going, structure: Structure | None, start: Attempt | None) -> None:
    """Note a structure to try where all else fails."""
    if structure is not None and structure.phases not in going.known:
        going.others.append((structure, start))


def _parted(going: Going, structure: Structure) -> Structure | None:
    """Return a structure with one change at each junction, if it is another one."""
    try:
        apart = parted(going.direct.setting, structure).merged()
    except UnsupportedError:
        return None
    return None if apart.phases in going.known else apart


def following(going: Going, found: Attempt, wrong: list[Fault]) -> Ending | Following:
    """Mend the worst fault that can be, with others of its kind that are as bad."""
    setting = going.direct.setting
    for worst in wrong:
        same = [f for f in wrong if f.what == worst.what and f.amount >= AS_BAD * worst.amount]
        for group in (same, [worst]):
            revisions = _mended(going, found.structure, group)
            if revisions and revisions[-1].structure.phases not in going.known:
                for revision in revisions:
                    going.log.tell(revision.action, revision.sentence)
                _else(going, singular_instead(setting, found.structure, worst), found)
                structure = revisions[-1].structure
                going.assume(structure)
                return Following(structure, wrong[0].sentence, found)
    return Ending(PolishStatus.REFUSED, wrong[0].sentence)


def _mended(going: Going, structure: Structure, group: list[Fault]) -> list[Revision]:
    """Return one revision upon another, each of what the one before it left."""
    setting, found = going.direct.setting, []
    if group[0].what == "vanished":  # what it leaves is counted anew: one at a time
        revision = revised(setting, structure, group[0])
        return [revision] if revision else []
    for fault in group:
        phase = structure.phase_at((fault.start + fault.end) / 2)
        revision = revised(setting, structure, replace(fault, phase=phase))
        if revision is not None:
            alone = _singular_arcs(revision.structure) > _singular_arcs(structure)
            structure = revision.structure
            found.append(revision)
            if alone:  # it takes the place of what is wrong on either side
                break
    return found


def _singular_arcs(structure: Structure) -> int:
    return sum(phase.kinds.count("singular") for phase in structure.phases)
