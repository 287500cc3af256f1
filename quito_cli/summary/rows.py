"""Solution -> the summary: rows of a label and what is said; no label continues the row above."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from quito_cli.options import Options
from quito_cli.problem.options import COLLOCATION
from quito_cli.summary.arcs import arc_rows, pontryagin_rows
from quito_cli.summary.meshes import junction_rows, mesh_rows
from quito_cli.summary.polishing import polish_rows

if TYPE_CHECKING:
    from quito_cli.solution.solution import Solution, Statistics


def summary_rows(solution: Solution, *, verbose: bool) -> list[tuple[str, str]]:
    """Return cost, method and evidence; with `verbose` also what the certificate does not say."""
    return [
        *_solve_rows(solution),
        *_evidence_rows(solution),
        *junction_rows(solution),
        *arc_rows(solution),
        *mesh_rows(solution),
        *polish_rows(solution),
        *pontryagin_rows(solution, verbose=verbose),
    ]


def _solve_rows(solution: Solution) -> list[tuple[str, str]]:
    """Return what was found, and how; what the problem left free, and what was set beside it."""
    statistics = solution.statistics
    iterations = "unknown" if statistics.iterations is None else str(statistics.iterations)
    times = (
        f"{iterations}, built in {_seconds(statistics.build_seconds)}, "
        f"solved in {_seconds(statistics.solve_seconds)}"
    )
    rows = [
        ("cost", _cost(solution)),
        ("iterations", times),
        ("method", _method(solution.options) + (", polished" if solution.polished else "")),
    ]
    if statistics.program == "QP" or statistics.solver != Options.solver:
        rows.append(("program", _program(statistics)))
    if solution.origin.free_times:
        rows.append(("horizon", f"{solution.times[0]:.9g} to {solution.times[-1]:.9g}"))
    if solution.origin.parameters:
        found = zip(solution.origin.parameters, solution.parameters, strict=True)
        rows.append(("parameters", ", ".join(f"{q.name} = {value:.9g}" for q, value in found)))
    if solution.origin.changes:
        changes = (f"{name} = {value}" for name, value in solution.origin.changes)
        rows.append(("set", ", ".join(changes)))
    return rows


def _evidence_rows(solution: Solution) -> list[tuple[str, str]]:
    evidence = solution.evidence
    largest = max(evidence.stationarity, evidence.feasibility, evidence.complementarity)
    judged = f"judged at {10 * evidence.tolerance:.0e}"
    again = (
        f"cost {evidence.resimulated_cost:.9g}, states within {evidence.resimulation_gap:.1e} "
        "of their size"
    )
    rows = [
        ("residuals", f"{largest:.1e} first-order and feasibility, {judged}"),
        ("re-simulated", again),
    ]
    if any(violation.constraint.startswith("final(") for violation in evidence.violations):
        rows.append(("", f"final conditions within {evidence.terminal_gap:.1e}"))
    rows.append(("violation", _violation(solution)))
    names = [quantity.name for quantity in solution.origin.controls]
    for label, values in (
        ("total variation", evidence.total_variation),
        ("ringing index", evidence.ringing),
    ):
        pairs = [f"{name} {value:.3g}" for name, value in zip(names, values, strict=True)]
        if pairs:
            rows.append((label, ", ".join(pairs)))
    return rows


def _cost(solution: Solution) -> str:
    sense = " (maximised)" if solution.origin.maximize else ""
    text = f"{solution.cost:.10g}{sense}"
    reference = solution.reference
    if reference is None or reference.cost is None:
        return text
    difference = solution.cost - reference.cost
    return f"{text}, reference {reference.cost:.10g}, difference {difference:+.1e}"


def _method(options: Any) -> str:
    if options["discretization"] == COLLOCATION:
        points = "point" if options["degree"] == 1 else "points"
        return (
            f"collocation at {options['degree']} Legendre-Gauss-Radau {points} in each of "
            f"{options['steps']} cells, polynomial control"
        )
    text = f"{options['steps']} cells of {options['substeps']} {options['discretization']} steps, "
    if options["control"] != "quasi-interpolant":
        return f"{text}{options['control']} control"
    plain = "" if options["normalised"] else ", as printed"
    return f"{text}{options['generating_function']}, variance {options['variance']:g}{plain}"


def _program(statistics: Statistics) -> str:
    kind = "a quadratic program" if statistics.program == "QP" else "a nonlinear program"
    return f"{kind}, by {statistics.solver}"


def _violation(solution: Solution) -> str:
    worst = [v for v in solution.evidence.violations if v.amount > 0]
    if not worst:
        return "none, between the nodes too"
    return f"at most {worst[0].amount:.1e}: {worst[0].constraint} at t = {worst[0].time:.5g}"


def option_rows(solution: Solution) -> list[tuple[str, str]]:
    """Return the options that it was solved with, the size of the program, and the solver."""
    statistics = solution.statistics
    return [
        *(
            (name.replace("_", "-"), "yes" if value is True else str(value))
            for name, value in solution.options.items()
            if value is not None and value != {}
        ),
        ("size", f"{statistics.unknowns} unknowns, {statistics.constraints} constraints"),
        ("solver", f"{statistics.solver}: {statistics.solver_said}"),
    ]


def _seconds(seconds: float) -> str:
    return f"{seconds:.2g} s" if seconds < 10 else f"{seconds:.0f} s"
