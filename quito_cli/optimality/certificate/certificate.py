"""An answer judged by Pontryagin's conditions, whatever made it.

Nothing of the nonlinear program's own residuals is used: states and costates are integrated anew
(`flow`), structure is read off û (`arcs`), the conditions (the table `CONDITIONS`) are
those of the Model. Of a polished answer structure and multipliers are known (`polished`), and no
residual is excused. It certifies an extremal, not that no other one is better.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np

from quito_cli.optimality.certificate.conditions import (
    costate_equation,
    hamiltonian,
    interior,
    legendre_clebsch,
    signs,
    state_equation,
)
from quito_cli.optimality.certificate.conditions_at_ends import feasibility, transversal
from quito_cli.optimality.certificate.conditions_of_minimum import least_hamiltonian
from quito_cli.optimality.certificate.conditions_of_multipliers import (
    other_multipliers,
    path_multipliers,
)
from quito_cli.optimality.certificate.conditions_of_switching import (
    generalised_clebsch,
    singular_arcs,
    switching,
)
from quito_cli.optimality.certificate.verdicts import not_applicable
from quito_cli.optimality.hamiltonian import Pontryagin, pontryagin
from quito_cli.optimality.looking.look import Look
from quito_cli.optimality.parts.apart import concave, faithful, merged_extremal, split_answer
from quito_cli.optimality.parts.parted import parted
from quito_cli.optimality.symbols.probes import TooLargeError
from quito_cli.problem.build import KEPT
from quito_cli.problem.model import Model
from quito_cli.problem.recent import recent
from quito_cli.solution.optimal import HAMILTONIAN, SWITCHING, Condition, Extremal

if TYPE_CHECKING:
    from quito_cli.solution.solution import Solution

Tests = tuple[Callable[[Look], Iterator[Condition]], ...]

CONDITIONS: Tests = (
    state_equation,
    costate_equation,
    interior,
    singular_arcs,
    signs,
    switching,
    hamiltonian,
    legendre_clebsch,
    generalised_clebsch,
    least_hamiltonian,
    transversal,
    path_multipliers,
    other_multipliers,
    feasibility,
)
"""In the order of the certificate; each gives its rows."""
ALL = "Pontryagin's conditions"
"""The one row where none can be looked at."""


def certify(model: Model, solution: Solution) -> Extremal:
    """Return arcs, certificate and curves of an answer to the problem of `model`.

    Controls with kinks are judged in parts. Where H is concave at a kink more is asked of parts
    than of controls: then what they do not meet is judged of the controls.
    """
    parts = parted(model) if solution.success else None
    if parts is None or not faithful(parts, solution):
        return _certified(model, solution)
    found = _certified(parts.model, split_answer(parts, solution))
    if any(row.verdict == "fails" for row in found.certificate) and concave(parts, solution):
        return _certified(model, solution)
    return merged_extremal(parts, found)


def _certified(model: Model, solution: Solution) -> Extremal:
    if not solution.success:
        return _nothing(f"the answer is none: {solution.status.value}")
    if not np.isfinite(solution.costates).all():
        return _nothing("there are no costates")
    system = _system(model)
    try:
        with np.errstate(all="ignore"):  # what is not finite fails, and says so
            look, tests = _looked(system, solution)
            arcs = look.arcs
            rows = tuple(chain.from_iterable(test(look) for test in tests))
    except TooLargeError:
        return _nothing("the Hamiltonian is too long to be worked on")
    if solution.polished:
        from quito_cli.optimality.looking.polished import sharply

        rows = tuple(map(sharply, rows))
    curves = {HAMILTONIAN: look.point.hamiltonian}
    for i, label in enumerate(look.names):
        curves[SWITCHING + label] = look.point.gradient[:, i]
    return Extremal(arcs, rows, look.flow.t, curves)


@recent(KEPT)
def _system(model: Model) -> Pontryagin:
    """Return Pontryagin's system of a Model, with what has been derived of it before."""
    return pontryagin(model)


def _looked(system: Pontryagin, solution: Solution) -> tuple[Look, Tests]:
    """Return an answer looked at, and what is asked of it."""
    if not solution.polished:
        return Look.at(system, solution), CONDITIONS
    from quito_cli.optimality.looking.polished import Polished, arcs_kept, row_multipliers

    # Its multipliers and arcs are known.
    tests = (row_multipliers if test is path_multipliers else test for test in CONDITIONS)
    return Polished.at(system, solution), (*tests, arcs_kept)


def _nothing(reason: str) -> Extremal:
    return Extremal((), (not_applicable(ALL, reason),), np.zeros(0), {})
