"""The product's source as the tests of the architecture read it: modules, their syntax trees, their imports."""

import ast
import re
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

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
        """Whether the file is a folder's `__init__.py`."""
        return self.path.name == "__init__.py"

    @cached_property
    def text(self) -> str:
        """The file's text."""
        return self.path.read_text(encoding="utf-8")

    @cached_property
    def tree(self) -> ast.Module:
        """The file's syntax tree."""
        return ast.parse(self.text, filename=str(self.path))

    @property
    def docstring(self) -> str:
        """The module's docstring, "" where it has none."""
        return ast.get_docstring(self.tree) or ""


@dataclass(frozen=True)
class Import:
    """One module that another imports."""

    importer: str
    imported: str


@cache
def modules() -> tuple[Module, ...]:
    """All modules of the product, by path."""
    paths = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py") if SITE not in path.parents)
    return tuple(Module(_dotted(path), path) for path in paths)


@cache
def by_name() -> dict[str, Module]:
    """The modules by their dotted names."""
    return {module.name: module for module in modules()}


@cache
def imports() -> tuple[Import, ...]:
    """All imports of the product, of its own modules and of others'."""
    return tuple(statement for module in modules() for statement in imports_of(module))


def imports_of(module: Module) -> Iterator[Import]:
    """The imports of one module: `from package import module` is an import of that module, of anything else of `package`."""
    for node in ast.walk(module.tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            yield from (Import(module.name, imported) for imported in _imported(module, node))


def none_of(wrong: Sequence[str], rule: str) -> None:
    """Fail with all findings, one a line, where there are any."""
    if wrong:
        pytest.fail("\n".join([f"{len(wrong)} {rule}", *wrong]), pytrace=False)


def first_sentence(docstring: str) -> str:
    """A docstring's first sentence, on one line."""
    text = " ".join(docstring.split("\n\n")[0].split())
    return re.split(r"(?<=[.!?])\s", text, maxsplit=1)[0]


def _dotted(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _imported(module: Module, node: ast.Import | ast.ImportFrom) -> Iterator[str]:
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names)
        return
    base = node.module or ""
    if node.level:
        package = module.name.split(".") if module.is_package else module.name.split(".")[:-1]
        base = ".".join([*package[: len(package) - node.level + 1], *filter(None, [base])])
    for alias in node.names:
        inner = f"{base}.{alias.name}"
        yield inner if inner in by_name() else base
