"""Whether an expression is zero, found by numbers: symbolic cancellation does not show it.

An expression is evaluated at random points of a box about what the file says of its variables.
Beside its value v goes the size m of the terms that it is made of,

    m(a ± b) = m(a) + m(b),    m(a b) = m(a) m(b),    m(a / b) = m(a) / |b|,    m(f(a)) = |f(a)|,

and it vanishes identically where |v| ≤ 1e-9 m at every point: cancellation leaves 1e-16 m.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.hamiltonian import Pontryagin
from quito_cli.problem.model import Bounds, GuessFunction, Variable

if TYPE_CHECKING:
    import casadi as ca

Array = NDArray[np.float64]

POINTS = 16
"""Random points of a test."""
ZERO = 1e-9
"""A value this small beside its terms is none."""
MOST_OPERATIONS = 8_000
"""Operations of an expression that is still worked on: about a fifth of a second."""


@dataclass(frozen=True, eq=False)
class Probe:
    """Random points of all arguments of a system, the same at every call."""

    system: Pontryagin

    @cached_property
    def points(self) -> list[Array]:
        """Values of `arguments` and the constants, (size, POINTS) each."""
        system, m = self.system, self.system.model
        random = np.random.default_rng(20240607)
        start, end = m.initial_time.guess, m.final_time.guess
        t = random.uniform(start, end, POINTS)
        ends = (m.initial, m.final)
        x = _drawn(random, m.state_bounds, ends, m.states, m.hints.states, t)
        u = _drawn(random, m.control_bounds, (), m.controls, m.hints.controls, t)
        middle = np.nan_to_num(m.hints.parameters, nan=1.0)
        p = middle[:, None] + 0.5 * random.uniform(-1, 1, (m.n_p, POINTS)) * (1 + 0 * t)
        p = np.clip(p, *(side[:, None] for side in m.parameter_bounds))
        normal = [(m.n_x, POINTS), (len(system.rows), POINTS), (system.integrals, POINTS)]
        costate, mu, nu = (random.normal(size=shape) for shape in normal)
        k = np.repeat(system.constants.values[:, None], POINTS, axis=1)
        return [x, costate, u, p, t[None, :], mu, nu, k]

    def sizes(self, expression: ca.SX) -> tuple[Array, Array]:
        """Return values and sizes of terms, (entries, POINTS) each; NaN where undefined.

        Raises:
            TooLargeError: more than MOST_OPERATIONS operations.
        """
        import casadi as ca

        inputs = [*self.system.arguments, self.system.constants.symbols]
        function = ca.Function("probed", inputs, [ca.vec(ca.densify(expression))])
        if function.n_instructions() > MOST_OPERATIONS:
            raise TooLargeError
        return _sizes(function, self.points)

    def vanishes(self, expression: ca.SX) -> bool:
        """Whether every entry is identically zero."""
        return bool(self.zeros(expression).all())

    def zeros(self, expression: ca.SX) -> NDArray[np.bool_]:
        """Whether each entry is identically zero, in the shape of the expression.

        Raises:
            TooLargeError: more than MOST_OPERATIONS operations.
        """
        rows, columns = expression.shape
        if expression.nnz() == 0 or expression.is_zero():
            return np.ones((rows, columns), dtype=bool)
        values, sizes = self.sizes(expression)
        with np.errstate(invalid="ignore"):
            defined = np.isfinite(values) & np.isfinite(sizes)
            zero = np.all(~defined | (np.abs(values) <= ZERO * sizes), axis=1)
        # Nowhere defined is not known to vanish.
        return np.asarray(zero & defined.any(axis=1)).reshape(columns, rows).T

    def depends(self, expression: ca.SX, on: ca.SX) -> bool:
        """Whether an expression really depends on symbols."""
        import casadi as ca

        if not on.numel() or not ca.depends_on(expression, on):
            return False
        return not self.vanishes(ca.jacobian(expression, on))


class TooLargeError(Exception):
    """An expression of more operations than are worked on."""


def _drawn(
    random: np.random.Generator,
    bounds: Bounds,
    ends: tuple[Bounds, ...],
    variables: tuple[Variable, ...],
    guesses: tuple[GuessFunction | None, ...],
    t: Array,
) -> Array:
    """Return points in the middle four fifths of bounds, else about ends and guesses."""
    rows = []
    for variable, guess in zip(variables, guesses, strict=True):
        guessed = None if guess is None else np.asarray(guess(t))
        for entry in range(variable.size):
            i = variable.first + entry
            low, high = bounds.lower[i], bounds.upper[i]
            said = np.array([side[i] for end in ends for side in end])
            said = said[np.isfinite(said)]
            if guessed is not None:
                said = np.append(said, guessed[:, entry])
            width = max(float(np.ptp(said)) if said.size else 0.0, 1.0)
            middle = float(said.mean()) if said.size else 0.0
            low = low if np.isfinite(low) else min(middle - width, high - width)
            high = high if np.isfinite(high) else max(middle + width, low + width)
            rows.append(low + (high - low) * random.uniform(0.1, 0.9, len(t)))
    return np.array(rows).reshape(len(rows), len(t))


def _sizes(function: ca.Function, points: list[Array]) -> tuple[Array, Array]:
    """Go through the operations with the size of every intermediate value."""
    import casadi as ca

    values, steps, outputs = _unrolled(function, points)
    sizes: list[Array] = []
    for value, (operation, read) in zip(values, steps, strict=True):
        with np.errstate(all="ignore"):
            if operation in (ca.OP_ADD, ca.OP_SUB):
                size = sizes[read[0]] + sizes[read[1]]
            elif operation == ca.OP_MUL:
                size = sizes[read[0]] * sizes[read[1]]
            elif operation == ca.OP_SQ:
                size = sizes[read[0]] ** 2
            elif operation == ca.OP_TWICE:
                size = 2 * sizes[read[0]]
            elif operation in (ca.OP_NEG, ca.OP_ASSIGN):
                size = sizes[read[0]]
            elif operation == ca.OP_DIV:
                size = sizes[read[0]] / np.abs(values[read[1]])
            else:
                size = np.abs(value)
        sizes.append(np.maximum(size, np.abs(value)))
    zero = np.zeros(points[0].shape[1])
    rows = [(zero, zero) if i is None else (values[i], sizes[i]) for i in outputs]
    return np.array([v for v, _ in rows]), np.array([s for _, s in rows])


def _unrolled(
    function: ca.Function, points: list[Array]
) -> tuple[Array, list[tuple[int, list[int]]], list[int | None]]:
    """Return every intermediate value (steps, points), what each step reads, and the outputs."""
    import casadi as ca

    inputs, work = function.sx_in(), [0] * function.sz_w()
    nodes: list[ca.SX] = []
    steps: list[tuple[int, list[int]]] = []
    outputs: list[int | None] = [None] * function.numel_out(0)
    for i in range(function.n_instructions()):
        operation = function.instruction_id(i)
        into, read = function.instruction_output(i), function.instruction_input(i)
        if operation == ca.OP_OUTPUT:
            outputs[into[1]] = work[read[0]]
            continue
        at: list[int] = []
        if operation == ca.OP_CONST:
            node = ca.SX(function.instruction_constant(i))
        elif operation == ca.OP_INPUT:
            node = inputs[read[0]].nz[read[1]]
        else:
            at = [work[j] for j in read]
            combine = ca.SX.unary if len(at) == 1 else ca.SX.binary
            node = combine(operation, *(nodes[j] for j in at))
        work[into[0]] = len(nodes)
        nodes.append(node)
        steps.append((operation, at))
    every = ca.Function("every", inputs, [ca.vertcat(*nodes)])
    n = points[0].shape[1]
    return np.array(ca.DM(every.map(n)(*points))).reshape(len(nodes), n), steps, outputs
