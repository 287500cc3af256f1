"""The JSON Schema that editors read: in step with the models, and as strict as a schema can be."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft7Validator, Draft202012Validator
from pydantic import ValidationError

from quito_cli.problem.json_schema import schema_text
from quito_cli.problem.library import bundled
from quito_cli.problem.schema import Control, Cost, Problem, State, Time
from quito_cli.problem.schema_reference import Reference
from quito_cli.problem.text.complaints import ProblemError
from quito_cli.problem.text.strict_yaml import read

TESTS = Path(__file__).parent
COMMITTED = TESTS.parent / "schemas" / "problem.schema.json"
BUNDLED = sorted(bundled().values())
ACCEPTED = sorted((TESTS / "problems" / "accepted").glob("*.yaml"))

REFUSED = sorted((TESTS / "problems" / "refused").glob("*.yaml"))
BEYOND_A_SCHEMA = {"mistakes_beside_a_wrong_size"}
"""2.0 is a whole number to JSON Schema."""


@pytest.fixture(scope="module")
def schema() -> dict[str, Any]:
    loaded = json.loads(COMMITTED.read_text(encoding="utf-8"))
    assert isinstance(loaded, dict)
    return loaded


def data(file: Path) -> Any:
    return read(file.read_text(encoding="utf-8"), file.name).data


def test_committed_is_generated() -> None:
    assert COMMITTED.read_text(encoding="utf-8") == schema_text()


def test_it_is_a_schema_of_draft_7_and_of_its_successor(schema: dict[str, Any]) -> None:
    assert schema["$schema"] == "http://json-schema.org/draft-07/schema#"
    Draft7Validator.check_schema(schema)
    Draft202012Validator.check_schema(schema)


def test_no_keyword_is_unknown_to_draft_7(schema: dict[str, Any]) -> None:
    known = {
        *("$ref", "$schema", "additionalProperties", "anyOf", "const", "default", "description"),
        *(
            "enum",
            "exclusiveMaximum",
            "exclusiveMinimum",
            "items",
            "maxItems",
            "pattern",
            "maxProperties",
        ),
        *("maximum", "minItems", "minProperties", "minimum", "oneOf", "properties", "required"),
        *("title", "type", "definitions", "$defs"),
    }
    used: set[str] = set()

    def look(part: Any, names: bool) -> None:
        """`names` where the keys are names of the file, not keywords."""
        if isinstance(part, list):
            for entry in part:
                look(entry, False)
        elif isinstance(part, dict):
            if not names:
                used.update(part)
            for key, value in part.items():
                if key not in ("default", "const", "enum"):
                    look(value, not names and key in ("properties", "$defs", "definitions"))

    look(schema, False)
    assert used <= known


def test_references_lead_somewhere(schema: dict[str, Any]) -> None:
    text = json.dumps(schema)
    for name in schema["$defs"]:
        assert f'"#/$defs/{name}"' in text
    assert text.count('"$ref"') == text.count('"$ref": "#/$defs/')


@pytest.mark.parametrize("file", BUNDLED + ACCEPTED, ids=lambda path: path.stem)
def test_valid_files_are_valid(file: Path, schema: dict[str, Any]) -> None:
    assert [error.message for error in Draft7Validator(schema).iter_errors(data(file))] == []
    assert Draft202012Validator(schema).is_valid(data(file))


def structure_is_wrong(file: Path) -> bool:
    """Whether the file can be read, and its keys and kinds of values are not those of a problem."""
    try:
        Problem.model_validate(data(file))
    except ValidationError:
        return True
    except (ProblemError, UnicodeDecodeError):  # no YAML that quito reads
        return False
    return False


def test_an_editor_sees_every_mistake_of_structure(schema: dict[str, Any]) -> None:
    """A refused file is refused by its schema too, where formulas and names are not the reason."""
    validator = Draft7Validator(schema)
    wrong = [file for file in REFUSED if structure_is_wrong(file)]
    assert len(wrong) > 80
    assert {file.stem for file in wrong if validator.is_valid(data(file))} == BEYOND_A_SCHEMA


def test_a_schema_is_no_stricter_than_quito(schema: dict[str, Any]) -> None:
    validator = Draft7Validator(schema)
    for file in REFUSED:
        try:
            read_data = data(file)
        except (ProblemError, UnicodeDecodeError):
            continue
        assert validator.is_valid(read_data) or structure_is_wrong(file), file.stem


def test_every_key_of_every_section_has_its_explanation(schema: dict[str, Any]) -> None:
    for name, part in [("Problem", schema), *schema["$defs"].items()]:
        assert part["additionalProperties"] is False, name
        for key, field in part["properties"].items():
            assert field.get("description", "").endswith((".", "x).", "too.", ")")), f"{name}.{key}"


def test_explanations_are_those_of_the_models(schema: dict[str, Any]) -> None:
    initial = schema["$defs"]["State"]["properties"]["initial"]
    assert initial["description"] == "Value at the initial time; free if left out."
    steps = schema["$defs"]["FileOptions"]["properties"]["steps"]
    assert steps["description"] == "Number N of control cells."


@pytest.mark.parametrize("model", [Problem, State, Control, Cost, Time, Reference])
def test_all_keys_are_there(model: Any, schema: dict[str, Any]) -> None:
    part = schema if model is Problem else schema["$defs"][model.__name__]
    assert set(part["properties"]) == set(model.model_fields)
    required = {name for name, field in model.model_fields.items() if field.is_required()}
    assert set(part.get("required", ())) == required


def test_bundled_files_name_the_schema() -> None:
    for file in BUNDLED:
        first = file.read_text(encoding="utf-8").splitlines()[0]
        assert first == "# yaml-language-server: $schema=../schemas/problem.schema.json"
        assert (file.parent / "../schemas/problem.schema.json").resolve() == COMMITTED.resolve()
