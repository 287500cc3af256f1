"""Why a solve failed, in the words of the problem file: which condition, where, how much."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from quito_cli.problem.model import Model, labels
from quito_cli.solution.trajectory import Trajectory
from quito_cli.solvers.outcome import Outcome, Status
from quito_cli.solvers.residuals import Residuals
from quito_cli.transcription.transcribe import Nlp

Array = NDArray[np.float64]

_HINTS = {
    Status.INFEASIBLE: (
        "No trajectory was found that meets all conditions: loosen a bound or an end condition, or "
        "give it more time; a problem with many local minima may need another start."
    ),
    Status.ITERATION_LIMIT: "Raise --max-iterations, or loosen --tolerance.",
    Status.TIME_LIMIT: "Raise the solver's time limit.",
    Status.TOO_FEW_FREEDOMS: "More conditions are fixed than controls can meet: free one.",
    Status.DIVERGED: "Give bounds to states and controls: the cost may have no minimum.",
    Status.STUCK: "Try other --steps, a looser --tolerance, or bounds that keep states sensible.",
}


def diagnose(
    nlp: Nlp, outcome: Outcome, residuals: Residuals, trajectory: Trajectory, u: Array
) -> tuple[str, ...]:
    """Return sentences on why the point of `outcome` is no answer.

    Args:
        nlp: the nonlinear program.
        outcome: the solver's point.
        residuals: recomputed at that point.
        trajectory: the states there.
        u: (N+1, n_u) the control at the nodes.
    """
    model, substeps = nlp.transcription.model, nlp.transcription.method.substeps
    parameters = nlp.transcription.layout.parameters(outcome.w)
    sentences = [
        *_not_finite(
            model, trajectory.times[::substeps], trajectory.states[::substeps], u, parameters
        ),
        *_worst_row(nlp, residuals, trajectory.times),
    ]
    if not sentences and residuals.stationarity > 0:
        sentences.append(
            "All constraints hold, but the point is not stationary: the first-order residual is "
            f"{residuals.stationarity:.2g}."
        )
    if hint := _HINTS.get(outcome.status):
        sentences.append(hint)
    return tuple(sentences)


def _worst_row(nlp: Nlp, residuals: Residuals, times: Array) -> list[str]:
    """Name the constraint that is violated most, with time and amount."""
    violations = np.nan_to_num(residuals.violations, nan=np.inf)
    if not violations.size or violations.max() <= 1e-6:
        return []
    row = int(np.argmax(violations))
    block = next(b for b in nlp.blocks if b.first <= row < b.first + b.count)
    place, label = divmod(row - block.first, len(block.labels))
    time = times[0] + (times[-1] - times[0]) * block.fractions[place]
    what = "dynamics" if block.name == "dynamics" else "bounds"
    return [
        f"Most violated: the {what} of {block.labels[label]}, by {violations[row]:.3g} "
        f"at t = {time:.6g}."
    ]


def _not_finite(
    model: Model, times: Array, states: Array, controls: Array, parameters: Array
) -> list[str]:
    """Name the first expression that is infinite or undefined, its node and the values there."""
    p = np.tile(parameters[:, None], (1, len(times)))
    xdot, running = model.right_hand_side.map(len(times))(states.T, controls.T, p, times)
    values = np.vstack([np.array(xdot), np.array(running).reshape(1, -1)])
    bad = ~np.isfinite(values)
    if not bad.any():
        return []
    node = int(np.argmax(bad.any(axis=0)))
    names = [f"dynamics.{name}" for name in labels(model.states)] + ["cost.lagrange"]
    name = names[int(np.argmax(bad[:, node]))]
    named = zip(
        labels(model.states) + labels(model.controls),
        np.append(states[node], controls[node]),
        strict=True,
    )
    at = ", ".join(f"{label} = {value:.6g}" for label, value in named)
    return [f"{name} is not finite at node {node}, t = {times[node]:.6g}: {at}."]
