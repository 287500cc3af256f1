"""A solved boundary value problem as an `Exact` extremal, with multipliers of direct adjoining.

On an arc of a state constraint S of order q the costates of direct adjoining are λ + Σ ζ_i ∇S^(i),
with ζ_{q−1} = η, ζ_{i−1} = −ζ_i' and the density μ = −ζ_0'. Where the arc begins the multiplier has
an atom π_0 − ζ_0, where it ends one of ζ_0; the costate jumps by these times ∇S and by nothing else
(R. F. Hartl, S. P. Sethi and R. G. Vickson, SIAM Review 37, 1995, section 5).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.hamiltonian import sampled as along
from quito_cli.optimality.polish.dense import Piece, lengths, sampled
from quito_cli.optimality.polish.exact import Atom, Exact, Sampled
from quito_cli.optimality.polish.faults import adjoined, arguments, leaps
from quito_cli.optimality.polish.system import System
from quito_cli.optimality.polish.unknowns import Unknowns
from quito_cli.solution.optimal import Arc, Kind

if TYPE_CHECKING:
    from quito_cli.optimality.polish.structure import Held

Array = NDArray[np.float64]


def exact(system: System, at: Unknowns, residual: float) -> Exact:
    """Return a solved boundary value problem as functions of time.

    Args:
        system: the equations.
        at: where they hold.
        residual: to which they do: the relative uncertainty of junctions.
    """
    layout, m, n = system.layout, system.setting.system.model, system.layout.states
    pieces = sampled(system, at, system.method.known.points)
    times = at.shared[layout.place("T")]
    rows = len(system.setting.system.rows)
    costates, mu, nodes = [], [], [times[:1]]
    for k, piece in enumerate(pieces):
        own, pulls = piece.y[..., n:].copy(), np.zeros((*piece.t.shape, rows))
        for held, parts in adjoined(system, at, k, piece).items():
            pulls[..., held[0]] = parts[..., -1]
            if system.setting.active(held).order:
                own += np.einsum(
                    "kmxi,kmi->kmx", _gradients(system, at, k, piece, held), parts[..., :-1]
                )
        costates.append(own)
        mu.append(pulls)
        fractions = at.phases[k].fractions[1:]
        inner = times[k] + fractions * (times[k + 1] - times[k])
        inner[-1] = times[k + 1]
        nodes.append(inner)
    values = Sampled(
        np.concatenate([piece.t for piece in pieces]),
        np.concatenate([piece.y[..., :n] for piece in pieces]),
        np.concatenate(costates),
        np.concatenate([piece.u for piece in pieces]),
        np.concatenate(mu),
    )
    part = {name: at.shared[layout.place(name)] for name in layout.sizes}
    return Exact(
        np.concatenate(nodes),
        system.method.known,
        values,
        part["p"],
        part["omega"],
        part["nu"],
        tuple(_points(system, at, len(m.constraints.point))),
        tuple(_atoms(system, at)),
        tuple(_arcs(system, times, max(residual, 1e-15) * float(np.ptp(times)))),
        _cost(system, at),
    )


def _gradients(system: System, at: Unknowns, k: int, piece: Piece, held: Held) -> Array:
    """Return ∇S^(i) along a piece, (K, m, n_x, q)."""
    known = system.setting.active(held)
    found = along(known.jumps, arguments(system, at, k, *piece.flat()))[0]
    return found.reshape(*piece.t.shape, system.layout.states, known.order or 0)


def _points(system: System, at: Unknowns, count: int) -> Iterator[Array]:
    """Give the multipliers of each point constraint."""
    known = {
        jump.point: at.shared[system.layout.place("pi")][leap.multipliers][: jump.values.numel()]
        for leap in system.leaps
        if leap
        for jump in leap.jumps
        if jump.point is not None
    }
    for k in range(count):
        yield known[k]


def _atoms(system: System, at: Unknowns) -> Iterator[Atom]:
    """Give the impulses of state constraints: where arcs begin and end, and touches."""
    firsts = np.cumsum([0, *(len(p.stages) for p in at.phases)])
    for leap in leaps(system, at):
        if leap.atom:
            yield Atom(int(firsts[leap.junction]), leap.held[0], leap.atom)


def _arcs(system: System, times: Array, doubt: float) -> Iterator[Arc]:
    """Give the arcs of controls, then of rows."""
    phases, setting = system.structure.phases, system.setting
    for i in range(setting.system.model.n_u):
        kinds = []
        for phase in phases:
            taken = any(i in setting.active(held).controls for held in phase.held)
            free: Kind = "active" if taken else "interior"
            kind = phase.kinds[i]
            kinds.append(free if kind == "free" else kind)
        yield from _joined(setting.name(i), kinds, times, doubt, frozenset())
    for row, given in enumerate(setting.system.rows):
        held = [any(row == h for h, _ in phase.held) for phase in phases]
        touched = frozenset(k for k, (h, _) in system.structure.touches if h == row)
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


def _cost(system: System, at: Unknowns) -> float:
    """Return the cost of the minimisation: Mayer cost and quadrature by the Gauss points."""
    m, n = system.setting.system.model, system.layout.states
    p, times = at.shared[system.layout.place("p")], at.shared[system.layout.place("T")]
    total = 0.0
    for k, piece in enumerate(sampled(system, at, system.method.points)):
        t, y, _, u = piece.flat()
        count = len(t)
        rates = m.right_hand_side.map(count)(y[:, :n].T, u.T, np.tile(p[:, None], (1, count)), t)
        running = np.array(rates[1])[0].reshape(piece.t.shape)
        h = np.diff(at.phases[k].fractions) * lengths(system, at)[k]
        total += float((running @ system.method.weights) @ h)
    ends = at.phases[0].nodes[0][:n], times[0], at.phases[-1].nodes[-1][:n], times[-1], p
    return total + float(m.end_cost(*ends))
