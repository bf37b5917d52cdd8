"""Options that several commands share, and how a command ends when it cannot go on."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import httpx2
import typer
from rich.console import Console

from service.cli.sending.spool import default_folder
from service.errors import NotFoundError
from service.settings import DEFAULT_DATABASE, DEFAULT_URL
from storage.engine.errors import StorageError

if TYPE_CHECKING:
    from storage.engine.database import Database as Opened

#: sysexits.h: the input is wrong, the service is away (try again later), the call is wrong.
EX_DATAERR, EX_TEMPFAIL, EX_USAGE = 65, 75, 64

out = Console(highlight=False)
err = Console(stderr=True, highlight=False)

Database = Annotated[
    str, typer.Option("--database", envvar="CLUTCHLIFE_DATABASE", help="sqlite:///path, or sqlite:////absolute/path")
]
Url = Annotated[str, typer.Option("--url", envvar="CLUTCHLIFE_URL", help="Where the service answers")]
Key = Annotated[str | None, typer.Option("--key", envvar="CLUTCHLIFE_KEY", help="A key, where the service wants one")]
Patience = Annotated[float, typer.Option(min=0, help="Seconds to go on trying while the service is away")]
SpoolFolder = Annotated[Path, typer.Option("--spool", help="Where runs wait until the service has them")]
Seed = Annotated[int, typer.Option(min=0, help="The simulated clutch and its noise; the same seed, the same bits")]

DATABASE, URL, SPOOL = DEFAULT_DATABASE, DEFAULT_URL, default_folder()


@contextmanager
def told() -> Iterator[None]:
    """What goes wrong with files, databases and addresses is said in a line, not in a traceback."""
    try:
        yield
    except (StorageError, NotFoundError, FileExistsError) as error:
        fail(str(error))
    except httpx2.InvalidURL as error:
        fail(f"the address is not one: {error}", EX_USAGE)
    except (ValueError, OSError) as error:
        fail(str(error), EX_USAGE)


@contextmanager
def existing(url: str) -> Iterator["Opened"]:
    """An open database that is there already: a mistyped address makes no new one."""
    from storage.engine.connect import path_of  # most commands open no database
    from storage.engine.database import open_database  # most commands open no database

    with told():
        path = path_of(url)
        if not path.exists():
            fail(f"there is no database at {path}", EX_USAGE)
        opened = open_database(url)
        try:
            yield opened
        finally:
            opened.close()


def fail(message: str, code: int = 1) -> NoReturn:
    """Say what went wrong on standard error, and end."""
    err.print(f"[bold red]clutchlife:[/] {message}", soft_wrap=True)
    raise typer.Exit(code)
