"""Problem -> Model: every formula parsed in its scope, every size and bound checked.

All complaints are collected and raised together.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from quito_cli.problem.complaints import Complaint, ProblemError, suggest
from quito_cli.problem.expressions import is_valid_name
from quito_cli.problem.known import read_reference
from quito_cli.problem.model import Bounds, Endpoints, Instant, Known, Model, Variable
from quito_cli.problem.schema import Control, Problem, State
from quito_cli.problem.values import Path, Reader

if TYPE_CHECKING:
    import casadi as ca


def build(problem: Problem) -> Model:
    """Return the Model of a problem.

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
    builder = _Builder(problem, Reader(poisoned))
    return builder.model(), builder.reader.complaints


class _Builder:
    """One pass over a problem."""

    def __init__(self, problem: Problem, reader: Reader) -> None:
        import casadi as ca

        self.problem, self.reader = problem, reader
        self.states = _variables(problem.states)
        self.controls = _variables(problem.controls)
        self.n_x = sum(v.size for v in self.states)
        self.n_u = sum(v.size for v in self.controls)
        self.x, self.u = ca.SX.sym("x", self.n_x), ca.SX.sym("u", self.n_u)
        self.p, self.t = ca.SX.sym("p", 0), ca.SX.sym("t")
        self._check_names()
        self.constants = self._constants()
        self.not_constant = {
            **{v.name: _no_bound_by(f"the {kind} '{v.name}'") for kind, v in self._named()},
            "t": _no_bound_by("the time t"),
        }

    def _named(self) -> list[tuple[str, Variable]]:
        return [("state", v) for v in self.states] + [("control", v) for v in self.controls]

    def _check_names(self) -> None:
        """Every name is valid and has one meaning."""
        meaning: dict[str, str] = {}
        sections = (
            ("constant", "constants", self.problem.constants),
            ("state", "states", self.problem.states),
            ("control", "controls", self.problem.controls),
        )
        for kind, section, names in sections:
            for name in names:
                path: Path = (section, name)
                if reason := is_valid_name(name):
                    self.reader.complain(path, reason, key=True)
                    self.reader.poison(name)
                elif name in meaning:
                    self.reader.complain(path, f"'{name}' is already a {meaning[name]}", key=True)
                meaning.setdefault(name, kind)

    def _constants(self) -> dict[str, ca.SX]:
        known: dict[str, ca.SX] = {}
        names = list(self.problem.constants)
        for i, (name, value) in enumerate(self.problem.constants.items()):
            later = {
                n: f"'{n}' is defined further down; constants use earlier ones" for n in names[i:]
            }
            later[name] = f"'{name}' is defined by itself"
            result = self.reader.constant(("constants", name), value, known, later)
            if result is None:
                self.reader.poison(name)
            else:
                known[name] = result
        return known

    def model(self) -> Model:
        """Read everything else, in the order of the file."""
        import casadi as ca

        start, end = self._times()
        ends = Endpoints(
            ca.SX.sym("x0", self.n_x), ca.SX.sym("t0"), ca.SX.sym("xf", self.n_x), ca.SX.sym("tf")
        )
        state_bounds = self._bounds("states", self.problem.states, self.states)
        control_bounds = self._bounds("controls", self.problem.controls, self.controls)
        initial = self._end_values("initial", state_bounds)
        final = self._end_values("final", state_bounds)
        return Model(
            self.problem.name,
            self.states,
            self.controls,
            (),
            self.x,
            self.u,
            self.p,
            self.t,
            self._dynamics(),
            self._lagrange(),
            ends,
            self._mayer(ends),
            state_bounds,
            control_bounds,
            Bounds(np.zeros(0), np.zeros(0)),
            initial.within(state_bounds),
            final.within(state_bounds),
            start,
            end,
            1,
            self._known(),
        )

    def _times(self) -> tuple[Instant, Instant]:
        time, refused = self.problem.time, self.not_constant
        start = self.reader.number(
            ("time", "initial"), time.initial, self.constants, refused=refused
        )
        end = self.reader.number(("time", "final"), time.final, self.constants, refused=refused)
        if start is not None and end is not None and end <= start:
            message = f"the final time {end:g} is not after the initial time {start:g}"
            self.reader.complain(("time", "final"), message)
        start, end = start or 0.0, end or 0.0
        return Instant(start, start, start), Instant(end, end, end)

    def _bounds(
        self,
        section: str,
        entries: Mapping[str, State | Control],
        variables: tuple[Variable, ...],
    ) -> Bounds:
        lower, upper = np.zeros(0), np.zeros(0)
        for (name, entry), variable in zip(entries.items(), variables, strict=True):
            path: Path = (section, name)
            read: list[Any] = []
            for side, value, otherwise in (
                ("lower", entry.lower, -np.inf),
                ("upper", entry.upper, np.inf),
            ):
                where = (*path, side)
                read.append(
                    self.reader.vector(
                        where, value, variable.size, otherwise, self.constants, self.not_constant
                    )
                )
            self.reader.ordered((*path, "upper"), Bounds(*read))
            lower, upper = np.append(lower, read[0]), np.append(upper, read[1])
        self._no_infinite_wall(section, variables, Bounds(lower, upper))
        return Bounds(lower, upper)

    def _no_infinite_wall(
        self, section: str, variables: tuple[Variable, ...], bounds: Bounds
    ) -> None:
        for variable in variables:
            part = variable.entries
            if np.any(bounds.lower[part] == np.inf):
                self.reader.complain(
                    (section, variable.name, "lower"), "a lower bound of +infinity"
                )
            if np.any(bounds.upper[part] == -np.inf):
                self.reader.complain(
                    (section, variable.name, "upper"), "an upper bound of −infinity"
                )

    def _end_values(self, which: str, bounds: Bounds) -> Bounds:
        lower, upper = np.zeros(0), np.zeros(0)
        for (name, state), variable in zip(self.problem.states.items(), self.states, strict=True):
            path: Path = ("states", name, which)
            read = self.reader.ends(
                path, getattr(state, which), variable.size, self.constants, self.not_constant
            )
            self._check_reachable(path, read, bounds, variable)
            lower, upper = np.append(lower, read.lower), np.append(upper, read.upper)
        return Bounds(lower, upper)

    def _check_reachable(
        self, path: Path, read: Bounds, bounds: Bounds, variable: Variable
    ) -> None:
        """An end value lies within the bounds of its state."""
        part = variable.entries
        for i, label in enumerate(variable.labels):
            low, high = bounds.lower[part][i], bounds.upper[part][i]
            if low > high:
                continue
            if read.lower[i] > high:
                message = f"{read.lower[i]:g} is above the upper bound {high:g} of {label}"
            elif read.upper[i] < low:
                message = f"{read.upper[i]:g} is below the lower bound {low:g} of {label}"
            else:
                continue
            self.reader.complain(path, f"the {path[-1]} value {message}")

    def _scope(self) -> dict[str, ca.SX]:
        """What dynamics and running cost may speak of."""
        scope = dict(self.constants)
        scope.update({v.name: self.x[v.entries] for v in self.states})
        scope.update({v.name: self.u[v.entries] for v in self.controls})
        scope["t"] = self.t
        return scope

    def _dynamics(self) -> ca.SX:
        import casadi as ca

        names, given, scope = [v.name for v in self.states], self.problem.dynamics, self._scope()
        for name in given:
            if name not in names:
                message = f"there is no state '{name}'{suggest(name, names)}"
                self.reader.complain(("dynamics", name), message, key=True)
        missing = [name for name in names if name not in given]
        if missing:
            message = f"the dynamics of {', '.join(missing)} are missing: one line for each state"
            self.reader.complain(("dynamics",), message, key=True)
        return ca.vertcat(
            *(
                self._derivative(v, given[v.name], scope)
                if v.name in given
                else ca.SX.zeros(v.size)
                for v in self.states
            )
        )

    def _derivative(
        self, variable: Variable, value: float | str | list[float | str], scope: dict[str, ca.SX]
    ) -> ca.SX:
        """Return the derivative of one state, (size, 1)."""
        import casadi as ca

        path: Path = ("dynamics", variable.name)
        if isinstance(value, list):
            entries = [self.reader.formula((*path, i), v, scope) for i, v in enumerate(value)]
            for i, entry in enumerate(entries):
                if entry is not None and entry.numel() != 1:
                    message = f"an entry is a scalar, this one has {entry.numel()} entries"
                    self.reader.complain((*path, i), message)
            good = [entry for entry in entries if entry is not None and entry.numel() == 1]
            if len(good) < len(entries):
                return ca.SX.zeros(variable.size)
            derivative = ca.vertcat(*good)
        else:
            read = self.reader.formula(path, value, scope)
            if read is None:
                return ca.SX.zeros(variable.size)
            derivative = read
        if derivative.shape != (variable.size, 1):
            rows, columns = derivative.shape
            has = str(rows) if columns == 1 else f"the shape {rows}x{columns}"
            size = f"{variable.size} entries" if variable.vector else "one entry"
            message = f"the state {variable.name} has {size}, its derivative has {has}"
            self.reader.complain(path, message)
            return ca.SX.zeros(variable.size)
        return derivative

    def _scalar(self, path: Path, value: ca.SX | None) -> ca.SX:
        import casadi as ca

        if value is None:
            return ca.SX(0)
        if value.numel() != 1:
            self.reader.complain(path, f"a cost is a scalar, this has {value.numel()} entries")
            return ca.SX(0)
        return value

    def _lagrange(self) -> ca.SX:
        path: Path = ("cost", "lagrange")
        value = self.reader.formula(path, self.problem.cost.lagrange, self._scope())
        return self._scalar(path, value)

    def _mayer(self, ends: Endpoints) -> ca.SX:
        path: Path = ("cost", "mayer")
        final = {v.name: ends.xf[v.entries] for v in self.states} | {"t": ends.tf}
        initial = {v.name: ends.x0[v.entries] for v in self.states} | {"t": ends.t0}
        no_control = "a control has no value at a single time: use it in the running cost"
        value = self.reader.formula(
            path,
            self.problem.cost.mayer,
            {**self.constants, **final},
            refused={v.name: no_control for v in self.controls},
            initial=initial,
            final=final,
        )
        return self._scalar(path, value)

    def _known(self) -> Known | None:
        reference = self.problem.reference
        if reference is None:
            return None
        known = read_reference(
            self.reader, reference, self.constants, self.t, self.states, self.controls
        )
        return known if reference.general or not self.problem.changes else None


def _variables(entries: Mapping[str, State | Control]) -> tuple[Variable, ...]:
    variables, first = [], 0
    for name, entry in entries.items():
        size = entry.size or 1
        variables.append(Variable(name, size, first, entry.unit, entry.size is not None))
        first += size
    return tuple(variables)


def _no_bound_by(what: str) -> str:
    return f"{what} is not a constant: bounds, times and end values are numbers and constants"
