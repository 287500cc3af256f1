"""Model -> the Model of its controls' parts, where any of them has a kink.

Kinks are found term by term, by numbers: where branches agree at random points and their slopes do
not. What the parts are, and what a term becomes, is said in `parts`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import accumulate, pairwise
from typing import TYPE_CHECKING

import numpy as np

from quito_cli.optimality.hamiltonian import pontryagin
from quito_cli.optimality.parts.branches import (
    Stretch,
    branch,
    corner_operations,
    distinct,
    kinks,
    sites,
    terms,
)
from quito_cli.optimality.parts.parts import Cut, Parts
from quito_cli.optimality.symbols.probes import MOST_OPERATIONS, Probe, TooLargeError
from quito_cli.problem.model import (
    Bounds,
    Constraint,
    GuessFunction,
    Hints,
    Model,
    Variable,
    labels,
    units,
)

if TYPE_CHECKING:
    import casadi as ca

MOST_LOOKED_AT = 100_000
"""Operations of all formulas that are looked for corners."""
MOST_SITES = 8
"""Kinks of a control; one with more, such as a table read at it, stays whole."""


def parted(model: Model) -> Parts | None:
    """Return a Model with controls that have kinks taken apart; None where none has any.

    Controls in whose formulas there are jumps, kinks that move, or too many, stay whole.
    """
    if not model.n_u or not _cornered(model):
        return None
    try:
        found = _sites(model)
        if not found:
            return None
        cuts, symbols = _cuts(model, found), _symbols(model)
        return Parts(model, _taken_apart(model, cuts, symbols), cuts)
    except TooLargeError:
        return None


def _cornered(model: Model) -> bool:
    """Whether anything in formulas may have a corner; of very long ones it is not asked."""
    import casadi as ca

    function = ca.Function("all", _symbols(model), [ca.vertcat(*_formulas(model))])
    count = function.n_instructions()
    found = (function.instruction_id(k) in corner_operations() for k in range(count))
    return count <= MOST_LOOKED_AT and any(found)


def _symbols(model: Model) -> list[ca.SX]:
    return [model.x, model.u, model.p, model.t]


def _formulas(model: Model) -> list[ca.SX]:
    """Return all scalar formulas along the horizon."""
    given = model.constraints
    values = [model.xdot, model.lagrange]
    values += [c.value for c in (*given.path, *given.integral, *given.point)]
    return [value[k] for value in values for k in range(value.numel())]


def _sites(model: Model) -> dict[int, tuple[float, ...]]:
    """Return where formulas have kinks, by control; none of a control with jumps.

    Raises:
        TooLargeError: formulas are too long to be worked on.
    """
    import casadi as ca

    symbols, probe = _symbols(model), Probe(pontryagin(model))
    found: dict[int, list[float]] = {}
    jumps: set[int] = set()
    for formula in _formulas(model):
        if not sites(formula, symbols, model.u):
            continue
        if ca.Function("size", symbols, [formula]).n_instructions() > MOST_OPERATIONS:
            raise TooLargeError
        for term in terms(formula, model.u):
            for i, given in sites(term, symbols, model.u).items():
                own, jump = kinks(term, symbols, model.u, i, given, probe)
                found.setdefault(i, []).extend(own)
                jumps |= {i} if jump else set()
    kept = {i: tuple(distinct(own)) for i, own in found.items() if own and i not in jumps}
    return {i: own for i, own in kept.items() if len(own) <= MOST_SITES}


def _cuts(model: Model, found: dict[int, tuple[float, ...]]) -> tuple[Cut, ...]:
    names, all_units = labels(model.controls), units(model.controls)
    rows = zip(names, all_units, *model.control_bounds, strict=True)
    return tuple(
        Cut(
            name,
            unit,
            float(low),
            float(high),
            tuple(b for b in found.get(i, ()) if low < b < high),
        )
        for i, (name, unit, low, high) in enumerate(rows)
    )


def _taken_apart(model: Model, cuts: tuple[Cut, ...], symbols: list[ca.SX]) -> Model:
    import casadi as ca

    names = [label for cut in cuts for label in cut.labels]
    v = ca.SX.sym("v", len(names))
    all_units = [cut.unit for cut in cuts for _ in cut.labels]
    apart = _Apart(model, cuts, v, symbols)
    given, size = model.constraints, ca.vertcat(*apart.wholes)

    def changed(constraint: Constraint) -> Constraint:
        value, sides = apart(constraint.value), ca.substitute(constraint.size, model.u, size)
        return replace(constraint, value=value, size=sides)

    return replace(
        model,
        controls=tuple(
            Variable(name, 1, i, unit)
            for i, (name, unit) in enumerate(zip(names, all_units, strict=True))
        ),
        u=v,
        xdot=apart(model.xdot),
        lagrange=apart(model.lagrange),
        control_bounds=Bounds(
            *(np.concatenate(side) for side in zip(*(c.bounds for c in cuts), strict=True))
        ),
        constraints=replace(
            given,
            path=tuple(map(changed, given.path)),
            integral=tuple(map(changed, given.integral)),
            point=tuple(map(changed, given.point)),
        ),
        hints=_hints(model, cuts),
        known=None,
        views=(),
        lookups=(),
    )


class _Apart:
    """Formulas of controls ↦ formulas of their parts."""

    def __init__(self, model: Model, cuts: tuple[Cut, ...], v: ca.SX, symbols: list[ca.SX]) -> None:
        import casadi as ca

        ends = list(accumulate((cut.count for cut in cuts), initial=0))
        self._model, self._cuts = model, cuts
        self._probe = Probe(pontryagin(model))
        self._parts = [v[slice(a, b)] for a, b in pairwise(ends)]
        self._all = ca.vertcat(model.u, v)
        x, u, p, t = symbols
        self._symbols = [x, ca.vertcat(u, v), p, t]

    @property
    def wholes(self) -> list[ca.SX]:
        """u in terms of the parts, by control."""
        import casadi as ca

        return [
            cut.sites[0] - v[0] + ca.sum1(v[1:]) if cut.sites else v
            for cut, v in zip(self._cuts, self._parts, strict=True)
        ]

    def __call__(self, formula: ca.SX) -> ca.SX:
        import casadi as ca

        rows = [sum(self._terms(formula[k]), ca.SX(0)) for k in range(formula.numel())]
        return ca.cse(ca.reshape(ca.vertcat(*rows), *formula.shape))

    def _terms(self, formula: ca.SX) -> Iterator[ca.SX]:
        import casadi as ca

        u = self._model.u
        for term in terms(formula, u) if ca.depends_on(formula, u) else [formula]:
            own, corners = term, sites(term, _symbols(self._model), u)
            for i in range(len(self._cuts)):
                given = corners.get(i, [])
                bends = [b for b in given if not self._alike(term, i, given, b)]
                own = self._of(own, i, given, bends)
            yield own

    def _alike(self, term: ca.SX, i: int, given: list[float], site: float) -> bool:
        """Whether a term is the same on both sides of a corner."""
        k, ends, symbols = given.index(site), [-np.inf, *given, np.inf], _symbols(self._model)
        stretches = Stretch(i, ends[k], site), Stretch(i, site, ends[k + 2])
        below, above = (branch(term, symbols, self._model.u, one) for one in stretches)
        return self._probe.vanishes(above - below)

    def _of(self, term: ca.SX, i: int, corners: list[float], bends: list[float]) -> ca.SX:
        """Return a term with one control taken apart."""
        import casadi as ca

        u, cut, v = self._model.u[i], self._cuts[i], self._parts[i]
        if not ca.depends_on(term, u):
            return term
        if not cut.sites:
            own = branch(term, self._symbols, self._all, Stretch(i, cut.lower, cut.upper))
            return ca.substitute(own, u, self.wholes[i])
        if not corners and not ca.depends_on(ca.jacobian(term, u), u):
            return ca.substitute(term, u, self.wholes[i])
        branches = [self._smooth(term, i, *ends, corners, bends) for ends in pairwise(cut.ends)]
        total = ca.substitute(branches[0], u, cut.sites[0] - v[0])
        for j, site in enumerate(cut.sites, start=1):
            total += ca.substitute(branches[j], u, site + v[j])
            total -= ca.substitute(branches[j], u, ca.SX(site))
        return total

    def _smooth(
        self, term: ca.SX, i: int, low: float, high: float, corners: list[float], bends: list[float]
    ) -> ca.SX:
        """Return a term as it is on a stretch that may have corners inside, but no kinks."""
        import casadi as ca

        ends = [low, *(b for b in corners if Stretch(i, low, high).above(b) is None), high]
        own = branch(term, self._symbols, self._all, Stretch(i, ends[-2], ends[-1]))
        for a, b in reversed(list(pairwise(ends[:-1]))):
            if b in bends:
                below = branch(term, self._symbols, self._all, Stretch(i, a, b))
                own = ca.if_else(self._model.u[i] < b, below, own)
        return own


def _hints(model: Model, cuts: tuple[Cut, ...]) -> Hints:
    """Return hints of the parts."""
    guesses: list[GuessFunction | None] = []
    entries = [
        (guess, k)
        for variable, guess in zip(model.controls, model.hints.controls, strict=True)
        for k in range(variable.size)
    ]
    for cut, (guess, k) in zip(cuts, entries, strict=True):
        guesses += [None if guess is None else _guess(cut, guess, k, j) for j in range(cut.count)]
    scale = np.repeat(model.hints.control_scale, [cut.count for cut in cuts])
    return replace(model.hints, controls=tuple(guesses), control_scale=scale)


def _guess(cut: Cut, guess: GuessFunction, k: int, j: int) -> GuessFunction:
    """Return the guess of part j from that of entry k of a variable."""
    return lambda t: cut.split(np.asarray(guess(t))[:, k])[:, [j]]
