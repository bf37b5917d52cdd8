"""The API's description is valid, and complete enough to write a client from."""

import copy
from collections.abc import Iterator, Mapping
from typing import Any

import jsonschema_rs
import openapi_spec_validator
import pytest
from openapi_spec_validator.validation.exceptions import UnresolvableParameterError

from service.web.openapi import consists_of_fields
from tests.service.clients import described

METHODS = ("get", "post", "put", "patch", "delete")
#: FastAPI's own shape of a wrong argument, which the service never sends.
FOREIGN = {"HTTPValidationError", "ValidationError"}


@pytest.fixture(scope="module")
def api() -> dict[str, Any]:
    """The description at /openapi.json."""
    return described()


def operations(api: Mapping[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    for path, item in api["paths"].items():
        yield from ((f"{method.upper()} {path}", item[method]) for method in METHODS if method in item)


def fields(api: Mapping[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Every field of every schema and body by its place, and every parameter."""
    schemas = {name: schema for name, schema in api["components"]["schemas"].items() if name not in FOREIGN}
    for name, operation in operations(api):
        for content in operation.get("requestBody", {}).get("content", {}).values():
            schemas[f"the body of {name}"] = content["schema"]
    for owner, schema in schemas.items():
        for name, field in schema.get("properties", {}).items():
            yield f"{owner}.{name}", field


def without_example(api: Mapping[str, Any]) -> list[str]:
    missing = [place for place, field in fields(api) if "examples" not in field and not consists_of_fields(field)]
    for name, operation in operations(api):
        missing += [
            f"{name}: {parameter['name']}"
            for parameter in operation.get("parameters", ())
            if "example" not in parameter and parameter["schema"].get("type") != "boolean"
        ]
    return missing


def references(part: Any) -> Iterator[str]:
    if isinstance(part, list):
        for item in part:
            yield from references(item)
    if isinstance(part, dict):
        if isinstance(part.get("$ref"), str):
            yield part["$ref"]
        for item in part.values():
            yield from references(item)


def test_the_description_keeps_to_the_standard(api: dict[str, Any]) -> None:
    """By the OpenAPI Initiative's own schema, and what it cannot say: references, unique ids, parameters of the paths."""
    openapi_spec_validator.validate(api)
    assert "servers" not in api, "it is at any address"
    paths = copy.deepcopy(api)
    del paths["paths"]["/v1/clutches/{clutch_id}"]["get"]["parameters"]
    with pytest.raises(UnresolvableParameterError, match="clutch_id"):
        openapi_spec_validator.validate(paths)


def test_every_field_and_parameter_has_an_example(api: dict[str, Any]) -> None:
    assert without_example(api) == []
    lacking = copy.deepcopy(api)
    del lacking["components"]["schemas"]["Receipt"]["properties"]["cycles"]["examples"]
    assert without_example(lacking) == ["Receipt.cycles"]


def test_every_example_is_of_its_fields_type(api: dict[str, Any]) -> None:
    wrong = []
    for place, field in fields(api):
        refers = next(references(field), None) is not None
        fits = jsonschema_rs.validator_for(field | ({"components": api["components"]} if refers else {}))
        wrong += [f"{place}: {example!r}" for example in field.get("examples", ()) if not fits.is_valid(example)]
    for name, operation in operations(api):
        wrong += [
            f"{name}: {parameter['name']}"
            for parameter in operation.get("parameters", ())
            if not jsonschema_rs.is_valid(parameter["schema"], parameter.get("example", False))
        ]
        for content in operation.get("requestBody", {}).get("content", {}).values():
            if "example" in content:
                whole = content["schema"] | {"components": api["components"]}
                wrong += [] if jsonschema_rs.is_valid(whole, content["example"]) else [f"the body of {name}"]
    assert wrong == []
