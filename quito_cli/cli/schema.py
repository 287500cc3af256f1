"""`quito schema`: the JSON Schema of problem files, or of suites."""

from __future__ import annotations

from typing import Annotated

import typer


def schema(
    suite: Annotated[
        bool, typer.Option("--suite", help="The schema of suites of cases instead.")
    ] = False,
) -> None:
    """Print the JSON Schema of problem files, or of suites."""
    if suite:
        from quito_cli.batch.suite.schema_suite import suite_schema_text

        typer.echo(suite_schema_text(), nl=False)
        return
    from quito_cli.problem.json_schema import schema_text

    typer.echo(schema_text(), nl=False)
