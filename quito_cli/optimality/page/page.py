"""The page that `quito show PROBLEM --pontryagin` prints: Pontryagin's conditions of one problem.

Hamiltonian, adjoint equations, controls with their switching functions and singular feedbacks, arcs
on constraints, conditions at the ends: derived, simplified, and written in the problem's symbols.
What would be too long to read is left out, and the page says so.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from quito_cli.optimality.hamiltonian import pontryagin
from quito_cli.optimality.page.page_controls import control_lines
from quito_cli.optimality.page.page_ends import constraint_lines, end_lines
from quito_cli.optimality.page.setting import MOST_LINES, Setting
from quito_cli.optimality.symbols.formulas import Formulas, formulas
from quito_cli.optimality.symbols.probes import Probe
from quito_cli.optimality.transversality import transversality
from quito_cli.problem.language.syntax import parse
from quito_cli.problem.mathematics.notation import Piece
from quito_cli.problem.mathematics.page import Line, latex_page, unicode_page
from quito_cli.problem.named import with_named_constants
from quito_cli.problem.schema import Problem


@dataclass(frozen=True)
class Part:
    """A part of the page."""

    heading: str
    lines: tuple[Line, ...]


def derivation(problem: Problem, *, latex: bool) -> str:
    """Return Pontryagin's conditions of a problem as text, in unicode or LaTeX with amsmath.

    Raises:
        ProblemError: with every mistake in its formulas, sizes and bounds.
    """
    model, constants = with_named_constants(problem)
    system = pontryagin(model, constants)
    ends = transversality(system)
    setting = Setting(formulas(problem, system, ends, latex), Probe(system))
    parts = [
        Part("Hamiltonian", tuple(_hamiltonian(problem, setting))),
        Part("Adjoint equations", tuple(_adjoint(setting))),
        Part("Controls", tuple(control_lines(setting))),
        Part("Constraints", tuple(constraint_lines(setting))),
        Part("Ends", tuple(end_lines(setting))),
        Part("where", (*_expressions(problem, setting), *_constants(problem, setting))),
    ]
    return "\n\n".join(_laid_out(part, latex) for part in parts if part.lines)


def _laid_out(part: Part, latex: bool) -> str:
    if latex:
        return f"\\paragraph{{{part.heading}}}\n" + latex_page([("", list(part.lines))], "")
    body = unicode_page([("", list(part.lines))], "")
    inner = "\n".join("  " + line[len("subject to ") :].rstrip() for line in body.splitlines())
    return f"{part.heading}\n{inner}"


def _hamiltonian(problem: Problem, setting: Setting) -> Iterator[Line]:
    """Write H in the problem's own words, its named expressions not written out."""
    text = _summed(problem, setting.of)
    piece = setting.of.piece(text) if text else None
    if piece is None:
        general = setting.maths("L + λᵀf", r"L + \lambda^{\top} f")
        yield setting.equation(setting.letter("H"), general, ", too long to write out")
    else:
        yield setting.equation(setting.letter("H"), piece)
    yield setting.say("to be minimised by the controls; the costates are ", setting.costate_is)
    if setting.of.system.model.sense < 0:
        yield setting.say("the cost is maximised in the file: L and the end cost have changed sign")


def _summed(problem: Problem, of: Formulas) -> str:
    """Return H as a formula of the language, from the texts of the file."""
    m = of.system.model
    lagrange = problem.cost.lagrange
    terms = []
    if not m.lagrange.is_zero():
        terms.append(f"{'-' if m.sense < 0 else ''}({lagrange})")
    for variable in m.states:
        value = problem.dynamics[variable.name]
        names = of.costates[variable.entries]
        if isinstance(value, list):
            terms += [f"{name}*({entry})" for name, entry in zip(names, value, strict=True)]
        elif variable.vector:
            terms.append(f"dot({names[0].split('[')[0]}, {value})")
        elif str(value) == "1":
            terms.append(names[0])
        else:
            terms.append(f"{names[0]}*({value})")
    for name, constraint in zip(of.integrals, m.constraints.integral, strict=True):
        integrand = of.text(constraint.value)
        if integrand is None:
            return ""
        terms.append(f"{name}*({integrand})")
    return " + ".join(terms)


def _adjoint(setting: Setting) -> Iterator[Line]:
    of = setting.of
    rule = setting.adjoint
    rows = any(row.value.numel() for row in of.system.rows)
    extra: Sequence[str | Piece] = ()
    if rows:
        pull = setting.pull(setting.maths("x", "x"))
        extra = (", less ", pull, " where a constraint is active")
    yield setting.say(rule, *extra)
    n = of.system.model.n_x
    shown = min(n, MOST_LINES)
    for i, piece in enumerate(of.values(of.system.free_adjoint[:shown])):
        yield setting.equation(setting.rate(i), piece)
    if n > shown:
        yield setting.say(f"and {n - shown} more costates, which are left out")


def _expressions(problem: Problem, setting: Setting) -> Iterator[Line]:
    """Write the named expressions of the file, which H is written with."""
    for name, text in problem.expressions.items():
        yield setting.equation(setting.named(name), setting.of.piece(str(text)))
    if any(isinstance(value, list) for value in problem.constants.values()):
        yield setting.say("with vectors and matrices as in the problem")


def _constants(problem: Problem, setting: Setting) -> Iterator[Line]:
    times = (problem.time.initial, problem.time.final)
    spoken = {name for time in times if isinstance(time, str) for name in parse(time).names}
    k, notation = setting.of.system.constants, setting.of.notation
    pairs = zip(k.names, k.values.tolist(), strict=True)
    used = [(name, value) for name, value in pairs if name in setting.used_constants | spoken]
    texts = [
        f"{notation.symbols[name].text(notation.latex)} = {notation.signed(notation.number(value))}"
        for name, value in used
    ]
    if texts:
        commas = [text + "," for text in texts[:-1]]
        yield Line((*commas, texts[-1]), gap=r" \quad " if notation.latex else "  ")
