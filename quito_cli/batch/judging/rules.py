"""Which of two figures is the better one, and by how much they may differ: a table by figure.

The tolerances are those that a new baseline starts with; there they can be changed. They are wide
enough for what another machine, another BLAS or another release of a solver does to an answer, and
narrow enough for what a change of a discretization does to it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Final


class Better(Enum):
    """Which of two figures is the better one."""

    SMALLER = "smaller"
    LARGER = "larger"
    NEITHER = "neither"
    """A change is for the worse: nobody has said that it is for the better."""
    COST = "cost"
    """Nearer to the optimum where that is known: see `quito_cli.batch.judging.comparing`."""


@dataclass(frozen=True)
class Tolerance:
    """By how much figures may differ and count as the same; the larger of the two holds."""

    absolute: float
    relative: float
    """Over the size of what was recorded."""

    def of(self, recorded: float) -> float:
        """Return the difference that is allowed."""
        if not math.isfinite(recorded):
            return self.absolute
        return max(self.absolute, self.relative * abs(recorded))


@dataclass(frozen=True)
class Rule:
    """How a figure is compared unless a baseline says otherwise."""

    better: Better
    tolerance: Tolerance
    recorded: bool = True
    """Whether a baseline has it without being told to: by a tolerance of its own for it."""
    words: tuple[str, ...] = ()
    """Of a figure in words: best first."""
    of: str = ""
    """The figure that it is made of, where it has another name; a time in calibration solves."""


def _smaller(absolute: float, relative: float, *, recorded: bool = True) -> Rule:
    return Rule(Better.SMALLER, Tolerance(absolute, relative), recorded)


def _neither(absolute: float, relative: float) -> Rule:
    return Rule(Better.NEITHER, Tolerance(absolute, relative), False)


def _time(of: str, *, recorded: bool = False) -> Rule:
    return Rule(Better.SMALLER, Tolerance(1, 1), recorded, of=of)


_EXACT: Final = Tolerance(0, 0)
PASSED: Final = "passed"
FAILS: Final = "fails"
"""Of a certificate: what fails by how much is no figure of a baseline."""
RULES: Final[Mapping[str, Rule]] = {
    "cost": Rule(Better.COST, Tolerance(1e-9, 1e-6)),
    "cost_error": _smaller(1e-8, 0.2),
    "relative_cost_error": _smaller(1e-8, 0.2, recorded=False),
    "resimulated_cost_error": _smaller(1e-8, 0.2),
    "error_l2": _smaller(1e-6, 0.2),
    "error_l1": _smaller(1e-6, 0.2, recorded=False),
    "error_sup": _smaller(1e-6, 0.2, recorded=False),
    "error_sup_outside": _smaller(1e-6, 0.2),
    "error_norm": _smaller(1e-6, 0.2, recorded=False),
    "dft_norm": _smaller(1e-5, 0.2, recorded=False),
    "state_error": _smaller(1e-7, 0.2),
    "switching_error": _smaller(1e-6, 0.2),
    "switching_times": _neither(1e-6, 1e-3),
    "initial_time": _neither(1e-9, 1e-6),
    "final_time": _neither(1e-9, 1e-6),
    "status": Rule(Better.NEITHER, _EXACT, False, ("solved",)),
    "success": Rule(Better.LARGER, _EXACT, False),
    "polished": Rule(Better.LARGER, _EXACT, False),
    "certificate": Rule(Better.NEITHER, _EXACT, words=(PASSED, FAILS)),
    "iterations": _smaller(3, 0.2),
    "cells": _neither(0, 0.1),
    "warnings": _smaller(0, 0),
    "violation": _smaller(1e-6, 0.2),
    "resimulation_gap": _smaller(1e-6, 0.2),
    "total_variation": _neither(1e-6, 0.02),
    "ringing": _smaller(0.5, 0.2),
    "estimated_error": _smaller(1e-5, 0.5),
    "processor_time": _time("processor_seconds", recorded=True),
    "build_time": _time("build_seconds"),
    "solve_time": _time("solve_seconds"),
}
"""By the name in a baseline. Recorded is what tells a better answer from a worse one; the others
are derived from these, or change without being better or worse, or with what else a machine does:
times on the clock."""
