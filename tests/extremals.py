"""Exact extremals made by hand, from formulas or by an integrator that is not quito's."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import quito_cli as quito
from quito_cli.optimality.hamiltonian import pontryagin
from quito_cli.optimality.polish.answer.answer import answer
from quito_cli.optimality.polish.answer.exact import Atom, Exact, Sampled
from quito_cli.options import Options
from quito_cli.problem.build import build
from quito_cli.problem.model import Model
from quito_cli.solution.optimal import Arc
from quito_cli.solution.polishing import Polishing, PolishStatus
from quito_cli.transcription.legendre import Nodes

Array = NDArray[np.float64]
Law = Callable[[Array, Array, Array], Array]
"""t (points,), x (points, n_x), λ (points, n_x) ↦ values (points, …)."""
Path = Callable[[Array], tuple[Array, Array]]
"""t (points,) ↦ states and costates, (points, n_x) each."""

STAGES = 10
UNSURE = 1e-12


@dataclass(frozen=True)
class Phase:
    """A stretch of an extremal."""

    end: float
    control: Law
    """(points, n_u)."""
    path: Path | None = None
    """Where states and costates are known by formulas; else they are integrated."""
    mu: Law | None = None
    """(points, rows)."""
    segments: int = 1
    jump: tuple[float, ...] = ()
    """What λ falls by at its end."""


@dataclass(frozen=True)
class Extremal:
    """What an Exact is made of."""

    problem: quito.Problem
    phases: tuple[Phase, ...]
    arcs: dict[str, str]
    """Kinds of the arcs of each control and row, in words, one a phase; neighbours are merged."""
    start: tuple[Array, Array]
    """x and λ at the initial time."""
    first: float = 0.0
    atoms: tuple[Atom, ...] = ()
    cost: float = 0.0
    boundary: tuple[float, ...] = ()
    integral: tuple[float, ...] = ()
    points: tuple[tuple[float, ...], ...] = ()
    parameters: tuple[float, ...] = ()
    model: Model = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "model", build(self.problem))

    @property
    def times(self) -> list[float]:
        """Of the ends of the phases."""
        return [self.first, *(phase.end for phase in self.phases)]

    def exact(self) -> Exact:
        """Sample it at Gauss points of its segments and both their ends."""
        c = np.concatenate([[0.0], (1 + np.polynomial.legendre.leggauss(STAGES)[0]) / 2, [1.0]])
        system, nodes = pontryagin(self.model), [self.first]
        parts: list[tuple[Array, ...]] = []
        x, costate = self.start
        for phase, begin in zip(self.phases, self.times[:-1], strict=True):
            for a, b in pairwise(np.linspace(begin, phase.end, phase.segments + 1)):
                t = a + (b - a) * c
                if phase.path is not None:
                    states, costates = phase.path(t)
                else:
                    states, costates = self._integrated(phase, t, x, costate)
                u = phase.control(t, states, costates)
                mu = np.zeros((len(t), len(system.rows)))
                if phase.mu is not None:
                    mu = phase.mu(t, states, costates)
                parts.append((t, states, costates, u, mu))
                x, costate = states[-1], costates[-1]
                nodes.append(float(b))
            costate = costate - np.array(phase.jump or 0.0)
        return Exact(
            np.array(nodes),
            Nodes(c),
            Sampled(*(np.array(one) for one in zip(*parts, strict=True))),
            np.array(self.parameters, dtype=float),
            np.array(self.boundary, dtype=float),
            np.array(self.integral, dtype=float),
            tuple(np.array(one) for one in self.points),
            self.atoms,
            tuple(arc for of, words in self.arcs.items() for arc in self._arcs(of, words.split())),
            self.cost,
        )

    def _arcs(self, of: str, kinds: Sequence[Any]) -> list[Arc]:
        found: list[Arc] = []
        times = self.times
        for k, kind in enumerate(kinds):
            doubts = (UNSURE * (k > 0), UNSURE * (k + 1 < len(kinds)))
            arc = Arc(of, kind, times[k], times[k + 1], *doubts)
            if found and found[-1].kind == kind:
                arc = replace(
                    arc, start=found[-1].start, start_uncertainty=found[-1].start_uncertainty
                )
                found.pop()
            found.append(arc)
        return found

    def _integrated(self, phase: Phase, t: Array, x: Array, costate: Array) -> tuple[Array, Array]:
        """Carry x and λ from each time to the next, so that nothing is interpolated."""
        n, slopes = self.model.n_x, pontryagin(self.model).functions
        f, p, nu = self.model.right_hand_side, np.array(self.parameters), np.array(self.integral)

        def rates(t: float, y: Array) -> Array:
            at, given = np.array([t]), (y[None, :n], y[None, n:])
            u = phase.control(at, *given)[0]
            mu = phase.mu(at, *given)[0] if phase.mu else np.zeros(slopes.size1_in(5))
            xdot = np.array(f(y[:n], u, p, t)[0]).ravel()
            return np.append(xdot, np.array(slopes(y[:n], y[n:], u, p, t, mu, nu)[1]).ravel())

        found = [np.append(x, costate)]
        for a, b in pairwise(t):
            run = solve_ivp(rates, (a, b), found[-1], method="DOP853", rtol=3e-14, atol=1e-15)
            found.append(run.y[:, -1])
        both = np.array(found)
        return both[:, :n], both[:, n:]


POLISHED = Polishing(PolishStatus.POLISHED, "", (), 1e-15, 0.1, 1.0, 3, 3)


def polished(made: Extremal, exact: Exact, direct: quito.Solution) -> quito.Solution:
    """Return the answer of an extremal."""
    options = Options.resolve(made.problem.options, {})
    return answer(made.problem, made.model, options, exact, direct, POLISHED, 0.5)
