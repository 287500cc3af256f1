"""The search for a structure that fits: solved, looked at, revised, until nothing is wrong.

A direct answer is read one way after another; from each reading a number of structures is tried,
every one the revision of the one before it by what spoke against that (`faults`, `revise`).
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace

import numpy as np

from quito_cli.optimality.polish.again import Again
from quito_cli.optimality.polish.dense import Dense
from quito_cli.optimality.polish.direct import Direct
from quito_cli.optimality.polish.ends_held import ends_held
from quito_cli.optimality.polish.fault import Fault
from quito_cli.optimality.polish.faults import faults
from quito_cli.optimality.polish.focal import focal_point
from quito_cli.optimality.polish.gauss import gauss
from quito_cli.optimality.polish.lengths import undetermined
from quito_cli.optimality.polish.newton import Solved, iterate
from quito_cli.optimality.polish.parting import parted
from quito_cli.optimality.polish.refine import refined
from quito_cli.optimality.polish.revise import Revision, dropped, revised
from quito_cli.optimality.polish.setting import UnsupportedError
from quito_cli.optimality.polish.shown import shown
from quito_cli.optimality.polish.start import Near, started
from quito_cli.optimality.polish.structure import Phase, Structure
from quito_cli.optimality.polish.system import System
from quito_cli.optimality.polish.told import told
from quito_cli.solution.polishing import Action, PolishStatus, PolishStep

STAGES = 10
"""Gauss points of a segment: order 20 at its end, 11 in between."""
REVISIONS = 12
"""Structures that are tried from one reading, at most."""
AS_BAD = 0.1
"""Faults this much of the worst one are mended with it."""
READINGS = ((None, False), (None, True), (0.05, True), (0.2, True))
"""How a direct answer is read: by its arcs, then by nearness to bounds; with junctions that are
close to each other apart, then as one. See `shown`."""
HALVINGS = 6
"""Times that segments are halved, at most."""


@dataclass
class Log:
    """What was done so far."""

    steps: list[PolishStep] = field(default_factory=list)

    def tell(self, action: Action, sentence: str, residuals: tuple[float, ...] = ()) -> None:
        """Add a step."""
        self.steps.append(PolishStep(action, sentence, residuals))

    @property
    def newton(self) -> int:
        """Newton steps in all."""
        return sum(max(len(step.residuals) - 1, 0) for step in self.steps)


@dataclass(frozen=True, eq=False)
class Ending:
    """How a search ended, and with what."""

    status: PolishStatus
    reason: str = ""
    """Why there is no extremal; empty where there is one."""
    extremal: Dense | None = None
    residual: float = np.nan
    """To which the equations of the extremal hold."""


@dataclass(frozen=True, eq=False)
class Attempt:
    """A structure solved, as far as it could be."""

    dense: Dense
    solved: Solved

    @property
    def structure(self) -> Structure:
        """The structure at the times that were found."""
        return self.dense.system.structure.at(self.dense.times)


@dataclass(frozen=True, eq=False)
class Following:
    """What to try next."""

    structure: Structure
    reason: str
    """What spoke against the structure before it."""
    start: Attempt | None
    """What to start it from; None is what the one before it was started from."""


@dataclass(eq=False)
class _Search:
    """What is known while searching."""

    direct: Direct
    log: Log
    deadline: float
    known: set[tuple[Phase, ...]] = field(default_factory=set)
    """Structures that were tried."""

    @property
    def late(self) -> bool:
        """Whether it has taken as long as it may."""
        return time.perf_counter() > self.deadline

    def assume(self, structure: Structure) -> None:
        """Say what is tried."""
        self.log.tell("assume", told(self.direct.setting, structure))


def search(direct: Direct, log: Log, deadline: float) -> Ending:
    """Try one reading of a direct answer after another; what the first came to stands for all.

    Args:
        direct: the answer.
        log: is told every step.
        deadline: when to stop, by `time.perf_counter`.
    """
    going, first = _Search(direct, log, deadline), None
    for reach, tied in READINGS:
        try:
            structure = shown(direct.setting, direct.solution, direct.impulses, reach, tied)
            if structure.phases in going.known:
                continue
            if first is not None:
                said = "junctions that are close to each other taken to be one"
                if reach is not None:
                    said = f"every control within {reach:.0%} of a bound taken to be there"
                log.tell("refuse", f"{first.reason}: the answer is read anew, with {said}")
            going.assume(structure)
            ended = _revised(going, structure)
        except UnsupportedError as error:  # another reading may do without
            ended = Ending(PolishStatus.UNSUPPORTED, str(error))
        if ended.status in (PolishStatus.POLISHED, PolishStatus.DEGENERATE):
            return ended
        first = first or ended
        if going.late:
            break
    assert first is not None, "the first reading is of nothing known"
    return first


def _revised(going: _Search, structure: Structure) -> Ending:
    """Solve and revise until nothing is wrong."""
    start, reason = None, "no structure fits"
    for _ in range(REVISIONS):
        going.known.add(structure.phases)
        if going.late:
            reason = f"it would take longer than the solve before it; {reason}"
            return Ending(PolishStatus.NOT_CONVERGED, reason)
        judged = _judged(going, _attempted(going, structure, start))
        if isinstance(judged, Ending):
            return judged
        structure, reason, start = judged.structure, judged.reason, judged.start or start
    return Ending(PolishStatus.REFUSED, reason)


def _attempted(going: _Search, structure: Structure, last: Attempt | None) -> Attempt:
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


def _judged(going: _Search, found: Attempt) -> Ending | Following:
    """Hold what was found against every condition: an end, or what to try next."""
    scales = going.direct.scales(found.dense.system.layout)
    if not (found.solved.slow or found.solved.converged):
        return _simpler(going, found)
    brief = undetermined(found.dense, scales)
    if found.solved.slow and brief is None:
        return Ending(PolishStatus.DEGENERATE, _slow(found.solved))
    wrong = [brief] if brief else faults(found.dense)
    if wrong:
        return _following(going, found, wrong)
    focal = focal_point(found.dense, scales)
    if focal:
        return Ending(PolishStatus.DEGENERATE, focal)
    return Ending(PolishStatus.POLISHED, "", found.dense, found.solved.residuals[-1])


def _slow(solved: Solved) -> str:
    values = solved.last.singular_values if solved.last else np.ones(1)
    return (
        "Newton's method creeps: the conditions do not determine the extremal (smallest singular "
        f"value {values[-1] / values[0]:.1e} of the largest)"
    )


def _simpler(going: _Search, found: Attempt) -> Ending | Following:
    """Take apart what changes at one junction, or leave out the arc that is known least."""
    structure, layout = found.dense.system.structure, found.dense.system.layout
    reason = f"the residual stays at {found.solved.residuals[-1]:.1e}"
    ended = Ending(PolishStatus.NOT_CONVERGED, reason)
    apart = _parted(going, structure)
    if apart is not None:
        going.log.tell("insert", "no extremal was found: what changes at one time is taken apart")
        going.assume(apart)
        return Following(apart, reason, None)
    if len(structure.phases) < 2 or found.solved.last is None:
        return ended
    weakest = np.abs(found.solved.last.weakest[layout.place("times")])[1:-1]
    k = int(np.argmax(weakest)) + 1
    lengths = np.diff(structure.times)
    simpler = dropped(structure, k if lengths[k] <= lengths[k - 1] else k - 1).merged()
    if simpler.phases in going.known:
        return ended
    going.log.tell(
        "drop",
        f"no extremal was found, and the junction at {structure.times[k]:.6g} is known least: the "
        "arc beside it is left out",
    )
    return Following(simpler, reason, None)


def _parted(going: _Search, structure: Structure) -> Structure | None:
    """Return a structure with one change at each junction, if it is another one."""
    try:
        apart = parted(going.direct.setting, structure).merged()
    except UnsupportedError:
        return None
    return None if apart.phases in going.known else apart


def _following(going: _Search, found: Attempt, wrong: list[Fault]) -> Ending | Following:
    """Mend the worst fault that can be, with others of its kind that are as bad."""
    for worst in wrong:
        same = [f for f in wrong if f.what == worst.what and f.amount >= AS_BAD * worst.amount]
        for group in (same, [worst]):
            revisions = _mended(going, found.structure, group)
            if revisions and revisions[-1].structure.phases not in going.known:
                for revision in revisions:
                    going.log.tell(revision.action, revision.sentence)
                structure = revisions[-1].structure
                going.assume(structure)
                return Following(structure, wrong[0].sentence, found)
    return Ending(PolishStatus.REFUSED, wrong[0].sentence)


def _mended(going: _Search, structure: Structure, group: list[Fault]) -> list[Revision]:
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
