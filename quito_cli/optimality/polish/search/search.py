"""The search for a structure that fits: solved, looked at, revised, until nothing is wrong.

A direct answer is read one way after another; from each reading a number of structures is tried,
every one the revision of the one before it by what spoke against that (`faults`, `revise`).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import islice

import numpy as np

from quito_cli.optimality.polish.equations.gauss import gauss
from quito_cli.optimality.polish.equations.setting import UnsupportedError
from quito_cli.optimality.polish.equations.structure import Structure
from quito_cli.optimality.polish.equations.system import System
from quito_cli.optimality.polish.faults.dense import Dense
from quito_cli.optimality.polish.faults.faults import faults
from quito_cli.optimality.polish.faults.focal import focal_point
from quito_cli.optimality.polish.faults.lengths import undetermined
from quito_cli.optimality.polish.reading.direct import Direct
from quito_cli.optimality.polish.reading.ends_held import ends_held
from quito_cli.optimality.polish.reading.shown import shown
from quito_cli.optimality.polish.search.attempts import Attempt, Ending, Following, Going, Log
from quito_cli.optimality.polish.search.mending import following, simpler
from quito_cli.optimality.polish.solving.again import Again
from quito_cli.optimality.polish.solving.newton import Solved, iterate
from quito_cli.optimality.polish.solving.refine import refined, rough
from quito_cli.optimality.polish.solving.start import Near, started
from quito_cli.solution.polishing import PolishStatus

STAGES = 10
"""Gauss points of a segment: order 20 at its end, 11 in between."""
REVISIONS = 12
"""Structures that are tried from one reading, at most."""
SOON = 5
"""Of these before another reading is tried: from a wrong one the way to the right structure is
long."""
READINGS = ((None, False), (None, True), (0.05, True), (0.2, True))
"""How a direct answer is read: by its arcs, then by nearness to bounds; with junctions that are
close to each other apart, then as one. See `shown`."""
OTHERS = 8
"""Structures that are tried where all readings fail, at most."""
HALVINGS = 6
"""Times that segments are halved, at most."""


@dataclass(eq=False)
class _Line:
    """A reading of the direct answer, and what became of it so far."""

    structure: Structure | None
    reason: str = "no structure fits"
    """What spoke against the structure before this one."""
    ended: Ending | None = None
    start: Attempt | None = None
    tries: int = 0

    @property
    def end(self) -> Ending:
        """How it ended; refused where there are no tries left."""
        return self.ended or Ending(PolishStatus.REFUSED, self.reason)


def search(direct: Direct, log: Log, deadline: float) -> Ending:
    """Follow every reading of a direct answer for a while, and then on.

    What the first came to stands for all where none comes to an extremal.

    Args:
        direct: the answer.
        log: is told every step.
        deadline: when to stop, by `time.thread_time`.
    """
    going = Going(direct, log, deadline)
    lines: list[_Line] = []
    for reach, tied in READINGS:
        line = _read(going, reach, tied, lines)
        if line is None:
            continue
        lines.append(line)
        if _followed(going, line, SOON):
            return line.end
        if going.late:
            break
    for line in [line for line in lines if line.ended is None]:
        log.tell("refuse", f"{lines[-1].reason}: an earlier reading is gone on with")
        if _followed(going, line, REVISIONS):
            return line.end
    for structure, start in islice(going.others, OTHERS):  # there may be more while they are tried
        if structure.phases not in going.known and not going.late:
            log.tell("refuse", f"{lines[0].reason}: another mend of an earlier structure is tried")
            going.assume(structure)
            line = _Line(structure, start=start)
            if _followed(going, line, SOON):
                return line.end
    return lines[0].end


def _read(going: Going, reach: float | None, tied: bool, others: list[_Line]) -> _Line | None:
    """Return a reading of the direct answer; None where what it shows was tried."""
    direct = going.direct
    if others:
        said = "junctions that are close to each other taken to be one"
        if reach is not None:
            said = f"every control within {reach:.0%} of a bound taken to be there"
    try:
        structure = shown(direct.setting, direct.solution, direct.impulses, reach, tied)
    except UnsupportedError as error:  # another reading may do without
        return _Line(None, str(error), Ending(PolishStatus.UNSUPPORTED, str(error)))
    if structure.phases in going.known:
        return None
    if others:
        going.log.tell("refuse", f"{others[0].reason}: the answer is read anew, with {said}")
    going.assume(structure)
    return _Line(structure)


def _followed(going: Going, line: _Line, tries: int) -> bool:
    """Solve and revise until nothing is wrong; say whether that settles the search.

    Args:
        going: what is known.
        line: what is revised.
        tries: in all, at most.
    """
    try:
        while line.ended is None and line.tries < tries:
            if going.late:
                reason = f"it would take longer than the solve before it; {line.reason}"
                line.ended = Ending(PolishStatus.NOT_CONVERGED, reason)
            else:
                _further(going, line)
    except UnsupportedError as error:
        line.ended = Ending(PolishStatus.UNSUPPORTED, str(error))
    if line.ended is None or not line.ended.settles:
        return False
    # What a mend made degenerate need not be so: where there is another, that is tried first.
    return line.ended.status is PolishStatus.POLISHED or not going.others


def _further(going: Going, line: _Line) -> None:
    """Solve what a line came to, and revise it."""
    assert line.structure is not None, "a line without a structure has ended"
    line.tries += 1
    going.known.add(line.structure.phases)
    judged = _judged(going, _attempted(going, line.structure, line.start))
    if isinstance(judged, Ending):
        line.ended, line.reason = judged, judged.reason
    else:
        line.structure, line.reason = judged.structure, judged.reason
        line.start = judged.start or line.start


def _attempted(going: Going, structure: Structure, last: Attempt | None) -> Attempt:
    """Solve the boundary value problem of a structure, with segments short enough."""
    direct, log = going.direct, going.log
    system = System(direct.setting, structure, ends_held(direct, structure), gauss(STAGES))
    near: Near = direct if last is None else Again(direct, last.dense)
    unknowns, scales = started(near, system), direct.scales(system.layout)
    solved = iterate(system, unknowns, scales)
    phases = "1 phase" if len(structure.phases) == 1 else f"{len(structure.phases)} phases"
    said = f"{phases}, {unknowns.segments} segments"
    log.tell("solve", said, solved.residuals)
    for _ in range(HALVINGS):
        finer = refined(Dense(system, solved.unknowns), scales) if solved.converged else None
        if finer is None:
            break
        solved = iterate(system, finer, scales)
        said = f"{finer.segments} segments, some of them halved"
        log.tell("refine", said, solved.residuals)
    return Attempt(Dense(system, solved.unknowns), solved)


def _judged(going: Going, found: Attempt) -> Ending | Following:
    """Hold what was found against every condition: an end, or what to try next."""
    scales = going.direct.scales(found.dense.system.layout)
    if not (found.solved.slow or found.solved.converged):
        return simpler(going, found)
    brief = undetermined(found.dense, scales)
    if found.solved.slow and brief is None:
        return Ending(PolishStatus.DEGENERATE, _slow(found.solved))
    wrong = [brief] if brief else faults(found.dense)
    time = rough(found.dense, scales)
    judged = following(going, found, wrong) if wrong else None
    if judged is not None and (time is None or isinstance(judged, Following)):
        return judged
    if time is not None:
        return Ending(PolishStatus.REFUSED, _rough(time))
    focal = focal_point(found.dense, scales)
    if focal:
        return Ending(PolishStatus.DEGENERATE, focal)
    return Ending(PolishStatus.POLISHED, "", found.dense, found.solved.residuals[-1])


def _rough(time: float) -> str:
    return (
        f"states, costates or controls are not smooth at t = {time:.4g}, however short the "
        "segments there: a formula of the problem jumps, has a kink or is infinitely steep"
    )


def _slow(solved: Solved) -> str:
    values = solved.last.singular_values if solved.last else np.ones(1)
    return (
        "Newton's method creeps: the conditions do not determine the extremal (smallest singular "
        f"value {values[-1] / values[0]:.1e} of the largest)"
    )
