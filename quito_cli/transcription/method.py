"""What a method of transcription is to everything around it: multiple shooting or collocation.

It says where the states and the control stand, where they are looked at, and adds the terms of the
dynamics with the integrals and path constraints to a program; what it adds can read states and
costates back from an answer. A new method is a class of its own, and a line in `solve`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from quito_cli.transcription.control import Basis
from quito_cli.transcription.layout import Layout
from quito_cli.transcription.mesh import Mesh

if TYPE_CHECKING:
    from quito_cli.problem.model import Model
    from quito_cli.transcription.cells import PathPoints
    from quito_cli.transcription.guess import Guess
    from quito_cli.transcription.program import Program
    from quito_cli.transcription.terms import Term

Array = NDArray[np.float64]

Interpolation = Literal["linear", "cubic", "polynomial"]
"""Between the breaks: linear or cubic from one to the next; one polynomial through those of a
cell."""


class Dynamics(Protocol):
    """The terms of the dynamics in a program, and what an answer says by them."""

    @property
    def terms(self) -> tuple[Term, ...]:
        """Along the horizon, the cost unscaled."""

    def states(self, w: Array) -> tuple[Array, Array]:
        """Return the states just after and just before the breaks, (M, n_x) each.

        Args:
            w: (n_w,) unknowns in their units.
        """

    def costates(self, w: Array, multipliers: Array) -> Array:
        """Return λ = ∂V/∂x at the nodes, (N+1, n_x), or at all breaks, (M+1, n_x).

        Args:
            w: (n_w,) unknowns in their units.
            multipliers: (n_g,) of all rows, unscaled.
        """


class Method(Protocol):
    """What a continuous problem is made finite with."""

    @property
    def mesh(self) -> Mesh:
        """The cells."""

    @property
    def basis(self) -> Basis:
        """The functions of the control."""

    @property
    def offsets(self) -> Array:
        """Offsets in a cell at which û is looked at, increasing."""

    @property
    def breaks(self) -> Array:
        """Offsets in a cell between which states are interpolated, from 0 to 1."""

    @property
    def interpolation(self) -> Interpolation:
        """How states go on between the breaks."""

    @property
    def fine(self) -> Array:
        """Offsets in [0, 1) of a grid much finer than the offsets, 0 the first."""

    @property
    def resolved(self) -> tuple[Array, int]:
        """Offsets in a cell of an even grid as fine as the method resolves; points that are to the
        ringing index what a cell is."""

    @property
    def own_are_states(self) -> bool:
        """Whether bounds of states hold for the cells' own unknowns."""

    @property
    def sampled(self) -> Mesh:
        """Where guesses are asked for, and sizes taken."""

    @property
    def order(self) -> int:
        """Of the states: in cells of length h they err by h^(order + 1) in each."""

    @property
    def finer(self) -> str:
        """The options that refine it."""

    @property
    def calmer(self) -> str:
        """What is known to help where the control rings."""

    def layout(self, model: Model) -> Layout:
        """Return where the unknowns of `model` stand."""

    def start(self, guess: Guess, layout: Layout) -> Array:
        """Return the unknowns of a guess on `sampled`, (n_w,)."""

    def add_dynamics(self, program: Program, path_points: PathPoints | None) -> Dynamics:
        """Add dynamics, integrals and path constraints to a program.

        Args:
            program: being put together.
            path_points: where path constraints hold; None where it fits each of them.
        """
