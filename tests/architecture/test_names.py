"""A name is the field's noun for what it holds: no pronoun, no participle that says nothing of the thing."""

import ast
import re
from collections.abc import Iterator

import pytest

from tests.architecture.source import PACKAGES, ROOT, modules, none_of

BANNED = frozenset(
    {
        "each",
        "found",
        "told",
        "standing",
        "views",
        "said",
        "one",
        "these",
        "them",
        "those",
        "that",
        "some",
        "what",
        "seen",
    }
    | {"asked", "known"}
)
SCRIPTS = ROOT / "service" / "dashboard" / "static"


def declared(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """(line, name) of every variable, field, argument, function, class and import under another name."""
    for node in ast.walk(tree):
        match node:
            case ast.Name(id=name, ctx=ast.Store()) | ast.Attribute(attr=name, ctx=ast.Store()):
                yield node.lineno, name
            case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.ClassDef(name=name):
                yield node.lineno, name
            case ast.arg(arg=name):
                yield node.lineno, name
            case ast.alias(asname=str(name)) | ast.ExceptHandler(name=str(name)):
                yield node.lineno, name
            case ast.MatchAs(name=str(name)) | ast.MatchStar(name=str(name)):
                yield node.lineno, name


def declared_in_script(text: str) -> Iterator[tuple[int, str]]:
    """(line, name) of the constants, variables, functions, classes and parameters of a script, as far as patterns see."""
    patterns = (
        r"\b(?:const|let|var|function\*?|class)\s+([\w$]+)",
        r"\b(?:const|let|var)\s*[\[{]([^=;]*?)[\]}]\s*(?:=|of\b)",
        r"\bfunction\*?\s*[\w$]*\s*\(([^()]*)\)",
        r"\(([^()]*)\)\s*=>",
        r"([\w$]+)\s*=>",
    )
    for pattern in patterns:
        for match in re.finditer(pattern, text):
            line = text.count("\n", 0, match.start()) + 1
            # `{key: name}` declares name, `name = default` declares name
            for part in re.split(r"[,\[\]{}]", match[1]):
                name = re.sub(r"=.*", "", part.split(":")[-1], flags=re.DOTALL).strip().lstrip(".").strip()
                if name:
                    yield line, name


def banned(name: str) -> bool:
    """Whether a name is one of the list, also with underscores before it and in capitals."""
    return name.lstrip("_").lower() in BANNED


@pytest.mark.parametrize("package", PACKAGES)
def test_no_name_is_a_pronoun(package: str) -> None:
    wrong = [
        f"{module.shown}:{line}: {name}"
        for module in modules()
        if module.name.split(".")[0] == package
        for line, name in declared(module.tree)
        if banned(name)
    ]
    none_of(wrong, "names say nothing of the thing:")


def test_no_name_of_the_dashboard_is_a_pronoun() -> None:
    wrong = [
        f"{path.relative_to(ROOT)}:{line}: {name}"
        for path in sorted(SCRIPTS.rglob("*.js"))
        for line, name in declared_in_script(path.read_text(encoding="utf-8"))
        if banned(name)
    ]
    none_of(wrong, "names say nothing of the thing:")


def test_every_way_of_declaring_is_noticed() -> None:
    """The negative control: each of these lines declares a banned name."""
    lines = (
        "found = 1",
        "a, (each, b) = x",
        "self._told = 1",
        "each: int = 3",
        "for seen in x: pass",
        "y = [one for one in x]",
        "def _what(): pass",
        "class Views: pass",
        "def f(*, known): pass",
        "f = lambda them: 1",
        "import x as said",
        "with x as (some, y): pass",
        "if (asked := 1): pass",
        "match x:\n    case [*those]: pass",
        "try: pass\nexcept E as that: pass",
    )
    for line in lines:
        assert any(banned(name) for _, name in declared(ast.parse(line))), line
    scripts = (
        "const each = 1;",
        "let {a, b: found} = x;",
        "xs.map((each, i) => 1)",
        "xs.map(one => 1)",
        "for (const [k, seen] of x)",
    )
    for line in (*scripts, "function told(a) {}", "function f(a, those = 3) {}", "function f({a, these}) {}"):
        assert any(banned(name) for _, name in declared_in_script(line)), line
    assert not any(banned(name) for _, name in declared(ast.parse("row = found_rows(each_row)")))
