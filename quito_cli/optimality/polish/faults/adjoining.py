"""Multipliers of direct adjoining of a solved boundary value problem.

On an arc of a state constraint S of order q the costates of direct adjoining are λ + Σ ζ_i ∇S^(i),
with ζ_{q−1} = η, ζ_{i−1} = −ζ_i' and the density μ = −ζ_0'. Where the arc begins the multiplier has
an atom π_0 − ζ_0, where it ends one of ζ_0; the costate jumps by these times ∇S and by nothing else
(R. F. Hartl, S. P. Sethi and R. G. Vickson, SIAM Review 37, 1995, section 5).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.polish.equations.structure import Held
from quito_cli.optimality.polish.faults.dense import Dense
from quito_cli.optimality.polish.solving.flow import inputs

Array = NDArray[np.float64]

ROUNDING = 1e-11
"""Part of its size by which a multiplier may differ on both sides of a junction and be the same."""


@dataclass(frozen=True, eq=False)
class Adjoined:
    """A row's multipliers along a phase, at `Gauss.known` of its K segments."""

    zeta: Array
    """(K, m, q): ζ_0 … ζ_{q−1}; q = 0 of a mixed constraint."""
    mu: Array
    """(K, m)."""

    def size(self, length: float) -> float:
        """Return the size of the terms that μ is made of, over a phase of a length.

        μ = −ζ_0' may be zero where ζ_0 is not.
        """
        powers = length ** np.arange(1.0, self.zeta.shape[2] + 1)
        parts = np.abs(self.zeta).max(axis=(0, 1)) / powers
        return max(float(np.abs(self.mu).max()), float(parts.max(initial=0.0))) or 1.0


@dataclass(frozen=True)
class Atom:
    """What the multiplier of a state constraint has at a junction."""

    junction: int
    held: Held
    size: float
    """What its multiplier of direct adjoining jumps by."""
    rest: float
    """What the costate jumps by in the directions of higher derivatives: nothing, in theory."""
    scale: float
    """Of what both are made of."""


def adjoined(dense: Dense, k: int) -> dict[Held, Adjoined]:
    """Return the multipliers of what phase k holds."""
    system, piece = dense.system, dense.known[k]
    law, slopes = system.laws[k], system.method.known.differentiation
    h = np.diff(dense.at.phases[k].fractions)[:, None] * dense.lengths[k]
    rates, found = _rates(dense, k), {}
    for j, held in enumerate(law.held):
        place = len(law.between) + j
        parts = [piece.z[..., place]]
        for i in range(system.setting.active(held).order or 0):
            parts.append(-(parts[-1] @ slopes.T) / h if i else -rates[..., place])
        zeta = np.stack(parts[-2::-1], axis=-1) if parts[1:] else np.zeros((*piece.t.shape, 0))
        found[held] = Adjoined(zeta, parts[-1])
    return found


def _rates(dense: Dense, k: int) -> Array:
    """Return z' of phase k at `Gauss.known`, (K, m, n_z), by the law: z_v v'.

    On a brief arc the derivative of a polynomial would be rounding.
    """
    system, (t, y, z, _) = dense.system, dense.known[k].flat()
    law, two = system.laws[k], 2 * system.layout.states
    v = inputs(t, y, dense.at.shared, system.layout)
    settled, rates = law.settled(v, z), law.values(v, z).rates[:, :two]
    found = np.einsum("nzy,ny->nz", settled.by_v[..., :two], rates) + settled.by_v[..., two]
    return np.asarray(found.reshape(dense.known[k].z.shape))


def atoms(dense: Dense) -> Iterator[Atom]:
    """Give the atoms of state constraints: where arcs begin, go on and end, and at touches.

    Where an arc begins π_i − ζ_i, where it ends ζ_i: i = 0 is the atom, the others vanish. Where
    another control jumps on it, or a formula, ζ_i may: what it falls by.
    """
    structure = dense.system.structure
    parts = [adjoined(dense, k) for k in range(len(structure.phases))]
    for k in range(len(structure.phases) + 1):
        yield from _begun(dense, k, parts[k] if k < len(parts) else {})
        if k:
            yield from _ended(dense, k, parts[k - 1])
        if 0 < k < len(parts):
            yield from _gone_on(k, parts[k - 1], parts[k])


def _begun(dense: Dense, k: int, after: dict[Held, Adjoined]) -> Iterator[Atom]:
    leap, touches = dense.system.leaps[k], dense.system.structure.touches
    for jump, place in leap.parts(dense.system.layout) if leap else ():
        if jump.held is not None:
            pi = dense.at.shared[place]
            arc = jump.held in after and (k, jump.held) not in touches
            zeta = after[jump.held].zeta[0, 0] if arc else np.zeros(len(pi))
            yield _atom(k, jump.held, pi - zeta, float(np.abs(pi).max()))


def _gone_on(k: int, before: dict[Held, Adjoined], after: dict[Held, Adjoined]) -> Iterator[Atom]:
    for held in before.keys() & after.keys():
        zeta, then = before[held].zeta, after[held].zeta
        if zeta.shape[2]:
            scale = float(max(np.abs(zeta).max(), np.abs(then).max()))
            falls = zeta[-1, -1] - then[0, 0]
            if np.abs(falls).max() > ROUNDING * scale:
                yield _atom(k, held, falls, scale)


def _ended(dense: Dense, k: int, before: dict[Held, Adjoined]) -> Iterator[Atom]:
    phases = dense.system.structure.phases
    after = phases[k].held if k < len(phases) else frozenset()
    for held, own in before.items():
        if held not in after and own.zeta.shape[2]:
            yield _atom(k, held, own.zeta[-1, -1], float(np.abs(own.zeta).max()))


def _atom(k: int, held: Held, values: Array, scale: float) -> Atom:
    rest = float(np.abs(values[1:]).max(initial=0.0))
    return Atom(k, held, float(values[0]), rest, scale or 1.0)
