"""Expressions of the problem file: values, complaints, and texts that mean harm."""

from __future__ import annotations

import copy
import math
import operator
import pickle
import subprocess
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING

import casadi
import numpy as np
import pytest
from hypothesis import HealthCheck, assume, example, given, settings
from hypothesis import strategies as st
from processor import within

from quito_cli.problem.language.expressions import (
    ExpressionError,
    constant,
    evaluate,
    is_valid_name,
    parse,
    parse_comparison,
)
from quito_cli.problem.language.functions import FUNCTIONS
from quito_cli.problem.language.tables import TableData

if TYPE_CHECKING:
    from casadi import SX


def scope() -> dict[str, SX]:
    """Give symbols and numbers that stand for a problem's names."""
    return {
        "x1": casadi.SX.sym("x1"),
        "x2": casadi.SX.sym("x2"),
        "u": casadi.SX.sym("u"),
        "t": casadi.SX.sym("t"),
        "x": casadi.SX.sym("x", 2),
        "z": casadi.SX.sym("z", 3),
        "A": casadi.SX([[1, 2], [3, 4]]),
        "M": casadi.SX([[1, 2, 3], [4, 5, 6]]),
        "v": casadi.SX([3, -4]),
        "w": casadi.SX([1, 2, 3]),
        "a": casadi.SX(0.5),
        "mu": casadi.SX(2.0),
    }


TABLES = {
    "wind": TableData("wind", np.array([0.0, 1.0, 2.0]), np.array([0.0, 1.0, 4.0]), "cubic"),
    "gust": TableData("gust", np.array([0.0, 1.0]), np.array([2.0, 4.0]), "linear"),
}


def number(text: str) -> object:
    return constant(parse(text), scope(), tables=TABLES)


def complaint(text: str, read: Callable[[str], object] = number) -> tuple[str, str]:
    """Give the message about a text and the part of it that is underlined."""
    with pytest.raises(ExpressionError) as caught:
        read(text)
    error = caught.value
    assert str(error) == error.message
    assert 0 <= error.offset <= len(text)
    assert error.offset + error.length <= len(text)
    return error.message, text[error.offset : error.offset + error.length]


VALUES: dict[str, float] = {
    "1 + 2*3": 7.0,
    "-a^2": -0.25,
    "-3^2": -9.0,
    "2^3^2": 512.0,
    "2**3**2": 512.0,
    "-2^-2": -0.25,
    "(-2)^2": 4.0,
    "2^-1^2": 0.5,
    "7/2": 3.5,
    "1 - 2 - 3": -4.0,
    "8/4/2": 1.0,
    "+-+3": -3.0,
    ".5 + 1. + 1e-1 + 2.5E+1": 26.6,
    "pi": math.pi,
    "a\n  + \t1\r\n": 1.5,
    "if_else(1<2and 2>1, 10, 20)": 10.0,
    "sin(a)": math.sin(0.5),
    "cos(a)": math.cos(0.5),
    "tan(a)": math.tan(0.5),
    "asin(a)": math.asin(0.5),
    "acos(a)": math.acos(0.5),
    "atan(a)": math.atan(0.5),
    "sinh(a)": math.sinh(0.5),
    "cosh(a)": math.cosh(0.5),
    "tanh(a)": math.tanh(0.5),
    "asinh(a)": math.asinh(0.5),
    "acosh(mu)": math.acosh(2.0),
    "atanh(a)": math.atanh(0.5),
    "atan2(-1, -2)": math.atan2(-1, -2),
    "exp(a)": math.exp(0.5),
    "log(a)": math.log(0.5),
    "sqrt(a)": math.sqrt(0.5),
    "abs(-3)": 3.0,
    "sign(-3)": -1.0,
    "sign(0)": 0.0,
    "erf(a)": math.erf(0.5),
    "min(3, 1, 2)": 1.0,
    "max(3, 1, 2)": 3.0,
    "min(v)": -4.0,
    "max(transpose(w))": 3.0,
    "interpolate(a, wind)": 0.25,
    "1 + interpolate(2*a^2, gust)*interpolate(interpolate(a, wind), gust)": 8.5,
    "dot(v, [1, 2])": -5.0,
    "dot(v, A @ v)": 3 * (3 - 8) - 4 * (9 - 16),
    "norm(v)": 5.0,
    "sum(w)": 6.0,
    "w[0]": 1.0,
    "w[-1]": 3.0,
    "transpose(w)[1]": 2.0,
    "M[1, 2]": 6.0,
    "M[-1, 0]": 4.0,
    "(A @ v)[1]": -7.0,
    "a[0]": 0.5,
    "a[:] + a[0, 0]": 1.0,
    "transpose(v) @ v": 25.0,
    "if_else(a < 1, 10, 20)": 10.0,
    "if_else(a <= 0.5, 10, 20)": 10.0,
    "if_else(a > 1, 10, 20)": 20.0,
    "if_else(a >= 0.5, 10, 20)": 10.0,
    "if_else(a == 0.5, 10, 20)": 10.0,
    "if_else(a != 0.5, 10, 20)": 20.0,
    "if_else(0 < a < 1, 10, 20)": 10.0,
    "if_else(0 < a < 0.1, 10, 20)": 20.0,
    "if_else(a > 1 or a < 0.6, 10, 20)": 10.0,
    "if_else(a > 1 and a < 0.6, 10, 20)": 20.0,
    "if_else(not a > 1, 10, 20)": 10.0,
    "if_else((not (a > 1)) and a + 1 > if_else(a < 0, 1, 0), 10, 20)": 10.0,
}


@pytest.mark.parametrize("text", VALUES)
def test_scalar_value(text: str) -> None:
    value = number(text)
    assert isinstance(value, float)
    assert value == pytest.approx(VALUES[text], rel=1e-15, abs=1e-300)


ARRAYS: dict[str, list[object]] = {
    "[1, 2]": [1, 2],
    "[[1, 2]]": [[1, 2]],
    "[[1, 2], [3, a]]": [[1, 2], [3, 0.5]],
    "2*v": [6, -8],
    "v + 1": [4, -3],
    "v*v": [9, 16],
    "v^2": [9, 16],
    "-v/2": [-1.5, 2],
    "A*A": [[1, 4], [9, 16]],
    "A @ A": [[7, 10], [15, 22]],
    "A @ v": [-5, -7],
    "M @ w": [14, 32],
    "M[:, 1]": [2, 5],
    "M[1, :]": [[4, 5, 6]],
    "M[0:2, 1:]": [[2, 3], [5, 6]],
    "w[::-1]": [3, 2, 1],
    "w[1:3]": [2, 3],
    "abs(v)": [3, 4],
    "min(v, 0)": [0, -4],
    "max(v, [1, 1], 2)": [3, 2],
    "interpolate([1, 2]/2, wind)": [0.25, 1],
    "interpolate(A, gust)": [[4, 6], [8, 10]],
    "atan2(v, 1)": [math.atan2(3, 1), math.atan2(-4, 1)],
    "if_else(a > 1, v, 0)": [0, 0],
    "cross(w, [0, 0, 1])": [2, -1, 0],
    "transpose(M)": [[1, 4], [2, 5], [3, 6]],
    "inv(A)": [[-2, 1], [1.5, -0.5]],
    "solve(A, v)": [-10, 6.5],
    "solve(A, A)": [[1, 0], [0, 1]],
    "diag(v)": [[3, 0], [0, -4]],
    "diag(transpose(v))": [[3, 0], [0, -4]],
    "diag(A)": [1, 4],
}


@pytest.mark.parametrize("text", ARRAYS)
def test_array_value(text: str) -> None:
    value = number(text)
    expected = np.array(ARRAYS[text], dtype=float)
    assert isinstance(value, np.ndarray)
    assert value.shape == expected.shape
    np.testing.assert_allclose(value, expected, rtol=1e-14, atol=1e-14)


def test_every_function_has_a_value_here() -> None:
    called = {name for text in (*VALUES, *ARRAYS) for name in parse(text).functions}
    assert called == set(FUNCTIONS)
    assert all(row.doc and row.name == name for name, row in FUNCTIONS.items())


def test_symbols_become_a_dense_expression() -> None:
    values = scope()
    value = evaluate(parse("mu*(1 - x1^2)*x2 - x1 + u*sin(t)"), values)
    f = casadi.Function("f", [values[name] for name in ("x1", "x2", "u", "t")], [value])
    expected = 2 * (1 - 0.3**2) * 0.7 - 0.3 + 0.2 * math.sin(1.1)
    assert float(f(0.3, 0.7, 0.2, 1.1)) == pytest.approx(expected, rel=1e-15)
    assert evaluate(parse("diag(x)"), values).is_dense()


@pytest.mark.parametrize("size", [2, 3, 5, 12])
def test_symbolic_inverse(size: int) -> None:
    matrix = casadi.SX.sym("M", size, size)
    numbers = np.random.default_rng(1).normal(size=(size, size))
    right = np.arange(1.0, size + 1)
    names = {"M": matrix, "b": casadi.SX(right)}
    outputs = [evaluate(parse(text), names) for text in ("inv(M)", "solve(M, b)")]
    inverse, solution = casadi.Function("f", [matrix], outputs)(numbers)
    np.testing.assert_allclose(inverse.full(), np.linalg.inv(numbers), rtol=1e-10, atol=1e-11)
    np.testing.assert_allclose(
        solution.full()[:, 0], np.linalg.solve(numbers, right), rtol=1e-10, atol=1e-10
    )


def test_constant_matrix_with_symbolic_right_side() -> None:
    values = scope()
    f = casadi.Function("f", [values["x"]], [evaluate(parse("solve(A, x)"), values)])
    np.testing.assert_allclose(f([3, -4]).full()[:, 0], [-10, 6.5])


def test_names_and_functions_in_order() -> None:
    expression = parse("u*sin(x1) + final(x2) - pi*cos(u) + x[0]")
    assert expression.names == ("u", "x1", "x2", "x")
    assert expression.functions == ("sin", "final", "cos")
    assert expression.source == expression.text


def test_tables_are_not_among_the_names() -> None:
    expression = parse("interpolate(t + interpolate(x1, gust), wind)*mu - interpolate(u, gust)")
    assert expression.names == ("t", "x1", "mu", "u")
    assert expression.tables == ("wind", "gust")
    assert expression.functions == ("interpolate",)
    assert parse("wind*2").names == ("wind",)
    assert parse("2*x1").tables == ()
    sides = parse_comparison("interpolate(t, wind) <= x1").sides
    assert [side.tables for side in sides] == [("wind",), ()]


def test_table_has_no_value_at_an_end() -> None:
    def read(text: str) -> SX:
        return evaluate(parse(text), scope(), initial={}, final={}, tables=TABLES)

    message = "'wind' has no final value: it is not a state"
    assert complaint("final(wind)", read) == (message, "wind")


def test_expression_can_be_copied_and_pickled() -> None:
    for twin in (copy.deepcopy(parse("2*a^2")), pickle.loads(pickle.dumps(parse("2*a^2")))):
        assert constant(twin, scope()) == 0.5


def test_error_can_be_pickled() -> None:
    error = pickle.loads(pickle.dumps(ExpressionError("wrong", 3, 2)))
    assert (error.message, error.offset, error.length) == ("wrong", 3, 2)


def test_initial_and_final() -> None:
    first, last = {"x1": casadi.SX(1.0), "x": casadi.SX([1, 2])}, {"x1": casadi.SX(5.0)}
    value = evaluate(parse("final(x1) - initial(x1)*initial(x)[1]"), {}, initial=first, final=last)
    assert float(value) == 3.0

    def read(text: str) -> SX:
        refused = {"u": "controls are not allowed here", "x1": "write initial(x1) or final(x1)"}
        return evaluate(parse(text), scope(), refused=refused, initial=first, final=last)

    assert complaint("1 + x1", read) == ("write initial(x1) or final(x1)", "x1")
    assert complaint("final(u)", read) == ("controls are not allowed here", "u")
    assert complaint("final(mu)", read) == ("'mu' has no final value: it is not a state", "mu")
    assert complaint("final(y1)", read) == ("unknown name 'y1'; did you mean 'x1'?", "y1")


def test_comparison_has_sides_and_operators() -> None:
    comparison = parse_comparison("-1 <= x1^2 +\n x2 < 2")
    assert [side.source for side in comparison.sides] == ["-1", "x1^2 + x2", "2"]
    assert [side.names for side in comparison.sides] == [(), ("x1", "x2"), ()]
    assert comparison.operators == ("<=", "<")
    assert parse_comparison("a == 1").operators == ("==",)
    with pytest.raises(ExpressionError) as caught:
        evaluate(parse_comparison("x1^2 <= y9").sides[1], scope())
    assert caught.value.offset == 8


COMPARISON_COMPLAINTS = {
    "x1 + 1": ("a comparison is expected here, such as x <= 1", "x1 + 1"),
    "x1 < 1 and x2 < 1": (
        "write conditions that hold together as constraints of their own",
        "x1 < 1 and x2 < 1",
    ),
    "(x1 < 2) < 1": ("a comparison can only stand in the condition of if_else", "x1 < 2"),
    "x1 = 1": (
        "a single '=' has no meaning here: a comparison is written '==', "
        "and arguments are given by position",
        "=",
    ),
}


@pytest.mark.parametrize("text", COMPARISON_COMPLAINTS)
def test_comparison_complaint(text: str) -> None:
    assert complaint(text, parse_comparison) == COMPARISON_COMPLAINTS[text]


def test_caret_is_mapped_back_behind_powers() -> None:
    text = "  x1^2 +\n  x2^2^2 * y7^2"
    with pytest.raises(ExpressionError) as caught:
        evaluate(parse(text), scope())
    assert caught.value.offset == text.index("y7")
    assert caught.value.length == 2
    assert complaint("x1^2^2 + A^2 + 1")[1] == "A^2"
    assert complaint("x1^2 + sin(x1^2, 2)^3")[1] == "sin(x1^2, 2)"
    assert complaint("x1^2 + not x1")[1] == "n"


EQUALS = COMPARISON_COMPLAINTS["x1 = 1"][0]
QUOTED = "quoted text is not allowed: an expression holds numbers, names and operators"
BRACES = "braces are not allowed: write ( ) to group and [ ] for a list"
TERNARY = "there is no 'if ... else' here: write if_else(condition, a, b)"
ATTRIBUTE = "'.' can only be a decimal point: names have no attributes here"
LOOP = "cannot be a name, and there are no loops here"
KEYWORD = "cannot be a name: write {0}_, say"
PRIME = (
    "a prime has no meaning here: a transpose is written transpose(...), "
    "and a line of `dynamics` is the derivative itself"
)
INFINITY = "infinity stands alone, and only in bounds: write a large number instead, such as 1e3"
PLACE = "a comparison can only stand in the condition of if_else"
CONDITION = "the condition of if_else is a comparison, such as x > 0"
TABLE = "interpolate(x, table) takes the name of a table here, and nothing else"
INDEX = "an index is a whole number written out, counted from 0"
ASCII = "is not allowed: names and numbers are plain ASCII"
COMMA = "a decimal comma is not understood: write a decimal point"
BETWEEN = "a product needs its '*': write it between"

COMPLAINTS: dict[str, tuple[str, str]] = {
    # the ends and the brackets
    "": ("the expression is empty", ""),
    " \n ": ("the expression is empty", " \n "),
    "a +": ("something is missing after '+'", "+"),
    "* a": ("something is missing before '*'", "*"),
    "a + * a": ("something is missing between '+' and '*'", "*"),
    "or a": ("something is missing before 'or'", "or"),
    "sin(a": ("this '(' is never closed", "("),
    "a)": ("this ')' has no opening bracket", ")"),
    "[a)": ("')' cannot close the '[' opened at character 1", ")"),
    "()": ("nothing stands between '(' and ')'", ")"),
    "[]": ("nothing stands between '[' and ']'", "]"),
    "w[]": ("nothing stands between '[' and ']'", "]"),
    "[1, 2, ]": ("something is missing between ',' and ']'", "]"),
    # products, commas, digits
    "2a": ("a product needs its '*': write 2*a", "a"),
    "2 a": ("a product needs its '*': write 2*a", "a"),
    "a mu": ("a product needs its '*': write a*mu", "mu"),
    "2(a)": (f"{BETWEEN} '2' and '('", "("),
    "(a)(a)": (f"{BETWEEN} ')' and '('", "("),
    "(a)2": (f"{BETWEEN} ')' and '2'", "2"),
    "2[0]": (f"{BETWEEN} '2' and '['", "["),
    "w[0](2)": (f"{BETWEEN} ']' and '('", "("),
    "sin a": ("arguments stand in round brackets: write sin(...)", "a"),
    "1j": ("a product needs its '*': write 1*j", "j"),
    "0x10": ("a product needs its '*': write 0*x10", "x10"),
    "1_000": ("the digits of a number stand together, without '_'", "_"),
    "1.5.2": ("a number has one decimal point", ".2"),
    "0777": ("a whole number has no leading zeros: write 777", "0777"),
    "1e999": ("this number is not finite: it is too large for a double", "1e999"),
    "1,5 + a": (COMMA, ","),
    "(1,5)": (COMMA, ","),
    "a, a": ("',' can only separate the arguments of a function or entries of a list", ","),
    "a:2": ("':' can only stand inside an index such as x[0:2]", ":"),
    # operators of other languages
    "a = 2": (EQUALS, "="),
    "max(w, key=a)": (EQUALS, "="),
    "a =< 2": ("'=<' is not an operator: write '<='", "=<"),
    "a => 2": ("'=>' is not an operator: write '>='", "=>"),
    "a && a": ("'&&' is not an operator here: write 'and'", "&&"),
    "a || a": ("'||' is not an operator here: write 'or'", "||"),
    "!a": ("'!' is not an operator here: write 'not'", "!"),
    "a & a": ("'&' is not an operator here: write 'and'", "&"),
    "a | a": ("'|' is not an operator here: write 'or'", "|"),
    "~a": ("'~' is not an operator here: write 'not'", "~"),
    "a // 2": ("'//' is not an operator here: a division is written '/'", "//"),
    "a % 2": ("'%' is not an operator here: there is no remainder", "%"),
    "a << 2": ("'<<' is not an operator here: there are no bit operations", "<<"),
    "a ? 1 : 2": ("'?' is not an operator here: write if_else(condition, a, b)", "?"),
    "a; a": ("';' is not allowed: this has to be one expression", ";"),
    "a # b": (
        "'#' is not allowed inside an expression: a comment belongs to the YAML around it",
        "#",
    ),
    # Python that is no formula
    "a if a else 2": (TERNARY, "if"),
    "1if 1else 2": (TERNARY, "if"),
    "(a := 2)": ("nothing can be assigned inside an expression", ":="),
    "f'{a}'": (QUOTED, "'"),
    'b"a"': (QUOTED, '"'),
    "__import__('os').system('x')": (
        "'__import__' is no name: names begin with a letter",
        "__import__",
    ),
    "().__class__.__bases__": (ATTRIBUTE, "."),
    "a.real": (ATTRIBUTE, "."),
    "1..real": (ATTRIBUTE, "."),
    "lambda: 0": (f"'lambda' {KEYWORD.format('lambda')}", "lambda"),
    "True + 1": (f"'True' {KEYWORD.format('True')}", "True"),
    "None": (f"'None' {KEYWORD.format('None')}", "None"),
    "a is a": (f"'is' {KEYWORD.format('is')}", "is"),
    "[i for i in w]": (f"'for' {LOOP}", "for"),
    "a in w": (f"'in' {LOOP}", "in"),
    "{1: 2}": (BRACES, "{"),
    "{1}": (BRACES, "{"),
    "max(*w)": ("something is missing between '(' and '*'", "*"),
    "max(**w)": ("something is missing between '(' and '**'", "**"),
    "a not a": ("an operator is missing between 'a' and 'not'", "not"),
    "-a + not a": ("this cannot be understood here", "n"),
    # characters
    "a\0": (f"the character (U+0000, a control character) {ASCII}", "\0"),
    "a\\": (f"the character '\\' (U+005C, REVERSE SOLIDUS) {ASCII}", "\\"),
    "ａ": (f"the character 'ａ' (U+FF41, FULLWIDTH LATIN SMALL LETTER A) {ASCII}", "ａ"),
    "1１": (f"the character '１' (U+FF11, FULLWIDTH DIGIT ONE) {ASCII}", "１"),
    "а + 1": (f"the character 'а' (U+0430, CYRILLIC SMALL LETTER A) {ASCII}", "а"),
    "a\u00a0+ 1": (f"the character (U+00A0, NO-BREAK SPACE) {ASCII}", "\u00a0"),
    "1 \N{MINUS SIGN} a": (
        "this minus sign is not the one of the keyboard: write '-'",
        "\N{MINUS SIGN}",
    ),
    "a²": ("a power is written '^2'", "²"),
    "2π": ("the number is written 'pi'", "π"),
    # conditions
    "a < 1": (PLACE, "a < 1"),
    "not a": (PLACE, "not a"),
    "a or 1": (PLACE, "a or 1"),
    "if_else(a, 1, 2)": (CONDITION, "a"),
    "if_else(a > 0 and a, 1, 2)": (CONDITION, "a"),
    "if_else(-(a < 1), 1, 2)": (CONDITION, "-(a < 1)"),
    "if_else(1 < (a < 1), 1, 2)": (PLACE, "a < 1"),
    "if_else(v > 0, 1, 2)": ("a condition compares scalars, not 2x1", "v"),
    # names and calls
    "x3 + 1": ("unknown name 'x3'; did you mean 'x'?", "x3"),
    "Mu": ("unknown name 'Mu'; did you mean 'mu'?", "Mu"),
    "e": ("unknown name 'e'", "e"),
    "sin": ("'sin' is a function: write sin(...)", "sin"),
    "final*2": ("'final' is a function: write final(...)", "final"),
    "a(1)": ("'a' is not a function; README.md lists the functions, under Expressions", "a"),
    "foo()": ("'foo' is not a function; README.md lists the functions, under Expressions", "foo"),
    "2*ln(a)": ("'ln' is not a function; write log(...)", "ln"),
    "arctan(a)": ("'arctan' is not a function; write atan(...)", "arctan"),
    "heaviside(a - 1)": (
        "'heaviside' is not a function; write if_else(a - 1 >= 0, 1, 0)",
        "heaviside",
    ),
    "deg2rad(30)": ("'deg2rad' is not a function; write 30*pi/180", "deg2rad"),
    "deg2rad(a + 1)": ("'deg2rad' is not a function; write (a + 1)*pi/180", "deg2rad"),
    "deg2rad()": ("'deg2rad' is not a function; write (...)*pi/180", "deg2rad"),
    "integral(a^2)": (
        "'integral' is not a function: `lagrange` and the constraints of kind `integral` are "
        "integrated as they stand",
        "integral",
    ),
    "np.sin(a)": ("names have no attributes here: write sin(...) without 'np.'", "."),
    "np.arcsin(a)": ("names have no attributes here: write asin(...) without 'np.'", "."),
    "2*math.pi": ("names have no attributes here: write pi without 'math.'", "."),
    "|a|": ("an absolute value is written abs(...)", "|"),
    "a + |a|": ("an absolute value is written abs(...)", "|"),
    "2*||v||": ("the length of a vector is written norm(...)", "||"),
    "sin(90\N{DEGREE SIGN})": ("angles are in radians: write 90*pi/180", "\N{DEGREE SIGN}"),
    "\N{DEGREE SIGN}": ("angles are in radians: write ...*pi/180", "\N{DEGREE SIGN}"),
    "a'": (PRIME, "'"),
    "30 %": ("a percentage is written as a number, 30/100", "%"),
    "max(a, -.inf)": (INFINITY, "."),
    "\N{INFINITY}": (INFINITY, "\N{INFINITY}"),
    "1 + sine(a)": ("'sine' is not a function; did you mean 'sin'?", "sine"),
    "sin()": ("sin takes 1 argument, not 0", "sin()"),
    "1 + sin(1, 2)": ("sin takes 1 argument, not 2", "sin(1, 2)"),
    "atan2(1)": ("atan2 takes 2 arguments, not 1", "atan2(1)"),
    "max()": ("max takes 1 or more arguments, not 0", "max()"),
    "max(a)": ("max takes two or more arguments, or one vector", "max(a)"),
    "min(A)": ("min takes a vector, not a 2x2 matrix", "min(A)"),
    "min(v, w)": ("the shapes 2x1 and 3x1 do not fit together", "min(v, w)"),
    "initial(x1)": (
        "initial() belongs to boundary constraints and the Mayer cost; it has no meaning here",
        "initial(x1)",
    ),
    "final(x[0])": ("final() takes a name alone, as in final(t) or final(x)[0]", "final(x[0])"),
    # tables
    "a*interpolate(a, wnd)": ("'wnd' is no table; did you mean 'wind'?", "wnd"),
    "interpolate(a, mu)": (
        "'mu' is no table: measured data are given by name under `tables:`",
        "mu",
    ),
    "interpolate(wind, a)": ("'wind' is a table: write interpolate(x, wind)", "wind"),
    "2*wind^2": ("'wind' is a table: write interpolate(x, wind)", "wind"),
    "2*wnd^2": ("unknown name 'wnd'; did you mean 'wind'?", "wnd"),
    "interpolate(a, 2*wind)": (TABLE, "2*wind"),
    "interpolate(a, [1, 2])": (TABLE, "[1, 2]"),
    "interpolate(a, w[0])": (TABLE, "w[0]"),
    "interpolate(a, a > 1)": (TABLE, "a > 1"),
    "interpolate(a, 'wind')": (QUOTED, "'"),
    "interpolate(a > 1, wind)": (PLACE, "a > 1"),
    "interpolate()": ("interpolate takes 2 arguments, not 0", "interpolate()"),
    "interpolate(a)": ("interpolate takes 2 arguments, not 1", "interpolate(a)"),
    "interpolate(a, wind, 1)": ("interpolate takes 2 arguments, not 3", "interpolate(a, wind, 1)"),
    "interpolat(a, wind)": (
        "'interpolat' is not a function; did you mean 'interpolate'?",
        "interpolat",
    ),
    "interpolate + 1": ("'interpolate' is a function: write interpolate(...)", "interpolate"),
    "interpolate(x1, wind)": ("a constant is expected, and 'x1' is none", "x1"),
    # shapes
    "A @ w": ("A @ w: 2x2 times 3x1", "A @ w"),
    "1 + A*v": ("A*v: 2x2 times 2x1: the product of matrices is written '@'", "A*v"),
    "v @ v": ("v @ v: 2x1 times 2x1: the product of two vectors is written dot(a, b)", "v @ v"),
    "2 @ A": ("2 @ A: 1x1 times 2x2: the product with a scalar is written '*'", "2 @ A"),
    "v + w": ("v + w: 2x1 and 3x1: entry by entry, the shapes have to be equal", "v + w"),
    "2^v": ("2^v: an exponent is a scalar, not 2x1", "2^v"),
    "A^2": ("A^2: a 2x2 matrix has no power here: write products with '@'", "A^2"),
    "atan2(v, w)": ("the shapes 2x1 and 3x1 do not fit together", "atan2(v, w)"),
    "dot(v, w)": ("dot takes two vectors of one size, not 2x1 and 3x1", "dot(v, w)"),
    "cross(v, v)": ("cross takes vectors of 3 entries, not 2x1", "cross(v, v)"),
    "norm(A)": ("norm takes a vector, not a 2x2 matrix", "norm(A)"),
    "sum(A)": ("sum takes a vector, not a 2x2 matrix", "sum(A)"),
    "inv(M)": ("inv takes a square matrix, not one of 2x3", "inv(M)"),
    "inv(A*0)": ("the matrix is singular", "inv(A*0)"),
    "solve(A, w)": ("solve(A, b) takes as many rows of b as of A, not 2x2 and 3x1", "solve(A, w)"),
    "diag(M)": ("diag takes a vector or a square matrix, not 2x3", "diag(M)"),
    "[v, 1]": ("an entry of a list is a scalar, not 2x1", "v"),
    "[[1], 2]": ("a list holds either scalars or lists of equal length", "2"),
    "[[1, 2], [3]]": ("the rows of a matrix are equally long, not 2 and 1 entries", "[3]"),
    # indices
    "w[3]": ("w[3]: no entry 3: there are 3 entries, counted from 0", "w[3]"),
    "w[-4]": ("w[-4]: no entry -4: there are 3 entries, counted from 0", "w[-4]"),
    "a[1]": ("a[1]: no entry 1: there is 1 entry, counted from 0", "a[1]"),
    "M[2, 0]": ("M[2, 0]: no row 2: there are 2 rows, counted from 0", "M[2, 0]"),
    "w[0:9]": ("w[0:9]: the slice goes to 9: there are 3 entries, counted from 0", "w[0:9]"),
    "w[2:1]": ("w[2:1]: the slice selects nothing: there are 3 entries, counted from 0", "w[2:1]"),
    "w[::0]": ("the step of a slice cannot be 0", "::0"),
    "w[1.0]": (INDEX, "1.0"),
    "w[a]": (INDEX, "a"),
    "w[--1]": (INDEX, "--1"),
    "M[0]": ("M[0]: a 2x3 matrix takes two indices: [row, column]", "M[0]"),
    "M[0, 0, 0]": ("there are at most two indices: row and column", "M[0, 0, 0]"),
    # constants
    "2*x1": ("a constant is expected, and 'x1' is none", "x1"),
    "u + x1": ("a constant is expected, and 'u' is none", "u"),
    "1/0": ("the value is not finite: inf", "1/0"),
    "[1, log(-1)]": ("the value is not finite: nan", "[1, log(-1)]"),
    "9**9**9**9": ("the value is not finite: inf", "9**9**9**9"),
    "10^10^10": ("the value is not finite: inf", "10^10^10"),
}


@pytest.mark.parametrize("text", COMPLAINTS)
def test_complaint(text: str) -> None:
    assert complaint(text) == COMPLAINTS[text]


HOSTILE: dict[str, str] = {
    "brackets": "(" * 5_000 + "1" + ")" * 5_000,
    "open brackets": "[" * 10_000,
    "indices": "w" + "[0]" * 3_000,
    "calls": "sin(" * 2_000 + "1" + ")" * 2_000,
    "minus signs": "-" * 9_999 + "1",
    "some minus signs": "-" * 500 + "1",
    "nots": "if_else(" + "not " * 2_000 + "a > 1, 1, 2)",
    "tower": "^".join("2" * 1_000),
    "sum": "+".join("1" * 5_000),
    "comparisons": "a<" * 4_000 + "a",
    "ternaries": "1 if 1 else " * 800 + "1",
    "lambdas": "lambda:" * 1_400 + "1",
    "digits": "9" * 10_000,
    "zeros": "0" * 10_000,
    "long name": "x" * 10_000,
    "long function": "s" * 9_000 + "(1)",
    "too long": "1 " * 5_001,
    "nul": "\0" * 100,
    "surrogate": "\ud800",
    "blanks": "\n" * 10_000,
    "column of quotes": "'''" * 3_000,
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_text_is_refused_quickly(name: str) -> None:
    with within(20):
        complaint(HOSTILE[name])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1 " * 5_001, "the expression is too long: 10002 characters, at most 10000"),
        ("(" * 51, "brackets are nested more than 50 deep"),
        ("-" * 300 + "1", "more than 200 operations are chained or nested"),
        ("+".join("1" * 5_000), "more than 200 operations are chained or nested"),
        ("9" * 400, "this number is not finite: it is too large for a double"),
    ],
)
def test_caps(text: str, message: str) -> None:
    assert complaint(text)[0].startswith(message)


def test_what_stays_below_the_caps_is_accepted() -> None:
    assert number("(" * 50 + "1" + ")" * 50) == 1.0
    assert number("+".join("1" * 190)) == 190.0
    assert number("-" * 190 + "1") == 1.0
    assert number("max(" + ",".join("1" * 4_900) + ")") == 1.0


def test_work_is_capped() -> None:
    big = {"X": casadi.SX.sym("X", 100, 100), "l": casadi.SX.sym("l", 150)}
    big["S"] = casadi.SX.sym("S", 13, 13)
    big["N"] = casadi.SX.eye(51)

    def read(text: str) -> SX:
        return evaluate(parse(text), big)

    large = "the expression is too large: it takes more than 200000 operations"
    with within(30):
        assert complaint("X @ X", read) == (large, "X @ X")
        assert complaint("l @ transpose(l)", read)[0].startswith("a matrix of 150x150 is too large")
        assert complaint("+".join(["X"] * 100), read)[0] == large
        assert complaint("diag(l)", read)[0] == (
            "diag of 150 entries is a matrix of more than 10000 entries"
        )
        symbols = "takes matrices of symbols up to 12x12, not 13x13"
        assert complaint("inv(S)", read)[0] == f"inv {symbols}"
        assert complaint("solve(S, S)", read)[0] == f"solve {symbols}"
        assert (
            complaint("inv(N)", read)[0] == "inv takes matrices of numbers up to 50x50, not 51x51"
        )
        places = np.arange(1000.0)
        table = {"long": TableData("long", places, places, "cubic")}
        text = "interpolate(l, long)"
        assert complaint(text, lambda given: evaluate(parse(given), big, tables=table))[0] == large


@pytest.mark.parametrize("name", ["x", "X1", "x_1", "e", "alpha_dot_", "pi2", "T", "I"])
def test_valid_name(name: str) -> None:
    assert is_valid_name(name) is None


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("", "a name cannot be empty"),
        ("t", "'t' is reserved: it is the time"),
        ("pi", "'pi' is reserved: it is a known constant"),
        ("initial", "'initial' is the name of a function"),
        ("sin", "'sin' is the name of a function"),
        ("interpolate", "'interpolate' is the name of a function"),
        ("lambda", "'lambda' cannot be a name: write lambda_, say"),
        ("not", "'not' cannot be a name: write not_, say"),
        ("None", "'None' cannot be a name: write None_, say"),
        *[
            (
                name,
                f"'{name}' is no name: names are letters, digits and '_', and begin with a letter",
            )
            for name in ("1x", "_x", "x-y", "x y", "é", "ｘ", "x'", "x\n", "x１")
        ],
    ],
)
def test_invalid_name(name: str, reason: str) -> None:
    assert is_valid_name(name) == reason


def test_import_does_not_load_casadi() -> None:
    code = (
        "import sys, quito_cli.problem.language.expressions as e; e.parse('x^2'); "
        "sys.exit(bool({'casadi', 'numpy'} & set(sys.modules)))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


Rendered = tuple[str, float]


def _leaf() -> st.SearchStrategy[Rendered]:
    numbers = st.floats(0, 100, allow_subnormal=False).map(lambda value: (repr(value), value))
    whole = st.integers(0, 10**12).map(lambda value: (str(value), float(value)))
    return numbers | whole | st.just(("a", 0.5)) | st.just(("pi", math.pi))


def _grown(inner: st.SearchStrategy[Rendered]) -> st.SearchStrategy[Rendered]:
    """Give trees one level higher: their text in full brackets, and their value in floats."""
    blank = st.sampled_from(["", " ", "\n"])

    def combine(left: Rendered, sign: str, right: Rendered, gap: str) -> Rendered:
        text = f"({left[0]}{gap}{sign}{gap}{right[0]})"
        if sign == "/":
            return text, _finite(left[1] / right[1] if right[1] else math.nan)
        operation = {"+": operator.add, "-": operator.sub, "*": operator.mul}[sign]
        return text, _finite(operation(left[1], right[1]))

    def choose(low: Rendered, high: Rendered, a: Rendered) -> Rendered:
        text = f"if_else({low[0]} < {high[0]}, {a[0]}, -{a[0]})"
        return text, _finite((a[1] if low[1] < high[1] else -a[1]) + 0 * (low[1] + high[1]))

    return st.one_of(
        st.builds(combine, inner, st.sampled_from("+-*/"), inner, blank),
        inner.map(lambda tree: (f"(-{tree[0]}^2)", _finite(-(tree[1] * tree[1])))),
        inner.map(lambda tree: (f"sin({tree[0]})", math.sin(tree[1]))),
        inner.map(lambda tree: (f"abs(-{tree[0]})", abs(tree[1]))),
        st.builds(choose, inner, inner, inner),
    )


def _finite(value: float) -> float:
    """Give NaN for what overflows: it stays NaN up to the root, and the tree is left out there."""
    return value if math.isfinite(value) else math.nan


@settings(suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much], deadline=None)
@given(st.recursive(_leaf(), _grown, max_leaves=20))
def test_random_trees_equal_python_floats(tree: Rendered) -> None:
    text, expected = tree
    assume(not math.isnan(expected))
    value = float(evaluate(parse(text), scope()))
    assert value == pytest.approx(expected, rel=1e-13, abs=1e-300)


def refusal(text: str, read: Callable[[str], object]) -> ExpressionError | None:
    try:
        read(text)
    except ExpressionError as error:
        return error
    return None


PIECES = [*"+-*/^@()[],:<>=!&|~%.;'\"{}# \n\0", "**", "<=", "and", "or", "not", "if", "lambda"]
PIECES += [
    "x1",
    "v",
    "A",
    "sin",
    "if_else",
    "initial",
    "max",
    "inv",
    "1",
    "2.5",
    "1e308",
    "é",
    "for",
]


@settings(max_examples=400, deadline=2000)
@given(st.text(max_size=60) | st.lists(st.sampled_from(PIECES), max_size=25).map("".join))
@example("x[" * 25)
@example("1" + "if" * 40)
def test_random_text_raises_nothing_else(text: str) -> None:
    for read in (parse, parse_comparison, number):
        if (error := refusal(text, read)) is not None:
            assert 0 <= error.offset <= len(text)
            assert 0 <= error.length <= len(text) - error.offset
