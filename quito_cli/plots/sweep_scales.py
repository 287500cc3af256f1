"""How the axes of a sweep are drawn: places on a plot, and colours and dashes of curves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from quito_cli.plots.layout import legend_columns
from quito_cli.plots.palette import COLOURS, plain

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure

    from quito_cli.batch.axes import Axis

Array = NDArray[np.float64]

MAP: Final = "viridis"
_DARKEST, _PALEST = 0.0, 0.88
"""Of the colours of the map, for lines: the palest are not seen on white."""
_FEW: Final = 6
"""Values told apart by colours of their own; more have a colour bar."""
_LONGEST: Final = 24
"""Characters of all values of a logarithmic axis that have room at its ticks."""
_DASHES: Final[tuple[Any, ...]] = ("-", (0, (6, 2)), (0, (2, 1)), (0, (6, 1.5, 1.5, 1.5)))


def positions(axis: Axis) -> Array:
    """Return where the values stand: at themselves, or side by side where they are names."""
    return np.array(axis.values if axis.numeric else range(len(axis.values)), dtype=float)


def edges(axis: Axis) -> Array:
    """Return the ends of the cells around the values, halfway between them."""
    at = np.log(positions(axis)) if _logarithmic(axis) else positions(axis)
    between = (at[1:] + at[:-1]) / 2
    ends = np.concatenate([[2 * at[0] - between[0]], between, [2 * at[-1] - between[-1]]])
    return np.exp(ends) if _logarithmic(axis) else ends


def _logarithmic(axis: Axis) -> bool:
    """Whether it is drawn so: negative values are not."""
    return axis.logarithmic and bool((positions(axis) > 0).all())


def scale(plot: Axes, side: Literal["x", "y"], axis: Axis) -> None:
    """Give a side of a plot the name, the scale and the ticks of an axis."""
    drawn = plot.xaxis if side == "x" else plot.yaxis
    drawn.set_label_text(plain(axis.name))
    if not axis.numeric:
        drawn.set_ticks(positions(axis), labels=[plain(label) for label in axis.labels])
    elif _logarithmic(axis):
        (plot.set_xscale if side == "x" else plot.set_yscale)("log")
        if len("".join(axis.labels)) <= _LONGEST:
            drawn.set_ticks(positions(axis), labels=[plain(label) for label in axis.labels])
            drawn.set_ticks([], minor=True)
    elif all(isinstance(value, int) for value in axis.values):
        from matplotlib.ticker import MaxNLocator

        drawn.set_major_locator(MaxNLocator(integer=True, nbins=6))


def named(axes: Sequence[Axis]) -> str:
    """Return the names of axes as a sentence has them."""
    names = [axis.name for axis in axes]
    return " and ".join([*([", ".join(names[:-1])] if names[1:] else []), names[-1]])


@dataclass(frozen=True)
class Hue:
    """How curves are told apart that stand at different places on some axes."""

    axes: tuple[Axis, ...]
    by_colour: int
    """The axis that colours stand for."""
    colours: tuple[Any, ...]
    """Of its values."""
    mappable: ScalarMappable | None
    """For a colour bar; None where each colour has a name of its own."""

    @property
    def name(self) -> str:
        """What colours stand for."""
        return self.axes[self.by_colour].name

    @property
    def _dashed(self) -> list[int]:
        return [i for i in range(len(self.axes)) if i != self.by_colour]

    @property
    def _dashes(self) -> dict[tuple[int, ...], Any]:
        """By place on the other axes."""
        places = product(*(range(len(self.axes[i].values)) for i in self._dashed))
        return {place: _DASHES[n % len(_DASHES)] for n, place in enumerate(places)}

    def look(self, place: tuple[int, ...]) -> dict[str, Any]:
        """Return colour and dashes at a place on the axes."""
        rest = tuple(place[i] for i in self._dashed)
        return {"color": self.colours[place[self.by_colour]], "linestyle": self._dashes[rest]}

    def entries(self) -> dict[str, Artist]:
        """Return what a legend has to say, by its text."""
        from matplotlib.lines import Line2D

        found: dict[str, Artist] = {}
        axis = self.axes[self.by_colour]
        if self.mappable is None:
            for colour, label in zip(self.colours, axis.labels, strict=True):
                found[plain(f"{axis.name} = {label}")] = Line2D([], [], color=colour)
        dashes = self._dashes
        if 1 < len(dashes) <= len(_DASHES):
            for place, dash in dashes.items():
                parts = zip(self._dashed, place, strict=True)
                text = ", ".join(
                    f"{self.axes[i].name} = {self.axes[i].labels[n]}" for i, n in parts
                )
                found[plain(text)] = Line2D([], [], color="#666666", linestyle=dash)
        return found


def coloured(axes: Sequence[Axis]) -> Hue:
    """Return how curves at different places on axes are told apart.

    Args:
        axes: one at least; that of them which is finest is told by colours.
    """
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, LogNorm, Normalize

    n = max(range(len(axes)), key=lambda i: (axes[i].numeric, len(axes[i].values), -i))
    axis = axes[n]
    if len(axis.values) <= _FEW or not axis.numeric:
        count = len(axis.values)
        return Hue(tuple(axes), n, tuple(COLOURS[i % len(COLOURS)] for i in range(count)), None)
    at = positions(axis)
    shades = ListedColormap(colormaps[MAP](np.linspace(_DARKEST, _PALEST, 256)))
    norm = (LogNorm if _logarithmic(axis) else Normalize)(at.min(), at.max())
    bar = ScalarMappable(norm, shades)
    return Hue(tuple(axes), n, tuple(bar.to_rgba(value) for value in at), bar)


def explain(
    drawn: Figure, hue: Hue | None, plots: Sequence[Axes], marks: Mapping[str, Artist]
) -> None:
    """Say in a legend, and by a colour bar, what is drawn.

    Args:
        drawn: the figure.
        hue: how its curves are told apart.
        plots: those that have curves.
        marks: what else is drawn, by its name.
    """
    entries = dict(marks)
    if hue is not None and plots:
        entries = hue.entries() | entries
        if hue.mappable is not None:
            drawn.colorbar(hue.mappable, ax=plots, label=plain(hue.name), pad=0.01)
    if entries:
        drawn.legend(
            handles=list(entries.values()),
            labels=list(entries),
            loc="outside lower center",
            ncols=legend_columns(list(entries), drawn.get_figwidth()),
            frameon=False,
        )
