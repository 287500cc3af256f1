"""A solved boundary value problem as an `Exact` extremal, with multipliers of direct adjoining."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.polish.answer.exact import Atom, Exact, Sampled
from quito_cli.optimality.polish.equations.structure import Held
from quito_cli.optimality.polish.faults.adjoining import adjoined, atoms
from quito_cli.optimality.polish.faults.dense import Dense
from quito_cli.solution.optimal import Arc, Kind

Array = NDArray[np.float64]

ROUNDING = 1e-15
"""Part of the horizon that junctions are uncertain by at least."""


def exact(dense: Dense, residual: float) -> Exact:
    """Return a solved boundary value problem as functions of time.

    Args:
        dense: the solution.
        residual: to which its equations hold: the relative uncertainty of junctions.
    """
    system, n = dense.system, dense.system.layout.states
    costates, mu = zip(*(_multipliers(dense, k) for k in range(len(dense.known))), strict=True)
    values = Sampled(
        np.concatenate([piece.t for piece in dense.known]),
        np.concatenate([piece.y[..., :n] for piece in dense.known]),
        np.concatenate(costates),
        np.concatenate([piece.u for piece in dense.known]),
        np.concatenate(mu),
    )
    return Exact(
        _nodes(dense),
        system.method.known,
        values,
        dense.shared("parameters"),
        dense.shared("boundary"),
        dense.shared("integral"),
        tuple(_points(dense)),
        tuple(_atoms(dense)),
        tuple(_arcs(dense, max(residual, ROUNDING) * dense.horizon)),
        _cost(dense),
    )


def _nodes(dense: Dense) -> Array:
    """Return the times at which segments meet; those of junctions as they were found."""
    found = [dense.times[:1]]
    for k, segments in enumerate(dense.at.phases):
        start, end = dense.times[k : k + 2]
        found += [start + segments.fractions[1:-1] * (end - start), dense.times[[k + 1]]]
    return np.concatenate(found)


def _multipliers(dense: Dense, k: int) -> tuple[Array, Array]:
    """Return costates of direct adjoining, (K, m, n_x), and μ of all rows, (K, m, rows)."""
    piece, setting = dense.known[k], dense.system.setting
    costates = piece.y[..., dense.system.layout.states :].copy()
    mu = np.zeros((*piece.t.shape, len(setting.system.rows)))
    for held, own in adjoined(dense, k).items():
        mu[..., held[0]] = own.mu
        if setting.active(held).order:
            costates += np.einsum("kmxi,kmi->kmx", _gradients(dense, k, held), own.zeta)
    return costates, mu


def _gradients(dense: Dense, k: int, held: Held) -> Array:
    """Return ∇S^(i) along a phase, (K, m, n_x, q)."""
    known, piece = dense.system.setting.active(held), dense.known[k]
    found = dense.along(known.jumps, k, piece)[0]
    return found.reshape(*piece.t.shape, dense.system.layout.states, -1)


def _points(dense: Dense) -> Iterator[Array]:
    """Give the multipliers of each point constraint."""
    found = {
        jump.point: dense.at.shared[place]
        for leap in dense.system.leaps
        if leap
        for jump, place in leap.parts(dense.system.layout)
    }
    for k in range(len(dense.system.setting.system.model.constraints.point)):
        yield found[k]


def _atoms(dense: Dense) -> Iterator[Atom]:
    """Give the impulses of state constraints: where arcs begin and end, and touches."""
    firsts = np.cumsum([0, *(segments.count for segments in dense.at.phases)])
    for atom in atoms(dense):
        if atom.size:
            yield Atom(int(firsts[atom.junction]), atom.held[0], atom.size)


def _arcs(dense: Dense, doubt: float) -> Iterator[Arc]:
    """Give the arcs of controls, then of rows; junctions are known up to `doubt`."""
    structure, setting, times = dense.system.structure, dense.system.setting, dense.times
    phases = structure.phases
    for i in range(setting.system.model.n_u):
        kinds: list[Kind] = []
        for phase in phases:
            taken = any(i in setting.active(held).controls for held in phase.held)
            free: Kind = "active" if taken else "interior"
            kind = phase.kinds[i]
            kinds.append(free if kind == "free" else kind)
        yield from _joined(setting.name(i), kinds, times, doubt, frozenset())
    for row, given in enumerate(setting.system.rows):
        held = [any(row == h for h, _ in phase.held) for phase in phases]
        touched = frozenset(k for k, (h, _) in structure.touches if h == row)
        kinds = ["active" if own else "inactive" for own in held]
        yield from _joined(given.label, kinds, times, doubt, touched)


def _joined(
    label: str, kinds: list[Kind], times: Array, doubt: float, apart: frozenset[int]
) -> Iterator[Arc]:
    """Give one arc for phases of one kind, but where they are to be apart."""
    start, last = 0, len(kinds)
    for k in range(1, last + 1):
        if k == last or kinds[k] != kinds[start] or k in apart:
            before, after = 0.0 if start == 0 else doubt, 0.0 if k == last else doubt
            yield Arc(label, kinds[start], float(times[start]), float(times[k]), before, after)
            start = k


def _cost(dense: Dense) -> float:
    """Return the cost of the minimisation: Mayer cost and quadrature by the Gauss points."""
    system, p, times = dense.system, dense.shared("parameters"), dense.times
    m, n, total = system.setting.system.model, system.layout.states, 0.0
    for k, piece in enumerate(dense.sampled(system.method.points)):
        t, y, _, u = piece.flat()
        count = len(t)
        rates = m.right_hand_side.map(count)(y[:, :n].T, u.T, np.tile(p[:, None], (1, count)), t)
        running = np.array(rates[1])[0].reshape(piece.t.shape)
        h = np.diff(dense.at.phases[k].fractions) * dense.lengths[k]
        total += float((running @ system.method.weights) @ h)
    ends = dense.at.phases[0].nodes[0][:n], times[0], dense.at.phases[-1].nodes[-1][:n], times[-1]
    return total + float(m.end_cost(*ends, p))
