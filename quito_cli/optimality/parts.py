"""Controls with kinks taken apart, so that nothing has one any more.

Where H has kinks at b_1 < … < b_m in a control, that control becomes m + 1 parts of one sign each,

    u = b_1 − v_0 + v_1 + … + v_m,    0 ≤ v_0 ≤ b_1 − lower,    0 ≤ v_j ≤ b_{j+1} − b_j,

and a term φ(u) of costs, dynamics and constraints becomes one that is smooth in every part,

    φ_0(b_1 − v_0) + Σ_j φ_j(b_j + v_j) − φ_j(b_j),

φ_j its branch between b_j and b_{j+1}: |u| becomes v_0 + v_1, v_0 = max(−u, 0) and v_1 = max(u, 0).
They are the same as long as parts are filled in order, v_j > 0 only where what is below is full.
H of the parts is never below the least H of u then, so that parts in order that minimise it give a
u that does. At rest on a kink two parts are at bounds, where H_v ≥ 0 of the one and H_v ≤ 0 or ≥ 0
of the other say that zero is between the slopes of H on either side: the subdifferential has it
(F. H. Clarke, Optimization and Nonsmooth Analysis, 1983, section 5.2). Bang-off-bang is bang-bang
of the parts, its junctions where the slope on one side is zero. Where H is concave at a kink
minimising parts are out of order, and the answer is none.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import accumulate, pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.branches import Stretch, branch, distinct, kinks, sites, terms
from quito_cli.optimality.hamiltonian import pontryagin
from quito_cli.optimality.probes import MOST_OPERATIONS, Probe, TooLargeError
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

Array = NDArray[np.float64]

MOST_SITES = 8
"""Kinks of a control; one with more, such as a table read at it, stays whole."""


@dataclass(frozen=True)
class Cut:
    """A control, and where it has kinks."""

    label: str
    unit: str
    lower: float
    upper: float
    sites: tuple[float, ...]
    """Within its bounds, increasing; none of a control that stays whole."""

    @property
    def ends(self) -> tuple[float, ...]:
        """Where its parts begin and end, one more than parts."""
        return (self.lower, *self.sites, self.upper)

    @property
    def count(self) -> int:
        """Parts."""
        return len(self.sites) + 1

    @property
    def bounds(self) -> Bounds:
        """Of its parts, (count,) each."""
        if not self.sites:
            return Bounds(np.array([self.lower]), np.array([self.upper]))
        return Bounds(np.zeros(self.count), np.diff(self.ends))

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of its parts."""
        if not self.sites:
            return (self.label,)
        first, last = (self._from(site) for site in (self.sites[0], self.sites[-1]))
        inner = (f"{self._from(a)} to {b:g}" for a, b in pairwise(self.sites))
        return (f"{first}⁻", *inner, f"{last}⁺")

    def _from(self, site: float) -> str:
        if site == 0:
            return self.label
        return f"({self.label} {'-' if site > 0 else '+'} {abs(site):g})"

    @property
    def told(self) -> str:
        """What it is the sum of."""
        first, *rest = self.labels
        start = f"{self.sites[0]:g} - " if self.sites[0] else "-"
        return f"{self.label} = {start}{' + '.join([first, *rest])}"

    def split(self, u: Array) -> Array:
        """Return the parts, (points, count), of values (points,)."""
        if not self.sites:
            return u[:, None]
        widths = [*np.diff(self.sites), np.inf]
        above = [np.clip(u - b, 0.0, w) for b, w in zip(self.sites, widths, strict=True)]
        return np.column_stack([np.maximum(self.sites[0] - u, 0.0), *above])

    def merged(self, parts: Array) -> Array:
        """Return values, (points,), of parts (points, count)."""
        if not self.sites:
            return parts[:, 0]
        return np.asarray(self.sites[0] - parts[:, 0] + parts[:, 1:].sum(axis=1))

    def disorder(self, parts: Array) -> Array:
        """Return what is in a part while the one below has room, (points,); zero in order."""
        if not self.sites:
            return np.zeros(len(parts))
        room = np.diff(self.ends) - parts
        room[:, 0] = parts[:, 0]  # counted downwards
        return np.asarray(np.minimum(room[:, :-1], parts[:, 1:]).max(axis=1))


@dataclass(frozen=True, eq=False)
class Parts:
    """A Model, and the one of its controls' parts."""

    whole: Model
    model: Model
    cuts: tuple[Cut, ...]
    """By control of the whole."""

    @property
    def places(self) -> tuple[slice, ...]:
        """Where the parts of each control are among all."""
        ends = tuple(accumulate((cut.count for cut in self.cuts), initial=0))
        return tuple(slice(*pair) for pair in pairwise(ends))

    @property
    def told(self) -> str:
        """What controls are the sums of."""
        return "; ".join(cut.told for cut in self.cuts if cut.sites) or "one side is left of each"

    def split(self, u: Array) -> Array:
        """Return all parts, (points, parts), of controls (points, n_u)."""
        columns = [cut.split(u[:, i]) for i, cut in enumerate(self.cuts)]
        return np.hstack([np.zeros((len(u), 0)), *columns])

    def merged(self, parts: Array) -> Array:
        """Return controls, (points, n_u), of parts (points, parts)."""
        found = [c.merged(parts[:, at]) for c, at in zip(self.cuts, self.places, strict=True)]
        return np.column_stack(found)

    def disorder(self, parts: Array) -> Array:
        """Return `Cut.disorder` of every control, over 1 + its largest value, (points, n_u)."""
        found = []
        for cut, at in zip(self.cuts, self.places, strict=True):
            size = np.abs(cut.merged(parts[:, at])).max(initial=0.0)
            found.append(cut.disorder(parts[:, at]) / (size or 1.0))
        return np.column_stack(found)


def parted(model: Model) -> Parts | None:
    """Return a Model with controls that have kinks taken apart; None where none has any.

    Controls in whose formulas there are jumps, kinks that move, or too many, stay whole.
    """
    if not model.n_u:
        return None
    try:
        found = _sites(model)
        if not found:
            return None
        cuts, symbols = _cuts(model, found), _symbols(model)
        return Parts(model, _taken_apart(model, cuts, symbols), cuts)
    except TooLargeError:
        return None


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
            own = term
            for i in range(len(self._cuts)):
                own = self._of(own, i)
            yield own

    def _of(self, term: ca.SX, i: int) -> ca.SX:
        """Return a term with one control taken apart."""
        import casadi as ca

        u, cut, v = self._model.u[i], self._cuts[i], self._parts[i]
        if not ca.depends_on(term, u):
            return term
        branches = [
            branch(term, self._symbols, self._all, Stretch(i, low, high))
            for low, high in pairwise(cut.ends)
        ]
        cornered = i in sites(term, self._symbols, self._all)
        if not cut.sites or (not cornered and not ca.depends_on(ca.jacobian(term, u), u)):
            return ca.substitute(branches[0], u, self.wholes[i])
        total = ca.substitute(branches[0], u, cut.sites[0] - v[0])
        for j, site in enumerate(cut.sites, start=1):
            total += ca.substitute(branches[j], u, site + v[j])
            total -= ca.substitute(branches[j], u, ca.SX(site))
        return total


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
