"""Options of a solve, with their defaults, which are here and nowhere else.

What each means is said where problem files have it: `problem.options`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any, Literal

from quito_cli.errors import UsageError

if TYPE_CHECKING:
    from quito_cli.problem.options import CommonOptions


@dataclass(frozen=True)
class Options:
    """How to solve; what each means is said in `quito_cli.problem.options`."""

    steps: int = 100
    variance: float = 2.0
    generating_function: str = "gaussian"
    normalised: bool = True
    control: str = "quasi-interpolant"
    discretization: str = "rk4"
    substeps: int = 2
    degree: int = 4
    mesh: str = "uniform"
    mesh_steps: int = 100
    mesh_tolerance: float = 1e-3
    mesh_iterations: int = 8
    mesh_limit: int | None = None
    polish: bool = False
    tolerance: float = 1e-9
    max_iterations: int = 1000
    solver: str = "ipopt"
    objective_scale: float | None = None
    path_points: Literal["nodes", "substeps"] | None = None
    guess: str | None = None
    warm_start: bool = False
    solver_options: Mapping[str, float | int | bool | str] = field(default_factory=dict)

    @classmethod
    def resolve(cls, file: CommonOptions, given: Mapping[str, Any]) -> Options:
        """Return the options of a solve: given ones, then the file's, then the defaults.

        Args:
            file: what the problem file asks for.
            given: what the call or the command line asks for; None counts as not given.

        Raises:
            UsageError: an unknown option, a wrong value, or options that exclude each other.
        """
        from quito_cli.problem.options import COLLOCATION, idle, refuse_idle

        asked = _checked(given)
        wanted = file.model_dump(exclude_none=True)
        if "solver" in asked and asked["solver"] != wanted.get("solver", cls.solver):
            wanted.pop("solver_options", None)  # the file's are for the file's solver
        discretization = asked.get("discretization", wanted.get("discretization"))
        if discretization != wanted.get("discretization"):
            for name in idle(discretization):  # the file's choice was for the file's method
                wanted.pop(name, None)
            if discretization == COLLOCATION:
                wanted.pop("mesh", None)
        if "control" in asked and asked["control"] != wanted.get("control", cls.control):
            for name in QUASI_INTERPOLANT_ONLY:  # the file's choice was for the file's control
                wanted.pop(name, None)
        wanted["solver_options"] = wanted.get("solver_options", {}) | asked.pop(
            "solver_options", {}
        )
        wanted |= asked
        if wanted.get("polish") and discretization != COLLOCATION:
            wanted.setdefault("mesh", "adaptive")  # arcs are seen the better, the sharper they are
        refuse_idle(wanted, discretization)
        control = wanted.get("control", cls.control)
        for name in QUASI_INTERPOLANT_ONLY:
            if control != "quasi-interpolant" and name in wanted:
                raise UsageError(
                    f"{name.replace('_', '-')} belongs to quasi-interpolants; a {control} control "
                    "has none: leave it out"
                )
        return replace(cls(), **wanted)._meshed(asked)

    def _meshed(self, asked: Mapping[str, Any]) -> Options:
        """Return the options with the cells that an adaptive mesh starts from.

        Raises:
            UsageError: what belongs to adaptive meshes is asked of a uniform one, the cells to
                start from are said twice, or the limit is less than them.
        """
        if self.mesh == "uniform":
            for name in ADAPTIVE_ONLY:
                if name in asked:
                    raise UsageError(
                        f"{name.replace('_', '-')} belongs to adaptive meshes: add --mesh adaptive"
                    )
            return self
        if "steps" in asked and "mesh_steps" in asked:
            raise UsageError(
                "steps and mesh-steps both say how many cells an adaptive mesh starts from: leave "
                "one out"
            )
        name = "steps" if "steps" in asked else "mesh_steps"
        cells = getattr(self, name)
        if cells < FEWEST:
            raise UsageError(
                f"steps: an adaptive mesh starts from {FEWEST} cells at least, got {cells}"
            )
        found = replace(self, steps=cells, mesh_steps=cells)
        if found.most_cells < cells:
            raise UsageError(
                f"a mesh-limit of {found.mesh_limit} cells does not hold the {cells} that "
                f"refinement starts from: raise it, or take fewer --{name.replace('_', '-')}"
            )
        return found

    @property
    def most_cells(self) -> int:
        """Cells that refinement may come to: twice as many as it starts from, unless it is said."""
        return self.mesh_limit or 2 * self.steps

    @property
    def record(self) -> dict[str, Any]:
        """By name, those that mean something to the discretization and to the mesh."""
        from quito_cli.problem.options import idle

        unused = idle(self.discretization)
        unused += ADAPTIVE_ONLY if self.mesh == "uniform" else ()
        return {name: value for name, value in asdict(self).items() if name not in unused}


MOST_OF_A_FILE = 1_000_000
"""Variables times substeps that a file may ask for by itself."""
SIZES = frozenset(("steps", "degree", "mesh_limit"))
"""Options by which a person says how large the program may be."""
DENSE_POINTS = 20
"""Points of a collocation that depend on one another as much as a step costs."""
ADAPTIVE_ONLY = ("mesh_steps", "mesh_tolerance", "mesh_iterations", "mesh_limit")
"""Options that mean nothing to a uniform mesh."""
FEWEST = 4
"""Cells that an adaptive mesh may start from: fewer have no place to be moved to."""
QUASI_INTERPOLANT_ONLY = ("variance", "generating_function", "normalised")
"""Options that mean nothing to the classical controls."""


def too_large(variables: int, options: Options) -> str | None:
    """Return what is asked for, where it is more than a file may ask for by itself.

    Args:
        variables: number of states and controls.
        options: resolved.
    """
    from quito_cli.problem.options import COLLOCATION

    each, what, dense = options.substeps, "steps", 1
    if options.discretization == COLLOCATION:
        each, what, dense = options.degree, "points", 1 + options.degree // DENSE_POINTS
    cells = options.steps if options.mesh == "uniform" else options.most_cells
    if variables * cells * each * dense <= MOST_OF_A_FILE:
        return None
    return (
        f"{cells} cells of {each} {what} with {variables} states and controls, which may take "
        "hours and all memory"
    )


def _checked(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the given options, validated, without those that are None."""
    from pydantic import ValidationError

    from quito_cli.problem.keys import option_hint
    from quito_cli.problem.options import RequestedOptions
    from quito_cli.problem.wording import expected

    known = [f.name for f in fields(Options) if f.name != "guess"]
    for name in given:
        if name not in known:
            raise UsageError(f"there is no option '{name}'{option_hint(name, known)}")
    present = {name: value for name, value in given.items() if value is not None}
    try:
        return RequestedOptions.model_validate(present).model_dump(exclude_none=True)
    except ValidationError as error:
        messages = [
            f"{str(detail['loc'][0]).replace('_', '-')}: {expected(detail)}"
            for detail in error.errors()
        ]
        raise UsageError("\n".join(messages)) from None
