"""Why a solve failed, in the words of the problem file: which condition, where, how much."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.problem.model import Model, labels
from quito_cli.solution.kinks import sat_on
from quito_cli.solution.trajectory import Curve
from quito_cli.solvers.outcome import Outcome, Status
from quito_cli.solvers.residuals import Residuals
from quito_cli.transcription.transcribe import Nlp

if TYPE_CHECKING:
    import casadi as ca

Array = NDArray[np.float64]

FELT = 1e-3
"""A violation, scaled, that is more than a tolerance not reached."""
RUNAWAY = 1e8
"""Unknowns in their units that are no answer any more."""
_RUNS_AWAY = "The cost runs away with"
_HINTS = {
    Status.INFEASIBLE: (
        "No trajectory was found that meets all conditions: loosen a bound or an end condition, or "
        "give it more time; a problem with many local minima may need another start: a `guess` for "
        "its states, or the result of an easier one (--set, then --guess)."
    ),
    Status.ITERATION_LIMIT: (
        "Raise --max-iterations, or loosen --tolerance; if the cost runs away it has no minimum: "
        "give bounds to states and controls."
    ),
    Status.NOT_FINITE: (
        "Keep the expression defined: bounds on what it depends on, or a guess where it is defined."
    ),
    Status.TIME_LIMIT: "Raise the solver's time limit.",
    Status.TOO_FEW_FREEDOMS: "More conditions are fixed than controls can meet: free one.",
    Status.DIVERGED: "Give bounds to states and controls: the cost may have no minimum.",
    Status.STUCK: "Try other --steps, a looser --tolerance, or bounds that keep states sensible.",
}


def diagnose(
    nlp: Nlp, outcome: Outcome, residuals: Residuals, trajectory: Curve, u: Array
) -> tuple[str, ...]:
    """Return sentences on why the point of `outcome` is no answer.

    Args:
        nlp: the nonlinear program.
        outcome: the solver's point.
        residuals: recomputed at that point.
        trajectory: the states there.
        u: (N+1, n_u) the control at the nodes.
    """
    model, method = nlp.transcription.model, nlp.transcription.method
    parameters = nlp.transcription.layout.parameters(outcome.w * nlp.unit)
    at = slice(None, None, len(method.breaks) - 1)
    times, states = trajectory.times[at], trajectory.states[at]
    sentences = _not_finite(model, times, states, u, parameters, "at")
    if outcome.status is Status.NOT_FINITE and not sentences:
        sentences = _not_finite_nearby(model, times, states, u, parameters)
    sentences += _runs_away(nlp, outcome) or _worst_row(nlp, residuals, trajectory.times)
    if outcome.status not in (Status.NOT_FINITE, Status.INTERRUPTED):
        sentences += _kink(model, times, states, u, parameters)
    if not sentences:
        kinds = {
            "first-order": residuals.stationarity,
            "feasibility": residuals.feasibility,
            "complementarity": residuals.complementarity,
        }
        worst = max(kinds, key=kinds.__getitem__)
        if residuals.feasibility > FELT:
            sentences = [f"A bound or an end condition is violated by {residuals.feasibility:.2g}."]
        else:
            sentences = [
                f"No condition fails by much, but the {worst} residual is {kinds[worst]:.2g}."
            ]
    beyond = outcome.status is Status.FAILED and residuals.feasibility > FELT
    status = Status.INFEASIBLE if beyond else outcome.status
    if (hint := _HINTS.get(status)) and not sentences[-1].startswith(_RUNS_AWAY):
        sentences.append(hint)
    return tuple(sentences)


def _runs_away(nlp: Nlp, outcome: Outcome) -> list[str]:
    """Name the unknown without a bound that has grown beyond all measure."""
    made, w = nlp.transcription, np.abs(outcome.w)
    if outcome.status not in (Status.ITERATION_LIMIT, Status.DIVERGED, Status.STUCK):
        return []
    if not np.isfinite(w).all() or w.max() < RUNAWAY:
        return []
    layout, model = made.layout, made.model
    names = labels(model.states) + labels(model.controls)
    sizes = (*layout.states(w).max(axis=0), *layout.coefficient_table(w).max(axis=0))
    unbounded = (*model.state_bounds.unbounded, *model.control_bounds.unbounded)
    rows = zip(names, sizes, unbounded, strict=True)
    grown = [name for name, size, free in rows if free and size > RUNAWAY / 10]
    if not grown:
        return []
    return [
        f"{_RUNS_AWAY} {' and '.join(grown)}: as it stands the problem has no minimum. Give them "
        "bounds, or a cost that keeps them small."
    ]


def _kink(
    model: Model, times: Array, states: Array, controls: Array, parameters: Array
) -> list[str]:
    """Name the formula whose corner the answer sits on."""
    p = np.tile(parameters[:, None], (1, len(times)))
    for name, expression in _along(model):
        inputs = [model.x, model.u, model.p, model.t]
        found = sat_on(inputs, expression, (states.T, controls.T, p, times[None, :]))
        if found:
            function, node = found
            return [
                f"{name} has a corner there: its {function} is at the corner from "
                f"t = {times[node]:.6g} on. Round it off, as in sqrt(x^2 + 1e-6) for abs(x), or "
                "split x into two controls of one sign."
            ]
    return []


def _worst_row(nlp: Nlp, residuals: Residuals, times: Array) -> list[str]:
    """Name the constraint that is violated most, with time and amount."""
    violations = np.nan_to_num(residuals.violations / nlp.row_scale, nan=np.inf)
    if not violations.size or violations.max() <= 1e-6:
        return []
    row = int(np.argmax(violations))
    block = next(b for b in nlp.blocks if b.first <= row < b.first + b.count)
    place, label = divmod(row - block.first, len(block.labels))
    time = times[0] + (times[-1] - times[0]) * block.fractions[min(place, len(block.fractions) - 1)]
    what = f"the {block.name}"
    if block.name in ("dynamics", "control bounds"):
        what += f" of {block.labels[label]}"
    return [f"Most violated: {what}, by {violations[row]:.3g} at t = {time:.6g}."]


def _not_finite(
    model: Model, times: Array, states: Array, controls: Array, parameters: Array, where: str
) -> list[str]:
    """Name the first expression that is infinite or undefined, its node and the values there."""
    import casadi as ca

    p = np.tile(parameters[:, None], (1, len(times)))
    arguments = [model.x, model.u, model.p, model.t]
    unknowns = ca.vertcat(model.x, model.u, model.p)
    for name, expression in _along(model):
        for value, what in (
            (expression, "is not finite"),
            (ca.jacobian(expression, unknowns), "is finite, but its slope is not,"),
        ):
            function = ca.Function("value", arguments, [ca.vec(ca.densify(value))])
            found = np.array(function.map(len(times))(states.T, controls.T, p, times))
            bad = ~np.isfinite(found).all(axis=0)
            if bad.any():
                node = int(np.argmax(bad))
                at = _named(model, states[node], controls[node], parameters)
                return [f"{name} {what} {where} node {node}, t = {times[node]:.6g}: {at}."]
    ends = (states[0], times[0], states[-1], times[-1], parameters)
    if not np.isfinite(float(model.end_cost(*ends))):
        at = _named(model, states[-1], controls[-1], parameters)
        return [f"cost.mayer is not finite at t = {times[-1]:.6g}: {at}."]
    return []


def _not_finite_nearby(
    model: Model, times: Array, states: Array, controls: Array, parameters: Array
) -> list[str]:
    """Name an expression that is undefined next to a point at which all are defined.

    The solver met it on its way, at a point that it does not hand back.
    """
    size = np.maximum(np.abs(states).max(axis=0), 1e-3)
    for far in (0.1, 0.5, 1.5):
        for side in (-far, far):
            shifted = states + side * size
            if found := _not_finite(model, times, shifted, controls, parameters, "near"):
                return found
    return []


def _along(model: Model) -> list[tuple[str, ca.SX]]:
    """Return the formulas along the horizon with the names the problem file has for them."""
    given = model.constraints
    return [
        *((f"dynamics.{v.name}", model.xdot[v.entries]) for v in model.states),
        ("cost.lagrange", model.lagrange),
        *((f"constraints.integral.{c.name}", c.value) for c in given.integral),
        *((f"constraints.path.{c.name}", c.value) for c in given.path),
    ]


def _named(model: Model, state: Array, control: Array, parameters: Array) -> str:
    names = labels(model.states) + labels(model.controls) + labels(model.parameters)
    values = np.concatenate([state, control, parameters])
    pairs = zip(names, values, strict=True)
    return ", ".join(f"{name} = {value:.6g}" for name, value in pairs)
