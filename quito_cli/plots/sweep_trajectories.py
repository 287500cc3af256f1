"""The trajectories of a sweep, one over another, coloured by the finest of its axes."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from quito_cli.plots.layout import balanced, places, shared, with_unit
from quito_cli.plots.palette import BOUND, plain
from quito_cli.plots.panels import thinned
from quito_cli.plots.sweep_scales import coloured, explain, named
from quito_cli.solution.solution import Quantity, Solution

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from quito_cli.batch.sweeps.sweep import Swept
    from quito_cli.plots.sweep_scales import Hue

_MOST: Final = 40
"""Trajectories in a plot: more are a surface. They are spread over each axis."""
_MOST_DASHED: Final = 4
"""Places on the axes that colours do not stand for."""
_COLUMNS: Final = 3
_NEAR: Final = 0.6
"""Bounds further away than this many spans of a quantity are not drawn."""


def trajectories(swept: Swept) -> Figure | None:
    """Return states and controls of the answers; None where there is none.

    Raises:
        ResultFileError: the result of a case cannot be read.
    """
    from matplotlib.figure import Figure

    hue = coloured(swept.sweep.axes)
    chosen = _chosen(swept, hue)
    found = {place: solution for place in chosen if (solution := _answer(swept, place))}
    if not found:
        return None
    origin = next(iter(found.values())).origin
    groups = [
        [(kind, members) for members in shared(quantities).items()]
        for kind, quantities in (("state", origin.states), ("control", origin.controls))
    ]
    rows = [row for group in groups for row in balanced(group, _COLUMNS)]
    size = 1.2 + 3.6 * max(2, *(len(row) for row in rows)), 1.3 + 2.4 * len(rows)
    drawn = Figure(figsize=size, layout="constrained")
    for i, _, (kind, (name, members)), place in places(drawn, rows, [1.0] * len(rows)):
        plot = drawn.add_subplot(place)
        quantities = origin.states if kind == "state" else origin.controls
        _draw(plot, found, hue, kind, [quantities[n].name for n in members])
        plot.set_ylabel(with_unit(name, quantities[members[0]].unit))
        if i == len(rows) - 1:
            plot.set_xlabel("t")
    drawn.suptitle(_heading(swept, len(found), len(chosen)))
    explain(drawn, hue, drawn.axes, {})
    return drawn


def _chosen(swept: Swept, hue: Hue) -> list[tuple[int, ...]]:
    """Return places spread over the sweep, few enough to be told apart."""
    shape = swept.sweep.shape
    others = [i for i in range(len(shape)) if i != hue.by_colour]
    room = dict.fromkeys(others, 1)
    for i in others:  # as many as there are dashes, on the first axes that have them
        used = int(np.prod([room[j] for j in others if j != i]))
        room[i] = max(1, min(shape[i], _MOST_DASHED // used))
    count = int(np.prod(list(room.values()))) if room else 1
    room[hue.by_colour] = min(shape[hue.by_colour], max(2, _MOST // count))
    spread = (
        sorted({round(x) for x in np.linspace(0, size - 1, room[i])})
        for i, size in enumerate(shape)
    )
    return list(product(*spread))


def _answer(swept: Swept, place: tuple[int, ...]) -> Solution | None:
    number = int(np.ravel_multi_index(place, swept.sweep.shape))
    one = swept.finished[number]
    if one is None or one.result is None or not swept.solved[number]:
        return None
    return Solution.load(one.result)


def _draw(
    plot: Axes,
    found: dict[tuple[int, ...], Solution],
    hue: Hue,
    kind: str,
    names: Sequence[str],
) -> None:
    """Draw quantities of all answers, by name, and the bounds that they have in common."""
    low, high, bounds = np.inf, -np.inf, []
    for place, solution in found.items():
        quantities: tuple[Quantity, ...] = getattr(solution.origin, f"{kind}s")
        times = np.union1d(solution.dense_times, solution.times)
        values = getattr(solution, kind)(times)
        of_this = [q for q in quantities if q.name in names]
        bounds.append({b for q in of_this for b in (q.lower, q.upper)})
        for quantity in of_this:
            column = values[:, quantities.index(quantity)]
            low, high = min(low, np.nanmin(column)), max(high, np.nanmax(column))
            look: dict[str, Any] = {"linewidth": 1.0, **hue.look(place)}
            plot.plot(*thinned(times, column), **look)
    reach = _NEAR * max(high - low, 1e-12)
    for bound in set.intersection(*bounds):
        if low - reach <= bound <= high + reach:
            plot.axhline(bound, color=BOUND, linewidth=0.9, linestyle=":")
    plot.grid(alpha=0.25)
    plot.margins(x=0.01)


def _heading(swept: Swept, drawn: int, chosen: int) -> str:
    sweep = swept.sweep
    total = len(sweep.cases)
    said = f"trajectories over {named(sweep.axes)}"
    if chosen < total:
        said += f", {drawn} of {total}"
    return f"{plain(sweep.title or sweep.name)}\n{plain(said)}"
