"""Comparison -> plots of its control error e(t) = û(t) − u*(t), at the sample times of the norms.

On the whole; magnified, as high as the first method's error is between the jumps, without methods
whose error would only fill the plot; its modulus on a logarithmic scale; and the modulus of its
discrete Fourier transform over the frequency. The QuITO paper judges ringing by these (section 4).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.plots.layout import shared, with_unit
from quito_cli.plots.panels import (
    Line,
    Panel,
    beyond,
    finite,
    first,
    padded,
    shortened,
    span,
    traces,
)

if TYPE_CHECKING:
    from quito_cli.comparison.comparison import Comparison

Array = NDArray[np.float64]

_LARGE = 1.5
"""Errors larger than this part of the control's span are cut off."""
_MAGNIFIED = 3.0
"""Magnified plots reach to this multiple of the first method's error between the jumps, and stand
where that is by this factor less than the whole."""
_CLOSE = 1e-4
"""Part of the control's span that is magnified at most: errors far below are a flat line."""
_USUAL = 0.95
"""Part of the samples outside the jump zones that counts as between the jumps."""
_ROUNDING = 1e-14
"""Of the control's size: errors below it are none, and drawn there."""
_RARE = 0.02
"""Part of the values that a logarithmic axis may leave below its foot: crossings of zero."""


@dataclass(frozen=True)
class _Error:
    """The error of the controls that share a plot."""

    name: str
    unit: str
    times: list[Line]
    """By sample time."""
    frequencies: list[Line]
    """Modulus of the transform by frequency."""
    size: float
    """Span of the control."""
    between: dict[int, float]
    """Half of a method's samples between the jumps are larger, by row."""
    usual: float
    """Nearly all of the first method's between the jumps are smaller."""


def _errors(comparison: Comparison) -> list[_Error]:
    """Return the errors that are known, a plot each."""
    if comparison.truth is None:
        return []
    at = comparison.sample_times
    outside = np.ones(len(at), dtype=bool)
    for start, end in comparison.zones:
        outside &= (at < start) | (at > end)
    truth = finite(comparison.truth.control(at))
    found = []
    for name, entries in shared(comparison.controls).items():
        known = [
            (number, row, i)
            for i in entries
            for number, row in enumerate(comparison.rows)
            if row.errors is not None and np.isfinite(row.samples[:, i]).any()
        ]
        if not known:
            continue
        times = [(n, at, finite(row.samples[:, i])) for n, row, i in known]
        moduli = [(n, comparison.frequencies, finite(row.spectrum[:, i])) for n, row, i in known]
        numbers = {n for n, _, _ in times}
        leader = first(comparison) if first(comparison) in numbers else min(numbers)
        between = {n: _between([y[outside] for m, _, y in times if m == n]) for n in numbers}
        halves = {n: _quantile(values, 0.5) for n, values in between.items()}
        usual = _quantile(between[leader], _USUAL)
        low, high = span([truth[:, entries]])
        size = high - low or max(abs(low), 1.0)
        unit = comparison.controls[entries[0]].unit
        found.append(_Error(name, unit, times, moduli, size, halves, usual))
    return found


def _between(parts: list[Array]) -> Array:
    values = np.abs(np.concatenate(parts))
    return values[np.isfinite(values)]


def _quantile(values: Array, part: float) -> float:
    return float(np.quantile(values, part)) if values.size else 0.0


def on_the_whole(comparison: Comparison) -> list[Panel]:
    """Return the error of each control, jumps and all."""
    panels = []
    for error in _errors(comparison):
        low, high = _whole(error)
        panels.append(
            Panel(
                with_unit(f"error of {error.name}", error.unit),
                "t",
                traces(error.times, low, high),
                *padded(low, high),
                zones=comparison.zones,
                note=beyond(comparison, error.times, low, high),
            )
        )
    return panels


def _whole(error: _Error) -> tuple[float, float]:
    low, high = span([y for _, _, y in error.times])
    most = _LARGE * error.size
    return min(max(low, -most), 0.0), max(min(high, most), 0.0)


def magnified(comparison: Comparison) -> list[Panel]:
    """Return the error of each control between the jumps; none where that is no closer look."""
    panels = []
    closer = False
    for error in _errors(comparison):
        whole = max(map(abs, _whole(error)))
        reach = max(_MAGNIFIED * error.usual, _CLOSE * error.size)
        closer = closer or _MAGNIFIED * reach < whole
        reach = min(reach, whole) or error.size
        beyond = [n for n, half in sorted(error.between.items()) if half > reach]
        lines = [line for line in error.times if line[0] not in beyond]
        panels.append(
            Panel(
                with_unit(f"error of {error.name}", error.unit),
                "t",
                traces(lines, -reach, reach),
                -reach,
                reach,
                zones=comparison.zones,
                note=_magnification(comparison, whole / reach, beyond),
            )
        )
    return panels if closer else []


def _magnification(comparison: Comparison, times: float, beyond: list[int]) -> str:
    """Return what is said of a magnified plot, and of methods that would only fill it."""
    if times <= 1:
        return ""
    said = f"magnified {_two_digits(times)} times"
    if beyond:
        others = f" and {len(beyond) - 1} more" if len(beyond) > 1 else ""
        name = shortened(comparison.rows[beyond[0]].method, 24)
        said += f", {name}{others} not shown: larger"
    return said


def _two_digits(number: float) -> str:
    return f"{float(f'{number:.2g}'):,.10g}"


def logarithmic(comparison: Comparison) -> list[Panel]:
    """Return the modulus of the error of each control on a logarithmic scale."""
    panels = []
    for error in _errors(comparison):
        lines = [(n, x, np.abs(y)) for n, x, y in error.times]
        label = with_unit(f"|error of {error.name}|", error.unit)
        panels.append(_logarithmic(label, "t", lines, error.size, comparison.zones))
    return panels


def spectrum(comparison: Comparison) -> list[Panel]:
    """Return the modulus of the transform of each control's error over the frequency."""
    panels = []
    for error in _errors(comparison):
        size = error.size * len(comparison.sample_times)
        label = f"|DFT of error of {error.name}|"
        panels.append(
            _logarithmic(label, "frequency [cycles per unit of t]", error.frequencies, size, ())
        )
    return panels


def _logarithmic(
    label: str, axis: str, lines: list[Line], size: float, zones: tuple[tuple[float, float], ...]
) -> Panel:
    """Return a plot whose foot is where rare crossings of zero are cut off."""
    none = _ROUNDING * size
    feet = []
    top = 0.0
    for _, _, y in lines:
        some = y[y > none]
        if some.size:
            feet.append(float(np.quantile(some, _RARE)))
            top = max(top, float(some.max()))
    top = top or 10 * none
    foot = min(feet, default=none) / 3
    zero = any((y <= none).any() for _, _, y in lines)
    raised = [(n, x, np.maximum(y, foot)) for n, x, y in lines]
    drawn = traces([(n, x, np.log10(y)) for n, x, y in raised], np.log10(foot), np.log10(top))
    restored = tuple(replace(t, y=10**t.y) for t in drawn)
    note = "zero is drawn at the foot" if zero else ""
    return Panel(
        label=label,
        axis=axis,
        traces=restored,
        low=0.8 * foot,
        high=1.6 * top,
        bounds=(),
        zones=zones,
        logarithmic=True,
        note=note,
    )
