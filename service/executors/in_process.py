"""One input after the other, in the thread that asks."""

from collections.abc import Callable, Iterable, Iterator

from service.executors.executor import Closing, Item, Outcome, Result, called


class InProcess(Closing):
    """The executor `local`."""

    elsewhere = False

    def map(
        self,
        function: Callable[[Item], Result],
        items: Iterable[Item],
        *,
        in_order: bool = True,  # noqa: ARG002  (as they come is in order)
    ) -> Iterator[Outcome[Result]]:
        """As `Executor.map`; one item is in memory at a time."""
        for index, item in enumerate(items):
            result, error = called(function, item)
            yield Outcome(index=index, result=result, error=error)
