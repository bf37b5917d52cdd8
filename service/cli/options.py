"""Options that several commands share, a service for one command, and how a command ends on an error."""

import functools
import inspect
import json
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing, contextmanager
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer
from rich.console import Console, ConsoleOptions, RenderableType
from rich.markup import escape
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.segment import Segment

from service.client.clutchlife.answers import RefusedError, ServiceAwayError
from service.client.clutchlife.transport import Service, connect
from service.defaults import DEFAULT_DATABASE, DEFAULT_URL, SCHEDULERS
from service.errors import NotFoundError
from storage.engine.errors import StorageError

if TYPE_CHECKING:
    from service.jobs.executor import Executor
    from storage.engine.database import Database as Opened

#: Exit codes of sysexits.h: the input is wrong, the service is away (try again later), the call is wrong.
EX_DATAERR, EX_TEMPFAIL, EX_USAGE = 65, 75, 64

#: What commands a terminal or turns the order of letters about, as no text that somebody sent may.
_COMMANDING = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")


class _Terminal(Console):
    """A console that prints control characters in notes, titles and names as �, so that no text moves the cursor."""

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """The printed segments; rich's own control codes are segments of their own and stay."""
        for part in super().render(renderable, options):
            yield part if part.control else Segment(_COMMANDING.sub("\N{REPLACEMENT CHARACTER}", part.text), part.style)


out = _Terminal(highlight=False)
err = _Terminal(stderr=True, highlight=False)

Database = Annotated[
    str,
    typer.Option(
        "--database",
        envvar="CLUTCHLIFE_DATABASE",
        help="sqlite:///path, sqlite:////absolute/path, or postgresql+psycopg://user@host/database",
    ),
]
#: The same where a service may be asked instead.
ChosenDatabase = Annotated[
    str | None, typer.Option("--database", envvar="CLUTCHLIFE_DATABASE", help="Work on this database; see --url")
]
ServiceUrl = Annotated[
    str | None, typer.Option("--url", envvar="CLUTCHLIFE_URL", help="Ask the service at this address")
]
ClutchId = Annotated[str, typer.Argument(metavar="ID")]
Url = Annotated[str, typer.Option("--url", envvar="CLUTCHLIFE_URL", help="The address of the service")]
Key = Annotated[str | None, typer.Option("--key", envvar="CLUTCHLIFE_KEY", help="Your key, if the service needs one")]
Patience = Annotated[float, typer.Option(min=0, help="Seconds to keep trying while the service is away")]
Seed = Annotated[
    int, typer.Option(min=0, help="Seed of the simulated clutch and its noise; the same seed gives the same data")
]

ChannelMap = Annotated[str | None, typer.Option("--map", help="Channels by name: torque_nm:Mz,speed_rpm:n")]
Decimal = Annotated[str | None, typer.Option(help="Decimal sign of text files, . or , ; default: detected")]
Missing = Annotated[
    str | None,
    typer.Option(
        help="Marks of missing values, such as -9999,n/a; rows with such a mark are left out. "
        "none: every number is a measurement"
    ),
]
Good = Annotated[
    str | None,
    typer.Option(help="Codes of a column of qualities that mark good rows, such as 0 or 192. none: all rows are read"),
]

Reason = Annotated[str, typer.Option("--reason", help="The reason, for the audit trail")]
Json = Annotated[bool, typer.Option("--json", help="Print the service's answer as JSON")]

Scheduler = Annotated[str, typer.Option("--scheduler", help=f"Where it is computed: {SCHEDULERS}")]

DATABASE, URL = DEFAULT_DATABASE, DEFAULT_URL


@contextmanager
def errors_in_a_line() -> Iterator[None]:
    """Context that prints errors of files, databases, addresses and the service in one line instead of a traceback."""
    try:
        yield
    except ServiceAwayError as error:
        fail(str(error), EX_TEMPFAIL)
    except RefusedError as error:
        fail(str(error), EX_DATAERR)
    except (StorageError, NotFoundError, FileExistsError) as error:
        fail(str(error))
    except OSError as error:
        fail(f"{error.filename}: {error.strerror}" if error.filename and error.strerror else str(error), EX_USAGE)
    except ValueError as error:
        fail(str(error), EX_USAGE)


@contextmanager
def existing(url: str, *, read_only: bool = False) -> Iterator["Opened"]:
    """The open, existing database; a mistyped address creates none. An older database is migrated, or left at its
    revision if `read_only`."""
    from storage.engine.opening import find_database, open_database  # start-up time: most commands open no database

    with errors_in_a_line():
        require_database(url)
        with closing((find_database if read_only else open_database)(url)) as opened:
            yield opened


@contextmanager
def executor(scheduler: str) -> Iterator["Executor"]:
    """Context with the executor of an option; if it cannot be used, the command ends with a line."""
    from service.jobs import executor as executors  # start-up time: few commands compute

    with errors_in_a_line():
        try:
            with executors.executor_of(scheduler) as chosen_executor:
                yield chosen_executor
        except executors.ExecutorUnavailableError as error:
            fail(str(error), EX_TEMPFAIL)


def require_database(url: str) -> None:
    """End the command if there is no database at the address."""
    from service.settings import redacted  # start-up time: most commands open no database
    from storage.engine.opening import database_exists  # start-up time: most commands open no database

    if not database_exists(url):
        fail(f"there is no database at {redacted(url)}: name it with --database", EX_USAGE)


def require_file(url: str, instead: str) -> None:
    """End the command if the database is not a file."""
    from storage.engine.postgresql.connect import is_on_server  # start-up time: most commands open no database

    if is_on_server(url):
        fail(f"the database is on a PostgreSQL server: {instead}", EX_USAGE)


def print_line(text: str) -> None:
    """Print a line on standard output, unwrapped in a narrow terminal too."""
    out.print(text, markup=False, soft_wrap=True)


def say(text: str) -> None:
    """Print a line on standard error, with file names unchanged."""
    err.print(text, markup=False, soft_wrap=True)


def spinning(console: Console) -> Progress:
    """Context with a bar of a simulation's progress."""
    columns = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    return Progress(*columns, console=console, transient=True)


def fail(message: str, code: int = 1) -> NoReturn:
    """Print the error on standard error, and end."""
    err.print(f"[bold red]clutchlife:[/] {escape(message)}", soft_wrap=True)
    raise typer.Exit(code)


_OPTIONS = {"url": (Url, URL), "key": (Key, None), "patience": (Patience, 10.0)}


def asking(command: Callable[..., None]) -> Callable[..., None]:
    """The command with --url, --key and --patience in place of its first parameter, the service made from them."""
    _, *parameters = inspect.signature(command, eval_str=True).parameters.values()
    kind = inspect.Parameter.KEYWORD_ONLY
    shared = [inspect.Parameter(name, kind, default=usual, annotation=of) for name, (of, usual) in _OPTIONS.items()]

    @functools.wraps(command)
    def with_service(*, url: str, key: str | None, patience: float, **given: Any) -> None:
        with errors_in_a_line(), connect(url, key=key) as http:
            command(Service(http=http, patience=patience), **given)

    with_service.__signature__ = inspect.Signature([*parameters, *shared])  # type: ignore[attr-defined]
    with_service.__annotations__ = {parameter.name: parameter.annotation for parameter in [*parameters, *shared]}
    return with_service


def listed(items: Iterable[Any], as_json: bool, show: Callable[[list[Any]], object], nothing: str) -> None:
    """Print a list as JSON or by `show`; without items, the line that says so."""
    items = list(items)
    if as_json:
        out.print_json(json.dumps(items))
    elif items:
        show(items)
    else:
        print_line(nothing)
