"""What a certificate comes to: how many conditions hold, which fails by how much, what to do."""

from __future__ import annotations

import math
from collections.abc import Sequence

from quito_cli.solution.optimal import MINIMUM, UNRESOLVED, Condition

CAVEAT = "It certifies an extremal, not a global optimum."
"""What no certificate of necessary conditions says."""


def applying(certificate: Sequence[Condition]) -> list[Condition]:
    """Return the conditions that apply to the problem."""
    return [one for one in certificate if one.verdict != "not applicable"]


def failing(certificate: Sequence[Condition]) -> list[Condition]:
    """Return the conditions that fail, the one furthest from holding first."""
    failed = [one for one in certificate if one.verdict == "fails"]
    return sorted(failed, key=lambda one: -_excess(one))


def _excess(condition: Condition) -> float:
    """Return the residual over its scale; what cannot be told is the worst."""
    if not condition.scale > 0 or math.isnan(condition.residual):
        return math.inf
    return condition.residual / condition.scale


def verdict(certificate: Sequence[Condition]) -> str:
    """Return the whole certificate in a line."""
    count = len(applying(certificate))
    if not count:
        return f"no condition applies{f': {certificate[0].reason}' if certificate else ''}"
    failed = failing(certificate)
    if failed:
        others = f"; {len(failed)} of {count} conditions fail" if len(failed) > 1 else ""
        return f"FAILS: {told(failed[0])}{others}"
    if blind(certificate):
        return (
            "nothing is known of the control: its arcs are too short to be judged on these cells; "
            "take more cells, or --mesh adaptive"
        )
    rough = sum(one.verdict == "holds to discretization accuracy" for one in certificate)
    whole = "the one condition holds" if count == 1 else f"all {count} conditions hold"
    if not rough:
        return whole
    return f"{whole} ({f'{rough} ' if rough < count else ''}to discretization accuracy)"


def blind(certificate: Sequence[Condition]) -> bool:
    """Whether no condition on a control could be judged, for want of cells."""
    rows = [one for one in certificate if "dH/du" in one.condition]
    unresolved = any(UNRESOLVED in one.reason for one in rows)
    return unresolved and all(one.verdict == "not applicable" for one in rows)


def told(condition: Condition) -> str:
    """Return a condition with the amount by which it is missed, and where."""
    text, where = condition.condition, f" at t = {condition.time:.5g}"
    if math.isfinite(excess := _excess(condition)):
        text += f", by {excess:.0e} of its scale"
    elif math.isfinite(condition.residual):
        text += f", by {condition.residual:.0e}"
    return text + ("" if math.isnan(condition.time) else where)


def doubts(certificate: Sequence[Condition]) -> tuple[str, ...]:
    """Return warnings where conditions fail, as sentences that say what to do."""
    failed = failing(certificate)
    lesser = tuple(
        f"The answer stays in a lesser well of the Hamiltonian: {one.reason}. Start again with "
        "that control as `guess`"
        for one in failed
        if one.condition == MINIMUM
    )
    if len(failed) == len(lesser):
        return lesser
    others = f" ({len(failed)} conditions fail in all)" if len(failed) > 1 else ""
    first = next(one for one in failed if one.condition != MINIMUM)
    return (
        f"Pontryagin's conditions do not all hold{others}: {told(first)}. Solve again with "
        "more cells or --mesh adaptive; what fails then too is no matter of accuracy, and this "
        "answer no optimum: try another guess",
        *lesser,
    )
