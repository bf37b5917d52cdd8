"""A client that a kept generator writes from /openapi.json compiles, registers a clutch, posts a run and reads it."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.support import Server, stationary

#: `make slow` sets it up: the generator asks for other releases than ours, and its clients for none of our packages.
ENVIRONMENT = Path(f"{sys.prefix}-generator") / "bin"

CALLS = """
import json, sys
from written.client import Client
from written.models import ClutchIn, ClutchOut, Problem, Receipt, RunPage, StationaryRunIn
from written.api.clutches import register_clutch_v1_clutches_post as register
from written.api.runs import list_runs_v1_clutches_clutch_id_runs_get as listed
from written.api.runs import post_run_v1_clutches_clutch_id_runs_post as post
client = Client(base_url=sys.argv[1], raise_on_unexpected_status=True)
clutch = register.sync(client=client, body=ClutchIn(clutch_id="written"))
assert isinstance(clutch, ClutchOut), clutch
assert isinstance(register.sync(client=client, body=ClutchIn(clutch_id="no/name")), Problem)
run = StationaryRunIn.from_dict(json.loads(sys.argv[2]))
receipt = post.sync("written", client=client, body=run)
assert isinstance(receipt, Receipt), receipt
page = listed.sync("written", client=client)
assert isinstance(page, RunPage), page
print([item.run_id for item in page.items])
"""


def run(*arguments: str | Path, folder: Path) -> str:
    environment = {"PATH": f"{ENVIRONMENT}:{os.environ['PATH']}", "PYTHONPATH": str(folder)}
    command = [str(ENVIRONMENT / arguments[0]), *map(str, arguments[1:])]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def sends_an_image(operation: dict[str, Any]) -> bool:
    """The generator writes bodies of JSON, forms and any bytes."""
    return any(kind.startswith("image/") for kind in operation.get("requestBody", {}).get("content", {}))


@pytest.mark.slow
def test_a_client_is_generated_that_compiles_and_posts_a_run(server: Server, tmp_path: Path) -> None:
    assert ENVIRONMENT.is_dir(), f"{ENVIRONMENT} is not there: make slow sets it up"
    description = tmp_path / "openapi.json"
    description.write_bytes(server.http.get("/openapi.json").content)
    output = ("--output-path", "written", "--meta", "none")
    run("openapi-python-client", "generate", "--path", description, *output, folder=tmp_path)
    operations = [
        operation
        for path in json.loads(description.read_text())["paths"].values()
        for operation in path.values()
        if "operationId" in operation and not sends_an_image(operation)
    ]
    written = {path.stem for path in (tmp_path / "written" / "api").rglob("*.py")} - {"__init__"}
    assert len(written) == len(operations)
    run("python", "-W", "error", "-m", "compileall", "-q", "written", folder=tmp_path)
    body = json.dumps(stationary(0, run_id="r0"))
    assert run("python", "-c", CALLS, server.url, body, folder=tmp_path) == "['r0']\n"
