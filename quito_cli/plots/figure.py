"""Solution -> matplotlib Figure, by matplotlib's object interface: no display, no global state.

A panel is a row of the table `PANELS`: a list of curves drawn from a Solution. A picture stacks the
panels asked for, one small plot a curve.
"""

from __future__ import annotations

import logging
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.errors import UsageError
from quito_cli.plots.history import History, histories
from quito_cli.plots.layout import balanced, places, shared, with_unit
from quito_cli.plots.palette import BOUND, COLOURS, JUNCTION, KNOWN, OURS, plain
from quito_cli.plots.plan import draw_plan
from quito_cli.solution.junctions import Junction
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
_NEAR, _FAR = 0.6, 2.0
"""Bounds further than this many spans of a state, or sizes of a control, are not drawn."""
_MOST_MARKS = 36
"""Jumps and kinks marked in a plot: the highest."""


@dataclass(frozen=True)
class Line:
    """A quantity over time."""

    name: str
    values: Array
    known: Array | None = None
    """The reference at the same times; NaN where unknown."""
    lower: float = -np.inf
    upper: float = np.inf


@dataclass(frozen=True)
class Curve:
    """One small plot: a line, or those of a vector."""

    label: str
    times: Array
    lines: tuple[Line, ...]
    far_bounds: bool = False
    """Draw bounds that are not near too."""
    steps: bool = False
    logarithmic: bool = False
    marks: tuple[Junction, ...] = ()
    """Jumps and kinks of its lines."""


Panel = Curve | Drawing | History


def _curves(
    solution: Solution,
    quantities: tuple[Quantity, ...],
    values: Array,
    known: Array | None,
    far_bounds: bool,
    junctions: tuple[Junction, ...] = (),
) -> list[Panel]:
    """Return a plot for each entry, or where there are many, for each vector."""
    curves: list[Panel] = []
    for name, members in shared(quantities).items():
        lines = []
        for i in members:
            reference = None if known is None or np.isnan(known[:, i]).all() else known[:, i]
            q = quantities[i]
            lines.append(Line(q.name, values[:, i], reference, q.lower, q.upper))
        label = with_unit(name, quantities[members[0]].unit)
        marks = tuple(j for j in junctions if j.control in members)
        curves.append(Curve(label, solution.dense_times, tuple(lines), far_bounds, marks=marks))
    return curves


def _states(solution: Solution) -> list[Panel]:
    known = solution.reference.states if solution.reference else None
    values = solution.state(solution.dense_times)
    return _curves(solution, solution.origin.states, values, known, False)


def _controls(solution: Solution) -> list[Panel]:
    known = solution.reference.controls if solution.reference else None
    values = solution.control(solution.dense_times)
    quantities, found = solution.origin.controls, solution.junctions
    return _curves(solution, quantities, values, known, True, found)


def _costates(solution: Solution) -> list[Panel]:
    duals = tuple(
        Quantity(f"λ of {state.name}", "", -np.inf, np.inf) for state in solution.origin.states
    )
    return _curves(solution, duals, solution.costate(solution.dense_times), None, False)


def _mesh(solution: Solution) -> list[Panel]:
    if solution.refinement is not None:
        return list(histories(solution))
    steps = np.diff(solution.times)
    lengths = Line("length of the cells", np.append(steps, steps[-1]))
    return [Curve(lengths.name, solution.times, (lengths,), steps=True, logarithmic=True)]


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
    last = max((i for i, row in enumerate(rows) if isinstance(row[0], Curve)), default=-1)
    for i, _, panel, place in places(drawn, rows, heights):
        if isinstance(panel, Drawing):
            flat = len(panel.labels) == 2
            draw_plan(drawn.add_subplot(place, projection=None if flat else "3d"), panel)
            continue
        axes = drawn.add_subplot(place)
        if isinstance(panel, History):
            panel.draw(axes)
            continue
        _draw(axes, panel)
        if i == last:
            axes.set_xlabel("t")
    drawn.suptitle(_heading(solution))
    _legend(drawn)
    return drawn


def _rows(group: Sequence[Panel]) -> list[Sequence[Panel]]:
    """Return the rows of a group; the meshes over time take all of one."""
    if group and isinstance(group[0], History):
        return [row for row in (group[:1], group[1:]) if row]
    return balanced(group, _COLUMNS)


def _heading(solution: Solution) -> str:
    failed = "" if solution.success else "NOT SOLVED: "
    title = solution.origin.title or solution.origin.name
    changed = "".join(
        f", {plain(name)} = {plain(value)}" for name, value in solution.origin.changes
    )
    cells = len(solution.times) - 1
    return f"{failed}{plain(title)}\ncost {solution.cost:.8g}, {cells} cells{changed}"


def _draw(axes: Axes, curve: Curve) -> None:
    several = len(curve.lines) > 1
    style = "steps-post" if curve.steps else "default"
    drawn: list[Artist] = []
    for i, line in enumerate(curve.lines):
        colour, name = (COLOURS[i % len(COLOURS)], plain(line.name)) if several else (OURS, "quito")
        drawn += axes.plot(curve.times, line.values, color=colour, label=name, drawstyle=style)
        if line.known is not None:
            axes.plot(curve.times, line.known, "--", color=KNOWN, linewidth=1.2, label="reference")
    _mark(axes, curve.marks)
    low, high = _range(curve)
    for bound in sorted({b for line in curve.lines for b in (line.lower, line.upper)}):
        if low - _reach(curve, low, high) <= bound <= high + _reach(curve, low, high):
            axes.axhline(bound, color=BOUND, linewidth=0.9, linestyle=":", label="bound")
    if curve.logarithmic:
        axes.set_yscale("log")
        axes.set_ylim(low / 3, high * 3)
    elif high - low <= 1e-9 * max(abs(high), 1.0):  # rounding is no shape
        axes.set_ylim(low - 0.5 * max(abs(low), 1.0), high + 0.5 * max(abs(high), 1.0))
    axes.set_ylabel(curve.label)
    axes.grid(alpha=0.25)
    axes.margins(x=0.01)
    if several:
        axes.legend(handles=drawn, frameon=False, fontsize="small")


def _mark(axes: Axes, junctions: tuple[Junction, ...]) -> None:
    """Mark where jumps and kinks are, and shade how uncertain that is."""
    highest = sorted(junctions, key=lambda one: -abs(one.after - one.before))
    for one in highest[:_MOST_MARKS]:
        ends = one.time - one.uncertainty, one.time + one.uncertainty
        axes.axvspan(*ends, color=JUNCTION, alpha=0.12, linewidth=0, zorder=0.5)
        label = "jump or kink"
        axes.axvline(one.time, color=JUNCTION, linewidth=0.9, linestyle=":", label=label, zorder=1)


def _range(curve: Curve) -> tuple[float, float]:
    """Return the least and the largest value drawn."""
    values = np.concatenate([line.values for line in curve.lines])
    finite = values[np.isfinite(values)]
    return (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)


def _reach(curve: Curve, low: float, high: float) -> float:
    """Return how far from the values a bound may be to be drawn."""
    if curve.far_bounds:
        return _FAR * max(high - low, abs(low), abs(high)) or 1e300
    return _NEAR * max(high - low, 1e-12)


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
    write(figure(solution, panels), path)


def write(drawn: Figure, path: Path) -> None:
    """Write a figure; the ending of `path` is its format.

    Raises:
        ResultFileError: the file cannot be written.
    """
    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # no word on fonts being looked for
    dateless = {"Date": None} if path.suffix == ".svg" else {}
    if path.suffix == ".pdf":
        dateless = {"CreationDate": None}
    with warnings.catch_warnings():  # a title may have letters that the font has not
        warnings.filterwarnings("ignore", "Glyph .* missing from font")
        write_aside(path, lambda aside: drawn.savefig(aside, dpi=150, metadata=dateless))
