"""What the sections of the file declare, as arrays: times, bounds, end values, guesses, scales."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from quito_cli.problem.model import GuessFunction, Hints
from quito_cli.problem.schema import Control, Parameter, State
from quito_cli.problem.schema_values import FreeTime, GuessTable
from quito_cli.problem.scopes import Scope, Scopes
from quito_cli.problem.values import Path, miscounted
from quito_cli.problem.variables import Bounds, Instant, Variable

if TYPE_CHECKING:
    import casadi as ca

Array = NDArray[np.float64]
Entries = Mapping[str, State | Control | Parameter]


def times(scopes: Scopes) -> tuple[Instant, Instant]:
    """Return initial and final time."""
    section = scopes.problem.time
    start = _instant(scopes, ("time", "initial"), section.initial, None)
    end = _instant(scopes, ("time", "final"), section.final, start)
    if start is None or end is None:
        return Instant(*[-np.inf] * 3), Instant(*[np.inf] * 3)  # nothing is outside of it
    if start.fixed and end.fixed and end.lower <= start.lower:
        message = f"the final time {end.lower:g} is not after the initial time {start.lower:g}"
        scopes.reader.complain(("time", "final"), message)
    elif wrong := _not_after(start, end):
        which, key, message = wrong
        path: Path = ("time", which)
        given = getattr(scopes.problem.time, which)
        inside = isinstance(given, FreeTime) and getattr(given, key) is not None
        scopes.reader.complain((*path, key) if inside else path, message)
    return start, end


def _not_after(start: Instant, end: Instant) -> tuple[str, str, str] | None:
    """Return where and why a free final time may come before the initial one: it must not."""
    if end.lower <= start.lower:
        if not np.isfinite(end.lower):
            it_is = f"the initial time {start.lower:g}: write final: {{lower: ...}}"
        else:
            it_is = f"the initial time {start.lower:g}, not {end.lower:g}"
        return "final", "lower", f"the final time needs a lower bound above {it_is}"
    if not end.fixed and np.isfinite(end.upper) and end.upper <= start.upper:
        message = f"the latest final time {end.upper:g} is not after the latest initial time"
        return "final", "upper", f"{message} {start.upper:g}"
    if end.fixed and end.upper <= start.upper:
        message = f"the initial time needs an upper bound below the final time {end.upper:g}"
        return "initial", "upper", f"{message}: write initial: {{upper: ...}}"
    if end.guess <= start.guess:
        message = f"the guessed final time {end.guess:g} is not after the initial one"
        return "final", "guess", f"{message}, {start.guess:g}"
    return None


def _instant(
    scopes: Scopes, path: Path, value: float | str | FreeTime, after: Instant | None
) -> Instant | None:
    reader, scope = scopes.reader, scopes.constant
    if not isinstance(value, FreeTime):
        number = reader.number(path, value, scope.values, refused=scope.refused)
        return None if number is None else Instant(number, number, number)
    read: dict[str, float | None] = {}
    for name, otherwise in (("lower", -np.inf), ("upper", np.inf), ("guess", None)):
        given = getattr(value, name)
        read[name] = otherwise
        if given is not None:
            read[name] = reader.number(
                (*path, name), given, scope.values, infinite=name != "guess", refused=scope.refused
            )
            if read[name] is None:
                return None
    lower, upper, guess = read["lower"], read["upper"], read["guess"]
    assert lower is not None
    assert upper is not None
    if lower == np.inf or upper == -np.inf:
        key = "lower" if lower == np.inf else "upper"
        reader.complain((*path, key), "no time is infinite; for no bound leave it out")
        return None
    reader.ordered((*path, "upper"), Bounds(np.array([lower]), np.array([upper])))
    if guess is not None and not lower <= guess <= upper:
        reader.complain((*path, "guess"), f"the guess {guess:g} is outside its bounds")
    return Instant(lower, upper, _guessed_time(lower, upper, after) if guess is None else guess)


def _guessed_time(lower: float, upper: float, after: Instant | None) -> float:
    """Return a time within bounds, for want of a guess."""
    start = after.guess if after is not None else 0.0
    if np.isfinite(lower) and np.isfinite(upper):
        return (lower + upper) / 2
    if np.isfinite(lower):
        return max(lower, start + 1.0)
    return upper if np.isfinite(upper) and upper < start + 1.0 else start + float(after is not None)


def bounds(scopes: Scopes, section: str, names: tuple[Variable, ...]) -> Bounds:
    """Return the bounds of a section's variables."""
    entries: Entries = getattr(scopes.problem, section)
    lower, upper = np.zeros(0), np.zeros(0)
    for (name, entry), variable in zip(entries.items(), names, strict=True):
        path: Path = (section, name)
        low = _numbers(scopes, (*path, "lower"), entry.lower, variable.size, -np.inf)
        high = _numbers(scopes, (*path, "upper"), entry.upper, variable.size, np.inf)
        scopes.reader.ordered((*path, "upper"), Bounds(low, high))
        if np.any(low == np.inf):
            scopes.reader.complain(
                (*path, "lower"),
                "a lower bound of infinity leaves no value; for no bound leave it out",
            )
        if np.any(high == -np.inf):
            scopes.reader.complain(
                (*path, "upper"),
                "an upper bound of -infinity leaves no value; for no bound leave it out",
            )
        lower, upper = np.append(lower, low), np.append(upper, high)
    return Bounds(lower, upper)


def _numbers(scopes: Scopes, path: Path, value: Any, size: int, otherwise: float) -> Array:
    scope = scopes.bound if path[-1] in ("lower", "upper") else scopes.constant
    return scopes.reader.vector(path, value, size, otherwise, scope.values, scope.refused)


def end_values(scopes: Scopes, which: str, within: Bounds) -> Bounds:
    """Return the `initial` or `final` values of all states."""
    lower, upper = np.zeros(0), np.zeros(0)
    for (name, state), variable in zip(scopes.problem.states.items(), scopes.states, strict=True):
        path: Path = ("states", name, which)
        scope = scopes.constant
        read = scopes.reader.ends(
            path, getattr(state, which), variable.size, scope.values, scope.refused
        )
        _check_reachable(scopes, path, read, within, variable)
        lower, upper = np.append(lower, read.lower), np.append(upper, read.upper)
    return Bounds(lower, upper)


def _check_reachable(
    scopes: Scopes, path: Path, read: Bounds, within: Bounds, variable: Variable
) -> None:
    """An end value lies within the bounds of its state."""
    part = variable.entries
    for i, label in enumerate(variable.labels):
        low, high = within.lower[part][i], within.upper[part][i]
        if low > high:
            continue
        if read.lower[i] > high:
            message = f"{read.lower[i]:g} is above the upper bound {high:g} of {label}"
        elif read.upper[i] < low:
            message = f"{read.upper[i]:g} is below the lower bound {low:g} of {label}"
        else:
            continue
        scopes.reader.complain(path, f"the {path[-1]} value {message}")


def hints(scopes: Scopes, parameter_bounds: Bounds) -> Hints:
    """Return guesses and scales."""
    problem = scopes.problem
    parameters = _each(scopes, "parameters", scopes.parameters, "guess")
    for variable in scopes.parameters:
        if np.isinf(parameters[variable.entries]).any():
            message = "a guess is finite; leave it out to start from the bounds"
            scopes.reader.complain(("parameters", variable.name, "guess"), message)
    unknown = np.isnan(parameters) & ~np.isfinite(parameter_bounds.lower)
    for variable in scopes.parameters:
        if np.any((unknown & ~np.isfinite(parameter_bounds.upper))[variable.entries]):
            message = f"the parameter {variable.name} needs bounds or a guess to start from"
            scopes.reader.complain(("parameters", variable.name), message, key=True)
    return Hints(
        tuple(_guess(scopes, "states", v, problem.states[v.name].guess) for v in scopes.states),
        tuple(
            _guess(scopes, "controls", v, problem.controls[v.name].guess) for v in scopes.controls
        ),
        parameters,
        _scales(scopes, "states", scopes.states),
        _scales(scopes, "controls", scopes.controls),
        _scales(scopes, "parameters", scopes.parameters),
    )


def _each(scopes: Scopes, section: str, names: tuple[Variable, ...], key: str) -> Array:
    """Return a number for every entry of a section's variables; NaN where none is given."""
    entries = getattr(scopes.problem, section)
    parts = [
        _numbers(scopes, (section, v.name, key), getattr(entries[v.name], key), v.size, np.nan)
        for v in names
    ]
    return np.concatenate(parts) if parts else np.zeros(0)


def _scales(scopes: Scopes, section: str, names: tuple[Variable, ...]) -> Array:
    scales = _each(scopes, section, names, "scale")
    for variable in names:
        part = scales[variable.entries]
        if np.any(part <= 0) or np.any(np.isinf(part)):
            message = "a scale is a finite number above zero"
            scopes.reader.complain((section, variable.name, "scale"), message)
    return scales


def _guess(scopes: Scopes, section: str, variable: Variable, value: Any) -> GuessFunction | None:
    """Return the guess of one variable as a function of time."""
    path: Path = (section, variable.name, "guess")
    if value is None:
        return None
    if isinstance(value, GuessTable):
        return _guess_table(scopes, path, value, variable.size)
    scope = Scope(
        {**scopes.constants, "t": scopes.t},
        {name: f"a guess is an expression of t, not of {name}" for name in scopes.along.values},
    )
    allowed = {name: why for name, why in scope.refused.items() if name not in scope.values}
    scope = Scope(scope.values, allowed)
    given = value if isinstance(value, list) else [value]
    paths: list[Path] = [(*path, i) for i in range(len(given))] if given is value else [path]
    read = [scopes.formula(p, entry, scope) for p, entry in zip(paths, given, strict=True)]
    good = [entry for entry in read if entry is not None]
    if len(good) < len(read):
        return None
    import casadi as ca

    stacked = ca.vertcat(*(ca.vec(entry) for entry in good))
    if stacked.numel() not in (1, variable.size):
        scopes.reader.complain(path, miscounted(variable.size, stacked.numel()))
        return None
    stacked = ca.repmat(stacked, variable.size // stacked.numel(), 1)
    return _sampled(ca.Function("guess", [scopes.t], [stacked]))


def _sampled(function: ca.Function) -> GuessFunction:
    def guess(at: Array) -> Array:
        return np.array(function.map(len(at))(at)).T

    return guess


def _guess_table(scopes: Scopes, path: Path, table: GuessTable, size: int) -> GuessFunction | None:
    times = np.array(table.times)
    rows = [row if isinstance(row, list) else [row] for row in table.values]
    if len(rows) != len(times):
        message = f"{len(times)} times, but {len(rows)} values"
        scopes.reader.complain((*path, "values"), message)
        return None
    for i, row in enumerate(rows):
        if len(row) != size or not np.isfinite(row).all():
            wanted = f"{size} finite numbers" if size > 1 else "a finite number"
            scopes.reader.complain((*path, "values", i), f"expected {wanted}")
            return None
    if not np.isfinite(times).all():
        place = int(np.argmin(np.isfinite(times)))
        scopes.reader.complain((*path, "times", place), "a time of a guess is a finite number")
        return None
    if np.any(np.diff(times) <= 0):
        place = 1 + int(np.argmax(np.diff(times) <= 0))
        scopes.reader.complain((*path, "times", place), "the times of a guess increase")
        return None
    values = np.array(rows, dtype=float)

    def guess(at: Array) -> Array:
        return np.column_stack([np.interp(at, times, column) for column in values.T])

    return guess
