"""How an adaptive mesh came about, as pictures: its cells over time, cost and estimates by mesh."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from quito_cli.plots.palette import BOUND, COLOURS, KNOWN, OURS
from quito_cli.solution.rounds import Refinement
from quito_cli.solution.solution import Solution

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

_PALEST = 0.25
"""Opacity of the first mesh."""
_NAMED = 8
"""More meshes than this, and only the first, the kept and the last are named."""
_AIR = 2.0
"""Between lengths and frame, as a factor."""
_BESIDE: dict[str, Any] = {
    "loc": "center left",
    "bbox_to_anchor": (1.0, 0.5),
    "frameon": False,
    "fontsize": "small",
}
"""Place of a legend."""
_WIDE = 1.6
"""Line of the mesh that was kept."""
_ROUNDING = 1e-16
"""Of the cost's size: differences of costs that are no more than that are none."""


@dataclass(frozen=True)
class History:
    """A plot of the rounds of a refinement."""

    name: str
    solution: Solution
    refinement: Refinement
    drawn_by: Callable[[Axes, Solution, Refinement], None]

    def draw(self, axes: Axes) -> None:
        """Draw it."""
        self.drawn_by(axes, self.solution, self.refinement)
        axes.set_yscale("log")
        axes.set_ylabel(self.name)
        axes.grid(alpha=0.25)


def histories(solution: Solution) -> tuple[History, ...]:
    """Return the plots of how the mesh was found, the one over time first; none of a uniform one.

    Where there was one mesh only, that is all there is.
    """
    how = solution.refinement
    if how is None:
        return ()
    found = [History("length of the cells", solution, how, _lengths)]
    if len(how.rounds) > 1:
        found.append(History("|cost − its last value|", solution, how, _costs))
        found.append(History("estimates, of the range", solution, how, _estimates))
    return tuple(found)


def _lengths(axes: Axes, solution: Solution, how: Refinement) -> None:
    count = len(how.rounds)
    for i, one in enumerate(how.rounds):
        kept, steps = i == how.kept, np.diff(one.nodes)
        named = kept or i in (0, count - 1) or count <= _NAMED
        name = f"mesh {i + 1}, {one.cells} cells{', kept' if kept else ''}" if named else ""
        axes.plot(
            one.nodes,
            np.append(steps, steps[-1]),
            drawstyle="steps-post",
            color=KNOWN if kept else OURS,
            linewidth=_WIDE if kept else 1.0,
            alpha=1.0 if kept else _PALEST + (1 - _PALEST) * i / count,
            zorder=3 if kept else 2,
            label=name or "_",
        )
    axes.set_xlabel("t")
    axes.margins(x=0.01)
    lengths = np.concatenate([np.diff(one.nodes) for one in how.rounds])
    axes.set_ylim(lengths.min() / _AIR, lengths.max() * _AIR)
    axes.legend(**_BESIDE)


def _costs(axes: Axes, solution: Solution, how: Refinement) -> None:
    last = how.rounds[-1].resimulated_cost
    for name, colour, values in (
        ("of the program", COLOURS[4], [one.cost for one in how.rounds]),
        ("re-simulated", COLOURS[0], [one.resimulated_cost for one in how.rounds[:-1]]),
    ):
        away = np.abs(np.array(values) - last)
        _by_mesh(axes, np.where(away > _ROUNDING * abs(last), away, np.nan), name, colour)
    _finish(axes, len(how.rounds))
    axes.legend(
        loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, frameon=False, fontsize="small"
    )


def _estimates(axes: Axes, solution: Solution, how: Refinement) -> None:
    changes = np.array([one.change for one in how.rounds])
    blurs = np.array([one.blur for one in how.rounds])
    _by_mesh(axes, np.where(changes > 0, changes, np.nan), "change from mesh to mesh", COLOURS[0])
    _by_mesh(axes, np.where(blurs > 0, blurs, np.nan), "jumps, in L²", COLOURS[3])
    if how.account is not None and how.account.control > 0:
        axes.plot(
            [how.kept + 1],
            [how.account.control],
            "D",
            color=KNOWN,
            markersize=6,
            label="estimated error",
        )
    tolerance = float(solution.options["mesh_tolerance"])
    axes.axhline(tolerance, color=BOUND, linewidth=0.9, linestyle=":", label="tolerance")
    _finish(axes, len(how.rounds))
    axes.legend(**_BESIDE)


def _by_mesh(axes: Axes, values: Array, name: str, colour: str) -> None:
    if np.isfinite(values).any():
        numbers = np.arange(1, len(values) + 1)
        axes.plot(numbers, values, "o-", color=colour, markersize=4, linewidth=1.2, label=name)


def _finish(axes: Axes, count: int) -> None:
    from matplotlib.ticker import MaxNLocator

    axes.set_xlim(0.7, count + 0.3)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_xlabel("mesh")
