"""Answers, and what is said of them, between controls and their parts (`parts`).

Coefficients are split and merged one by one: the functions of a control add up to one, so that
b_1 − Σ v̂_0 + … is û again, and parts of one sign stay so where the functions are positive.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.hamiltonian import pontryagin
from quito_cli.optimality.parts.parts import Cut, Parts
from quito_cli.problem.model import labels
from quito_cli.solution.junctions import Junction, junctions, width
from quito_cli.solution.optimal import Arc, Extremal, Kind
from quito_cli.solution.solution import Quantity, Solution
from quito_cli.solution.structure import by_quantity
from quito_cli.solution.variation import largest_bounds
from quito_cli.solvers.outcome import Outcome
from quito_cli.solvers.residuals import Residuals
from quito_cli.transcription.cells import PathPoints
from quito_cli.transcription.transcribe import Nlp, transcribe

Array = NDArray[np.float64]

MIXED = 0.01
"""Part of a control's size by which parts may be out of order."""
EXACT = 1e-9
"""The same of an exact answer."""
BOUNDS = "control bounds"
"""Rows that are of parts, and of no use to the whole."""


def split_answer(parts: Parts, answer: Solution) -> Solution:
    """Return an answer as one of the parts' Model, to be looked at."""
    model = parts.model
    coefficients = parts.split(answer.coefficients)
    quantities = zip(labels(model.controls), _units(parts), *model.control_bounds, strict=True)
    kept = [name for name in answer.multipliers if name != BOUNDS]
    times = float(answer.times[0]), float(answer.times[-1])
    found = junctions(
        answer.basis, answer.mesh, coefficients, times, largest_bounds(*model.control_bounds)
    )
    return replace(
        answer,
        origin=replace(answer.origin, controls=tuple(Quantity(*row) for row in quantities)),
        coefficients=coefficients,
        multipliers={name: answer.multipliers[name] for name in kept},
        multiplier_axes={name: answer.multiplier_axes[name] for name in kept},
        junctions=found,
        reference=None,
        drawings=(),
        extremal=_split_extremal(parts, answer) if answer.polished else None,
    )


def _split_extremal(parts: Parts, answer: Solution) -> Extremal:
    """Return the arcs of a polished answer as those of its parts, by what û is in their middle."""
    names = labels(parts.whole.controls)
    own = by_quantity(answer.arcs, names)[0]
    found: list[Arc] = []
    for i, cut in enumerate(parts.cuts):
        for j, label in enumerate(cut.labels):
            found += [
                replace(arc, of=label, kind=_kind_of_part(cut, j, arc, answer, i))
                for arc in own.get(cut.label, [])
            ]
    rows = [arc for arc in answer.arcs if arc.of not in own]
    return Extremal((*found, *rows), (), np.zeros(0), {})


def _kind_of_part(cut: Cut, j: int, arc: Arc, answer: Solution, i: int) -> Kind:
    """Return what part j of control i is on an arc: full, empty, or what the control is."""
    if not cut.sites:
        return arc.kind
    v = cut.split(answer.control([(arc.start + arc.end) / 2])[:, i])[0]
    size, (lower, upper) = 1 + float(np.abs(v).max()), cut.bounds
    if v[j] <= lower[j] + EXACT * size:
        return "lower"
    return "upper" if v[j] >= upper[j] - EXACT * size else arc.kind


def faithful(parts: Parts, answer: Solution) -> bool:
    """Whether the formulas of the parts have the values of those of the controls along an answer.

    Whether branches agree at a kink was seen at random points alone.
    """
    t = answer.dense_times
    x, u, p = answer.state(t), answer.control(t), np.tile(answer.parameters[:, None], (1, len(t)))
    found = []
    for model, given in ((parts.whole, u), (parts.model, parts.split(u))):
        own = [model.right_hand_side, *(model.function(c) for c in model.constraints.path)]
        found.append([np.array(v) for f in own for v in f.map(len(t)).call([x.T, given.T, p, t])])
    with np.errstate(invalid="ignore"):
        return all(
            bool((np.abs(a - b) <= EXACT * (1 + np.abs(a).max(initial=0.0))).all())
            for a, b in zip(*found, strict=True)
        )


def concave(parts: Parts, answer: Solution) -> bool:
    """Whether H bends downwards at a kink of a control, somewhere along an answer."""
    t, p = answer.times, answer.parameters
    x, costate, u = answer.state(t), answer.costate(t), parts.split(answer.control(t))
    system = pontryagin(parts.model)
    for cut, at in zip(parts.cuts, parts.places, strict=True):
        for k in range(1, cut.count):
            v = u.copy()
            v[:, at] = cut.split(np.full(len(t), cut.sites[k - 1]))
            slopes = system.along(t, x, costate, v, p).gradient[:, at]
            below = -slopes[:, 0] if k == 1 else slopes[:, k - 1]
            bend, size = slopes[:, k] - below, np.abs(slopes).max()
            if (bend < -MIXED * size).any():
                return True
    return False


def _units(parts: Parts) -> list[str]:
    return [cut.unit for cut in parts.cuts for _ in cut.labels]


def in_order(parts: Parts, nlp: Nlp, outcome: Outcome) -> bool:
    """Whether parts are filled in order, but for as long as a jump takes."""
    made = nlp.transcription
    table = made.layout.coefficient_table(outcome.w * nlp.unit)
    mixed = (parts.disorder(table) > MIXED).any(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mixed.astype(int), [0]])))
    longest = int(np.diff(edges.reshape(-1, 2), axis=1).max(initial=0))
    return longest <= 2 * width(made.method.basis)


def mixed(parts: Parts, own: Solution, whole: Solution) -> str:
    """Say why an exact answer in parts is none of the controls; empty where it is.

    Args:
        parts: the parts.
        own: the answer in parts.
        whole: the same of the controls.
    """
    disorder = parts.disorder(own.coefficients)
    worst, i = np.unravel_index(int(np.argmax(disorder)), disorder.shape)
    if disorder[worst, i] > EXACT:
        return f"{parts.cuts[i].label} would have to be on both sides of a kink at once"
    if not faithful(parts, whole):
        return "a formula jumps where a control is at a kink"
    return ""


def merged_point(
    parts: Parts, nlp: Nlp, outcome: Outcome, found: Residuals, path_points: PathPoints | None
) -> tuple[Nlp, Outcome, Residuals]:
    """Return a point of the parts' program as one of the whole's.

    Residuals are those of the parts' program, which was solved: that of the whole has kinks, at
    which it has no gradient.
    """
    made = nlp.transcription
    whole = transcribe(parts.whole, made.method, nlp.objective_scale, path_points)
    first = made.layout.first_coefficient
    w = outcome.w * nlp.unit
    table = parts.merged(made.layout.coefficient_table(w))
    lam_w = outcome.lam_w / nlp.unit
    at_bounds = _of_bounds(parts, lam_w[first:].reshape(len(table), -1))
    lam_w = np.concatenate([lam_w[:first], at_bounds.ravel()]) * whole.unit
    point = replace(
        outcome,
        w=np.concatenate([w[:first], table.ravel()]) / whole.unit,
        lam_g=_rows(nlp, whole, outcome.lam_g * nlp.row_scale) / whole.row_scale,
        lam_w=lam_w,
    )
    violations = _rows(nlp, whole, found.violations / nlp.row_scale) * whole.row_scale
    return whole, point, replace(found, violations=violations)


def _rows(nlp: Nlp, whole: Nlp, values: Array) -> Array:
    """Return values by row of the whole's program; zero of the bounds of its controls."""
    given = {block.name: values[block.rows] for block in nlp.blocks if block.name != BOUNDS}
    found = np.zeros(len(whole.row_lower))
    for block in whole.blocks:
        if block.name in given:
            found[block.rows] = given[block.name]
    return found


def _of_bounds(parts: Parts, multipliers: Array) -> Array:
    """Return the multipliers of bounds of controls: those of the ends of their parts."""
    columns = []
    for cut, at in zip(parts.cuts, parts.places, strict=True):
        own = multipliers[:, at]
        pressed = np.maximum(own[:, -1], 0.0) - np.maximum(own[:, 0], 0.0)
        columns.append(pressed if cut.sites else own[:, 0])
    return np.column_stack(columns)


def merged_junctions(parts: Parts, answer: Solution) -> tuple[Junction, ...]:
    """Return where controls jump or have kinks, of a polished answer in parts: at nodes."""
    found = []
    for i, at in enumerate(parts.places):
        own = {j.time: j for j in answer.junctions if at.start <= j.control < at.stop}
        for time, junction in own.items():
            cell = np.array([int(np.argmin(np.abs(answer.times - time)))])
            sides = (cell - 1, np.ones(1)), (cell, np.zeros(1))
            before, after = (
                float(parts.merged(answer.basis.evaluate(answer.coefficients, *side))[0, i])
                for side in sides
            )
            found.append(replace(junction, control=i, before=before, after=after))
    return tuple(sorted(found, key=lambda one: one.time))


def merged_extremal(parts: Parts, found: Extremal) -> Extremal:
    """Return what is said of an answer's parts with the arcs of its controls."""
    return replace(found, arcs=tuple(_merged_arcs(parts, found.arcs)))


def _merged_arcs(parts: Parts, arcs: Sequence[Arc]) -> Iterator[Arc]:
    names = labels(parts.model.controls)
    own = by_quantity(arcs, names)[0]
    for cut in parts.cuts:
        lists = [own.get(label, []) for label in cut.labels]
        if all(lists):
            yield from _of_cut(cut, lists) if cut.sites else lists[0]
    yield from (arc for arc in arcs if arc.of not in names)


def _of_cut(cut: Cut, lists: list[list[Arc]]) -> Iterator[Arc]:
    """Give the arcs of a control from those of its parts."""
    start, end = lists[0][0].start, lists[0][-1].end
    edges = [(start, 0.0), *_edges(lists), (end, 0.0)]
    runs: list[tuple[tuple[Kind, int], tuple[float, float], tuple[float, float]]] = []
    for a, b in pairwise(edges):
        own = _kind([_at(arcs, (a[0] + b[0]) / 2) for arcs in lists])
        if runs and runs[-1][0] == own:
            runs[-1] = own, runs[-1][1], b
        else:
            runs.append((own, a, b))
    for (kind, _), a, b in runs:
        yield Arc(cut.label, kind, a[0], b[0], a[1], b[1])


def _edges(lists: list[list[Arc]]) -> list[tuple[float, float]]:
    """Return when parts change and how uncertain that is; what may be at once, is."""
    found: list[tuple[float, float]] = []
    ends = ((arc.end, arc.end_uncertainty) for arcs in lists for arc in arcs[:-1])
    for time, doubt in sorted(ends):
        if found and time - found[-1][0] <= doubt + found[-1][1]:
            last = found.pop()
            found.append(((time + last[0]) / 2, max(doubt, last[1])))
        else:
            found.append((time, doubt))
    return found


def _at(arcs: list[Arc], time: float) -> Kind:
    return next((arc.kind for arc in arcs if time < arc.end), arcs[-1].kind)


def _kind(kinds: list[Kind]) -> tuple[Kind, int]:
    """Return what a control is, of what its parts are, and at or in which of them."""
    if kinds[0] != "lower":
        return ("lower" if kinds[0] == "upper" else kinds[0]), 0
    j = max((j for j, kind in enumerate(kinds) if j and kind != "lower"), default=0)
    if j == 0:
        return "kink", 1
    if kinds[j] != "upper":
        return kinds[j], j
    return ("upper", j) if j == len(kinds) - 1 else ("kink", j + 1)
