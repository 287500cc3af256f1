"""A Solution for people and for programs: the summary, and the JSON object."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from quito_cli.cli.certificate import arc_rows, arcs_as_list, certificate_as_list, pontryagin_rows
from quito_cli.cli.meshes import (
    junction_rows,
    junctions_as_list,
    mesh_rows,
    refinement_as_dictionary,
    rounds_table,
)
from quito_cli.cli.polishing import account, polish_rows, polishing_as_dictionary
from quito_cli.cli.text import columns, labelled, plain
from quito_cli.problem.options import COLLOCATION
from quito_cli.solve import Options

if TYPE_CHECKING:
    from quito_cli.solution.solution import Solution, Statistics

_MOST_VIOLATIONS = 12


def as_dictionary(solution: Solution, result: Path | None, plot: Path | None) -> dict[str, Any]:
    """Return what `--json` prints; figures that are not finite become null."""
    evidence, statistics = solution.evidence, solution.statistics
    names = [quantity.name for quantity in solution.origin.controls]
    answer: dict[str, Any] = {
        "problem": solution.origin.name,
        "status": solution.status.name.lower(),
        "message": solution.status.value,
        "success": solution.success,
        "cost": solution.cost,
        "reference_cost": solution.reference.cost if solution.reference else None,
        "solver": statistics.solver,
        "solver_said": statistics.solver_said,
        "program": statistics.program,
        "iterations": statistics.iterations,
        "steps": solution.options["steps"],
        "build_seconds": statistics.build_seconds,
        "solve_seconds": statistics.solve_seconds,
        "stationarity": evidence.stationarity,
        "feasibility": evidence.feasibility,
        "complementarity": evidence.complementarity,
        "maximum_violation": evidence.maximum_violation,
        "violations": [
            {"constraint": v.constraint, "time": v.time, "amount": v.amount}
            for v in evidence.violations
            if v.amount > 0
        ],
        "resimulated_cost": evidence.resimulated_cost,
        "resimulation_gap": evidence.resimulation_gap,
        "terminal_gap": evidence.terminal_gap,
        "parameters": dict(
            zip(
                [quantity.name for quantity in solution.origin.parameters],
                [float(value) for value in solution.parameters],
                strict=True,
            )
        ),
        "initial_time": float(solution.times[0]),
        "final_time": float(solution.times[-1]),
        "total_variation": dict(zip(names, evidence.total_variation, strict=True)),
        "ringing": dict(zip(names, evidence.ringing, strict=True)),
        "switching_times": list(solution.switching_times),
        "junctions": junctions_as_list(solution),
        "refinement": refinement_as_dictionary(solution.refinement),
        "polish": polishing_as_dictionary(solution.polishing),
        "arcs": arcs_as_list(solution),
        "certificate": certificate_as_list(solution),
        "warnings": list(solution.warnings),
        "diagnosis": list(evidence.diagnosis),
        "set": dict(solution.origin.changes),
        "options": dict(solution.options),
        "hdf5": None if result is None else str(result),
        "plot": None if plot is None else str(plot),
    }
    return {key: finite(value) for key, value in answer.items()}


def finite(value: Any) -> Any:
    """Return a value for JSON, which knows no infinity: null in its place, and in that of NaN."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: finite(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [finite(entry) for entry in value]
    return value


def print_solution(
    solution: Solution,
    *,
    verbose: bool,
    files: tuple[Path | None, ...] = (),
    explain: bool = False,
) -> None:
    """Print the summary with its evidence; with `explain` the account of its polish, too."""
    good = solution.success
    word = typer.style(
        "Solved." if good else "Not solved.", bold=True, fg="green" if good else "red"
    )
    paragraphs = [
        typer.style(plain(solution.origin.title or solution.origin.name), bold=True)
        + f"\n{word} {solution.status.value}"
        + "".join(f"\n  {plain(sentence)}" for sentence in solution.evidence.diagnosis),
        labelled([*_figures(solution), *pontryagin_rows(solution, verbose=verbose)]),
    ]
    if explain and solution.polishing is not None:
        paragraphs.append(account(solution.polishing))
    if verbose:
        if solution.refinement is not None:
            paragraphs.append(rounds_table(solution.refinement))
        paragraphs += [_all_violations(solution), labelled(_options(solution))]
    if solution.warnings:
        mark = typer.style("Warning:", bold=True, fg="yellow")
        paragraphs.append("\n".join(f"{mark} {plain(text)}" for text in solution.warnings))
    written = [str(path) for path in files if path is not None]
    if written:
        paragraphs.append(f"Saved {' and '.join(written)}")
    typer.echo("\n\n".join(paragraphs))


def _figures(solution: Solution) -> list[tuple[str, str]]:
    evidence, statistics = solution.evidence, solution.statistics
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
    largest = max(evidence.stationarity, evidence.feasibility, evidence.complementarity)
    judged = f"judged at {10 * evidence.tolerance:.0e}"
    again = (
        f"cost {evidence.resimulated_cost:.9g}, states within {evidence.resimulation_gap:.1e} "
        "of their size"
    )
    rows += [
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
        if not names:
            continue
        pairs = zip(names, values, strict=True)
        rows.append((label, ", ".join(f"{name} {value:.3g}" for name, value in pairs)))
    rows += [*junction_rows(solution), *arc_rows(solution), *mesh_rows(solution)]
    return [*rows, *polish_rows(solution)]


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


def _all_violations(solution: Solution) -> str:
    rows = [("condition", "worst at t", "violated by")]
    found = solution.evidence.violations
    for violation in found[:_MOST_VIOLATIONS]:
        amount = f"{violation.amount:.2e}" if violation.amount > 0 else "holds"
        rows.append((violation.constraint, f"{violation.time:.6g}", amount))
    if len(found) > _MOST_VIOLATIONS:
        rows.append((f"and {len(found) - _MOST_VIOLATIONS} less violated", "", ""))
    return columns(rows, header=True)


def _options(solution: Solution) -> list[tuple[str, str]]:
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
