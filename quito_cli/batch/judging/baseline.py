"""A Baseline: the figures of an earlier run by case, and the tolerances to compare others with.

Of a run it records the cases that have an answer. A figure is written to as many digits as its
tolerance can tell apart, to a twentieth of it, and where it is the same as the one recorded, that
one stays: what is within its tolerance changes no line of the file, and cannot creep away in small
steps, from update to update, either. Times are recorded in calibration solves.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final

from quito_cli.batch.judging.figures import COSTLY
from quito_cli.batch.judging.rules import FAILS, PASSED, RULES, Tolerance
from quito_cli.batch.suite.case import Ending, Figure, Finished

Figures = Mapping[str, Figure]
"""Known figures by name."""
Tolerances = Mapping[str, Tolerance | None]
"""By figure; None of one that is ignored."""

ANSWERED: Final = (Ending.PASSED, Ending.OUTSIDE)
"""Endings with an answer, whose figures mean something."""
_PART: Final = 20
"""Of a tolerance that rounding a figure may take."""


@dataclass(frozen=True)
class Baseline:
    """Figures of an earlier run, and the tolerances to compare others with."""

    cases: Mapping[str, Figures] = field(default_factory=dict)
    """By case, then by figure."""
    tolerances: Tolerances = field(default_factory=dict)
    """Of all cases; a figure that is not here has the tolerance of its rule."""
    exceptions: Mapping[str, Tolerances] = field(default_factory=dict)
    """By case: tolerances of its own."""

    def tolerance(self, case: str, figure: str) -> Tolerance | None:
        """Return the tolerance of a figure of a case; None where it is ignored."""
        for declared in (self.exceptions.get(case, {}), self.tolerances):
            if figure in declared:
                return declared[figure]
        return RULES[figure].tolerance if RULES[figure].recorded else None

    @cached_property
    def _looked_at(self) -> frozenset[str]:
        """Every figure that has a tolerance in any case."""
        named = {name for own in self.exceptions.values() for name, given in own.items() if given}
        return frozenset(name for name in RULES if name in named or self.tolerance("", name))

    @property
    def costly(self) -> frozenset[str]:
        """The figures it wants that are found on request only."""
        return self._looked_at & COSTLY

    @property
    def timed(self) -> bool:
        """Whether times are of any interest to it, and with them a calibration."""
        return any(RULES[name].of for name in self._looked_at)


def known(figure: Figure) -> bool:
    """Whether a figure is there at all: not None, and no NaN."""
    return figure is not None and not (isinstance(figure, float) and math.isnan(figure))


def measured(
    baseline: Baseline, finished: Finished, calibration: float | None
) -> dict[str, Figure]:
    """Return the figures of a case that are compared, by their names in a baseline.

    One that is expected not to converge has none: where a solver gives up says nothing.

    Args:
        baseline: which leaves out what it ignores.
        finished: a case with an answer.
        calibration: processor seconds of a calibration solve; None leaves the times out.
    """
    found: dict[str, Figure] = {}
    if finished.figures.get("success") is False:
        return found
    for name, rule in RULES.items():
        figure = finished.figures.get(rule.of or name)
        if not known(figure) or baseline.tolerance(finished.case.name, name) is None:
            continue
        if name == "certificate":
            figure = PASSED if figure == PASSED else FAILS
        if not rule.of:
            found[name] = figure
        elif calibration and isinstance(figure, int | float):
            found[name] = figure / calibration
    return found


def without_times(figures: Figures) -> dict[str, Figure]:
    """Return figures of a baseline without those that want a calibration."""
    return {name: figure for name, figure in figures.items() if not RULES[name].of}


def updated(
    baseline: Baseline,
    finished: Sequence[Finished],
    same: Mapping[str, frozenset[str]],
    calibration: float | None,
    everything: Collection[str] | None,
) -> Baseline:
    """Return the baseline with what a run has found; tolerances stay as they are.

    A case without an answer keeps what is recorded of it.

    Args:
        baseline: as it was; an empty one to begin with.
        finished: the cases of a run.
        same: by case the figures that are within their tolerances, and stay.
        calibration: processor seconds of a calibration solve; None leaves the times as they were.
        everything: names of all cases of the suite: others are left out. None of a run of a part
            of the suite, where others stay.
    """
    stay = baseline.cases if everything is None else baseline.cases.keys() & set(everything)
    cases = {name: baseline.cases[name] for name in stay}
    for case in finished:
        name = case.case.name
        recorded = baseline.cases.get(name, {})
        if case.ending in ANSWERED:
            cases[name] = _renewed(
                baseline, case, recorded, same.get(name, frozenset()), calibration
            )
        elif recorded:
            cases[name] = recorded
    seen = {name for figures in cases.values() for name in figures}
    rules = {name: rule.tolerance for name, rule in RULES.items() if name in seen}
    exceptions = {name: own for name, own in baseline.exceptions.items() if name in cases}
    return Baseline(cases, {**rules, **baseline.tolerances}, exceptions)


def _renewed(
    baseline: Baseline,
    case: Finished,
    recorded: Figures,
    same: frozenset[str],
    calibration: float | None,
) -> Figures:
    timeless = without_times(recorded) if calibration is None else recorded
    renewed = {name: figure for name, figure in recorded.items() if name not in timeless}
    for name, figure in measured(baseline, case, calibration).items():
        tolerance = baseline.tolerance(case.case.name, name)
        assert tolerance is not None
        renewed[name] = recorded[name] if name in same else rounded(figure, tolerance)
    return renewed


def rounded(figure: Figure, tolerance: Tolerance) -> Figure:
    """Return a figure to as few digits as lose no more than a twentieth of its tolerance."""
    if isinstance(figure, tuple):
        return tuple(_shortened(entry, tolerance.of(entry)) for entry in figure)
    return _shortened(figure, tolerance.of(figure)) if isinstance(figure, float) else figure


def _shortened(value: float, tolerance: float) -> float:
    if not math.isfinite(value):
        return value
    if abs(value) <= tolerance / _PART:
        return 0.0
    for digits in range(1, 17):
        short = float(f"{value:.{digits}g}")
        if abs(short - value) <= tolerance / _PART:
            return short
    return value
