"""Problem -> text: the problem as a paper states it, in unicode or LaTeX."""

from quito_cli.problem.mathematics.statement import notation_of, render

__all__ = ["notation_of", "render"]
