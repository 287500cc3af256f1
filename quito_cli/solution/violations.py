"""The largest violation of every bound and end condition, between the nodes too."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from quito_cli.problem.model import Bounds, Model, labels

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Violation:
    """The worst point of one condition."""

    constraint: str
    """In the words of the problem file, such as "x2 >= -0.4"."""
    time: float
    amount: float
    """How much it is violated, in the unit of the quantity; 0 where it holds everywhere."""
    scale: float
    """Size of the quantity, to judge the amount by."""

    @property
    def relative(self) -> float:
        """Amount over scale."""
        return self.amount / self.scale


def violations(model: Model, times: Array, states: Array, controls: Array) -> tuple[Violation, ...]:
    """Return the worst point of every bound and end condition on a dense grid, worst first.

    Args:
        model: the problem.
        times: (points,) increasing, from the initial to the final time.
        states: (points, n_x).
        controls: (points, n_u).
    """
    ends = slice(0, 1), slice(-1, None)
    initial = [f"initial({name})" for name in labels(model.states)]
    final = [f"final({name})" for name in labels(model.states)]
    found = [
        *_of(labels(model.states), model.state_bounds, times, states, states),
        *_of(labels(model.controls), model.control_bounds, times, controls, controls),
        *_of(tuple(initial), model.initial, times[ends[0]], states[ends[0]], states),
        *_of(tuple(final), model.final, times[ends[1]], states[ends[1]], states),
    ]
    return tuple(sorted(found, key=lambda violation: -violation.relative))


def _of(
    names: tuple[str, ...], bounds: Bounds, times: Array, values: Array, everywhere: Array
) -> Iterator[Violation]:
    for i, name in enumerate(names):
        lower, upper = float(bounds.lower[i]), float(bounds.upper[i])
        size = float(np.max(np.abs(everywhere[:, i])))
        scale = max(upper - lower if np.isfinite(upper - lower) else 0.0, size) or 1.0
        if lower == upper:
            amounts = np.abs(values[:, i] - lower)
            yield _worst(f"{name} = {lower:g}", times, amounts, scale)
            continue
        if np.isfinite(lower):
            yield _worst(f"{name} >= {lower:g}", times, lower - values[:, i], scale)
        if np.isfinite(upper):
            yield _worst(f"{name} <= {upper:g}", times, values[:, i] - upper, scale)


def _worst(name: str, times: Array, amounts: Array, scale: float) -> Violation:
    if not np.isfinite(amounts).all():
        return Violation(name, float(times[np.argmin(np.isfinite(amounts))]), np.inf, scale)
    worst = int(np.argmax(amounts))
    return Violation(name, float(times[worst]), max(float(amounts[worst]), 0.0), scale)
