"""One solve on one mesh: Model -> Method -> Nlp -> numbers -> Solution."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from quito_cli.options import Options
    from quito_cli.problem.model import Model
    from quito_cli.problem.schema import Problem
    from quito_cli.solution.solution import Solution
    from quito_cli.solvers import Residuals
    from quito_cli.solvers.outcome import Listener, Outcome
    from quito_cli.transcription.control import Basis, ControlBasis
    from quito_cli.transcription.mesh import Mesh
    from quito_cli.transcription.method import Method
    from quito_cli.transcription.transcribe import Nlp

RESCALINGS = 2
"""Solves that may follow because the guess misjudged the size of the cost."""
SATURATION_LIMIT = 1e-4
"""Saturation of the control, relative to its range, above which there is a warning: a tenth of what
a mesh is expected to reach."""
CLASSICAL_CONTROLS = {"piecewise-constant": "box", "piecewise-linear": "hat"}
"""Controls that are a generating function of their own."""
REFINED_TOLERANCE = 1e-12
"""Tolerance of solves on meshes that follow the control: what a coefficient does in a small cell
counts for as little as the cell is long."""
GRADED = 0.5
"""Shortest cell over the mean from which on a mesh counts as one of equal cells."""
PATIENCE = 3, 100
"""Iterations that such a solve may take: this many times those of the solve before, and some; of a
solver that does not tell, as many as the first."""


@dataclass(frozen=True)
class Task:
    """What is to be solved, and how; on which mesh, is said later."""

    problem: Problem
    model: Model
    options: Options
    """As resolved, for the record; an answer is judged by their tolerance."""
    tolerance: float
    """What the solver is asked for."""
    max_iterations: int
    own_guess: bool
    """Whether the guess is the problem's, so that it is worth a word what was done to it."""
    listener: Listener | None

    def on(self, mesh: Mesh, warm: Solution | None, build_seconds: float) -> Solution:
        """Solve on a mesh.

        Args:
            mesh: the cells.
            warm: an answer whose multipliers are to be started from; None starts from the guess.
            build_seconds: what building took before.

        Raises:
            UsageError: too small a variance, or a solver that cannot do it.
        """
        from quito_cli.solution.extract import extract

        started = time.perf_counter()
        method = method_on(self.options, mesh)
        build_seconds += time.perf_counter() - started
        nlp, outcome, residuals, transcribed = self._minimised(method, warm)
        doubt = control_warning(self.model, method.basis)
        notes = nlp.notes if self.own_guess else ()
        nlp = replace(nlp, notes=notes + ((doubt,) if doubt else ()))
        seconds = build_seconds + transcribed
        return extract(self.problem, nlp, outcome, residuals, self.options.record, seconds)

    def again(self, mesh: Mesh, substeps: int, earlier: Solution) -> Solution:
        """Solve on another mesh from the answer on the last one, to a tighter tolerance.

        An answer that only meets the tolerance asked for is one, too.
        """
        from quito_cli.solution.follow import guided
        from quito_cli.solvers import SOLVERS

        row = SOLVERS.get(self.options.solver)
        started, times, some = time.perf_counter(), *PATIENCE
        taken = earlier.statistics.iterations
        graded = mesh.steps.min() * mesh.cells < GRADED
        task = replace(
            self,
            model=guided(self.model, earlier),
            own_guess=False,
            options=replace(self.options, substeps=substeps, steps=mesh.cells),
            tolerance=min(self.tolerance, REFINED_TOLERANCE) if graded else self.tolerance,
            max_iterations=self.max_iterations
            if taken is None
            else min(self.max_iterations, times * taken + some),
        )
        warm = earlier if row is not None and row.warm is not None else None
        return task.on(mesh, warm, time.perf_counter() - started)

    def _minimised(
        self, method: Method, warm: Solution | None
    ) -> tuple[Nlp, Outcome, Residuals, float]:
        """Return program, answer, residuals and the seconds of transcription.

        Controls with kinks are taken apart. Parts out of order are no answer: then the problem is
        solved as it stands.
        """
        from quito_cli.optimality.parts.apart import in_order, merged_point, split_answer
        from quito_cli.optimality.parts.parted import parted
        from quito_cli.solvers import Status

        parts = parted(self.model)
        if parts is None:
            return self._solved(self.model, method, warm)
        earlier = None if warm is None else split_answer(parts, warm)
        nlp, outcome, residuals, seconds = self._solved(parts.model, method, earlier)
        if not in_order(parts, nlp, outcome) and outcome.status is not Status.INTERRUPTED:
            return self._solved(self.model, method, warm)
        begun = time.perf_counter()
        found = merged_point(parts, nlp, outcome, residuals, self.options.path_points)
        return *found, seconds + time.perf_counter() - begun

    def _solved(
        self, model: Model, method: Method, warm: Solution | None
    ) -> tuple[Nlp, Outcome, Residuals, float]:
        """Return program, answer, residuals and the seconds of transcription.

        Where the guess was so costly that its scale makes the objective count for nothing, it is
        solved again from the answer, with the scale that the cost found calls for.
        """
        from quito_cli.solution.follow import resumed
        from quito_cli.solvers import Status, judged, minimise
        from quito_cli.transcription.transcribe import FAR_TOO_SMALL, transcribe, wanted_scale

        options, started = self.options, time.perf_counter()
        nlp = transcribe(model, method, options.objective_scale, options.path_points)
        nlp, start = (nlp, None) if warm is None else resumed(nlp, warm)
        seconds = time.perf_counter() - started
        settings = (
            options.solver,
            self.tolerance,
            self.max_iterations,
            options.solver_options,
            self.listener,
        )
        outcome, residuals = minimise(nlp, *settings, start)
        for _ in range(RESCALINGS if options.objective_scale is None else 0):
            scale = wanted_scale(residuals.cost)
            if nlp.objective_scale > FAR_TOO_SMALL * scale or outcome.status is Status.INTERRUPTED:
                break
            before, started = outcome, time.perf_counter()
            nlp = replace(transcribe(model, method, scale, options.path_points), guess=outcome.w)
            seconds += time.perf_counter() - started
            outcome, residuals = minimise(nlp, *settings, None)
            outcome = outcome.following(before)
        return nlp, judged(outcome, residuals, options.tolerance), residuals, seconds


def method_on(options: Options, mesh: Mesh) -> Method:
    """Return what the options make a problem finite with, on a mesh.

    Raises:
        UsageError: too small a variance for the generating function.
    """
    from quito_cli.problem.options import COLLOCATION
    from quito_cli.transcription.cells import Discretization
    from quito_cli.transcription.schemes import scheme

    if options.discretization == COLLOCATION:
        from quito_cli.transcription.collocation import Collocation

        return Collocation(mesh, options.degree)
    basis = control_basis(options, mesh.cells).on(mesh)
    return Discretization(mesh, basis, scheme(options.discretization), options.substeps)


def control_basis(options: Options, cells: int) -> ControlBasis:
    """Return the control's functions on so many cells, of equal length.

    Where the scheme looks at û in too few points, ghosts that none of them could determine are left
    out.

    Raises:
        UsageError: a variance too small for the generating function.
    """
    from quito_cli.transcription.cells import points_seen
    from quito_cli.transcription.control import ControlBasis
    from quito_cli.transcription.generating import (
        GENERATING_FUNCTIONS,
        check_variance,
        generating_function,
    )
    from quito_cli.transcription.schemes import scheme

    classical = CLASSICAL_CONTROLS.get(options.control)
    if classical is not None:
        return ControlBasis(GENERATING_FUNCTIONS[classical], cells, 1.0, True)
    row = generating_function(options.generating_function)
    check_variance(row, options.variance)
    basis = ControlBasis(row, cells, options.variance, options.normalised)
    seen = points_seen(scheme(options.discretization), options.substeps, cells)
    most = max(-1 if cells > 2 else 0, (seen - cells - 1) // 2)
    return basis if basis.ghosts <= most else replace(basis, most_ghosts=most)


def control_warning(model: Model, basis: Basis) -> str | None:
    """Return what there is to say against a control's generating function and variance."""
    from quito_cli.transcription.control import ControlBasis
    from quito_cli.transcription.qualities import saturation_warning

    if not isinstance(basis, ControlBasis):
        return None
    bounds = model.control_bounds
    return saturation_warning(basis, bounds.lower, bounds.upper, SATURATION_LIMIT)
