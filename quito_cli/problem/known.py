"""What is known of an answer: its cost, its switching times, states and controls by time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from quito_cli.problem.variables import Array, Variable

if TYPE_CHECKING:
    import casadi as ca


@dataclass(frozen=True)
class Piece:
    """A piece of a known function of time."""

    until: float
    """Where it ends; the next piece holds from there on."""
    value: ca.Function
    """t ↦ a column of the variable's size."""


@dataclass(frozen=True)
class Known:
    """What is known of the answer."""

    cost: float | None
    """In the file's sense."""
    accuracy: float | None
    switching_times: tuple[float, ...]
    states: dict[str, tuple[Piece, ...]]
    controls: dict[str, tuple[Piece, ...]]

    @staticmethod
    def sample(
        functions: dict[str, tuple[Piece, ...]], variables: tuple[Variable, ...], times: Array
    ) -> Array:
        """Return the known functions at `times`, (len(times), entries); NaN where unknown."""
        values = np.full((len(times), sum(v.size for v in variables)), np.nan)
        for variable in variables:
            start = -np.inf
            for piece in functions.get(variable.name, ()):
                here = (times >= start) & (times < piece.until)
                if here.any():
                    found = np.array(piece.value.map(int(here.sum()))(times[here]))
                    values[here, variable.entries] = found.T
                start = piece.until
        return values
