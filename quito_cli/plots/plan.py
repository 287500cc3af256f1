"""The plots a file asks for: curves against each other in a plane or in space, among obstacles."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from quito_cli.plots.palette import COLOURS, OBSTACLE, plain
from quito_cli.problem.shapes import Ball, Block
from quito_cli.solution.solution import Drawing

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

_FACES = (((0, 1), 2), ((1, 2), 0), ((0, 2), 1))
"""Axes of a box's face, and the axis it is normal to."""


def draw_plan(axes: Axes, drawing: Drawing) -> None:
    """Draw curves with their starts (rings) and ends (dots), and the obstacles."""
    for ball in drawing.balls:
        _sphere(axes, ball) if _in_space(drawing) else _circle(axes, ball)
    for block in drawing.blocks:
        _box(axes, block) if _in_space(drawing) else _rectangle(axes, block)
    for i, (name, points) in enumerate(drawing.curves.items()):
        colour = COLOURS[i % len(COLOURS)]
        label = plain(name) if len(drawing.curves) > 1 else None
        axes.plot(*points.T, color=colour, linewidth=1.8, label=label)
        for place, face in ((points[:1], "white"), (points[-1:], colour)):
            axes.plot(*place.T, "o", color=colour, markerfacecolor=face, zorder=5)
    for letter, text in zip("xyz", drawing.labels, strict=False):
        getattr(axes, f"set_{letter}label")(plain(text))
    axes.set_title(plain(drawing.title), fontsize="medium")
    axes.grid(alpha=0.25)
    if drawing.balls or drawing.blocks:  # a circle is to look like one
        _frame(axes, drawing)
    if len(drawing.curves) > 1:
        axes.legend(frameon=False, fontsize="small")


def _in_space(drawing: Drawing) -> bool:
    return len(drawing.labels) == 3


def _frame(axes: Axes, drawing: Drawing) -> None:
    """Show all curves, and obstacles as far as they are near, with equal units on all axes."""
    points = np.vstack(list(drawing.curves.values()))
    points = points[np.isfinite(points).all(axis=1)]
    low, high = points.min(axis=0), points.max(axis=0)
    middle, reach = (low + high) / 2, 0.65 * max(float((high - low).max()), 1e-9)
    for letter, centre in zip("xyz", middle, strict=False):
        getattr(axes, f"set_{letter}lim")(centre - reach, centre + reach)
    axes.set_aspect("equal" if not _in_space(drawing) else "auto", adjustable="box")
    if _in_space(drawing):
        space: Any = axes
        space.set_box_aspect((1, 1, 1))


def _circle(axes: Axes, ball: Ball) -> None:
    from matplotlib.patches import Circle

    axes.add_patch(Circle((ball.centre[0], ball.centre[1]), ball.radius, **OBSTACLE))


def _rectangle(axes: Axes, block: Block) -> None:
    from matplotlib.patches import Rectangle

    (x, y), (a, b) = block.centre, block.half
    axes.add_patch(Rectangle((x - a, y - b), 2 * a, 2 * b, **OBSTACLE))


def _sphere(axes: Any, ball: Ball) -> None:
    around, up = np.meshgrid(np.linspace(0, 2 * np.pi, 25), np.linspace(0, np.pi, 13))
    shape = np.cos(around) * np.sin(up), np.sin(around) * np.sin(up), np.cos(up)
    surface = (c + ball.radius * s for c, s in zip(ball.centre, shape, strict=True))
    axes.plot_surface(*surface, color=OBSTACLE["facecolor"], alpha=OBSTACLE["alpha"], linewidth=0)


def _box(axes: Any, block: Block) -> None:
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    corners = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    faces = []
    for (i, j), normal in _FACES:
        for side in (-1, 1):
            face = np.tile(np.asarray(block.centre), (4, 1))
            face[:, normal] += side * block.half[normal]
            face[:, [i, j]] += np.array(corners) * np.array([block.half[i], block.half[j]])
            faces.append(face)
    axes.add_collection3d(Poly3DCollection(faces, **OBSTACLE))
