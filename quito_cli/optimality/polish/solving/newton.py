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

from quito_cli.optimality.polish.equations.system import System
from quito_cli.optimality.polish.equations.unknowns import Unknowns
from quito_cli.optimality.polish.solving.assembly import Assembled, assembled
from quito_cli.optimality.polish.solving.chain import Chain, Found, Links, Rows, solved

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
    """A system about a point, scaled."""

    assembled: Assembled
    chain: Chain
    """In terms of relative changes."""
    weights: tuple[Array, ...]
    """By node (rows,): what its rows were divided by."""
    norm: float
    """Largest residual; infinite where one, or a derivative, has no value."""


def iterate(system: System, start: Unknowns, scales: Scales) -> Solved:
    """Solve the equations of a structure from a start."""
    about = _about(system, start, scales)
    norms, found = [about.norm], None
    for _ in range(STEPS):
        if not np.isfinite(about.norm) or about.norm <= SETTLED:
            break
        found = solved(about.chain)
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
    return Solved(about.assembled.unknowns, tuple(norms), converged, slow, found)


def linear(system: System, at: Unknowns, scales: Scales) -> Chain:
    """Return the equations about a point, scaled."""
    return _about(system, at, scales).chain


def _slow(norms: list[float]) -> bool:
    """Whether steps near a solution shrink the residual by a factor each, and no faster."""
    near = [v for v in norms if NOISE < v < CLOSE]
    ratios = [after / before for before, after in pairwise(near)]
    return len(ratios) >= CREEPING and min(ratios) > QUICK and max(ratios) < 1.0


def _damped(system: System, about: _About, found: Found, scales: Scales) -> _About | None:
    """Return the system after the longest step that helps; None where none does."""
    times = system.layout.place("times")
    moved = np.abs(found.shared[times]).max() * scales.shared[times][0]
    horizon = float(np.ptp(about.assembled.unknowns.shared[times]))
    share = min(1.0, FAR * horizon / moved) if moved > 0 else 1.0
    while share >= SHORTEST:
        tried = _about(system, _moved(system, about, found, scales, share), scales)
        if tried.norm < (1 - 0.1 * share) * about.norm or tried.norm <= SETTLED:
            return tried
        if about.norm <= NEARLY:
            if tried.norm <= 2 * about.norm:
                return tried if tried.norm < about.norm else None
        elif np.isfinite(tried.norm) and _natural(about, tried, found, share):
            return tried
        share /= 2
    return None


def _natural(about: _About, tried: _About, found: Found, share: float) -> bool:
    """Whether the step that the old derivatives call for has become shorter.

    Where a junction moves, residuals grow that the next step takes back; the length of that step
    does not depend on how equations are weighed (P. Deuflhard, Newton Methods for Nonlinear
    Problems, 2004, section 3.3).
    """
    own = [
        replace(old, right=new.right * after / before)
        for old, new, before, after in zip(
            about.chain.own, tried.chain.own, about.weights, tried.weights, strict=True
        )
    ]
    links = replace(about.chain.links, right=tried.chain.links.right)
    return _length(solved(Chain(own, links))) < (1 - share / 4) * _length(found)


def _length(found: Found) -> float:
    """Return the root mean square of a step, in relative changes."""
    return float(np.sqrt(np.mean(np.concatenate([found.nodes.ravel(), found.shared]) ** 2)))


def _moved(system: System, about: _About, found: Found, scales: Scales, share: float) -> Unknowns:
    """Return the unknowns a part of the step further on."""
    at, two = about.assembled.unknowns, 2 * system.layout.states
    shared = share * found.shared * scales.shared
    steps = np.split(share * found.nodes * scales.nodes, at.firsts[1:-1])
    phases = []
    for segments, flow, own in zip(at.phases, about.assembled.flows, steps, strict=True):
        inner = share * flow.stage_steps
        inner = inner + (flow.stages_by_start @ own[:-1, :two, None])[..., 0]
        inner = inner + flow.stages_by_shared @ shared
        stages = segments.stages + inner.reshape(segments.stages.shape)
        phases.append(replace(segments, nodes=segments.nodes + own, stages=stages))
    return Unknowns(tuple(phases), system.as_given(at.shared + shared))


def _about(system: System, at: Unknowns, scales: Scales) -> _About:
    """Linearise, scale, and take the norm of what is not met."""
    with np.errstate(all="ignore"):
        given = assembled(system, at)
        weighed = [_weighed(rows, scales) for rows in given.chain.own]
        chain = Chain([rows for rows, _ in weighed], _scaled(given.chain.links, scales))
        two, junctions = 2 * system.layout.states, at.firsts[1:-1] - 1
        parts = [
            *((flow.residuals / scales.nodes[:two]).ravel() for flow in given.flows),
            *((flow.gaps / scales.nodes).ravel() for flow in given.flows),
            *(rows.right for rows in chain.own),
            chain.links.right[junctions].ravel(),
        ]
    whole = np.abs(np.concatenate(parts))
    known = np.isfinite(whole).all() and _has_values(chain)
    norm = float(whole.max(initial=0.0)) if known else np.inf
    return _About(given, chain, tuple(weights for _, weights in weighed), norm)


def _has_values(chain: Chain) -> bool:
    """Whether all derivatives are finite; where one is not, there is no step."""
    parts = [part for rows in chain.own for part in (rows.here, rows.shared)]
    parts += [chain.links.matrix, chain.links.shared]
    return all(np.isfinite(part).all() for part in parts)


def _weighed(rows: Rows, scales: Scales) -> tuple[Rows, Array]:
    """Return rows in terms of relative changes, each by its size, and the sizes."""
    here, shared = rows.here * scales.nodes, rows.shared * scales.shared
    norms = np.sqrt((here**2).sum(axis=1) + (shared**2).sum(axis=1))
    norms = np.where(norms > 0, norms, 1.0)
    return Rows(here / norms[:, None], shared / norms[:, None], rows.right / norms), norms


def _scaled(links: Links, scales: Scales) -> Links:
    """Return links in terms of relative changes."""
    size = scales.nodes[:, None]
    return Links(
        links.matrix * scales.nodes / size,
        links.shared * scales.shared / size,
        links.right / scales.nodes,
    )
