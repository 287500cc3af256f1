"""Solution -> matplotlib Figure, by matplotlib's object interface: no display, no global state.

A panel is a row of the table `PANELS`: a list of curves drawn from a Solution. A picture stacks the
panels asked for, one small plot a curve.
"""

from __future__ import annotations

import logging
import math
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.errors import UsageError
from quito_cli.plots.palette import BOUND, KNOWN, OURS, plain
from quito_cli.plots.plan import draw_plan
from quito_cli.solution.solution import Drawing, Quantity, Solution
from quito_cli.solution.store import write_aside

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

_COLUMNS = 3
_CURVE_HEIGHT, _PLAN_HEIGHT = 2.2, 4.8
"""Of a row, in inches."""
_NEAR = 0.6
"""A bound further than this fraction of a curve's span from it is not drawn."""


@dataclass(frozen=True)
class Curve:
    """One small plot."""

    label: str
    times: Array
    values: Array
    known: Array | None
    """The reference at the same times; NaN where unknown."""
    lower: float
    upper: float
    all_bounds: bool = False
    """Draw the bounds however far they are."""
    steps: bool = False
    logarithmic: bool = False


Panel = Curve | Drawing


def _curves(
    solution: Solution,
    quantities: tuple[Quantity, ...],
    values: Array,
    known: Array | None,
    all_bounds: bool,
) -> list[Panel]:
    times = solution.dense_times
    curves: list[Panel] = []
    for i, quantity in enumerate(quantities):
        unit = f" [{plain(quantity.unit)}]" if quantity.unit else ""
        reference = None if known is None or np.isnan(known[:, i]).all() else known[:, i]
        bounds = quantity.lower, quantity.upper
        label = quantity.name + unit
        curves.append(Curve(label, times, values[:, i], reference, *bounds, all_bounds))
    return curves


def _states(solution: Solution) -> list[Panel]:
    known = solution.reference.states if solution.reference else None
    values = solution.state(solution.dense_times)
    return _curves(solution, solution.origin.states, values, known, False)


def _controls(solution: Solution) -> list[Panel]:
    known = solution.reference.controls if solution.reference else None
    values = solution.control(solution.dense_times)
    return _curves(solution, solution.origin.controls, values, known, True)


def _costates(solution: Solution) -> list[Panel]:
    values = solution.costate(solution.dense_times)
    return [
        Curve(f"λ of {q.name}", solution.dense_times, values[:, i], None, -np.inf, np.inf)
        for i, q in enumerate(solution.origin.states)
    ]


def _mesh(solution: Solution) -> list[Panel]:
    steps = np.diff(solution.times)
    lengths = np.append(steps, steps[-1])
    no_bounds = (-np.inf, np.inf, False)
    return [Curve("length of the cells", solution.times, lengths, None, *no_bounds, True, True)]


PANELS: dict[str, Callable[[Solution], list[Panel]]] = {
    "states": _states,
    "controls": _controls,
    "costates": _costates,
    "mesh": _mesh,
    "plan": lambda solution: list(solution.drawings),
}
DEFAULT = ("states", "controls", "plan")
"""What a picture shows unless told otherwise."""


def figure(solution: Solution, panels: Iterable[str]) -> Figure:
    """Return the figure of `panels`, names of `PANELS` in the order wanted.

    Raises:
        UsageError: there is nothing to draw in them.
    """
    from matplotlib.figure import Figure

    groups = [PANELS[name](solution) for name in panels]
    rows = [row for group in groups for row in _rows(group)]
    if not rows:
        raise UsageError(f"the problem has no {' or '.join(panels)} to draw")
    columns = max(len(row) for row in rows)
    heights = [_PLAN_HEIGHT if isinstance(row[0], Drawing) else _CURVE_HEIGHT for row in rows]
    size = 1.2 + 3.6 * max(columns, 2), 1.1 + sum(heights)
    drawn = Figure(figsize=size, layout="constrained")
    units = math.lcm(*(len(row) for row in rows))
    grid = drawn.add_gridspec(len(rows), units, height_ratios=heights)
    last = max((i for i, row in enumerate(rows) if isinstance(row[0], Curve)), default=-1)
    for i, row in enumerate(rows):
        width = units // len(row)
        for j, panel in enumerate(row):
            place = grid[i, j * width : (j + 1) * width]
            if isinstance(panel, Drawing):
                flat = len(panel.labels) == 2
                draw_plan(drawn.add_subplot(place, projection=None if flat else "3d"), panel)
                continue
            axes = drawn.add_subplot(place)
            _draw(axes, panel)
            if i == last:
                axes.set_xlabel("t")
    drawn.suptitle(_heading(solution))
    _legend(drawn)
    return drawn


def _rows(group: Sequence[Panel]) -> list[Sequence[Panel]]:
    """Return rows of nearly equal length: four plots stand two by two, not three and one."""
    count = math.ceil(len(group) / _COLUMNS)
    ends = [math.ceil(len(group) * (i + 1) / max(count, 1)) for i in range(count)]
    return [group[start:end] for start, end in zip([0, *ends], ends, strict=False)]


def _heading(solution: Solution) -> str:
    failed = "" if solution.success else "NOT SOLVED: "
    title = solution.origin.title or solution.origin.name
    return f"{failed}{plain(title)}\ncost {solution.cost:.8g}, {len(solution.times) - 1} cells"


def _draw(axes: Axes, curve: Curve) -> None:
    style = "steps-post" if curve.steps else "default"
    axes.plot(curve.times, curve.values, color=OURS, linewidth=1.6, label="quito", drawstyle=style)
    if curve.known is not None:
        axes.plot(
            curve.times, curve.known, color=KNOWN, linewidth=1.2, linestyle="--", label="reference"
        )
    finite = curve.values[np.isfinite(curve.values)]
    low, high = (finite.min(), finite.max()) if finite.size else (0.0, 1.0)
    reach = np.inf if curve.all_bounds else _NEAR * max(high - low, 1e-12)
    for bound in (curve.lower, curve.upper):
        if np.isfinite(bound) and low - reach <= bound <= high + reach:
            axes.axhline(bound, color=BOUND, linewidth=0.9, linestyle=":", label="bound")
    if curve.logarithmic:
        axes.set_yscale("log")
        axes.set_ylim(low / 3, high * 3)
    elif high - low <= 1e-9 * max(abs(high), 1.0):  # rounding is no shape
        axes.set_ylim(low - 0.5 * max(abs(low), 1.0), high + 0.5 * max(abs(high), 1.0))
    axes.set_ylabel(curve.label)
    axes.grid(alpha=0.25)
    axes.margins(x=0.01)


def _legend(drawn: Figure) -> None:
    """One legend for all plots, each entry once, and only where there is more than one."""
    entries: dict[str, Artist] = {}
    for axes in drawn.axes:
        if axes.get_legend() is not None:  # a plan with names of its own
            continue
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            entries.setdefault(str(label), handle)
    if len(entries) > 1:
        drawn.legend(
            handles=list(entries.values()),
            labels=list(entries),
            loc="outside lower center",
            ncols=len(entries),
            frameon=False,
        )


def draw(solution: Solution, panels: Iterable[str], path: Path) -> None:
    """Write the figure of `panels`; the ending of `path` is its format.

    Raises:
        ResultFileError: the file cannot be written.
    """
    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # no word on fonts being looked for
    drawn = figure(solution, panels)
    dateless = {"Date": None} if path.suffix == ".svg" else {}
    if path.suffix == ".pdf":
        dateless = {"CreationDate": None}
    with warnings.catch_warnings():  # a title may have letters that the font has not
        warnings.filterwarnings("ignore", "Glyph .* missing from font")
        write_aside(path, lambda aside: drawn.savefig(aside, dpi=150, metadata=dateless))
