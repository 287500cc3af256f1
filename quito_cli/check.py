"""Looking at a problem without solving it: what is wrong, and what is likely not meant.

Errors are those of loading and building. Warnings come from the Model, evaluated with its first
derivatives at the guess: names that do nothing, bounds that cannot matter, values that are not
finite, sizes far apart, and a discretization too coarse for its control.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from quito_cli.options import Options
from quito_cli.problem.build import build
from quito_cli.problem.idle import idle
from quito_cli.problem.model import Constraint, Model, labels
from quito_cli.problem.options import COLLOCATION
from quito_cli.problem.schema import Problem
from quito_cli.problem.text.complaints import Complaint, Path
from quito_cli.solution.violations import Dense, beyond_tables
from quito_cli.solving.on_mesh import control_basis, control_warning
from quito_cli.transcription.guess import Guess, make_guess
from quito_cli.transcription.mesh import Mesh

if TYPE_CHECKING:
    import casadi as ca

Array = NDArray[np.float64]

FAR_APART = 1e6
"""Ratio of sizes that is worth a word."""
_POINTS = 50
"""Cells of the mesh that the guess is looked at on."""


def check(problem: Problem) -> tuple[Complaint, ...]:
    """Return the warnings about a problem, each with its place in the file.

    Raises:
        ProblemError: mistakes in the formulas, all of them told.
        UsageError: the file's options exclude each other.
    """
    model = build(problem)
    options = Options.resolve(problem.options, {})
    guess = make_guess(model, Mesh.uniform(_POINTS))
    return (
        *idle(problem, model),
        *_guess(model, guess),
        *_tables(model, guess),
        *_sizes(model, guess),
        *_discretization(model, options),
    )


def _guess(model: Model, guess: Guess) -> Iterator[Complaint]:
    """What had to be done to the guess, and what is not finite there, derivatives included."""
    for note in guess.notes:
        yield Complaint((note.section, note.variable, "guess"), note.message)
    for path, values, what in _evaluated(model, guess):
        bad = ~np.isfinite(values)
        if bad.any():
            node = int(np.argmax(bad.any(axis=0)))
            time = guess.times[0] + (guess.times[1] - guess.times[0]) * guess.fractions[node]
            at = _values_at(model, guess, node)
            message = f"{what} not finite at the guess, t = {time:.4g}: {at}; give a better guess"
            yield Complaint(path, message, key=True)


def _values_at(model: Model, guess: Guess, node: int) -> str:
    names = labels(model.states) + labels(model.controls) + labels(model.parameters)
    values = [*guess.states[node], *guess.controls[node], *guess.parameters]
    shown = [f"{name} = {value:.4g}" for name, value in zip(names, values, strict=True)]
    return ", ".join(shown[:8]) + (", ..." if len(shown) > 8 else "")


def _evaluated(model: Model, guess: Guess) -> Iterator[tuple[Path, Array, str]]:
    """Values and slopes by formula, (rows, nodes), with where the formula stands."""
    import casadi as ca

    along = [model.x, model.u, model.p, model.t]
    nodes, (start, end) = len(guess.fractions), guess.times
    t = (start + (end - start) * guess.fractions)[None, :]
    p = np.tile(guess.parameters[:, None], (1, nodes))
    at_nodes = [guess.states.T, guess.controls.T, p, t]
    ends = [model.ends.x0, model.ends.t0, model.ends.xf, model.ends.tf, model.p]
    at_ends = [guess.states[0], start, guess.states[-1], end, guess.parameters]
    for path, value, name in _formulas_along(model):
        yield from _with_slope(path, value, name, along, ca.vertcat(*along[:3]), at_nodes, nodes)
    for path, value, name in _formulas_at_ends(model):
        unknowns = ca.vertcat(ends[0], ends[2], model.p)
        yield from _with_slope(path, value, name, ends, unknowns, at_ends, 1)
    for constraint in model.constraints.point:
        node = int(np.argmin(np.abs(guess.fractions - (constraint.at or 0.0))))
        here = [values[:, [node]] for values in at_nodes]
        path = ("constraints", "point", constraint.name)
        unknowns = ca.vertcat(*along[:3])
        yield from _with_slope(path, constraint.value, constraint.name, along, unknowns, here, 1)


def _formulas_along(model: Model) -> Iterator[tuple[Path, ca.SX, str]]:
    for v in model.states:
        yield ("dynamics", v.name), model.xdot[v.entries], f"the derivative of {v.name}"
    yield ("cost", "lagrange"), model.lagrange, "the running cost"
    for kind in ("path", "integral"):
        given: tuple[Constraint, ...] = getattr(model.constraints, kind)
        for constraint in given:
            yield ("constraints", kind, constraint.name), constraint.value, constraint.name


def _formulas_at_ends(model: Model) -> Iterator[tuple[Path, ca.SX, str]]:
    yield ("cost", "mayer"), model.mayer, "the end cost"
    for constraint in model.constraints.boundary:
        yield ("constraints", "boundary", constraint.name), constraint.value, constraint.name


def _with_slope(
    path: Path,
    value: ca.SX,
    name: str,
    arguments: list[ca.SX],
    unknowns: ca.SX,
    numbers: list[Any],
    count: int,
) -> Iterator[tuple[Path, Array, str]]:
    """Values of a formula; and where they are finite, of its slope."""
    import casadi as ca

    for expression, what in (
        (value, f"{name} is"),
        (ca.jacobian(value, unknowns), f"{name} is finite, but its slope is"),
    ):
        function = ca.Function("f", arguments, [ca.vec(ca.densify(expression))])
        found = np.array(function.map(count)(*numbers))
        yield path, found, what
        if not np.isfinite(found).all():
            break


def _tables(model: Model, guess: Guess) -> Iterator[Complaint]:
    """Tables that end before the horizon does."""
    import casadi as ca

    unknowns = ca.vertcat(model.x, model.u, model.p)
    of_time = tuple(
        lookup for lookup in model.lookups if not ca.depends_on(lookup.argument, unknowns)
    )
    times = guess.times[0] + (guess.times[1] - guess.times[0]) * guess.fractions
    seen = Dense(times, guess.states, guess.controls, guess.parameters)
    for lookup in of_time:
        for message in beyond_tables(replace(model, lookups=(lookup,)), seen):
            yield Complaint(("tables", lookup.table), message, key=True)


def _sizes(model: Model, guess: Guess) -> Iterator[Complaint]:
    """States whose sizes are far apart, and costs of which one drowns the other."""
    sizes = np.abs(guess.states).max(axis=0)
    sizes = np.where(np.isnan(model.hints.state_scale), sizes, 1.0)  # what is scaled is settled
    names = np.array(labels(model.states))[sizes > 0]
    sizes = sizes[sizes > 0]
    if sizes.size and sizes.max() / sizes.min() > FAR_APART:
        large, small = names[sizes.argmax()], names[sizes.argmin()]
        yield Complaint(
            ("states",),
            f"{large} is of size {sizes.max():.1g}, {small} of size {sizes.min():.1g}: consider "
            "other units, or a `scale` for them",
            key=True,
        )
    running, end = _costs(model, guess)
    if min(running, end) > 0 and max(running, end) / min(running, end) > FAR_APART:
        message = f"at the guess the running cost is {running:.1g} and the end cost {end:.1g}"
        yield Complaint(("cost",), f"{message}: one drowns the other", key=True)


def _costs(model: Model, guess: Guess) -> tuple[float, float]:
    nodes, (start, end) = len(guess.fractions), guess.times
    t = start + (end - start) * guess.fractions
    p = np.tile(guess.parameters[:, None], (1, nodes))
    found = model.right_hand_side.map(nodes)(guess.states.T, guess.controls.T, p, t)
    running = abs(float(np.mean(np.array(found[1])[0])) * (end - start))
    ends = (guess.states[0], start, guess.states[-1], end, guess.parameters)
    last = abs(float(model.end_cost(*ends)))
    return (running, last) if np.isfinite([running, last]).all() else (0.0, 0.0)


def _discretization(model: Model, options: Options) -> Iterator[Complaint]:
    """Cells too few, or a variance too small, for the control of the file's options."""
    if options.discretization == COLLOCATION:
        return
    basis = control_basis(options, options.steps)
    if not basis.function.scaled or not model.n_u:
        return
    least = 8 * np.sqrt(basis.variance)
    if options.steps < least:
        yield Complaint(
            ("options", "steps"),
            f"{options.steps} cells are few for a variance of {basis.variance:g}: a jump alone is "
            f"about {least / 2:.0f} cells wide; take {least:.0f} or more",
        )
    doubt = control_warning(model, basis)
    if doubt:
        yield Complaint(("options", "variance"), doubt)
