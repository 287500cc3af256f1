"""Where plots stand in a figure, and which entries share one."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

from quito_cli.plots.palette import plain
from quito_cli.solution.solution import Quantity

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Item = TypeVar("Item")

_MANY = 12
"""More entries than this, and those of one vector share a plot."""


def shared(quantities: tuple[Quantity, ...]) -> dict[str, list[int]]:
    """Return the entries of each plot by its name: one, or where there are many, a vector's."""
    plots: dict[str, list[int]] = {}
    for i, quantity in enumerate(quantities):
        vector = quantity.name.partition("[")[0]
        plots.setdefault(vector if len(quantities) > _MANY else quantity.name, []).append(i)
    return plots


def with_unit(name: str, unit: str) -> str:
    """Return the label of an axis."""
    return name + (f" [{plain(unit)}]" if unit else "")


def balanced(group: Sequence[Item], columns: int) -> list[Sequence[Item]]:
    """Return rows of nearly equal length: four plots stand two by two, not three and one."""
    count = math.ceil(len(group) / columns)
    ends = [math.ceil(len(group) * (i + 1) / max(count, 1)) for i in range(count)]
    return [group[start:end] for start, end in zip([0, *ends], ends, strict=False)]


def places(
    drawn: Figure, rows: Sequence[Sequence[Item]], heights: Sequence[float]
) -> Iterator[tuple[int, int, Item, Any]]:
    """Yield row and column of each item, the item, and the cell of the grid where it stands.

    Args:
        drawn: the figure.
        rows: whose items share the width equally.
        heights: of the rows, relative to each other.
    """
    units = math.lcm(*(len(row) for row in rows))
    grid = drawn.add_gridspec(len(rows), units, height_ratios=heights)
    for i, row in enumerate(rows):
        width = units // len(row)
        for j, item in enumerate(row):
            yield i, j, item, grid[i, j * width : (j + 1) * width]


def legend_columns(names: Sequence[str], width: float) -> int:
    """Return how many names of a legend stand beside each other, in rows as full as each other.

    Args:
        names: one at least.
        width: of the figure, in inches.
    """
    longest = max(map(len, names))
    fit = max(1, int(width / (0.085 * longest + 0.75)))
    lines = math.ceil(len(names) / fit)
    return math.ceil(len(names) / lines)
