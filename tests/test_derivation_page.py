"""Derived formulas as text: equal to what they say, readable, on pages that come at once."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from contextlib import suppress
from fractions import Fraction
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from processor import within

import quito_cli as quito
from quito_cli.cli.app import main
from quito_cli.optimality.hamiltonian import pontryagin
from quito_cli.optimality.page.page import derivation
from quito_cli.optimality.symbols.algebra import Algebra
from quito_cli.optimality.symbols.formulas import Formulas, formulas
from quito_cli.optimality.symbols.probes import Probe
from quito_cli.optimality.symbols.reading import Reader, constant
from quito_cli.optimality.symbols.sums import MOST_TERMS, TooLongError, add, atom, number
from quito_cli.optimality.symbols.wording import Writer
from quito_cli.optimality.transversality import transversality
from quito_cli.problem.build import build
from quito_cli.problem.language.expressions import evaluate, parse
from quito_cli.problem.library import bundled
from quito_cli.problem.load import load_text
from quito_cli.problem.named import with_named_constants
from quito_cli.problem.schema import Problem

ROOT = Path(__file__).parent.parent
BUNDLED = sorted(bundled())


def problem(text: str) -> Problem:
    return load_text(text, "test.yaml")


def small(text: str) -> Problem:
    states = "time: {initial: 0, final: 1}\nstates: {x: {initial: 1}, y: {initial: 0}}\n"
    return problem(f"title: small\n{states}{text}\n")


def page(given: Problem | str, latex: bool = False) -> str:
    return derivation(quito.load(given) if isinstance(given, str) else given, latex=latex)


# Text says what the expression is

NAMES = ("a", "b", "c")
SYMBOLS = {name: ca.SX.sym(name) for name in NAMES}


def rewritten(expression: ca.SX, gathered: tuple[str, ...] = (), together: bool = False) -> str:
    reader = Reader(NAMES)
    (value,) = reader.read([*SYMBOLS.values()], expression)
    writer = Writer(reader, NAMES, gathered)
    if together:
        return writer.quotient(*reader.algebra.fraction(value, number(1)))
    return writer.text(value)


def written(text: str, **how: Any) -> str:
    return rewritten(evaluate(parse(text), SYMBOLS), **how)


def values(expression: ca.SX) -> np.ndarray:
    function = ca.Function("f", [*SYMBOLS.values()], [expression])
    points = np.random.default_rng(3).uniform(0.6, 1.9, (3, 12))
    return np.array(function.map(12)(*points)).ravel()


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a + a", "2*a"),
        ("a - a", "0"),
        ("(a + b)^2 - a^2 - b^2", "2*a*b"),
        ("a*b/(b*c)", "a/c"),
        ("-a*(b - c)", "a*c - a*b"),
        ("0.5*a - a/3", "a/6"),
        ("0.1*a + 0.2*a", "0.3*a"),
        ("sqrt(a)*sqrt(a)", "a"),
        ("sqrt(a + b)*sqrt(a + b)", "a + b"),
        ("a/(b + c) + a/(b + c)", "2*a/(b + c)"),
        ("sin(-a)", "-sin(a)"),
        ("a^0.5*a^1.5", "a^2"),
        ("2*pi*a", "2*pi*a"),
        ("if_else(a > b, a, 0)", "if_else((b < a), a, 0)"),
        ("1 - a", "1 - a"),
        ("-1 + a - b", "a - 1 - b"),
    ],
)
def test_what_is_simplified(text: str, expected: str) -> None:
    found = written(text)
    again = evaluate(parse(expected), SYMBOLS)
    assert written(expected) == found
    assert values(evaluate(parse(found), SYMBOLS)) == pytest.approx(values(again))
    assert len(found) <= len(expected) + 2


def test_terms_are_gathered() -> None:
    text = written("a*b - c + a*b^2 + 2*a*c*b", gathered=("a",))
    assert text == "-c + a*b*(1 + b + 2*c)"


def test_fractions_are_in_lowest_terms() -> None:
    assert written("(a^2 - b^2)/(a - b)", together=True) == "a + b"
    assert written("(a - b)/(a^2 - b^2)", together=True) == "1/((a + b))"
    text = written("1/(a + b) + 1/(a - b)", together=True)
    assert text.startswith("2*a/(")
    assert written("(2*a + 2*b)/(4*c)", together=True) == "a/(2*c) + b/(2*c)"


LEAVES = st.sampled_from(["a", "b", "c", "2", "0.5", "3", "0.7", "(1/3)"])


def _grown(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    pairs = st.tuples(inner, st.sampled_from(["+", "-", "*", "/"]), inner)
    calls = st.tuples(st.sampled_from(["sin", "cos", "exp", "atan", "abs", "tanh"]), inner)
    powers = st.tuples(inner, st.sampled_from(["2", "3", "(-1)", "0.5", "(-2)"]))
    return (
        pairs.map(lambda p: f"({p[0]} {p[1]} {p[2]})")
        | calls.map(lambda p: f"{p[0]}({p[1]})")
        | powers.map(lambda p: f"({p[0]})^{p[1]}")
    )


@settings(max_examples=150, deadline=None, derandomize=True)
@given(st.recursive(LEAVES, _grown, max_leaves=9), st.booleans(), st.booleans())
def test_the_text_has_the_value_of_the_expression(text: str, together: bool, gather: bool) -> None:
    expression = evaluate(parse(text), SYMBOLS)
    before = values(expression)
    assume(np.isfinite(before).all() and np.abs(before).max() < 1e8)
    try:
        found = rewritten(expression, ("b",) if gather else (), together)
    except (TooLongError, ZeroDivisionError):
        return
    after = values(evaluate(parse(found), SYMBOLS))
    scale = max(1.0, float(np.abs(before).max()))
    good = np.isfinite(after)
    assert after[good] == pytest.approx(before[good], rel=1e-6, abs=1e-7 * scale)


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (0.7, Fraction(7, 10)),
        (1 / 3, Fraction(1, 3)),
        (0.1 + 0.2, Fraction(3, 10)),
        (1.4e-7, Fraction("1.4e-7")),
        (6.02e23, Fraction("6.02e23")),
    ],
)
def test_numbers_are_those_that_people_write(value: float, expected: Fraction) -> None:
    assert constant(value) == number(expected)


def test_multiples_of_pi() -> None:
    assert constant(np.pi / 2) == {(("pi", Fraction(1)),): Fraction(1, 2)}


def test_polynomials_are_divided_exactly_or_not_at_all() -> None:
    a, b = atom("a"), atom("b")
    algebra = Algebra()
    whole = algebra.product(add(a, b), add(a, number(-2)))
    assert algebra.divided(whole, add(a, b)) == add(a, number(-2))
    assert algebra.divided(add(whole, number(1)), add(a, b)) is None


def test_long_sums_are_refused_and_not_worked_on() -> None:
    many = ca.SX.sym("m", 2 * MOST_TERMS)
    with pytest.raises(TooLongError):
        Reader([f"m[{i}]" for i in range(2 * MOST_TERMS)]).read([many], ca.sum1(many**2))


@pytest.mark.parametrize(
    "text",
    [
        "(3*a)^1000000000",
        "((((3*a)^100)^100)^100)^100",
        "(a + b)^1000000000",
        "(a + 2*b + 3*c)^(-1000000000)",
        "2^(a*1000)",
        "(" * 40 + "a + 1" + ")^2 + 1" * 40,
        "sin(" * 45 + "a" + ")" * 45,
        "*".join(["(a + b + c + a*b)"] * 60),
    ],
)
def test_nothing_grows_without_end(text: str) -> None:
    with within(60):
        for together in (False, True):
            with suppress(TooLongError, ZeroDivisionError):
                written(text, together=together)


def test_names_of_nested_calls_do_not_double_without_end() -> None:
    a = SYMBOLS["a"]
    for _ in range(300):
        a = ca.sin(a + 1) + ca.cos(a)
    with pytest.raises(TooLongError):
        rewritten(a)


# Formulas of problems


def writing(name: str) -> tuple[Formulas, Probe]:
    given = quito.load(name)
    system = pontryagin(*with_named_constants(given))
    return formulas(given, system, transversality(system), False), Probe(system)


@pytest.mark.parametrize("name", BUNDLED)
def test_adjoint_equations_and_switching_functions_say_what_is_so(name: str) -> None:
    of, probe = writing(name)
    system, m = of.system, of.system.model
    scope: dict[str, ca.SX] = {"t": m.t}
    for variables, stacked in ((m.states, m.x), (m.controls, m.u), (m.parameters, m.p)):
        scope |= {v.name: stacked[v.entries] for v in variables}
    scope |= {of.costates[v.first].partition("[")[0]: system.costate[v.entries] for v in m.states}
    k = system.constants
    scope |= {n: k.symbols[i] for i, n in enumerate(k.names)}
    scope |= {n: system.integral_multipliers[i] for i, n in enumerate(of.integrals)}
    expressions = ca.vertcat(system.free_adjoint, system.switching)
    shown = 0
    for i in range(expressions.numel()):
        text = of.text(expressions[i])
        if text is None:
            continue
        shown += 1
        difference = evaluate(parse(text), scope) - expressions[i]
        both = ca.vertcat(difference, expressions[i])
        function = ca.Function("f", of.inputs, [both])
        found = np.array(function.map(16)(*probe.points))
        assert np.abs(found[0]).max() <= 1e-8 * (1 + np.abs(found[1]).max())
    assert shown == expressions.numel()


@pytest.mark.parametrize("latex", [False, True])
@pytest.mark.parametrize("name", BUNDLED)
def test_all_bundled_problems_have_a_page(name: str, latex: bool) -> None:
    with within(60):
        text = page(name, latex)
    assert "nan" not in text
    assert "None" not in text
    for heading in ("Hamiltonian", "Adjoint equations", "Controls", "Ends"):
        assert heading in text
    if latex:
        assert text.isascii()
        assert text.count("{") == text.count("}")
        assert text.count(r"\begin{") == text.count(r"\end{")
        assert not re.search(r"_(\w|\{[^{}]*\})_", text)  # LaTeX: "double subscript"
        assert not re.search(r"\^\{\([^()]*\)\}\^", text)  # LaTeX: "double superscript"
        assert r"\text{}" not in text.replace(r"\text{} \quad", "")


def test_the_page_of_van_der_pol() -> None:
    text = page("van_der_pol")
    for line in (
        "H = ½ (x₁² + x₂²) + λₓ₁ x₂ + λₓ₂ (μ (1 − x₁²) x₂ − x₁ + u)",
        "λ̇ₓ₁ = −x₁ + λₓ₂ (1 + 2 μ x₁ x₂)",
        "σ = ∂H/∂u = λₓ₂",
        "u = −1 where σ > 0",
        "λₓ₁ = −x₂",
        "u = 2 x₁ − μ x₂ + μ x₁² x₂",
        "−A must not be negative (Legendre-Clebsch, order 1)",
        "λₓ₁(4) = 0",
        "μ = 1",
    ):
        assert f"  {line}\n" in text + "\n"


@pytest.mark.parametrize(
    ("name", "lines"),
    [
        ("alychan", ["u = −x₁", "λₓ₃(π/2) = 1"]),
        ("bressan", ["u = 1/2", "λₓ₃(T) = −1", "T = 10"]),
        ("catalyst_mixing", ["0 = x₁² − 20 x₁ x₂ + 90 x₂², the singular surface"]),
        ("bryson_denham", ["u = −λₓ₂", "C = d²S/dt² = u, of order 2"]),
        ("rayleigh_mixed", ["u = −⅙ x₁ at the upper bound", "η = −2 u − 4 λₓ₂, ≥ 0"]),
        ("van_der_pol_state", ["C = dS/dt = u + μ x₂ − x₁ − μ x₁² x₂, of order 1"]),
        ("minimum_time", ["H(t_f) = −1, the time within its bounds"]),
        ("strongest_column", ["∫ ∂H/∂load dt = 1, the parameter within its bounds"]),
        (
            "strongest_column",
            ["νᵥₒₗᵤₘₑ is ≥ 0 with the integral at an upper bound, ≤ 0 at a lower one, 0 between"],
        ),
        ("robot_path", ["∂H/∂u + η ∂C/∂u = 0 for the other controls between their bounds"]),
        ("goddard", ["D = D₀ v² exp(−β (h − 1))"]),
    ],
)
def test_lines_of_other_pages(name: str, lines: list[str]) -> None:
    text = page(name)
    for line in lines:
        assert f"  {line}\n" in text + "\n"


def test_constants_that_are_zero_or_exponents_stay_numbers() -> None:
    given = small(
        "constants: {n: 3, k: 0, a: 2}\ncontrols: {u: {}}\n"
        "dynamics: {x: a*x^n + k*y + u, y: x}\ncost: {lagrange: u^2}"
    )
    model, constants = with_named_constants(given)
    assert constants.names == ("a",)
    plain, at = build(given), (np.array([0.3, 0.2]), 0.7, np.zeros(0), 0.0)
    inputs = [model.x, model.u, model.p, model.t, constants.symbols]
    named = ca.Function("f", inputs, [model.xdot])(*at, constants.values)
    assert np.array(named) == pytest.approx(np.array(plain.right_hand_side.call([*at])[0]))


# Problems that cannot be written out, and say so


def test_tables_corners_and_choices_are_said_to_be_so() -> None:
    given = small(
        "tables: {wind: {x: [0, 0.3, 0.7, 1], y: [0, 1, 0, 2]}}\ncontrols: {u: {}, v: {}}\n"
        'dynamics: {x: "interpolate(y, wind)*u", y: "if_else(x > 0, v, -x) + abs(x)"}\n'
        "cost: {lagrange: abs(u) + v^2}"
    )
    for latex in (False, True):
        text = page(given, latex)
        assert "enters H with a corner" in text
        assert "sgn" in text or "too long" in text
    assert "wind(y) u" in page(given)
    assert "too long to write out" in page(given)


def test_sixty_states_take_no_minutes() -> None:
    lines = [
        "title: many\ntime: {initial: 0, final: 1}",
        "states: {x: {size: 60, initial: 1}}",
        "controls: {u: {lower: -1, upper: 1}}",
        "dynamics: {x: ["
        + ", ".join(f'"sin(x[{i + 1}])*x[{i}] - x[{i}]^3"' for i in range(59))
        + ', "u + x[0]*x[1]"]}',
        'cost: {lagrange: "dot(x, x)"}',
    ]  # fmt: skip
    with within(60):
        text = page(problem("\n".join(lines)))
    assert "and 48 more costates, which are left out" in text
    assert "too long" in text or "singular where" in text


def test_a_problem_that_has_the_letters_itself() -> None:
    given = small(
        "controls: {H: {lower: 0, upper: 1}, sigma: {}}\n"
        "dynamics: {x: H, y: sigma}\ncost: {lagrange: x^2 + sigma^2}"
    )
    assert "∂ℋ/∂H" in page(given)
    assert "ς" in page(given)
    assert r"\mathcal{H}" in page(given, latex=True)


def test_a_constant_may_be_called_as_a_multiplier_usually_is() -> None:
    """Van der Pol's mu is no multiplier: that of the constraint has a letter of its own."""
    first = "dλ/dt = −∂H/∂x, less η ∂C/∂x where a constraint is active"
    assert first in page("van_der_pol_state")
    given = small(
        "constants: {eta: 2, C: 3}\ncontrols: {u: {}}\ndynamics: {x: eta*u, y: C*x}\n"
        "cost: {lagrange: u^2}\nconstraints: {path: {p: x + u <= 1}}"
    )
    assert first.replace("η", "χ").replace("C", "𝒞") in page(given)


def test_several_boundary_constraints_have_multipliers_of_their_own() -> None:
    given = small(
        "controls: {u: {}}\ndynamics: {x: u, y: x}\ncost: {lagrange: u^2}\n"
        "constraints: {boundary: {closed: final(x) == initial(y), far: final(y) >= 2}}"
    )
    text = page(given)
    assert "λₓ(1) = ω_closed" in text or "λₓ(1) = ωcₗₒₛₑd" in text
    assert "ω" in text.split("λ_y(1) = ")[1].splitlines()[0]


# The command


Command = Callable[..., tuple[int, str, str]]


@pytest.fixture
def command(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Command:
    """Run a command in this process: its exit code, what it prints, and its complaints."""

    def run(*arguments: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["quito", *arguments])
        code = 0
        try:
            main()
        except SystemExit as left:
            code = left.code if isinstance(left.code, int) else int(left.code is not None)
        out, err = capsys.readouterr()
        return code, out, err

    return run


def test_show_pontryagin(command: Command) -> None:
    code, out, err = command("show", "bressan", "--pontryagin")
    assert (code, err) == (0, "")
    assert out.startswith("Bressan problem, bang then singular\n")
    assert "\nHamiltonian\n  H = λₓ₁ u + λₓ₂ (−x₁) + λₓ₃ (x₂ − x₁²)\n" in out
    code, out, err = command("show", "bressan", "--pontryagin", "--latex")
    assert (code, err) == (0, "")
    assert out.startswith(r"\paragraph{Hamiltonian}")


@pytest.mark.parametrize("other", ["--json", "--yaml"])
def test_pontryagin_goes_with_latex_only(other: str, command: Command) -> None:
    code, out, err = command("show", "bressan", "--pontryagin", other)
    assert (code, out) == (2, "")
    assert "--pontryagin goes with --latex only" in err


def test_a_result_is_refused(tmp_path: Path, command: Command) -> None:
    quito.solve("bressan", steps=10).save(tmp_path / "r.h5")
    code, out, err = command("show", str(tmp_path / "r.h5"), "--pontryagin")
    assert (code, out) == (2, "")
    assert "name that" in err
