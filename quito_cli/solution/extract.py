"""The solver's point -> Solution: everything read back from the unknowns, and the evidence."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from quito_cli.problem.model import Known, Model, labels, units
from quito_cli.problem.schema import Problem
from quito_cli.solution.diagnosis import diagnose
from quito_cli.solution.resimulation import Control, Resimulation, resimulate
from quito_cli.solution.solution import (
    Evidence,
    Origin,
    Quantity,
    ReferenceSamples,
    Solution,
    Statistics,
)
from quito_cli.solution.trajectory import Trajectory
from quito_cli.solution.variation import ringing_index, total_variation
from quito_cli.solution.violations import Violation, violations
from quito_cli.solvers.outcome import Outcome, Status
from quito_cli.solvers.residuals import Residuals
from quito_cli.transcription.transcribe import Nlp, Transcription

Array = NDArray[np.float64]

DENSE_POINTS = 10
"""Points a cell on the grid that violations and variation are looked for on."""
SAVED_POINTS = 2001
"""Points of the saved dense grid, at least; four a cell on finer meshes."""
WORTH_A_WARNING = 1e-3
"""Violation between nodes or re-simulation gap, over the quantity's size."""


def extract(
    problem: Problem,
    nlp: Nlp,
    outcome: Outcome,
    residuals: Residuals,
    options: Mapping[str, Any],
    build_seconds: float,
) -> Solution:
    """Return the Solution of a solver's point.

    Args:
        problem: what was solved.
        nlp: its discretization.
        outcome: the solver's point.
        residuals: recomputed at that point.
        options: resolved options, for the record; `tolerance` is judged by.
        build_seconds: time of everything before the solver was called.
    """
    made, w = nlp.transcription, outcome.w
    model, layout = made.model, made.layout
    start, end = layout.times(w, model)
    times = start + (end - start) * made.method.mesh.fractions
    control = Control(made.method.basis, made.method.mesh, layout.coefficient_table(w))
    trajectory = _trajectory(made, control, w, (start, end))
    states = trajectory.states
    again = resimulate(
        model, control, made.method.substeps, (start, end), states[0], layout.parameters(w)
    )
    cost = _cost(nlp, w)
    dense = np.linspace(start, end, max(SAVED_POINTS, 4 * made.method.mesh.cells + 1))
    return Solution(
        _origin(problem, model),
        dict(options),
        outcome.status,
        model.sense * cost,
        times,
        trajectory,
        made.method.basis,
        control.coefficients,
        _costates(nlp, outcome, residuals),
        _multipliers(nlp, outcome),
        _evidence(nlp, outcome, residuals, control, trajectory, again, cost, options["tolerance"]),
        Statistics(
            outcome.iterations,
            build_seconds + outcome.build_seconds,
            outcome.solve_seconds,
            len(w),
            len(nlp.row_lower),
            "ipopt",
            outcome.said,
        ),
        outcome.history,
        dense,
        _reference(model, dense),
    )


def _cost(nlp: Nlp, w: Array) -> float:
    """Return the cost of the minimisation, recomputed."""
    return float(nlp.assembled.gradient(w, [])[0]) / nlp.objective_scale


def _origin(problem: Problem, model: Model) -> Origin:
    def quantities(variables: Any, bounds: Any) -> tuple[Quantity, ...]:
        rows = zip(labels(variables), units(variables), *bounds, strict=True)
        return tuple(Quantity(n, u, float(low), float(high)) for n, u, low, high in rows)

    return Origin(
        problem.name,
        problem.title,
        problem.text,
        problem.changes,
        quantities(model.states, model.state_bounds),
        quantities(model.controls, model.control_bounds),
        model.sense < 0,
    )


def _trajectory(
    made: Transcription, control: Control, w: Array, ends: tuple[float, float]
) -> Trajectory:
    """Return the states at the ends of all substeps, with slopes from both sides."""
    N, R, n = made.method.mesh.cells, made.method.substeps, made.model.n_x
    z = np.array(made.cell_gather @ w).reshape(N, -1).T
    inner = np.array(made.cell.inner.map(N)(z, made.cell_parameters)).T.reshape(N, R + 1, n)
    states = np.vstack([inner[:, :-1].reshape(-1, n), made.layout.states(w)[-1:]])
    begins = np.arange(R) / R
    cells, offsets = made.method.mesh.points(begins)
    fractions = made.method.mesh.fractions[cells] + offsets * made.method.mesh.steps[cells]
    times = ends[0] + (ends[1] - ends[0]) * np.append(fractions, 1.0)
    parameters = made.layout.parameters(w)

    def slopes(x: Array, at: Array, t: Array) -> Array:
        u = control.basis.evaluate(control.coefficients, *made.method.mesh.points(at))
        p = np.tile(parameters[:, None], (1, len(t)))
        return np.array(made.model.right_hand_side.map(len(t))(x.T, u.T, p, t)[0]).T

    return Trajectory(
        times,
        states,
        slopes(states[:-1], begins, times[:-1]),
        slopes(inner[:, 1:].reshape(-1, n), begins + 1 / R, times[1:]),
        made.method.scheme.interpolation,
    )


def _costates(nlp: Nlp, outcome: Outcome, residuals: Residuals) -> Array:
    """Return λ at the nodes: defect multipliers, and stationarity at the initial time."""
    made, block = nlp.transcription, nlp.blocks[0]
    n, N = made.model.n_x, made.method.mesh.cells
    inner = outcome.lam_g[block.rows].reshape(N, -1)[:, -n:]
    first = residuals.gradient[made.layout.node(np.array(0))]
    return np.vstack([first, inner]) / nlp.objective_scale


def _multipliers(nlp: Nlp, outcome: Outcome) -> dict[str, Array]:
    scaled = outcome.lam_g / nlp.objective_scale
    return {b.name: scaled[b.rows].reshape(-1, len(b.labels)) for b in nlp.blocks}


def _reference(model: Model, times: Array) -> ReferenceSamples | None:
    known = model.known
    if known is None:
        return None
    return ReferenceSamples(
        known.cost,
        known.accuracy,
        known.switching_times,
        Known.sample(known.states, model.states, times),
        Known.sample(known.controls, model.controls, times),
    )


def _evidence(
    nlp: Nlp,
    outcome: Outcome,
    residuals: Residuals,
    control: Control,
    trajectory: Trajectory,
    again: Resimulation,
    cost: float,
    tolerance: float,
) -> Evidence:
    model, mesh, times = nlp.transcription.model, control.mesh, trajectory.times
    offsets = np.arange(DENSE_POINTS) / DENSE_POINTS
    cells, places = mesh.points(offsets)
    cells, places = np.append(cells, mesh.cells - 1), np.append(places, 1.0)
    grid = mesh.fractions[cells] + places * mesh.steps[cells]
    dense_times = times[0] + (times[-1] - times[0]) * grid
    u = control.basis.evaluate(control.coefficients, cells, places)
    x = trajectory(dense_times)
    found = violations(model, dense_times, x, u)
    scale = np.abs(trajectory.states).max(axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    gap = np.abs(again.states - trajectory.states) / scale
    at_end = again.states[-1]
    missed = np.maximum(np.maximum(model.final.lower - at_end, at_end - model.final.upper), 0.0)
    resimulation_gap = _finite_or_inf(gap.max(initial=0.0))
    terminal_gap = _finite_or_inf((missed / scale).max(initial=0.0))
    failed = outcome.status not in (Status.SOLVED, Status.INTERRUPTED)
    return Evidence(
        tolerance,
        residuals.stationarity,
        residuals.feasibility,
        residuals.complementarity,
        model.sense * cost,
        model.sense * again.cost,
        resimulation_gap,
        again.accuracy,
        terminal_gap,
        found,
        tuple(float(v) for v in total_variation(u)),
        _ringing(nlp.transcription, control, (float(times[0]), float(times[-1]))),
        _warnings(found, resimulation_gap, terminal_gap, again, times),
        diagnose(nlp, outcome, residuals, trajectory, u[::DENSE_POINTS]) if failed else (),
    )


def _finite_or_inf(value: float) -> float:
    return float(value) if np.isfinite(value) else np.inf


def _ringing(made: Transcription, control: Control, ends: tuple[float, float]) -> tuple[float, ...]:
    """Return the ringing index of each control on the grid of the cells' offsets."""
    offsets = made.method.offsets
    offsets = offsets[offsets < 1]
    cells, places = made.method.mesh.points(offsets)
    u = control.basis.evaluate(control.coefficients, cells, places)
    model = made.model
    known = np.full(u.shape, np.nan)
    if model.known is not None:
        fractions = made.method.mesh.fractions[cells] + places * made.method.mesh.steps[cells]
        times = ends[0] + (ends[1] - ends[0]) * fractions
        known = Known.sample(model.known.controls, model.controls, times)
    return tuple(
        ringing_index(
            u[:, i], len(offsets), known[:, i] if np.isfinite(known[:, i]).all() else None
        )
        for i in range(model.n_u)
    )


def _warnings(
    found: tuple[Violation, ...], gap: float, terminal: float, again: Resimulation, times: Array
) -> tuple[str, ...]:
    warnings = [
        f"{v.constraint} is violated by {v.amount:.2g} at t = {v.time:.6g}"
        for v in found
        if v.relative > WORTH_A_WARNING
    ]
    if gap > WORTH_A_WARNING:
        warnings.append(
            f"re-simulated states differ by {gap:.2g} of their size: the mesh is too coarse for "
            "these dynamics, or they are unstable; try more --steps or --substeps"
        )
    if terminal > WORTH_A_WARNING:
        warnings.append(
            f"the re-simulated state misses the final conditions by {terminal:.2g} of its size"
        )
    if again.accuracy > WORTH_A_WARNING:
        warnings.append(
            f"the re-simulation itself is only accurate to {again.accuracy:.2g}: stiff or unstable "
            "dynamics; its gap says little here"
        )
    return tuple(warnings)
