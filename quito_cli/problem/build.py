"""Problem -> Model: every formula parsed in its scope, every size and bound checked.

All complaints are collected and raised together.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np

from quito_cli.problem.comparisons import read_comparison
from quito_cli.problem.declarations import bounds, end_values, hints, times
from quito_cli.problem.keys import derived_state
from quito_cli.problem.known import Known
from quito_cli.problem.model import Constraint, Constraints, Lookup, Model
from quito_cli.problem.recent import recent
from quito_cli.problem.reference import check_reference, read_reference
from quito_cli.problem.schema import Problem
from quito_cli.problem.scopes import Scopes
from quito_cli.problem.text.complaints import Complaint, ProblemError, suggest
from quito_cli.problem.values import Path, Reader
from quito_cli.problem.variables import Bounds, Instant, Variable
from quito_cli.problem.views import read_views

if TYPE_CHECKING:
    import casadi as ca

KEPT: Final = 8
"""Problems whose Models are kept for who asks again."""


@recent(KEPT)
def build(problem: Problem) -> Model:
    """Return the Model of a problem; that of a problem asked for lately is the same object.

    Raises:
        ProblemError: with every mistake in its formulas, sizes and bounds.
    """
    model, complaints = try_build(problem)
    if complaints:
        raise ProblemError(complaints, problem.file, set_values(problem.changes))
    return model


def set_values(changes: tuple[tuple[str, str], ...]) -> str:
    """Return a heading for complaints that may come from values set beside the file."""
    pairs = ", ".join(f"{name}={value}" for name, value in changes)
    return f"with {pairs} set:" if pairs else ""


def try_build(problem: Problem, poisoned: Iterable[str] = ()) -> tuple[Model, list[Complaint]]:
    """Return a Model, of no use if there are complaints, and the complaints.

    `poisoned` are names already complained of: nothing that depends on them is mentioned again.
    """
    reader = Reader(poisoned)
    scopes = Scopes(problem, reader)
    start, end = times(scopes)
    state_bounds = bounds(scopes, "states", scopes.states)
    control_bounds = bounds(scopes, "controls", scopes.controls)
    parameter_bounds = bounds(scopes, "parameters", scopes.parameters)
    initial = end_values(scopes, "initial", state_bounds)
    final = end_values(scopes, "final", state_bounds)
    sense = -1 if problem.sense == "maximize" else 1
    model = Model(
        name=problem.name,
        states=scopes.states,
        controls=scopes.controls,
        parameters=scopes.parameters,
        x=scopes.x,
        u=scopes.u,
        p=scopes.p,
        t=scopes.t,
        xdot=dynamics(scopes),
        lagrange=sense * cost(scopes, "lagrange"),
        ends=scopes.ends,
        mayer=sense * cost(scopes, "mayer"),
        state_bounds=state_bounds,
        control_bounds=control_bounds,
        parameter_bounds=parameter_bounds,
        initial=initial.within(state_bounds),
        final=final.within(state_bounds),
        initial_time=start,
        final_time=end,
        constraints=_constraints(scopes, start, end),
        hints=hints(scopes, parameter_bounds),
        sense=sense,
        known=_known(scopes, start, end, state_bounds, control_bounds),
        views=read_views(scopes),
        lookups=_lookups(scopes),
    )
    return model, reader.complaints


def dynamics(scopes: Scopes) -> ca.SX:
    """Return the derivatives of the states, (n_x, 1)."""
    import casadi as ca

    names, given = [v.name for v in scopes.states], scopes.problem.dynamics
    keys = {name: name for name in names if name in given}
    for key in given:
        if key in names:
            continue
        hint, meant = suggest(key, names), derived_state(key, names)
        if meant:
            hint = f": the key is the state itself, {meant}: ..."
            keys.setdefault(meant, key)
        scopes.reader.complain(("dynamics", key), f"there is no state '{key}'{hint}", key=True)
    missing = [name for name in names if name not in keys]
    if missing:
        message = f"the dynamics of {', '.join(missing)} are missing: one line for each state"
        scopes.reader.complain(("dynamics",), message, key=True)
    return ca.vertcat(
        *(
            _derivative(scopes, v, ("dynamics", keys[v.name]), given[keys[v.name]])
            if v.name in keys
            else ca.SX.zeros(v.size)
            for v in scopes.states
        )
    )


def _derivative(
    scopes: Scopes, variable: Variable, path: Path, value: float | str | list[float | str]
) -> ca.SX:
    """Return the derivative of one state, (size, 1)."""
    import casadi as ca

    if isinstance(value, list):
        entries = [scopes.formula((*path, i), v, scopes.along) for i, v in enumerate(value)]
        for i, entry in enumerate(entries):
            if entry is not None and entry.numel() != 1:
                message = f"an entry is a scalar, this one has {entry.numel()} entries"
                scopes.reader.complain((*path, i), message)
        good = [entry for entry in entries if entry is not None and entry.numel() == 1]
        derivative = ca.vertcat(*good) if len(good) == len(entries) else None
    else:
        derivative = scopes.formula(path, value, scopes.along)
    if derivative is None or scopes.reader.is_poisoned([variable.name]):
        return ca.SX.zeros(variable.size)
    if derivative.shape != (variable.size, 1):
        rows, columns = derivative.shape
        has = str(rows) if columns == 1 else f"the shape {rows}x{columns}"
        size = f"{variable.size} entries" if variable.vector else "one entry"
        message = f"the state {variable.name} has {size}, its derivative has {has}"
        scopes.reader.complain(path, message)
        return ca.SX.zeros(variable.size)
    return derivative


def cost(scopes: Scopes, kind: str) -> ca.SX:
    """Return the Lagrange or Mayer cost, a scalar, in the file's sense."""
    import casadi as ca

    path: Path = ("cost", kind)
    scope = scopes.along if kind == "lagrange" else scopes.mayer
    value = scopes.formula(path, getattr(scopes.problem.cost, kind), scope)
    if value is None:
        return ca.SX(0)
    if value.numel() != 1:
        scopes.reader.complain(path, f"a cost is a scalar, this has {value.numel()} entries")
        return ca.SX(0)
    return value


def _constraints(scopes: Scopes, start: Instant, end: Instant) -> Constraints:
    given = scopes.problem.constraints
    along, boundary = scopes.along, scopes.boundary

    def read(kind: str, texts: dict[str, str]) -> tuple[Constraint, ...]:
        scope = boundary if kind == "boundary" else along
        found = (
            read_comparison(
                *(scopes, ("constraints", kind, name), text, scope, name),
                integral=kind == "integral",
            )
            for name, text in texts.items()
        )
        return tuple(constraint for constraint in found if constraint is not None)

    return Constraints(
        read("path", given.path),
        read("boundary", given.boundary),
        read("integral", given.integral),
        _points(scopes, start, end),
    )


def _points(scopes: Scopes, start: Instant, end: Instant) -> tuple[Constraint, ...]:
    found = []
    fixed = start.fixed and end.fixed
    low, high = (start.lower, end.lower) if fixed else (0.0, 1.0)
    for name, point in scopes.problem.constraints.point.items():
        path: Path = ("constraints", "point", name)
        constant = scopes.constant
        at = scopes.reader.number(
            (*path, "at"), point.at, constant.values, refused=constant.refused
        )
        constraint = read_comparison(scopes, (*path, "holds"), point.holds, scopes.along, name)
        if at is not None and not low <= at <= high:
            what = "the horizon" if fixed else "0 to 1, as a fraction of the free horizon"
            limits = f" [{low:g}, {high:g}]" if fixed else ""
            scopes.reader.complain((*path, "at"), f"{at:g} is outside {what}{limits}")
        elif at is not None and constraint is not None:
            fraction = (at - low) / (high - low) if high > low else 0.0
            found.append(replace(constraint, at=fraction))
    return tuple(found)


def _lookups(scopes: Scopes) -> tuple[Lookup, ...]:
    """Return where tables are read along the horizon, each place once."""
    import casadi as ca

    inputs = [scopes.x, scopes.u, scopes.p, scopes.t]
    found: dict[tuple[str, str], Lookup] = {}
    for table, at in scopes.reader.lookups:
        argument = ca.vec(ca.densify(at))
        if not ca.Function("at", inputs, [argument], {"allow_free": True}).get_free():
            lookup = Lookup(table.name, float(table.x[0]), float(table.x[-1]), argument)
            found.setdefault((table.name, str(argument)), lookup)
    return tuple(found.values())


def _known(
    scopes: Scopes, start: Instant, end: Instant, state_bounds: Bounds, control_bounds: Bounds
) -> Known | None:
    reference, changes = scopes.problem.reference, _of_the_answer(scopes.problem.changes)
    # A general reference is one for other constants: what else was changed, it cannot know.
    constants_only = all(name.split(".")[0] in ("constants", *scopes.constants) for name in changes)
    if reference is None or (changes and not (reference.general and constants_only)):
        return None
    # Even so it may not reach as far as a changed value: then there is none.
    reader = Reader() if changes else scopes.reader
    known = read_reference(
        reader, reference, scopes.constants, scopes.t, scopes.states, scopes.controls
    )
    for i, time in enumerate(known.switching_times):
        if start.fixed and end.fixed and not start.lower <= time <= end.lower:
            message = f"{time:g} is outside the horizon [{start.lower:g}, {end.lower:g}]"
            reader.complain(("reference", "switching_times", i), message)
    horizon = start.upper, end.lower  # at least: a free time may make it longer
    if not reader.complaints and -np.inf < horizon[0] < horizon[1] < np.inf:
        states, controls = (scopes.states, state_bounds), (scopes.controls, control_bounds)
        check_reference(reader, known, horizon, states, controls, whole=start.fixed and end.fixed)
    return None if changes and reader.complaints else known


def _of_the_answer(changes: tuple[tuple[str, str], ...]) -> list[str]:
    """Return the names of changes that concern the answer, not the way to it."""
    aside = ("guess", "scale", "unit", "description")
    return [name for name, _ in changes if name.count(".") < 2 or name.split(".")[2] not in aside]
