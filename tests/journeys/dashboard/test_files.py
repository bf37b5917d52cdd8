"""The pages' files: what browsers may keep, what is compressed, what may run; and that no chart library is imported."""

import gzip
import re
import subprocess
import sys
from collections.abc import Iterator

import httpx2
import pytest

from tests.support import serving

PAGES = ("/", "/clutches/bench3-017")


@pytest.fixture(scope="module")
def http(tmp_path_factory: pytest.TempPathFactory) -> Iterator[httpx2.Client]:
    """A client of an empty service."""
    with (
        serving(tmp_path_factory.mktemp("files") / "clutchlife.db", loaded=True) as server,
        httpx2.Client(base_url=server.url, timeout=60) as found,
    ):
        yield found


def assets_of(http: httpx2.Client, path: str) -> list[str]:
    """Paths of a page's files; the page names them relative to itself, so that it may stand behind any path."""
    page = http.get(path)
    names = re.findall(r'(?:src|href)="([^"]*assets/[^"]+)"', page.text)
    return [page.url.join(name).path for name in names]


def test_the_plotting_library_goes_out_compressed(http: httpx2.Client) -> None:
    name = "/".join([*assets_of(http, PAGES[1])[0].split("/")[:3], "plotly.min.js"])
    with http.stream("GET", name, headers={"Accept-Encoding": "gzip"}) as answer:
        raw = b"".join(answer.iter_raw())
    assert len(raw) < 1_700_000
    text = gzip.decompress(raw).decode()
    assert "plotly.js v" in text[:200]
    assert "MIT license" in text[:400]
    plain = http.get(name, headers={"Accept-Encoding": "identity"})
    assert "content-encoding" not in plain.headers
    assert plain.text == text
    assert plain.headers["etag"] != answer.headers["etag"]


def test_the_plotting_library_is_found_and_not_imported() -> None:
    code = "import sys; from service.dashboard import assets; assets.load(); print('plotly' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
