"""The files as a tree: each by its path, all under one content hash."""

from pathlib import Path

import pytest

from service.dashboard import assets


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


def test_a_file_is_named_by_its_path_in_the_tree(tmp_path: Path) -> None:
    loaded = assets.load(written(tmp_path, TREE))
    assert set(loaded.by_name) == {*TREE, "plotly.min.js"}
    assert loaded.by_name["shared/dom.js"].body == b"1"
    assert loaded.by_name["fleet/dom.js"].body == b"2"
    assert loaded.by_name["fleet/deep/er.css"].media_type == "text/css; charset=utf-8"


def test_a_page_names_the_folder_of_this_version(tmp_path: Path) -> None:
    loaded = assets.load(written(tmp_path, TREE))
    assert loaded.page("page.html", "../").body.decode() == f'<a href="../">../assets/{loaded.digest}</a>'


def test_a_page_names_all_modules_that_it_loads(tmp_path: Path) -> None:
    files = {
        "page.html": '<script type="module" src="{assets}/fleet/page.js"></script>',
        "fleet/page.js": 'import {\n  h,\n} from "../shared/dom.js";\nimport "./row.js";\n',
        "fleet/row.js": '/** @import { T } from "../shared/types.js" */\nexport { h } from "../shared/dom.js";\n',
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


def test_only_what_browsers_load_is_served(tmp_path: Path) -> None:
    loaded = assets.load(written(tmp_path, {**TREE, "shared/types.d.ts": "", "shared/.dom.js.swp": "", "notes.md": ""}))
    assert set(loaded.by_name) == {*TREE, "plotly.min.js"}


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
