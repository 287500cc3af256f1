"""Solution -> what `--json` prints."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from quito_cli.summary.arcs import arcs_as_list, certificate_as_list
from quito_cli.summary.meshes import junctions_as_list, refinement_as_dictionary
from quito_cli.summary.polishing import polishing_as_dictionary

if TYPE_CHECKING:
    from quito_cli.solution.solution import Evidence, Solution


def as_dictionary(solution: Solution, result: Path | None, plot: Path | None) -> dict[str, Any]:
    """Return what `--json` prints; figures that are not finite become null."""
    answer: dict[str, Any] = {
        **_verdict(solution),
        **_solve(solution),
        **_residuals_and_gaps(solution.evidence),
        **_unknowns(solution),
        **_by_control(solution),
        "switching_times": list(solution.switching_times),
        "junctions": junctions_as_list(solution),
        "refinement": refinement_as_dictionary(solution.refinement),
        "polish": polishing_as_dictionary(solution.polishing),
        "arcs": arcs_as_list(solution),
        "certificate": certificate_as_list(solution),
        "warnings": list(solution.warnings),
        "diagnosis": list(solution.evidence.diagnosis),
        "set": dict(solution.origin.changes),
        "options": dict(solution.options),
        "hdf5": None if result is None else str(result),
        "plot": None if plot is None else str(plot),
    }
    return {key: finite(value) for key, value in answer.items()}


def _verdict(solution: Solution) -> dict[str, Any]:
    return {
        "problem": solution.origin.name,
        "status": solution.status.name.lower(),
        "message": solution.status.value,
        "success": solution.success,
        "cost": solution.cost,
        "reference_cost": solution.reference.cost if solution.reference else None,
    }


def _solve(solution: Solution) -> dict[str, Any]:
    statistics = solution.statistics
    return {
        "solver": statistics.solver,
        "solver_said": statistics.solver_said,
        "program": statistics.program,
        "iterations": statistics.iterations,
        "steps": solution.options["steps"],
        "build_seconds": statistics.build_seconds,
        "solve_seconds": statistics.solve_seconds,
    }


def _residuals_and_gaps(evidence: Evidence) -> dict[str, Any]:
    return {
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
    }


def _unknowns(solution: Solution) -> dict[str, Any]:
    names = [quantity.name for quantity in solution.origin.parameters]
    values = [float(value) for value in solution.parameters]
    return {
        "parameters": dict(zip(names, values, strict=True)),
        "initial_time": float(solution.times[0]),
        "final_time": float(solution.times[-1]),
    }


def _by_control(solution: Solution) -> dict[str, Any]:
    names = [quantity.name for quantity in solution.origin.controls]
    evidence = solution.evidence
    return {
        "total_variation": dict(zip(names, evidence.total_variation, strict=True)),
        "ringing": dict(zip(names, evidence.ringing, strict=True)),
    }


def finite(value: Any) -> Any:
    """Return a value for JSON, which knows no infinity: null in its place, and in that of NaN."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: finite(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [finite(entry) for entry in value]
    return value
