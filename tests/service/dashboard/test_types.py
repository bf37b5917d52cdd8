"""The answers as JavaScript's checks know them hold no field that the service does not send."""

import importlib
import pkgutil
import re

import pytest
from pydantic import BaseModel

import service.schemas
from service.dashboard.assets import STATIC

TEXT = (STATIC / "shared" / "types.d.ts").read_text(encoding="utf-8")
#: Interfaces that stand for no single class of the schemas.
GENERIC = {"ListPage"}


def schemas() -> dict[str, type[BaseModel]]:
    """Every class of service/schemas by its name."""
    modules = [
        importlib.import_module(info.name)
        for info in pkgutil.walk_packages(service.schemas.__path__, "service.schemas.")
    ]
    return {
        name: value
        for module in modules
        for name, value in vars(module).items()
        if isinstance(value, type) and issubclass(value, BaseModel)
    }


def interfaces(text: str) -> dict[str, dict[str, str]]:
    """Each interface's own fields with their types."""
    found = re.findall(r"^export interface (\w+)[^{]*\{\n(.*?)^\}", text, re.MULTILINE | re.DOTALL)
    return {name: dict(re.findall(r"^  (\w+): (.*);$", body, re.MULTILINE)) for name, body in found}


def wrong(fields: dict[str, str], schema: type[BaseModel]) -> list[str]:
    """Fields that the schema does not have, or that may be null there and not here."""
    sent = schema.model_fields
    return [
        name
        for name, kind in fields.items()
        if name not in sent or kind.endswith("| null") != (type(None) in getattr(sent[name].annotation, "__args__", ()))
    ]


ANSWERS = {name: fields for name, fields in interfaces(TEXT).items() if name not in GENERIC}


def test_every_interface_is_read() -> None:
    assert len(interfaces(TEXT)) == TEXT.count("export interface") > 25
    assert all(ANSWERS.values())


@pytest.mark.parametrize("name", sorted(ANSWERS))
def test_an_interface_holds_what_the_schema_of_its_name_holds(name: str) -> None:
    assert wrong(ANSWERS[name], schemas()[name]) == []


def test_a_wrong_field_would_be_noticed() -> None:
    schema = schemas()["Current"]
    assert wrong({"health": "number | null"}, schema) == []
    assert wrong({"helth": "number | null"}, schema) == ["helth"]
    assert wrong({"health": "number"}, schema) == ["health"]
