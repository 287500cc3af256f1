"""Formulas gone through operation by operation, and built again in their own shape."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import casadi as ca

Replace = Callable[[int, "list[ca.SX]"], "ca.SX | None"]
"""An operation and what it is applied to ↦ what is to stand for it; None leaves it."""


def rebuilt(formula: ca.SX, symbols: list[ca.SX], replace: Replace) -> ca.SX:
    """Return a formula with some of its operations replaced, in its own shape."""
    import casadi as ca

    function = ca.Function("formula", symbols, [ca.vec(ca.densify(formula))])
    work, found = [ca.SX(0)] * function.sz_w(), [ca.SX(0)] * formula.numel()
    for i in range(function.n_instructions()):
        operation, into = function.instruction_id(i), function.instruction_output(i)
        read = function.instruction_input(i)
        if operation == ca.OP_CONST:
            work[into[0]] = ca.SX(function.instruction_constant(i))
        elif operation == ca.OP_INPUT:
            work[into[0]] = symbols[read[0]].nz[read[1]]
        elif operation == ca.OP_OUTPUT:
            found[into[1]] = work[read[0]]
        else:
            arguments = [work[j] for j in read]
            combine = ca.SX.unary if len(read) == 1 else ca.SX.binary
            own = replace(operation, arguments)
            work[into[0]] = combine(operation, *arguments) if own is None else own
    return ca.reshape(ca.vertcat(*found), *formula.shape)
