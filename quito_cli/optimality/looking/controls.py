"""The controls that minimise H: which kind each is, and the regular ones where no bound holds them.

Where H_uu ≠ 0 a control is regular: H_u = 0 determines it, in closed form where H is quadratic in
it, u = −H_uu⁻¹ H_u(u=0), else as the root that Newton's steps −H_uu⁻¹ H_u lead to. Controls that
H_uu couples are determined together. Where H is affine in a control, H_u is its switching function,
and `singular` has the rest.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.hamiltonian import Pontryagin, sampled
from quito_cli.optimality.symbols.probes import Probe

if TYPE_CHECKING:
    import casadi as ca

Array = NDArray[np.float64]
Kind = Literal["regular", "affine", "kinked", "absent"]
"""How a control enters H; `kinked` is piecewise affine, as in abs(u)."""

STEPS = 50
"""Newton's method has found the control long before, or never will."""


@dataclass(frozen=True, eq=False)
class Regular:
    """Controls that H_u = 0 determines together, as functions of Pontryagin's arguments."""

    system: Pontryagin
    controls: tuple[int, ...]
    """Entries of u."""
    gradient: ca.SX
    """H_u of these, (controls, 1): zero in the interior."""
    curvature: ca.SX
    """H_uu of these, (controls, controls): positive semidefinite at a minimum (Legendre)."""
    closed: ca.SX | None
    """u* in terms of the other arguments, (controls, 1); None where H is not quadratic in them."""

    @cached_property
    def step(self) -> ca.Function:
        """Arguments ↦ Newton's step −H_uu⁻¹ H_u; zero at the regular control."""
        import casadi as ca

        step = -ca.solve(ca.densify(self.curvature), self.gradient)
        return self.system.function("newton", [step])

    @cached_property
    def closed_function(self) -> ca.Function:
        """Arguments ↦ u*; only where `closed` is not None."""
        return self.system.function("regular", [self.closed])

    def along(
        self,
        t: Array,
        x: Array,
        costate: Array,
        guess: Array,
        p: Array,
        mu: Array | None = None,
        nu: Array | None = None,
    ) -> Array:
        """Return the interior control along a trajectory, (points, controls).

        `guess` is all of u, (points, n_u): the start of Newton's method, and the values of other
        controls. NaN where Newton's method does not settle.
        """
        if self.closed is not None:
            return sampled(self.closed_function, (t, x, costate, guess, p, mu, nu))[0]
        u, place = np.array(guess, float), list(self.controls)
        with np.errstate(all="ignore"):
            for _ in range(STEPS):
                step = sampled(self.step, (t, x, costate, u, p, mu, nu))[0]
                u[:, place] += step
                size = 1 + np.abs(u[:, place])
                if np.all(np.abs(step) <= 1e-14 * size):
                    break
        settled = np.isfinite(size) & (np.abs(step) <= 1e-9 * size)
        return np.where(settled, u[:, place], np.nan)


@dataclass(frozen=True, eq=False)
class Controls:
    """How every control enters H."""

    kinds: tuple[Kind, ...]
    """(n_u,)."""
    regular: tuple[Regular, ...]
    """Groups of controls that H_uu couples, each control in one."""

    def of_kind(self, kind: Kind) -> tuple[int, ...]:
        """Return the entries of u of a kind."""
        return tuple(i for i, given in enumerate(self.kinds) if given == kind)


def controls(system: Pontryagin, probe: Probe) -> Controls:
    """Return how every control enters H, and the regular ones.

    Raises:
        TooLargeError: H is too long to be worked on.
    """
    if not system.model.n_u:
        return Controls((), ())
    coupled = ~probe.zeros(system.curvature)
    coupled |= coupled.T
    kinds = tuple(_kind(system, probe, coupled, i) for i in range(system.model.n_u))
    regular = np.array([kind == "regular" for kind in kinds])
    among = coupled & np.outer(regular, regular)
    return Controls(kinds, tuple(_regular(system, probe, g) for g in _groups(among)))


def _kind(system: Pontryagin, probe: Probe, coupled: NDArray[np.bool_], i: int) -> Kind:
    """Tell from H_uu whether u_i is regular; a kink is in H_u, but not in its derivative."""
    import casadi as ca

    if coupled[i, i]:
        return "regular"
    slope, u = system.switching[i], system.model.u[i]
    if ca.depends_on(slope, u):
        span = 1 + float(np.ptp(probe.points[2][i]))
        moved = ca.substitute(slope, u, u + span) - ca.substitute(slope, u, u - span)
        if not probe.vanishes(moved):
            return "kinked"
    return "absent" if probe.vanishes(slope) else "affine"


def _groups(coupled: NDArray[np.bool_]) -> Iterable[tuple[int, ...]]:
    """Give the connected parts of what has a diagonal."""
    left = [int(i) for i in np.flatnonzero(np.diag(coupled))]
    while left:
        group, border = {left[0]}, [left[0]]
        while border:
            near = {int(j) for j in np.flatnonzero(coupled[border.pop()])} - group
            group |= near
            border += near
        left = [i for i in left if i not in group]
        yield tuple(sorted(group))


def _regular(system: Pontryagin, probe: Probe, group: tuple[int, ...]) -> Regular:
    import casadi as ca

    place = list(group)
    u = system.model.u[place]
    gradient, curvature = system.switching[place], system.curvature[place, place]
    closed = None
    if not probe.depends(ca.vec(ca.densify(curvature)), u):
        none = ca.SX.zeros(len(group))
        matrix, offset = ca.substitute([ca.densify(curvature), gradient], [u], [none])
        # A quotient where there is one control: the general solution would square it.
        closed = -offset / matrix if len(group) == 1 else -ca.solve(matrix, offset)
    return Regular(system, group, gradient, curvature, closed)
