"""Whether the equations determine how long a brief arc is.

Where the extremal does not have an arc of a structure, the arc shrinks; and where its junctions are
then one, the equations have a double root: Newton's method halves the arc with each step, and ends
when the residual, which goes with the square of the length, is as small as it is asked to be. So
the length that is left is not of the extremal. A further step tells: of an arc that is there it
changes next to nothing, of one that is not about half.
"""

from __future__ import annotations

import numpy as np

from quito_cli.optimality.polish.faults.dense import Dense
from quito_cli.optimality.polish.faults.fault import Fault
from quito_cli.optimality.polish.solving.chain import solved
from quito_cli.optimality.polish.solving.newton import Scales, linear

BRIEF = 1e-2
"""Part of the horizon that an arc is shorter than, to be looked at."""
CHANGED = 0.05
"""Part of its length by which a further step may change an arc."""


def undetermined(dense: Dense, scales: Scales) -> Fault | None:
    """Return the brief arc whose length a further step changes most; None where all stay."""
    lengths, place = dense.lengths, dense.system.layout.place("times")
    if len(lengths) < 2 or lengths.min() > BRIEF * dense.horizon:
        return None
    step = solved(linear(dense.system, dense.at, scales)).shared[place] * scales.shared[place]
    change = np.abs(np.diff(step)) / np.abs(lengths)
    change[lengths > BRIEF * dense.horizon] = 0.0
    k = int(np.argmax(change))
    if not change[k] > CHANGED:
        return None
    says = (
        f"nothing determines the length of the arc that begins at {dense.times[k]:.6g}: the "
        "extremal does not have it"
    )
    return Fault("vanished", 0.0, 0.0, float(change[k]), says, k)
