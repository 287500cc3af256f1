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
from quito_cli.optimality.polish.focal import focal_point
from quito_cli.optimality.polish.gauss import gauss
from quito_cli.optimality.polish.guess import Again, Direct, ends_of, scales_of, started
from quito_cli.optimality.polish.newton import Solved, iterate
from quito_cli.optimality.polish.revise import dropped, revised
from quito_cli.optimality.polish.setting import Setting, UnsupportedError
from quito_cli.optimality.polish.structure import Phase, Structure, assumed
from quito_cli.optimality.polish.system import System
from quito_cli.optimality.polish.unknowns import Unknowns
from quito_cli.optimality.polish.written import exact
from quito_cli.optimality.probes import TooLargeError
from quito_cli.solution.polishing import Action, Polishing, PolishStatus, PolishStep

if TYPE_CHECKING:
    from quito_cli.problem.model import Model
    from quito_cli.problem.schema import Problem
    from quito_cli.solution.solution import Solution
    from quito_cli.solve import Options

Array = NDArray[np.float64]

STAGES = 10
"""Gauss points of a segment: order 20 at its end, 11 in between."""
REVISIONS = 12
"""Structures that are tried, at most."""
AS_BAD = 0.1
"""Faults this much of the worst one are mended with it."""
READINGS = (None, 0.05, 0.2)
"""How a direct answer is read: by its arcs, then by nearness to bounds, see `assumed`."""
LEAST_SECONDS = 5.0
"""That a polish may take however quick the solve before it was."""
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


def polish(problem: Problem, model: Model, options: Options, direct: Solution) -> Solution:
    """Return the polished answer, or the direct one with the account of why it stands.

    Args:
        problem: what was solved.
        model: its Model.
        options: as resolved for the direct solve.
        direct: its answer, with its arcs.
    """
    from quito_cli.optimality.polish.answer import answer

    started = time.perf_counter()
    ended = sought(model, direct)
    found = ended.extremal
    residual = found.solved.residuals[-1] if found else np.nan
    segments = _count(found.solved.unknowns) if found else 0
    account = Polishing(
        ended.status,
        ended.reason,
        ended.steps,
        residual,
        time.perf_counter() - started,
        direct.cost,
        segments,
        ended.newton_steps,
    )
    if found is None:
        return replace(direct, polishing=account)
    extremal = exact(found.system, found.solved.unknowns, residual)
    polished = answer(problem, model, options, extremal, direct, account, account.seconds)
    refusal = _refusal(polished)
    if refusal:
        steps = (*account.steps[:-1], PolishStep("refuse", refusal))
        account = replace(
            account, status=PolishStatus.NO_BETTER, reason=refusal, steps=steps, segments=0
        )
        return replace(direct, polishing=account)
    return polished


def _refusal(polished: Solution) -> str:
    """Say what the evidence has against a polished answer; empty where it has nothing."""
    if not polished.success:
        return f"as a point of a collocation: {polished.status.value}"
    failing = [row for row in polished.certificate if row.verdict == "fails"]
    return f"{failing[0].condition} fails: {failing[0].reason}" if failing else ""


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
            return ended(*_read(given, log, _deadline(direct)))
    except TooLargeError:
        return ended(PolishStatus.NOT_DERIVED, "its formulas are too long to be worked on")
    except UnsupportedError as error:
        return ended(PolishStatus.UNSUPPORTED, str(error))


def _deadline(direct: Solution) -> float:
    """Return when to stop: a polish is to take no longer than what went before it."""
    seconds = direct.statistics.build_seconds + direct.statistics.solve_seconds
    if direct.refinement is not None:
        seconds = sum(r.seconds for r in direct.refinement.rounds)
    return time.perf_counter() + max(seconds, LEAST_SECONDS)


def _read(given: Direct, log: _Log, deadline: float) -> tuple[PolishStatus, str, Extremal | None]:
    """Try one reading of the direct answer after another; what the first came to stands for all."""
    first: tuple[PolishStatus, str, Extremal | None] | None = None
    known: set[tuple[Phase, ...]] = set()
    for reach in READINGS:
        structure = assumed(given.setting, given.solution, given.impulses, reach)
        if structure.phases in known:
            continue
        if reach is not None:
            log.tell(
                "refuse",
                f"{first[1] if first else ''}: the answer is read anew, with every "
                f"control within {reach:.0%} of a bound taken to be there",
            )
        log.tell("assume", described(given.setting, structure))
        found = _revised(given, structure, log, deadline, known)
        if found[0] in (PolishStatus.POLISHED, PolishStatus.DEGENERATE):
            return found
        first = first or found
        if time.perf_counter() > deadline:
            break
    assert first is not None
    return first


def _revised(
    given: Direct,
    structure: Structure,
    log: _Log,
    deadline: float,
    known: set[tuple[Phase, ...]],
) -> tuple[PolishStatus, str, Extremal | None]:
    """Solve and revise until nothing is wrong."""
    setting, last = given.setting, None
    known.add(structure.phases)
    reason = "no structure fits"
    for _ in range(REVISIONS):
        if time.perf_counter() > deadline:
            reason = f"it would take longer than the solve before it; {reason}"
            return PolishStatus.NOT_CONVERGED, reason, None
        found = _solved(given, structure, last, log)
        solved = found.solved
        if solved.slow:
            return PolishStatus.DEGENERATE, _slow(found), None
        if not solved.converged:
            reason = f"the residual stays at {solved.residuals[-1]:.1e}"
            simpler = _simpler(found)
            if simpler is None or simpler[0].phases in known:
                return PolishStatus.NOT_CONVERGED, reason, None
            structure = simpler[0]
            log.tell("drop", simpler[1])
            known.add(structure.phases)
            continue
        wrong = faults(found.system, solved.unknowns)
        if not wrong:
            focal = focal_point(found.system, solved.unknowns, scales_of(given, found.system))
            status = PolishStatus.DEGENERATE if focal else PolishStatus.POLISHED
            return status, focal, None if focal else found
        reason = wrong[0].sentence
        following = _following(setting, _timed(found), wrong, known, log)
        if following is None:
            return PolishStatus.REFUSED, reason, None
        log.tell("assume", described(setting, following))
        structure, last = following, found
        known.add(structure.phases)
    return PolishStatus.REFUSED, reason, None


def _following(
    setting: Setting,
    structure: Structure,
    wrong: list[Fault],
    known: set[tuple[Phase, ...]],
    log: _Log,
) -> Structure | None:
    """Return the structure that mends the worst fault and others of its kind that are as bad."""
    for worst in wrong:
        same = [f for f in wrong if f.what == worst.what and f.amount >= AS_BAD * worst.amount]
        for group in (same, [worst]):
            found, said = structure, []
            for fault in group:
                phase = found.phase_at((fault.start + fault.end) / 2)
                placed = fault if fault.what == "vanished" else replace(fault, phase=phase)
                revision = revised(setting, found, placed)
                if revision is not None:
                    found = revision.structure
                    said.append(revision)
                if fault.what == "vanished":
                    break
            if said and found.phases not in known:
                for revision in said:
                    log.tell(revision.action, revision.sentence)  # type: ignore[arg-type]
                return found
    return None


def _timed(found: Extremal) -> Structure:
    times = found.solved.unknowns.shared[found.system.layout.place("T")]
    return found.system.structure.at(times)


def _solved(given: Direct, structure: Structure, last: Extremal | None, log: _Log) -> Extremal:
    """Solve the boundary value problem of a structure, with segments short enough."""
    system = System(given.setting, structure, ends_of(given, structure), gauss(STAGES))
    scales = scales_of(given, system)
    start = (
        started(given, system)
        if last is None
        else Again(given, last.system, last.solved.unknowns).unknowns_of(system)
    )
    solved = iterate(system, start, scales)
    phases = "1 phase" if len(structure.phases) == 1 else f"{len(structure.phases)} phases"
    log.tell("solve", f"{phases}, {_count(start)} segments", solved.residuals)
    for _ in range(HALVINGS):
        if not solved.converged:
            break
        finer = refined(system, solved.unknowns, scales)
        if finer is None:
            break
        solved = iterate(system, finer, scales)
        log.tell("refine", f"{_count(finer)} segments, some of them halved", solved.residuals)
    return Extremal(system, solved)


def _count(unknowns: Unknowns) -> int:
    return sum(len(p.stages) for p in unknowns.phases)


def _simpler(found: Extremal) -> tuple[Structure, str] | None:
    """Return a structure without the arc whose junction the equations know least of."""
    structure = found.system.structure
    if len(structure.phases) < 2 or found.solved.last is None:
        return None
    weakest = np.abs(found.solved.last.weakest[found.system.layout.place("T")])[1:-1]
    k = int(np.argmax(weakest)) + 1
    lengths = np.diff(structure.times)
    phase = k if lengths[k] <= lengths[k - 1] else k - 1
    sentence = (
        f"no extremal was found, and the junction at {structure.times[k]:.6g} is known least: "
        "the arc beside it is left out"
    )
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
                kind = "interior" if kinds[start] == "free" else kinds[start]
                said.append(f"{kind} to {structure.times[k]:.6g}")
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
