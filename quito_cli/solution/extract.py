"""The solver's point -> Solution: everything read back from the unknowns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from quito_cli.problem.model import Bounds, Known, Model, Variable, labels, units
from quito_cli.problem.schema import Problem
from quito_cli.problem.shapes import View
from quito_cli.solution.evidence import Answer, evidence
from quito_cli.solution.resimulation import Control
from quito_cli.solution.solution import (
    Drawing,
    MultiplierAxes,
    Origin,
    Quantity,
    ReferenceSamples,
    Solution,
    Statistics,
)
from quito_cli.solution.trajectory import Trajectory
from quito_cli.solvers import SOLVERS, judged_at
from quito_cli.solvers.outcome import Outcome
from quito_cli.solvers.residuals import Residuals
from quito_cli.transcription.transcribe import Nlp, Transcription

Array = NDArray[np.float64]

SAVED_POINTS = 2001
"""Points of the saved dense grid, at least; four a cell on finer meshes."""


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
        options: resolved options, for the record; judged is by `tolerance`, or by what the solver
            attains.
        build_seconds: time of everything before the solver was called.
    """
    answer = _answer(nlp, outcome)
    model, method = nlp.transcription.model, nlp.transcription.method
    judged = judged_at(SOLVERS[outcome.solver], options["tolerance"])
    (start, end), cells = answer.times, method.mesh.cells
    dense = np.linspace(start, end, max(SAVED_POINTS, 4 * cells + 1))
    solution = Solution(
        _origin(problem, model),
        dict(options),
        outcome.status,
        model.sense * answer.cost,
        start + (end - start) * method.mesh.fractions,
        answer.trajectory,
        method.basis,
        answer.control.coefficients,
        answer.parameters,
        _costates(nlp, outcome),
        _multipliers(nlp, outcome),
        {b.name: MultiplierAxes(start + (end - start) * b.fractions, b.labels) for b in nlp.blocks},
        evidence(nlp, outcome, residuals, answer, judged),
        Statistics(
            outcome.iterations,
            build_seconds + outcome.build_seconds,
            outcome.solve_seconds,
            len(outcome.w),
            len(nlp.row_lower),
            outcome.solver,
            outcome.said,
            "NLP" if nlp.nonlinearity else "QP",
        ),
        outcome.history,
        dense,
        _reference(model, dense),
    )
    return replace(solution, drawings=_drawings(model, solution))


def _answer(nlp: Nlp, outcome: Outcome) -> Answer:
    """Return what the unknowns mean."""
    made, w = nlp.transcription, outcome.w * nlp.unit
    times, parameters = made.layout.times(w, made.model), made.layout.parameters(w)
    control = Control(made.method.basis, made.method.mesh, made.layout.coefficient_table(w))
    cost = float(nlp.assembled.gradient(outcome.w, [])[0]) / nlp.objective_scale
    trajectory = _trajectory(made, control, outcome.w, made.layout.states(w)[-1], times, parameters)
    return Answer(times, parameters, control, trajectory, cost)


def _trajectory(
    made: Transcription,
    control: Control,
    scaled: Array,
    last: Array,
    ends: tuple[float, float],
    parameters: Array,
) -> Trajectory:
    """Return the states at the ends of all substeps, with slopes from both sides."""
    N, R, n = made.method.mesh.cells, made.method.substeps, made.model.n_x
    z = np.array(made.cells.gather @ scaled).reshape(N, -1).T
    inner = np.array(made.cell.inner.map(N)(z, made.cells.parameters)).T.reshape(N, R + 1, n)
    states = np.vstack([inner[:, :-1].reshape(-1, n), last])
    begins = np.arange(R) / R
    cells, offsets = made.method.mesh.points(begins)
    fractions = made.method.mesh.fractions[cells] + offsets * made.method.mesh.steps[cells]
    times = ends[0] + (ends[1] - ends[0]) * np.append(fractions, 1.0)

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


def _costates(nlp: Nlp, outcome: Outcome) -> Array:
    """Return λ at the nodes: what the cost that remains there gains by a change of the state.

    At the end of a cell that is −∂/∂x_{k+1} of the cell's part of the Lagrangian, for an explicit
    scheme the multiplier of its defect; at the start of the horizon +∂/∂x_0 of the first cell's.
    Where a condition holds at the node itself it is the value just before it.
    """
    made, cells = nlp.transcription, nlp.transcription.cells
    scaled = outcome.lam_g * nlp.row_scale / nlp.objective_scale
    nu = np.where(cells.rows >= 0, scaled[cells.rows], 0.0) + cells.weights
    z = np.array(cells.gather @ outcome.w).reshape(cells.count, -1).T
    gradient = np.array(cells.local.gradient.map(cells.count)(z, cells.parameters, nu))
    first, n = made.layout.shared, made.model.n_x
    return np.vstack([gradient[first : first + n, :1].T, -gradient[first + n : first + 2 * n].T])


def _multipliers(nlp: Nlp, outcome: Outcome) -> dict[str, Array]:
    unscaled = outcome.lam_g * nlp.row_scale / nlp.objective_scale
    return {b.name: unscaled[b.rows].reshape(-1, len(b.labels)) for b in nlp.blocks}


def _origin(problem: Problem, model: Model) -> Origin:
    return Origin(
        problem.name,
        problem.title,
        problem.text,
        problem.changes,
        _quantities(model.states, model.state_bounds),
        _quantities(model.controls, model.control_bounds),
        _quantities(model.parameters, model.parameter_bounds),
        not (model.initial_time.fixed and model.final_time.fixed),
        model.sense < 0,
    )


def _quantities(variables: tuple[Variable, ...], bounds: Bounds) -> tuple[Quantity, ...]:
    rows = zip(labels(variables), units(variables), *bounds, strict=True)
    return tuple(Quantity(name, unit, float(low), float(high)) for name, unit, low, high in rows)


def _drawings(model: Model, solution: Solution) -> tuple[Drawing, ...]:
    """Return the plots the file asks for, sampled on the dense grid."""
    times = solution.dense_times
    parameters = np.tile(solution.parameters[:, None], (1, len(times)))
    at = solution.state(times).T, solution.control(times).T, parameters, times

    def sampled(view: View) -> dict[str, Array]:
        return {name: np.array(f.map(len(times))(*at)).T for name, f in view.curves.items()}

    return tuple(
        Drawing(view.name, view.title, view.labels, sampled(view), view.balls, view.blocks)
        for view in model.views
    )


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
