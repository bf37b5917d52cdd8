"""The API's description: what FastAPI makes of the routes, completed by what holds for all of them.

Keys, entity tags and 304, the headers of pages and refusals, compression, and an example of every field and parameter
(`service.api.examples`). The schemas of bodies and problems, which routes describe by themselves, are named as all are.
"""

import json
from functools import cache
from typing import Any

from fastapi import FastAPI

from service.api.examples import example_of
from service.web.limits import UNLIMITED

Json = dict[str, Any]

_SECURITY = {
    "type": "http",
    "scheme": "bearer",
    "description": "A key, made by `clutchlife key create`. Where no key exists none is needed, and only this "
    "machine may ask.",
}
#: Ends the name of what is sent where what is answered has the name already.
_SENT = "Sent"


def _header(description: str, example: object) -> Json:
    return {"description": description, "schema": {"type": "string"}, "example": example}


_TAG = {"ETag": _header("A strong entity tag: it changes when and only when the answer does", '"9f86d081884c7d65"')}
_READ = _TAG | {"Cache-Control": _header("Keep it, and ask each time whether it still holds", "no-cache")}
_REVISION = {"Clutchlife-Revision": _header("The clutch's revision that the answer is of", "17")}
_LINK = {
    "Link": _header('The next page, `rel="next"`; absent on the last', '</v1/clutches?cursor=WzEsIiJd>; rel="next"')
}
_ID = {
    "X-Request-ID": _header(
        "The request's id, as the service's log has it: the one that was sent, where it is 1 to 128 visible characters",
        "3f9a1c0b7d2e4f56",
    )
}
#: Headers by status, of every answer that may have it.
_OF_STATUS = {
    "201": {"Location": _header("Where it is from now on", "/v1/clutches/bench3-017")},
    "202": {"Location": _header("Where its end will be", "/v1/clutches/bench3-017/diagnoses/3f9a1c0b7d2e4f56")},
    "401": {"WWW-Authenticate": _header("How to send a key", "Bearer")},
    "415": {"Accept-Encoding": _header("The encodings of a body that are taken", "gzip")},
    "503": {"Retry-After": _header("Seconds after which to try again", "1")},
}
_UNCHANGED = {"description": "Unchanged: `If-None-Match` names the present answer", "headers": _TAG | _ID}


def install(app: FastAPI, root: str) -> None:
    """Have the application, served below the path `root`, use this OpenAPI description."""
    plain = app.openapi
    servers = {"servers": [{"url": root}]} if root else {}
    app.openapi = cache(lambda: completed(plain()) | servers)  # type: ignore[method-assign]


def completed(api: Json) -> Json:
    """The OpenAPI description, changed in place, with the parts added that all addresses share."""
    schemas = api.setdefault("components", {}).setdefault("schemas", {})
    api["components"]["securitySchemes"] = {"key": _SECURITY}
    api["security"] = [{"key": []}, {}]
    operations = [(path, *item) for path, items in api["paths"].items() for item in items.items()]
    for path, method, operation in operations:
        for place in [operation.get("requestBody", {}), *operation["responses"].values()]:
            for content in place.get("content", {}).values():
                content["schema"] = _named(content.get("schema", {}), schemas)
        if path in UNLIMITED:
            operation["security"] = []
        _complete(path, method, operation)
    for owner, schema in schemas.items():
        for name, field in schema.get("properties", {}).items():
            example = _example(field, owner.removesuffix(_SENT), name)
            if example is not None and "examples" not in field:
                field["examples"] = [example]
    return api


def _complete(path: str, method: str, operation: Json) -> None:
    """Add the common headers, the response 304 and examples to one operation."""
    names = set()
    for parameter in operation.get("parameters", ()):
        names.add(parameter["name"])
        example = _example(parameter["schema"], "", parameter["name"].lower())
        if example is not None:
            parameter.setdefault("example", example)
    responses = operation["responses"]
    for response in responses.values():
        response.setdefault("headers", {}).update(_ID)
    for status, headers in _OF_STATUS.items():
        if status in responses:
            responses[status].setdefault("headers", {}).update(headers)
    if method == "get" and path.startswith("/v1/"):
        responses["304"] = _UNCHANGED
        headers = _READ | (_REVISION if "{clutch_id}/" in path else {}) | (_LINK if "cursor" in names else {})
        responses["200"]["headers"] = headers | responses["200"].get("headers", {})


def _named(schema: Json, schemas: Json) -> Json:
    """The schema with its inner schemas moved to the components; a schema with fields moves there too and becomes a
    `$ref`.

    A reference finds its schema there alone, and who writes a client from the description names its types by it.
    """
    parts = schema.pop("$defs", {})
    title = schema.get("title") if "properties" in schema else None
    if title is not None:
        parts = parts | {title: schema}
    # unless another schema has the name: as a body's and an answer's of one kind, which differ in what is required
    taken = {name for name, part in parts.items() if _content(schemas.get(name, part)) != _content(part)}
    names = {name: f"{name}{_SENT}" if name in taken else name for name in parts}
    for part in (schema, *parts.values()):
        _refer(part, names)
    for name, part in parts.items():
        schemas.setdefault(names[name], part | {"title": names[name]})
    return schema if title is None else {"$ref": f"#/components/schemas/{names[title]}"}


def _content(part: Json) -> str:
    """A schema's text, the same wherever it and its parts are stored and whether or not their names have the suffix."""
    text = json.dumps(part, sort_keys=True)
    return text.replace("#/$defs/", "#/components/schemas/").replace(f'{_SENT}"', '"')


def _refer(part: Any, names: dict[str, str]) -> None:
    """Replace references to local definitions by those of the whole document, in place."""
    if isinstance(part, list):
        for item in part:
            _refer(item, names)
    if isinstance(part, dict):
        for key, value in part.items():
            inside, _, name = value.rpartition("/") if isinstance(value, str) else ("", "", "")
            if inside == "#/$defs":
                part[key] = f"#/components/schemas/{names[name]}"
            _refer(value, names)


def _example(schema: Json, owner: str, name: str) -> Any:
    """The example of a field or parameter; None if it has none, or consists of fields with examples of their own."""
    if consists_of_fields(schema):
        return None
    for kind in _kinds(schema):
        if "const" in kind or "enum" in kind:
            return kind["const"] if "const" in kind else kind["enum"][0]
        if kind.get("type") == "boolean":
            return False
    value = example_of(owner, name)
    return None if value is None else _shaped(schema, value)


def consists_of_fields(schema: Json) -> bool:
    """Whether a schema refers to another one that describes fields of its own."""
    kinds = _kinds(schema)
    inside = [kind["items"] for kind in kinds if isinstance(kind.get("items"), dict)]
    return any("$ref" in kind for kind in kinds) or any(map(consists_of_fields, inside))


def _kinds(schema: Json) -> list[Json]:
    parts = schema.get("anyOf") or schema.get("oneOf") or schema.get("allOf")
    return [schema] if parts is None else [kind for part in parts for kind in _kinds(part)]


def _shaped(schema: Json, value: Any) -> Any:
    """An example value converted to the schema's type: put into a list, taken as the first item of a list or object, or
    made an integer."""
    types = {kind.get("type"): kind for kind in _kinds(schema)}
    if "array" in types:
        items = types["array"].get("items", {})
        return [_shaped(items, item) for item in (value if isinstance(value, list) else [value])]
    if isinstance(value, list):
        value = value[0]
    if isinstance(value, dict) and "object" not in types:
        value = next(iter(value.values()))
    return int(value) if "integer" in types and isinstance(value, float) else value
