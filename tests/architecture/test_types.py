"""What goes from layer to layer has a type: no signature in the service but the repository's takes or gives a dict of
anything."""

import ast
import re
from collections.abc import Iterator

from tests.architecture.source import Module, by_name, none_of

#: What reads the wire as it comes, with no library of the service: the command line and its client. And the rows <-> values.
APART = ("service/cli/", "service/client/", "service/repository.py")
#: Where JSON itself is the content: what jobs' processes tell each other, a fleet's prior as its row holds it, and the API's
#: document. Only these may name it by its alias.
JSON_ITSELF = (
    *APART,
    "service/jobs/",
    "service/changes/learn_fleet.py",
    "service/changes/replay.py",
    "service/web/openapi.py",
)


def annotated(module: Module, pattern: str) -> Iterator[str]:
    """Where the type of an argument, of a result or of a field matches the pattern."""
    for node in ast.walk(module.tree):
        annotations: list[ast.expr | None] = []
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            given = node.args
            arguments = [*given.posonlyargs, *given.args, *given.kwonlyargs, given.vararg, given.kwarg]
            annotations = [node.returns, *(each.annotation for each in arguments if each is not None)]
        if isinstance(node, ast.ClassDef):
            annotations = [field.annotation for field in node.body if isinstance(field, ast.AnnAssign)]
        if any(re.search(pattern, ast.unparse(each)) for each in annotations if each is not None):
            yield f"{module.shown}:{node.lineno} {node.name}"  # type: ignore[attr-defined]


def test_no_signature_of_the_service_is_a_dict_of_anything() -> None:
    modules = [each for each in by_name().values() if each.shown.startswith("service/")]
    for pattern, apart in ((r"\b[dD]ict\[str, Any\]", APART), (r"\bJson\b", JSON_ITSELF)):
        found = [place for each in modules if not each.shown.startswith(apart) for place in annotated(each, pattern)]
        none_of(found, f"signatures with {pattern}:")
