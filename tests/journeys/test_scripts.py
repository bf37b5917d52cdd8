"""What docs/how-to/scripts.md shows, done: Python runs; recipes for MATLAB and LabVIEW are the requests that these send."""

import ast
import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import httpx2
import pandas as pd
import pytest

from service.client.clutchlife import Client
from tests.lab.measuring import ROOT, blocks
from tests.support import Server

PAGE = ROOT / "docs" / "how-to" / "scripts.md"
#: Where the package is that scripts import.
SCRIPTS = os.environ | {"PYTHONPATH": str(ROOT / "service" / "client")}


def block(language: str) -> str:
    """The first one."""
    return blocks(PAGE, language)[0][1]


def test_the_python_example_runs(server: Server) -> None:
    script = f"URL = {server.url!r}\n{block('python')}"
    done = subprocess.run([sys.executable, "-c", script], env=SCRIPTS, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "422" in done.stdout


@pytest.mark.slow
def test_the_notebook_runs(server: Server) -> None:
    script = ROOT / "docs" / "tutorial" / "first_steps.py"
    environment = SCRIPTS | {"CLUTCHLIFE_URL": server.url}
    done = subprocess.run([sys.executable, script], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "The cause is changed oil temperature" in done.stdout
    assert done.stdout.splitlines()[-1].startswith("with the extended model: safe for ")


def matlab(text: str) -> dict[str, Any]:
    """`struct('a', 1, 'b', [1 2])` as the JSON that MATLAB makes of it: rows are lists."""
    text = re.sub(r"\.\.\.\s*", "", text)
    text = re.sub(r"\[([\d. ]+)\]", lambda row: f"[{', '.join(row[1].split())}]", text)
    return value(ast.parse(text, mode="eval").body)


def value(node: ast.expr) -> Any:
    if not isinstance(node, ast.Call):
        return ast.literal_eval(node)
    parts = [value(argument) for argument in node.args]
    return dict(zip(parts[::2], parts[1::2], strict=True))


def test_the_recipe_for_matlab_is_understood(server: Server) -> None:
    """`webwrite` with this media type sends the struct as JSON; `webread` takes JSON and CSV."""
    code = block("matlab")
    run = re.search(r"run = (struct\(.*?\)\));", code, flags=re.DOTALL)
    addresses = re.findall(r"\[url '([^']+)'\]", code)
    headers = {"Content-Type": "application/json", "Accept": "*/*", "User-Agent": "MATLAB 24.1.0.2537033 (R2024a)"}
    with httpx2.Client(base_url=server.url, headers=headers, timeout=60) as http:
        assert http.post(addresses[0], content=json.dumps({"clutch_id": "bench3-018"})).status_code == 201
        assert http.post(addresses[1], content=json.dumps(matlab(run[1]))).status_code == 201
        assert http.get(addresses[2]).json()["clutch_id"] == "bench3-018"
        table = http.get(addresses[3])
    assert table.headers["Content-Type"].startswith("text/csv")
    assert "quantity" in table.text.splitlines()[0]


def test_the_recipe_for_labview_is_understood(server: Server, tmp_path: Path) -> None:
    """The text as its buffer, and a file as its body: a POST without a type."""
    page = PAGE.read_text(encoding="utf-8")
    path = re.search(r"`(/v1/[^`]*/runs)`", page)
    file_address = re.search(r"`(/v1/[^`]*/runs/file[^`]*)`", page)
    body = block("json")
    csv = tmp_path / "run.csv"
    pd.DataFrame(json.loads(body)["channels"]).to_csv(csv, index=False)
    with Client(server.url) as client, httpx2.Client(base_url=server.url, timeout=60) as http:
        client.register("bench3-019")
        sent = http.post(path[1], content=body, headers={"Content-Type": "application/json"})
        assert sent.status_code == 201, sent.text
        sent = http.post(file_address[1].replace("run.tdms", "run.csv"), content=csv.read_bytes())
        assert sent.status_code == 201, sent.text
