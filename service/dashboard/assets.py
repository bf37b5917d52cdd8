"""What the pages load: read once, named by the hash of its content, compressed, kept by the browser for good.

No build step: the files are served as they stand in `static/`, all under one folder that is named by the hash of all of
them, so that modules find each other by relative imports and a new version is a new address. The plotting library's
JavaScript is the one in the installed wheel of plotly, which is found and never imported.
"""

import gzip
import hashlib
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from importlib.util import find_spec
from pathlib import Path

STATIC = Path(__file__).parent / "static"
_TYPES = {
    ".css": "text/css; charset=utf-8",
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
}


@dataclass(frozen=True, kw_only=True)
class Asset:
    """A file and how it goes out."""

    name: str
    media_type: str
    body: bytes

    @cached_property
    def digest(self) -> str:
        """The start of its content's sha256."""
        return hashlib.sha256(self.body).hexdigest()[:16]

    @cached_property
    def compressed(self) -> bytes:
        """Gzipped, worked out when it is first asked for."""
        return gzip.compress(self.body, 9, mtime=0)


def plotting_library() -> Path:
    """Where the wheel of plotly keeps its JavaScript; raises FileNotFoundError where it is not installed."""
    spec = find_spec("plotly")  # of a top-level package: looks it up, does not run it
    places = [] if spec is None else spec.submodule_search_locations or []
    for place in places:
        path = Path(place) / "package_data" / "plotly.min.js"
        if path.is_file():
            return path
    raise FileNotFoundError("plotly.min.js is not there: the package plotly is not installed whole")


@dataclass(frozen=True, kw_only=True)
class Assets:
    """All that the pages load, by name; `digest` names the folder that they stand in."""

    by_name: dict[str, Asset]
    digest: str

    def page(self, name: str) -> Asset:
        """A page with the addresses of its assets filled in."""
        raw = self.by_name[name]
        text = raw.body.decode().replace("{assets}", f"/assets/{self.digest}")
        return Asset(name=name, media_type=raw.media_type, body=text.encode())


def load(folder: Path = STATIC) -> Assets:
    """Read every file of the folder, and the plotting library."""
    found = [_read(path) for path in sorted(folder.iterdir()) if path.suffix in _TYPES]
    found.append(_read(plotting_library()))
    return Assets(by_name={asset.name: asset for asset in found}, digest=_digest(found))


def _read(path: Path) -> Asset:
    return Asset(name=path.name, media_type=_TYPES[path.suffix], body=path.read_bytes())


def _digest(assets: Iterable[Asset]) -> str:
    told = "".join(f"{asset.name} {asset.digest}\n" for asset in assets)
    return hashlib.sha256(told.encode()).hexdigest()[:16]
