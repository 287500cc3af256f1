"""JSON Schemas of files, from their pydantic models; `schemas/` holds it committed.

Descriptions are the models' attribute docstrings, read from their source here and not by pydantic
at every start. Draft 7, for editors that know no later one.
"""

from __future__ import annotations

import ast
import inspect
import json
from itertools import pairwise
from typing import Any

from pydantic import BaseModel

from quito_cli.problem.schema import Problem


def schema_text() -> str:
    """Return the schema of problem files, as `schemas/problem.schema.json` has it."""
    return schema_of(Problem, "quito problem")


def schema_of(root: type[BaseModel], title: str) -> str:
    """Return the schema of the files that a model is of."""
    schema = root.model_json_schema()
    ours = root.__module__.partition(".")[0]  # a web framework has a Parameter, too
    models = {m.__name__: m for m in _subclasses(BaseModel) if m.__module__.startswith(ours)}
    for name, part in [(root.__name__, schema), *schema["$defs"].items()]:
        said = attribute_docstrings(models[name])
        for key, field in part.get("properties", {}).items():
            field.pop("title", None)
            if key in said:
                field["description"] = said[key]
    head = {"$schema": "http://json-schema.org/draft-07/schema#", "title": title}
    return json.dumps(head | {k: v for k, v in schema.items() if k != "title"}, indent=2) + "\n"


def attribute_docstrings(model: type[BaseModel]) -> dict[str, str]:
    """Return the string that follows each attribute in the source of a class and its bases."""
    said: dict[str, str] = {}
    for base in reversed(model.__mro__):
        if issubclass(base, BaseModel) and base is not BaseModel:
            (definition,) = ast.parse(inspect.getsource(base)).body
            said |= _of_body(definition)
    return said


def _of_body(definition: ast.stmt) -> dict[str, str]:
    body = definition.body if isinstance(definition, ast.ClassDef) else []
    said = {}
    for statement, following in pairwise(body):
        match statement, following:
            case (
                ast.AnnAssign(target=ast.Name(id=name)),
                ast.Expr(value=ast.Constant(value=str(text))),
            ):
                said[name] = inspect.cleandoc(text)
    return said


def _subclasses(model: type[Any]) -> list[type[Any]]:
    found = model.__subclasses__()
    return found + [deeper for subclass in found for deeper in _subclasses(subclass)]
