"""The product's source as the tests of the architecture read it: modules, their syntax trees, their imports."""

import ast
import re
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

import grimp
import pytest

ROOT = Path(__file__).parents[2]
#: The built site, with scripts to download.
SITE = ROOT / "service" / "dashboard" / "help"
PACKAGES = ("models", "storage", "service")


def _chapters() -> tuple[str, ...]:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]
    (order,) = (each["layers"] for each in settings["contracts"] if each.get("containers") == ["models.diagnosis"])
    return tuple(layer.strip("()") for layer in reversed(order))


#: The chapters of the diagnosis in reading order: none imports a later one, as import-linter holds.
CHAPTERS = _chapters()


@dataclass(frozen=True)
class Module:
    """One Python file of the product; `name` is dotted, without `__init__`."""

    name: str
    path: Path

    @property
    def shown(self) -> str:
        """The path from the root of the repository."""
        return self.path.relative_to(ROOT).as_posix()

    @property
    def is_package(self) -> bool:
        return self.path.name == "__init__.py"

    @cached_property
    def text(self) -> str:
        return self.path.read_text(encoding="utf-8")

    @cached_property
    def tree(self) -> ast.Module:
        return ast.parse(self.text, filename=str(self.path))

    @property
    def docstring(self) -> str:
        """The module's docstring, "" where it has none."""
        return ast.get_docstring(self.tree) or ""


@cache
def by_name() -> dict[str, Module]:
    """All modules of the product by their dotted names, in the order of their paths."""
    paths = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py") if SITE not in path.parents)
    names = (".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__") for path in paths)
    return {name: Module(name, path) for name, path in zip(names, paths, strict=True)}


@cache
def imports() -> frozenset[tuple[str, str]]:
    """Importer and imported, of the product's modules: `from package import module` imports that module, of anything else
    the package. Imports for types count."""
    graph = grimp.build_graph(*PACKAGES, cache_dir=None)
    found = ((name, graph.find_modules_directly_imported_by(name)) for name in graph.modules)
    return frozenset((importer, imported) for importer, those in found for imported in those)


def none_of(wrong: Sequence[str], rule: str) -> None:
    """Fail with all findings, one a line, where there are any."""
    if wrong:
        pytest.fail("\n".join([f"{len(wrong)} {rule}", *wrong]), pytrace=False)


def first_sentence(docstring: str) -> str:
    """A docstring's first sentence, on one line."""
    text = " ".join(docstring.split("\n\n")[0].split())
    return re.split(r"(?<=[.!?])\s", text, maxsplit=1)[0]
