"""The Solution: an answer with its evidence, frozen, and usable without CasADi."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from quito_cli.problem.shapes import Ball, Block
from quito_cli.solution.junctions import Junction
from quito_cli.solution.optimal import Arc, Condition, Extremal, all_switches
from quito_cli.solution.polishing import Polishing
from quito_cli.solution.tally import doubts
from quito_cli.solution.trajectory import Curve, Polynomials
from quito_cli.solution.violations import Violation
from quito_cli.solvers.outcome import Status
from quito_cli.transcription.control import Basis
from quito_cli.transcription.mesh import Mesh

if TYPE_CHECKING:
    from quito_cli.solution.densities import Densities
    from quito_cli.solution.rounds import Refinement

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Quantity:
    """A state or control entry, as labels and bounds on a plot need it."""

    name: str
    unit: str
    lower: float
    upper: float


@dataclass(frozen=True)
class Origin:
    """The problem that was solved."""

    name: str
    title: str
    text: str
    """The YAML text."""
    changes: tuple[tuple[str, str], ...]
    """What was set beside it: (name, value)."""
    states: tuple[Quantity, ...]
    controls: tuple[Quantity, ...]
    parameters: tuple[Quantity, ...]
    free_times: bool
    """Whether the initial or the final time was an unknown."""
    maximize: bool


@dataclass(frozen=True)
class ReferenceSamples:
    """What the file knows of the answer, sampled where the solution's dense grid is."""

    cost: float | None
    accuracy: float | None
    switching_times: tuple[float, ...]
    states: Array
    """(points, n_x); NaN where unknown."""
    controls: Array
    """(points, n_u); NaN where unknown."""


@dataclass(frozen=True)
class Drawing:
    """A plot of the file's own, sampled where the solution's dense grid is."""

    name: str
    title: str
    labels: tuple[str, ...]
    """Of its two or three axes."""
    curves: Mapping[str, Array]
    """By name for the legend, (points, axes)."""
    balls: tuple[Ball, ...]
    blocks: tuple[Block, ...]


@dataclass(frozen=True)
class Evidence:
    """What speaks for an answer, found independently of the nonlinear program (or recomputed)."""

    tolerance: float
    """What the residuals are judged against, at ten times."""
    stationarity: float
    """First-order residual at the returned point, scaled."""
    feasibility: float
    """Largest violation of a constraint of the nonlinear program."""
    complementarity: float
    """Largest product of a multiplier with the distance from its bound, scaled."""
    recomputed_cost: float
    """Cost at the returned point by the nonlinear program's functions, in the file's sense."""
    resimulated_cost: float
    """Cost that û(t) produces when integrated anew, in the file's sense."""
    resimulation_gap: float
    """Largest distance of the re-simulated states from the answer's, over the state's size."""
    resimulation_accuracy: float
    """Relative change of the re-simulation when its steps were last halved."""
    terminal_gap: float
    """Largest violation of a final condition by the re-simulated state, over the state's size."""
    violations: tuple[Violation, ...]
    """Of every bound and end condition on a grid between the nodes too, worst first."""
    total_variation: tuple[float, ...]
    """By control."""
    ringing: tuple[float, ...]
    """Ringing index by control; about one without ringing."""
    warnings: tuple[str, ...]
    """What a reader must know before believing the answer."""
    diagnosis: tuple[str, ...]
    """For an answer that is no success: why, in the words of the problem file."""

    @property
    def maximum_violation(self) -> float:
        """The largest amount by which any condition is violated anywhere."""
        return max((violation.amount for violation in self.violations), default=0.0)


@dataclass(frozen=True)
class MultiplierAxes:
    """The axes of a block of multipliers."""

    times: Array
    """(places,)."""
    labels: tuple[str, ...]


@dataclass(frozen=True)
class Statistics:
    """Counts and times."""

    iterations: int | None
    build_seconds: float
    solve_seconds: float
    unknowns: int
    constraints: int
    solver: str
    """The row of the table of solvers that ran."""
    solver_said: str
    program: str
    """`QP` where the nonlinear program is a quadratic one, else `NLP`."""


@dataclass(frozen=True)
class Solution:
    """An answer: control, states and costates as functions of time, and why to believe them."""

    origin: Origin
    options: Mapping[str, Any]
    """Resolved options of the solve."""
    status: Status
    cost: float
    """In the file's sense."""
    times: Array
    """(N+1,) times of the nodes."""
    trajectory: Curve
    basis: Basis
    coefficients: Array
    """(count, n_u) of the control."""
    parameters: Array
    """(n_p,) unknowns constant in time."""
    costates: Array
    """(N+1, n_x) at the nodes: λ = ∂V/∂x of the minimisation, unscaled."""
    multipliers: Mapping[str, Array]
    """Of the nonlinear program's rows, by block, unscaled: (places, labels)."""
    multiplier_axes: Mapping[str, MultiplierAxes]
    """When and of what the multipliers of each block are."""
    evidence: Evidence
    statistics: Statistics
    history: Mapping[str, Array]
    """By iteration of the solver."""
    dense_times: Array
    """A fine uniform grid from the initial to the final time."""
    reference: ReferenceSamples | None
    """None where the file has none that applies."""
    drawings: tuple[Drawing, ...] = ()
    """The plots the file asks for."""
    adjoint: Polynomials | None = None
    """Costates at all collocation points and in between; None where the nodes are all there is."""
    junctions: tuple[Junction, ...] = ()
    """Jumps and kinks of the controls, by time."""
    refinement: Refinement | None = None
    """How the mesh was found; None of a uniform one."""
    extremal: Extremal | None = None
    """What Pontryagin's conditions say of it; None where they were not looked at."""
    polishing: Polishing | None = None
    """The account of its polish; None where none was asked for."""
    densities: Densities | None = None
    """Multipliers of constraints as functions of time: those of a polished answer are known."""

    def __post_init__(self) -> None:
        pressing = self.densities and self.densities.curve
        curves = [vars(c).values() for c in (self.trajectory, self.adjoint, pressing) if c]
        sampled = () if self.extremal is None else self.extremal.curves.values()
        times = () if self.extremal is None else (self.extremal.times,)
        for value in (*vars(self).values(), *chain(*curves), *sampled, *times):
            if isinstance(value, np.ndarray):
                value.flags.writeable = False

    def __repr__(self) -> str:
        how = f"{self.status.name}, cost {self.cost:.10g}, {len(self.times) - 1} cells"
        return f"<Solution of {self.origin.name}: {how}>"

    @property
    def success(self) -> bool:
        """Whether the recomputed residuals are within ten times the tolerance."""
        return self.status is Status.SOLVED

    @property
    def polished(self) -> bool:
        """Whether it is an exact extremal of known arcs, on a mesh of their segments."""
        return self.densities is not None

    @property
    def switching_times(self) -> tuple[float, ...]:
        """Times at which a control or a constraint changes, each once, without the ends."""
        return all_switches(self.arcs, self.junctions)

    @property
    def arcs(self) -> tuple[Arc, ...]:
        """The structure of every control, then of every constraint; empty where it is not known."""
        return () if self.extremal is None else self.extremal.arcs

    @property
    def certificate(self) -> tuple[Condition, ...]:
        """Pontryagin's conditions, one a row; empty where they were not looked at."""
        return () if self.extremal is None else self.extremal.certificate

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a reader must know before believing the answer: of evidence, certificate, polish."""
        unpolished = () if self.polishing is None else self.polishing.warnings
        return (*self.evidence.warnings, *doubts(self.certificate), *unpolished)

    @property
    def interrupted(self) -> bool:
        """Whether the user stopped the solve, or the polish of its answer."""
        unpolished = self.polishing is not None and self.polishing.interrupted
        return self.status is Status.INTERRUPTED or unpolished

    @property
    def mesh(self) -> Mesh:
        """The control cells."""
        start, end = self.times[0], self.times[-1]
        return Mesh((self.times - start) / (end - start))

    def control(self, t: ArrayLike) -> Array:
        """Return û at times t, (len(t), n_u), continuous from the right; ends hold beyond."""
        start, end = self.times[0], self.times[-1]
        times = np.clip(np.atleast_1d(np.asarray(t, dtype=float)), start, end)
        cells, offsets = self.mesh.locate((times - start) / (end - start))
        return self.basis.evaluate(self.coefficients, cells, offsets)

    def state(self, t: ArrayLike) -> Array:
        """Return the states at times t, (len(t), n_x), interpolated by the scheme's order."""
        return self.trajectory(np.atleast_1d(np.asarray(t, dtype=float)))

    def costate(self, t: ArrayLike) -> Array:
        """Return the costates at times t, (len(t), n_x).

        Linear between the nodes; of a collocation the polynomials through all of its points. Where
        those of a polished answer jump, continuous from the right.
        """
        times = np.atleast_1d(np.asarray(t, dtype=float))
        if self.adjoint is not None:
            return self.adjoint(times)
        columns = [np.interp(times, self.times, column) for column in self.costates.T]
        return np.array(columns).reshape(len(columns), len(times)).T

    def save(self, path: str | Path) -> None:
        """Write the result file; an older one of that name is replaced only when all is written.

        Raises:
            ResultFileError: the file cannot be written.
        """
        from quito_cli.solution.store import save

        save(self, Path(path))

    @classmethod
    def load(cls, path: str | Path) -> Solution:
        """Read a result file.

        Raises:
            ResultFileError: it is missing, damaged, no result of quito, or of a newer format.
        """
        from quito_cli.solution.store import load

        return load(Path(path))
