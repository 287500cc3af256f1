"""Model -> Nlp: which terms there are, and the bounds and guess of every unknown."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from quito_cli.problem.model import Model
from quito_cli.transcription.blocks import (
    add_control_rows,
    add_ends,
    add_points,
    bounded_by_coefficients,
)
from quito_cli.transcription.cells import PathPoints
from quito_cli.transcription.guess import make_guess
from quito_cli.transcription.layout import Layout
from quito_cli.transcription.method import Dynamics, Method
from quito_cli.transcription.program import Program
from quito_cli.transcription.rows import Rows
from quito_cli.transcription.scaling import unknown_scales
from quito_cli.transcription.structure import nonlinearity
from quito_cli.transcription.terms import Assembled, Term, assemble

Array = NDArray[np.float64]

COST_SIZE = 100.0
"""What the objective is scaled to: at size one singular problems end with an unresolved control."""


FAR_TOO_SMALL = 0.1
"""Part of the wanted scale under which the objective counts for too little."""


def wanted_scale(cost: float) -> float:
    """Return the scale of the objective that a cost of that size calls for."""
    return COST_SIZE / max(1.0, abs(cost)) if np.isfinite(cost) else COST_SIZE


@dataclass(frozen=True)
class Transcription:
    """How a Model was made finite; what reads an answer back from the unknowns."""

    model: Model
    method: Method
    layout: Layout
    dynamics: Dynamics


@dataclass(frozen=True)
class Nlp:
    """Minimise objective subject to bounds on unknowns and rows; all in scaled units."""

    assembled: Assembled
    terms: tuple[Term, ...]
    """What `assembled` is the sum of."""
    lower: Array
    upper: Array
    guess: Array
    row_lower: Array
    row_upper: Array
    blocks: tuple[Rows, ...]
    unit: Array
    """(n_w,): an unknown is its scaled value times its unit."""
    row_scale: Array
    """(n_g,): a scaled row is the row times its scale."""
    objective_scale: float
    """objective = scale · cost (of the minimisation)."""
    notes: tuple[str, ...]
    """What a reader should know of how it was made."""
    transcription: Transcription

    @cached_property
    def nonlinearity(self) -> str | None:
        """What keeps it from being a quadratic program, by name; None where it is one."""
        return nonlinearity(self)


def transcribe(
    model: Model,
    method: Method,
    objective_scale: float | None,
    path_points: PathPoints | None,
) -> Nlp:
    """Return the nonlinear program of `model`.

    Args:
        model: the problem.
        method: shooting or collocation, on a mesh.
        objective_scale: factor of the cost; None scales by its size at the guess.
        path_points: where path constraints hold; None where it fits each of them.
    """
    layout, guess = method.layout(model), make_guess(model, method.sampled)
    unit, state_unit = unknown_scales(model, method, layout, guess)
    program = Program(model, method, layout, guess, (unit, state_unit))
    dynamics = method.add_dynamics(program, path_points)
    add_ends(program)
    add_points(program)
    add_control_rows(program)
    lower, upper = _bounds(model, method, layout)
    start = np.clip(method.start(guess, layout), lower, upper) / unit
    scale = objective_scale or wanted_scale(_cost_at(program.terms, start))
    terms = tuple(replace(term, weights=scale * term.weights) for term in program.terms)
    row_lower, row_upper, row_scale = program.book.gathered()
    return Nlp(
        assembled=assemble(terms, layout.size, row_scale),
        terms=terms,
        lower=lower / unit,
        upper=upper / unit,
        guess=start,
        row_lower=row_lower,
        row_upper=row_upper,
        blocks=tuple(program.book.blocks),
        unit=unit,
        row_scale=row_scale,
        objective_scale=scale,
        notes=tuple(note.message for note in guess.notes),
        transcription=Transcription(model, method, layout, dynamics),
    )


def _bounds(model: Model, method: Method, layout: Layout) -> tuple[Array, Array]:
    """Return bounds of all unknowns."""
    basis, sides = method.basis, []
    for side, infinity in enumerate((-np.inf, np.inf)):
        instants = (model.initial_time, model.final_time)
        shared = [(i.lower, i.upper)[side] for i in instants if not i.fixed]
        nodes = np.tile(list(model.state_bounds)[side], (layout.cells + 1, 1))
        nodes[0], nodes[-1] = list(model.initial)[side], list(model.final)[side]
        own = list(model.state_bounds)[side] if method.own_are_states else infinity
        inner = np.broadcast_to(own, (layout.cells * layout.own, layout.n_x)).ravel()
        control = list(model.control_bounds)[side]
        # Rows say nothing of û beyond its last point: a range of room keeps ghosts from running.
        room = np.diff(list(model.control_bounds), axis=0)[0] * np.sign(infinity)
        loose = np.where(np.isfinite(room), control + room, infinity)
        coefficient = np.where(bounded_by_coefficients(model, basis), control, loose)
        parts = [shared, list(model.parameter_bounds)[side], nodes.ravel(), inner]
        sides.append(np.concatenate([*parts, np.tile(coefficient, basis.count)]))
    return sides[0], sides[1]


def _cost_at(terms: list[Term], w: Array) -> float:
    """Return the size of the cost at `w`; 0 where it is not finite."""
    total = 0.0
    for term in terms:
        if term.in_objective:
            z = np.array(term.gather @ w).reshape(term.count, -1).T
            y = np.array(term.function.map(term.count)(z, term.parameters))
            with np.errstate(invalid="ignore", over="ignore"):  # a guess may hit a pole
                total += float((term.weights * y)[term.weights != 0].sum())
    return abs(total) if np.isfinite(total) else 0.0
