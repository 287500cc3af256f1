"""The plots that a file asks for, as functions of the answer and shapes made of numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from quito_cli.problem.schema_plots import Plot
from quito_cli.problem.scopes import Scopes
from quito_cli.problem.shapes import Ball, Block, View
from quito_cli.problem.values import Path

if TYPE_CHECKING:
    import casadi as ca

_AXES = {2: "two", 3: "three"}


def read_views(scopes: Scopes) -> tuple[View, ...]:
    """Return the plots of the file; complaints go to the reader of `scopes`."""
    views = (_view(scopes, name, plot) for name, plot in scopes.problem.plots.items())
    return tuple(view for view in views if view is not None)


def _view(scopes: Scopes, name: str, plot: Plot) -> View | None:
    path: Path = ("plots", name)
    curves = {
        curve: _curve(scopes, (*path, "curves", curve), plot.curves[curve]) for curve in plot.curves
    }
    good = {curve: value for curve, value in curves.items() if value is not None}
    if len(good) < len(curves):
        return None
    first = next(iter(good))
    axes = good[first].numel()
    for curve, value in good.items():
        if value.numel() != axes:
            message = f"'{first}' has {axes} coordinates, '{curve}' has {value.numel()}"
            scopes.reader.complain((*path, "curves", curve), message)
            return None
    if plot.labels is not None and len(plot.labels) != axes:
        message = f"the plot has {_AXES[axes]} axes, and {len(plot.labels)} labels"
        scopes.reader.complain((*path, "labels"), message)
    return View(
        name,
        plot.title or name,
        tuple(plot.labels or _labels(plot.curves[first], axes)),
        {curve: _function(scopes, value) for curve, value in good.items()},
        _balls(scopes, path, plot, axes),
        tuple(
            Block(
                _coordinates(scopes, (*path, "boxes", i, "centre"), box.centre, axes),
                _coordinates(scopes, (*path, "boxes", i, "half"), box.half, axes, positive=True),
            )
            for i, box in enumerate(plot.boxes)
        ),
    )


def _curve(scopes: Scopes, path: Path, value: str | list[float | str]) -> ca.SX | None:
    """Return two or three coordinates along the horizon, as a column."""
    import casadi as ca

    if isinstance(value, str):
        point = scopes.formula(path, value, scopes.along)
        if point is not None and point.numel() not in _AXES:
            message = f"two or three coordinates are drawn, this has {point.numel()}; write a list"
            scopes.reader.complain(path, message)
            return None
        return None if point is None else ca.vec(point)
    entries = [scopes.formula((*path, i), v, scopes.along) for i, v in enumerate(value)]
    for i, entry in enumerate(entries):
        if entry is not None and entry.numel() != 1:
            message = f"a coordinate is a scalar, this has {entry.numel()} entries"
            scopes.reader.complain((*path, i), message)
            return None
    good = [entry for entry in entries if entry is not None]
    return ca.vertcat(*good) if len(good) == len(entries) else None


def _labels(value: str | list[float | str], axes: int) -> list[str]:
    if isinstance(value, str):
        return [f"{value}[{i}]" for i in range(axes)]
    return [str(entry) for entry in value]


def _function(scopes: Scopes, value: ca.SX) -> ca.Function:
    import casadi as ca

    return ca.Function("curve", [scopes.x, scopes.u, scopes.p, scopes.t], [value])


def _balls(scopes: Scopes, path: Path, plot: Plot, axes: int) -> tuple[Ball, ...]:
    right, wrong = ("circles", "spheres") if axes == 2 else ("spheres", "circles")
    if getattr(plot, wrong):
        message = f"a plot with {_AXES[axes]} axes has {right}, not {wrong}"
        scopes.reader.complain((*path, wrong), message, key=True)
    balls = []
    for i, ball in enumerate(getattr(plot, right)):
        where = (*path, right, i)
        centre = _coordinates(scopes, (*where, "centre"), ball.centre, axes)
        (radius,) = _coordinates(scopes, (*where, "radius"), ball.radius, 1, positive=True)
        balls.append(Ball(centre, radius))
    return tuple(balls)


def _coordinates(
    scopes: Scopes, path: Path, value: object, size: int, *, positive: bool = False
) -> tuple[float, ...]:
    shape, before = scopes.shape, len(scopes.reader.complaints)
    found = scopes.reader.vector(path, value, size, np.nan, shape.values, refused=shape.refused)
    if len(scopes.reader.complaints) == before:
        if not np.isfinite(found).all():
            scopes.reader.complain(path, "obstacles are made of finite numbers")
        elif positive and (found <= 0).any():
            scopes.reader.complain(path, "a length is positive")
    return tuple(float(number) for number in found)
