"""`python -m tests.architecture.picture`: draws the code from its imports, into docs/figures/architecture.svg.

Four bands from the top: service, storage, models, and inside models the chapters of the diagnosis. A box imports only boxes
below it; an arrow that a longer way implies is left out, and what a box takes from the bands below stands in it.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from xml.sax.saxutils import escape

from tests.architecture.source import PACKAGES, ROOT, by_name, first_sentence, imports

PICTURE = ROOT / "docs" / "figures" / "architecture.svg"
#: Files directly in storage hold the rows of one table each: one box, but for those that folders of storage import.
ROWS, OTHERS = "storage.each_table", ("storage.tables", "storage.dialects", "storage.encoding", "storage.rows")
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
    return {name: _box_of(name, belongs) for name in sorted({name for name in belongs.values() if name is not None})}


def _box_of(name: str, belongs: Mapping[str, str | None]) -> Box:
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


def edges_of(belongs: Mapping[str, str | None]) -> dict[str, frozenset[str]]:
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


def in_rows(graph: Edges, names: Iterable[str]) -> list[list[str]]:
    """The boxes of one layer in rows, each box above all that it imports."""
    chosen = sorted(names)

    @cache
    def depth_of(name: str) -> int:
        return 1 + max((depth_of(target) for target in graph[name] if target in chosen), default=-1)

    deepest = max(map(depth_of, chosen), default=0)
    return [[name for name in chosen if depth_of(name) == level] for level in range(deepest, -1, -1)]


WIDTH = 1120
_LEFT, _RIGHT, _BOX, _ROW, _GAP, _BAND = 116, 16, 34, 62, 18, 26
_LETTER, _SMALL_LETTER, _PADDING = 7.6, 5.6, 16
#: A row that is wider than the picture is broken.
_ROOM = WIDTH - _LEFT - _RIGHT
_STYLE = (
    ".ground{fill:#fff}.band{fill:#f3f5f8}.box{fill:#fff;stroke:#5b6b80}.name{fill:#1b2430;font-weight:600}"
    ".files{fill:#5b6b80;font-size:10px}.layer{fill:#1b2430;font-size:14px;font-weight:700}"
    ".arrow{fill:none;stroke:#7d8da3;stroke-width:1.1}"
    ".head{fill:#7d8da3}"
    "@media (prefers-color-scheme:dark){.ground{fill:#10151c}.band{fill:#18202a}.box{fill:#222d3a;stroke:#8fa1b8}"
    ".name,.layer{fill:#e8edf3}.files{fill:#a9b7c8}.arrow{stroke:#8393a8}.head{fill:#8393a8}}"
)

Place = tuple[float, float, float]  # left, top, width


def draw() -> str:
    packages, chapters = ({name: of(name) for name in by_name()} for of in (package_of, chapter_of))
    large, inside = edges_of(packages), edges_of(chapters)
    bands = [
        (package, in_rows(large, [n for n in large if n.startswith(f"{package}.")])) for package in reversed(PACKAGES)
    ]
    bands.append(("the diagnosis", in_rows(inside, inside)))
    described = boxes(packages) | boxes(chapters)
    places, grounds, height = _placed(bands, {**large, **inside}, described)
    parts = [
        *(_band(*ground) for ground in grounds),
        *_arrows(large, places),
        *_arrows(inside, places),
        *(_box(described[name], place) for name, place in places.items()),
    ]
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" width="{WIDTH}" height="{height}" '
        f'font-family="Helvetica, Arial, sans-serif" font-size="12"><style>{_STYLE}</style>'
        f'<defs><marker id="head" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto">'
        f'<path class="head" d="M0 0.8L8 4L0 7.2z"/></marker></defs>'
        f'<rect class="ground" width="{WIDTH}" height="{height}"/>{"".join(parts)}</svg>\n'
    )


def _placed(
    bands: Sequence[tuple[str, list[list[str]]]], edges: Mapping[str, frozenset[str]], described: Mapping[str, Box]
) -> tuple[dict[str, Place], list[tuple[str, float, float]], int]:
    """Where each box stands, and each band's label, top and height; the picture's height."""
    places: dict[str, Place] = {}
    grounds = []
    top = 12.0
    for label, rows in bands:
        begun = top
        top += _BAND / 2
        for row in _reading_order(rows, edges):
            for part in _broken([described[name] for name in row]):
                widths = [_width(box) for box in part]
                gap = min(3.0 * _GAP, (_ROOM - sum(widths)) / max(1, len(part)))
                left = _LEFT + (_ROOM - sum(widths) - gap * (len(part) - 1)) / 2
                for box, width in zip(part, widths, strict=True):
                    places[box.name] = (left, top, width)
                    left += width + gap
                top += _ROW
        top += _BOX - _ROW + _BAND
        grounds.append((label, begun, top - begun - _BAND / 2))
    return places, grounds, round(top)


def _reading_order(rows: list[list[str]], edges: Mapping[str, frozenset[str]]) -> list[list[str]]:
    """Rows whose boxes stand below what imports them, as far as one sweep gets."""
    middle: dict[str, float] = {}
    sorted_rows = []
    for row in rows:
        importers = {name: [middle[above] for above in middle if name in edges.get(above, ())] for name in row}
        placed = sorted(
            row, key=lambda name: (sum(importers[name]) / len(importers[name]) if importers[name] else 0.5, name)
        )
        middle |= {name: (index + 0.5) / len(placed) for index, name in enumerate(placed)}
        sorted_rows.append(placed)
    return sorted_rows


def _broken(row: list[Box]) -> list[list[Box]]:
    lines: list[list[Box]] = [[]]
    for box in row:
        if lines[-1] and sum(_width(other) + _GAP for other in (*lines[-1], box)) > _ROOM:
            lines.append([])
        lines[-1].append(box)
    return lines


def _label(name: str) -> str:
    return "rows, a file a table" if name == ROWS else name.split(".")[-1]


def _second_line(box: Box) -> str:
    files = f"{box.files} file{'s' if box.files != 1 else ''}"
    return f"{files} → {', '.join(box.lower)}" if box.lower else files


def _width(box: Box) -> float:
    return max(len(_label(box.name)) * _LETTER, len(_second_line(box)) * _SMALL_LETTER) + _PADDING


def _band(label: str, top: float, height: float) -> str:
    return (
        f'<rect class="band" x="8" y="{top:.0f}" width="{WIDTH - 16}" height="{height:.0f}" rx="6"/>'
        f'<text class="layer" x="20" y="{top + 22:.0f}">{escape(label)}</text>'
    )


def _box(box: Box, place: Place) -> str:
    left, top, width = place
    middle = f'x="{left + width / 2:.1f}" text-anchor="middle"'
    return (
        f"<g><title>{escape(box.name)}: {escape(box.introduction)}</title>"
        f'<rect class="box" x="{left:.1f}" y="{top:.1f}" width="{width:.1f}" height="{_BOX}" rx="4"/>'
        f'<text class="name" {middle} y="{top + 15:.1f}">{escape(_label(box.name))}</text>'
        f'<text class="files" {middle} y="{top + 28:.1f}">{escape(_second_line(box))}</text></g>'
    )


def _arrows(edges: Mapping[str, frozenset[str]], places: Mapping[str, Place]) -> list[str]:
    kept = reduced(edges)
    return [_arrow(places[name], places[each]) for name, targets in sorted(kept.items()) for each in sorted(targets)]


def _arrow(start: Place, end: Place) -> str:
    x0, x1 = start[0] + start[2] / 2, end[0] + end[2] / 2
    y0, y1 = start[1] + _BOX, end[1]
    bend = max(20.0, (y1 - y0) * 0.45)
    return (
        f'<path class="arrow" marker-end="url(#head)" d="M{x0:.1f} {y0:.1f}C{x0:.1f} {y0 + bend:.1f} '
        f'{x1:.1f} {y1 - bend:.1f} {x1:.1f} {y1:.1f}"/>'
    )


def main() -> None:
    PICTURE.write_text(draw(), encoding="utf-8")
    print(f"{PICTURE.relative_to(ROOT)}: {PICTURE.stat().st_size} bytes")


if __name__ == "__main__":
    main()
