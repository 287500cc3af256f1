"""The plots a file asks for: curves against each other in a plane or in space, among obstacles."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from quito_cli.plots.palette import COLOURS, OBSTACLE, plain
from quito_cli.problem.shapes import Ball
from quito_cli.solution.solution import Drawing

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

FAR = 1e100
"""Coordinates beyond this are no place on a picture."""
LARGE = 1e4
"""Balls so much larger than the frame are not drawn: their edge is no curve any more."""
_FACES = ((0, 1), (1, 2), (0, 2))
"""The axes along a box's faces."""


def draw_plan(axes: Axes, drawing: Drawing) -> None:
    """Draw curves with their starts (rings) and ends (dots), and the obstacles."""
    if frame := _frame(drawing):
        _obstacles(axes, drawing, *frame)
    lines: list[Artist] = []
    for i, curve in enumerate(drawing.curves.values()):
        points = np.where(np.abs(curve) < FAR, curve, np.nan)
        colour = COLOURS[i % len(COLOURS)]
        lines += axes.plot(*points.T, color=colour, linewidth=1.8)
        for place, face in ((points[:1], "white"), (points[-1:], colour)):
            axes.plot(*place.T, "o", color=colour, markerfacecolor=face, zorder=5)
    for letter, text in zip("xyz", drawing.labels, strict=False):
        getattr(axes, f"set_{letter}label")(plain(text))
    axes.set_title(plain(drawing.title), fontsize="medium")
    axes.grid(alpha=0.25)
    if len(drawing.curves) > 1:
        names = [plain(name) for name in drawing.curves]
        axes.legend(lines, names, frameon=False, fontsize="small")


def _in_space(drawing: Drawing) -> bool:
    return len(drawing.labels) == 3


def _frame(drawing: Drawing) -> tuple[Array, Array] | None:
    """Return the corners of a square or cube around the curves; None without obstacles."""
    points = np.vstack(list(drawing.curves.values()))
    points = points[(np.abs(points) < FAR).all(axis=1)]  # not what is undefined or overflows
    if not len(points) or not (drawing.balls or drawing.blocks):
        return None
    low, high = points.min(axis=0), points.max(axis=0)
    reach = 0.65 * max(float((high - low).max()), 1e-9)
    return (low + high) / 2 - reach, (low + high) / 2 + reach


def _obstacles(axes: Axes, drawing: Drawing, low: Array, high: Array) -> None:
    """Draw the obstacles that reach into the frame, with equal units on all axes."""
    for letter, *limits in zip("xyz", low, high, strict=False):
        getattr(axes, f"set_{letter}lim")(*limits)
    if _in_space(drawing):
        space: Any = axes
        space.set_box_aspect((1, 1, 1))
    else:
        axes.set_aspect("equal", adjustable="box")
    for ball in drawing.balls:
        nearest = np.clip(ball.centre, low, high)
        inside = np.linalg.norm(nearest - ball.centre) <= ball.radius
        if inside and ball.radius < LARGE * float((high - low)[0]):
            _sphere(axes, ball) if _in_space(drawing) else _circle(axes, ball)
    for block in drawing.blocks:
        centre, half = np.array(block.centre), np.array(block.half)
        start, end = np.maximum(centre - half, low), np.minimum(centre + half, high)
        if (start < end).all():
            _box(axes, start, end) if _in_space(drawing) else _rectangle(axes, start, end)


def _circle(axes: Axes, ball: Ball) -> None:
    from matplotlib.patches import Circle

    axes.add_patch(Circle((ball.centre[0], ball.centre[1]), ball.radius, **OBSTACLE))


def _rectangle(axes: Axes, start: Array, end: Array) -> None:
    from matplotlib.patches import Rectangle

    axes.add_patch(Rectangle((start[0], start[1]), *(end - start), **OBSTACLE))


def _sphere(axes: Any, ball: Ball) -> None:
    around, up = np.meshgrid(np.linspace(0, 2 * np.pi, 25), np.linspace(0, np.pi, 13))
    shape = np.cos(around) * np.sin(up), np.sin(around) * np.sin(up), np.cos(up)
    surface = (c + ball.radius * s for c, s in zip(ball.centre, shape, strict=True))
    style = {"color": OBSTACLE["facecolor"], "alpha": OBSTACLE["alpha"], "linewidth": 0}
    axes.plot_surface(*surface, axlim_clip=True, **style)


def _box(axes: Any, start: Array, end: Array) -> None:
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    corners = ((0, 0), (1, 0), (1, 1), (0, 1))
    faces = []
    for i, j in _FACES:
        for side in (start, end):
            face = np.tile(side, (4, 1))
            face[:, [i, j]] = start[[i, j]] + np.array(corners) * (end - start)[[i, j]]
            faces.append(face)
    axes.add_collection3d(Poly3DCollection(faces, **OBSTACLE))
