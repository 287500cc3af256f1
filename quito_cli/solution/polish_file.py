"""What a polish adds to a result file, written and read: its account, multipliers by time."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, get_args

import numpy as np

from quito_cli.solution.densities import Densities, Impulse
from quito_cli.solution.groups import Group, texts
from quito_cli.solution.polishing import Action, Polishing, PolishStatus, PolishStep
from quito_cli.solution.trajectory import Polynomials

if TYPE_CHECKING:
    import h5py

OF_POLISHING = ("reason", "residual", "seconds", "cost_before", "segments", "newton_steps")
"""Fields of the account of a polish that are attributes as they are."""


def write_polishing(into: Group, polishing: Polishing) -> None:
    """Write the account of a polish."""
    steps, attributes = polishing.steps, into.attributes
    attributes["status"] = polishing.status.name
    for name in OF_POLISHING:
        attributes[name] = getattr(polishing, name)
    into.axis("step", np.arange(len(steps)))
    into.data("action", texts(step.action for step in steps), "step")
    into.data("sentence", texts(step.sentence for step in steps), "step")
    into.data("residuals", np.array([len(step.residuals) for step in steps], dtype=int), "step")
    values = np.array([r for step in steps for r in step.residuals], dtype=float)
    into.axis("solve", np.arange(len(values)))
    into.data("residual", values, "solve")


def read_polishing(group: h5py.Group) -> Polishing:
    """Return the account of a polish.

    Raises:
        ValueError, LookupError: a word in it that there is not.
    """
    attributes, ends = group.attrs, np.cumsum(group["residuals"][:])
    residuals = [tuple(map(float, part)) for part in np.split(group["residual"][:], ends)]
    actions: list[Any] = [str(action) for action in group["action"].asstr()[:]]
    check(Action, actions)
    sentences = map(str, group["sentence"].asstr()[:])
    return Polishing(
        PolishStatus[attributes["status"]],
        str(attributes["reason"]),
        tuple(map(PolishStep, actions, sentences, residuals)),
        float(attributes["residual"]),
        float(attributes["seconds"]),
        float(attributes["cost_before"]),
        int(attributes["segments"]),
        int(attributes["newton_steps"]),
    )


def write_densities(into: Group, given: Densities) -> None:
    """Write multipliers by time."""
    curve, impulses = given.curve, given.impulses
    into.attributes["degree"] = curve.degree
    into.axis("time", curve.times)
    into.axis("row", texts(given.labels))
    into.data("density", curve.states, "time", "row")
    if curve.before is not None:
        into.axis("cell", np.arange(len(curve.before)))
        into.data("density_before", curve.before, "cell", "row")
    into.axis("impulse", np.arange(len(impulses)))
    into.data("node", np.array([one.node for one in impulses], dtype=int), "impulse")
    into.data("of_row", np.array([one.row for one in impulses], dtype=int), "impulse")
    into.data("size", np.array([one.size for one in impulses], dtype=float), "impulse")


def read_densities(group: h5py.Group) -> Densities:
    """Return multipliers by time.

    Raises:
        ValueError: an impulse at a node, or of a row, that there is not.
    """
    before = group["density_before"][:] if "density_before" in group else None
    degree = int(group.attrs["degree"])
    curve = Polynomials(group["time"][:], group["density"][:], degree, before)
    labels = tuple(str(label) for label in group["row"].asstr()[:])
    columns = (group[name][:].tolist() for name in ("node", "of_row", "size"))
    impulses = tuple(Impulse(*row) for row in zip(*columns, strict=True))
    for one in impulses:
        if not (0 <= one.node <= curve.cells and 0 <= one.row < len(labels)):
            raise ValueError("an impulse is at no node, or of no row")
    return Densities(labels, curve, impulses)


def check(possible: Any, found: Iterable[str]) -> None:
    """Refuse words that are none of a Literal's.

    Raises:
        ValueError: there is one.
    """
    for one in found:
        if one not in get_args(possible):
            raise ValueError(f"{one} is none of {', '.join(get_args(possible))}")
