"""Parts of the polish without an answer to start from: settings of texts, structures solved."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.hamiltonian import pontryagin
from quito_cli.optimality.polish.equations.ends import Ends
from quito_cli.optimality.polish.equations.gauss import gauss
from quito_cli.optimality.polish.equations.setting import Setting
from quito_cli.optimality.polish.equations.structure import Held, Kind, Phase, Structure
from quito_cli.optimality.polish.equations.system import System
from quito_cli.optimality.polish.faults.dense import Dense
from quito_cli.optimality.polish.solving.newton import Scales, iterate
from quito_cli.optimality.polish.solving.start import started
from quito_cli.problem.build import build
from quito_cli.problem.load import load_text
from quito_cli.problem.model import Bounds

Array = NDArray[np.float64]


def setting_of(text: str) -> Setting:
    """Return the setting of a problem file's text."""
    return Setting(pontryagin(build(load_text(text, "test.yaml"))))


def phase(*kinds: Kind, held: Sequence[Held] = ()) -> Phase:
    """Return a phase."""
    return Phase(kinds, frozenset(held))


def ends_of(setting: Setting) -> Ends:
    """Return what a Model fixes at the ends: ranges count as free, constraints as not active."""
    m = setting.system.model

    def fixed(bounds: Bounds) -> Array:
        return np.where(bounds.fixed, bounds.lower, np.nan)

    times = [t.lower if t.lower == t.upper else np.nan for t in (m.initial_time, m.final_time)]
    boundary = [fixed(c.bounds) for c in m.constraints.boundary]
    return Ends(
        setting.system,
        fixed(m.initial),
        fixed(m.final),
        float(times[0]),
        float(times[1]),
        fixed(m.parameter_bounds),
        np.full(setting.system.integrals, np.nan),
        np.concatenate([np.zeros(0), *boundary]),
        tuple(fixed(c.bounds) for c in m.constraints.point),
    )


@dataclass(frozen=True)
class Guess:
    """A trajectory to start from: (x, λ) at times, by default zero, and zero for all the rest."""

    y: Callable[[Array], Array] | None = None
    """t (n,) ↦ (n, 2 n_x)."""
    count: int = 3
    """Segments a phase."""

    def shared(self, system: System) -> Array:
        """Return g."""
        g, layout = np.zeros(system.layout.count), system.layout
        times = np.array(system.structure.times)
        g[layout.place("times")] = times
        both = np.concatenate([layout.entries("state"), layout.entries("costate")])
        g[both] = self._y(system, times[:1])[0]
        return g

    def along(self, system: System, k: int, t: Array) -> tuple[Array, Array]:
        """Return (x, λ) and z."""
        law = system.laws[k]
        return self._y(system, t), np.zeros((len(t), len(law.between) + len(law.held)))

    def segments(self, system: System, k: int) -> int:
        """Return how many segments a phase is to have."""
        return self.count

    def _y(self, system: System, t: Array) -> Array:
        return self.y(t) if self.y else np.zeros((len(t), 2 * system.layout.states))


def solved(
    setting: Setting, structure: Structure, guess: Guess | None = None, stages: int = 10
) -> Dense:
    """Solve the equations of a structure; they are to be met."""
    system = System(setting, structure, ends_of(setting), gauss(stages))
    scales = Scales(np.ones(system.layout.size), np.ones(system.layout.count))
    found = iterate(system, started(guess or Guess(), system), scales)
    assert found.converged, found.residuals
    return Dense(system, found.unknowns)
