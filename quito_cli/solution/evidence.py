"""What speaks for an answer, found independently of the nonlinear program."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from quito_cli.problem.model import Known, Model, labels
from quito_cli.solution.diagnosis import diagnose
from quito_cli.solution.resimulation import Control, Resimulation, resimulate
from quito_cli.solution.solution import Evidence
from quito_cli.solution.trajectory import Curve
from quito_cli.solution.variation import largest_bounds, ringing_index, total_variation
from quito_cli.solution.violations import (
    Dense,
    Violation,
    beyond_tables,
    violations,
    worst_first,
)
from quito_cli.solvers.outcome import Outcome, Status
from quito_cli.solvers.residuals import Residuals
from quito_cli.transcription.method import Method
from quito_cli.transcription.transcribe import Nlp

Array = NDArray[np.float64]

SEEN = 0.01
"""A control that moves by less of its size is a constant to the eye."""
RINGS = 100.0
"""Ringing index from which on it is plain to see."""
HARDLY_MOVES = 0.1
"""A state smaller than this part of its unit has no size of its own: rounding may move it."""
WORTH_A_WARNING = 1e-3
"""Violation between nodes or re-simulation gap, over the quantity's size."""


@dataclass(frozen=True)
class Answer:
    """A solver's point, read: control, trajectory and cost."""

    times: tuple[float, float]
    parameters: Array
    """(n_p,)."""
    control: Control
    trajectory: Curve
    cost: float
    """Of the minimisation, recomputed from the nonlinear program."""


def evidence(
    nlp: Nlp, outcome: Outcome, residuals: Residuals, answer: Answer, tolerance: float
) -> Evidence:
    """Return the evidence for `answer`.

    Args:
        nlp: what was solved.
        outcome: the solver's point.
        residuals: recomputed at that point.
        answer: what the point means.
        tolerance: what the residuals are judged against.
    """
    model, method = nlp.transcription.model, nlp.transcription.method
    trajectory, start = answer.trajectory, answer.trajectory.states[0]
    again = resimulate(model, answer.control, method.breaks, answer.times, start, answer.parameters)
    dense = _dense(answer, method.fine)
    found = violations(model, dense, again.integrals)
    failed = outcome.status not in (Status.SOLVED, Status.INTERRUPTED)
    if outcome.status is not Status.SOLVED:
        found = worst_first((*found, *_defects(nlp, residuals, trajectory.times)))
    unit = nlp.unit[nlp.transcription.layout.node(np.array(0))]
    gap, terminal = _gaps(model, trajectory.states, again, unit)
    nodes = dense.controls[:: len(method.fine)]
    ringing = _ringing(model, method, answer)
    warned = nlp.notes + beyond_tables(model, dense)
    why: tuple[str, ...] = ()
    if failed:
        why += diagnose(nlp, outcome, residuals, trajectory, nodes)
        why += _missed(model, again, outcome.status, method.finer)
    else:
        warned += _warnings(found, gap, terminal, answer.cost, again, method.finer)
        warned += _rings(model, dense.controls, ringing, method.calmer)
    return Evidence(
        tolerance=tolerance,
        stationarity=residuals.stationarity,
        feasibility=residuals.feasibility,
        complementarity=residuals.complementarity,
        recomputed_cost=model.sense * answer.cost,
        resimulated_cost=model.sense * again.cost,
        resimulation_gap=gap,
        resimulation_accuracy=again.accuracy,
        terminal_gap=terminal,
        violations=found,
        total_variation=tuple(float(v) for v in total_variation(dense.controls)),
        ringing=ringing,
        warnings=warned,
        diagnosis=why,
    )


def _dense(answer: Answer, fine: Array) -> Dense:
    """Return the answer on a grid of the offsets `fine` in every cell."""
    control, mesh = answer.control, answer.control.mesh
    cells, places = mesh.points(fine)
    cells, places = np.append(cells, mesh.cells - 1), np.append(places, 1.0)
    fractions = mesh.at(cells, places)
    times = answer.times[0] + (answer.times[1] - answer.times[0]) * fractions
    controls = control.basis.evaluate(control.coefficients, cells, places)
    return Dense(times, answer.trajectory(times), controls, answer.parameters)


def _gaps(model: Model, states: Array, again: Resimulation, unit: Array) -> tuple[float, float]:
    """Return the distance of re-simulated states from the answer's, and from final conditions."""
    size = np.maximum(np.abs(states).max(axis=0), HARDLY_MOVES * unit)
    at_end = again.states[-1]
    with np.errstate(invalid="ignore"):  # a state that overflows is infinitely far
        gap = (np.abs(again.states - states) / size).max(initial=0.0)
        outside = np.maximum(model.final.lower - at_end, at_end - model.final.upper)
        terminal = (np.maximum(outside, 0.0) / size).max(initial=0.0)
    return _finite_or_inf(gap), _finite_or_inf(terminal)


def _defects(nlp: Nlp, residuals: Residuals, times: Array) -> tuple[Violation, ...]:
    """Return the worst jump of each state between cells: zero in an answer, not in a failure."""
    block = nlp.blocks[0]
    jumps = residuals.violations[block.rows].reshape(-1, len(block.labels)) / block.scale
    jumps = np.where(np.isfinite(jumps), jumps, np.inf)
    at = times[0] + (times[-1] - times[0]) * block.fractions[jumps.argmax(axis=0)]
    return tuple(
        Violation(f"dynamics of {name}", float(t), float(amount), 1.0 / float(scale))
        for name, t, amount, scale in zip(
            block.labels, at, jumps.max(axis=0), block.scale, strict=True
        )
    )


def _missed(model: Model, again: Resimulation, status: Status, finer: str) -> tuple[str, ...]:
    """Say which final value the control misses most when it is integrated."""
    at_end, (lower, upper) = again.states[-1], model.final
    if not np.isfinite(at_end).all():
        return ()
    outside = np.maximum(np.maximum(lower - at_end, at_end - upper), 0.0)
    worst = int(np.argmax(outside))
    if outside[worst] <= 1e-6 and status is not Status.INFEASIBLE:
        return ()
    if outside[worst] <= 1e-6:
        return (
            "Integrated with this control by a finer integrator, the end conditions are met: the "
            f"dynamics may be too stiff for these steps; try more {finer}.",
        )
    limit = lower[worst] if at_end[worst] < lower[worst] else upper[worst]
    return (
        f"Integrated with this control, {labels(model.states)[worst]} ends at {at_end[worst]:.6g} "
        f"where {limit:.6g} is asked for.",
    )


def _finite_or_inf(value: float) -> float:
    return float(value) if np.isfinite(value) else np.inf


def _ringing(model: Model, method: Method, answer: Answer) -> tuple[float, ...]:
    """Return the ringing index of each control on a grid as fine as the method resolves."""
    offsets, width = method.resolved
    cells, places = method.mesh.points(offsets)
    u = answer.control.basis.evaluate(answer.control.coefficients, cells, places)
    known = np.full(u.shape, np.nan)
    if model.known is not None:
        fractions = method.mesh.at(cells, places)
        times = answer.times[0] + (answer.times[1] - answer.times[0]) * fractions
        known = Known.sample(model.known.controls, model.controls, times)
    bounds = largest_bounds(*model.control_bounds)
    return tuple(
        ringing_index(
            u[:, i],
            width,
            known[:, i] if np.isfinite(known[:, i]).all() else None,
            float(bounds[i]),
        )
        for i in range(model.n_u)
    )


def _rings(
    model: Model, controls: Array, ringing: tuple[float, ...], calmer: str
) -> tuple[str, ...]:
    """Say which controls ring to be seen, and what is known to help."""
    moves = np.ptp(controls, axis=0) > SEEN * np.abs(controls).max(axis=0)
    return tuple(
        f"{name} rings (index {index:.2g}): {calmer}"
        for name, index, seen in zip(labels(model.controls), ringing, moves, strict=True)
        if index > RINGS and seen
    )


def _warnings(
    found: tuple[Violation, ...],
    gap: float,
    terminal: float,
    cost: float,
    again: Resimulation,
    finer: str,
) -> tuple[str, ...]:
    warnings = [
        f"{v.constraint} is violated by {v.amount:.2g} at t = {v.time:.6g}"
        for v in found
        if v.relative > WORTH_A_WARNING
    ]
    if gap > WORTH_A_WARNING:
        warnings.append(
            f"re-simulated states differ by {gap:.2g} of their size: the mesh is too coarse for "
            f"these dynamics, or they are unstable; try more {finer}"
        )
    if terminal > WORTH_A_WARNING:
        warnings.append(
            f"the re-simulated state misses the final conditions by {terminal:.2g} of its size"
        )
    missed, size = abs(cost - again.cost), max(abs(cost), abs(float(again.integrals[0])))
    if not np.isfinite(missed) or missed > max(WORTH_A_WARNING * size, 1e-6):
        warnings.append(
            f"the re-simulated cost differs by {missed:.2g}: the mesh does not resolve it; try "
            f"more {finer}"
        )
    if again.accuracy > WORTH_A_WARNING:
        warnings.append(
            f"the re-simulation itself is only accurate to {again.accuracy:.2g}: stiff or unstable "
            "dynamics; its gap says little here"
        )
    return tuple(warnings)
