"""Damped Gauss-Newton for the boundary value problem.

Every unknown counts by its size, every equation by what a relative change of the unknowns does to
it, so that residuals are relative errors to first order. The system may have more equations than
unknowns, consistent ones (the conditions of a singular arc that the terminal conditions imply): a
least-squares step converges as fast as Newton's where they all can be met, and where they cannot,
the residual says so.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.polish.chain import Found, Rows, solved
from quito_cli.optimality.polish.flow import Linearised
from quito_cli.optimality.polish.system import System
from quito_cli.optimality.polish.unknowns import Unknowns

Array = NDArray[np.float64]

STEPS = 40
"""Newton steps, at most."""
SETTLED = 1e-12
"""Norm of residuals at which an extremal is found."""
NEARLY = 1e-8
"""Norm at which it is found when rounding lets it fall no further."""
NOISE = 1e-11
"""Norm below which rounding may keep residuals from falling."""
CLOSE = 1e-3
"""Norm below which Newton's method is to converge quadratically."""
QUICK = 0.05
"""Factor by which it does so at least."""
CREEPING = 5
"""Steps that near a solution reduce the residual by less."""
PATIENCE = 6
"""Steps within which the residual is to become half of what it was."""
SHORTEST = 2.0**-8
"""Damping factor below which there is no progress."""
FAR = 0.25
"""Part of the horizon that a junction may move in a step."""


@dataclass(frozen=True, eq=False)
class Scales:
    """Sizes of the unknowns."""

    nodes: Array
    """(n_y,)."""
    shared: Array
    """(n_g,)."""


@dataclass(frozen=True, eq=False)
class Solved:
    """Where the iteration ended."""

    unknowns: Unknowns
    residuals: tuple[float, ...]
    """Before each step, and after the last."""
    converged: bool
    slow: bool
    """Steps shrink by a factor each, as they do where the equations have no isolated solution."""
    last: Found | None
    """The last linear solve."""


@dataclass(frozen=True, eq=False)
class _About:
    """A system about a point."""

    flows: list[Linearised]
    chain: list[list[Rows]]
    """Scaled."""
    unknowns: Unknowns
    norm: float


def iterate(system: System, start: Unknowns, scales: Scales) -> Solved:
    """Solve the equations of a structure from a start."""
    about = _about(system, start, scales)
    norms, found = [about.norm], None
    for _ in range(STEPS):
        if not np.isfinite(about.norm) or about.norm <= SETTLED:
            break
        found = solved(about.chain, system.size, system.layout.count)
        following = _damped(system, about, found, scales)
        if following is None:
            break
        stalls = following.norm > 0.5 * about.norm and following.norm <= NEARLY
        about = following
        norms.append(about.norm)
        if stalls or min(norms[-PATIENCE:]) > 0.5 * min(norms[:-PATIENCE], default=np.inf):
            break
    slow = _slow(norms)
    converged = bool(about.norm <= NEARLY) and not slow
    if found is None and np.isfinite(about.norm):
        found = solved(about.chain, system.size, system.layout.count)
    return Solved(about.unknowns, tuple(norms), converged, slow, found)


def _slow(norms: list[float]) -> bool:
    """Whether steps near a solution shrink the residual by a factor each, and no faster."""
    near = [v for v in norms if NOISE < v < CLOSE]
    ratios = [after / before for before, after in pairwise(near)]
    return len(ratios) >= CREEPING and min(ratios) > QUICK and max(ratios) < 1.0


def _damped(system: System, about: _About, found: Found, scales: Scales) -> _About | None:
    """Return the system after the longest step that helps; None where none does."""
    times = system.layout.place("T")
    moved = np.abs(found.shared[times]).max() * scales.shared[times][0]
    horizon = float(np.ptp(about.unknowns.shared[times]))
    share = min(1.0, FAR * horizon / moved) if moved > 0 else 1.0
    while share >= SHORTEST:
        tried = _about(system, _moved(system, about, found, scales, share), scales)
        if tried.norm < (1 - 0.1 * share) * about.norm or tried.norm <= SETTLED:
            return tried
        if (
            np.isfinite(tried.norm)
            and about.norm > NEARLY
            and _natural(system, about, tried, found, share)
        ):
            return tried
        if about.norm <= NEARLY and tried.norm <= 2 * about.norm:
            return tried if tried.norm < about.norm else None
        share /= 2
    return None


def _natural(system: System, about: _About, tried: _About, found: Found, share: float) -> bool:
    """Whether the step that the old derivatives call for has become shorter.

    Where a junction moves, residuals grow that the next step takes back; the length of that step
    does not depend on how equations are weighed (P. Deuflhard, Newton Methods for Nonlinear
    Problems, 2004, section 3.3).
    """
    chain = [
        [replace(old, right=new.right * _ratio(old, new)) for old, new in zip(*pair, strict=True)]
        for pair in zip(about.chain, tried.chain, strict=True)
    ]
    following = solved(chain, system.size, system.layout.count)
    return _length(following) < (1 - share / 4) * _length(found)


def _ratio(old: Rows, new: Rows) -> Array | float:
    """Return what puts a right-hand side back to the weights of the old rows."""
    return 1.0 if old.norms is None or new.norms is None else new.norms / old.norms


def _length(found: Found) -> float:
    """Return the root mean square of a step, in relative changes."""
    return float(np.sqrt(np.mean(np.concatenate([found.nodes.ravel(), found.shared]) ** 2)))


def _moved(system: System, about: _About, found: Found, scales: Scales, share: float) -> Unknowns:
    """Return the unknowns a part of the step further on."""
    steps = share * found.nodes * scales.nodes
    shared = share * found.shared * scales.shared
    two, at, phases = 2 * system.layout.states, 0, []
    for segments, flow in zip(about.unknowns.phases, about.flows, strict=True):
        count = len(segments.stages)
        own = steps[at : at + count + 1]
        at += count + 1
        inner = share * flow.stage_steps
        inner = inner + np.einsum("ksy,ky->ks", flow.stages_by_start, own[:-1, :two])
        inner = inner + flow.stages_by_shared @ shared
        stages = segments.stages + inner.reshape(segments.stages.shape)
        phases.append(replace(segments, nodes=segments.nodes + own, stages=stages))
    return Unknowns(tuple(phases), system.as_given(about.unknowns.shared + shared))


def _about(system: System, at: Unknowns, scales: Scales) -> _About:
    """Linearise, scale, and take the norm of what is not met."""
    with np.errstate(all="ignore"):
        flows, chain, settled = system.linearised(at)
    scaled = [[_scaled(rows, scales) for rows in own] for own in chain]
    two = 2 * system.layout.states
    parts = []
    for flow in flows:
        parts.append((flow.residuals / scales.nodes[:two]).ravel())
        parts.append((flow.gaps / scales.nodes).ravel())
    for own in scaled:
        parts += [rows.right for rows in own if rows.there is None]
    firsts = np.cumsum([len(s.nodes) for s in settled.phases])[:-1]
    for node in firsts:
        parts += [rows.right for rows in scaled[node - 1] if rows.there is not None]
    whole = np.concatenate(parts)
    norm = float(np.max(np.abs(whole), initial=0.0)) if np.isfinite(whole).all() else np.inf
    return _About(flows, scaled, settled, norm)


def linear(system: System, at: Unknowns, scales: Scales) -> list[list[Rows]]:
    """Return the equations about a point, scaled."""
    return _about(system, at, scales).chain


def _scaled(rows: Rows, scales: Scales) -> Rows:
    """Return rows in terms of relative changes, each by its size."""
    here, shared = rows.here * scales.nodes, rows.shared * scales.shared
    if rows.there is not None:
        size = scales.nodes[:, None]
        return Rows(
            here / size, rows.there * scales.nodes / size, shared / size, rows.right / scales.nodes
        )
    norms = np.sqrt((here**2).sum(axis=1) + (shared**2).sum(axis=1))
    norms = np.where(norms > 0, norms, 1.0)[:, None]
    return Rows(here / norms, None, shared / norms, rows.right / norms[:, 0], norms[:, 0])
