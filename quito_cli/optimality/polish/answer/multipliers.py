"""Multipliers of an extremal as those of a collocation's program; `answer` says how they go."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.hamiltonian import Pontryagin
from quito_cli.optimality.polish.answer.exact import Exact, Sampled
from quito_cli.solvers.residuals import at_its_bound
from quito_cli.transcription.legendre import radau
from quito_cli.transcription.transcribe import Nlp

Array = NDArray[np.float64]


def row_multipliers(system: Pontryagin, nlp: Nlp, exact: Exact, values: Sampled) -> Array:
    """Return the multipliers of all rows, (n_g,), scaled.

    Args:
        system: Pontryagin's system of the problem.
        nlp: the collocation.
        exact: the extremal.
        values: it at the points of the collocation and the ends of its cells.
    """
    m = system.model
    found = np.zeros(len(nlp.row_lower))
    blocks = {block.name: block for block in nlp.blocks}
    found[blocks["dynamics"].rows] = values.costates[:, :-1].ravel()
    pressing = _impulses(exact, values)
    at = 0
    for constraint in m.constraints.path:
        own = slice(at, at + len(constraint.labels))
        at = own.stop
        block = blocks[f"path constraint {constraint.name}"]
        found[block.rows] = pressing[: len(block.fractions), own].ravel()
    at = 0
    for constraint in m.constraints.boundary:
        own = slice(at, at + len(constraint.bounds.lower))
        at = own.stop
        found[blocks[f"boundary constraint {constraint.name}"].rows] = exact.boundary[own]
    for constraint, nu in zip(m.constraints.integral, exact.integral, strict=True):
        found[blocks[f"integral constraint {constraint.name}"].rows] = nu
    for constraint, rho in zip(m.constraints.point, exact.points, strict=True):
        found[blocks[f"point constraint {constraint.name}"].rows] = rho
    return found * nlp.objective_scale / nlp.row_scale


def bound_multipliers(
    system: Pontryagin, nlp: Nlp, exact: Exact, values: Sampled, w: Array, lam_g: Array
) -> Array:
    """Return the multipliers of the bounds of unknowns, (n_w,), scaled.

    Those of states inside the horizon are known. Everything else that is at a bound of its own has
    what the gradient leaves to it, where the sign is right.
    """
    slopes = np.array(nlp.assembled.gradient(w, [])[1]).ravel()
    jacobian = nlp.assembled.jacobian(w, [])[1]
    rest = -slopes - np.array(jacobian.T @ lam_g).ravel()
    limits = np.where(rest > 0, nlp.upper, nlp.lower)
    there = np.isfinite(limits) & at_its_bound(w, nlp.lower, nlp.upper, rest)
    found = np.where(there, rest, 0.0)
    layout = nlp.transcription.layout
    inner = slice(layout.shared + layout.n_x, layout.first_own - layout.n_x)
    own = slice(layout.first_own, layout.first_coefficient)
    bounded = system.model.state_bounds.present
    pressing = np.zeros((values.mu.shape[0], values.mu.shape[1] - 1, layout.n_x))
    rows = len(system.rows) - int(bounded.sum())
    pressing[:, :, bounded] = _impulses(exact, values)[:-1, rows:].reshape(*pressing.shape[:2], -1)
    unscaled = nlp.objective_scale * nlp.unit
    found[inner] = pressing[1:, 0].ravel() * unscaled[inner]
    found[own] = pressing[:, 1:].ravel() * unscaled[own]
    return found


def _impulses(exact: Exact, values: Sampled) -> Array:
    """Return what multipliers of rows amount to at the points and the end, (N D + 1, rows)."""
    degree = values.t.shape[1] - 1
    shares = np.diff(exact.nodes)[:, None] * radau(degree).weights
    rows = values.mu.shape[2]
    found = np.zeros((shares.size + 1, rows))
    found[:-1] = (shares[:, :, None] * values.mu[:, :-1]).reshape(shares.size, rows)
    for one in exact.atoms:
        found[one.node * degree, one.row] += one.size
    return found
