"""Reading values of the problem file: numbers, vectors, ranges and formulas, complaints collected.

A `Reader` never raises for a mistake in the file: it notes a complaint and hands back a harmless
stand-in, so that one pass finds every mistake. What depends on a name that is itself in error is
skipped silently, so that one mistake is told once.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from quito_cli.problem.language.expressions import (
    Budget,
    Expression,
    ExpressionError,
    evaluate,
    parse,
)
from quito_cli.problem.language.hints import Place as Hinted
from quito_cli.problem.language.hints import advice, infinity
from quito_cli.problem.language.tables import TableData
from quito_cli.problem.schema_values import Range
from quito_cli.problem.text.complaints import Complaint
from quito_cli.problem.variables import Bounds

if TYPE_CHECKING:
    import casadi as ca

Array = NDArray[np.float64]
Path = tuple[str | int, ...]
Scope = Mapping[str, "ca.SX"]

_INFINITY = "infinity is written .inf or -.inf, stands alone, and only in bounds"


class Reader:
    """Evaluates values at paths of the file and collects what is wrong with them."""

    def __init__(self, poisoned: Iterable[str] = ()) -> None:
        self.complaints: list[Complaint] = []
        self.budget = Budget()
        self._poisoned = set(poisoned)
        self.tables: dict[str, TableData] = {}
        self.lookups: list[tuple[TableData, ca.SX]] = []
        self.declared: dict[str, str] = {}
        """Every name of the file, and what it is: a `state`, a `table`."""

    def complain(self, path: Path, message: str, *, key: bool = False) -> None:
        """Note a mistake at `path`."""
        length = len(str(path[-1])) if key else 1
        self.complaints.append(Complaint(path, message, length=length, key=key))

    def misread(self, path: Path, error: ExpressionError, *, ends: bool) -> None:
        """Note what is wrong with a formula, with what is known of the names and the place."""
        place = Hinted(self.declared, ends, _end_key(path))
        message = (error.about and advice(error.about, place)) or error.message
        self.complaints.append(Complaint(path, message, error.offset, error.length))

    def poison(self, name: str) -> None:
        """Say no more about whatever depends on `name`."""
        self._poisoned.add(name)

    def is_poisoned(self, names: Iterable[str]) -> bool:
        """Whether any of `names` is in error already."""
        return not self._poisoned.isdisjoint(names)

    def formula(
        self,
        path: Path,
        value: float | str,
        scope: Scope,
        *,
        refused: Mapping[str, str] | None = None,
        initial: Scope | None = None,
        final: Scope | None = None,
    ) -> ca.SX | None:
        """Return the value of a number or formula, or None where it has none."""
        import casadi as ca

        if not isinstance(value, str):
            if not np.isfinite(value):
                self.complain(path, f"{value} is not a finite number")
                return None
            return ca.SX(value)
        try:
            expression: Expression = parse(value)
            if self.budget.exhausted or self.is_poisoned((*expression.names, *expression.tables)):
                return None
            return evaluate(
                expression,
                scope,
                refused={**infinity(expression.tree, _INFINITY), **(refused or {})},
                initial=initial,
                final=final,
                tables=self.tables,
                budget=self.budget,
                lookups=self.lookups,
            )
        except ExpressionError as error:
            self.misread(path, error, ends=initial is not None)
            return None

    def constant(
        self,
        path: Path,
        value: float | str | list[Any],
        scope: Scope,
        refused: Mapping[str, str] | None = None,
    ) -> ca.SX | None:
        """Return a finite number, vector or matrix as a constant SX."""
        import casadi as ca

        if isinstance(value, list):
            return self._table(path, value, scope, refused)
        result = self.formula(path, value, scope, refused=refused)
        if result is None:
            return None
        if not result.is_constant():
            self.complain(path, "a constant is expected: numbers and constants only")
            return None
        if not np.isfinite(np.array(ca.DM(result))).all():
            self.complain(path, "the value is not finite")
            return None
        return result

    def _table(
        self, path: Path, entries: list[Any], scope: Scope, refused: Mapping[str, str] | None
    ) -> ca.SX | None:
        """Return a vector from a list, a matrix from a list of equally long lists."""
        import casadi as ca

        rows = [self.constant((*path, i), entry, scope, refused) for i, entry in enumerate(entries)]
        nested = [isinstance(entry, list) for entry in entries]
        good = [row for row in rows if row is not None]
        if len(good) < len(rows):
            return None
        if any(nested) and not all(nested):
            self.complain((*path, nested.index(not nested[0])), "rows and numbers do not mix")
            return None
        for i, row in enumerate(good):
            if row.numel() != good[0].numel():
                expected = f"{good[0].numel()} entries" if nested[0] else "a number"
                self.complain((*path, i), f"expected {expected} like the first, got {row.numel()}")
                return None
        return ca.vertcat(*(row.T if nested[0] else row for row in good))

    def number(
        self,
        path: Path,
        value: float | str,
        scope: Scope,
        *,
        infinite: bool = False,
        refused: Mapping[str, str] | None = None,
    ) -> float | None:
        """Return a scalar; `infinite` lets ±.inf through."""
        if infinite and not isinstance(value, str) and np.isinf(value):
            return float(value)
        result = self.constant(path, value, scope, refused)
        if result is None:
            return None
        if result.numel() != 1:
            self.complain(path, f"a single number is expected, not {result.numel()} entries")
            return None
        return float(result)

    def vector(
        self,
        path: Path,
        value: Any,
        size: int,
        otherwise: float,
        scope: Scope,
        refused: Mapping[str, str],
    ) -> Array:
        """Return a bound of `size` entries: a number for all, a vector, or a list."""
        if value is None:
            return np.full(size, otherwise)
        if isinstance(value, list):
            return self._entries(path, value, size, otherwise, scope, refused)
        if not isinstance(value, str):
            number = self.number(path, value, scope, infinite=True, refused=refused)
            return np.full(size, otherwise if number is None else number)
        result = self.constant(path, value, scope, refused)
        if result is None:
            return np.full(size, otherwise)
        if result.numel() not in (1, size):
            self.complain(path, f"expected {_entries(size)}, the expression has {result.numel()}")
            return np.full(size, otherwise)
        import casadi as ca

        return np.broadcast_to(np.array(ca.DM(result)).ravel(), (size,)).astype(float)

    def _entries(
        self,
        path: Path,
        entries: list[Any],
        size: int,
        otherwise: float,
        scope: Scope,
        refused: Mapping[str, str],
    ) -> Array:
        if len(entries) != size:
            self.complain(path, miscounted(size, len(entries)))
            return np.full(size, otherwise)
        read = [
            otherwise
            if entry is None
            else self.number((*path, i), entry, scope, infinite=True, refused=refused)
            for i, entry in enumerate(entries)
        ]
        return np.array([otherwise if number is None else number for number in read])

    def ends(
        self, path: Path, value: Any, size: int, scope: Scope, refused: Mapping[str, str]
    ) -> Bounds:
        """Return bounds from an end value: fixed, a range, free (None), or a list of these."""
        if isinstance(value, list):
            if len(value) != size:
                self.complain(path, miscounted(size, len(value)))
                value = None
            else:
                parts = [
                    self.ends((*path, i), entry, 1, scope, refused) for i, entry in enumerate(value)
                ]
                return Bounds(
                    np.concatenate([part.lower for part in parts]),
                    np.concatenate([part.upper for part in parts]),
                )
        if isinstance(value, Range):
            lower = self.vector((*path, "lower"), value.lower, size, -np.inf, scope, refused)
            upper = self.vector((*path, "upper"), value.upper, size, np.inf, scope, refused)
            self.ordered((*path, "upper"), Bounds(lower, upper))
            return Bounds(lower, upper)
        if value is None:
            return Bounds(np.full(size, -np.inf), np.full(size, np.inf))
        if not isinstance(value, str) and not np.isfinite(value):
            self.complain(path, f"{value} is not a finite number; leave it out to leave it free")
            return Bounds(np.full(size, -np.inf), np.full(size, np.inf))
        before = len(self.complaints)
        fixed = self.vector(path, value, size, 0.0, scope, refused)
        if len(self.complaints) > before:  # a stand-in must not clash with the bounds later
            return Bounds(np.full(size, -np.inf), np.full(size, np.inf))
        return Bounds(fixed, fixed)

    def ordered(self, path: Path, bounds: Bounds) -> None:
        """Complain where a lower bound is above its upper one."""
        (crossed,) = np.nonzero(bounds.lower > bounds.upper)
        if crossed.size:
            i = crossed[0]
            entry = f" of entry {i}" if len(bounds.lower) > 1 else ""
            self.complain(
                path,
                f"the upper bound {bounds.upper[i]:g}{entry} is below the lower bound "
                f"{bounds.lower[i]:g}",
            )


def _end_key(path: Path) -> str:
    """Return the key of a bound or end value of a variable, or `time`, or nothing."""
    if path[0] == "time":
        return "time"
    inside = path[0] in ("states", "controls", "parameters") and len(path) > 2
    keys = [str(step) for step in path[2:] if step in ("initial", "final", "lower", "upper")]
    return keys[-1] if inside and keys else ""


def _entries(size: int) -> str:
    return f"{size} entries" if size > 1 else "one entry"


def miscounted(size: int, given: int) -> str:
    """Say how many entries there should be."""
    hint = "; a vector needs its `size`" if size == 1 else ""
    return f"expected {_entries(size)}, got {given}{hint}"
