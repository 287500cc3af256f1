"""Structures: what each kind of fault makes of one, and what is left when an arc vanishes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import pytest
from polish_parts import phase, setting_of

from quito_cli.optimality.polish.equations.setting import Setting, UnsupportedError
from quito_cli.optimality.polish.equations.structure import Held, Kind, Phase, Structure
from quito_cli.optimality.polish.faults.fault import Fault
from quito_cli.optimality.polish.search.revise import dropped, revised
from quito_cli.solution.polishing import Action

MANY = """\
title: Controls and rows of every kind
time: {initial: 0, final: 1}
states: {x: {upper: 1}, v: {upper: 1}, y: {}}
controls: {u: {lower: -1, upper: 1}, r: {lower: -1, upper: 1}, w: {lower: 0}}
dynamics: {x: v, v: u + r, y: w + u*y}
cost: {lagrange: r^2 + y^2}
constraints:
  path: {cap: u + x <= 1}
"""
CAP, X, V = (0, True), (1, True), (2, True)
"""A mixed row, one of order two, one of order one."""


@cache
def many() -> Setting:
    return setting_of(MANY)


def one(given: Phase) -> Structure:
    return Structure((given,), (0.0, 1.0))


def fault(what: str, start: float, end: float, **more: object) -> Fault:
    made = Fault("sign", start, end, 0.5, "It is so", 0)
    return replace(made, what=what, **more)  # type: ignore[arg-type]


PLAIN = phase("upper", "free", "lower")
HIGH = phase("upper", "upper", "lower")
ARC = phase("upper", "free", "lower", held=[X])
CAPPED = phase("free", "free", "lower", held=[CAP])


@dataclass(frozen=True)
class Case:
    """A structure with a fault, and what it is to become."""

    given: Structure
    fault: Fault
    phases: tuple[Phase, ...]
    times: tuple[float, ...]
    action: Action
    touches: tuple[tuple[int, Held], ...] = ()


LOW = phase("lower", "free", "lower")
IN_THREE = (0.0, 0.2, 0.5, 1.0)
RESTS = Structure((PLAIN,) * 3, (0.0, 0.4, 0.6, 1.0), ((1, X), (2, X)))
REVISIONS = {
    "a wrong sign of an affine control": Case(
        one(PLAIN), fault("sign", 0.2, 0.5, control=0, upper=True), (PLAIN, LOW, PLAIN), IN_THREE,
        "insert",
    ),
    "a wrong sign from the start": Case(
        one(PLAIN), fault("sign", 1e-8, 0.5, control=0, upper=True), (LOW, PLAIN), (0, 0.5, 1),
        "insert",
    ),
    "a wrong sign where there is no other bound": Case(
        one(PLAIN), fault("sign", 0.2, 0.5, control=2),
        (PLAIN, phase("upper", "free", "singular"), PLAIN), IN_THREE, "insert",
    ),
    "a wrong sign of a regular control": Case(
        one(HIGH), fault("sign", 0.2, 0.5, control=1, upper=True), (HIGH, PLAIN, HIGH), IN_THREE,
        "insert",
    ),
    "a control beyond its bound": Case(
        one(PLAIN), fault("beyond", 0.2, 0.5, control=1, upper=True), (PLAIN, HIGH, PLAIN),
        IN_THREE, "insert",
    ),
    "a mixed row violated": Case(
        one(PLAIN), fault("violated", 0.2, 0.5, held=CAP), (PLAIN, CAPPED, PLAIN), IN_THREE,
        "insert",
    ),
    "a state row of order one violated": Case(
        one(PLAIN), fault("violated", 0.2, 0.5, held=V),
        (PLAIN, phase("upper", "free", "lower", held=[V]), PLAIN), IN_THREE, "insert",
    ),
    "a state row of order two violated": Case(
        one(PLAIN), fault("violated", 0.2, 0.5, held=X), (PLAIN, PLAIN), (0, 0.35, 1), "insert",
        ((1, X),),
    ),
    "rest between touches": Case(
        RESTS, fault("violated", 0.4, 0.6, phase=1, held=X), (PLAIN, ARC, PLAIN),
        (0, 0.4, 0.6, 1), "insert",
    ),
    "a pull of a mixed row in the middle": Case(
        one(CAPPED), fault("pull", 0.2, 0.5, held=CAP), (CAPPED, LOW, CAPPED), IN_THREE, "release",
    ),
    "a pull of a state row of order one": Case(
        Structure((PLAIN, phase("upper", "free", "lower", held=[V]), PLAIN), (0, 0.3, 0.7, 1)),
        fault("pull", 0.4, 0.5, phase=1, held=V), (PLAIN,), (0, 1), "release",
    ),
    "a pull of a state row of order two": Case(
        Structure((PLAIN, ARC, PLAIN), (0, 0.3, 0.7, 1)),
        fault("pull", 0.3, 0.3, phase=1, held=X), (PLAIN, PLAIN), (0, 0.5, 1), "release",
        ((1, X),),
    ),
    "an arc of a control that vanished": Case(
        Structure((PLAIN, LOW, HIGH), (0, 0.5, 0.5, 1)), fault("vanished", 0, 0, phase=1),
        (PLAIN, HIGH), (0, 0.5, 1), "drop",
    ),
    "an arc between equal ones that vanished": Case(
        Structure((PLAIN, LOW, PLAIN), (0, 0.5, 0.5, 1)), fault("vanished", 0, 0, phase=1),
        (PLAIN,), (0, 1), "drop",
    ),
    "a first arc that vanished": Case(
        Structure((LOW, PLAIN), (0, -0.1, 1)), fault("vanished", 0, 0), (PLAIN,), (0, 1), "drop",
    ),
    "a last arc that vanished": Case(
        Structure((LOW, PLAIN), (0, 1.1, 1)), fault("vanished", 0, 0, phase=1), (LOW,), (0, 1),
        "drop",
    ),
    "a sign that is wrong beside a switch": Case(
        Structure((LOW, PLAIN), (0, 0.4, 1)),
        fault("sign", 0.4, 0.5, phase=1, control=0, upper=True),
        (LOW, phase("singular", "free", "lower"), PLAIN), (0, 0.4, 0.5, 1), "insert",
    ),
    "an arc of order two that vanished": Case(
        Structure((PLAIN, ARC, PLAIN), (0, 0.5, 0.5, 1)), fault("vanished", 0, 0, phase=1),
        (PLAIN, PLAIN), (0, 0.5, 1), "drop", ((1, X),),
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", REVISIONS.values(), ids=REVISIONS)
def test_a_fault_leads_to_the_structure_that_it_asks_for(case: Case) -> None:
    found = revised(many(), case.given, case.fault)
    assert found is not None
    assert found.structure.phases == case.phases
    assert found.structure.times == pytest.approx(case.times)
    assert found.structure.touches == case.touches
    assert found.action == case.action
    assert found.sentence


NOTHING = {
    "of second order": (one(PLAIN), fault("curvature", 0.2, 0.5)),
    "at an end": (one(PLAIN), fault("end", 0, 0)),
    "what the phase does already": (one(HIGH), fault("beyond", 0, 1, control=1, upper=True)),
    "a junction moved": (
        Structure((HIGH, PLAIN), (0, 0.4, 1)),
        fault("beyond", 0.4, 0.5, phase=1, control=1, upper=True),
    ),
}


@pytest.mark.parametrize(("given", "wrong"), NOTHING.values(), ids=NOTHING)
def test_where_nothing_helps_there_is_no_other_structure(given: Structure, wrong: Fault) -> None:
    assert revised(many(), given, wrong) is None


def test_junctions_of_two_controls_met_in_the_wrong_order_are_put_right() -> None:
    first, second = phase("upper", "lower", "lower"), phase("upper", "upper", "lower")
    start = phase("lower", "lower", "lower")
    crossed = Structure((start, first, second), (0, 0.6, 0.5, 1))
    found = dropped(crossed, 1)
    assert found.phases == (start, phase("lower", "upper", "lower"), second)
    assert found.times == (0, 0.5, 0.6, 1)
    assert dropped(found.at((0, 0.6, 0.5, 1)), 1).phases == crossed.phases


def test_a_row_and_a_control_met_in_the_wrong_order_are_put_right() -> None:
    crossed = Structure((PLAIN, ARC, replace(ARC, kinds=LOW.kinds)), (0, 0.6, 0.5, 1))
    found = dropped(crossed, 1)
    assert found.phases == (PLAIN, LOW, crossed.phases[2])
    assert found.times == (0, 0.5, 0.6, 1)


def test_what_vanishes_beside_a_touch_leaves_the_touch_where_it_is() -> None:
    given = Structure((LOW, PLAIN, HIGH), (0, 0.4, 0.5, 1), ((2, X),))
    found = dropped(given, 1)
    assert found == Structure((LOW, HIGH), (0, 0.5, 1), ((1, X),))
    given = replace(given, touches=((1, X),))
    assert dropped(given, 1) == Structure((LOW, HIGH), (0, 0.4, 1), ((1, X),))


# What determines the controls of a phase

ONLY_U: tuple[Kind, ...] = ("free", "upper", "lower")
CONSISTENT = {
    # An affine control that nothing holds is singular, a regular one is not.
    "nothing holds it": (("free", "singular", "lower"), (), ("singular", "free", "lower"), ()),
    "a row holds it": (("singular", "free", "lower"), (CAP,), ("free", "free", "lower"), (CAP,)),
    "a row has nothing to hold": (("upper", "free", "lower"), (CAP,), PLAIN.kinds, ()),
    # The cap speaks of u alone and takes it first; r is left for the other row.
    "two rows": (("free", "free", "lower"), (V, CAP), ("free", "free", "lower"), (V, CAP)),
    "two rows of one control": (ONLY_U, (V, CAP), ONLY_U, (CAP,)),
    "an infinite bound": (("upper", "free", "upper"), (), ("upper", "free", "singular"), ()),
}


@pytest.mark.parametrize(("kinds", "held", "own", "left"), CONSISTENT.values(), ids=CONSISTENT)
def test_every_free_control_has_what_determines_it(
    kinds: tuple[Kind, ...], held: tuple[Held, ...], own: tuple[Kind, ...], left: tuple[Held, ...]
) -> None:
    assert many().consistent(phase(*kinds, held=held)) == phase(*own, held=left)


def test_a_control_between_its_bounds_at_a_kink_is_not_polished() -> None:
    setting = setting_of(MANY.replace("r^2 + y^2", "abs(r) + y^2"))
    with pytest.raises(
        UnsupportedError,
        match="r is between its bounds where the Hamiltonian has a jump in it, or a kink",
    ):
        setting.consistent(PLAIN)
    assert setting.consistent(HIGH) == HIGH
