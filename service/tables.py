"""Answers as rows of a table: what the CSV exports write."""

from collections.abc import Iterable
from typing import TypeAlias

from pydantic import BaseModel

#: A row of a table by the names of its columns.
Cells: TypeAlias = dict[str, object]


def cells(answer: BaseModel, names: Iterable[str]) -> Cells:
    """An answer's fields of these names as a table row."""
    return {name: getattr(answer, name) for name in names}
