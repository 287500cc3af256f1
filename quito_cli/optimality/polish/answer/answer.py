"""An exact extremal as an answer like any other.

It is written down as the point of another program: Legendre-Gauss-Radau collocation whose cells are
the segments of its arcs, of a degree that has room for its polynomials. States and controls at the
points are the unknowns; with m offsets w_i h of the quadrature,

    rows of the dynamics   λ at the points,
    path constraints       w_i h μ(t_i), and impulses at nodes,
    bounds of states       the same, multipliers of unknowns,
    other constraints      ω, ν and ρ as they are,

are the multipliers; what is at a bound of its own takes what the gradient leaves, if it has the
sign. None of this is solved: a discretization that had no part in finding it judges the point as
its own first-order point, and all evidence comes from the code that every answer comes from. The
certificate is recomputed with the arcs and multipliers that are known.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.certificate.certificate import certify
from quito_cli.optimality.hamiltonian import Pontryagin, pontryagin
from quito_cli.optimality.parts.apart import merged_extremal, merged_junctions, merged_point
from quito_cli.optimality.polish.answer.exact import Exact, Sampled
from quito_cli.optimality.polish.answer.multipliers import bound_multipliers, row_multipliers
from quito_cli.optimality.polish.answer.switches import junctions_of
from quito_cli.solution.densities import Densities, Impulse
from quito_cli.solution.extract import extract
from quito_cli.solution.follow import guided
from quito_cli.solution.optimal import Extremal
from quito_cli.solution.trajectory import Polynomials
from quito_cli.solvers import judged
from quito_cli.solvers.outcome import Outcome, Status
from quito_cli.solvers.residuals import Residuals, residuals
from quito_cli.transcription.collocation import Collocation
from quito_cli.transcription.legendre import radau
from quito_cli.transcription.mesh import Mesh
from quito_cli.transcription.transcribe import Nlp, transcribe, wanted_scale

if TYPE_CHECKING:
    from quito_cli.optimality.parts.parts import Parts
    from quito_cli.options import Options
    from quito_cli.problem.model import Model
    from quito_cli.problem.schema import Problem
    from quito_cli.solution.polishing import Polishing
    from quito_cli.solution.solution import Solution

Array = NDArray[np.float64]

SAID = "polished"
"""In the place of a solver's own word."""


def answer(
    problem: Problem,
    model: Model,
    options: Options,
    exact: Exact,
    direct: Solution,
    polishing: Polishing,
    seconds: float,
) -> Solution:
    """Return an exact extremal as a Solution, with its evidence and its certificate.

    Args:
        problem: what was solved.
        model: its Model.
        options: as resolved for the direct solve; the answer is judged by their tolerance.
        exact: the extremal.
        direct: the answer that it was polished from.
        polishing: the account of the polish.
        seconds: what the polish took until now.
    """
    return _written(problem, model, options, exact, direct, polishing, seconds).solution


def answer_of_parts(
    problem: Problem,
    parts: Parts,
    options: Options,
    exact: Exact,
    direct: Solution,
    polishing: Polishing,
    seconds: float,
) -> tuple[Solution, Solution]:
    """Return an exact extremal in parts of controls as a Solution, and that of the whole.

    Its certificate is that of the parts; all other evidence is found anew, of the controls.

    Args:
        problem: what was solved.
        parts: its Model, and that of the parts.
        options: as resolved for the direct solve.
        exact: the extremal, of the parts.
        direct: the answer that it was polished from, of the parts.
        polishing: the account of the polish.
        seconds: what the polish took until now.
    """
    done = _written(problem, parts.model, options, exact, direct, polishing, seconds)
    point = merged_point(parts, done.nlp, done.outcome, done.found, None)
    own, said = done.solution, done.solution.options
    building = own.statistics.build_seconds
    whole = extract(problem, *point, said, building)
    return own, replace(
        whole,
        times=own.times,
        trajectory=own.trajectory,
        adjoint=own.adjoint,
        costates=own.costates,
        densities=own.densities,
        junctions=merged_junctions(parts, own),
        refinement=own.refinement,
        polishing=own.polishing,
        extremal=None if own.extremal is None else merged_extremal(parts, own.extremal),
    )


@dataclass(frozen=True, eq=False)
class _Written:
    """An extremal as a point of a program, and as an answer."""

    nlp: Nlp
    outcome: Outcome
    found: Residuals
    solution: Solution


def _written(
    problem: Problem,
    model: Model,
    options: Options,
    exact: Exact,
    direct: Solution,
    polishing: Polishing,
    seconds: float,
) -> _Written:
    started = time.perf_counter()
    system, degree = pontryagin(model), len(exact.offsets.points)
    fractions = (exact.nodes - exact.nodes[0]) / (exact.nodes[-1] - exact.nodes[0])
    method = Collocation(Mesh(fractions), degree)
    scale = options.objective_scale or wanted_scale(exact.cost)
    nlp = replace(transcribe(guided(model, direct), method, scale, None), notes=())
    values = exact.at(radau(degree).state.points)
    outcome = _outcome(system, nlp, exact, values, direct, seconds)
    found = residuals(nlp, outcome)
    outcome = judged(outcome, found, options.tolerance)
    record = {**direct.options, "polish": True}
    building = time.perf_counter() - started + direct.statistics.build_seconds
    solution = extract(problem, nlp, outcome, found, record, building)
    solution = replace(
        _as_known(solution, system, exact, values),
        refinement=direct.refinement,
        polishing=polishing,
        extremal=Extremal(exact.arcs, (), np.zeros(0), {}),
    )
    solution = replace(solution, extremal=certify(model, solution))
    return _Written(nlp, outcome, found, solution)


def _outcome(
    system: Pontryagin,
    nlp: Nlp,
    exact: Exact,
    values: Sampled,
    direct: Solution,
    seconds: float,
) -> Outcome:
    """Return the extremal as a point of the program with its multipliers."""
    statistics = direct.statistics
    instants = (system.model.initial_time, system.model.final_time)
    ends = zip(instants, exact.nodes[[0, -1]], strict=True)
    parts = (
        np.array([at for instant, at in ends if not instant.fixed]),
        exact.parameters,
        values.states[:, 0],
        values.states[-1, -1],
        values.states[:, 1:-1],
        values.controls[:, :-1],
    )
    w = np.concatenate([part.ravel() for part in parts]) / nlp.unit
    lam_g = row_multipliers(system, nlp, exact, values)
    return Outcome(
        Status.SOLVED,
        w,
        lam_g,
        bound_multipliers(system, nlp, exact, values, w, lam_g),
        statistics.iterations,
        dict(direct.history),
        0.0,
        statistics.solve_seconds + seconds,
        SAID,
        statistics.solver,
    )


def _as_known(solution: Solution, system: Pontryagin, exact: Exact, values: Sampled) -> Solution:
    """Return the answer with what its extremal knows better than a point of a program does.

    Times of nodes to the last digit, costates and multipliers on both sides of them, junctions.
    """
    t = np.append(values.t[:, :-1].ravel(), exact.nodes[-1])
    cells, degree = values.t.shape[0], values.t.shape[1] - 1

    def curve(parts: Array, jumps: bool) -> Polynomials:
        at = np.vstack([parts[:, :-1].reshape(cells * degree, parts.shape[2]), parts[-1:, -1]])
        return Polynomials(t, at, degree, parts[:, -1] if jumps else None)

    adjoint = curve(values.costates, True)
    return replace(
        solution,
        times=exact.nodes.copy(),
        trajectory=curve(values.states, False),
        adjoint=adjoint,
        costates=adjoint.states[::degree].copy(),
        junctions=junctions_of(system.model, exact, values),
        densities=Densities(
            tuple(row.label for row in system.rows),
            curve(values.mu, True),
            tuple(Impulse(one.node, one.row, one.size) for one in exact.atoms),
        ),
    )
