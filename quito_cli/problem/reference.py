"""The file's `reference` -> what is Known of the answer, held against horizon and bounds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from quito_cli.problem.known import Known, Piece
from quito_cli.problem.schema_reference import Reference
from quito_cli.problem.text.complaints import suggest
from quito_cli.problem.values import Path, Reader
from quito_cli.problem.variables import Array, Bounds, Variable

if TYPE_CHECKING:
    import casadi as ca


@dataclass(frozen=True)
class _Context:
    reader: Reader
    scope: dict[str, ca.SX]
    t: ca.SX
    refused: dict[str, str]


def read_reference(
    reader: Reader,
    reference: Reference,
    constants: dict[str, ca.SX],
    t: ca.SX,
    states: tuple[Variable, ...],
    controls: tuple[Variable, ...],
) -> Known:
    """Return the reference with its expressions evaluated; complaints go to `reader`."""
    scope = dict(constants)
    for name, value in reference.constants.items():
        path = ("reference", "constants", name)
        if name in constants:
            reader.complain(path, f"'{name}' is already a constant of the problem", key=True)
        number = reader.constant(path, value, scope)
        if number is None:
            reader.poison(name)
        else:
            scope[name] = number
    refused = {
        variable.name: f"'{variable.name}' is a {kind}: a reference is made of t and constants"
        for kind, variables in (("state", states), ("control", controls))
        for variable in variables
        if variable.name not in scope
    }
    context = _Context(reader, scope, t, refused)
    cost = None
    if reference.cost is not None:
        cost = reader.number(("reference", "cost"), reference.cost, scope)
    return Known(
        cost,
        reference.accuracy,
        _switching_times(context, reference),
        _functions(context, "state", reference.state, states),
        _functions(context, "control", reference.control, controls),
    )


def _switching_times(context: _Context, reference: Reference) -> tuple[float, ...]:
    times: list[float] = []
    for i, value in enumerate(reference.switching_times):
        path = ("reference", "switching_times", i)
        time = context.reader.number(path, value, context.scope)
        if time is not None:
            if times and time <= times[-1]:
                context.reader.complain(path, f"switching times increase: {time:g} does not")
            times.append(time)
    return tuple(times)


def _functions(
    context: _Context, kind: str, values: dict[str, Any], variables: tuple[Variable, ...]
) -> dict[str, tuple[Piece, ...]]:
    by_name = {variable.name: variable for variable in variables}
    functions = {}
    for name, value in values.items():
        path: Path = ("reference", kind, name)
        if name not in by_name:
            hint = suggest(name, by_name)
            context.reader.complain(path, f"there is no {kind} '{name}'{hint}", key=True)
            continue
        if isinstance(value, list):
            functions[name] = _pieces(context, path, value, by_name[name].size)
        else:
            function = _function(context, path, value, by_name[name].size)
            functions[name] = (Piece(np.inf, function),) if function else ()
    return functions


def _pieces(context: _Context, path: Path, pieces: list[Any], size: int) -> tuple[Piece, ...]:
    read: list[Piece] = []
    for i, piece in enumerate(pieces):
        last = i == len(pieces) - 1
        until: float | None = np.inf
        if last and piece.until is not None:
            context.reader.complain((*path, i, "until"), "the last piece has no end: drop `until`")
        elif not last and piece.until is None:
            context.reader.complain(
                (*path, i), "`until` is missing: only the last piece has no end"
            )
        elif not last:
            until = context.reader.number((*path, i, "until"), piece.until, context.scope)
            if until is not None and read and until <= read[-1].until:
                message = f"pieces follow one another: {until:g} is not after {read[-1].until:g}"
                context.reader.complain((*path, i, "until"), message)
        function = _function(context, (*path, i, "value"), piece.value, size)
        if function is not None and until is not None:
            read.append(Piece(until, function))
    return tuple(read)


def _function(context: _Context, path: Path, value: float | str, size: int) -> ca.Function | None:
    """Return t ↦ value, a column of `size`."""
    import casadi as ca

    scope = {**context.scope, "t": context.t}
    expression = context.reader.formula(path, value, scope, refused=context.refused)
    if expression is None:
        return None
    if expression.numel() != size:
        message = f"expected {size} entries, the expression has {expression.numel()}"
        context.reader.complain(path, message)
        return None
    return ca.Function("reference", [context.t], [ca.vec(expression)])


POINTS = 201
"""Looked at in every piece of a reference."""
ROUNDING = 1e-6
"""Relative to a bound, what a reference may be beyond it."""


def check_reference(
    reader: Reader,
    known: Known,
    horizon: tuple[float, float],
    states: tuple[tuple[Variable, ...], Bounds],
    controls: tuple[tuple[Variable, ...], Bounds],
    *,
    whole: bool,
) -> None:
    """Complain of a reference that does not cover the horizon, or leaves the bounds.

    Args:
        reader: told of it.
        known: the reference.
        horizon: from the latest initial to the earliest final time.
        states: with their bounds.
        controls: with theirs.
        whole: whether that is all of the horizon.
    """
    for kind, functions, (variables, bounds) in (
        ("state", known.states, states),
        ("control", known.controls, controls),
    ):
        for variable in variables:
            path: Path = ("reference", kind, variable.name)
            pieces = functions.get(variable.name, ())
            limits = bounds.lower[variable.entries], bounds.upper[variable.entries]
            begin = horizon[0]
            for i, piece in enumerate(pieces):
                here = (*path, i) if len(pieces) > 1 else path
                if whole and np.isfinite(piece.until) and not begin < piece.until < horizon[1]:
                    message = f"{piece.until:g} is not inside the horizon"
                    reader.complain((*here, "until"), f"{message} [{horizon[0]:g}, {horizon[1]:g}]")
                    break
                end = min(piece.until, horizon[1])
                wrong = _wrong(piece, variable, (begin, end), limits) if begin < end else None
                if wrong:
                    reader.complain((*here, "value") if len(pieces) > 1 else here, wrong)
                    break
                begin = max(begin, end)


def _wrong(
    piece: Piece, variable: Variable, span: tuple[float, float], limits: tuple[Array, Array]
) -> str | None:
    """Return what is wrong with a piece between its ends; at these it need not be finite."""
    times = span[0] + (span[1] - span[0]) * (np.arange(POINTS) + 0.5) / POINTS
    values = np.array(piece.value.map(POINTS)(times)).T
    lower, upper = (np.broadcast_to(limit, values.shape) for limit in limits)
    slack = [ROUNDING * np.maximum(1.0, np.abs(limit)) for limit in (lower, upper)]
    if not np.isfinite(values).all():
        missing = times[np.argmin(np.isfinite(values).all(axis=1))]
        return f"this has no value at t = {missing:.6g}: a reference covers the whole horizon"
    for bad, limit, what in (
        (values < lower - slack[0], lower, "below its lower"),
        (values > upper + slack[1], upper, "above its upper"),
    ):
        if bad.any():
            point, entry = np.argwhere(bad)[0]
            found = f"{variable.labels[entry]} = {values[point, entry]:.6g}"
            bound = f"{what} bound {limit[point, entry]:g}"
            return f"the reference has {found} at t = {times[point]:.6g}, {bound}"
    return None
