"""The polish: structure assumed, solved, held against every inequality, revised, and again.

    assume    the structure that the arcs of the direct answer show
    solve     its boundary value problem; segments are halved until polynomials carry
    check     every inequality of Pontryagin's conditions
    revise    the worst one that does not hold tells which arc to drop, insert or release

until nothing is wrong, or nothing more is known to try. The polished answer replaces the direct one
only where all holds.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.hamiltonian import pontryagin
from quito_cli.optimality.look import Look
from quito_cli.optimality.polish.dense import refined
from quito_cli.optimality.polish.faults import Fault, faults
from quito_cli.optimality.polish.gauss import gauss
from quito_cli.optimality.polish.guess import Again, Direct, ends_of, scales_of, started
from quito_cli.optimality.polish.newton import Solved, iterate
from quito_cli.optimality.polish.revise import dropped, revised
from quito_cli.optimality.polish.setting import Setting, UnsupportedError
from quito_cli.optimality.polish.structure import Structure, assumed
from quito_cli.optimality.polish.system import System
from quito_cli.optimality.probes import TooLargeError
from quito_cli.solution.polishing import Action, Polishing, PolishStatus, PolishStep

if TYPE_CHECKING:
    from quito_cli.problem.model import Model
    from quito_cli.solution.solution import Solution

Array = NDArray[np.float64]

STAGES = 10
"""Gauss points of a segment: order 20 at its end, 11 in between."""
REVISIONS = 12
"""Structures that are tried, at most."""
HALVINGS = 6
"""Times that segments are halved, at most."""


@dataclass(frozen=True, eq=False)
class Extremal:
    """Where the polish came to."""

    system: System
    solved: Solved


@dataclass
class _Log:
    """What was done so far."""

    steps: list[PolishStep] = field(default_factory=list)
    newton: int = 0

    def tell(self, action: Action, sentence: str, residuals: tuple[float, ...] = ()) -> None:
        self.steps.append(PolishStep(action, sentence, residuals))
        self.newton += max(len(residuals) - 1, 0)


@dataclass(frozen=True, eq=False)
class Ended:
    """How it ended, and with what."""

    status: PolishStatus
    reason: str
    steps: tuple[PolishStep, ...]
    newton_steps: int
    extremal: Extremal | None


def sought(model: Model, direct: Solution) -> Ended:
    """Seek the extremal that a direct answer is near to."""
    log = _Log()

    def ended(status: PolishStatus, reason: str, extremal: Extremal | None = None) -> Ended:
        accepted = status is PolishStatus.POLISHED
        log.tell("accept" if accepted else "refuse", reason or status.value)
        return Ended(status, "" if accepted else reason, tuple(log.steps), log.newton, extremal)

    if not direct.success or not np.isfinite(direct.costates).all():
        return ended(PolishStatus.NO_ANSWER, direct.status.value)
    try:
        setting = Setting(pontryagin(model))
        with np.errstate(all="ignore"):
            look = Look.at(setting.system, direct)
            given = Direct(setting, direct, look)
            structure = assumed(setting, direct, given.impulses)
            log.tell("assume", described(setting, structure))
            return ended(*_revised(given, structure, log))
    except TooLargeError:
        return ended(PolishStatus.NOT_DERIVED, "its formulas are too long to be worked on")
    except UnsupportedError as error:
        return ended(PolishStatus.UNSUPPORTED, str(error))


def _revised(
    given: Direct, structure: Structure, log: _Log
) -> tuple[PolishStatus, str, Extremal | None]:
    """Solve and revise until nothing is wrong."""
    setting, known = given.setting, {structure.phases}
    last: Extremal | None = None
    for _ in range(REVISIONS):
        found = _solved(given, structure, last, log)
        solved = found.solved
        if not solved.converged:
            if solved.slow:
                return PolishStatus.DEGENERATE, _slow(found), None
            simpler = _simpler(found)
            if simpler is None or simpler[0].phases in known:
                return PolishStatus.NOT_CONVERGED, f"the residual stays at {solved.residuals[-1]:.1e}", None
            structure = simpler[0]
            log.tell("drop", simpler[1])
            known.add(structure.phases)
            continue
        structure = _timed(found)
        wrong = faults(found.system, solved.unknowns)
        if not wrong:
            return PolishStatus.POLISHED, "", found
        revision = next(
            (r for f in wrong if (r := revised(setting, structure, f)) and r.structure.phases not in known),
            None,
        )
        if revision is None:
            return PolishStatus.REFUSED, wrong[0].sentence, None
        log.tell(revision.action, revision.sentence)  # type: ignore[arg-type]
        log.tell("assume", described(setting, revision.structure))
        structure, last = revision.structure, found
        known.add(structure.phases)
    return PolishStatus.REFUSED, wrong[0].sentence if solved.converged else "no structure fits", None


def _timed(found: Extremal) -> Structure:
    times = found.solved.unknowns.shared[found.system.layout.place("T")]
    return found.system.structure.at(times)


def _solved(given: Direct, structure: Structure, last: Extremal | None, log: _Log) -> Extremal:
    """Solve the boundary value problem of a structure, with segments short enough."""
    system = System(given.setting, structure, ends_of(given, structure), gauss(STAGES))
    scales = scales_of(given, system)
    start = (
        started(given, system) if last is None
        else Again(last.system, last.solved.unknowns).unknowns_of(system)
    )
    solved = iterate(system, start, scales)
    log.tell("solve", f"{len(structure.phases)} phases, {_count(start)} segments", solved.residuals)
    for _ in range(HALVINGS):
        if not solved.converged:
            break
        finer = refined(system, solved.unknowns, scales)
        if finer is None:
            break
        solved = iterate(system, finer, scales)
        log.tell("refine", f"{_count(finer)} segments, some of them halved", solved.residuals)
    return Extremal(system, solved)


def _count(unknowns: object) -> int:
    return sum(len(p.stages) for p in unknowns.phases)  # type: ignore[attr-defined]


def _simpler(found: Extremal) -> tuple[Structure, str] | None:
    """Return a structure without the arc whose junction the equations know least of."""
    structure = found.system.structure
    if len(structure.phases) < 2 or found.solved.last is None:
        return None
    weakest = np.abs(found.solved.last.weakest[found.system.layout.place("T")])[1:-1]
    k = int(np.argmax(weakest)) + 1
    lengths = np.diff(structure.times)
    phase = k if lengths[k] <= lengths[k - 1] else k - 1
    sentence = f"no extremal was found, and the time of the junction at {structure.times[k]:.6g} is known least: the arc beside it is left out"
    return dropped(structure, phase).merged(), sentence


def _slow(found: Extremal) -> str:
    values = found.solved.last.singular_values if found.solved.last else np.ones(1)
    return (
        "Newton's method creeps: the conditions do not determine the extremal (smallest singular "
        f"value {values[-1] / values[0]:.1e} of the largest)"
    )


def described(setting: Setting, structure: Structure) -> str:
    """Say a structure in a sentence."""
    parts = []
    for i in range(setting.system.model.n_u):
        kinds = [phase.kinds[i] for phase in structure.phases]
        said, start = [], 0
        for k in range(1, len(kinds) + 1):
            if k == len(kinds) or kinds[k] != kinds[start]:
                said.append(f"{kinds[start]} to {structure.times[k]:.6g}")
                start = k
        parts.append(f"{setting.name(i)}: " + ", ".join(said))
    for k, phase in enumerate(structure.phases):
        for row, upper in sorted(phase.held):
            side = "upper" if upper else "lower"
            parts.append(
                f"{setting.system.rows[row].label} at its {side} bound from "
                f"{structure.times[k]:.6g} to {structure.times[k + 1]:.6g}"
            )
    for k, (row, _) in structure.touches:
        parts.append(f"{setting.system.rows[row].label} touched at {structure.times[k]:.6g}")
    return "; ".join(parts)


__all__ = ["Ended", "Fault", "Polishing", "replace", "sought", "time"]
