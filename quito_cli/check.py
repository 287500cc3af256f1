"""Looking at a problem without solving it: what is wrong, and what is likely not meant.

Errors are those of loading and building. Warnings come from the Model, evaluated with its first
derivatives at the guess: names that do nothing, bounds that cannot matter, values that are not
finite, sizes far apart, and a discretization too coarse for its control.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from quito_cli.problem.build import build
from quito_cli.problem.language.expressions import ExpressionError, parse, parse_comparison
from quito_cli.problem.model import Constraint, Model, labels
from quito_cli.problem.schema import Problem
from quito_cli.problem.text.complaints import Complaint, Path
from quito_cli.solve import Options, control_basis, control_warning
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
        *_unused_names(problem),
        *_idle_variables(model),
        *_out_of_reach(model),
        *_guess(model, guess),
        *_sizes(model, guess),
        *_discretization(model, options),
    )


def _formulas(problem: Problem) -> Iterator[tuple[str, Any]]:
    """Every text of the problem that may be a formula, with the name it defines, or ''."""
    data = problem.model_dump(exclude_unset=True)
    own = ("constants", "expressions")
    for section, content in data.items():
        if section in ("title", "source", "description", "reference", "published", "options"):
            continue
        for name, value in content.items() if isinstance(content, dict) else ():
            for text in _texts(value):
                yield (name if section in own else ""), text


def _texts(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        for inner in value.values():
            yield from _texts(inner)
    elif isinstance(value, list):
        for inner in value:
            yield from _texts(inner)


def _names_in(text: str) -> set[str]:
    try:
        sides = [parse(text)]
    except ExpressionError:
        try:
            sides = list(parse_comparison(text).sides)
        except ExpressionError:
            return set()
    return {name for side in sides for name in (*side.names, *side.tables)}


def _unused_names(problem: Problem) -> Iterator[Complaint]:
    used: set[str] = set()
    for own, text in _formulas(problem):
        used |= _names_in(text) - {own}
    for section in ("constants", "tables", "expressions"):
        for name in getattr(problem, section):
            if name not in used and not _in_reference(problem, name):
                kind = section.removesuffix("s")
                yield _warning((section, name), f"the {kind} '{name}' is used nowhere")


def _in_reference(problem: Problem, name: str) -> bool:
    if problem.reference is None:
        return False
    texts = _texts(problem.reference.model_dump(exclude_unset=True))
    return any(name in _names_in(text) for text in texts)


def _warning(path: Path, message: str) -> Complaint:
    return Complaint(path, message, length=len(str(path[-1])), key=True)


def _everything(model: Model) -> ca.SX:
    """Everything that depends on x, u, p along the horizon, stacked."""
    import casadi as ca

    given = model.constraints
    values = [c.value for group in (given.path, given.integral, given.point) for c in group]
    return ca.vertcat(model.xdot, model.lagrange, *values)


def _at_ends(model: Model) -> ca.SX:
    import casadi as ca

    return ca.vertcat(model.mayer, *(c.value for c in model.constraints.boundary))


def _idle_variables(model: Model) -> Iterator[Complaint]:
    """Controls and parameters that enter nowhere; states that nothing asks for."""
    import casadi as ca

    along, ends = _everything(model), _at_ends(model)
    for variable in model.controls:
        if not ca.depends_on(along, model.u[variable.entries]):
            yield _warning(
                ("controls", variable.name), f"the control {variable.name} enters nowhere"
            )
    for variable in model.parameters:
        if not ca.depends_on(ca.vertcat(along, ends), model.p[variable.entries]):
            message = f"the parameter {variable.name} enters nowhere"
            yield _warning(("parameters", variable.name), message)
    for variable in model.states:
        part = variable.entries
        wanted = ca.depends_on(along, model.x[part]) or ca.depends_on(
            ends, ca.vertcat(model.ends.x0[part], model.ends.xf[part])
        )
        limits = (*model.state_bounds, *model.final)
        if not wanted and not any(np.isfinite(side[part]).any() for side in limits):
            message = f"the state {variable.name} enters nothing but its own value"
            yield _warning(("states", variable.name), message)


def _out_of_reach(model: Model) -> Iterator[Complaint]:
    """Bounds of states that bounded controls alone cannot reach within the horizon."""
    import casadi as ca

    if not (model.initial_time.fixed and model.final_time.fixed) or not model.n_u:
        return
    horizon = model.final_time.lower - model.initial_time.lower
    others = ca.vertcat(model.x, model.p, model.t)
    gradient = ca.jacobian(model.xdot, model.u)
    for variable in model.states:
        for i, label in zip(
            range(variable.first, variable.first + variable.size), variable.labels, strict=True
        ):
            row = gradient[i, :]
            if ca.depends_on(model.xdot[i], others) or ca.depends_on(row, model.u):
                continue
            slope = np.array(ca.DM(row)).ravel()
            offset = float(ca.Function("o", [model.u], [model.xdot[i]])(np.zeros(model.n_u)))
            with np.errstate(invalid="ignore"):  # 0 · inf of controls that do not enter
                ends = [np.where(slope != 0, slope * s, 0.0) for s in model.control_bounds]
            lowest, highest = offset + np.minimum(*ends).sum(), offset + np.maximum(*ends).sum()
            least = model.initial.lower[i] + horizon * min(lowest, 0.0)
            most = model.initial.upper[i] + horizon * max(highest, 0.0)
            for side, bound, missed in (
                ("upper", model.state_bounds.upper[i], most),
                ("lower", model.state_bounds.lower[i], least),
            ):
                beyond = bound > missed if side == "upper" else bound < missed
                if np.isfinite(bound) and np.isfinite(missed) and beyond:
                    message = f"{label} cannot get beyond {missed:g}: the bound does nothing"
                    yield _warning(("states", variable.name, side), message)


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
    basis = control_basis(options)
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
