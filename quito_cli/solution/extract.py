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
from quito_cli.solution.junctions import junctions
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
from quito_cli.solution.trajectory import Curve, Polynomials, Trajectory
from quito_cli.solution.variation import largest_bounds
from quito_cli.solvers import SOLVERS, judged_at
from quito_cli.solvers.outcome import Outcome
from quito_cli.solvers.residuals import Residuals
from quito_cli.transcription.transcribe import Nlp, Transcription

Array = NDArray[np.float64]

SAVED_POINTS = 2001
"""Points of the saved dense grid, at least; four a cell, or collocation point, on finer meshes."""


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
    (start, end), pieces = answer.times, method.basis.pieces
    dense = np.linspace(start, end, max(SAVED_POINTS, 4 * pieces + 1))
    nodes, adjoint = _costates(nlp, outcome, answer)
    ranges, coefficients = largest_bounds(*model.control_bounds), answer.control.coefficients
    solution = Solution(
        origin=_origin(problem, model),
        options=dict(options),
        status=outcome.status,
        cost=model.sense * answer.cost,
        times=start + (end - start) * method.mesh.fractions,
        trajectory=answer.trajectory,
        basis=method.basis,
        coefficients=coefficients,
        parameters=answer.parameters,
        costates=nodes,
        multipliers=_multipliers(nlp, outcome),
        multiplier_axes=_multiplier_axes(nlp, answer),
        evidence=evidence(nlp, outcome, residuals, answer, judged),
        statistics=_statistics(nlp, outcome, build_seconds),
        history=outcome.history,
        dense_times=dense,
        reference=_reference(model, dense),
        adjoint=adjoint,
        junctions=junctions(method.basis, method.mesh, coefficients, answer.times, ranges),
    )
    return replace(solution, drawings=_drawings(model, solution))


def _answer(nlp: Nlp, outcome: Outcome) -> Answer:
    """Return what the unknowns mean."""
    made, w = nlp.transcription, outcome.w * nlp.unit
    times, parameters = made.layout.times(w, made.model), made.layout.parameters(w)
    control = Control(made.method.basis, made.method.mesh, made.layout.coefficient_table(w))
    cost = float(nlp.assembled.gradient(outcome.w, [])[0]) / nlp.objective_scale
    starts, ends = made.dynamics.states(outcome.w)
    states = np.vstack([starts, made.layout.states(w)[-1]])
    between = _BETWEEN[made.method.interpolation]
    trajectory = between(made, control, states, ends, times, parameters)
    return Answer(times, parameters, control, trajectory, cost)


def _hermite(
    made: Transcription,
    control: Control,
    states: Array,
    ends: Array,
    times: tuple[float, float],
    parameters: Array,
) -> Curve:
    """Return the states from break to break, with slopes from both sides."""
    method = made.method
    begins, after = method.breaks[:-1], method.breaks[1:]
    t = _break_times(made, times)

    def slopes(x: Array, at: Array, t: Array) -> Array:
        u = control.basis.evaluate(control.coefficients, *method.mesh.points(at))
        p = np.tile(parameters[:, None], (1, len(t)))
        return np.array(made.model.right_hand_side.map(len(t))(x.T, u.T, p, t)[0]).T

    assert method.interpolation != "polynomial"
    return Trajectory(
        t,
        states,
        slopes(states[:-1], begins, t[:-1]),
        slopes(ends, after, t[1:]),
        method.interpolation,
    )


def _polynomials(
    made: Transcription,
    control: Control,
    states: Array,
    ends: Array,
    times: tuple[float, float],
    parameters: Array,
) -> Curve:
    """Return the polynomials through the states at the breaks."""
    return Polynomials(_break_times(made, times), states, len(made.method.breaks) - 1)


_BETWEEN = {"linear": _hermite, "cubic": _hermite, "polynomial": _polynomials}
"""What makes a curve of states at the breaks."""


def _break_times(made: Transcription, times: tuple[float, float]) -> Array:
    mesh = made.method.mesh
    cells, offsets = mesh.points(made.method.breaks[:-1])
    fractions = mesh.at(cells, offsets)
    return np.asarray(times[0] + (times[1] - times[0]) * np.append(fractions, 1.0))


def _costates(nlp: Nlp, outcome: Outcome, answer: Answer) -> tuple[Array, Polynomials | None]:
    """Return λ at the nodes, and as a function of time where more is known than that."""
    made = nlp.transcription
    unscaled = outcome.lam_g * nlp.row_scale / nlp.objective_scale
    found = made.dynamics.costates(outcome.w, unscaled)
    each = (len(found) - 1) // made.method.mesh.cells
    times = _break_times(made, answer.times)
    adjoint = None if len(found) != len(times) or each == 1 else Polynomials(times, found, each)
    return found[::each], adjoint


def _multipliers(nlp: Nlp, outcome: Outcome) -> dict[str, Array]:
    unscaled = outcome.lam_g * nlp.row_scale / nlp.objective_scale
    return {b.name: unscaled[b.rows].reshape(-1, len(b.labels)) for b in nlp.blocks}


def _multiplier_axes(nlp: Nlp, answer: Answer) -> dict[str, MultiplierAxes]:
    start, end = answer.times
    return {
        b.name: MultiplierAxes(start + (end - start) * b.fractions, b.labels) for b in nlp.blocks
    }


def _statistics(nlp: Nlp, outcome: Outcome, build_seconds: float) -> Statistics:
    return Statistics(
        iterations=outcome.iterations,
        build_seconds=build_seconds + outcome.build_seconds,
        solve_seconds=outcome.solve_seconds,
        unknowns=len(outcome.w),
        constraints=len(nlp.row_lower),
        solver=outcome.solver,
        solver_said=outcome.said,
        program="NLP" if nlp.nonlinearity else "QP",
    )


def _origin(problem: Problem, model: Model) -> Origin:
    return Origin(
        name=problem.name,
        title=problem.title,
        text=problem.text,
        changes=problem.changes,
        states=_quantities(model.states, model.state_bounds),
        controls=_quantities(model.controls, model.control_bounds),
        parameters=_quantities(model.parameters, model.parameter_bounds),
        free_times=not (model.initial_time.fixed and model.final_time.fixed),
        maximize=model.sense < 0,
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
        cost=known.cost,
        accuracy=known.accuracy,
        switching_times=known.switching_times,
        states=Known.sample(known.states, model.states, times),
        controls=Known.sample(known.controls, model.controls, times),
    )
