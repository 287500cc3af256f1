"""What names mean where: along the horizon, at its ends, and among constants.

    dynamics, running cost, path, integral, point   states, controls, parameters, t, tables
    Mayer cost                                      bare names are final values; initial(), final()
    boundary constraints                            initial() and final() only, and parameters
    bounds, times, end values                       constants

Named expressions are evaluated in each scope they can be: one that contains a control has no value
at a single time.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from quito_cli.problem.language.expressions import is_valid_name
from quito_cli.problem.language.tables import TableData, check
from quito_cli.problem.model import Endpoints
from quito_cli.problem.schema import Control, Parameter, Problem, State
from quito_cli.problem.values import Path, Reader
from quito_cli.problem.variables import Variable

if TYPE_CHECKING:
    import casadi as ca

_NO_CONTROL = "a control has no value at a single time: use it in the running cost"
_PATH_CONTROL = "a control has no value at a single time: use it in a path constraint"
_ENDS_ONLY = "say which value is meant: initial({name}) or final({name})"
_EARLIER = "constants are made of numbers and earlier constants"
_MOVING = (
    "; a bound that moves is a path constraint, such as constraints: {path: {limit: x <= 2*t}}"
)
_LATER = "'{name}' is defined further down; {what} use earlier ones"


@dataclass(frozen=True)
class Scope:
    """Names and their values, and names that are refused with the reason."""

    values: Mapping[str, ca.SX]
    refused: Mapping[str, str]
    initial: Mapping[str, ca.SX] | None = None
    final: Mapping[str, ca.SX] | None = None


@dataclass
class Scopes:
    """Symbols and scopes of one problem, made as its sections are read."""

    problem: Problem
    reader: Reader
    states: tuple[Variable, ...] = ()
    controls: tuple[Variable, ...] = ()
    parameters: tuple[Variable, ...] = ()
    constants: dict[str, ca.SX] = field(default_factory=dict)
    tables: dict[str, TableData] = field(default_factory=dict)

    def __post_init__(self) -> None:
        import casadi as ca

        problem = self.problem
        self.states = variables(problem.states)
        self.controls = variables(problem.controls)
        self.parameters = variables(problem.parameters)
        sizes = [sum(v.size for v in vs) for vs in (self.states, self.controls, self.parameters)]
        self.n_x, self.n_u, self.n_p = sizes
        self.x, self.u = ca.SX.sym("x", self.n_x), ca.SX.sym("u", self.n_u)
        self.p, self.t = ca.SX.sym("p", self.n_p), ca.SX.sym("t")
        self.ends = Endpoints(
            ca.SX.sym("x0", self.n_x), ca.SX.sym("t0"), ca.SX.sym("xf", self.n_x), ca.SX.sym("tf")
        )
        self._check_names()
        self._read_tables()
        self._read_constants()
        refused = self._not_constant("bounds, times and end values are")
        self.constant = Scope(self.constants, refused)
        self.shape = Scope(self.constants, self._not_constant("obstacles are made of"))
        self.bound = Scope(self.constants, {n: why + _MOVING for n, why in refused.items()})
        self.along, self.mayer, self.boundary = self._scopes()

    def _check_names(self) -> None:
        """Every name is valid and has one meaning."""
        meaning: dict[str, str] = {}
        for section in ("constants", "tables", "states", "controls", "parameters", "expressions"):
            kind = section.removesuffix("s")
            article = "an" if kind[0] in "aeiou" else "a"
            for name in getattr(self.problem, section):
                path: Path = (section, name)
                if reason := is_valid_name(name):
                    self.reader.complain(path, reason, key=True)
                    self.reader.poison(name)
                elif name in meaning:
                    self.reader.complain(path, f"'{name}' is already {meaning[name]}", key=True)
                meaning.setdefault(name, f"{article} {kind}")
                self.reader.declared.setdefault(name, kind)

    def _read_tables(self) -> None:
        for name, table in self.problem.tables.items():
            complaints = check(table.x, table.y)
            for place, message in complaints:
                path: Path = ("tables", name)
                column = "y" if message.startswith(f"entry {place} of y ") else "x"
                self.reader.complain(path if place is None else (*path, column, place), message)
            if complaints:
                self.reader.poison(name)
            else:
                data = TableData(name, np.array(table.x), np.array(table.y), table.method)
                self.tables[name] = self.reader.tables[name] = data

    def _read_constants(self) -> None:
        varying = {"t": f"'t' is the time: {_EARLIER}"}
        for kind, variables_of in self._kinds():
            varying |= {v.name: f"'{v.name}' is a {kind}: {_EARLIER}" for v in variables_of}
        for name in self.problem.expressions:
            varying[name] = f"'{name}' is an expression: {_EARLIER}"
        names = list(self.problem.constants)
        for i, (name, value) in enumerate(self.problem.constants.items()):
            later = {n: _LATER.format(name=n, what="constants") for n in names[i:]}
            later[name] = f"'{name}' is defined by itself"
            result = self.reader.constant(
                ("constants", name), value, self.constants, varying | later
            )
            if result is None:
                self.reader.poison(name)
            else:
                self.constants[name] = result

    def _kinds(self) -> tuple[tuple[str, tuple[Variable, ...]], ...]:
        return (
            ("state", self.states),
            ("control", self.controls),
            ("parameter", self.parameters),
        )

    def _not_constant(self, what: str) -> dict[str, str]:
        """Why names are refused where `what` numbers and constants."""
        varying = {"t": "the time t"}
        for kind, names in self._kinds():
            varying |= {v.name: f"the {kind} '{v.name}'" for v in names}
        varying |= {name: f"the expression '{name}'" for name in self.problem.expressions}
        return {
            name: f"{called} is not a constant: {what} numbers and constants"
            for name, called in varying.items()
        }

    def name_constants(self, symbols: Mapping[str, ca.SX]) -> None:
        """Let formulas along the horizon and at its ends read these symbols for constants."""
        self.constants |= symbols
        self.along, self.mayer, self.boundary = self._scopes()

    def _scopes(self) -> tuple[Scope, Scope, Scope]:
        """Return the scopes along the horizon, of the Mayer cost and of boundary constraints."""
        fixed = {**self.constants, **_entries(self.parameters, self.p)}
        along = fixed | _entries(self.states, self.x) | _entries(self.controls, self.u)
        along["t"] = self.t
        initial = _entries(self.states, self.ends.x0) | {"t": self.ends.t0}
        final = _entries(self.states, self.ends.xf) | {"t": self.ends.tf}
        at_ends = dict.fromkeys((v.name for v in self.controls), _NO_CONTROL)
        initial_scope, final_scope = fixed | initial, fixed | final
        names = list(self.problem.expressions)
        for i, (name, text) in enumerate(self.problem.expressions.items()):
            later = {n: _LATER.format(name=n, what="expressions") for n in names[i:]}
            later[name] = f"'{name}' is defined by itself"
            path: Path = ("expressions", name)
            value = self.formula(path, text, Scope(along, later))
            if value is None:
                self.reader.poison(name)
                continue
            along[name] = value
            if _depends(value, self.u):
                at_ends[name] = f"'{name}' contains a control, which has no value at a single time"
                continue
            for scope, bare in ((initial_scope, initial), (final_scope, final)):
                at_end = self.formula(path, text, Scope(scope, {}))
                if at_end is not None:
                    scope[name] = bare[name] = at_end
        bare_names = [*(v.name for v in self.states), "t", *self.problem.expressions]
        ends_only = {n: _ENDS_ONLY.format(name=n) for n in bare_names} | at_ends
        at_path = dict.fromkeys((v.name for v in self.controls), _PATH_CONTROL)
        return (
            Scope(along, {}),
            Scope(final_scope, at_ends, initial, final),
            Scope(fixed, ends_only | at_path, initial, final),
        )

    def formula(self, path: Path, value: float | str, scope: Scope) -> ca.SX | None:
        """Return the value of a formula in a scope, or None after a complaint."""
        return self.reader.formula(
            path,
            value,
            scope.values,
            refused=scope.refused,
            initial=scope.initial,
            final=scope.final,
        )


def variables(entries: Mapping[str, State | Control | Parameter]) -> tuple[Variable, ...]:
    """Return the variables of a section, stacked in its order."""
    found, first = [], 0
    for name, entry in entries.items():
        size = entry.size or 1
        found.append(Variable(name, size, first, entry.unit, entry.size is not None))
        first += size
    return tuple(found)


def _entries(names: tuple[Variable, ...], stacked: ca.SX) -> dict[str, ca.SX]:
    return {variable.name: stacked[variable.entries] for variable in names}


def _depends(value: ca.SX, on: ca.SX) -> bool:
    import casadi as ca

    return bool(on.numel()) and bool(ca.depends_on(value, on))
