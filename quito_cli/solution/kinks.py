"""Kinks: where an answer sits on a corner of a formula, which Newton's method cannot settle on.

abs, sign, min, max and the comparisons of if_else have a corner or a jump where their argument is
zero (or both arguments are equal). The formula's operations are gone through once, and what each
corner depends on is made an output of its own.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.problem.language.rebuilding import rebuilt

if TYPE_CHECKING:
    import casadi as ca

Array = NDArray[np.float64]

NEAR = 1e-3
"""A corner this near, relative to the size its argument has along the horizon, is sat on."""
RUN = 3
"""Nodes in a row at which a corner is sat on rather than crossed."""


def corners(function: ca.Function) -> list[tuple[str, ca.SX]]:
    """Return the name of each corner of an SX function, and what is zero there, by its inputs."""
    import casadi as ca

    names = {
        ca.OP_FABS: "abs",
        ca.OP_SIGN: "sign",
        ca.OP_FMIN: "min",
        ca.OP_FMAX: "max",
        ca.OP_LT: "if_else",
        ca.OP_LE: "if_else",
    }
    inputs = function.sx_in()
    found: list[tuple[str, ca.SX]] = []

    def seen(operation: int, arguments: list[ca.SX]) -> None:
        if operation in names:
            zero = arguments[0] - (arguments[1] if len(arguments) == 2 else 0)
            found.append((names[operation], zero))

    rebuilt(ca.veccat(*function.call(inputs)), inputs, seen)
    return found


def sat_on(
    model_inputs: list[ca.SX], expression: ca.SX, points: tuple[Array, ...]
) -> tuple[str, int] | None:
    """Return the name of a corner that points in a row sit on, and the first of them.

    Args:
        model_inputs: symbols of `expression`.
        expression: a formula along the horizon.
        points: values of the symbols, (size, points) each.
    """
    import casadi as ca

    function = ca.Function("formula", model_inputs, [ca.vec(ca.densify(expression))])
    found = corners(function)
    zero = ca.Function("corners", function.sx_in(), [ca.vertcat(*(a for _, a in found))])
    values = np.abs(np.array(zero.map(points[-1].shape[-1])(*points)))
    for (name, _), row in zip(found, values, strict=True):
        near = row <= NEAR * float(np.nanmax(row, initial=0.0))
        starts = np.convolve(near, np.ones(RUN), mode="valid") == RUN
        if starts.any():
            return name, int(np.argmax(starts))
    return None
