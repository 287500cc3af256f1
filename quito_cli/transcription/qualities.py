"""What the generating functions are like, computed from the weights that a control has.

Everything is read off the middle of a row of nodes so long that no weight reaches its ends, with
h = 1 there: s counts cells. The weights are those of `ControlBasis`, its cut of ψ included.

- Order: the least q ≥ 1 with ∫ x^q ψ(x) dx ≠ 0, where ∫ψ = 1. A smooth control is met to (√D h)^q
  (Maz'ya and Schmidt, *Approximate Approximations*, 2007, chapter 2).
- Saturation: the error besides, which falls exponentially with D, but not with that power of h. By
  Poisson's summation formula, with F the Fourier transform,

      D^(−1/2) Σ_m ψ((s−m)/√D) = 1 + Σ_{ν≠0} Fψ(√D ν) e^{2πiνs}.

  So **as printed** a constant c is missed by |c| max |D^(−1/2) Σ_m ψ((s−m)/√D) − 1|, on however
  fine a mesh: 2 e^(−π²D) |c| for the gaussian. **Normalised** weights reproduce constants. What is
  left is the next term of the expansion, with the slope: where a control rises by r in a cell,
  r max |Σ_m (m−s) w_m(s)|. It falls as the mesh grows finer where the control is smooth, but not
  at the steepest places: there, on a mesh that follows the control, cells shrink until the control
  crosses a good part of its range in one. r is therefore taken to be the whole range.
- Lebesgue constant: max_s Σ_m |w_m(s)|, the most by which û exceeds its largest coefficient.
- Jump: û for coefficients 0 up to a node, 1 from the next on. Its overshoot is max û − 1; its width
  is the distance in cells between the places at which û rises through 10 % and through 90 %.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from quito_cli.errors import UsageError
from quito_cli.transcription.control import ControlBasis
from quito_cli.transcription.generating import (
    GENERATING_FUNCTIONS,
    LEAST_SUM,
    QUASI_INTERPOLANTS,
    GeneratingFunction,
    least_variance,
    partition_floor,
    reach,
)

Array = NDArray[np.float64]

_OFFSETS = np.linspace(0, 1, 65)
"""Where a cell is looked at."""
_JUMP_POINTS = 200
"""For each √D cells of a jump: its overshoot is right to 1e-5."""
_ZERO = 1e-8
"""A moment is zero below this part of ∫|x^k ψ|."""
_MOST_VARIANCE = 30.0
"""Up to which a variance without saturation is looked for: beyond it, the cut of ψ is all."""
_RISE = 0.1, 0.9


@dataclass(frozen=True)
class Qualities:
    """A row of the table; figures at a variance are None where the variance is refused."""

    function: GeneratingFunction
    order: int
    least_variance: float
    """Smaller ones are refused."""
    enough_variance: float | None
    """From here on, saturation is at most the limit; None if it never is."""
    saturation: float | None
    lebesgue_constant: float | None
    overshoot: float | None
    """Over the height of the jump."""
    width: float | None
    """Of the jump, in cells."""


def all_qualities(variance: float, normalised: bool, limit: float) -> tuple[Qualities, ...]:
    """Return the table of the six at a variance.

    Args:
        variance: D.
        normalised: the control divides by the sum of weights.
        limit: of the saturation, for `enough_variance`.

    Raises:
        UsageError: the variance is too small for all of them.
    """
    rows = [GENERATING_FUNCTIONS[name] for name in QUASI_INTERPOLANTS]
    if not any(allowed(row, variance) for row in rows):
        least, name = min((least_variance(row.name), row.name) for row in rows)
        raise UsageError(
            f"variance {variance:g} is too small for every generating function; {name} takes "
            f"{least:g} or more"
        )
    return tuple(_qualities(row, variance, normalised, limit) for row in rows)


def _qualities(
    row: GeneratingFunction, variance: float, normalised: bool, limit: float
) -> Qualities:
    fixed = (row, order(row), least_variance(row.name), enough_variance(row, normalised, limit))
    if not allowed(row, variance):
        return Qualities(*fixed, None, None, None, None)
    s, u = jump(row, variance, normalised)
    return Qualities(
        *fixed,
        saturation(row, variance, normalised),
        lebesgue_constant(row, variance, normalised),
        max(0.0, round(float(u.max()) - 1, 12)),  # without rounding
        _width(s, u),
    )


def allowed(row: GeneratingFunction, variance: float) -> bool:
    """Whether a solve takes the variance."""
    return partition_floor(row, variance) >= LEAST_SUM


def order(row: GeneratingFunction) -> int:
    """Return the order of the moment condition."""
    return leading_moment(row)[0]


def leading_moment(row: GeneratingFunction) -> tuple[int, float]:
    """Return the order q of the moment condition and the moment ∫ x^q ψ(x) dx that breaks it.

    The trapezoidal rule is exact to rounding: ψ is analytic and decays.
    """
    step = 1 / 32
    x = np.arange(-60, 60 + step, step)
    psi = row.value(x)
    if abs(step * psi.sum() - 1) > _ZERO:
        return 0, float(step * psi.sum())
    k = 1
    while abs((x**k * psi).sum()) <= _ZERO * np.abs(x**k * psi).sum():
        k += 1
    return k, float(step * (x**k * psi).sum())


def _basis(row: GeneratingFunction, variance: float, normalised: bool) -> tuple[ControlBasis, int]:
    """Return a row of nodes and the cell in its middle, whose weights reach no end."""
    half = math.ceil(reach(row.name) * math.sqrt(variance)) + 1
    return ControlBasis(row, 2 * half + 1, variance, normalised), half


def _cell_weights(
    row: GeneratingFunction, variance: float, normalised: bool
) -> tuple[Array, Array]:
    """Return m − s and w_m(s), (offsets, window), at places of the middle cell."""
    basis, middle = _basis(row, variance, normalised)
    indices, weights = basis.weights(np.full(len(_OFFSETS), middle), _OFFSETS)
    return basis.centres[indices] - (middle + _OFFSETS[:, None]), weights


def saturation(row: GeneratingFunction, variance: float, normalised: bool) -> float:
    """Return the error that does not fall with the order of ψ.

    As printed it is that of a constant, over its value; normalised, that of a control that crosses
    its range in a cell, over the range.
    """
    if not row.scaled:
        return 0.0
    distances, weights = _cell_weights(row, variance, normalised)
    if not normalised:
        return float(np.abs(weights.sum(axis=1) - 1).max())
    return float(np.abs((distances * weights).sum(axis=1)).max())


def lebesgue_constant(row: GeneratingFunction, variance: float, normalised: bool) -> float:
    """Return the largest sum of absolute weights."""
    _, weights = _cell_weights(row, variance, normalised)
    return float(np.abs(weights).sum(axis=1).max())


def jump(row: GeneratingFunction, variance: float, normalised: bool) -> tuple[Array, Array]:
    """Return s, in cells from the jump, and û(s) for coefficients that jump there from 0 to 1."""
    half = 2 * math.ceil(reach(row.name) * math.sqrt(variance)) + 2
    basis = ControlBasis(row, 2 * half + 1, variance, normalised)
    coefficients = (basis.centres > half + 0.5).astype(float)[:, None]
    points = math.ceil(_JUMP_POINTS / math.sqrt(variance))
    cells = np.repeat(np.arange(half // 2, half + half // 2 + 1), points)
    offsets = np.tile(np.arange(points) / points, half + 1)
    return cells + offsets - half - 0.5, basis.evaluate(coefficients, cells, offsets)[:, 0]


def _width(s: Array, u: Array) -> float:
    low, high = _RISE
    top = int(np.argmax(u >= high))
    bottom = int(np.flatnonzero(u[:top] <= low)[-1])

    def crossing(i: int, level: float) -> float:
        return float(s[i] + (s[i + 1] - s[i]) * (level - u[i]) / (u[i + 1] - u[i]))

    return crossing(top - 1, high) - crossing(bottom, low)


def enough_variance(row: GeneratingFunction, normalised: bool, limit: float) -> float | None:
    """Return the smallest variance, to two digits, whose saturation is at most `limit`."""
    low, most = round(100 * least_variance(row.name)) - 1, round(100 * _MOST_VARIANCE)

    def enough(hundredths: int) -> bool:
        return saturation(row, hundredths / 100, normalised) <= limit

    high = low
    for candidate in np.geomspace(low + 1, most, 60):  # it falls, until the cut is all of it
        low, high = high, round(float(candidate))
        if enough(high):
            break
    else:
        return None
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if enough(middle) else (middle, high)
    return high / 100


def saturation_warning(basis: ControlBasis, lower: Array, upper: Array, limit: float) -> str | None:
    """Return what to say of a control whose saturation is above `limit` of its range, if it is.

    As printed, the saturation grows with the value of the control, so that it counts for more where
    the range is narrow and far from zero: [9, 10] has ten times its range.

    Args:
        basis: of the control.
        lower: (n_u,) its bounds.
        upper: (n_u,).
        limit: over the range of the control.
    """
    row, variance, normalised = basis.function, basis.variance, basis.normalised
    leverage = 1.0 if normalised or not row.scaled else _leverage(lower, upper)
    error = leverage * saturation(row, variance, normalised)
    if error <= limit or not len(lower):
        return None
    enough = enough_variance(row, normalised, limit / leverage)
    advice = (
        f"take a variance of at least {enough:g}"
        if enough
        else "no variance will do: take normalised weights"
    )
    where = " where it is steep" if normalised else ""
    return (
        f"with variance {variance:g} the control is only accurate to {error:.2g} of its range"
        f"{where}, on however fine a mesh: that is the saturation of {row.name}; {advice}"
    )


def _leverage(lower: Array, upper: Array) -> float:
    """Return the largest value of a control over its range; 1 where either is unknown."""
    width = upper - lower
    known = np.isfinite(width) & (width > 0)
    sizes = np.maximum(np.abs(lower), np.abs(upper))[known] / width[known]
    return float(sizes.max(initial=0.0)) if known.all() else float(sizes.max(initial=1.0))
