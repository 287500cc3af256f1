"""The generating functions as a picture: their shapes, what a jump becomes, saturation by variance.

Curves are those of the weights that a control has; where a variance is refused, there are none.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from quito_cli.plots.palette import BOUND, COLOURS
from quito_cli.transcription.generating import CUT
from quito_cli.transcription.qualities import Qualities, allowed, jump, saturation

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_REACH = 4.0
"""Of the shapes and of the jump, in units of √D."""
_VARIANCES = np.geomspace(0.25, 8, 181)
_STYLES = ("-", "-", "--", "-", ":", "-")
"""Of the six: 3 and 5 nearly coincide with one another."""


def figure(rows: tuple[Qualities, ...], variance: float, normalised: bool, limit: float) -> Figure:
    """Return the figure of all rows.

    Args:
        rows: the functions.
        variance: of the jump; marked where saturation is drawn.
        normalised: the weights are.
        limit: of the saturation, drawn as a line.
    """
    from matplotlib.figure import Figure

    drawn = Figure(figsize=(12, 4.6), layout="constrained")
    shapes, jumps, errors = drawn.subplots(1, 3)
    _shapes(shapes, rows)
    _jumps(jumps, rows, variance, normalised)
    _saturation(errors, rows, variance, normalised, limit)
    for axes in (shapes, jumps, errors):
        axes.grid(alpha=0.25)
        axes.margins(x=0.01)
    weights = "normalised" if normalised else "as printed"
    drawn.suptitle(f"Generating functions, variance {variance:g}, weights {weights}")
    handles, labels = shapes.get_legend_handles_labels()
    drawn.legend(
        handles=handles, labels=labels, loc="outside lower center", ncols=len(rows), frameon=False
    )
    return drawn


def _style(row: Qualities) -> dict[str, Any]:
    number = row.function.number
    return {
        "color": COLOURS[number - 1],
        "linestyle": _STYLES[number - 1],
        "label": f"{number} {row.function.name}",
    }


def _shapes(axes: Axes, rows: tuple[Qualities, ...]) -> None:
    x = np.linspace(-_REACH, _REACH, 801)
    for row in rows:
        axes.plot(x, row.function.value(x), **_style(row))
    axes.set_xlabel("x")
    axes.set_title("ψ(x)", fontsize="medium")


def _jumps(axes: Axes, rows: tuple[Qualities, ...], variance: float, normalised: bool) -> None:
    room = _REACH * np.sqrt(variance)
    axes.plot([-room, 0, 0, room], [0, 0, 1, 1], color=BOUND, linewidth=0.9, linestyle=":")
    for row in rows:
        if row.width is not None:
            s, u = jump(row.function, variance, normalised)
            near = np.abs(s) <= room
            axes.plot(s[near], u[near], **_style(row))
    axes.set_xlabel("cells")
    axes.set_title("Control whose coefficients jump", fontsize="medium")


def _saturation(
    axes: Axes,
    rows: tuple[Qualities, ...],
    variance: float,
    normalised: bool,
    limit: float,
) -> None:
    for row in rows:
        taken = [D for D in _VARIANCES if allowed(row.function, D)]
        errors = [saturation(row.function, D, normalised) for D in taken]
        axes.plot(taken, errors, **_style(row))
    axes.axhline(limit, color=BOUND, linewidth=0.9, linestyle=":")
    axes.annotate(
        f"warned of above {limit:g}",
        (0.02, limit),
        xycoords=("axes fraction", "data"),
        xytext=(0, -4),
        textcoords="offset points",
        va="top",
        fontsize="small",
        color=BOUND,
    )
    axes.axvline(variance, color=BOUND, linewidth=0.9, linestyle=":")
    axes.set_yscale("log")
    axes.set_ylim(10 * CUT, 1)  # less is of the cut of ψ, not of ψ
    axes.set_xscale("log", base=2)
    axes.set_xticks([0.25, 0.5, 1, 2, 4, 8], ["1/4", "1/2", "1", "2", "4", "8"])
    axes.set_xlabel("variance D")
    axes.set_title("Saturation error", fontsize="medium")
