"""The types of the API's answers for the checks of the dashboard's JavaScript, from the OpenAPI document.

`python -m tests.javascript.types` writes `generated/types.d.ts` beside this file, which every module knows without an
import: an interface a schema, and the answer to each route, by which `read` and `send` know what an address holds.
Browsers never load it.
"""

import json
import re
from pathlib import Path
from typing import Any

from service.app import create_app
from service.settings import Settings

FILE = Path(__file__).parent / "generated" / "types.d.ts"
#: What no single schema is.
GENERAL = """\
type Quantiles = Record<string, number | null>;
type Table = (number | null)[][];
/** A list's page; `next` is the cursor of the page after it. */
interface ListPage<Item> { items: Item[]; next: string | null }
type Channels = Record<string, number[]>;
type ClutchPath = `/v1/clutches/${string}`;
type Items<Path extends string> = AnswerTo<"GET", Path>["items"];
type AnswerTo<Method extends string, Path extends string> =
  Path extends `${infer Base}?${string}` ? ByRoute<`${Method} ${Base}`> : ByRoute<`${Method} ${Path}`>;
"""
#: A schema whose name TypeScript has for something else.
TAKEN = {"Parameters": "StribeckParameters"}
SIMPLE = {"string": "string", "number": "number", "integer": "number", "boolean": "boolean", "null": "null"}


def type_of(schema: dict[str, Any]) -> str:
    """A schema as a type of TypeScript."""
    if "$ref" in schema:
        name = str(schema["$ref"]).rpartition("/")[2]
        return TAKEN.get(name, name)
    if "const" in schema:
        return json.dumps(schema["const"])
    if "enum" in schema:
        return " | ".join(json.dumps(value) for value in schema["enum"])
    for several in ("anyOf", "oneOf"):
        if several in schema:
            return " | ".join(dict.fromkeys(type_of(one) for one in schema[several]))
    kind = schema.get("type")
    if kind == "array":
        return f"({type_of(schema.get('items', {}))})[]"
    if kind == "object":
        values = schema.get("additionalProperties", True)
        return f"Record<string, {type_of(values) if isinstance(values, dict) else 'any'}>"
    return SIMPLE.get(str(kind), "any")


def interface(name: str, schema: dict[str, Any]) -> str:
    """An interface, or an alias where the schema is no object with properties. An answer has all its fields."""
    if "properties" not in schema:
        return f"type {name} = {type_of(schema)};\n"
    fields = (f"  {json.dumps(field)}: {type_of(kind)};\n" for field, kind in schema["properties"].items())
    return f"interface {name} {{\n{''.join(fields)}}}\n"


def answers(document: dict[str, Any]) -> str:
    """The type of the answer to each route. A parameter matches slashes too, so that the longest routes come first, and of
    those the ones with the fewest parameters."""
    routes = sorted(document.get("paths", {}), key=lambda path: (-path.count("/"), path.count("{"), path))
    choices = [
        f"  Route extends `{method.upper()} {re.sub('{[^}]*}', '${string}', path)}` ? {type_of(schema)} :\n"
        for path in routes
        for method, operation in document["paths"][path].items()
        if (schema := _answer(operation)) is not None
    ]
    return f"type ByRoute<Route extends string> =\n{''.join(choices)}  any;\n"


def _answer(operation: dict[str, Any]) -> dict[str, Any] | None:
    """The schema of what an operation answers in JSON when it succeeds."""
    for status in ("200", "201", "202"):
        content = operation.get("responses", {}).get(status, {}).get("content", {})
        if "schema" in content.get("application/json", {}):
            found: dict[str, Any] = content["application/json"]["schema"]
            return found
    return None


def text(document: dict[str, Any]) -> str:
    """All types of an OpenAPI document."""
    schemas = document["components"]["schemas"]
    interfaces = (interface(TAKEN.get(name, name), schema) for name, schema in sorted(schemas.items()))
    return GENERAL + "".join(interfaces) + answers(document)


if __name__ == "__main__":
    FILE.parent.mkdir(parents=True, exist_ok=True)
    FILE.write_text(text(create_app(Settings(workers=0, database="sqlite:///:memory:")).openapi()), encoding="utf-8")
