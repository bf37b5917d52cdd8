"""Everything that goes over the wire is described: operations, parameters, and every field of every schema."""

from collections.abc import Iterator, Mapping
from typing import Any

import pytest

from service.app import create_app
from service.settings import Settings

#: FastAPI's own shape of a wrong argument, which the service never sends: it is in the description all the same.
FOREIGN = {"HTTPValidationError", "ValidationError"}
METHODS = ("get", "post", "put", "patch", "delete")


@pytest.fixture(scope="module")
def api() -> dict[str, Any]:
    """The description at /openapi.json."""
    return create_app(Settings()).openapi()


def operations(api: Mapping[str, Any]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    for address, item in api["paths"].items():
        for method in METHODS:
            if method in item:
                yield f"{method.upper()} {address}", item[method]


def undescribed(schema: Any, place: str) -> Iterator[str]:
    """The fields below a schema that have no description."""
    if isinstance(schema, list):
        for index, item in enumerate(schema):
            yield from undescribed(item, f"{place}[{index}]")
    if not isinstance(schema, Mapping):
        return
    for name, field in schema.get("properties", {}).items():
        if not str(field.get("description", "")).strip():
            yield f"{place}.{name}"
    for name, part in schema.items():
        if name not in ("example", "examples", "default", "enum"):
            yield from undescribed(part, f"{place}/{name}")


def test_every_operation_and_parameter_is_described(api: dict[str, Any]) -> None:
    missing = []
    for name, operation in operations(api):
        if not operation.get("description"):
            missing.append(name)
        parameters = operation.get("parameters", [])
        missing += [f"{name}: {parameter['name']}" for parameter in parameters if not parameter.get("description")]
        missing += undescribed(operation.get("requestBody", {}), name)
        missing += undescribed(operation["responses"], name)
    assert missing == []


def test_every_schema_and_field_is_described(api: dict[str, Any]) -> None:
    schemas = {name: schema for name, schema in api["components"]["schemas"].items() if name not in FOREIGN}
    assert len(schemas) > 50
    assert [name for name, schema in schemas.items() if not schema.get("description")] == []
    assert list(undescribed(schemas, "")) == []


def test_an_undescribed_field_is_noticed() -> None:
    body = {"content": {"properties": {"a": {"type": "object", "properties": {"b": {"title": "B"}}}}}}
    assert list(undescribed(body, "x")) == ["x/content.a", "x/content/properties/a.b"]
