"""What the pages load: read once, named by the hash of its content, compressed, kept by the browser for good.

No build step: the tree `static/` is served as it stands, below one folder that is named by the hash of all its files, so
that modules find each other by relative imports and a new version is a new address. A page names all modules that it will
load, so that the browser asks for them at once, and not for each when another has come that imports it. A file's name is
its path in the tree, as `shared/api.js`. What is not read here at start-up has no name: a request looks names up in a
dictionary and never touches the disk.
"""

import gzip
import hashlib
import posixpath
import re
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version
from pathlib import Path

STATIC = Path(__file__).parent / "static"
TYPES = {
    ".css": "text/css; charset=utf-8",
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".png": "image/png",
    ".svg": "image/svg+xml",
}
#: What a page includes, its module, and what a module imports.
_INCLUDED = re.compile(r"\{(shared/\w+\.html)\}\n?")
_MODULE = re.compile(r'<script type="module" src="\{assets\}/([^"]+)"></script>')
_IMPORTED = re.compile(r'^(?:import|export)\b[^;"]*"(\.[^"]+)";', re.MULTILINE)


@dataclass(frozen=True, kw_only=True)
class Asset:
    """A static file with its media type; `name` is its path in the tree, with slashes."""

    name: str
    media_type: str
    body: bytes

    @cached_property
    def digest(self) -> str:
        return hashlib.sha256(self.body).hexdigest()[:16]

    @cached_property
    def compressed(self) -> bytes:
        """The gzipped file, computed at the first request."""
        return gzip.compress(self.body, 9, mtime=0)


@dataclass(frozen=True, kw_only=True)
class Assets:
    """All files that the pages load, by name; `digest` names the folder that they are served from."""

    by_name: dict[str, Asset]
    digest: str

    def page(self, name: str, root: str) -> Asset:
        """A page with its parts and addresses filled in, and links to preload all modules that its module imports.

        `root` leads from the page to the service's root: relative, so that a proxy may add a path.
        """
        raw = self.by_name[name]
        whole = _INCLUDED.sub(lambda part: self.by_name[part[1]].body.decode(), raw.body.decode())
        text = (
            _MODULE.sub(self._announced, whole)
            .replace("{assets}", f"{root}assets/{self.digest}")
            .replace("{root}", root)
            .replace("{release}", version("clutchlife"))
        )
        return Asset(name=name, media_type=raw.media_type, body=text.encode())

    def _announced(self, script: re.Match[str]) -> str:
        links = (f'<link rel="modulepreload" href="{{assets}}/{name}">' for name in self.imported(script[1]))
        return "\n".join([*links, script[0]])

    def imported(self, module: str) -> list[str]:
        """All modules that a module imports, directly or through others."""
        names = [module]
        for name in names:
            folder = posixpath.dirname(name)
            for relative in _IMPORTED.findall(self.by_name[name].body.decode()):
                met = posixpath.normpath(posixpath.join(folder, relative))
                if met not in names:
                    names.append(met)
        return names[1:]


def load(folder: Path = STATIC) -> Assets:
    """Read all files of the tree."""
    paths = sorted(path for path in folder.rglob("*") if path.suffix in TYPES and path.is_file())
    assets = [read(path, path.relative_to(folder).as_posix()) for path in paths]
    listing = "".join(f"{asset.name} {asset.digest}\n" for asset in assets)
    digest = hashlib.sha256(listing.encode()).hexdigest()[:16]
    return Assets(by_name={asset.name: asset for asset in assets}, digest=digest)


def read(path: Path, name: str) -> Asset:
    return Asset(name=name, media_type=TYPES[path.suffix], body=path.read_bytes())
