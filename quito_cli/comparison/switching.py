"""Switching times of an answer, near those of the truth.

Where a control of the truth jumps at a switching time, the answer switches where its own control
crosses the middle of that jump. Looked for is the crossing nearest to the truth's time, half-way to
its neighbours and no further than a seventh of the horizon.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from quito_cli.comparison.comparison import OfTime, Truth

Array = NDArray[np.float64]

FARTHEST = 1 / 7
"""Of the horizon, from the truth's switching time."""
POINTS = 4001
"""Looked at around it."""
CLOSER = 3
"""Times that the neighbourhood of a crossing is looked at by as many points: a jump is found to
rounding."""
JUMP = 1e-3
"""Smallest jump, over the span of the control."""
STEEPER = 2.0
"""A jump is by this factor more than the control changes as quickly beside it."""
_BESIDE = 1e-9
"""Of the horizon: where the limits of the truth are taken."""


def switching_times(
    answer: OfTime, truth: Truth, horizon: tuple[float, float]
) -> tuple[float, ...]:
    """Return when `answer` switches, one for each of the truth's times.

    Infinite where the answer does not switch; NaN where the truth has no jump to be looked for.

    Of several controls that jump at once, the one whose jump is largest for it is followed.
    """
    times = truth.switching_times
    if not times:
        return ()
    at, length = np.array(times), horizon[1] - horizon[0]
    limits = np.concatenate([[horizon[0]], (at[1:] + at[:-1]) / 2, [horizon[1]]])
    middles, jumps = _jumps(truth, at, limits, horizon)
    found = []
    for i, time in enumerate(times):
        if not jumps[i].any() or not horizon[0] < time < horizon[1]:
            found.append(np.nan)
            continue
        control = int(np.abs(jumps[i]).argmax())
        reach = FARTHEST * length
        window = max(limits[i], time - reach), min(limits[i + 1], time + reach)
        crossing, middle = time, middles[i, control]
        for _ in range(1 + CLOSER):
            grid = np.linspace(*window, POINTS)
            values = (answer(grid)[:, control] - middle) * np.sign(jumps[i, control])
            crossing = _crossing(grid, values, crossing)
            if not np.isfinite(crossing):
                break
            window = crossing - (grid[1] - grid[0]), crossing + (grid[1] - grid[0])
        found.append(crossing)
    return tuple(found)


def _jumps(
    truth: Truth, at: Array, limits: Array, horizon: tuple[float, float]
) -> tuple[Array, Array]:
    """Return the middles of the truth's jumps, and their heights over the span; (times, n_u) each.

    The height is zero where there is none: where it changes as much farther out, up to half-way to
    the neighbours, it is steep there, or has a corner.
    """
    beside = max(_BESIDE * (horizon[1] - horizon[0]), truth.blur)
    before, after = truth.control(at - beside), truth.control(at + beside)
    sooner = truth.control(np.maximum(at - 3 * beside, limits[:-1]))
    later = truth.control(np.minimum(at + 3 * beside, limits[1:]))
    usual = np.maximum(np.abs(before - sooner), np.abs(later - after))
    span = np.ptp(truth.control(np.linspace(*horizon, POINTS)), axis=0)
    with np.errstate(invalid="ignore"):
        heights = (after - before) / np.where(span > 0, span, np.inf)
        some = (np.abs(heights) >= JUMP) & (np.abs(after - before) > STEEPER * usual)
    return (before + after) / 2, np.where(some, heights, 0.0)


def _crossing(times: Array, values: Array, near: float) -> float:
    """Return the time nearest to `near` at which values rise above zero; infinite if never."""
    (at,) = np.nonzero((values[:-1] < 0) & (values[1:] >= 0))
    if not at.size:
        return np.inf
    share = -values[at] / (values[at + 1] - values[at])
    crossings = times[at] + share * (times[at + 1] - times[at])
    return float(crossings[np.argmin(np.abs(crossings - near))])
