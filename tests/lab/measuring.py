"""What tools that measure share: what they are asked for, results that are kept, tables in Markdown, parts of documents."""

import json
import os
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TypeVar

from rich.console import Console
from scipy.stats import binomtest

from service.jobs.executor import executor_of
from service.jobs.progress import progress

Job = TypeVar("Job")
Result = TypeVar("Result")

ROOT = Path(__file__).parents[2]
APPENDIX = ROOT / "docs" / "appendix"


@dataclass(frozen=True)
class Asked:
    """What `make` passes on: SEED= (several with commas where a tool counts them together), SIZE= small, full or a share
    of the whole, ONLY= beginnings of names."""

    seeds: tuple[int, ...]
    size: float
    only: tuple[str, ...]

    @classmethod
    def here(cls, size: str = "small", seed: int = 1) -> "Asked":
        seeds, chosen, only = (os.environ.get(name) or "" for name in ("SEED", "SIZE", "ONLY"))
        share = {"small": 0.1, "full": 1.0}.get(chosen or size)
        return cls(
            seeds=tuple(map(int, (seeds or str(seed)).split(","))),
            size=float(chosen) if share is None else share,
            only=tuple(only.split(",")),
        )

    @property
    def seed(self) -> int:
        """The only one, or the first."""
        return self.seeds[0]

    def __str__(self) -> str:
        only = f" ONLY={','.join(self.only)}" if any(self.only) else ""
        return f"SEED={','.join(map(str, self.seeds))} SIZE={self.size:g}{only}"


def number(name: str, otherwise: int) -> int:
    """A number that `make` passes on, such as COUNT=."""
    return int(os.environ.get(name) or otherwise)


def where(processes: int) -> str:
    """Where work is done: what follows `--scheduler`, else by PROCESSES= of this machine; 0: here."""
    if "--scheduler" in sys.argv:
        return sys.argv[sys.argv.index("--scheduler") + 1]
    processes = number("PROCESSES", processes)
    return f"processes:{processes}" if processes else "local"


def each(work: Callable[[Job], Result], jobs: Iterable[Job], place: str) -> Iterator[Result]:
    """What comes of every job, in their order, with a bar that says how far it is."""
    chosen = list(jobs)
    with executor_of(place) as executor, progress(Console(stderr=True), work.__name__) as advance:
        advance(0, total=len(chosen))
        for outcome in executor.map(work, chosen):
            yield outcome.value()
            advance()


def kept(path: Path, make: Callable[[], bytes]) -> bytes:
    """What a file holds: made, and written whole or not at all, where it is not there yet."""
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.with_suffix(".part").write_bytes(make())
        path.with_suffix(".part").rename(path)
    return path.read_bytes()


class Lines:
    """What was computed, a line of JSON each, so that a run goes on where it ended; in memory without a file."""

    def __init__(self, path: Path | str | None) -> None:
        self.path, self.known = Path(path) if path else None, dict[str, Any]()
        if self.path is not None and self.path.exists():
            self.known = dict(json.loads(line) for line in self.path.read_text(encoding="utf-8").splitlines())

    def get(self, name: str, make: Callable[[], Any]) -> Any:
        """What is known by a name, or is made and noted: as JSON has it, a dataclass as its fields."""
        if name not in self.known:
            line = json.dumps([name, make()], default=asdict)
            self.known[name] = json.loads(line)[1]
            if self.path is not None:
                with self.path.open("a", encoding="utf-8") as file:
                    file.write(line + "\n")
        return self.known[name]


def table(titles: Sequence[object], rows: Iterable[Sequence[object]]) -> list[str]:
    """Lines of a table in Markdown; a pipe within a cell is escaped."""
    lines = [titles, ["---"] * len(titles), *rows]
    return ["| " + " | ".join(str(cell).replace("|", "\\|") for cell in line) + " |" for line in lines]


def records(rows: Iterable[Mapping[str, object]]) -> list[str]:
    """Lines of a table whose rows name their cells; numbers to four digits."""
    rows = list(rows)
    cells = [[f"{v:.4g}" if isinstance(v, float) else v for v in row.values()] for row in rows]
    return table(list(rows[0]), cells)


def show(title: str, rows: Iterable[Mapping[str, object]]) -> None:
    """Print such a table under its title."""
    print("\n".join([f"{title}\n", *records(rows), ""]), flush=True)


def publish(page: str, part: str, lines: Iterable[str]) -> None:
    """Print what was measured; ARGS=--write puts it into a page of docs/appendix, too."""
    text = "\n".join(lines).strip()
    print(text, flush=True)
    if "--write" in sys.argv:
        fill(APPENDIX / page, {part: text})


def wilson(hits: int, count: int) -> tuple[float, float]:
    """The 95 % interval of a share after Wilson (1927)."""
    found = binomtest(hits, count).proportion_ci(method="wilson")
    return found.low, found.high


def shared(hits: int, count: int) -> tuple[str, str]:
    """A share and its 95 % interval, in per cent."""
    if count == 0:
        return "-", "-"
    low, high = wilson(hits, count)
    return f"{hits / count:.0%}", f"{low:.0%} to {high:.0%}"


def blocks(page: Path, *languages: str) -> list[tuple[str, str]]:
    """(language, text) of the fenced blocks of a page, of some languages alone where they are given."""
    found = re.findall(
        r"^```([a-z]*)[^\n]*\n(.*?)^```$", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL
    )
    return [(language, text) for language, text in found if not languages or language in languages]


def parts(text: str) -> dict[str, str]:
    """The parts of a document by name: what stands between `<!-- name -->` and `<!-- end -->`."""
    found = re.findall(r"<!-- ([a-z_ -]+) -->\n(.*?)<!-- end -->", text, flags=re.DOTALL)
    return {name: body.strip("\n") for name, body in found}


def filled(text: str, bodies: Mapping[str, str]) -> str:
    """A document with these parts written again. Raises ValueError where one is not there."""
    for name, body in bodies.items():
        start, end = f"<!-- {name} -->\n", "<!-- end -->"
        before, _, rest = text.partition(start)
        if not rest:
            raise ValueError(f"the document must hold the part {start.strip()}")
        text = f"{before}{start}\n{body}\n\n{end}{rest.partition(end)[2]}"
    return text


def fill(page: Path, bodies: Mapping[str, str]) -> None:
    page.write_text(filled(page.read_text(encoding="utf-8"), bodies), encoding="utf-8")
