"""Where the solver starts: the line between the end conditions, the middle of the bounds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from quito_cli.problem.model import Bounds, Model
from quito_cli.transcription.control import ControlBasis
from quito_cli.transcription.layout import Layout
from quito_cli.transcription.mesh import Mesh

Array = NDArray[np.float64]


def middle(bounds: Bounds, otherwise: Array) -> Array:
    """Return the middle of bounds; the nearest to `otherwise` where a side is open."""
    lower, upper = bounds
    closed = np.isfinite(lower) & np.isfinite(upper)
    inside = np.clip(otherwise, lower, upper)
    with np.errstate(invalid="ignore"):  # inf − inf on open sides, not used there
        return np.where(closed, (lower + upper) / 2, inside)


def initial_guess(model: Model, mesh: Mesh, basis: ControlBasis, layout: Layout) -> Array:
    """Return a guess of all unknowns."""
    centre = middle(model.state_bounds, np.zeros(model.n_x))
    start, end = middle(model.initial, centre), middle(model.final, centre)
    free_start = ~model.initial.fixed & model.final.fixed
    free_end = ~model.final.fixed & model.initial.fixed
    start = np.where(free_start, np.clip(end, *model.initial), start)
    end = np.where(free_end, np.clip(start, *model.final), end)
    nodes = start + (end - start) * mesh.fractions[:, None]
    control = middle(model.control_bounds, np.zeros(model.n_u))
    instants = (model.initial_time, model.final_time)
    shared = [instant.guess for instant in instants if not instant.fixed]
    inner = np.repeat(nodes[:-1], layout.own, axis=0)
    return np.concatenate(
        [
            shared,
            middle(model.parameter_bounds, np.zeros(model.n_p)),
            nodes.ravel(),
            inner.ravel(),
            np.tile(control, basis.count),
        ]
    )
