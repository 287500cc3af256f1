"""Junctions, meshes and the account of the control's error, for people and for programs."""

from __future__ import annotations

import math
from dataclasses import asdict
from textwrap import wrap
from typing import TYPE_CHECKING, Any

from quito_cli.summary.times import instant

if TYPE_CHECKING:
    from quito_cli.solution.junctions import Junction
    from quito_cli.solution.rounds import Account, Refinement, Round
    from quito_cli.solution.solution import Solution

_MOST_JUNCTIONS = 8
"""Lines of a summary; all of them are in the result."""

_HEADS = (
    *("mesh", "cells", "substeps", "shortest", "cost", "re-simulated"),
    *("gap", "violation", "change", "blur", "iterations", "seconds"),
)
"""Of the table of rounds."""
_MOST_LEFT_OUT = 0.5
"""Part of the horizon around jumps: what is known of the rest is no figure for the control."""
_WIDTH = 90
"""Of a sentence in the summary."""


def junction_rows(solution: Solution, most: int = _MOST_JUNCTIONS) -> list[tuple[str, str]]:
    """Return a line for each jump and kink."""
    found = solution.junctions
    shown = [said_of(solution, junction) for junction in found[:most]]
    if len(found) > most:
        shown.append(f"and {len(found) - most} more")
    return _under("switching times", shown)


def _under(label: str, lines: list[str]) -> list[tuple[str, str]]:
    return [(label if i == 0 else "", line) for i, line in enumerate(lines)]


def said_of(solution: Solution, junction: Junction) -> str:
    """Return when a jump or kink is, and of what from where to where."""
    return f"{instant(junction.time, junction.uncertainty)}  {change_of(solution, junction)}"


def change_of(solution: Solution, junction: Junction) -> str:
    """Return of what a jump or kink is, from where to where."""
    name = solution.origin.controls[junction.control].name
    size = max(abs(junction.before), abs(junction.after))
    before, after = _rounded(junction.before, size), _rounded(junction.after, size)
    what = f"jumps {before} → {after}" if junction.kind == "jump" else f"bends at {before}"
    return f"{name} {what}"


def _rounded(value: float, size: float) -> str:
    """Return a value in three digits, 0 where it is less than that beside `size`."""
    return "0" if abs(value) <= size / 1000 else f"{value:.3g}"


def mesh_rows(solution: Solution) -> list[tuple[str, str]]:
    """Return how an adaptive mesh was found, and how far its control may be from the truth.

    What is said of the control is not said of a polished one.
    """
    if solution.options.get("mesh") != "adaptive":
        return []
    how = solution.refinement
    if how is None:
        return [("mesh", "not refined: the solve on the first mesh did not end well")]
    rows = _under("mesh", [_meshes(how), *wrap(how.outcome, _WIDTH)])
    return rows if solution.polished else rows + _error(solution, how.account)


def _meshes(how: Refinement) -> str:
    cells = [one.cells for one in how.rounds]
    count = "1 mesh" if len(cells) == 1 else f"{len(cells)} meshes"
    sizes = f"{min(cells)} to {max(cells)}" if min(cells) < max(cells) else f"{cells[0]}"
    kept = f", number {how.kept + 1} kept" if how.kept + 1 < len(cells) else ""
    shortest = how.rounds[how.kept].shortest
    return f"adaptive: {count}{kept}, {sizes} cells, shortest {shortest:.1e} of the horizon"


def _error(solution: Solution, account: Account | None) -> list[tuple[str, str]]:
    controls = solution.origin.controls
    if not controls:
        return []
    label = f"error of {controls[0].name}" if len(controls) == 1 else "error of controls"
    if account is None:
        return [(label, "not estimated: refinement did not get so far")]
    horizon = float(solution.times[-1] - solution.times[0])
    whose = "its range" if len(controls) == 1 else "their range"
    where, part = "at all times", account.time_left_out / horizon
    if part > _MOST_LEFT_OUT:
        said = f"not known: what jumps blur is {part:.0%} of the horizon; start from more cells"
        return [(label, said.replace("%", " %"))]
    if account.left_out:
        where = f"outside jumps ({100 * part:.2g} % of the horizon)"
    beside = {
        "saturation": account.saturation,
        "approximation": account.approximation,
        "integration": account.integration,
        "states": account.states,
    }
    known = [f"{name} {value:.0e}" for name, value in beside.items() if math.isfinite(value)]
    lines = [
        f"about {account.control:.0e} of {whose} {where}",
        f"an estimate: other mesh {account.meshes:.0e}, twice the substeps {account.substeps:.0e}, "
        f"at bounds {account.bounds:.0e}",
        f"beside it: {', '.join(known)}",
    ]
    if account.left_out:
        lines.append(f"the jumps themselves: {account.jumps:.0e} in L²")
    return _under(label, lines)


def round_rows(how: Refinement) -> list[tuple[str, ...]]:
    """Return a head, and a row for each mesh."""
    return [_HEADS, *(_round(i, one, i == how.kept) for i, one in enumerate(how.rounds))]


def _round(i: int, one: Round, kept: bool) -> tuple[str, ...]:
    return (
        f"{i + 1}{' *' if kept else ''}",
        str(one.cells),
        str(one.substeps),
        f"{one.shortest:.1e}",
        f"{one.cost:.10g}",
        f"{one.resimulated_cost:.10g}",
        *(_small(value) for value in (one.gap, one.violation, one.change, one.blur)),
        "unknown" if one.iterations < 0 else str(one.iterations),
        f"{one.seconds:.2g}",
    )


def _small(value: float) -> str:
    return f"{value:.1e}" if math.isfinite(value) else "-"


def junctions_as_list(solution: Solution) -> list[dict[str, Any]]:
    """Return every jump and kink, the control by its name."""
    names = [quantity.name for quantity in solution.origin.controls]
    return [asdict(one) | {"control": names[one.control]} for one in solution.junctions]


def refinement_as_dictionary(how: Refinement | None) -> dict[str, Any] | None:
    """Return the rounds without their nodes, and the account; None of a uniform mesh."""
    if how is None:
        return None
    account = how.account
    return {
        "rounds": [_round_as_dictionary(one) for one in how.rounds],
        "kept": how.kept,
        "outcome": how.outcome,
        "account": None
        if account is None
        else asdict(account)
        | {
            "control": account.control,
            "left_out": [list(zone) for zone in account.left_out],
            "time_left_out": account.time_left_out,
        },
    }


def _round_as_dictionary(one: Round) -> dict[str, Any]:
    numbers = {name: value for name, value in asdict(one).items() if name != "nodes"}
    return {"cells": one.cells, "shortest": one.shortest} | numbers
