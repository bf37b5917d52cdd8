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


#: Aliases that still have the name of a class elsewhere.
YET = {
    "models.diagnosis.design.facts": "Run",
    "models.diagnosis.explanations.posterior": "Kinds",
    "service.readers.sandbox": "Answer",
}


def test_an_alias_of_a_type_has_no_class_s_name() -> None:
    """An annotated argument of a route or of a command may: it is the field of that name."""
    classes = {
        node.name for module in by_name().values() for node in ast.walk(module.tree) if isinstance(node, ast.ClassDef)
    }
    found = []
    for module in by_name().values():
        for node in module.tree.body:
            target = node.targets[0] if isinstance(node, ast.Assign) else getattr(node, "target", None)
            if not isinstance(target, ast.Name) or target.id not in classes or YET.get(module.name) == target.id:
                continue
            if not ast.unparse(node.value).startswith(("TypeVar(", "Annotated[")):  # type: ignore[attr-defined]
                found.append(f"{module.shown}:{node.lineno} {target.id}")
    none_of(found, "aliases with the name of a class:")
