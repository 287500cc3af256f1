"""A sweep -> matplotlib Figures: chosen figures over its axes; the trajectories over one another.

Over one axis a figure is a curve with a point for each case. Over two fine axes it is a map, with
contours; over others a family of curves along the finest axis. What was not solved is marked where
it would be. Trajectories are coloured by the finest axis; what other axes there are is told by
dashes. A figure that spans decades has a logarithmic scale.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from quito_cli.plots.figure import write
from quito_cli.plots.layout import balanced, places
from quito_cli.plots.palette import BOUND, COLOURS, OURS, plain
from quito_cli.plots.sweep_scales import MAP, Hue, coloured, edges, explain, named, positions, scale
from quito_cli.plots.sweep_trajectories import trajectories

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from quito_cli.batch.suite.axes import Axis
    from quito_cli.batch.sweeps.sweep import Swept

Array = NDArray[np.float64]

_COLUMNS: Final = 3
_WIDTH, _HEIGHT = 4.0, 2.9
"""Of a plot, in inches."""
_FINE: Final = 4
"""Values of either axis of a map, at least."""
_DECADES: Final = 100.0
"""A figure whose largest value is this many times its smallest has a logarithmic scale."""
_MARK: Final[dict[str, Any]] = {"linestyle": "none", "marker": "x", "markersize": 6}
_FOOT: Final = 0.03
"""Height at which what was not solved is marked, as a fraction of the plot's."""


@dataclass(frozen=True)
class _Cases:
    """What is drawn in each plot."""

    swept: Swept
    along: int
    """The axis that is drawn along."""
    solved: NDArray[np.bool_]
    """The shape of the sweep."""

    @property
    def others(self) -> tuple[int, ...]:
        return tuple(i for i in range(len(self.swept.sweep.axes)) if i != self.along)

    @property
    def families(self) -> list[tuple[int | slice, ...]]:
        """The index of each curve: a slice along the axis, a place on every other one."""
        ranges: list[Any] = [range(size) for size in self.swept.sweep.shape]
        ranges[self.along] = (slice(None),)
        return list(product(*ranges))


def draw_all(swept: Swept, names: Sequence[str], folder: Path, ending: str) -> tuple[Path, ...]:
    """Write the figures that have something to show, and return their paths.

    Args:
        swept: what to draw.
        names: of the figures to draw over the axes.
        folder: where to; files are `<problem>-sweep.png` and `<problem>-sweep-trajectories.png`.
        ending: the format: png, svg or pdf.

    Raises:
        ResultFileError: a file cannot be written, or the result of a case cannot be read.
    """
    paths = []
    for suffix, drawn in (("", figures(swept, names)), ("-trajectories", trajectories(swept))):
        if drawn is not None:
            path = folder / f"{swept.sweep.name}-sweep{suffix}.{ending}"
            write(drawn, path)
            paths.append(path)
    return tuple(paths)


def finest(axes: Sequence[Axis]) -> int:
    """Return the axis that things are drawn along: of those with numbers the longest."""
    return max(range(len(axes)), key=lambda i: (axes[i].numeric, len(axes[i].values), -i))


def figures(swept: Swept, names: Sequence[str]) -> Figure | None:
    """Return the figures `names` over the axes; None where none of them is known as a number."""
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    axes = swept.sweep.axes
    grids = [(name, grid) for name in names if (grid := swept.grid(name)) is not None]
    grids = [(name, grid) for name, grid in grids if np.isfinite(grid).any()]
    if not grids:
        return None
    rows = balanced(grids, _COLUMNS)
    columns = max(map(len, rows))
    size = 1.2 + _WIDTH * columns, 1.1 + _HEIGHT * len(rows)
    drawn = Figure(figsize=(max(size[0], 7.0), size[1]), layout="constrained")
    solved = np.array(swept.solved).reshape(swept.sweep.shape)
    cases = _Cases(swept, finest(axes), solved)
    fine = len(axes) == 2 and all(a.numeric and len(a.values) >= _FINE for a in axes)
    hue = coloured([axes[i] for i in cases.others]) if len(axes) > 1 else None
    curves = []
    for _, _, (name, grid), place in places(drawn, rows, [1.0] * len(rows)):
        plot = drawn.add_subplot(place)
        if fine and grid.ndim == 2:
            _map(plot, swept, grid, solved)
            plot.set_title(name.replace("_", " "))
        else:
            _curves(plot, cases, grid, hue)
            plot.set_ylabel(name.replace("_", " "))
            curves.append(plot)
    drawn.suptitle(_heading(swept))
    marks = {} if solved.all() else {"not solved": Line2D([], [], color=BOUND, **_MARK)}
    explain(drawn, hue, curves, marks)
    return drawn


def _heading(swept: Swept) -> str:
    """Return the title, and what was swept over."""
    sweep = swept.sweep
    given = "".join(f", {name} = {value}" for name, value in sweep.constants.items())
    failed = swept.solved.count(False)
    left = f", {failed} of {len(swept.solved)} not solved" if failed else ""
    return f"{plain(sweep.title or sweep.name)}\n{plain(f'over {named(sweep.axes)}{given}{left}')}"


def _decades(values: Array) -> bool:
    """Whether the finite values are positive and span decades."""
    some = values[np.isfinite(values)]
    return bool(some.size and some.min() > 0 and some.max() >= _DECADES * some.min())


def _curves(plot: Axes, cases: _Cases, grid: Array, hue: Hue | None) -> None:
    """Draw a figure along the finest axis, a curve for each place on the other ones."""
    axis = cases.swept.sweep.axes[cases.along]
    x = positions(axis)
    for index in cases.families:
        values = grid[index].reshape(len(x), -1)
        look = _look(cases, index, hue)
        joined = {"linestyle": "none"}  # names have no order, and of several times some come and go
        if axis.numeric and values.shape[1] == 1:
            joined = {}
        for column in values.T:
            plot.plot(x, column, marker="o", markersize=3.5, linewidth=1.2, **look | joined)
        missing = ~cases.solved[index]
        if missing.any():
            foot = plot.get_xaxis_transform()
            at = x[missing]
            look |= {"color": COLOURS[1]} if hue is None else {}
            plot.plot(at, np.full(len(at), _FOOT), transform=foot, clip_on=False, **look | _MARK)
    if _decades(grid):
        plot.set_yscale("log")
    scale(plot, "x", axis)
    plot.grid(alpha=0.25)


def _look(cases: _Cases, index: tuple[int | slice, ...], hue: Hue | None) -> dict[str, Any]:
    if hue is None:
        return {"color": OURS}
    return hue.look(tuple(int(place) for place in index if not isinstance(place, slice)))


def _map(plot: Axes, swept: Swept, grid: Array, solved: NDArray[np.bool_]) -> None:
    """Draw a figure as a map, the first axis to the right."""
    from matplotlib.colors import LogNorm

    first, second = swept.sweep.axes
    norm = LogNorm() if _decades(grid) else None
    known = np.ma.masked_invalid(grid.T)
    mesh = plot.pcolormesh(edges(first), edges(second), known, cmap=MAP, norm=norm)
    x, y = positions(first), positions(second)
    if len(np.unique(known.compressed())) == known.count():  # counts and zeros have no contours
        plot.contour(x, y, known, colors="white", linewidths=0.7, alpha=0.7, norm=norm)
    plot.set_facecolor("#EEEEEE")
    missing = np.argwhere(~solved)
    plot.plot(x[missing[:, 0]], y[missing[:, 1]], color=COLOURS[1], **_MARK)
    scale(plot, "x", first)
    scale(plot, "y", second)
    bar = plot.figure.colorbar(mesh, ax=plot)
    bar.outline.set_visible(False)
