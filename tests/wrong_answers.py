"""Answers that are wrong in known ways, made from good ones or from nothing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

import quito_cli as quito
from quito_cli.problem.model import Model
from quito_cli.solution.junctions import junctions
from quito_cli.solution.resimulation import Control, resimulate
from quito_cli.solution.trajectory import Trajectory
from quito_cli.solution.variation import largest_bounds
from quito_cli.transcription.control import ControlBasis
from quito_cli.transcription.mesh import Mesh

Array = NDArray[np.float64]

FREE_FLYING_ROBOT = """
title: Free-flying robot
source: Y. Sakawa, Optim. Control Appl. Meth. 20 (1999)
time: {initial: 0, final: 12}
states:
  x1: {initial: -10, final: 0}
  x2: {initial: -10, final: 0}
  x3: {initial: pi/2, final: 0}
  x4: {initial: 0, final: 0}
  x5: {initial: 0, final: 0}
  x6: {initial: 0, final: 0}
controls:
  u1: {lower: 0, upper: 1}
  u2: {lower: 0, upper: 1}
  u3: {lower: 0, upper: 1}
  u4: {lower: 0, upper: 1}
dynamics:
  x1: x4
  x2: x5
  x3: x6
  x4: (u1 - u2 + u3 - u4)*cos(x3)
  x5: (u1 - u2 + u3 - u4)*sin(x3)
  x6: 0.2*(u1 - u2) - 0.2*(u3 - u4)
cost: {lagrange: u1 + u2 + u3 + u4}
constraints:
  path: {first: u1 + u2 <= 1, second: u3 + u4 <= 1}
"""

PHASES = (
    (0, 1, 1, 0),
    (0, 0, 1, 0),
    (0, 0, 0, 0),
    (1, 0, 0, 0),
    (0, 0, 0, 0),
    (0, 1, 0, 0),
    (0, 0, 0, 0),
    (0, 0, 0, 1),
    (1, 0, 0, 1),
)
"""The robot's thrusters in the best answer that only has them on or off."""
SWITCHES = (0.61, 1.09, 2.54, 4.83, 7.17, 9.46, 10.91, 11.39)
"""About when they are switched."""


def simulated(model: Model, answer: quito.Solution, coefficients: Array) -> quito.Solution:
    """Return an answer with another control and the states that it produces."""
    substeps = int(answer.options["substeps"])
    control = Control(answer.basis, answer.mesh, coefficients)
    ends = float(answer.times[0]), float(answer.times[-1])
    start, p = answer.trajectory.states[0], answer.parameters
    breaks = np.arange(substeps + 1) / substeps
    states = resimulate(model, control, breaks, ends, start, p).states
    answer = replace(answer, coefficients=coefficients)
    return replace(answer, trajectory=_curve(model, answer, answer.trajectory.times, states))


def _curve(model: Model, answer: quito.Solution, t: Array, x: Array) -> Trajectory:
    after, before = answer.control(t[:-1]), answer.control(t[1:] - 1e-12)
    f, n = model.right_hand_side, len(t) - 1
    p = np.tile(answer.parameters[:, None], (1, n))
    starts = np.array(f.map(n)(x[:-1].T, after.T, p, t[:-1])[0]).T
    ends = np.array(f.map(n)(x[1:].T, before.T, p, t[1:])[0]).T
    return Trajectory(t, x, starts, ends, "cubic")


def shifted(answer: quito.Solution, first: float, last: float, by: float) -> Array:
    """Return coefficients of which those of times between two are shifted."""
    nodes = np.arange(len(answer.times))
    t = np.interp(answer.basis.centres, nodes, answer.times)
    inside = (t > first) & (t < last)
    return np.asarray(answer.coefficients + by * inside[:, None])


def bang_off_bang(model: Model, template: quito.Solution, each: int) -> quito.Solution:
    """Return the robot's extremal among controls that are on or off, in the order of `PHASES`.

    Args:
        model: of the robot.
        template: an answer with piecewise constant controls in 9 · `each` cells.
        each: cells of a phase.
    """
    levels = np.array(PHASES, dtype=float)
    step = _step(model, 1)
    h, start = ca.SX.sym("h", len(levels)), ca.SX(template.trajectory.states[0])
    x = start
    for k, u in enumerate(levels):
        for _ in range(each):
            x = step(x, u, h[k] / each)
    fuel = ca.dot(ca.SX(levels.sum(axis=1)), h)
    program = {"x": h, "f": fuel, "g": ca.vertcat(x, ca.sum1(h))}
    quiet: dict[str, Any] = {
        "ipopt.print_level": 0,
        "print_time": False,
        "ipopt.tol": 1e-11,
        "ipopt.sb": "yes",
    }
    ends = np.append(0.0, 0 * levels[1:, 0]), np.append(np.zeros(model.n_x), 12.0)
    found = ca.nlpsol("fuel", "ipopt", program, quiet)(
        x0=np.diff([0.0, *SWITCHES, 12.0]), lbx=ends[0], lbg=ends[1], ubg=ends[1]
    )
    lengths = np.repeat(np.array(found["x"]).ravel() / each, each)
    u = np.repeat(levels, each, axis=0)
    t = np.append(0.0, np.cumsum(lengths))
    states, costates = _both(model, u, lengths, start, np.array(found["lam_g"]).ravel()[:-1])
    answer = replace(
        template,
        times=t,
        coefficients=u,
        costates=costates,
        cost=float(found["f"]),
        options={**template.options, "substeps": 1},
        multipliers={name: 0 * values for name, values in template.multipliers.items()},
        junctions=(),
    )
    return replace(answer, trajectory=_curve(model, answer, t, states))


def _step(model: Model, steps: int) -> Callable[..., ca.SX]:
    """Return (x, u, h) ↦ x after h, by steps of Kutta's scheme."""
    x, u, h = ca.SX.sym("x", model.n_x), ca.SX.sym("u", model.n_u), ca.SX.sym("h")
    at = x

    def f(x: ca.SX) -> ca.SX:
        return model.right_hand_side(x, u, ca.SX(0, 1), 0)[0]

    for _ in range(steps):
        d = h / steps
        k1 = f(at)
        k2 = f(at + d / 2 * k1)
        k3 = f(at + d / 2 * k2)
        at = at + d / 6 * (k1 + 2 * k2 + 2 * k3 + f(at + d * k3))
    return ca.Function("step", [x, u, h], [at])


def _both(model: Model, u: Array, h: Array, start: ca.SX, last: Array) -> tuple[Array, Array]:
    """Return states and costates at the nodes: the costates of an exact discrete adjoint."""
    step = _step(model, 1)
    x, v, d = ca.SX.sym("x", model.n_x), ca.SX.sym("u", model.n_u), ca.SX.sym("h")
    slope = ca.Function("slope", [x, v, d], [ca.jacobian(step(x, v, d), x)])
    states = [np.array(ca.DM(start)).ravel()]
    for k in range(len(h)):
        states.append(np.array(step(states[-1], u[k], h[k])).ravel())
    costates = [last]
    for k in reversed(range(len(h))):
        costates.append(np.array(slope(states[k], u[k], h[k])).T @ costates[-1])
    return np.array(states), np.array(costates[::-1])


def moved(model: Model, answer: quito.Solution, time: float) -> quito.Solution:
    """Return an answer whose control switches a hundredth of the horizon later than at `time`.

    The mesh is pulled along, by less the further off it is; costates are those of the answer.
    """
    start, end = answer.times[0], answer.times[-1]
    far = 0.1 * (end - start)
    pull = 0.01 * (end - start) * np.maximum(1 - np.abs(answer.times - time) / far, 0)
    near = np.minimum((answer.times - start) / far, (end - answer.times) / far)
    times = answer.times + pull * np.minimum(near, 1)
    mesh = Mesh((times - start) / (end - start))
    basis = answer.basis.on(mesh) if isinstance(answer.basis, ControlBasis) else answer.basis
    steps = len(answer.trajectory.times) - 1
    nodes = np.linspace(0, 1, steps + 1) * (len(times) - 1)
    wrong = replace(
        answer,
        times=times,
        basis=basis,
        costates=answer.costate(times),
        junctions=junctions(
            basis,
            mesh,
            answer.coefficients,
            (float(start), float(end)),
            largest_bounds(*model.control_bounds),
        ),
        trajectory=replace_times(answer, np.interp(nodes, np.arange(len(times)), times)),
    )
    return simulated(model, wrong, answer.coefficients)


def replace_times(answer: quito.Solution, times: Array) -> Trajectory:
    """Return the answer's trajectory at other times: what is simulated starts from it."""
    assert isinstance(answer.trajectory, Trajectory)
    return replace(answer.trajectory, times=times)
