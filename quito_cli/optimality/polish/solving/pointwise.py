"""Functions and linear systems at many points: compiled once, evaluated on arrays as they lie.

CasADi keeps matrices column by column. So an array (n, size) is the columns of n points, and n
values (r, c) side by side are an array (n, c, r): both are handed over without a copy.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import casadi as ca

Array = NDArray[np.float64]

TOGETHER = 32
"""Points that one call evaluates: a function is mapped once, over so many, not over each n."""


def evaluated(function: ca.Function, *inputs: Array) -> list[Array]:
    """Evaluate a function at n points.

    Args:
        function: of column vectors, with dense outputs.
        inputs: one for each of its inputs, (n, size).

    Returns:
        Its outputs, (n, r, c) each.
    """
    n = len(inputs[0])
    many = n > 1
    padded = -(-n // TOGETHER) * TOGETHER if many else n
    given = [_padded(value, padded) for value in inputs]
    shapes = [function.size_out(i) for i in range(function.n_out())]
    found = [np.empty((padded, c, r)) for r, c in shapes]
    buffer: Any
    buffer, run = (_mapped(function) if many else function).buffer()
    for start in range(0, padded, TOGETHER):
        own = slice(start, start + TOGETHER)
        for i, value in enumerate(given):
            buffer.set_arg(i, value[own].data)
        for i, result in enumerate(found):
            buffer.set_res(i, result[own].data)
        run()
    return [result[:n].transpose(0, 2, 1) for result in found]


def _padded(value: Array, n: int) -> Array:
    """Return n rows in one piece of memory; those that there are not are zero."""
    whole = np.zeros((n, value.shape[1]))
    whole[: len(value)] = value
    return whole


@lru_cache(maxsize=64)
def _mapped(function: ca.Function) -> ca.Function:
    return function.map(TOGETHER)


def solved(matrices: Array, right: Array) -> Array:
    """Solve linear systems, (n, m, m) and (n, m, c); NaN where there is no solution."""
    try:
        return np.asarray(np.linalg.solve(matrices, right))
    except np.linalg.LinAlgError:
        return np.concatenate(
            [_one(m[None], r[None]) for m, r in zip(matrices, right, strict=True)]
        )


def _one(matrix: Array, right: Array) -> Array:
    try:
        return np.asarray(np.linalg.solve(matrix, right))
    except np.linalg.LinAlgError:
        return np.full(right.shape, np.nan)
