"""What a solver hands back, in words and numbers that do not depend on the solver."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Status(Enum):
    """How a solve ended; the values are sentences."""

    SOLVED = "The first-order conditions hold to the tolerance."
    INACCURATE = "The solver reports success, but the recomputed residuals are above the tolerance."
    ACCEPTABLE = "The solver stopped at a point that is only nearly optimal."
    INFEASIBLE = (
        "The solver converged to a point that violates the constraints as little as it can."
    )
    ITERATION_LIMIT = "The iteration limit was reached before convergence."
    TIME_LIMIT = "The time limit was reached before convergence."
    NOT_FINITE = "An expression of the problem became infinite or undefined."
    STUCK = "The solver could not make further progress."
    DIVERGED = "The iterates diverge: the problem may be unbounded."
    TOO_FEW_FREEDOMS = "The discretized problem has more equations than unknowns."
    INTERRUPTED = "Interrupted: this is the best iterate so far; the guess, if there is none."
    FAILED = "The solver failed."


@dataclass(frozen=True)
class Progress:
    """One iteration, for a progress line."""

    iteration: int
    cost: float
    """In the file's sense."""
    violation: float
    """Largest violation of a constraint of the nonlinear program."""
    stage: str = ""
    """Of several solves after one another, which one: `mesh 3, 143 cells`."""


Listener = Callable[[Progress], None]
"""Told of every iteration."""


@dataclass(frozen=True)
class Outcome:
    """A point, its multipliers, and how the solver came there."""

    status: Status
    """As the solver says; `residuals` has the judgement."""
    w: Array
    """(n_w,) unknowns."""
    lam_g: Array
    """(n_g,) multipliers of the rows: positive at upper bounds."""
    lam_w: Array
    """(n_w,) multipliers of the bounds: positive at upper bounds."""
    iterations: int | None
    """None where the solver does not say."""
    history: dict[str, Array]
    """By iteration: objective (the cost, in the file's sense), primal_infeasibility,
    dual_infeasibility, barrier_parameter; empty where the solver does not say."""
    build_seconds: float
    solve_seconds: float
    said: str
    """The solver's own word for its status."""
    solver: str
    """The row that ran."""

    def following(self, before: Outcome) -> Outcome:
        """Return this outcome with the counts, times and history of one that led to it."""
        both = (self.iterations, before.iterations)
        names = self.history.keys() & before.history.keys()
        return replace(
            self,
            iterations=None if None in both else sum(n or 0 for n in both),
            history={n: np.append(before.history[n], self.history[n]) for n in sorted(names)},
            build_seconds=self.build_seconds + before.build_seconds,
            solve_seconds=self.solve_seconds + before.solve_seconds,
        )
