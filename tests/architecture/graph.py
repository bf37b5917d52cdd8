"""The packages of the product and what imports what, small enough to be drawn: boxes, arrows, rows."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache

from tests.architecture.source import PACKAGES, by_name, first_sentence, imports

#: Files directly in storage hold the rows of one table each: one box, but for those that folders of storage import.
ROWS, OTHERS = "storage.rows", ("storage.tables", "storage.dialects", "storage.encoding")
DIAGNOSIS = "models.diagnosis"

Edges = Mapping[str, frozenset[str]]


@dataclass(frozen=True)
class Box:
    """A package or a file at the top of one: its dotted name, how many files it holds, which lower packages they import
    from, and its introduction."""

    name: str
    files: int
    lower: tuple[str, ...]
    introduction: str


def package_of(module: str) -> str | None:
    """The box of the large picture that a module belongs to; None for the three packages themselves."""
    package, *below = module.split(".")
    if not below:
        return None
    name = f"{package}.{below[0]}"
    return ROWS if package == "storage" and not by_name()[name].is_package and name not in OTHERS else name


def chapter_of(module: str) -> str | None:
    """The box of the diagnosis' picture that a module belongs to; None outside the diagnosis."""
    return ".".join(module.split(".")[:3]) if module.startswith(f"{DIAGNOSIS}.") else None


def boxes(belongs: Mapping[str, str | None]) -> dict[str, Box]:
    """The boxes by name; `belongs`: module -> box."""
    return {name: _box(name, belongs) for name in sorted({name for name in belongs.values() if name is not None})}


def _box(name: str, belongs: Mapping[str, str | None]) -> Box:
    members = {module for module, box in belongs.items() if box == name}
    introduced = by_name().get(name)
    docstring = "The rows of each table, a file a table." if introduced is None else introduced.docstring
    tops = {imported.split(".")[0] for importer, imported in imports() if importer in members} - {name.split(".")[0]}
    return Box(
        name=name,
        files=sum(not by_name()[module].is_package for module in members),
        lower=tuple(package for package in reversed(PACKAGES) if package in tops),
        introduction=first_sentence(docstring),
    )


def edges(belongs: Mapping[str, str | None]) -> dict[str, frozenset[str]]:
    """box -> the boxes of its package that its modules import, itself left out."""
    targets: dict[str, set[str]] = {name: set() for name in belongs.values() if name is not None}
    for pair in imports():
        importer, imported = (belongs.get(name) for name in pair)
        if importer is None or imported is None or importer == imported:
            continue
        if importer.split(".")[0] == imported.split(".")[0]:
            targets[importer].add(imported)
    return {name: frozenset(boxes_below) for name, boxes_below in targets.items()}


def reachable(graph: Edges, start: str) -> frozenset[str]:
    """All boxes that a box reaches by one arrow or more."""
    reached: set[str] = set()
    waiting = [start]
    while waiting:
        for target in graph[waiting.pop()] - reached:
            reached.add(target)
            waiting.append(target)
    return frozenset(reached)


def reduced(graph: Edges) -> dict[str, frozenset[str]]:
    """The arrows that no longer way implies: what is drawn. There is no circle, which import-linter forbids."""
    reach = {name: reachable(graph, name) for name in graph}
    return {name: targets - frozenset().union(*(reach[each] for each in targets)) for name, targets in graph.items()}


def rows(graph: Edges, names: Iterable[str]) -> list[list[str]]:
    """The boxes of one layer in rows, each box above all that it imports."""
    chosen = sorted(names)

    @cache
    def depth_of(name: str) -> int:
        return 1 + max((depth_of(target) for target in graph[name] if target in chosen), default=-1)

    deepest = max(map(depth_of, chosen), default=0)
    return [[name for name in chosen if depth_of(name) == level] for level in range(deepest, -1, -1)]
