"""Solution <-> HDF5: labelled, self-contained, reproducible to the byte but for recorded times.

    problem        the YAML text, its SHA-256, resolved options, bounds
    trajectory     at the nodes: time, state, control, costate
    interpolation  what makes states a function of time: ends of substeps, slopes; or the points of
                   a collocation, its degree, and the costates there, with those just before the
                   ends of cells where they may jump
    dense          state, control and reference on a fine uniform grid
    control        coefficients of û, generating function and variance, or degree; mesh, and on a
                   graded one the slopes of the index at both ends of each cell
    junctions      jumps and kinks by time: of which control, how uncertain, û before and after, L²
                   norm of what a jump is smeared by
    refinement     of an adaptive mesh: by round its cells, substeps, costs, gap, violation, change,
                   blur, iterations and seconds, and the nodes of each; which was kept, and why it
                   ended; in `account` the estimates of the control's error
    optimality     Pontryagin's conditions: in `arcs` of which control or constraint, of which kind,
                   both ends and how uncertain they are; in `certificate` condition, residual,
                   scale, worst time, verdict, reason; Hamiltonian and switching functions by time
    polishing      what a polish did, step by step: action, sentence, and how many of the residuals,
                   written one after another, are of it; how it ended
    densities      of a polished answer: multipliers of constraints at the points, just before the
                   ends of cells, and their impulses at nodes
    multipliers    of the nonlinear program's rows, by block
    iterations     objective, infeasibilities, barrier parameter
    statistics     cost, counts, times, and every figure of the evidence
    plots          the plots the file asks for: curves and obstacles

Every axis has a dimension scale, so that `xarray.open_dataset(file, group="trajectory",
engine="h5netcdf")` finds names and times. A file is written beside the old one and renamed.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from quito_cli.errors import ResultFileError
from quito_cli.solution.solution import Solution
from quito_cli.solution.writing import FORMAT, FORMAT_VERSION
from quito_cli.solution.writing import write as write_to

if TYPE_CHECKING:
    import h5py

SWEEP = "quito sweep"
"""Format of a file over many results, by `quito_cli.batch.dataset`."""
DAMAGED = (OSError, LookupError, ValueError, TypeError, AttributeError, RuntimeError)
"""What h5py and numpy raise for a file whose bytes or layout are not what they should be."""


def write_aside(path: Path, write: Callable[[Path], None]) -> None:
    """Let `write` make a file beside `path`, then rename it: `path` is the old or the new one.

    Raises:
        ResultFileError: the file cannot be written.
    """
    aside = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write(aside)
        os.replace(aside, path)
    except OSError as error:
        raise ResultFileError(f"{path} cannot be written: {error.strerror or error}") from None
    finally:
        with suppress(OSError):
            aside.unlink()


def write_content(path: Path, content: str | bytes) -> None:
    """Write text, as UTF-8 and with its own line ends, or bytes in the way of `write_aside`.

    Raises:
        ResultFileError: the file cannot be written.
    """
    made = content.encode() if isinstance(content, str) else content

    def write(aside: Path) -> None:
        aside.write_bytes(made)

    write_aside(path, write)


def save(solution: Solution, path: Path) -> None:
    """Write `solution` to `path`."""
    import h5py

    def write(aside: Path) -> None:
        with h5py.File(aside, "w", driver="core", backing_store=True) as file:  # in one piece
            write_to(file, solution)

    write_aside(path, write)


def load(path: Path) -> Solution:
    """Read a Solution.

    Raises:
        ResultFileError: the file is missing, damaged, no result of quito, or of a newer format.
    """
    import h5py

    from quito_cli.solution.reading import read

    if not path.is_file():
        raise ResultFileError(f"there is no file {path}")
    try:
        with h5py.File(path, "r") as file:
            _check_format(file, path)
            return read(file)
    except DAMAGED as error:
        raise ResultFileError(f"{path} is no result of quito, or damaged: {error}") from None


def is_result(path: Path) -> bool:
    """Whether `path` is an HDF5 file, by content."""
    import h5py

    return path.is_file() and bool(h5py.is_hdf5(path))


def _check_format(file: h5py.File, path: Path) -> None:
    if file.attrs.get("format") == SWEEP:
        raise ResultFileError(
            f"{path} is a sweep: the result of each of its cases is a file in the folder beside it"
        )
    if file.attrs.get("format") != FORMAT:
        raise ResultFileError(f"{path} is an HDF5 file, but no result of quito")
    version = int(file.attrs["format_version"])
    if version > FORMAT_VERSION:
        raise ResultFileError(
            f"{path} has format version {version}; this quito reads up to {FORMAT_VERSION}: "
            "update quito to read it"
        )
