"""Norms of the error e(t) = û(t) − u*(t) of a control, none of them normalised.

    L1    ∫|e| dt            L2    (∫ e² dt)^½            sup   sup |e(t)|
    norm  ‖(e(t_1), …, e(t_n))‖₂   with n samples at t_i = t_0 + (i − ½) T/n
    dft   ‖(E_0, …, E_{n−1})‖₂     with E_k = Σ_i e(t_i) exp(−2π√−1 (i − 1) k/n)

The last two are those of the QuITO paper's tables: norms of a vector, which grow with the number of
its samples, norm ≈ (n/T)^½ L2, and by Parseval's theorem dft = √n norm.

Both û and u* are smooth between the nodes of the mesh and the ends of the reference's pieces. The
integrals are therefore Gauss-Legendre sums over panels that end at all of these. A cell is cut into
panels at Chebyshev's points: on few cells there are so many that a polynomial of degree 400 in one
is resolved, whose oscillations are shortest at the ends. Suprema are taken over Gauss's points and
the limits from within at both ends of every panel, so that a jump counts with both of its sides.

Of several controls together: L1 is the sum, L2, norm and dft the 2-norm, sup the maximum.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from quito_cli.comparison.comparison import Errors

Array = NDArray[np.float64]
Zones = tuple[tuple[float, float], ...]

POINTS = 8
"""Of Gauss's rule on a panel: exact for degree 15."""
PANELS = 1024
"""Panels on the horizon, at least."""
LEAST = 2
"""Panels in a cell, at least."""
WITHIN = 1e-9
"""Part of a panel by which a limit from within keeps off its end."""

SAME = 64
"""Units in the last place by which two ends differ that are meant to be the same time."""


@dataclass(frozen=True)
class Grid:
    """Panels that together are the horizon, and the points in them."""

    times: Array
    """(panels, points + 2) increasing: just within the start, Gauss's points, within the end."""
    weights: Array
    """(panels, points) of the quadrature."""
    outside: NDArray[np.bool_]
    """(panels,) those in no jump zone."""

    def sample(self, function: Callable[[Array], Array]) -> Array:
        """Return a function of time at all points, (panels, points + 2, entries)."""
        values = function(self.times.ravel())
        return values.reshape(*self.times.shape, values.shape[1])


def grid(nodes: Array, breaks: Array, horizon: tuple[float, float], zones: Zones = ()) -> Grid:
    """Return panels that end at all nodes, breaks and ends of zones.

    Args:
        nodes: (N+1,) of the mesh, increasing.
        breaks: further times between which the functions are smooth, in any order.
        horizon: what the panels cover.
        zones: disjoint times to be told from the rest.
    """
    count = max(LEAST, -(-PANELS // (len(nodes) - 1)))
    places = (1 - np.cos(np.pi * np.arange(count) / count)) / 2
    inner = (nodes[:-1, None] + np.diff(nodes)[:, None] * places).ravel()
    ends = np.concatenate([inner, nodes[-1:], breaks, np.ravel(zones), horizon])
    ends = np.unique(ends[(ends >= horizon[0]) & (ends <= horizon[1])])
    ulp = np.spacing(np.abs(ends).max())
    ends = ends[np.append(True, np.diff(ends) > SAME * ulp)]
    starts, lengths = ends[:-1, None], np.diff(ends)[:, None]
    x, w = np.polynomial.legendre.leggauss(POINTS)
    off = np.minimum(np.maximum(WITHIN * lengths, 2 * SAME * ulp), lengths / 2)
    times = np.hstack([starts + off, starts + lengths * (x + 1) / 2, starts + lengths - off])
    middles = ends[:-1] + np.diff(ends) / 2
    inside = [(middles > start) & (middles < end) for start, end in zones]
    outside = ~np.any(inside, axis=0) if inside else np.ones(len(middles), dtype=bool)
    return Grid(times, lengths * w / 2, outside)


def jump_zones(times: tuple[float, ...], horizon: tuple[float, float], width: float) -> Zones:
    """Return what lies within `width` of the horizon around the times, disjoint and increasing."""
    reach = width * (horizon[1] - horizon[0])
    zones: list[tuple[float, float]] = []
    for time in sorted(times) if reach > 0 else ():
        start, end = max(time - reach, horizon[0]), min(time + reach, horizon[1])
        if zones and start <= zones[-1][1]:
            start = zones.pop()[0]
        if start < end:
            zones.append((start, end))
    return tuple(zones)


def sample_times(horizon: tuple[float, float], count: int) -> Array:
    """Return the middles of `count` equal parts of the horizon."""
    part = (horizon[1] - horizon[0]) / count
    return np.asarray(horizon[0] + part * (np.arange(count) + 0.5))


def spectrum(samples: Array) -> Array:
    """Return |E_k| for k = 0 … n//2, (n//2 + 1, n_u): the others are the same again."""
    return np.asarray(np.abs(np.fft.rfft(samples, axis=0)), dtype=float)


def errors(values: Array, on: Grid, samples: Array) -> tuple[Errors, ...]:
    """Return the norms by control.

    Args:
        values: (panels, points + 2, n_u) the error on the grid; NaN where unknown.
        on: the grid.
        samples: (n, n_u) the error at the sample times.
    """
    return tuple(_errors(values[:, :, i], on, samples[:, i]) for i in range(values.shape[2]))


def _errors(values: Array, on: Grid, samples: Array) -> Errors:
    """Return the norms of one control's error, (panels, points + 2); NaN if it is NaN anywhere."""
    inner, out = values[:, 1:-1], on.outside
    squares = (on.weights * inner**2).sum(axis=1)
    none = not out.any()
    return Errors(
        l1=float((on.weights * np.abs(inner)).sum()),
        l2=float(np.sqrt(squares.sum())),
        l2_outside=np.nan if none else float(np.sqrt(squares[out].sum())),
        sup=float(np.abs(values).max()),
        sup_outside=np.nan if none else float(np.abs(values[out]).max()),
        norm=float(np.linalg.norm(samples)),
        dft_norm=float(np.linalg.norm(np.fft.fft(samples))),
    )


def together(by_control: tuple[Errors, ...]) -> Errors | None:
    """Return the norms of all known controls together, or None where none is known."""
    known = [one for one in by_control if not np.isnan(one.sup)]
    if not known:
        return None

    def two(name: str) -> float:
        return float(np.linalg.norm([getattr(one, name) for one in known]))

    return Errors(
        l1=sum(one.l1 for one in known),
        l2=two("l2"),
        l2_outside=two("l2_outside"),
        sup=max(one.sup for one in known),
        sup_outside=max(one.sup_outside for one in known),
        norm=two("norm"),
        dft_norm=two("dft_norm"),
    )
