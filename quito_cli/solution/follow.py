"""An earlier answer as the guess of a new solve, whatever its mesh."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from quito_cli.errors import UsageError
from quito_cli.problem.model import GuessFunction, Instant, Model, Variable, labels
from quito_cli.solution.solution import Quantity, Solution
from quito_cli.solvers import Start, start_at
from quito_cli.transcription.control import Basis
from quito_cli.transcription.rows import Rows
from quito_cli.transcription.transcribe import Nlp

Array = NDArray[np.float64]

ROUNDING = 1e-12
"""Fraction of the horizon by which a saved node may differ from what it was."""


def guided(model: Model, earlier: Solution) -> Model:
    """Return the model with its guesses taken from `earlier`: by name, over the whole horizon.

    Variables that `earlier` does not have keep their own guess.

    Raises:
        UsageError: `earlier` shares no state with the problem.
    """
    known = {quantity.name for quantity in earlier.origin.states}
    if known.isdisjoint(label for state in model.states for label in state.labels):
        raise UsageError(
            f"the result to start from, {earlier.origin.name}, shares no state with this problem"
        )
    first, last = model.initial_time, model.final_time
    model = replace(
        model,
        initial_time=_guessed(first, float(earlier.times[0])),
        final_time=_guessed(last, float(earlier.times[-1])),
    )
    start, horizon = model.initial_time.guess, model.final_time.guess - model.initial_time.guess

    def at(t: Array) -> Array:
        """Times of the new horizon as times of the earlier one."""
        fractions = (t - start) / horizon
        return np.asarray(earlier.times[0] + fractions * (earlier.times[-1] - earlier.times[0]))

    origin, hints = earlier.origin, model.hints
    states = (
        _function(v, origin.states, lambda t: earlier.state(at(t)), own)
        for v, own in zip(model.states, hints.states, strict=True)
    )
    controls = (
        _function(v, origin.controls, lambda t: earlier.control(at(t)), own)
        for v, own in zip(model.controls, hints.controls, strict=True)
    )
    parameters = hints.parameters.copy()
    values = {q.name: v for q, v in zip(origin.parameters, earlier.parameters, strict=True)}
    for variable in model.parameters:
        for i, label in enumerate(variable.labels):
            parameters[variable.first + i] = values.get(label, parameters[variable.first + i])
    hints = replace(hints, states=tuple(states), controls=tuple(controls), parameters=parameters)
    return replace(model, hints=hints)


def _guessed(instant: Instant, time: float) -> Instant:
    if instant.fixed:
        return instant
    return replace(instant, guess=float(np.clip(time, instant.lower, instant.upper)))


def _function(
    variable: Variable,
    quantities: tuple[Quantity, ...],
    values: GuessFunction,
    otherwise: GuessFunction | None,
) -> GuessFunction | None:
    """Return the variable's columns of `values`, or its own guess where one is missing."""
    names = [quantity.name for quantity in quantities]
    if not set(variable.labels) <= set(names):
        return otherwise
    columns = [names.index(label) for label in variable.labels]
    return lambda t: values(t)[:, columns]


def resumed(nlp: Nlp, earlier: Solution) -> tuple[Nlp, Start]:
    """Return `nlp`, whose guess is from `earlier`, with all else there is of it to start warm.

    Coefficients are taken as they are where control and mesh are the same. Multipliers are found
    by the names of their rows, and interpolated in time where the places differ.
    """
    made = nlp.transcription
    method, first = made.method, made.layout.first_coefficient
    guess = nlp.guess.copy()
    names = [quantity.name for quantity in earlier.origin.controls]
    same = _alike(method.basis, earlier.basis) and names == list(labels(made.model.controls))
    nodes = method.mesh.fractions
    if same and np.allclose(nodes, earlier.mesh.fractions, rtol=0, atol=ROUNDING):
        guess[first:] = earlier.coefficients.ravel() / nlp.unit[first:]
    nlp = replace(nlp, guess=np.clip(guess, nlp.lower, nlp.upper))
    lam_g = np.zeros(len(nlp.row_lower))
    for block in nlp.blocks:
        lam_g[block.rows] = _multipliers(block, earlier).ravel()
    return nlp, start_at(nlp, lam_g * nlp.objective_scale / nlp.row_scale)


def _alike(one: Basis, other: Basis) -> bool:
    """Whether the coefficients of two controls mean the same."""
    same = one.attributes == other.attributes
    return same and (one.cells, one.count) == (other.cells, other.count)


def _multipliers(block: Rows, earlier: Solution) -> Array:
    """Return the multipliers of a block's rows, (places, labels), unscaled; zero where unknown.

    Those of the dynamics are costates; those of a path constraint are densities times the distance
    of their places.
    """
    found = np.zeros(block.lower.shape)
    if block.name not in earlier.multipliers:
        return found
    values, axes = earlier.multipliers[block.name], earlier.multiplier_axes[block.name]
    start, end = earlier.times[0], earlier.times[-1]
    places = (axes.times - start) / (end - start)
    density = 1.0 if block.name == "dynamics" else len(places) / len(block.fractions)
    for i, label in enumerate(block.labels):
        if label in axes.labels:
            column = values[:, axes.labels.index(label)]
            found[:, i] = density * np.interp(block.fractions, places, column)
    return found
