"""The slug of an effect stands in its family's file and nowhere else in the models: what others need of it is a field."""

import ast
from collections import Counter
from dataclasses import fields
from pathlib import Path

import models
from models.diagnosis.campaign import EventKind
from models.diagnosis.effects.catalogue import BY_SLUG
from models.records.runs import Plateaus

MODELS = Path(models.__path__[0])
#: What maintenance did, and what was measured, in the contract's words: an oil change is an event and an effect, oil
#: temperature a column and an effect.
ELSEWHERE = {
    "diagnosis/campaign.py": {kind.value for kind in EventKind},
    "records/cleaning.py": {field.name for field in fields(Plateaus)},
    "records/runs.py": {field.name for field in fields(Plateaus)},
}


def slugs_in(source: str) -> set[str]:
    """The slugs that stand as string literals in a source; docstrings and longer texts are none."""
    constants = {node.value for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Constant)}
    return constants & set(BY_SLUG)


def test_no_slug_stands_outside_its_effects_file() -> None:
    for path in MODELS.rglob("*.py"):
        name = path.relative_to(MODELS)
        if name.parts[0] == "rig":  # it hides effects, and says which
            continue
        if path.parent.name == "effects":
            continue
        assert slugs_in(path.read_text(encoding="utf-8")) <= ELSEWHERE.get(name.as_posix(), set()), name


def test_every_slug_stands_in_one_file() -> None:
    """The control: a literal is found where it stands."""
    sources = [path.read_text(encoding="utf-8") for path in (MODELS / "diagnosis/effects").glob("*.py")]
    assert Counter(slug for source in sources for slug in slugs_in(source)) == Counter(BY_SLUG.keys())
