"""The problem file's JSON Schema, from the pydantic models; `schemas/` holds it committed.

Draft 2020-12, in keywords that draft 7 has too, for editors that know no later one.
"""

from __future__ import annotations

import json

from quito_cli.problem.schema import Problem


def schema_text() -> str:
    """Return the schema as `schemas/problem.schema.json` has it."""
    schema = Problem.model_json_schema()
    head = {"$schema": "http://json-schema.org/draft-07/schema#", "title": "quito problem"}
    return json.dumps(head | {k: v for k, v in schema.items() if k != "title"}, indent=2) + "\n"
