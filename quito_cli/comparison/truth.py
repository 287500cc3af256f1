"""What answers are held against: the file's reference, or a solve."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from quito_cli.comparison.comparison import Truth
from quito_cli.comparison.norms import grid
from quito_cli.problem.model import Known, Model
from quito_cli.solution.solution import Solution
from quito_cli.solution.variation import total_variation

Array = NDArray[np.float64]


BLUR = 6
"""Cells to either side over which a quasi-interpolant may spread a jump."""
MOST_BLUR = 0.02
"""Of the horizon, where cells are long: those of a collocation hold many points."""


def from_reference(model: Model) -> Truth | None:
    """Return what the file knows, or None where it knows no control, or without any, no state."""
    known = model.known
    if known is None or not (known.controls if model.controls else known.states):
        return None
    pieces = [
        piece for part in (known.states, known.controls) for p in part.values() for piece in p
    ]
    ends = {piece.until for piece in pieces if np.isfinite(piece.until)}
    return Truth(
        title="reference of the file",
        cost=known.cost,
        accuracy=known.accuracy,
        switching_times=known.switching_times,
        control=partial(Known.sample, known.controls, model.controls),
        state=partial(Known.sample, known.states, model.states),
        breaks=tuple(sorted(ends | set(known.switching_times))),
    )


def from_solution(solution: Solution, title: str, known: Known | None = None) -> Truth:
    """Return a solve as the truth, with the switching times that the file knows.

    A polished one knows them itself, and its jumps are jumps.
    """
    start, end = float(solution.times[0]), float(solution.times[-1])
    own = solution.switching_times if solution.polished else ()
    blur = min(BLUR * float(np.diff(solution.times).max()), MOST_BLUR * (end - start))
    return Truth(
        title=title,
        cost=solution.cost,
        accuracy=None,
        switching_times=known.switching_times if known else own,
        control=solution.control,
        state=solution.state,
        breaks=tuple(float(t) for t in solution.times),
        horizon=(start, end),
        blur=0.0 if solution.polished else blur,
    )


def with_variation(truth: Truth, horizon: tuple[float, float]) -> Truth:
    """Return the truth with the total variation of its controls, jumps counted."""
    found = variation(truth, np.array(horizon), horizon)
    return replace(truth, total_variation=found)


def variation(
    of: Truth | Solution, nodes: Array, horizon: tuple[float, float]
) -> tuple[float, ...]:
    """Return the total variation of each control on the horizon, sampled as errors are."""
    breaks = np.array(of.breaks) if isinstance(of, Truth) else np.zeros(0)
    values = grid(nodes, breaks, horizon).sample(of.control)
    in_order = values.reshape(values.shape[0] * values.shape[1], values.shape[2])
    return tuple(float(v) for v in total_variation(in_order))
