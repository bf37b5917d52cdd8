"""Benches on files of their own."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, closing
from itertools import count
from pathlib import Path
from typing import Any

import pytest

from tests.service.changes.benches import Bench, stood_in

NewBench = Callable[..., Bench]


@pytest.fixture
def new_bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[NewBench]:
    """Makes benches, each of a clutch of that record."""
    numbers = count()
    with stood_in(monkeypatch), ExitStack() as stack:

        def made(record: Mapping[str, Any] | None = None) -> Bench:
            return stack.enter_context(closing(Bench(tmp_path / f"bench-{next(numbers)}.db", record)))

        yield made


@pytest.fixture
def bench(new_bench: NewBench) -> Bench:
    return new_bench()


@pytest.fixture
def benches(new_bench: NewBench) -> tuple[Bench, Bench]:
    """A bench that slips, and one that does not."""
    return new_bench(), new_bench()
