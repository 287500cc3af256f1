"""The parts of the page on active constraints and on the ends of the horizon."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from quito_cli.optimality.constraints import Active, active
from quito_cli.optimality.hamiltonian import Row
from quito_cli.optimality.page.setting import Setting
from quito_cli.optimality.transversality import Freedom
from quito_cli.problem.mathematics.notation import Piece
from quito_cli.problem.mathematics.page import Line
from quito_cli.problem.model import labels

MOST_ROWS = 8
"""Rows of constraints that are written out."""


def constraint_lines(setting: Setting) -> Iterator[Line]:
    """Write what holds on arcs where a constraint is active."""
    rows = setting.of.system.rows
    if rows and any(np.isfinite(side) for row in rows for side in (row.lower, row.upper)):
        yield from _general(setting)
    for i, row in enumerate(rows[:MOST_ROWS]):
        yield _comparison(setting, row)
        sides = [upper for upper in (False, True) if np.isfinite(row.upper if upper else row.lower)]
        arcs = [active(setting.of.system, setting.probe, i, upper=upper) for upper in sides]
        for arc in arcs if row.mixed else arcs[:1]:
            yield from _arc(setting, arc)
    if len(rows) > MOST_ROWS:
        yield setting.say(f"and {len(rows) - MOST_ROWS} more rows, which are left out")


def _general(setting: Setting) -> Iterator[Line]:
    """Write what is the same on all arcs."""
    state = any(not row.mixed for row in setting.of.system.rows)
    c, s = setting.letter("C"), setting.letter("S")
    x, u = setting.maths("x", "x"), setting.maths("u", "u")
    zero = Piece((f"{setting.joined(c)} = 0",))
    yield setting.say("where a constraint is active, ", zero, " determines a control;")
    yield setting.say(c, " is its value less the bound")
    if state:
        first = ("or, where no control is in that difference ", s, ", the first derivative of ", s)
        yield setting.say(*first, " with one")
    yield setting.say(setting.adjoint, setting.maths(" − ", " - "), setting.pull(x))
    if setting.of.system.model.n_u > 1:
        slope, zero = setting.slope(setting.letter("H"), u), setting.maths(" = 0", " = 0")
        words = " for the other controls between their bounds"
        yield setting.say(slope, setting.maths(" + ", " + "), setting.pull(u), zero, words)
    if state:
        costate = setting.maths("λ", r"\lambda")
        words = " and its derivatives before that vanish, and "
        yield setting.say("where the arc begins, ", s, words, costate)
        yield setting.say("jumps along their gradients")


def _comparison(setting: Setting, row: Row) -> Line:
    """Write lower ≤ value ≤ upper."""
    value = setting.one(row.value) or Piece(("…",))
    sides, operators = [value], []
    if row.lower == row.upper:
        sides, operators = [value, setting.number(row.upper)], ["=="]
    elif np.isfinite(row.lower) and not np.isfinite(row.upper):
        sides, operators = [value, setting.number(row.lower)], [">="]
    else:
        if np.isfinite(row.lower):
            sides, operators = [setting.number(row.lower), value], ["<="]
        sides, operators = [*sides, setting.number(row.upper)], [*operators, "<="]
    name = "" if row.state else setting.joined(f"{row.label}: ")
    return Line(setting.of.notation.relation(sides, operators).terms, name)


def _arc(setting: Setting, arc: Active) -> Iterator[Line]:
    """Write the order, the control and the multiplier of an arc on a constraint."""
    order, row = arc.order, arc.system.rows[arc.row]
    if order is None:
        yield setting.say("no control appears in its derivatives, or only in ones too long")
        return
    side = " at " + ("the upper bound" if arc.upper else "the lower bound")
    if order:
        s, c = setting.letter("S"), setting.joined(setting.letter("C"))
        left = Piece((f"{c} = {setting.joined(setting.derived(s, order))}",))
        yield setting.equation(left, setting.one(arc.held), f", of order {order}")
        side = ""
    elif row.lower == row.upper:
        side = ""
    entry = arc.controls[0]
    control, eta = arc.control(entry), setting.letter("eta")
    if control is None:
        names = Piece((setting.joined(setting.control(entry)),))
        yield setting.say(names, " is the root of it", side)
    else:
        yield from setting.quotient(setting.control(entry), control, side)
    if len(arc.controls) > 1:
        yield setting.say("or another control from the same equation")
    sign = "" if order or row.lower == row.upper else ", ≥ 0" if arc.upper else ", ≤ 0"
    yield from setting.quotient(eta, arc.multiplier(entry), sign)


def end_lines(setting: Setting) -> Iterator[Line]:
    """Write the transversality conditions."""
    import casadi as ca

    ends, m = setting.of.ends, setting.of.system.model
    at = m.ends
    function = ends.end_function
    if "fixed" in (*ends.initial, *ends.final):
        yield setting.say("a state that is fixed at an end leaves its costate free there")
    yield from _end(setting, "initial", ends.initial, -ca.gradient(function, at.x0))
    yield from _end(setting, "final", ends.final, ca.gradient(function, at.xf))
    times = (("initial", ends.initial_time, at.t0, 1), ("final", ends.final_time, at.tf, -1))
    for which, freedom, time, sign in times:
        if freedom != "fixed":
            (value,) = setting.of.at_ends(sign * ca.gradient(function, time))
            words = ", as the time is free" if freedom == "free" else ", the time within its bounds"
            yield setting.equation(_taken(setting, setting.letter("H"), which), value, words)
    by_p = ca.gradient(function, m.p)
    pieces = setting.of.at_ends(by_p) if m.n_p else []
    for label, freedom, piece in zip(labels(m.parameters), ends.parameters, pieces, strict=True):
        if freedom != "fixed":
            yield _parameter(setting, setting.named(label), piece)
    if m.constraints.boundary:
        omega = setting.maths("ω", r"\omega")
        yield setting.say("with a multiplier ", omega, " for each boundary constraint: its sign is")
        yield setting.say(
            "≥ 0 at an upper bound, ≤ 0 at a lower one, 0 between, and any where it is equal"
        )
    for name, constraint in zip(setting.of.integrals, m.constraints.integral, strict=True):
        if not constraint.bounds.fixed.all():
            words = " is ≥ 0 with the integral at an upper bound, ≤ 0 at a lower one, 0 between"
            yield setting.say(setting.named(name), words)
    if m.constraints.point:
        yield setting.say("the costates jump at the times of point constraints, along their slopes")
    whole = ca.vertcat(setting.of.system.hamiltonian, *(r.value for r in setting.of.system.rows))
    if not ca.depends_on(whole, m.t):
        h = setting.letter("H")
        yield setting.say(h, " is constant along an extremal, as nothing depends on the time")


def _end(
    setting: Setting, which: str, freedoms: tuple[Freedom, ...], slopes: object
) -> Iterator[Line]:
    """Write the costates of what is not fixed at an end."""
    shown = [i for i, freedom in enumerate(freedoms) if freedom != "fixed"]
    pieces = setting.of.at_ends(slopes) if shown else []  # type: ignore[arg-type]
    for i in shown[:MOST_ROWS]:
        ranged = freedoms[i] == "range"
        words = ", the state there within its bounds" if ranged else ""
        costate = setting.at_end(setting.of.costates[i], which)
        yield setting.equation(costate, pieces[i], words)
    if len(shown) > MOST_ROWS:
        yield setting.say(f"and {len(shown) - MOST_ROWS} more, which are left out")


def _taken(setting: Setting, letter: Piece, which: str) -> Piece:
    """Write a letter at an end of the horizon."""
    end = setting.of.notation.ends[which == "final"]
    return Piece((f"{setting.joined(letter)}({setting.joined(end)})",))


def _parameter(setting: Setting, name: Piece, slope: Piece | None) -> Line:
    """Write M_p + ∫ H_p dt = 0."""
    h, p = setting.joined(setting.letter("H")), setting.joined(name)
    low, high = (setting.joined(end) for end in setting.of.notation.ends)
    integral = setting.maths(
        f"∫ ∂{h}/∂{p} dt", rf"\int_{{{low}}}^{{{high}}} \partial {h}/\partial {p} \, \mathrm{{d}}t"
    )
    value = None if slope is None else Piece(slope.terms, slope.level, not slope.negative)
    return setting.equation(integral, value, ", the parameter within its bounds")
