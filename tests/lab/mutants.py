"""`make mutants`: how many small faults, put into the product at random, the tests of their own folder find.

SEED= another draw (1)   COUNT= how many (200)   ONLY= files whose paths begin with these   PROCESSES= at once (2)
STORE= a file that keeps results, so that a run goes on where it ended. Some three hours for 200.

A fault is another operator, a number more by one, a condition turned round, or a call left out, at a place drawn from all
places of all files. The tests that lie where the file lies decide, those of its own name first; a fault that makes them take
`PATIENCE` seconds is found too.
"""

import ast
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tests.lab.measuring import ROOT, Asked, Lines, each, number, shared, table, where

PACKAGES = ("models", "storage", "service")
PATIENCE = 900.0
TURNED = {
    ast.Lt: ast.GtE, ast.GtE: ast.Lt, ast.Gt: ast.LtE, ast.LtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.In: ast.NotIn, ast.NotIn: ast.In, ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.And: ast.Or, ast.Or: ast.And,
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.Pow: ast.Mult,
}  # fmt: skip


@dataclass(frozen=True)
class Mutant:
    """The fault at the `place`th place of a file."""

    path: str
    place: int

    def made(self) -> tuple[str, str]:
        """The whole text with the fault, and what was changed, with its line."""
        tree = tree_of(self.path)
        node = places(tree)[self.place]
        before = ast.unparse(node)
        change(node)
        line = getattr(node, "lineno", 0)
        return ast.unparse(ast.fix_missing_locations(tree)), f"{self.path}:{line}: {before}  ->  {ast.unparse(node)}"

    def tests(self, root: Path) -> list[str]:
        """What decides: the tests of its own name, then those of the nearest folder that has any."""
        folder = Path("tests") / Path(self.path).parent
        while not list((root / folder).glob("**/test_*.py")):
            folder = folder.parent
        named = folder / f"test_{Path(self.path).stem}.py"
        return [str(named), str(folder)] if (root / named).exists() else [str(folder)]


def tree_of(path: str) -> ast.Module:
    return ast.parse((ROOT / path).read_text(encoding="utf-8"))


def places(tree: ast.Module) -> list[ast.AST]:
    """Where a fault can be, in the order of the text. What is not run (annotations, documentation) is left out."""
    return [node for node in _run(tree) if _changeable(node)]


def _run(node: ast.AST) -> Iterator[ast.AST]:
    yield node
    for name, value in ast.iter_fields(node):
        if name in {"annotation", "returns", "decorator_list"}:
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST):
                yield from _run(child)


def _changeable(node: ast.AST) -> bool:
    match node:
        case ast.Compare(ops=[one]) | ast.BinOp(op=one) | ast.BoolOp(op=one):
            return type(one) in TURNED
        case ast.Constant(value=bool() | int() | float()) | ast.If() | ast.IfExp():
            return True
        case ast.UnaryOp(op=ast.Not() | ast.USub()):
            return True
        case ast.Expr(value=ast.Call()):
            return True
    return False


def change(node: ast.AST) -> None:
    match node:
        case ast.Compare(ops=[one]):
            node.ops = [TURNED[type(one)]()]
        case ast.BinOp(op=one) | ast.BoolOp(op=one):
            node.op = TURNED[type(one)]()
        case ast.Constant(value=bool() as value):
            node.value = not value
        case ast.Constant(value=int() | float() as value):
            node.value = value + 1
        case ast.If() | ast.IfExp():
            node.test = ast.UnaryOp(ast.Not(), node.test)
        case ast.UnaryOp(op=ast.Not()):
            node.op, node.operand = ast.Not(), ast.UnaryOp(ast.Not(), node.operand)
        case ast.UnaryOp():
            node.op = ast.UAdd()
        case ast.Expr():
            node.value = ast.Constant(None)


def drawn(seed: int, count: int, only: tuple[str, ...]) -> list[Mutant]:
    """So many different faults, every place as likely as every other."""
    files = sorted(path.relative_to(ROOT).as_posix() for package in PACKAGES for path in (ROOT / package).rglob("*.py"))
    sizes = {path: len(places(tree_of(path))) for path in files if path.startswith(only)}
    every = [Mutant(path, place) for path, size in sizes.items() for place in range(size)]
    return random.Random(seed).sample(every, min(count, len(every)))  # noqa: S311 -- a sample, no secret


def tried(mutant: Mutant) -> tuple[str, str]:
    text, what = mutant.made()
    with tempfile.TemporaryDirectory() as place:
        root = Path(place) / "tree"
        shutil.copytree(ROOT, root, ignore=shutil.ignore_patterns(".*", "node_modules", "help", "__pycache__"))
        (root / mutant.path).write_text(text, encoding="utf-8")
        options = ["-x", "-q", "-p", "no:cacheprovider", "-m", "not slow and not browser"]
        try:
            ended = subprocess.run(
                [sys.executable, "-m", "pytest", *options, *mutant.tests(root)],
                cwd=root,
                env={**os.environ, "PYTHONPATH": str(root), "OPENBLAS_NUM_THREADS": "1"},
                capture_output=True,
                timeout=PATIENCE,
                check=False,
            )
        except subprocess.TimeoutExpired:
            return "found by time", what
    return ("survived" if ended.returncode == 0 else "found"), what


def main() -> None:
    asked = Asked.here()
    mutants = drawn(asked.seed, number("COUNT", 200), asked.only)
    store = Lines(os.environ.get("STORE"))
    unknown = [one for one in mutants if str(one) not in store.known]
    for one, outcome in zip(unknown, each(tried, unknown, where(2)), strict=True):
        store.get(str(one), lambda outcome=outcome: list(outcome))
    outcomes = [(one, *store.known[str(one)]) for one in mutants]
    counted = Counter((one.path.split("/")[0], ended != "survived") for one, ended, _ in outcomes)
    pairs = {package: (counted[package, True], counted[package, False]) for package in PACKAGES}
    rows = [(package, found + missed, *shared(found, found + missed)) for package, (found, missed) in pairs.items()]
    print("\n".join(table(("faults in", "drawn", "found", "95 % interval"), (row for row in rows if row[1]))))
    print("\n".join(what for _, ended, what in outcomes if ended == "survived"))


if __name__ == "__main__":
    main()
