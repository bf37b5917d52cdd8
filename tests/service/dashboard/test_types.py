"""The types that the pages' JavaScript is checked against are those of the OpenAPI document."""

from tests.javascript.types import text

DOCUMENT = {
    "components": {
        "schemas": {
            "Name": {"type": "string"},
            "Item": {
                "properties": {
                    "value": {"anyOf": [{"type": "number"}, {"type": "null"}]},
                    "kind": {"enum": ["a", "b"]},
                    "rows": {"type": "array", "items": {"$ref": "#/components/schemas/Name"}},
                    "by": {"type": "object", "additionalProperties": {"type": "integer"}},
                    "open": {"type": "object"},
                }
            },
        }
    }
}


def test_a_schema_is_an_interface() -> None:
    found = text(DOCUMENT)
    assert "export type Name = string;" in found
    for field in (
        '"value": number | null;', '"kind": "a" | "b";', '"rows": (Name)[];', '"by": Record<string, number>;',
        '"open": Record<string, any>;',
    ):  # fmt: skip
        assert field in found, field
