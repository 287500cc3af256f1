"""What Pontryagin's conditions say of an answer: its arcs, and a certificate by condition."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from quito_cli.solution.junctions import Junction

Array = NDArray[np.float64]

Kind = Literal["lower", "upper", "interior", "singular", "kink", "active", "inactive"]
"""Of a control: at its lower or upper bound, between them, between them where the Hamiltonian is
affine in it, or at rest where the Hamiltonian has a kink in it; of a constraint: active or not."""
Verdict = Literal["holds", "holds to discretization accuracy", "fails", "not applicable"]

UNRESOLVED = "that the cells resolve"
"""What the reason of a condition says that does not apply for want of cells."""
MINIMUM = "H is least over the admissible controls"
"""Name of the condition that lesser wells of H violate."""
HAMILTONIAN, SWITCHING = "Hamiltonian", "dH/d"
"""Names of curves: the Hamiltonian; before the label of a control, its switching function."""


@dataclass(frozen=True)
class Arc:
    """A stretch of time on which a control, or a constraint, is of one kind."""

    of: str
    """Label of the control, or name of the constraint."""
    kind: Kind
    start: float
    end: float
    start_uncertainty: float
    """Half the time within which the arc begins; 0 at the ends of the horizon."""
    end_uncertainty: float


@dataclass(frozen=True)
class Condition:
    """A row of the certificate."""

    condition: str
    """As a person would name it, such as "dH/du = 0 on interior arcs of u"."""
    residual: float
    """Largest violation; NaN where the condition does not apply."""
    scale: float
    """What the residual is judged by."""
    time: float
    """Where it is worst; NaN where that means nothing."""
    verdict: Verdict
    reason: str
    """Why it does not apply, or what fails; empty where it holds."""


@dataclass(frozen=True)
class Extremal:
    """An answer in the light of Pontryagin's conditions."""

    arcs: tuple[Arc, ...]
    """By control in the file's order, then by constraint; each in the order of time."""
    certificate: tuple[Condition, ...]
    times: Array
    """(points,) at which what follows is sampled, increasing, finer where cells are small."""
    curves: Mapping[str, Array]
    """(points,) each, by `HAMILTONIAN`, and by `SWITCHING` with the label of each control,
    or of the parts of one with kinks."""


def all_switches(arcs: Sequence[Arc], junctions: Sequence[Junction]) -> tuple[float, ...]:
    """Return the times at which any control or constraint changes, each once, in order.

    Ends of arcs come first, the surest of those that may be one; a jump or kink that none of them
    is, stands for itself.
    """
    last = max((arc.end for arc in arcs), default=np.inf)
    ends = [(arc.end, arc.end_uncertainty) for arc in arcs if arc.end < last]
    found: list[tuple[float, float]] = []
    for time, doubt in sorted(ends, key=lambda end: end[1]):
        if all(abs(time - other) > doubt + own for other, own in found):
            found.append((time, doubt))
    for j in junctions:
        if all(abs(j.time - time) > j.uncertainty + doubt for time, doubt in found):
            found.append((j.time, j.uncertainty))
    return tuple(sorted(time for time, _ in found))
