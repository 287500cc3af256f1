"""What does nothing: names that no formula uses, variables without effect, bounds out of reach, a
cost that is always the same."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from quito_cli.problem.language.expressions import ExpressionError, parse, parse_comparison
from quito_cli.problem.model import Model
from quito_cli.problem.schema import Problem
from quito_cli.problem.text.complaints import Complaint, Path

if TYPE_CHECKING:
    import casadi as ca


def idle(problem: Problem, model: Model) -> Iterator[Complaint]:
    """Complain of all of it, each at its place in the file."""
    yield from _unused_names(problem)
    yield from _idle_variables(model)
    yield from _out_of_reach(model)
    yield from _idle_cost(model)


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


def _idle_cost(model: Model) -> Iterator[Complaint]:
    """A cost that is the same whatever is done."""
    import casadi as ca

    ends = model.ends
    times = [ends.t0] * (not model.initial_time.fixed) + [ends.tf] * (not model.final_time.fixed)
    of_ends = ca.depends_on(model.mayer, ca.vertcat(ends.x0, ends.xf, model.p, *times))
    along = ca.depends_on(model.lagrange, ca.vertcat(model.x, model.u, model.p))
    longer = bool(times) and not model.lagrange.is_zero()
    if not (of_ends or along or longer):
        message = "the cost is the same whatever is done: any trajectory is as good as another"
        yield Complaint(("cost",), message, key=True)
