"""What theory says of an answer's errors: of its scheme on its cells, of its control's functions.

Nothing here looks at a residual. Local errors are the difference of the scheme's own steps and half
of them; costates of schemes of low order err as the adjoint scheme does, by what λ' changes over a
cell; polynomials by their last terms. What follows costates is off by all local errors together.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.looking.dilation import dilated, positive
from quito_cli.optimality.looking.flow import explained
from quito_cli.optimality.looking.panels import Panels, substeps
from quito_cli.solution.junctions import width
from quito_cli.transcription.control import ControlBasis

if TYPE_CHECKING:
    from quito_cli.optimality.looking.look import Look

Array = NDArray[np.float64]

FADED = 1e-3
"""Part of their largest values that costates count as, at least."""

ORDERS = {"euler": 1, "trapezoidal": 2}
"""Schemes whose errors are those of a method of lower order than Kutta's."""


@dataclass(frozen=True, eq=False)
class Explained:
    """Errors that an answer may have, by what made it."""

    look: Look

    @cached_property
    def local_errors(self) -> tuple[Array, Array]:
        """How fast the scheme errs in x and λ by theory, a unit of time, (P, n_x) each."""
        options, given = self.look.solution.options, self.look.panels
        order = 1 if options.get("degree") == 1 else ORDERS.get(options["discretization"], 4)
        steps = 1 if given.collocated else substeps(self.look.solution)
        args = (self.look.carrier, self.look.solution, given, self.look.impulses, order, steps)
        by_x, by_costate = (dilated(e / given.lengths[:, None], 2) for e in explained(*args))
        if order < 4:  # costates are those of the adjoint scheme, whose errors are others
            by_costate = by_costate + dilated(self._adjoint_moves(order), 2)
        if given.collocated:  # polynomials meet the equations at points only
            wrong = self.unfollowed.max(axis=1, initial=0.0)[:, None]
            by_x = by_x + _last_terms(given, given.states) + wrong * self.look.state_rates
            by_costate = by_costate + _last_terms(given, given.costates)
            by_costate = by_costate + wrong * self.look.costate_rates
        return by_x, by_costate

    def _adjoint_moves(self, order: int) -> Array:
        """How much λ' changes over a panel with x alone and with λ alone, (P, n_x).

        Of order 2, how much that change does.
        """
        f, p, nu = self.look.flow, self.look.solution.parameters, self.look.impulses.integral
        if len(f.t) == 1:  # with no other panel, all of λ' may be a change
            return np.abs(self.look.point.adjoint)
        here = self.look.point.adjoint[:-1]
        moves = [
            self.look.system.along(f.t[:-1], x, costate, f.u[:-1], p, nu=nu).adjoint - here
            for x, costate in ((f.x[1:], f.costate[:-1]), (f.x[:-1], f.costate[1:]))
        ]
        for _ in range(order - 1):
            moves = [np.diff(move, axis=0, prepend=move[[0]]) for move in moves]
        total = np.abs(np.array(moves)).sum(axis=0)
        return np.vstack([total, total[[-1]]])

    @cached_property
    def unfollowed(self) -> Array:
        """What û may be off by, over its range, because its functions cannot do better; (P, n_u).

        They follow whatever is a cubic over a few cells; fourth differences see the rest. Those of
        a wave of two cells are 16 times its amplitude. A staircase is off by half its steps, a
        piecewise linear control by an eighth of its bends, polynomials by what they do between
        their points.
        """
        look, basis = self.look, self.look.solution.basis
        found = look.differences(4) / 16
        if look.panels.collocated:
            u = look.panels.controls(look.solution, np.array([0.0, 0.5, 1.0])) / look.spans
            found = np.maximum(found, np.abs(u[:, 1] - (u[:, 0] + u[:, 2]) / 2))
        elif not isinstance(basis, ControlBasis) or basis.function.cellwise:
            u = look.flow.u / look.spans
            found = np.maximum(found, np.abs(np.diff(u, axis=0, prepend=u[[0]])) / 2)
        elif not basis.function.scaled:
            found = np.maximum(found, look.bends / 8)
        return dilated(found, width(basis))

    @cached_property
    def drift(self) -> float:
        """Relative error that local errors add up to over the horizon.

        Costates obey a linear equation: their errors grow and fade as they do themselves, and count
        beside what costates are where the errors are made.
        """
        by_x, by_costate = self.local_errors
        given = self.look.panels
        h = given.lengths[:, None]
        total = (h * by_x).sum(axis=0) / positive(np.abs(given.states).max(axis=0))
        sizes = np.maximum(np.abs(given.costates).max(axis=0), self.look.least_costates)
        sizes = np.maximum(sizes, 1e-6 * sizes.max())
        here = np.maximum((np.abs(given.costates[1:]) / sizes).max(axis=1), FADED)
        other = (h * by_costate / sizes).max(axis=1) / here
        return float(max(total.max(), other.sum()))

    @cached_property
    def uneven(self) -> Array:
        """What impulses that differ from one panel to the next do to H_u, (P, n_u)."""
        path = self.look.impulses.path.sum(axis=1)
        total = self.look.flow.bounds.copy()
        if path.any():
            total += np.einsum("pr,prx->px", path, self.look.rows[1][:, : path.shape[1]])
        if not total.any():
            return np.zeros((len(total), len(self.look.names)))
        change = np.abs(np.diff(total, axis=0, prepend=total[[0]]))
        return self.look.pulled(dilated(change, 1))


def _last_terms(given: Panels, values: Array) -> Array:
    """Return the slopes of the last terms of the polynomials of cells, at most, (P, n).

    The leading coefficient is a divided difference; a monic polynomial of degree D is at least
    2 · 4^(−D) somewhere on the unit interval (Chebyshev), and its slope 2D² times that (Markov).
    """
    each = int((given.cells == 0).sum())
    at = np.append(given.begins[:each], 1.0)
    apart = at[:, None] - at + np.eye(len(at))
    # Products of distances on [0, 4] do not underflow: the capacity of that interval is one.
    weights = 2.0 / np.prod(4 * apart, axis=1) * 4.0
    cells = (np.arange(0, len(values) - 1, each)[:, None] + np.arange(each + 1)).ravel()
    top = np.abs(
        np.einsum("d,kdx->kx", weights, values[cells].reshape(-1, each + 1, values.shape[1]))
    )
    lengths = given.lengths.reshape(-1, each).sum(axis=1)[:, None]
    return np.repeat(2 * each**2 * top / lengths, each, axis=0)
