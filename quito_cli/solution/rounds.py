"""What a refinement of the mesh leaves behind: its rounds, an account of the control's error."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Round:
    """A solve on one of the meshes."""

    nodes: Array
    """(N+1,) times."""
    substeps: int
    cost: float
    """Of the nonlinear program, in the file's sense."""
    resimulated_cost: float
    """Of its control, integrated anew, in the file's sense."""
    gap: float
    """Largest distance of the re-simulated states, over their size."""
    violation: float
    """Largest violation of any condition between the nodes, or at the end by the re-simulated
    states, over its size."""
    change: float
    """Largest change of û since the round before, outside jumps, over the control's range; NaN in
    the first."""
    blur: float
    """L² norm of û minus a step over all its jumps, over range and horizon."""
    iterations: int
    """Of the solver; −1 where it does not tell."""
    seconds: float
    """Building and solving."""

    @property
    def cells(self) -> int:
        """N."""
        return len(self.nodes) - 1

    @property
    def shortest(self) -> float:
        """Length of the shortest cell, over the horizon."""
        return float(np.diff(self.nodes).min() / (self.nodes[-1] - self.nodes[0]))


@dataclass(frozen=True)
class Account:
    """What is known of the error of û, relative to its range: estimates, none of them a bound."""

    meshes: float
    """Largest difference from the answer on another mesh, outside jumps."""
    substeps: float
    """Largest difference from the answer with twice the substeps, outside jumps."""
    bounds: float
    """Largest distance from a bound where û is at it."""
    jumps: float
    """L² norm of û minus a step, over all jumps."""
    left_out: tuple[tuple[float, float], ...]
    """Times around the jumps, left out above: of this answer and of those it is compared with."""
    saturation: float
    """Of the generating function: what no mesh removes."""
    approximation: float
    """Differences of û in index space, outside jumps, of the order of the first moment that is not
    zero, times that moment: the error of a quasi-interpolant with û's values for coefficients."""
    integration: float
    """Sum over the cells of the local errors of the states, over their size."""
    states: float
    """Largest distance of the re-simulated states, over their size."""

    @property
    def control(self) -> float:
        """One figure: the estimated error of û outside jumps, over its range."""
        return float(np.max([self.meshes, self.substeps, self.bounds]))  # NaN if one is not known

    @property
    def time_left_out(self) -> float:
        """Total width of the jump zones."""
        return sum(end - start for start, end in self.left_out)


@dataclass(frozen=True)
class Refinement:
    """How the mesh of an answer was found."""

    rounds: tuple[Round, ...]
    kept: int
    """Index of the round whose answer this is."""
    outcome: str
    """Why it ended, as a sentence."""
    account: Account | None
    """None where the rounds did not get so far."""
