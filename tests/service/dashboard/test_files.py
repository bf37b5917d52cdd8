"""The files of the pages: a tree under one content hash, what the routes answer, which module imports which; `/help`."""

import asyncio
import re
from graphlib import TopologicalSorter
from pathlib import Path, PurePosixPath
from posixpath import normpath
from typing import Any

import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient

from service.dashboard import assets, pages, site
from tests.javascript import types


def written(folder: Path, files: dict[str, str]) -> Path:
    """A tree with those files."""
    for name, text in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return folder


TREE = {
    "page.html": '<a href="{root}">{assets}</a>',
    "shared/dom.js": "1",
    "fleet/dom.js": "2",
    "fleet/deep/er.css": "a{}",
}


def test_what_browsers_load_is_named_by_its_path_in_the_tree(tmp_path: Path) -> None:
    loaded = assets.load(written(tmp_path, {**TREE, "shared/types.d.ts": "", "shared/.dom.js.swp": "", "notes.md": ""}))
    assert set(loaded.by_name) == set(TREE)
    assert loaded.by_name["shared/dom.js"].body == b"1"
    assert loaded.by_name["fleet/dom.js"].body == b"2"
    assert loaded.by_name["fleet/deep/er.css"].media_type == "text/css; charset=utf-8"
    assert loaded.page("page.html", "../").body.decode() == f'<a href="../">../assets/{loaded.digest}</a>'


def test_a_page_has_what_it_includes(tmp_path: Path) -> None:
    files = {"page.html": "<head>\n{shared/head.html}\n</head>\n", "shared/head.html": '<link href="{assets}/a.css">\n'}
    loaded = assets.load(written(tmp_path, files))
    assert loaded.page("page.html", "./").body.decode() == (
        f'<head>\n<link href="./assets/{loaded.digest}/a.css">\n</head>\n'
    )


def test_a_page_names_all_modules_that_it_loads(tmp_path: Path) -> None:
    files = {
        "page.html": '<script type="module" src="{assets}/fleet/page.js"></script>',
        "fleet/page.js": 'import {\n  h,\n} from "../shared/dom.js";\nimport "./row.js";\n',
        "fleet/row.js": '/** @import { T } from "../shared/gone.js" */\nexport { h } from "../shared/dom.js";\n',
        "shared/dom.js": '// import { x } from "./no.js";\nimport { y } from "./deep/y.js";\nconst a = "./b.js";\n',
        "shared/deep/y.js": 'import { page } from "../../fleet/page.js";\n',
    }
    loaded = assets.load(written(tmp_path, files))
    lines = loaded.page("page.html", "./").body.decode().splitlines()
    folder = f"./assets/{loaded.digest}"
    assert lines == [
        *(
            f'<link rel="modulepreload" href="{folder}/{name}">'
            for name in ("shared/dom.js", "fleet/row.js", "shared/deep/y.js")
        ),
        f'<script type="module" src="{folder}/fleet/page.js"></script>',
    ]


@pytest.mark.parametrize(
    "other",
    [
        {**TREE, "shared/dom.js": "1 "},
        {name.replace("deep", "deeper"): text for name, text in TREE.items()},
        {**TREE, "fleet/new.js": ""},
        {**TREE, "shared/dom.js": "2", "fleet/dom.js": "1"},
    ],
    ids=["content", "path", "another file", "contents exchanged"],
)
def test_one_hash_stands_for_the_whole_tree(tmp_path: Path, other: dict[str, str]) -> None:
    before = assets.load(written(tmp_path / "before", TREE)).digest
    assert assets.load(written(tmp_path / "same", TREE)).digest == before
    assert assets.load(written(tmp_path / "other", other)).digest != before


# --- What the routes answer: files by their path, and nothing that is not one of them, whatever the address looks like.


LOADED = assets.load()


@pytest.fixture(scope="module")
def app() -> FastAPI:
    """The pages alone."""
    made = FastAPI()
    made.include_router(pages.router(LOADED))
    return made


def get(app: FastAPI, path: str) -> tuple[int, bytes]:
    """Status and body; the path reaches the routes as it stands, as no client would let it through."""
    scope: dict[str, Any] = {
        "type": "http", "method": "GET", "path": path, "raw_path": path.encode(), "root_path": "", "scheme": "http",
        "http_version": "1.1", "query_string": b"", "headers": [], "server": ("127.0.0.1", 80), "client": None,
    }  # fmt: skip
    sent: list[dict[str, Any]] = []

    async def receive() -> dict[str, Any]:
        return {"type": "http.request", "body": b"", "more_body": False}

    async def send(message: Any) -> None:
        sent.append(message)

    asyncio.run(app(scope, receive, send))
    return sent[0]["status"], b"".join(message.get("body", b"") for message in sent)


@pytest.mark.parametrize("name", sorted(name for name in LOADED.by_name if not name.endswith(".html")))
def test_every_file_is_served_under_its_path(app: FastAPI, name: str) -> None:
    assert get(app, f"/assets/{LOADED.digest}/{name}") == (200, LOADED.by_name[name].body)


@pytest.mark.parametrize(
    "name",
    [
        "../pages.py", "../../dashboard/pages.py", "shared/../../pages.py", "shared/../shared/api.js", "./shared/api.js",
        "..%2fpages.py", "%2e%2e/pages.py", "..\\pages.py", "shared\\api.js", "/etc/passwd", "//etc/passwd", "", "/",
        "shared", "shared/", "shared//api.js", "shared/api.js/", "shared/api.js\0", "SHARED/api.js", "api.js",
        "static/shared/api.js", "shared/types.d.ts", "fleet.html", "clutch.html",
    ],
)  # fmt: skip
def test_nothing_else_is(app: FastAPI, name: str) -> None:
    status, body = get(app, f"/assets/{LOADED.digest}/{name}")
    assert status == 404
    assert len(body) < 200


def test_no_request_touches_the_disk(app: FastAPI, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: Any, **__: Any) -> None:
        raise AssertionError("a request opened a file")

    monkeypatch.setattr("builtins.open", refuse)
    monkeypatch.setattr("io.open", refuse)
    monkeypatch.setattr(Path, "read_bytes", refuse)
    with pytest.raises(AssertionError, match="opened a file"):
        assets.load()
    for path in ("/", "/clutches/any", f"/assets/{LOADED.digest}/shared/api.js"):
        assert get(app, path)[0] == 200
    assert get(app, f"/assets/{LOADED.digest}/../pages.py")[0] == 404


# --- The tree reads as chapters: imports that lead to a file, and one way only.


#: In reading order: a chapter imports itself and chapters before it; the two pages know nothing of each other.
CHAPTERS = ["shared", "charts", "quantities", "sending", "alarms", "diagnosis"]
CHAPTERS += ["engagements", "inspections", "clutch", "fleet", "compare"]
MODULES = {name: LOADED.by_name[name].body.decode() for name in LOADED.by_name if "/" in name and name.endswith(".js")}


def imported(name: str) -> list[str]:
    """The modules that a module imports, at once or when they are needed, by their names in the tree."""
    paths = re.findall(r'^(?:import|export)\b[^;]*?from "([^"]+)";', MODULES[name], re.MULTILINE)
    paths += re.findall(r'(?<=[ (])import\("([^"]+)"\)', MODULES[name])
    assert all(path.startswith(("./", "../")) for path in paths), "only relative imports are found below a content hash"
    return [normpath(PurePosixPath(name).parent / path) for path in paths]


def test_modules_are_checked_and_import_modules_in_no_circle_and_never_from_a_later_chapter() -> None:
    for name, text in MODULES.items():
        assert not re.search("@ts-(?!check)", text), name  # tsconfig.json has all of them checked, whole
        for target in imported(name):
            assert target in MODULES, name
            assert CHAPTERS.index(target.split("/")[0]) <= CHAPTERS.index(name.split("/")[0]), (name, target)
            assert not (name.startswith("fleet/") and target.startswith("clutch/")), (name, target)
    TopologicalSorter({name: imported(name) for name in MODULES}).prepare()


def test_every_module_is_loaded_by_a_page() -> None:
    html = [asset.body.decode() for name, asset in LOADED.by_name.items() if name.endswith(".html")]
    named = {name for text in html for name in re.findall(r'"\{assets\}/([^"]+)"', text)}
    assert named <= set(LOADED.by_name)
    reached, waiting = set[str](), [name for name in named if name in MODULES]
    while waiting:
        name = waiting.pop()
        if name not in reached:
            reached.add(name)
            waiting += imported(name)
    assert reached == set(MODULES)


def test_the_start_page_loads_no_chart_and_nothing_that_sends() -> None:
    """They are loaded when they are needed: half of what the page loaded before."""
    first = {"fleet/fleet.js", *LOADED.imported("fleet/fleet.js")}
    assert {name.split("/")[0] for name in first} <= {"fleet", "shared", "alarms", "sending"}
    assert first & {name for name in MODULES if name.startswith(("alarms/", "sending/"))} == {
        "alarms/raised.js",
        "sending/taking.js",
    }


# --- `/help`: the built site, or how to build it.


def test_the_site_is_served_and_where_none_was_built_the_answer_says_how(tmp_path: Path) -> None:
    app = FastAPI()
    app.include_router(site.router(tmp_path / "missing"))
    answer = TestClient(app).get("/help/")
    assert (answer.status_code, answer.headers["content-type"]) == (404, "text/html; charset=utf-8")
    assert "Run <code>make docs</code>" in answer.text
    pages_built = {"index.html": "<p>first</p>", "how-to/index.html": "<p>tasks</p>", "searchindex.js": "1"}
    app = FastAPI()
    app.include_router(site.router(written(tmp_path, pages_built | {"objects.inv": "no page"})))
    client = TestClient(app)
    assert client.get("/help").text == "<p>first</p>", "by a redirect to the address with the slash"
    assert client.get("/help/how-to/").text == "<p>tasks</p>"
    assert client.get("/help/searchindex.js").headers["content-type"].startswith("text/javascript")
    known = {"If-None-Match": client.get("/help/").headers["etag"]}
    assert client.get("/help/index.html", headers=known).status_code == 304
    for name in ("missing.html", "objects.inv", "../pages.py", "%2e%2e/pages.py", "how-to"):
        assert client.get(f"/help/{name}").status_code == 404, name


# --- The types that the pages' JavaScript is checked against are those of the OpenAPI document.


DOCUMENT = {
    "components": {
        "schemas": {
            "Name": {"type": "string"},
            "Parameters": {"type": "object", "properties": {"own": {"$ref": "#/components/schemas/Parameters"}}},
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
    found = types.text(DOCUMENT)
    assert "type Name = string;" in found
    for field in (
        '"value": number | null;', '"kind": "a" | "b";', '"rows": (Name)[];', '"by": Record<string, number>;',
        '"open": Record<string, any>;', 'interface StribeckParameters {\n  "own": StribeckParameters;',
    ):  # fmt: skip
        assert field in found, field


def test_an_address_tells_the_type_of_its_answer_and_the_longest_route_is_tried_first() -> None:
    def answered(status: str, schema: dict[str, Any]) -> dict[str, Any]:
        return {"responses": {status: {"content": {"application/json": {"schema": schema}}}}}

    item, several = {"$ref": "#/components/schemas/Item"}, {"type": "array", "items": {"type": "number"}}
    paths = {
        "/v1/items/{item_id}": {"get": answered("200", item), "delete": {"responses": {"204": {}}}},
        "/v1/items/{item_id}/parts": {"post": answered("201", several)},
        "/v1/items/first": {"get": answered("200", several)},
    }
    routes = [line.strip() for line in types.answers({"paths": paths}).splitlines()]
    assert routes == [
        "type ByRoute<Route extends string> =",
        "Route extends `POST /v1/items/${string}/parts` ? (number)[] :",
        "Route extends `GET /v1/items/first` ? (number)[] :",
        "Route extends `GET /v1/items/${string}` ? Item :",
        "any;",
    ]
