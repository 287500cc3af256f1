"""The generating functions ψ: one row each; a new one is a new row.

    û(t) = Σ_m c_m w_m(s(t)),   w_m(s) = ψ((s−m)/√D) / Σ_j ψ((s−j)/√D)

A row is of order q when it satisfies the moment conditions ∫ψ = 1 and ∫x^k ψ = 0 for 0 < k < q
(Maz'ya and Schmidt, *Approximate Approximations*, 2007, chapter 2). The numbers 1 to 6 are those of
the QuITO paper; its printed forms of 2, 3 and 4 carry misprints, the forms here satisfy the
conditions. Two further rows are the classical controls of other codes, written as the same sum:
`box` gives piecewise constant controls, `hat` piecewise linear ones.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from quito_cli.errors import UsageError

Array = NDArray[np.float64]

CUT = 1e-8
"""ψ is taken as zero where it stays below this fraction of its largest value."""

LEAST_SUM = 0.5
"""A variance is refused where the sum of weights falls below this between the nodes."""

GHOST_REACH = 2.0
"""Ghost nodes beyond each end, in units of √D. More change no error, on smooth problems or others,
and are so weakly determined that unbounded coefficients grow: at 2.5 to 6000 instead of 6 with one
substep and twelve cells, and the first cells' error with them."""


@dataclass(frozen=True)
class GeneratingFunction:
    """A row of the table."""

    name: str
    number: int
    """The paper's number; 0 for the classical controls."""
    formula: str
    order: int
    """Order of the moment condition."""
    positive: bool
    """ψ ≥ 0 everywhere: bounds on coefficients are then bounds on û at every t."""
    value: Callable[[Array], Array]
    """ψ(x), elementwise."""
    scaled: bool = True
    """Takes a variance; the classical controls do not."""
    cellwise: bool = False
    """One coefficient a cell rather than one a node."""


@dataclass(frozen=True)
class _GaussianTimes:
    """x ↦ (a0 + a1 x² + a2 x⁴ + …) e^{−x²}/√π."""

    coefficients: tuple[float, ...]

    def __call__(self, x: Array) -> Array:
        polynomial = np.zeros_like(x)
        for coefficient in reversed(self.coefficients):
            polynomial = coefficient + x * x * polynomial
        decay: Array = np.exp(-x * x) / math.sqrt(math.pi)
        product: Array = polynomial * decay
        return product


def _gaussian_times(*coefficients: float) -> _GaussianTimes:
    return _GaussianTimes(coefficients)


def _trigonometric(x: Array) -> Array:
    decay: Array = np.exp(-x * x) * math.sqrt(math.e / math.pi)
    return decay * np.cos(math.sqrt(2) * x)


def _box(x: Array) -> Array:
    return np.asarray(x == 0, dtype=float)


def _hat(x: Array) -> Array:
    peak: Array = np.maximum(0.0, 1 - np.abs(x))
    return peak


def _sech(x: Array) -> Array:
    decay: Array = np.exp(-np.abs(x))  # 2/(e^x + e^-x) without overflow
    return 2 * decay / (1 + decay * decay) / math.pi


GENERATING_FUNCTIONS: dict[str, GeneratingFunction] = {
    row.name: row
    for row in (
        GeneratingFunction("gaussian", 1, "e^(−x²)/√π", 2, True, _gaussian_times(1)),
        GeneratingFunction(
            "laguerre4", 2, "(3/2 − x²) e^(−x²)/√π", 4, False, _gaussian_times(3 / 2, -1)
        ),
        GeneratingFunction(
            "laguerre6",
            3,
            "(15/8 − 5x²/2 + x⁴/2) e^(−x²)/√π",
            6,
            False,
            _gaussian_times(15 / 8, -5 / 2, 1 / 2),
        ),
        GeneratingFunction(
            "hermite10",
            4,
            "(315/128 − 105x²/16 + 63x⁴/16 − 3x⁶/4 + x⁸/24) e^(−x²)/√π",
            10,
            False,
            _gaussian_times(315 / 128, -105 / 16, 63 / 16, -3 / 4, 1 / 24),
        ),
        GeneratingFunction(
            "trigonometric",
            5,
            "√(e/π) e^(−x²) cos(√2 x)",
            4,
            False,
            _trigonometric,
        ),
        GeneratingFunction("sech", 6, "sech(x)/π", 2, True, _sech),
        GeneratingFunction(
            "box",
            0,
            "1 on its cell, 0 elsewhere",
            1,
            True,
            _box,
            scaled=False,
            cellwise=True,
        ),
        GeneratingFunction(
            "hat",
            0,
            "max(0, 1 − |x|)",
            2,
            True,
            _hat,
            scaled=False,
        ),
    )
}

QUASI_INTERPOLANTS = tuple(name for name, row in GENERATING_FUNCTIONS.items() if row.number)
"""Names of the six generating functions of the paper, in its order."""


def generating_function(name: str | int) -> GeneratingFunction:
    """Return the row of that name or paper's number.

    Raises:
        UsageError: there is none; the message lists them.
    """
    for row in GENERATING_FUNCTIONS.values():
        if str(name) in (row.name, str(row.number)) and row.number:
            return row
    known = ", ".join(f"{GENERATING_FUNCTIONS[n].number} {n}" for n in QUASI_INTERPOLANTS)
    raise UsageError(f"there is no generating function {name!r}; the six are {known}")


@cache
def reach(name: str) -> float:
    """Return the |x| beyond which |ψ(x)| stays below `CUT` of its largest value."""
    row = GENERATING_FUNCTIONS[name]
    if not row.scaled:
        return 1.0
    x = np.linspace(0, 40, 40 * 256 + 1)
    values = np.abs(row.value(x))
    return float(x[np.nonzero(values >= CUT * values.max())[0][-1]])


def partition_floor(row: GeneratingFunction, variance: float) -> float:
    """Return the least value over s of Σ_j ψ((s−j)/√D): the divisor of the normalised weights."""
    if not row.scaled:
        return 1.0
    s = np.linspace(0, 1, 65)
    width = math.ceil(reach(row.name) * math.sqrt(variance)) + 1
    j = np.arange(-width, width + 2)
    return float(row.value((s[:, None] - j) / math.sqrt(variance)).sum(axis=1).min())


@cache
def least_variance(name: str) -> float:
    """Return the smallest variance, to two digits, from which the sum of weights is 1/2 or more."""
    row = GENERATING_FUNCTIONS[name]
    hundredths = np.arange(200, 0, -1)  # from variances that do down to the first that does not
    fails = (int(d) for d in hundredths if partition_floor(row, d / 100) < LEAST_SUM)
    return (next(fails, 0) + 1) / 100


def check_variance(row: GeneratingFunction, variance: float) -> None:
    """Refuse a variance so small that the sum of weights falls below 1/2 anywhere.

    Raises:
        UsageError: naming the smallest variance that would do.
    """
    floor = partition_floor(row, variance)
    if floor < LEAST_SUM:
        raise UsageError(
            f"variance {variance:g} is too small for the generating function {row.name}: between "
            f"the nodes its sum of weights falls to {floor:.2g}; take at least "
            f"{least_variance(row.name):g}"
        )
