"""The Comparison: several answers to one problem, each held against the same truth; frozen.

e(t) = û(t) − u*(t) is the error of a control, with u* the truth's. What the norms of it are says
`quito_cli.comparison.norms`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from quito_cli.problem.schema_reference import Published
from quito_cli.solution.solution import Quantity, Solution

Array = NDArray[np.float64]
OfTime = Callable[[Array], Array]
"""times (m,) ↦ values (m, entries); NaN where unknown."""


@dataclass(frozen=True)
class Truth:
    """What answers are held against."""

    title: str
    """Where it is from: "reference of the file", "a solve on 1200 cells"."""
    cost: float | None
    """In the file's sense."""
    accuracy: float | None
    """Absolute, of the cost."""
    switching_times: tuple[float, ...]
    control: OfTime
    """Continuous from the right; (m, n_u)."""
    state: OfTime
    """(m, n_x)."""
    breaks: tuple[float, ...] = ()
    """Between these, control and state are smooth."""
    horizon: tuple[float, float] | None = None
    """Where it is known; None where it is a formula."""
    total_variation: tuple[float, ...] = ()
    """By control, jumps counted; NaN where unknown."""
    blur: float = 0.0
    """Time to either side of a switching time over which a jump is spread: none, in a formula."""
    first_row: bool = False
    """Whether it is the answer of the first row."""


@dataclass(frozen=True)
class Errors:
    """Norms of the error of one control, or of all together."""

    l1: float
    """∫|e| dt."""
    l2: float
    """(∫e² dt)^½."""
    l2_outside: float
    """The same with the jump zones left out."""
    sup: float
    """sup |e|."""
    sup_outside: float
    """The same with the jump zones left out."""
    norm: float
    """‖(e(t_1), …, e(t_n))‖₂ of the samples, as the QuITO paper has it."""
    dft_norm: float
    """‖DFT(e(t_1), …, e(t_n))‖₂, not normalised: √n times `norm`."""


@dataclass(frozen=True)
class Row:
    """An answer, by the method it was found with."""

    method: str
    solution: Solution
    errors: Errors | None
    """Of all known controls together; None where nothing is known of any."""
    by_control: tuple[Errors, ...]
    """NaN where nothing is known of a control."""
    cost_error: float | None
    """Its cost − the truth's: below zero, in a maximisation above, where it claims more than can be
    had."""
    resimulated_cost_error: float | None
    """What its own control attains − the truth's cost."""
    state_errors: tuple[float, ...]
    """By state, the largest |x − x*|; NaN where unknown."""
    state_error: float | None
    """The largest of them, each over the largest |x*|."""
    switching_times: tuple[float, ...]
    """Found near each of the truth's; infinite where the answer does not switch, NaN where the
    truth does not."""
    total_variation: tuple[float, ...]
    """By control."""
    ringing: tuple[float, ...] | None
    """Ringing index by control; None where those of the rows would not compare."""
    samples: Array
    """(n, n_u) error of the controls at the sample times; NaN where unknown."""
    spectrum: Array
    """(n//2 + 1, n_u) modulus of its discrete Fourier transform, not normalised."""
    switching_errors: tuple[float, ...] = ()
    """Found − the truth's."""

    @property
    def seconds(self) -> float:
        """Build and solve."""
        statistics = self.solution.statistics
        return statistics.build_seconds + statistics.solve_seconds

    @property
    def polish_seconds(self) -> float | None:
        """Of solving, those of the polish; None where none was asked for."""
        polishing = self.solution.polishing
        return None if polishing is None else polishing.seconds


@dataclass(frozen=True)
class Comparison:
    """Answers to one problem, ours first, held against one truth."""

    problem: str
    """Short name."""
    title: str
    controls: tuple[Quantity, ...]
    states: tuple[Quantity, ...]
    truth: Truth | None
    """None where there is none: the finer solve that was to be it has failed."""
    zones: tuple[tuple[float, float], ...]
    """Jump zones, left out of the figures called outside; in time, disjoint and increasing."""
    sample_times: Array
    """(n,)."""
    frequencies: Array
    """(n//2 + 1,) in cycles per unit of time."""
    rows: tuple[Row, ...]
    published: tuple[Published, ...]
    notes: tuple[str, ...] = ()
    """What a reader must know of how it was compared."""
    interrupted: bool = False
    """Whether it was stopped before all was solved."""
