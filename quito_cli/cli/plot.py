"""`quito plot`: pictures of a saved result."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from quito_cli.cli.options import Quiet
from quito_cli.cli.output import Picture, check_folder, check_picture


def plot(
    result: Annotated[Path, typer.Argument(help="A result file of `quito solve`.")],
    states: Annotated[bool, typer.Option("--states", help="The states.")] = False,
    controls: Annotated[bool, typer.Option("--controls", help="The controls.")] = False,
    costates: Annotated[
        bool,
        typer.Option(
            "--costates", help="The costates, and with them switching functions and Hamiltonian."
        ),
    ] = False,
    mesh: Annotated[bool, typer.Option("--mesh", help="The lengths of the control cells.")] = False,
    plan: Annotated[bool, typer.Option("--plan", help="The problem file's own plots.")] = False,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Folder for the picture. [default: the result's]"),
    ] = None,
    picture: Picture = "png",
    quiet: Quiet = False,
) -> None:
    """Draw a saved result."""
    from quito_cli.plots.figure import DEFAULT, draw
    from quito_cli.problem.load import refuse_problem
    from quito_cli.solution.solution import Solution

    check_picture(picture)
    if output is not None:
        check_folder(output)
    refuse_problem(result, "plot")
    chosen = {
        "states": states,
        "controls": controls,
        "costates": costates,
        "switching": costates,
        "mesh": mesh,
        "plan": plan,
    }
    panels = tuple(name for name, wanted in chosen.items() if wanted)
    suffix = "".join(f"-{name}" for name in panels if name != "switching")
    solution = Solution.load(result)
    path = (output or result.parent) / f"{result.stem}{suffix}.{picture}"
    draw(solution, panels or DEFAULT, path)
    if not quiet:
        typer.echo(f"Saved {path}")
