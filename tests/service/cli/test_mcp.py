"""The service's answers as tools: what the protocol asks for, each tool once, and that nothing can be changed."""

import json
from collections.abc import Callable
from typing import Any

import jsonschema_rs
import pytest
from fastapi.testclient import TestClient

from service.cli import mcp
from service.client.clutchlife.transport import Service
from tests.service.clients import filled_client
from tests.support import post_tests

Call = Callable[..., dict[str, Any]]


@filled_client
def life(client: TestClient) -> None:
    client.post("/v1/clutches", json={"clutch_id": "bench-1-2"})
    post_tests(client, 0, 1000, 2000, to="bench-1-2", pressures=(5.0,))
    client.post("/v1/alarms", json={"quantity": "health", "below": 1.0})


@pytest.fixture
def call(life: TestClient) -> Call:
    """The result of a method."""
    service = Service(http=life, patience=0.0)

    def made(method: str, **parameters: Any) -> dict[str, Any]:
        message = {"jsonrpc": "2.0", "id": 7, "method": method, "params": parameters}
        reply = mcp.answered(service, json.dumps(message))
        assert reply is not None
        assert (reply["jsonrpc"], reply["id"]) == ("2.0", 7)
        return reply.get("result") or reply["error"]

    return made


def test_a_client_is_greeted_in_its_version_or_the_newest(call: Call) -> None:
    for asked, given in (("2025-03-26", "2025-03-26"), ("1999-01-01", mcp.VERSIONS[0])):
        hello = call("initialize", protocolVersion=asked, capabilities={}, clientInfo={"name": "t", "version": "0"})
        assert hello["protocolVersion"] == given
        assert hello["capabilities"] == {"tools": {}}
    assert mcp.answered(Service(http=None), '{"jsonrpc": "2.0", "method": "notifications/initialized"}') is None


def test_each_tool_answers_as_the_api_does_and_only_reads(call: Call, life: TestClient) -> None:
    tools = call("tools/list")["tools"]
    assert {tool["name"] for tool in tools} == set(mcp.TOOLS)
    before = life.get("/v1/clutches/bench-1-2").json()["revision"]
    for tool in tools:
        schema = tool["inputSchema"]
        arguments = {"clutch_id": "bench-1-2"} if "clutch_id" in schema["required"] else {}
        assert tool["annotations"]["readOnlyHint"] is True
        if tool["name"] == "get_diagnosis":
            arguments["diagnosis_id"] = "none"
        jsonschema_rs.validator_for(schema).validate(arguments)
        result = call("tools/call", name=tool["name"], arguments=arguments)
        assert result["isError"] is (tool["name"] == "get_diagnosis"), (tool["name"], result)
        if not result["isError"]:
            assert json.loads(result["content"][0]["text"]) == result["structuredContent"]
    assert life.get("/v1/clutches/bench-1-2").json()["revision"] == before
    clutch = call("tools/call", name="get_clutch", arguments={"clutch_id": "bench-1-2"})["structuredContent"]
    assert clutch == life.get("/v1/clutches/bench-1-2").json()
    (alarm,) = call("tools/call", name="list_alarms", arguments={"state": "raised"})["structuredContent"]["items"]
    assert alarm["clutch_id"] == "bench-1-2"


@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("{", -32700), ("[]", -32600), ('{"id": 1}', -32600), ('{"id": 1, "method": "tools/destroy"}', -32601),
        ('{"id": 1, "method": "tools/call", "params": {"name": "post_run"}}', -32602),
    ],
)  # fmt: skip
def test_what_is_no_question_is_an_error(line: str, code: int) -> None:
    reply = mcp.answered(Service(http=None), line)
    assert reply is not None
    assert reply["error"]["code"] == code


@pytest.mark.parametrize(
    ("arguments", "said"),
    [({"clutch_id": "nobody"}, "nobody"), ({}, "needs"), ({"clutch_id": "bench-1-2", "drop": 1}, "takes")],
)
def test_what_the_service_refuses_is_told(call: Call, arguments: dict[str, Any], said: str) -> None:
    result = call("tools/call", name="get_clutch", arguments=arguments)
    assert result["isError"] is True
    assert said in result["content"][0]["text"]
