"""Problem -> text: the problem as a paper states it, in unicode or LaTeX."""

from quito_cli.problem.mathematics.page import latex_lines
from quito_cli.problem.mathematics.statement import render, statement
from quito_cli.problem.mathematics.values import notation_of

__all__ = ["latex_lines", "notation_of", "render", "statement"]
