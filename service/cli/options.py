"""Options that several commands share, and how a command ends when it cannot go on."""

from pathlib import Path
from typing import Annotated, NoReturn

import typer
from rich.console import Console

from service.cli.spool import default_folder
from service.settings import DEFAULT_DATABASE, DEFAULT_URL

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


def fail(message: str, code: int = 1) -> NoReturn:
    """Say what went wrong on standard error, and end."""
    err.print(f"[bold red]clutchlife:[/] {message}", soft_wrap=True)
    raise typer.Exit(code)
