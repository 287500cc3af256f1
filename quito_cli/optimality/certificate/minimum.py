"""Pontryagin's minimum condition, where the slopes of H do not say all of it.

The principle asks for more than H_u = 0 and H_uu ≥ 0, which the shallower of two wells has too:

    H(x, λ, u) ≤ H(x, λ, v) for all v between their bounds with lower ≤ c(x, v) ≤ upper

(L. S. Pontryagin and others, The Mathematical Theory of Optimal Processes, 1962), c the rows that
speak of controls. Where H is convex in u and c affine the slopes say all; else `lesser` searches.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.hamiltonian import Pontryagin
from quito_cli.optimality.symbols.probes import Probe, TooLargeError
from quito_cli.problem.model import labels

if TYPE_CHECKING:
    import casadi as ca

Array = NDArray[np.float64]

ROUNDING = 1e-9
"""Part of H_uu that is none."""


def measured(system: Pontryagin, summands: ca.SX) -> ca.Function:
    """Return arguments ↦ summands of H, values of rows that speak of controls, their slopes in u.

    Slopes are (rows, n_u).
    """
    import casadi as ca

    rows = ca.vertcat(*(row.value for row in system.rows if row.mixed), ca.SX(0, 1))
    outputs = [summands, rows, ca.jacobian(rows, system.model.u)]
    return system.function("measured", [ca.densify(output) for output in outputs])


def named(system: Pontryagin, controls: Array, unlike: Array) -> str:
    """Return the controls (n_u,) that differ from others, with their values, for a reader."""
    pairs = zip(labels(system.model.controls), controls, unlike, strict=True)
    return ", ".join(f"{label} = {v:.6g}" for label, v, other in pairs if v != other)


def slopes_say_all(system: Pontryagin, probe: Probe, curvature: Array) -> str:
    """Return why H has no second well among admissible controls; empty where it may.

    Args:
        system: Pontryagin's system.
        probe: its random points.
        curvature: (points, n_u, n_u) H_uu along an answer.
    """
    if not system.model.n_u:
        return "there is no control"
    if not _quadratic(system, probe):
        return ""
    size = float(np.abs(curvature).max(initial=0.0))
    if not size:
        return "H is affine in the controls, so that its slopes say all"
    if np.linalg.eigvalsh(curvature).min() < -ROUNDING * size:
        return ""
    return "H is convex in the controls, so that its slopes say all"


def _quadratic(system: Pontryagin, probe: Probe) -> bool:
    """Whether H is quadratic in u, or affine, and the rows that speak of u are affine.

    Taylor's formula is to hold far away too: steps and kinks are in no derivative.
    """
    import casadi as ca

    u, h, bend = system.model.u, system.hamiltonian, system.curvature
    rows = ca.vertcat(*(row.value for row in system.rows if row.mixed), ca.SX(0, 1))
    by_rows = ca.jacobian(rows, u)
    rests = []
    for step in _far(system, probe):
        there, rows_there = ca.substitute([h, rows], [u], [u + step])
        taylor = h + ca.dot(system.switching, step) + ca.dot(step, bend @ step) / 2
        rests += [there - taylor, rows_there - rows - by_rows @ step]
    try:
        if probe.depends(ca.vertcat(ca.vec(ca.densify(bend)), ca.vec(ca.densify(by_rows))), u):
            return False
        return probe.vanishes(ca.densify(ca.vertcat(*rests)))
    except TooLargeError:
        return False


def _far(system: Pontryagin, probe: Probe) -> tuple[ca.DM, ca.DM]:
    """Return steps of all controls: as far as bounds are apart, or as controls are large."""
    import casadi as ca

    points = probe.points[2]
    without = ~np.isfinite(np.subtract(*system.model.control_bounds))
    steps = np.ptp(points, axis=1) + np.where(without, np.abs(points).max(axis=1), 0.0)
    return ca.DM(steps), ca.DM(-steps)
