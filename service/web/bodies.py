"""JSON bodies, read within bounds and checked in the service's own words."""

from typing import Any

from fastapi import Request
from pydantic import BaseModel

from service.errors import UnsupportedMediaTypeError


async def json_body(request: Request) -> bytes:
    """The body of a request that says it is JSON; a browser cannot send such a one across sites unasked."""
    kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if kind != "application/json" and not kind.endswith("+json"):
        raise UnsupportedMediaTypeError(f"send the body as application/json, not as {kind[:80]!r}")
    return await request.body()


def described_body(schema: type[BaseModel] | dict[str, Any], example: dict[str, Any]) -> dict[str, Any]:
    """The body for the API's description, since the routes read it themselves."""
    found = schema if isinstance(schema, dict) else schema.model_json_schema()
    return {"requestBody": {"required": True, "content": {"application/json": {"schema": found, "example": example}}}}
