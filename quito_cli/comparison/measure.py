"""Answers and a truth -> Comparison: every figure of the table.

All are measured on the horizon that the converged answers and the truth have in common, in absolute
time: where the final time is free, horizons differ by a little, and what one has beyond it has
nothing to be held against. An answer that did not converge is held constant where it ends sooner.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from quito_cli.comparison import norms
from quito_cli.comparison.comparison import Comparison, Row, Truth
from quito_cli.comparison.switching import switching_times
from quito_cli.comparison.truth import variation, with_variation
from quito_cli.errors import UsageError
from quito_cli.problem.schema_reference import Published
from quito_cli.solution.solution import Solution

Array = NDArray[np.float64]


SAMPLES: Final = 4
"""Of the sampled norms, for each cell of ours: 1200 for 300, as the published figures have it."""
MOST_SAMPLES: Final = 1_000_000
"""That may be asked for."""
ZONE: Final = 0.01
"""Half the width of a jump zone, as a fraction of the horizon."""


@dataclass(frozen=True)
class Setting:
    """How answers are compared."""

    samples: int
    """n of the sampled norms."""
    zone: float
    """Half the width of a jump zone, as a fraction of the horizon."""


@dataclass(frozen=True)
class _Ruler:
    """What every answer is measured with."""

    truth: Truth | None
    horizon: tuple[float, float]
    zones: norms.Zones
    times: Array
    """(n,) of the samples."""


def measured(
    answers: Sequence[tuple[str, Solution]],
    truth: Truth | None,
    setting: Setting,
    published: Sequence[Published],
    notes: Sequence[str],
    *,
    ringing: bool = True,
) -> Comparison:
    """Return the comparison of answers, by the name of their method, ours first.

    Args:
        answers: one at least.
        truth: what they are held against.
        setting: samples and jump zones.
        published: rows of published tables.
        notes: what a reader must know.
        ringing: whether their ringing indices are relative to the same.

    Raises:
        UsageError: their horizons have nothing in common.
    """
    horizon = _common_horizon([solution for _, solution in answers], truth)
    zones: norms.Zones = ()
    if truth is not None:
        truth = with_variation(truth, horizon)
        zones = norms.jump_zones(truth.switching_times, horizon, setting.zone)
    times = norms.sample_times(horizon, setting.samples)
    step = (horizon[1] - horizon[0]) / setting.samples
    ruler = _Ruler(truth, horizon, zones, times)
    rows = [_row(method, solution, ruler) for method, solution in answers]
    origin = answers[0][1].origin
    return Comparison(
        problem=origin.name,
        title=origin.title,
        controls=origin.controls,
        states=origin.states,
        truth=truth,
        zones=zones,
        sample_times=times,
        frequencies=np.asarray(np.fft.rfftfreq(setting.samples, step), dtype=float),
        rows=tuple(rows if ringing else (replace(row, ringing=None) for row in rows)),
        published=tuple(published),
        notes=tuple(notes),
    )


def check_setting(samples: int | None, zone: float) -> None:
    """Refuse settings that make no sense.

    Raises:
        UsageError: naming the option.
    """
    if samples is not None and not 2 <= samples <= MOST_SAMPLES:
        raise UsageError(f"samples: a number from 2 to {MOST_SAMPLES} is expected, got {samples}")
    if not 0 <= zone < 0.5:
        raise UsageError(f"zone: a fraction of the horizon from 0 to below 0.5, got {zone:g}")


def _common_horizon(solutions: Sequence[Solution], truth: Truth | None) -> tuple[float, float]:
    judged = [s for s in solutions if s.success] or solutions
    horizons = [(float(s.times[0]), float(s.times[-1])) for s in judged]
    if truth is not None and truth.horizon is not None:
        horizons.append(truth.horizon)
    start, end = max(h[0] for h in horizons), min(h[1] for h in horizons)
    if not end > start:
        raise UsageError("the horizons of these answers have no time in common")
    return start, end


def _row(method: str, solution: Solution, ruler: _Ruler) -> Row:
    truth, horizon, n_u = ruler.truth, ruler.horizon, len(solution.origin.controls)
    samples = np.full((len(ruler.times), n_u), np.nan)
    row = Row(
        method=method,
        solution=solution,
        errors=None,
        by_control=(),
        cost_error=None,
        resimulated_cost_error=None,
        state_errors=(np.nan,) * len(solution.origin.states),
        state_error=None,
        switching_times=(),
        total_variation=variation(solution, solution.times, horizon),
        ringing=solution.evidence.ringing,
        samples=samples,
        spectrum=norms.spectrum(samples),
    )
    if truth is None:
        return row
    on = norms.grid(solution.times, np.array(truth.breaks), horizon, ruler.zones)
    samples = solution.control(ruler.times) - truth.control(ruler.times)
    by_control = norms.errors(on.sample(solution.control) - on.sample(truth.control), on, samples)
    states, known = on.sample(solution.state), on.sample(truth.state)
    state_errors, sizes = np.abs(states - known).max(axis=(0, 1)), np.abs(known).max(axis=(0, 1))
    relative = (state_errors / np.where(sizes > 0, sizes, 1.0))[~np.isnan(state_errors)]
    cost, evidence = truth.cost, solution.evidence
    switching = switching_times(solution.control, truth, horizon)
    return replace(
        row,
        errors=norms.together(by_control),
        by_control=by_control,
        cost_error=None if cost is None else solution.cost - cost,
        resimulated_cost_error=None if cost is None else evidence.resimulated_cost - cost,
        state_errors=tuple(float(e) for e in state_errors),
        state_error=float(relative.max()) if relative.size else None,
        switching_times=switching,
        switching_errors=tuple(np.subtract(switching, truth.switching_times).tolist()),
        samples=samples,
        spectrum=norms.spectrum(samples),
    )
