"""Gates: limits that a comparison must keep, for use where nobody looks at the table.

They are limits of the first row, which is ours: what another method does badly is no fault of ours.
Where the first row is itself the truth, of saved results, they are limits of all others.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import product
from typing import Final

from quito_cli.comparison.comparison import Comparison, Row
from quito_cli.comparison.table import COLUMNS
from quito_cli.errors import GateError, UsageError


@dataclass(frozen=True)
class Gate:
    """A limit that may be asked for."""

    name: str
    """As an option: max-…"""

    @property
    def column(self) -> str:
        """What it limits, by its size."""
        return self.name.replace("-", "_")


GATES: Final = (
    Gate("error-l2"),
    Gate("error-l1"),
    Gate("error-sup"),
    Gate("error-sup-outside"),
    Gate("error-norm"),
    Gate("cost-error"),
    Gate("state-error"),
    Gate("switching-error"),
    Gate("total-variation"),
    Gate("ringing"),
    Gate("violation"),
)
_FIGURES: Final[Mapping[str, Callable[[Row], float | int | None]]] = {
    column.key: column.value for given in COLUMNS.values() for column in given
}


def check_limits(limits: Mapping[str, float | None]) -> None:
    """Refuse limits that nothing can keep.

    Raises:
        UsageError: one is negative or not a number.
    """
    for name, limit in limits.items():
        if limit is not None and not limit >= 0:
            raise UsageError(f"max-{name}: a limit of zero or more is expected, got {limit:g}")


def check_gates(comparison: Comparison, limits: Mapping[str, float | None]) -> None:
    """Hold our row, or where that is the truth all others, against limits by gates; None is none.

    Raises:
        UsageError: there is no figure to hold against a limit.
        GateError: a limit is not kept; every one that is not is told.
    """
    truth, failed = comparison.truth, []
    rows = comparison.rows[1:] if truth and truth.first_row else comparison.rows[:1]
    asked = ((gate, limit) for gate in GATES if (limit := limits.get(gate.name)) is not None)
    for (gate, limit), row in product(asked, rows):
        value = _FIGURES[gate.column](row)
        if value is None or math.isnan(value):
            raise UsageError(
                f"max-{gate.name}: nothing is known to measure it by; leave it out, or give the "
                "problem a reference"
            )
        if not abs(value) <= limit:
            failed.append(f"{row.method}: {gate.column} is {abs(value):.6g}, above {limit:g}")
    if failed:
        raise GateError("\n".join(failed))
