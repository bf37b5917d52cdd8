"""Load, compute, store: of each of many names what it follows from is loaded, computed by an executor, and stored where it
still holds; else the name is taken up again in the next round."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Generic

from service.work.executor import Executor, Item, Result


class Ending(Enum):
    """How a name ended."""

    STORED = "its result is stored"
    NOTHING = "there was nothing to compute"
    FAILED = "loading or computing raised an error"
    LEFT = "what it follows from had changed at each attempt"


@dataclass(frozen=True, slots=True, kw_only=True)
class Ended(Generic[Result]):
    """A name's end: its result where that is stored, the error where there was one."""

    name: str
    ending: Ending
    result: Result | None = None
    error: Exception | None = None


def in_rounds(
    executor: Executor,
    names: Sequence[str],
    *,
    load: Callable[[str], Item | None],
    compute: Callable[[Item], Result],
    store: Callable[[Item, Result], bool],
    rounds: int,
) -> Iterator[Ended[Result]]:
    """The names as they end. `load` gives None where there is nothing to do, `store` False where the item holds no more."""
    for number in range(rounds):
        sent: dict[int, tuple[str, Item]] = {}
        ended: list[Ended[Result]] = []
        again: list[str] = []

        def items(
            names: Iterable[str] = names,
            sent: dict[int, tuple[str, Item]] = sent,
            ended: list[Ended[Result]] = ended,
        ) -> Iterator[Item]:
            index = 0
            for name in names:
                try:
                    item = load(name)
                except Exception as error:  # noqa: BLE001  (given to who asked)
                    ended.append(Ended(name=name, ending=Ending.FAILED, error=error))
                    continue
                if item is None:
                    ended.append(Ended(name=name, ending=Ending.NOTHING))
                    continue
                sent[index] = (name, item)
                index += 1
                yield item

        for outcome in executor.map(compute, items(), in_order=False):
            name, item = sent.pop(outcome.index)
            if outcome.error is not None:
                ended.append(Ended(name=name, ending=Ending.FAILED, error=outcome.error))
            elif store(item, outcome.value()):
                ended.append(Ended(name=name, ending=Ending.STORED, result=outcome.value()))
            elif number + 1 < rounds:
                again.append(name)
            else:
                ended.append(Ended(name=name, ending=Ending.LEFT))
            yield from ended
            ended.clear()
        yield from ended
        names = again
