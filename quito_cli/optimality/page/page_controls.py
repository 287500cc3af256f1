"""The part of the page on controls: what minimises H, switching functions, singular feedbacks."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from quito_cli.optimality.looking.controls import Regular, controls
from quito_cli.optimality.page.setting import MOST_LINES, Setting
from quito_cli.optimality.singular import Reason, Singular, singular
from quito_cli.optimality.symbols.elimination import Eliminated, eliminated
from quito_cli.optimality.symbols.probes import TooLargeError
from quito_cli.problem.mathematics.notation import Piece
from quito_cli.problem.mathematics.page import Line

MOST_ARCS = 6
"""Affine controls whose singular arcs are worked out: each may take half a second."""

_REASONS: dict[Reason, str] = {
    "constant": "it never changes: no singular arc but where it is zero throughout",
    "no finite order": "its derivatives never contain the control: no singular arc of finite order",
    "too large": "its further derivatives are too long: whether there is a singular arc is open",
    "not determined": "the controls are not determined by its derivatives",
}


def control_lines(setting: Setting) -> Iterator[Line]:
    """Write how every control minimises H."""
    system = setting.of.system
    try:
        found = controls(system, setting.probe)
    except TooLargeError:
        yield setting.say("H is too long to be worked on")
        return
    left = MOST_LINES
    for group in found.regular:
        if left > 0:
            yield from _regular(setting, group)
        left -= len(group.controls)
    interior = found.of_kind("regular")
    for place, i in enumerate(found.of_kind("affine")):
        if left > 0:
            yield from _affine(setting, i, interior, arcs=place < MOST_ARCS)
        left -= 1
    for i in found.of_kind("kinked")[:MOST_LINES]:
        words = " enters H with a corner, as in abs(u): no derivative is taken there"
        yield setting.say(setting.control(i), words)
    for i in found.of_kind("absent")[:MOST_LINES]:
        yield setting.say(setting.control(i), " does not enter H: any value is as good")
    if left < 0:
        yield setting.say(f"and {-left} more controls, which are left out")


def _regular(setting: Setting, group: Regular) -> Iterator[Line]:
    """Write H_u = 0, what it gives, and H_uu."""
    pairs = list(zip(group.controls, setting.of.values(group.gradient), strict=True))
    for i, gradient in pairs:
        yield setting.equation(setting.slope(setting.letter("H"), setting.control(i)), gradient)
    if group.closed is not None:
        for row, i in enumerate(group.controls):
            yield from setting.quotient(setting.control(i), group.closed[row])
            yield from _within(setting, i)
    else:
        names = ", ".join(setting.joined(setting.control(i)) for i in group.controls)
        zero = setting.maths("= 0", "= 0")
        words = " inside its bounds" if len(group.controls) == 1 else " inside their bounds"
        yield setting.say(
            Piece((names,)), ": where the above ", zero, words, ", by Newton's method"
        )
        for i in group.controls:
            yield from _at_bounds(
                setting, i, setting.slope(setting.letter("H"), setting.control(i))
            )
    if len(group.controls) == 1:
        u, h = setting.control(group.controls[0]), setting.letter("H")
        text = setting.joined(u)
        second = setting.maths(
            f"∂²{setting.joined(h)}/∂{text}²",
            rf"\partial^2 {setting.joined(h)}/\partial {text}^2",
        )
        value = setting.one(group.curvature)
        yield setting.equation(second, value, ", must not be negative (Legendre)")


def _within(setting: Setting, i: int) -> Iterator[Line]:
    """Write that a control stays within its bounds."""
    low, high = (float(side[i]) for side in setting.of.system.model.control_bounds)
    if np.isfinite(low) and np.isfinite(high):
        ends = (setting.number(low), " and ", setting.number(high))
        yield setting.say("if this is between ", *ends, ", else the nearer of them")
    elif np.isfinite(low) or np.isfinite(high):
        side, bound = ("above", low) if np.isfinite(low) else ("below", high)
        number = setting.number(bound)
        yield setting.say(f"if this is {side} ", number, ", else ", number)


def _at_bounds(setting: Setting, i: int, slope: Piece) -> Iterator[Line]:
    """Write at which bound a control is, by the sign of H_u there."""
    low, high = (float(side[i]) for side in setting.of.system.model.control_bounds)
    for bound, sign in ((low, ">"), (high, "<")):
        if np.isfinite(bound):
            where = (" where ", slope, Piece((f" {sign} 0",)))
            yield setting.equation(setting.control(i), setting.number(bound), *where)


def _affine(setting: Setting, i: int, interior: tuple[int, ...], *, arcs: bool) -> Iterator[Line]:
    """Write a switching function, and the singular arc where it vanishes."""
    system, several = setting.of.system, setting.of.system.model.n_u > 1
    u, sigma = setting.control(i), setting.letter("sigma")
    if several:
        text, name = setting.joined(sigma), setting.joined(u)
        sigma = setting.maths(f"{text}({name})", rf"{{{text}^{{({name})}}}}")
    slope = setting.slope(setting.letter("H"), u)
    value = setting.one(system.switching[i])
    left = Piece((f"{setting.joined(sigma)} = {setting.joined(slope)}",))
    yield setting.equation(left, value)
    yield from _at_bounds(setting, i, sigma)
    if not arcs:
        yield setting.say("its singular arcs are left out")
        return
    arc = singular(system, setting.probe, (i,), interior)
    degrees = range(1, len(arc.derivatives[0]))
    for degree in degrees:
        derivative = setting.one(arc.derivatives[0][degree])
        yield setting.equation(setting.derived(sigma, degree), derivative)
        if derivative is None:
            break
    if arc.coefficient is None:
        yield setting.say(_REASONS[arc.reason])
    else:
        yield from _singular(setting, arc, u, sigma)


def _singular(setting: Setting, arc: Singular, u: Piece, sigma: Piece) -> Iterator[Line]:
    """Write A, the sign it needs, the costates on the arc and the feedback."""
    degree = arc.degrees[0]
    a, b, text = setting.letter("A"), setting.joined(setting.letter("B")), setting.joined(u)
    front = setting.joined(a)
    form = setting.maths(f"{front} {text} + {b}", rf"{front}\,{text} + {b}")
    (value,) = [None] if arc.coefficient is None else setting.of.values(arc.coefficient)
    yield setting.equation(setting.derived(sigma, degree), form)
    yield setting.equation(a, value)
    yield setting.say("singular where ", sigma, Piece((" = 0",)), " on an interval:")
    found = eliminated(arc, setting.probe)
    if found is not None:
        yield from _on_the_arc(setting, arc, found, u)


def _on_the_arc(setting: Setting, arc: Singular, found: Eliminated, u: Piece) -> Iterator[Line]:
    """Write what the conditions of a singular arc determine."""
    for i, value in found.costates.items():
        yield from setting.quotient(setting.named(setting.of.costates[i]), value)
    if found.surface is not None:
        surface = setting.of.numerator(found.surface)
        yield setting.equation(setting.maths("0", "0"), surface, ", the singular surface")
    others = setting.of.system.model.n_u > 1
    yield from setting.quotient(u, found.feedback)
    if others:
        yield setting.say("with the other controls on their bounds, or as above")
    order = arc.order
    if order is not None and found.clebsch is not None:
        left = replace(setting.letter("A"), negative=order % 2 == 1)
        yield from setting.quotient(left, found.clebsch)
        words = f" must not be negative (Legendre-Clebsch, order {order})"
        yield setting.say(left, words)
