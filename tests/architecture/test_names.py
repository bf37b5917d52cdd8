"""One class has one name, and one name is one class."""

import ast
from collections import defaultdict

from tests.architecture.source import by_name, none_of

#: Names that stand for two classes yet, one of them in the diagnosis. The list only shrinks.
WAITING = frozenset({"Estimate", "Fit", "Kind", "Piece"})


def test_a_class_name_exists_once() -> None:
    """In all of models, service and storage. Classes of `service.api` are named in the API's document: where another has the
    name of one of them, the other is renamed."""
    places = defaultdict[str, list[str]](list)
    for module in by_name().values():
        for node in ast.walk(module.tree):
            if isinstance(node, ast.ClassDef):
                places[node.name].append(f"{module.shown}:{node.lineno}")
    twice = {name: found for name, found in places.items() if len(found) > 1}
    none_of(
        [f"{name}: {', '.join(found)}" for name, found in sorted(twice.items()) if name not in WAITING],
        "names of more than one class:",
    )
    none_of(sorted(WAITING - set(twice)), "names that no longer wait: take them off WAITING")
    elsewhere = [name for name in sorted(WAITING) if not any("models/diagnosis/" in place for place in twice[name])]
    none_of(elsewhere, "names that wait, and no class of the diagnosis has them:")
