"""From a residual to a verdict.

Three levels, of every condition relative to the scale that it names:

    holds                              residual ≤ SOLVED · scale,
    holds to discretization accuracy   residual ≤ max(expected · scale, SAFETY · explained),
    fails                              above.

`expected` is what a mesh of the default tolerance, 1e-3 of the control's range, is there to reach:
a condition that is second order in the control's error, or has nothing to do with it, has less.
`explained` is what theory says of this very answer: the local errors of its scheme on its cells,
found by the same scheme with half the steps, never by looking at the residual; the accumulated ones
for whatever follows costates; second differences of û where a quasi-interpolant, or a polynomial,
cannot follow the control. It is asked for only where `expected` does not do. A wrong answer changes
the residual and not what its mesh explains.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from quito_cli.solution.optimal import Condition, Verdict

Array = NDArray[np.float64]

SOLVED = 1e-6
"""Relative residual of an answer that is right to the accuracy of solvers."""
SAFETY = 10.0
"""Errors may be this many times their estimates: constants of schemes differ by up to four."""
PLAIN, SHARP = 1e-3, 1e-5
"""What is expected of conditions: of those that feel û's error directly, and of the others."""


def judged(
    name: str,
    residuals: Array,
    scale: float | Array,
    times: Array,
    expected: float,
    explained: Callable[[], Array | float],
    what: str = "",
) -> Condition:
    """Return a row of the certificate: the place that is worst beside what is allowed there.

    Args:
        name: of the condition.
        residuals: (points,) or (points, entries), 0 where nothing is asked.
        scale: of all of them, or by entry; of (points,) residuals by point.
        times: (points,).
        expected: relative residual that a fine mesh reaches.
        explained: gives the absolute residual that the mesh explains, in the shape of `residuals`.
        what: fails, in words that the place is added to.
    """
    size = np.where(np.asarray(scale) > 0, scale, 1.0)
    given = np.abs(residuals)
    relative = np.where(np.isfinite(given), given, np.inf) / size
    worst = np.unravel_index(int(np.argmax(relative)), relative.shape)
    verdict: Verdict = "holds"
    if relative[worst] > SOLVED:
        verdict = "holds to discretization accuracy"
    if relative[worst] > expected:
        allowed = np.maximum(expected, SAFETY * np.asarray(explained()) / size)
        over = relative / np.where(np.isfinite(allowed), allowed, np.inf)
        if over.max() > 1:
            worst, verdict = np.unravel_index(int(np.argmax(over)), relative.shape), "fails"
    own = float(np.broadcast_to(size, relative.shape)[worst])
    residual, time = float(relative[worst]) * own, float(times[worst[0]])
    reason = (
        f"{what or name} is off by {residual:.2g} at t = {time:.6g}" if verdict == "fails" else ""
    )
    return Condition(name, residual, own, time, verdict, reason)


def not_applicable(name: str, reason: str) -> Condition:
    """Return the row of a condition that says nothing here."""
    return Condition(name, float("nan"), float("nan"), float("nan"), "not applicable", reason)
