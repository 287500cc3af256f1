"""`quito sweep`: a problem solved over constants and options; a table, an HDF5, pictures out."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from quito_cli.cli.options import Cluster, Settings, of_a_solve
from quito_cli.cli.output import Picture, check_folder, check_picture
from quito_cli.cli.stopping import Stopping

if TYPE_CHECKING:
    from quito_cli.batch.suite.suite import Suite
    from quito_cli.batch.sweeps.sweep import Sweep, Swept
    from quito_cli.batch.workers.run import Setting
    from quito_cli.cli.live import Live


@of_a_solve
def sweep(
    problem: Annotated[str, typer.Argument(help="A problem file, or the name of a bundled one.")],
    *,
    over: Annotated[
        list[str] | None,
        typer.Option(
            "--over",
            metavar="NAME=VALUES",
            help="What to go over: a constant, a value by its path, or an option. VALUES are "
            "START:STOP:POINTS, both ends included, START:STOP:POINTS:log, or a list with commas. "
            "Repeated, all combinations are solved.",
        ),
    ] = None,
    warm: Annotated[
        bool,
        typer.Option("--warm", help="Continuation: start each solve from its neighbour's answer."),
    ] = False,
    figures: Annotated[
        list[str] | None,
        typer.Option(
            "--figures",
            metavar="NAME,...",
            help="Figures of the table and the plots, as suites know them: cost, iterations, "
            "switching_times, violation, error_l2, ... [default: cost,iterations]",
            show_default=False,
        ),
    ] = None,
    jobs: Annotated[
        int | None,
        typer.Option("-j", "--jobs", help="Cases at once. [default: as many as processors]"),
    ] = None,
    cluster: Cluster = None,
    time_limit: Annotated[
        float | None, typer.Option(metavar="SECONDS", help="Of each case.")
    ] = None,
    memory_limit: Annotated[
        str | None, typer.Option(metavar="SIZE", help="Of each case, such as 2GB.")
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on where a run of this sweep stopped.")
    ] = False,
    options: dict[str, Any],
    settings: Settings = None,
    output: Annotated[
        Path, typer.Option("-o", "--output", help="Folder for the file, the pictures, the results.")
    ] = Path("results"),
    picture: Picture = "png",
    no_plot: Annotated[bool, typer.Option("--no-plot", help="Draw no pictures.")] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object, and nothing else.")
    ] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only.")] = False,
) -> None:
    """Solve a problem at all combinations of values, and draw what becomes of it over them.

    The reference of a file is held against answers only where no constant is swept or set, unless
    it says `general: true`.

    Exit codes: 0 all solved, 1 some did not, 2 a wrong command line or file, 130 interrupted.
    """
    with Stopping(output) as stopping:
        from quito_cli.batch.judging.figures import COSTLY
        from quito_cli.batch.sweeps.dataset import save
        from quito_cli.batch.sweeps.sweeping import SHOWN, known_figures, plan, suite_of
        from quito_cli.batch.workers.jobs import workers_of
        from quito_cli.batch.workers.recorded import exit_code, limited
        from quito_cli.batch.workers.run import Setting
        from quito_cli.cli.live import Live
        from quito_cli.problem.load import parse_settings

        check_picture(picture)
        check_folder(output)
        workers = workers_of(jobs, cluster)
        shown = known_figures(name for text in figures or SHOWN for name in text.split(","))
        constants = parse_settings(settings or [], "--set")
        planned = plan(problem, over or (), options=options, constants=constants, warm=warm)
        suite = limited(suite_of(planned), time_limit, memory_limit)
        record = tuple(sorted(COSTLY.intersection(shown)))
        folder = output / suite.name
        setting = Setting(workers, folder, "all", suite.limits, record, cluster=cluster)
        live = Live(len(suite.cases), silent=as_json, quiet=quiet, verbose=False)
        stopping.live = live
        swept, interrupted = _run(planned, suite, setting, live, resume=resume)
        path = output / f"{suite.name}.h5"
        save(swept, path)
        files = (path, *(() if no_plot else _draw(swept, shown, output, picture)))
        _report(swept, shown, files, setting.folder, as_json=as_json, quiet=quiet)
        if interrupted:
            stopping.leave()
    if code := exit_code(one for one in swept.finished if one is not None):
        raise typer.Exit(code)


def _run(
    planned: Sweep, suite: Suite, setting: Setting, live: Live, *, resume: bool
) -> tuple[Swept, bool]:
    """Return what became of the cases, and whether the user stopped it."""
    from dataclasses import replace

    from quito_cli.batch.sweeps.sweeping import run_through
    from quito_cli.solvers.interruption import interruptible

    with interruptible() as interruption, live:

        def stop() -> bool:
            live.draw()
            return interruption.requested

        setting = replace(setting, stop=stop, watch=live.watch if live.moving else None)
        swept = run_through(planned, suite, setting, resume=resume, show=live.show)
        return swept, interruption.requested


def _draw(swept: Swept, shown: tuple[str, ...], folder: Path, picture: str) -> tuple[Path, ...]:
    from quito_cli.plots.sweep import draw_all

    return draw_all(swept, shown, folder, picture)


def _report(
    swept: Swept,
    shown: tuple[str, ...],
    files: tuple[Path, ...],
    folder: Path,
    *,
    as_json: bool,
    quiet: bool,
) -> None:
    from quito_cli.cli.swept import print_json, print_swept

    if as_json:
        print_json(swept, shown, files)
    elif not quiet:
        print_swept(swept, shown, files, folder)
