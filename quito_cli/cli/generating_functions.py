"""`quito generating-functions`: what each of the six is like, as a table and a picture."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from quito_cli.cli.options import AsJson, Quiet
from quito_cli.errors import UsageError
from quito_cli.options import Options
from quito_cli.solving.on_mesh import SATURATION_LIMIT

if TYPE_CHECKING:
    from quito_cli.transcription.qualities import Qualities

_MOST_VARIANCE = 100.0
"""As in a problem file: beyond it a jump is thirty cells wide and more."""


def generating_functions(
    variance: Annotated[
        float | None,
        typer.Option(help=f"Shape parameter D. [default: {Options.variance:g}]"),
    ] = None,
    normalised: Annotated[
        bool | None,
        typer.Option(
            "--normalised/--as-printed",
            help="Weights over their sum, or the paper's sum as printed. [default: normalised]",
            show_default=False,
        ),
    ] = None,
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for the picture.")] = Path(
        "results"
    ),
    picture: Annotated[
        Literal["png", "pdf", "svg"], typer.Option("--format", help="Format of the picture.")
    ] = "png",
    no_plot: Annotated[bool, typer.Option("--no-plot", help="Draw no picture.")] = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Compare the generating functions: table and picture."""
    from quito_cli.problem.options import CommonOptions
    from quito_cli.transcription.qualities import all_qualities

    asked = {"variance": variance, "normalised": normalised}
    options = Options.resolve(CommonOptions(), asked)
    if options.variance > _MOST_VARIANCE:
        raise UsageError(f"variance: expected at most {_MOST_VARIANCE:g}, got {variance:g}")
    chosen = options.variance, options.normalised
    rows = all_qualities(*chosen, SATURATION_LIMIT)
    plotted = None
    if not no_plot:
        from quito_cli.plots.figure import write
        from quito_cli.plots.generating import figure

        plotted = output / f"generating-functions.{picture}"
        write(figure(rows, *chosen, SATURATION_LIMIT), plotted)
    if as_json:
        typer.echo(json.dumps(_dictionary(rows, options, plotted), ensure_ascii=False))
    elif not quiet:
        saved = f"\n\nSaved {plotted}" if plotted else ""
        typer.echo(f"{_heading(options)}\n\n{_table(rows)}\n\n{_explained(options)}{saved}")


def _dictionary(
    rows: tuple[Qualities, ...], options: Options, plotted: Path | None
) -> dict[str, Any]:
    return {
        "variance": options.variance,
        "normalised": options.normalised,
        "saturation_limit": SATURATION_LIMIT,
        "generating_functions": [
            {
                "number": row.function.number,
                "name": row.function.name,
                "formula": row.function.formula,
                "order": row.order,
                "saturation": row.saturation,
                "lebesgue_constant": row.lebesgue_constant,
                "overshoot": row.overshoot,
                "width": row.width,
                "least_variance": row.least_variance,
                "enough_variance": row.enough_variance,
            }
            for row in rows
        ],
        "plot": None if plotted is None else str(plotted),
    }


def _heading(options: Options) -> str:
    weights = "normalised" if options.normalised else "as printed"
    heading = f"Generating functions, variance D = {options.variance:g}, weights {weights}"
    return typer.style(heading, bold=True)


def _table(rows: tuple[Qualities, ...]) -> str:
    """Return the table, the formulas last; below it where a terminal is too narrow for them."""
    from quito_cli.cli.text import columns

    heads = ["", "name", "order", "saturation", "Lebesgue", "overshoot", "width", "least", "enough"]
    table = [heads, *(_cells(row) for row in rows)]
    formulas = ["formula", *(row.function.formula for row in rows)]
    whole = [[*cells, formula] for cells, formula in zip(table, formulas, strict=True)]
    text = columns(whole, indent="", header=True)
    width = max(len(line) for line in text.splitlines()[1:])
    if not sys.stdout.isatty() or width <= shutil.get_terminal_size().columns:
        return text
    apart = [[*cells[:2], formula] for cells, formula in zip(table, formulas, strict=True)]
    return "\n\n".join(columns(part, indent="", header=True) for part in (table, apart))


def _cells(row: Qualities) -> list[str]:
    def shown(value: float | None, form: str) -> str:
        return "-" if value is None else form.format(value)

    return [
        str(row.function.number),
        row.function.name,
        str(row.order),
        shown(row.saturation, "{:.1e}"),
        shown(row.lebesgue_constant, "{:.3f}"),
        shown(row.overshoot and 100 * row.overshoot, "{:.1f} %"),
        shown(row.width, "{:.2f}"),
        f"{row.least_variance:g}",
        shown(row.enough_variance, "{:g}"),
    ]


def _explained(options: Options) -> str:
    from quito_cli.cli.text import labelled

    of_what = (
        ("of a control that crosses its range", "in a cell, over the range")
        if options.normalised
        else ("of a constant, over its value", "")
    )
    return labelled(
        [
            ("order", "power of the cell with which the error of a smooth control falls"),
            ("saturation", f"error that only D reduces, {of_what[0]}"),
            *([("", of_what[1])] if of_what[1] else []),
            ("Lebesgue", "the largest sum of absolute weights"),
            ("overshoot", "beyond a jump, over its height"),
            ("width", "of a jump, from 10 % to 90 % of its height, in cells"),
            ("least", "smallest D taken: below it the sum of weights falls under 1/2"),
            ("enough", f"smallest D without a warning: saturation at most {SATURATION_LIMIT:g},"),
            ("", f"a tenth of the error of {Options.mesh_tolerance:g} expected of a mesh"),
        ],
        indent="",
    )
