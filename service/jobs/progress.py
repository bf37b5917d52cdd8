"""How far work has come: a bar on a terminal, a line now and then elsewhere."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

#: [s] Between two lines where there is no terminal. Chosen: a log of a night stays a page.
LINE_SECONDS = 20.0


@contextmanager
def progress(console: Console, title: str) -> Iterator[Callable[..., None]]:
    """Context that shows progress on the console: call the yielded function with the `count` of inputs just finished,
    or with their `total` once it is known."""
    if console.is_terminal:
        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
        with Progress(*columns, console=console, transient=True) as shown:
            task = shown.add_task(title, total=None)

            def advance_bar(count: int = 1, *, total: int | None = None) -> None:
                shown.update(task, advance=count, total=total)

            yield advance_bar
        return
    done, expected, shown_at = 0, None, time.monotonic()

    def advance_line(count: int = 1, *, total: int | None = None) -> None:
        nonlocal done, expected, shown_at
        done, expected = done + count, expected if total is None else total
        if time.monotonic() - shown_at >= LINE_SECONDS:
            shown_at = time.monotonic()
            out_of = "" if expected is None else f" of {expected}"
            console.print(f"{title}: {done}{out_of}", markup=False, soft_wrap=True)

    yield advance_line
