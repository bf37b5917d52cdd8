"""`clutchlife mcp`: the answers of a service as tools of the Model Context Protocol, read only, over standard streams.

In: a JSON-RPC message a line. Out: one answer a line. Each tool is one GET of the API; nothing can be changed.
"""

import json
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import quote

from service.cli.options import asking
from service.client.clutchlife.answers import ClutchlifeError, JsonObject
from service.client.clutchlife.transport import Service

#: Versions of the protocol that are understood, the newest first.
VERSIONS = ("2025-06-18", "2025-03-26", "2024-11-05")
#: Errors of JSON-RPC 2.0.
_PARSE_ERROR, _INVALID_REQUEST, _NO_METHOD, _INVALID_PARAMS = -32700, -32600, -32601, -32602
#: Items of a list where none is asked for. Chosen: some 20,000 characters.
_FEW = 20

_TEXT, _NUMBER = {"type": "string"}, {"type": "number"}
_COUNT = {"type": "integer", "minimum": 1, "maximum": 1000, "default": _FEW}
_LISTED: dict[str, JsonObject] = {"limit": _COUNT, "cursor": _TEXT}


@dataclass(frozen=True, slots=True, kw_only=True)
class Tool:
    """A GET of the API offered as a tool: `{names}` in its path are required arguments, `optional` ones go into the
    query."""

    name: str
    about: str
    path: str
    optional: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    @property
    def required(self) -> list[str]:
        """The names in the path."""
        return [part.partition("}")[0] for part in self.path.split("{")[1:]]

    def described(self) -> JsonObject:
        """The tool's description in `tools/list`."""
        return {
            "name": self.name,
            "description": self.about,
            "inputSchema": {
                "type": "object",
                "properties": {**dict.fromkeys(self.required, _TEXT), **self.optional},
                "required": self.required,
                "additionalProperties": False,
            },
            "annotations": {"readOnlyHint": True, "openWorldHint": False},
        }

    def asked(self, service: Service, arguments: Mapping[str, Any]) -> JsonObject:
        """The service's answer to a call. Raises ValueError on wrong arguments, and the client's ClutchlifeError."""
        unknown = arguments.keys() - {*self.required, *self.optional}
        missing = [name for name in self.required if not arguments.get(name)]
        if unknown or missing:
            raise ValueError(f"{self.name} needs {self.required or 'nothing'} and takes {sorted(self.optional)}")
        path = self.path.format(**{name: quote(str(arguments[name]), safe="") for name in self.required})
        query = {"limit": _FEW} if "limit" in self.optional else {}
        return service.get(path, **query | {name: arguments[name] for name in arguments if name in self.optional})


_CLUTCH = "/v1/clutches/{clutch_id}"
TOOLS = {
    tool.name: tool
    for tool in (
        Tool(
            name="list_clutches",
            about="Clutches, what needs somebody first: state, what to do, safe bound of the remaining cycles, open alarms",
            path="/v1/clutches",
            optional={"state": _TEXT, "find": _TEXT, "held": {"type": "boolean"}, **_LISTED},
        ),
        Tool(
            name="count_clutches",
            about="How many clutches there are by state, and open alarms",
            path="/v1/fleet/totals",
        ),
        Tool(
            name="get_clutch",
            about="One clutch: record, state, reason, what to do, remaining life in short",
            path=_CLUTCH,
        ),
        Tool(
            name="get_remaining_life",
            about="Remaining duty cycles with quantiles and criteria; `quantity`, `pressure_bar`: until another limit",
            path=f"{_CLUTCH}/remaining-useful-life",
            optional={"method": _TEXT, "quantity": _TEXT, "pressure_bar": _NUMBER, "at_cycles": _NUMBER},
        ),
        Tool(
            name="list_runs",
            about="The runs of a clutch by cycles, with doubts and warnings",
            path=f"{_CLUTCH}/runs",
            optional={"kind": _TEXT, "state": _TEXT, **_LISTED},
        ),
        Tool(
            name="list_series",
            about="Quantities of a clutch over cycles, measured and tracked",
            path=f"{_CLUTCH}/series",
            optional={"quantity": _TEXT, **_LISTED},
        ),
        Tool(
            name="list_stribeck",
            about="Fitted Stribeck curves of the stationary tests of a clutch",
            path=f"{_CLUTCH}/stribeck",
            optional=_LISTED,
        ),
        Tool(
            name="list_diagnoses",
            about="Diagnoses of a clutch, newest first",
            path=f"{_CLUTCH}/diagnoses",
            optional=_LISTED,
        ),
        Tool(
            name="get_diagnosis",
            about="One diagnosis: verdict, causes, sizes, advised test",
            path=f"{_CLUTCH}/diagnoses/{{diagnosis_id}}",
        ),
        Tool(
            name="list_changes",
            about="The audit trail of a clutch: who changed what, when and why",
            path=f"{_CLUTCH}/changes",
            optional=_LISTED,
        ),
        Tool(
            name="list_alarms",
            about="Alarms, newest first; `state`: raised, acknowledged, cleared or open",
            path="/v1/alarms/events",
            optional={"state": _TEXT, "clutch_id": _TEXT, **_LISTED},
        ),
    )
}


@asking
def mcp(service: Service) -> None:
    """Serve the answers to programs that speak the Model Context Protocol, read only, on standard input and output."""
    for line in sys.stdin:
        reply = answered(service, line) if line.strip() else None
        if reply is not None:
            print(json.dumps(reply, ensure_ascii=False), flush=True)  # noqa: T201  (the protocol, not a terminal)


def answered(service: Service, line: str) -> JsonObject | None:
    """The answer to a message; None if the message is a notification."""
    try:
        message = json.loads(line)
    except (ValueError, RecursionError):
        return _failed(None, _PARSE_ERROR, "the message is not JSON")
    if not isinstance(message, dict) or not isinstance(message.get("method"), str):
        return _failed(None, _INVALID_REQUEST, "a message is an object with a method")
    if "id" not in message:
        return None
    name, parameters = message["id"], message.get("params")
    given: JsonObject = parameters if isinstance(parameters, dict) else {}
    from importlib.metadata import version  # start-up time

    match message["method"]:
        case "initialize":
            asked = given.get("protocolVersion")
            result: JsonObject = {
                "protocolVersion": asked if asked in VERSIONS else VERSIONS[0],
                "capabilities": {"tools": {}},
                "serverInfo": {"name": "clutchlife", "version": version("clutchlife")},
                "instructions": "Condition monitoring of wet friction clutches. Every sentence about a clutch's state comes "
                "from the service: quote it, do not judge it again.",
            }
        case "ping":
            result = {}
        case "tools/list":
            result = {"tools": [tool.described() for tool in TOOLS.values()]}
        case "tools/call":
            tool, arguments = TOOLS.get(str(given.get("name"))), given.get("arguments") or {}
            if tool is None or not isinstance(arguments, dict):
                return _failed(name, _INVALID_PARAMS, f"the tools are {', '.join(TOOLS)}")
            result = _called(service, tool, arguments)
        case other:
            return _failed(name, _NO_METHOD, f"no such method: {other[:80]}")
    return {"jsonrpc": "2.0", "id": name, "result": result}


def _called(service: Service, tool: Tool, arguments: Mapping[str, Any]) -> JsonObject:
    """The result of a tool call; a refusal by the service or its absence is a result too."""
    try:
        answer = tool.asked(service, arguments)
    except (ClutchlifeError, ValueError) as error:
        return {"content": [{"type": "text", "text": str(error)}], "isError": True}
    text = json.dumps(answer, ensure_ascii=False)
    return {"content": [{"type": "text", "text": text}], "structuredContent": answer, "isError": False}


def _failed(name: Any, code: int, message: str) -> JsonObject:
    return {"jsonrpc": "2.0", "id": name, "error": {"code": code, "message": message}}
