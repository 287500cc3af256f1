"""Problems printed as mathematics: whole pages by eye, brackets and signs by reading them back."""

from __future__ import annotations

import ast
import operator
import re
import unicodedata
from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import quito_cli as quito
from quito_cli.problem.language.expressions import parse
from quito_cli.problem.library import bundled
from quito_cli.problem.mathematics import render
from quito_cli.problem.schema import Problem

VAN_DER_POL = """\
minimise   ½ ∫₀⁴ (x₁² + x₂²) dt    (over u)
subject to x\u0307₁ = x₂
           x\u0307₂ = μ (1 − x₁²) x₂ − x₁ + u
           x₁(0) = 0,  x₂(0) = 1
           |u(t)| ≤ 1
with       t ∈ [0, 4],  μ = 1"""
VAN_DER_POL_LATEX = r"""\[
\begin{aligned}
\underset{u}{\text{minimise}} \quad & \tfrac{1}{2} \int_0^4 (x_1^2 + x_2^2) \, \mathrm{d}t \\
\text{subject to} \quad & \dot{x}_1 = x_2 \\
\quad & \dot{x}_2 = \mu\,(1 - x_1^2)\,x_2 - x_1 + u \\
\quad & x_1(0) = 0, \quad x_2(0) = 1 \\
\quad & |u(t)| \le 1 \\
\text{with} \quad & t \in [0, 4], \quad \mu = 1
\end{aligned}
\]"""
BANG_BANG = """\
minimise   ½ ∫₀¹ (exp(−t) − 2 t) x dt    (over u)
subject to x\u0307 = −t x + ln(u + t + 3)
           x(0) = 0
           x(1) = 0.8
           |u(t)| ≤ 1
with       t ∈ [0, 1]"""
BANG_BANG_LATEX = r"""\[
\begin{aligned}
\underset{u}{\text{minimise}} \quad & \tfrac{1}{2} \int_0^1 (\mathrm{e}^{-t} - 2 t)\,x \, \mathrm{d}t \\
\text{subject to} \quad & \dot{x} = -t\,x + \ln(u + t + 3) \\
\quad & x(0) = 0 \\
\quad & x(1) = 0.8 \\
\quad & |u(t)| \le 1 \\
\text{with} \quad & t \in [0, 1]
\end{aligned}
\]"""  # noqa: E501
BRESSAN = """\
minimise   −x₃(T)    (over u)
subject to x\u0307₁ = u
           x\u0307₂ = −x₁
           x\u0307₃ = x₂ − x₁²
           x₁(0) = 0,  x₂(0) = 0,  x₃(0) = 0
           |u(t)| ≤ 1
with       t ∈ [0, T],  T = 10"""
BRESSAN_LATEX = r"""\[
\begin{aligned}
\underset{u}{\text{minimise}} \quad & {-}x_3(T) \\
\text{subject to} \quad & \dot{x}_1 = u \\
\quad & \dot{x}_2 = -x_1 \\
\quad & \dot{x}_3 = x_2 - x_1^2 \\
\quad & x_1(0) = 0, \quad x_2(0) = 0, \quad x_3(0) = 0 \\
\quad & |u(t)| \le 1 \\
\text{with} \quad & t \in [0, T], \quad T = 10
\end{aligned}
\]"""

FUNCTIONS = ("sin", "exp", "log", "sqrt", "abs")
STAND_INS = {name: i for i, name in enumerate(("sin", "exp", "ln", "√"), start=2)}
"""Any function will do to compare two readings exactly: f(x) = x/i + i."""


def power(base: Fraction, exponent: Fraction) -> Fraction:
    """Give a power that is a fraction again; others are not compared."""
    assume(exponent.denominator == 1 and abs(exponent) < 50)
    return Fraction(base ** int(exponent))


OPERATIONS: dict[type[ast.operator], Callable[[Fraction, Fraction], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: power,
}
VALUES = {"x1": Fraction(3, 7), "u": Fraction(-5, 3), "mu": Fraction(11, 4), "v_max": Fraction(2)}
VULGAR = "½⅓⅔¼¾⅕⅖⅗⅘⅙⅚⅛⅜⅝⅞"
LOOKS = {"x₁": "x1", "u": "u", "μ": "mu", "vₘₐₓ": "v_max"}


def problem(equation: str, **more: Any) -> Problem:
    """Give a problem of one state `x1` with these dynamics."""
    values: dict[str, Any] = {
        "time": {"initial": 0, "final": 1},
        "states": {"x1": {}},
        "controls": {"u": {}},
        "constants": {"mu": 1, "v_max": 2},
        "dynamics": {"x1": equation},
        "cost": {"lagrange": 0},
    }
    return Problem.model_validate(values | more)


def shown(formula: str, *, latex: bool = False, **more: Any) -> str:
    """Give a formula as it is printed, lines that were broken put together again."""
    page = render(problem(formula, **more), latex=latex)
    left = r"\dot{x}_1" if latex else "x\u0307₁"
    lines = page.replace(r" \\", "").splitlines()
    first = next(i for i, line in enumerate(lines) if f"{left} = " in line)
    last = next(i for i, line in enumerate(lines) if re.match(r"with|\\text\{with\}", line))
    joined = " ".join(re.sub(r"^\\quad & |\\qquad \{\} ", "", x).strip() for x in lines[first:last])
    return joined.split(" = ", 1)[1]


@dataclass
class Reading:
    """An independent reader of the printed formulas; it returns their value, exactly.

    A sum may begin with a minus sign, no other place may; a product is juxtaposed or has dots; on
    one line, a quotient ends the product.
    """

    text: str
    place: int = field(default=0)

    def whole(self) -> Fraction:
        value = self.sum()
        assert self.place == len(self.text), self.text[self.place :]
        return value

    def skip(self, pattern: str) -> str:
        match = re.compile(pattern).match(self.text, self.place)
        self.place += len(match[0]) if match else 0
        return match[0] if match else ""

    def sum(self) -> Fraction:
        value = -self.product() if self.skip("−") else self.product()
        while sign := self.skip(r" [+−] |(?<=\w)[+−](?=\w)"):
            value += self.product() * (-1 if "−" in sign else 1)
        return value

    def product(self) -> Fraction:
        value = self.factor()
        while self.skip(rf"·| (?=[\w(|√\\{VULGAR}])"):
            value *= self.factor()
        return value / self.factor() if self.skip("/") else value

    def factor(self) -> Fraction:
        base = self.base()
        if raised := self.skip("[⁺⁻⁰¹²³⁴-⁹]+"):
            plain = raised.translate(str.maketrans("⁺⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "+-0123456789"))
            base **= sum(map(int, re.findall(r"[+-]?\d+", plain)))
        elif self.skip(r"\^"):
            braces = self.text[self.place] == "{"
            base = power(base, self.closed("{", "}") if braces else self.base())
        return base

    def closed(self, left: str, right: str) -> Fraction:
        assert self.skip(re.escape(left)), self.text[self.place :]
        value = self.sum()
        assert self.skip(re.escape(right)), self.text[self.place :]
        return value

    def base(self) -> Fraction:
        here = self.text[self.place]
        if here in "(|":
            value = self.closed(here, ")" if here == "(" else "|")
            return value if here == "(" else abs(value)
        if self.skip("frac"):
            return self.closed("{", "}") / self.closed("{", "}")
        if name := self.skip("|".join(LOOKS)):
            return VALUES[LOOKS[name]]
        if name := self.skip("sin|ln|exp|√"):
            raised = self.skip("[²³]") or ("²" if self.skip(r"\^2") else "")
            raised = raised or ("³" if self.skip(r"\^3") else "")
            times = {"": 1, "²": 2, "³": 3}[raised]
            bracket = "()" if self.text[self.place] == "(" else "{}"
            return stand_in(name, self.closed(*bracket)) ** times
        if vulgar := self.skip(f"[{VULGAR}]"):
            numerator, denominator = unicodedata.normalize("NFKC", vulgar).split("\u2044")
            return Fraction(int(numerator), int(denominator))
        number = self.skip(r"\d+(\.\d+)?")
        assert number, self.text[self.place :]
        return Fraction(number)


def stand_in(name: str, value: Fraction) -> Fraction:
    return value / STAND_INS[name] + STAND_INS[name]


def one_line(latex: str) -> str:
    """Spell LaTeX so that `Reading` can read it; its brackets and braces stay."""
    spelled = {
        r"\left(": "(",
        r"\right)": ")",
        r"\left|": "|",
        r"\right|": "|",
        r"\,": " ",
        r" \cdot ": "·",
        r"\tfrac": "frac",
        r"\frac": "frac",
        r"\mathrm{e}^{": "exp{",
        r"\sin": "sin",
        r"\ln": "ln",
        r"\sqrt": "√",
        r"\mu": "μ",
        "x_1": "x₁",
        r"v_{\mathrm{max}}": "vₘₐₓ",
        "-": "−",
    }
    for old, new in spelled.items():
        latex = latex.replace(old, new)
    return latex


def meant(node: ast.AST) -> Fraction:
    """Evaluate the tree of a formula exactly, by the rules of Python."""
    match node:
        case ast.Constant(value=value):
            return Fraction(repr(value))
        case ast.Name(id=name):
            return VALUES[name]
        case ast.UnaryOp(op=op, operand=operand):
            return -meant(operand) if isinstance(op, ast.USub) else meant(operand)
        case ast.Call(func=ast.Name(id="abs"), args=[argument]):
            return abs(meant(argument))
        case ast.Call(func=ast.Name(id=name), args=[argument]):
            return stand_in({"log": "ln", "sqrt": "√"}.get(name, name), meant(argument))
        case ast.BinOp(left=left, op=op, right=right):
            a, b = meant(left), meant(right)
            return Fraction(OPERATIONS[type(op)](a, b))
    raise AssertionError(ast.dump(node))


def combined(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    """Build larger formulas out of smaller ones, with and without brackets."""
    part = inner | inner.map(lambda text: f"({text})")
    exponent = st.sampled_from(["2", "3", "1", "-1", "-2", "(-2)", "(1+1)", "(2-3)", "(6/3)"])
    return st.one_of(
        st.tuples(part, st.sampled_from("+-*/"), part).map(" ".join),
        st.tuples(part, st.just("^"), exponent).map("".join),
        part.map("-{}".format),
        part.map("+{}".format),
        st.tuples(st.sampled_from(FUNCTIONS), inner).map(lambda pair: f"{pair[0]}({pair[1]})"),
    )


ATOMS = st.sampled_from([*VALUES, "2", "3", "0.5", "0.25", "1/2", "3/4", "1/7", "1.5", "10"])
FORMULAS = st.recursive(ATOMS, combined, max_leaves=8)


@settings(max_examples=600, deadline=None)
@given(FORMULAS, st.booleans())
def test_what_is_printed_means_what_was_written(formula: str, latex: bool) -> None:
    try:
        value = meant(parse(formula).tree)
    except ZeroDivisionError:
        assume(False)
    assume(value.denominator < 10**60 and abs(value.numerator) < 10**60)
    text = shown(formula, latex=latex)
    assert Reading(one_line(text) if latex else text).whole() == value, text


@pytest.mark.parametrize(
    ("formula", "unicode", "latex"),
    [
        ("mu-(u-x1)", "μ − (u − x₁)", r"\mu - (u - x_1)"),
        ("mu+(u-x1)", "μ + u − x₁", r"\mu + u - x_1"),
        ("mu/(u*x1)", "μ/(u x₁)", r"\frac{\mu}{u\,x_1}"),
        ("mu+(-u+x1)", "μ + (−u + x₁)", r"\mu + (-u + x_1)"),
        ("-u^2", "−u²", "-u^2"),
        ("(-u)^2", "(−u)²", "(-u)^2"),
        ("2^-u", "2⁻ᵘ", "2^{-u}"),
        ("mu/u/x1", "(μ/u)/x₁", r"\frac{\frac{\mu}{u}}{x_1}"),
        ("mu*(u/x1)", "μ (u/x₁)", r"\mu\,\frac{u}{x_1}"),
        ("mu*u/x1", "μ u/x₁", r"\frac{\mu\,u}{x_1}"),
        ("-(mu+u)", "−(μ + u)", r"-(\mu + u)"),
        ("u - -x1", "u − (−x₁)", "u - (-x_1)"),
        ("-u*x1 + mu", "−u x₁ + μ", r"-u\,x_1 + \mu"),
        ("mu*(-u)", "μ (−u)", r"\mu\,(-u)"),
        ("--u", "−(−u)", "-(-u)"),
        ("2*3*u", "2·3 u", r"2 \cdot 3\,u"),
        ("u*2", "u·2", r"u \cdot 2"),
        ("2*(u/3)", "2 (u/3)", r"2 \cdot \frac{u}{3}"),
        ("0.5*u", "½ u", r"\tfrac{1}{2} u"),
        ("-3/4*u", "−¾ u", r"-\tfrac{3}{4} u"),
        ("0.1*u", "0.1 u", "0.1 u"),
        ("2e-7*u", "2·10⁻⁷ u", r"2 \cdot 10^{-7}\,u"),
        ("(u+1)^3", "(u + 1)³", "(u + 1)^3"),
        ("u^(mu+1)", "u^(μ + 1)", r"u^{\mu + 1}"),
        ("u^(1/2)", "u^(1/2)", "u^{1/2}"),
        ("(u^2)^3", "(u²)³", "(u^2)^3"),
        ("2^3^u", "2^(3ᵘ)", "2^{3^u}"),
        ("sin(u)^2", "sin²(u)", r"\sin^2(u)"),
        ("log(u)^2", "(ln(u))²", r"(\ln(u))^2"),
        ("exp(-u/mu)", "exp(−u/μ)", r"\mathrm{e}^{-u/\mu}"),
        ("sqrt(u)*abs(x1)", "√(u) |x₁|", r"\sqrt{u}\,\left|x_1\right|"),
        ("norm([u, 1])", "‖[u, 1]‖", r"\left\|\begin{pmatrix} u \\ 1 \end{pmatrix}\right\|"),
        ("cos(u/2)", "cos(u/2)", r"\cos\left(\frac{u}{2}\right)"),
        ("asinh(u) + sign(u)", "arsinh(u) + sgn(u)", None),
        ("max(u, 0)*pi", "max(u, 0) π", r"\max(u, 0)\,\pi"),
    ],
)
def test_brackets_and_signs(formula: str, unicode: str, latex: str | None) -> None:
    assert shown(formula) == unicode
    if latex is not None:
        page = render(problem(formula), latex=True)
        assert f"= {latex} \\\\\n" in page


@pytest.mark.parametrize(
    ("formula", "unicode", "latex"),
    [
        ("A @ x + b*u", "A x + b u", r"A\,\mathbf{x} + \mathbf{b}\,u"),
        ("A @ (x + b)", "A (x + b)", r"A\,(\mathbf{x} + \mathbf{b})"),
        ("dot(x, A @ x)", "xᵀ A x", r"\mathbf{x}^{\top} A\,\mathbf{x}"),
        ("dot(x + b, x)", "(x + b)ᵀ x", r"(\mathbf{x} + \mathbf{b})^{\top} \mathbf{x}"),
        ("transpose(A)*2", "Aᵀ·2", r"A^{\top} \cdot 2"),
        ("inv(A) @ x", "A⁻¹ x", r"A^{-1}\,\mathbf{x}"),
        ("solve(A, x)", "A⁻¹ x", r"A^{-1}\,\mathbf{x}"),
        ("u*cross(x, b)", "u (x × b)", r"u\,(\mathbf{x} \times \mathbf{b})"),
        ("x*b*u", "(x ∘ b) u", r"(\mathbf{x} \circ \mathbf{b})\,u"),
        ("x[0] + x[-1]", "x₁ + x₂", "x_1 + x_2"),
        ("A[0, 1] + A[-1][0]", "A₁₂ + (A₂)₁", "A_{12} + (A_2)_1"),
        ("x[0:2]", "x_1:2", "x_{1:2}"),
        ("p[-1]", "p[-1]", "p[-1]"),
        ("(A @ x)[1]", "(A x)₂", r"(A\,\mathbf{x})_2"),
        ("[[u, 1], [0, 2]]", "[[u, 1], [0, 2]]", r"\begin{pmatrix} u & 1 \\ 0 & 2 \end{pmatrix}"),
    ],
)
def test_vectors_and_matrices(formula: str, unicode: str, latex: str | None) -> None:
    more = {
        "constants": {"A": [[0, 1], [2, 3]], "b": [1, 2]},
        "states": {"x": {"size": 2, "initial": [0, None]}},
        "dynamics": {"x": formula},
    }
    pages = [render(problem("", **more), latex=latex) for latex in (False, True)]
    assert f" x\u0307 = {unicode}\n" in pages[0]
    if latex is not None:
        assert f"\\dot{{\\mathbf{{x}}}} = {latex} \\\\\n" in pages[1]
    assert "x₁(0) = 0\n" in pages[0]
    assert "t ∈ [0, 1],  x ∈ ℝ²,  A = [[0, 1], [2, 3]],  b = [1, 2]" in pages[0]
    assert r"A = \begin{pmatrix} 0 & 1 \\ 2 & 3 \end{pmatrix}" in pages[1]


def test_if_else() -> None:
    formula = "2*if_else(u > 0 and not (x1 <= 1 or u == 2), -u, 0)"
    choice = "(−u if u > 0 and (not (x₁ ≤ 1 or u = 2)), else 0)"
    assert shown(formula) == f"2 {choice}"
    assert r"\begin{cases} -u & \text{if } u > 0" in render(problem(formula), latex=True)


@pytest.mark.parametrize(
    ("name", "unicode", "latex"),
    [
        ("x10", "x₁₀", "x_{10}"),
        ("omega_0", "ω₀", r"\omega_0"),
        ("lam", "λ", r"\lambda"),
        ("Phi", "Φ", r"\Phi"),
        ("v_max", "vₘₐₓ", r"v_{\mathrm{max}}"),
        ("v_ref", "v_ref", r"v_{\mathrm{ref}}"),
        ("k_theta", "k_θ", r"k_{\theta}"),
        ("beta_hat", "β\u0302", r"\hat{\beta}"),
        ("x_bar_2", "x\u0304₂", r"\bar{x}_2"),
        ("x1_ref", "x₁_ref", r"x_{1,\mathrm{ref}}"),
        ("mass", "mass", r"\mathit{mass}"),
        ("mass_dot", "mass_dot", r"\mathit{mass}_{\mathrm{dot}}"),
        ("a1b", "a1b", r"\mathit{a1b}"),
    ],
)
def test_names(name: str, unicode: str, latex: str) -> None:
    more = {"constants": {name: 7}}
    assert render(problem("u", **more), latex=False).endswith(f",  {unicode} = 7")
    assert rf"\quad {latex} = 7" in render(problem("u", **more), latex=True)


def test_names_that_look_alike_keep_their_spelling() -> None:
    more = {"constants": {"a1": 1, "a_1": 2, "eps": 3, "epsilon": 4}}
    assert "a1 = 1,  a_1 = 2,  eps = 3,  epsilon = 4" in render(problem("u", **more), latex=False)
    assert r"\mathtt{a1} = 1, \quad \mathtt{a\_1} = 2" in render(problem("u", **more), latex=True)


@given(st.sets(st.from_regex(r"[A-Za-z][A-Za-z0-9_]{0,5}", fullmatch=True), min_size=2, max_size=6))
def test_names_can_be_told_apart(names: set[str]) -> None:
    page = render(problem("0", constants=dict.fromkeys(names, 7)), latex=False)
    printed = re.findall(r"(\S+) = 7", page)
    assert len(set(printed)) == len(names)


def test_derivatives() -> None:
    states = ["theta", "theta_dot", "x_2", "mass"]
    more = {"states": {name: {} for name in states}, "dynamics": dict.fromkeys(states, 0)}
    unicode, latex = (render(problem("", **more), latex=latex) for latex in (False, True))
    for left in ("θ\u0307", "θ\u0308", "x\u0307₂", "d mass/dt"):
        assert f" {left} = 0\n" in unicode
    for left in (r"\dot{\theta}", r"\ddot{\theta}", r"\dot{x}_2", r"\dot{\mathit{mass}}"):
        assert f"& {left} = 0 \\\\\n" in latex


@pytest.mark.parametrize(
    ("cost", "expected"),
    [
        ({"mayer": "x1^2 + t", "lagrange": "u^2"}, "x₁(1)² + 1 + ∫₀¹ u² dt"),
        ({"mayer": "x1", "lagrange": "-u"}, "x₁(1) − ∫₀¹ u dt"),
        ({"lagrange": "-(u + t)"}, "−∫₀¹ (u + t) dt"),
        ({"lagrange": "-0.5*u^2"}, "−½ ∫₀¹ u² dt"),
        ({"lagrange": "10*u/2"}, "∫₀¹ 10 u/2 dt"),
        ({"lagrange": "-u + t"}, "∫₀¹ (−u + t) dt"),
        ({"mayer": "final(x1) - initial(x1)"}, "x₁(1) − x₁(0)"),
        ({"lagrange": 0}, "0"),
    ],
)
def test_objective(cost: dict[str, str], expected: str) -> None:
    page = render(problem("u", cost=cost), latex=False)
    assert page.splitlines()[0] == f"minimise   {expected}    (over u)"


@pytest.mark.parametrize(
    ("bounds", "expected"),
    [
        ({"lower": -1, "upper": 1}, "|u(t)| ≤ 1"),
        ({"lower": "-mu", "upper": "mu"}, "|u(t)| ≤ μ"),
        ({"lower": 0, "upper": 1}, "0 ≤ u(t) ≤ 1"),
        ({"lower": 0, "upper": 0}, "u(t) = 0"),
        ({"lower": "mu/2"}, "u(t) ≥ μ/2"),
        ({"lower": float("-inf"), "upper": 1}, "u(t) ≤ 1"),
        ({"size": 2, "lower": -1, "upper": 1}, "−1 ≤ u(t) ≤ 1"),
        ({"size": 2, "lower": -1, "upper": [1, None]}, "|u₁(t)| ≤ 1,  u₂(t) ≥ −1"),
        ({"size": 2, "upper": "b"}, "u(t) ≤ b"),
        ({"size": 2, "lower": [0, None], "upper": "b"}, "0 ≤ u₁(t) ≤ b₁,  u₂(t) ≤ b₂"),
    ],
)
def test_bounds(bounds: dict[str, Any], expected: str) -> None:
    more = {"controls": {"u": bounds}, "constants": {"mu": 1, "b": [1, 2]}}
    assert f"           {expected}\n" in render(problem("x1", **more), latex=False)


def test_a_large_matrix_is_not_written_out() -> None:
    constants = {"M": [[1.0] * 9] * 9, "c": [1.0] * 12}
    page = render(problem("u", constants=constants), latex=False)
    assert "M = 9×9 matrix,  c = 12-vector" in page


def test_long_sums_are_broken() -> None:
    formula = " + ".join(f"u^{i}*x1" for i in range(2, 40))
    lines = render(problem(formula), latex=False).splitlines()
    assert max(map(len, lines)) <= 101  # one dot above takes no room
    broken = [line for line in lines if line.startswith(" " * 16 + "+ u")]
    assert len(broken) == 4


def test_what_is_no_formula_is_printed_as_it_stands() -> None:
    assert shown("u +* {x_1") == "u +* {x_1"
    latex = render(problem("u +* {x_1 \\ %"), latex=True)
    assert r"\text{\ttfamily u +* \{x\_1 \textbackslash{} \%}" in latex


def whole_language() -> Problem:
    """Give a problem with sections beyond those that `problem` has."""
    more = {
        "sense": "maximize",
        "time": {"initial": 0, "final": {"lower": 0.1, "guess": 1}},
        "parameters": {"p": {"lower": 0, "guess": 1}},
        "expressions": {"D": "0.5*v_max*x1^2"},
        "tables": {"rho": {"x": [0, 1], "y": [1, 2], "method": "linear"}},
        "constraints": {
            "path": {"mixed": "u + x1/6 <= 2", "band": "-1 <= x1 - u < 1"},
            "boundary": {"closed": "final(x1) - initial(x1) != 0"},
            "integral": {"fuel": "u^2 <= 5", "work": "-1 <= x1*u <= mu", "wrong": "u"},
            "point": {"way": {"at": 0.5, "holds": "x1 == 1"}},
        },
    }
    return problem("u*interpolate(x1, rho)", **more)


def test_the_whole_language() -> None:
    assert render(whole_language(), latex=False).splitlines() == [
        "maximise   0    (over u, p, t_f)",
        "subject to x\u0307₁ = u ρ(x₁)",
        "           t_f ≥ 0.1,  p ≥ 0",
        "           u + x₁/6 ≤ 2",
        "           −1 ≤ x₁ − u < 1",
        "           x₁(t_f) − x₁(0) ≠ 0",
        "           ∫₀^t_f u² dt ≤ 5",
        "           −1 ≤ ∫₀^t_f x₁ u dt ≤ μ",
        "           u",
        "           x₁ = 1, at t = 0.5",
        "where      D = ½ vₘₐₓ x₁²",
        "           ρ(·): linear interpolation of 2 points",
        "with       t ∈ [0, t_f],  μ = 1,  vₘₐₓ = 2",
    ]
    latex = render(whole_language(), latex=True)
    assert r"& \int_0^{t_f} u^2 \, \mathrm{d}t \le 5 \\" in latex
    assert r"& x_1 = 1\quad \text{at } t = 0.5 \\" in latex
    assert_balanced(latex)


@pytest.mark.parametrize(
    ("name", "unicode", "latex"),
    [
        ("van_der_pol", VAN_DER_POL, VAN_DER_POL_LATEX),
        ("bang_bang", BANG_BANG, BANG_BANG_LATEX),
        ("bressan", BRESSAN, BRESSAN_LATEX),
    ],
)
def test_bundled_problems(name: str, unicode: str, latex: str) -> None:
    assert render(quito.load(name), latex=False) == unicode
    assert render(quito.load(name), latex=True) == latex


@pytest.mark.parametrize("name", bundled())
def test_every_bundled_problem_can_be_printed(name: str) -> None:
    assert "subject to" in render(quito.load(name), latex=False)
    assert_balanced(render(quito.load(name), latex=True))


def assert_balanced(latex: str) -> None:
    """Check that braces, heights of brackets and environments come in pairs."""
    depth = 0
    for brace in re.findall(r"(?<!\\)[{}]", latex):
        depth += 1 if brace == "{" else -1
        assert depth >= 0
    assert depth == 0
    for row in latex.split("\\\\\n"):
        assert len(re.findall(r"\\left\b", row)) == len(re.findall(r"\\right\b", row))
    assert sorted(re.findall(r"\\begin(\{\w+\})", latex)) == sorted(
        re.findall(r"\\end(\{\w+\})", latex)
    )


def anything(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    """Build formulas of the whole language, whether they make sense or not."""
    condition = st.tuples(inner, st.sampled_from(["<", ">=", "==", "!="]), inner).map(" ".join)
    return st.one_of(
        combined(inner),
        st.tuples(inner, st.just("@"), inner).map(" ".join),
        st.tuples(condition, inner, inner).map(
            lambda p: "if_else(not {} or 1<2, {}, {})".format(*p)
        ),
        st.tuples(st.sampled_from(["dot", "cross", "solve", "min", "atan2"]), inner, inner).map(
            lambda p: "{}({}, {})".format(*p)
        ),
        st.tuples(st.sampled_from(["norm", "inv", "transpose", "sum", "diag", "erf"]), inner).map(
            lambda p: "{}({})".format(*p)
        ),
        st.tuples(
            inner, st.sampled_from(["[0]", "[-1]", "[1:]", "[0, :2]", "[12, 3]", "[::2]"])
        ).map(lambda p: "({}){}".format(*p)),
        st.lists(inner, min_size=1, max_size=3).map(lambda p: f"[{', '.join(p)}]"),
    )


ANYTHING = st.recursive(
    st.sampled_from([*VALUES, "t", "pi", "initial(x1)", "final(t)", "x1[0]", "1e-9", "7", "zz_9_"]),
    anything,
    max_leaves=12,
)


@settings(max_examples=300, deadline=None)
@given(ANYTHING | st.text(max_size=20), ANYTHING | st.text(max_size=20), st.booleans())
def test_anything_can_be_printed(first: str, second: str, vector: bool) -> None:
    states = {"x1": {"size": 2} if vector else {}}
    cost = {"lagrange": first, "mayer": second}
    made = problem(second, states=states, cost=cost, constants={"mu": first, "v_max": [1, 2]})
    assert "subject to" in render(made, latex=False)
    assert_balanced(render(made, latex=True))


@pytest.mark.parametrize("formula", ["-" * 45 + "u", "u" + "^2" * 45, "(" * 49 + "u" + ")" * 49])
@pytest.mark.parametrize("join", [" + ", " - ", "/", " @ ", "*"])
def test_deep_formulas(formula: str, join: str) -> None:
    whole = join.join(["u"] * 120 + [formula])
    assert_balanced(render(problem(whole, cost={"lagrange": whole}), latex=True))
