"""An earlier answer as the guess of a new solve, whatever its mesh."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from quito_cli.errors import UsageError
from quito_cli.problem.model import GuessFunction, Instant, Model, Variable
from quito_cli.solution.solution import Quantity, Solution

Array = NDArray[np.float64]


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
