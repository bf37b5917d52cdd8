"""One class has one name, and one name is one class."""

import ast
from collections import defaultdict

from tests.architecture.source import by_name, none_of


def test_a_class_name_exists_once() -> None:
    """In all of models, service and storage. Classes of `service.api` are named in the API's document: where another has the
    name of one of them, the other is renamed."""
    places = defaultdict[str, list[str]](list)
    for module in by_name().values():
        for node in ast.walk(module.tree):
            if isinstance(node, ast.ClassDef):
                places[node.name].append(f"{module.shown}:{node.lineno}")
    twice = [f"{name}: {', '.join(found)}" for name, found in sorted(places.items()) if len(found) > 1]
    none_of(twice, "names of more than one class:")
