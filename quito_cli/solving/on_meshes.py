"""The solves of a refinement: each told apart for who listens, and stopped between two, too."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from quito_cli.refinement.refine import Solver
    from quito_cli.solution.solution import Solution
    from quito_cli.solvers.interruption import Interruption
    from quito_cli.solvers.outcome import Listener, Progress
    from quito_cli.solving.on_mesh import Task
    from quito_cli.transcription.mesh import Mesh


def solver_of(
    task: Task, warm: Solution | None, build_seconds: float, interruption: Interruption
) -> Solver:
    """Return what solves a task on one mesh after another.

    Args:
        task: what is to be solved.
        warm: an answer whose multipliers the first solve is to start from.
        build_seconds: what building took before.
        interruption: whether the user wants to stop. Then an answer on the mesh before is returned
            as one that was interrupted, without a further solve.
    """
    meshes = 0

    def solve_on(mesh: Mesh, substeps: int, earlier: Solution | None) -> Solution:
        nonlocal meshes
        check = earlier is not None and earlier.options.get("substeps") != substeps
        meshes += not check
        stage = f"check of {substeps} substeps" if check else f"mesh {meshes}, {mesh.cells} cells"
        told = replace(task, listener=_staged(task.listener, stage))
        if earlier is None:
            return told.on(mesh, warm, build_seconds)
        if interruption.requested:
            return _interrupted(earlier, mesh)
        try:
            return told.again(mesh, substeps, earlier)
        except KeyboardInterrupt:  # asked for twice: what there is, at once
            return _interrupted(earlier, mesh)

    return solve_on


def _staged(listener: Listener | None, stage: str) -> Listener | None:
    """Return a listener that is told of the stage as well."""
    if listener is None:
        return None
    heard = listener

    def told(progress: Progress) -> None:
        heard(replace(progress, stage=stage))

    return told


def _interrupted(earlier: Solution, mesh: Mesh) -> Solution:
    """Return an earlier answer as what a solve on a mesh came to that was not begun."""
    from quito_cli.solvers.outcome import Status

    start, end = earlier.times[0], earlier.times[-1]
    times = start + (end - start) * mesh.fractions
    nothing = replace(earlier.statistics, iterations=0, build_seconds=0.0, solve_seconds=0.0)
    return replace(earlier, status=Status.INTERRUPTED, times=times, statistics=nothing)
