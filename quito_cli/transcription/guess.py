"""Where the solver starts: what the file says; else the line between the end conditions, the middle
of the bounds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from quito_cli.problem.model import Bounds, GuessFunction, Model, Variable
from quito_cli.transcription.layout import Layout
from quito_cli.transcription.mesh import Mesh

Array = NDArray[np.float64]

MOVED = 1e-6
"""Relative distance beyond a bound that is worth a word: answers lie up to 1e-8 outside theirs."""


@dataclass(frozen=True)
class Note:
    """What had to be done to the guess of a variable."""

    section: str
    variable: str
    message: str


@dataclass(frozen=True)
class Guess:
    """A guess of everything, within bounds."""

    times: tuple[float, float]
    parameters: Array
    """(n_p,)."""
    fractions: Array
    """(points,) of the horizon, the ends among them."""
    states: Array
    """(points, n_x)."""
    controls: Array
    """(points, n_u)."""
    notes: tuple[Note, ...]
    """What had to be done to it."""

    def stacked(self, layout: Layout, nodes: Array, own: Array, coefficients: Array) -> Array:
        """Return all unknowns, (n_w,), with the times and parameters of this guess."""
        free = (layout.free_initial_time, layout.free_final_time)
        times = np.array(self.times)[list(free)]
        parts = [times, self.parameters, nodes.ravel(), own.ravel(), coefficients.ravel()]
        return np.concatenate(parts)


def middle(bounds: Bounds, otherwise: Array) -> Array:
    """Return the middle of bounds; the nearest to `otherwise` where a side is open."""
    lower, upper = bounds
    closed = np.isfinite(lower) & np.isfinite(upper)
    inside = np.clip(otherwise, lower, upper)
    with np.errstate(invalid="ignore"):  # inf − inf on open sides, not used there
        return np.where(closed, (lower + upper) / 2, inside)


def make_guess(model: Model, mesh: Mesh) -> Guess:
    """Return the guess at the nodes of a mesh."""
    start, end = model.initial_time.guess, model.final_time.guess
    times = start + (end - start) * mesh.fractions
    notes: list[Note] = []
    states = _line(model, mesh)
    _follow(states, model.states, model.hints.states, times)
    states = _clipped(states, model.state_bounds, "states", model.states, notes)
    states[0], states[-1] = np.clip(states[0], *model.initial), np.clip(states[-1], *model.final)
    centre = middle(model.control_bounds, np.zeros(model.n_u))
    controls = np.tile(centre, (mesh.cells + 1, 1))
    _follow(controls, model.controls, model.hints.controls, times)
    controls = _clipped(controls, model.control_bounds, "controls", model.controls, notes)
    default = middle(model.parameter_bounds, np.zeros(model.n_p))
    parameters = np.where(np.isnan(model.hints.parameters), default, model.hints.parameters)
    parameters = _clipped(
        parameters[None, :], model.parameter_bounds, "parameters", model.parameters, notes
    )[0]
    return Guess((start, end), parameters, mesh.fractions, states, controls, tuple(notes))


def _line(model: Model, mesh: Mesh) -> Array:
    """Return the line between the end conditions; constant where only one end is given."""
    centre = middle(model.state_bounds, np.zeros(model.n_x))
    start, end = middle(model.initial, centre), middle(model.final, centre)
    free_start = ~model.initial.fixed & model.final.fixed
    free_end = ~model.final.fixed & model.initial.fixed
    start = np.where(free_start, np.clip(end, *model.initial), start)
    end = np.where(free_end, np.clip(start, *model.final), end)
    return np.asarray(start + (end - start) * mesh.fractions[:, None])


def _follow(
    values: Array,
    variables: tuple[Variable, ...],
    functions: tuple[GuessFunction | None, ...],
    times: Array,
) -> None:
    """Write what the file says over the default."""
    for variable, function in zip(variables, functions, strict=True):
        if function is not None:
            values[:, variable.entries] = function(times)


def _clipped(
    values: Array,
    bounds: Bounds,
    section: str,
    variables: tuple[Variable, ...],
    notes: list[Note],
) -> Array:
    """Return values within bounds; what moved is noted, what is not finite replaced."""
    default = middle(bounds, np.zeros(values.shape[1]))
    finite = np.where(np.isfinite(values), values, default)
    clipped = np.clip(finite, *bounds)
    for variable in variables:
        part = variable.entries
        moved = np.abs(clipped - finite)[:, part] > MOVED * (1 + np.abs(finite[:, part]))
        if not np.isfinite(values[:, part]).all():
            message = f"the guess of {variable.name} is not finite everywhere; replaced there"
        elif np.any(moved):
            message = f"the guess of {variable.name} was clipped to its bounds"
        else:
            continue
        notes.append(Note(section, variable.name, message))
    return np.asarray(clipped)
