"""The loop: solve, measure, move the mesh, carry the answer over, solve again (DESIGN 3.4).

It ends when û changes by less than the tolerance from one mesh to the next, outside its jumps, and
the jumps are that narrow in L²; or after the rounds allowed. A control that bends little, with no
jump or kink and states that are right, is left where it is after the first, unless the estimate of
its error says that it only looks so. Then one more answer, with twice the substeps, says what the
integration has to do with it: too much, and refinement goes on with those. Coefficients that go up
and down where û hardly does call for that answer early. The answer kept is the one of the lowest
re-simulated cost among those whose states and conditions hold between the nodes, the later one
where costs are level; else the one whose states are nearest to what its control does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from quito_cli.problem.model import Model
from quito_cli.refinement.account import account, bends, blur, change, spread
from quito_cli.refinement.grading import graded
from quito_cli.refinement.monitor import ENDS, wanted_steps
from quito_cli.solution.rounds import Account, Refinement, Round
from quito_cli.solution.solution import Solution
from quito_cli.solvers.outcome import Status
from quito_cli.transcription.mesh import Mesh

Array = NDArray[np.float64]

SHORTEST = 0.1
"""Length of the shortest cell over the square of the tolerance: L² sees a jump by its root."""
SOUND = 1e-3
"""Gap of the states, and violation between the nodes, up to which an answer may be kept."""
LEVEL = 4.0
"""Costs are level that differ by less than this times the square of the tolerance."""
DOUBT = 3.0
"""A re-simulated cost may be this many times worse than it differs from that of its program."""
UNSTABLE = 5.0
"""Where no answer is sound, a gap up to this many times the smallest says nothing."""
SMOOTH, SMOOTH_STATES = 2.0, 0.01
"""Errors of approximation and local errors of the states, over the tolerance, up to which a control
without jumps or kinks needs no other mesh."""
UNLIKELY = 10.0
"""Estimate of its error over the tolerance above which a control that looks smooth is not."""
WAVES, FROM_ROUND = 4.0, 3
"""Variation of the coefficients over that of û, from this round on, that calls for a check."""
STANDS = 0.8
"""A figure that has not fallen below this part of what it was no longer falls."""


class Solver(Protocol):
    """What solves on a mesh."""

    def __call__(self, mesh: Mesh, substeps: int, earlier: Solution | None) -> Solution:
        """Return the answer on `mesh`, starting from an earlier one."""


@dataclass(frozen=True)
class Limits:
    """How far to go."""

    tolerance: float
    """Of û in the uniform norm outside jumps, over its range."""
    rounds: int
    """Meshes at most."""
    cells: int
    """Cells at most."""
    points: Array
    """(k,) fractions of the horizon at which there must be nodes."""


@dataclass(frozen=True)
class _Step:
    """A round with its answer, and the mesh that it asks for."""

    solution: Solution
    record: Round
    errors: Array
    """(N,) local errors of the states."""
    moved: Mesh


def refine(
    model: Model, solve_on: Solver, mesh: Mesh, substeps: int, order: int, limits: Limits
) -> Solution:
    """Return the best answer found on meshes that follow the control, with its `refinement`.

    Args:
        model: the problem.
        solve_on: solves on a mesh.
        mesh: to start from.
        substeps: of the answers; the last check takes twice as many.
        order: of the scheme.
        limits: when to stop.
    """
    steps: list[_Step] = []
    checked = False
    while True:
        last = steps[-1].solution if steps else None
        solution = solve_on(steps[-1].moved if steps else mesh, substeps, last)
        if not solution.success:
            return _broken(solution, steps, limits)
        steps.append(_step(model, solution, last, mesh.cells, order, limits))
        ended = _reason(steps, limits)
        if ended is None and (checked or not _waves(steps)):
            continue
        best, alone = steps[_best(steps, limits)], len(steps) == 1
        check = solve_on(best.moved if alone else best.solution.mesh, 2 * substeps, best.solution)
        if check.status is Status.INTERRUPTED:
            said = f"{ended or ''} The check with twice the substeps was interrupted.".strip()
            kept = _finished(steps, limits, said, None, check)
            return replace(kept, status=Status.INTERRUPTED)
        if not check.success:
            said = f"The check with twice the substeps did not end well: {check.status.value}"
            return _finished(steps, limits, f"{ended or ''} {said}".strip(), None, check)
        beside = check if alone else _beside(best, steps)
        found = account(best.solution, beside, check, best.errors)
        if alone and limits.rounds > 1 and found.control > UNLIKELY * limits.tolerance:
            continue  # it looks smooth on these cells only
        resolved = alone or not found.substeps > limits.tolerance
        enough = resolved or len(steps) + 2 > limits.rounds
        if ended is not None and enough:
            return _finished(steps, limits, ended, found, check)
        checked = enough
        if not enough:  # what the integrator does not resolve, the optimiser abuses
            substeps *= 2
            steps.append(_step(model, check, best.solution, mesh.cells, order, limits))


def _waves(steps: list[_Step]) -> bool:
    """Whether coefficients go up and down where û hardly does: the integrator may not see it."""
    if len(steps) < FROM_ROUND:
        return False
    solution = steps[-1].solution
    u = solution.control(solution.times)
    moves = (np.abs(np.diff(values, axis=0)).sum(axis=0) for values in (solution.coefficients, u))
    coefficients, control = moves
    return bool((coefficients > WAVES * np.maximum(control, spread(solution) / 10)).any())


def _beside(best: _Step, steps: list[_Step]) -> Solution:
    """Return the answer after the best one, whose mesh knows more, or before the last."""
    at = steps.index(best)
    return steps[at + 1 if at + 1 < len(steps) else at - 1].solution


def _step(
    model: Model,
    solution: Solution,
    last: Solution | None,
    cells: int,
    order: int,
    limits: Limits,
) -> _Step:
    """Measure an answer and move the mesh."""
    size, evidence, statistics = spread(solution), solution.evidence, solution.statistics
    wanted, errors = wanted_steps(model, solution, size, cells, limits.tolerance, order)
    shortest = SHORTEST * limits.tolerance**2
    moved = graded(solution.mesh, wanted, shortest, limits.cells, limits.points)
    worst = max((v.relative for v in evidence.violations), default=0.0)
    worst = max(worst, evidence.terminal_gap)
    record = Round(
        nodes=solution.times,
        substeps=int(solution.options["substeps"]),
        cost=solution.cost,
        resimulated_cost=evidence.resimulated_cost,
        gap=evidence.resimulation_gap,
        violation=worst,
        change=math.nan if last is None else change(solution, last),
        blur=blur(solution.junctions, size, float(solution.times[-1] - solution.times[0])),
        iterations=-1 if statistics.iterations is None else statistics.iterations,
        seconds=statistics.build_seconds + statistics.solve_seconds,
    )
    return _Step(solution, record, errors, moved)


def _reason(steps: list[_Step], limits: Limits) -> str | None:
    """Return why to end here, or None to go on."""
    records, tolerance = [step.record for step in steps], limits.tolerance
    last = records[-1]
    all_tried = "The one mesh allowed has been tried."
    if limits.rounds > 1:
        all_tried = f"All {limits.rounds} meshes allowed have been tried."
    if len(records) == 1:
        solution = steps[0].solution
        smooth = not solution.junctions and bends(solution, ENDS) <= SMOOTH * tolerance
        if smooth and steps[0].errors.sum() <= SMOOTH_STATES * tolerance:
            return "The control is smooth: another mesh changes it no more than the estimate says."
        return all_tried if limits.rounds == 1 else None
    before = records[-2]
    narrow = last.blur <= tolerance or last.blur > STANDS * before.blur
    if narrow and last.change <= tolerance:
        level = "The control no longer changes from mesh to mesh by more than the tolerance."
        wide = last.blur > tolerance and last.cells >= limits.cells
        return f"{level} With more cells, its jumps would be sharper." if wide else level
    if len(records) > 3 and narrow and last.change > STANDS * records[-3].change:
        return (
            "The control still changes from mesh to mesh by more than the tolerance, and no longer "
            "by less each time: start from more cells, or take a larger tolerance."
        )
    return all_tried if len(records) >= limits.rounds else None


def _best(steps: list[_Step], limits: Limits) -> int:
    """Return the index of the answer to keep."""
    sign = -1.0 if steps[0].solution.origin.maximize else 1.0
    records = [step.record for step in steps]
    sound = [i for i, r in enumerate(records) if max(r.gap, r.violation) <= SOUND]
    if not sound:
        least = min(record.gap for record in records)
        return max(i for i, record in enumerate(records) if record.gap <= UNSTABLE * least)
    costs = {i: sign * records[i].resimulated_cost + _doubt(records[i]) for i in sound}
    least = min(costs.values())
    level = LEVEL * limits.tolerance**2 * abs(least)
    return max(i for i, cost in costs.items() if cost <= least + level)


def _doubt(record: Round) -> float:
    """Return how far a re-simulated cost may be from what its mesh would come to."""
    return DOUBT * abs(record.resimulated_cost - record.cost)


def _broken(solution: Solution, steps: list[_Step], limits: Limits) -> Solution:
    """Return what there is when a solve fails or is interrupted half-way."""
    if not steps:
        return solution
    cells, status = len(solution.times) - 1, solution.status
    said = f"The solve on mesh {len(steps) + 1}, of {cells} cells, "
    interrupted = status is Status.INTERRUPTED
    said += "was interrupted." if interrupted else f"ended: {status.value}"
    kept = _finished(steps, limits, said, None, solution)
    sentence = f"the mesh was not refined to the end: {said[0].lower()}{said[1:]}"
    evidence = replace(kept.evidence, warnings=(*kept.evidence.warnings, sentence))
    return replace(kept, evidence=evidence, status=status if interrupted else kept.status)


def _finished(
    steps: list[_Step], limits: Limits, ended: str, found: Account | None, *others: Solution
) -> Solution:
    """Return the best answer with the record of all, and the counts of all solves."""
    kept = _best(steps, limits)
    best = steps[kept].solution
    all_of = [*(step.solution.statistics for step in steps), *(s.statistics for s in others)]
    iterations = [one.iterations for one in all_of]
    statistics = replace(
        best.statistics,
        iterations=None if None in iterations else sum(i for i in iterations if i is not None),
        build_seconds=sum(one.build_seconds for one in all_of),
        solve_seconds=sum(one.solve_seconds for one in all_of),
    )
    rounds = tuple(step.record for step in steps)
    refinement = Refinement(rounds, kept, ended, found)
    return replace(best, statistics=statistics, refinement=refinement)
