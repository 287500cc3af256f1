"""`quito schema`: the JSON Schema of problem files."""

from __future__ import annotations

import typer


def schema() -> None:
    """Print the JSON Schema of problem files."""
    from quito_cli.problem.json_schema import schema_text

    typer.echo(schema_text(), nl=False)
