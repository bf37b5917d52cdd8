"""A service for one command: --url, --key and --patience become one; its refusals, and that it does not answer, end the
command with a line and an exit code.
"""

import functools
import inspect
import json
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from service.cli.options import (
    EX_DATAERR,
    EX_TEMPFAIL,
    URL,
    Key,
    Patience,
    Url,
    errors_in_a_line,
    fail,
    out,
    print_line,
)
from service.client.clutchlife.answers import RefusedError, ServiceAwayError
from service.client.clutchlife.transport import Service, connect

_OPTIONS = {"url": (Url, URL), "key": (Key, None), "patience": (Patience, 10.0)}


@contextmanager
def service_at(url: str, key: str | None, patience: float) -> Iterator[Service]:
    """The service at `url`; `patience` [s] is how long a request is tried again while the service is away."""
    with errors_in_a_line(), connect(url, key=key) as http:
        try:
            yield Service(http=http, patience=patience)
        except ServiceAwayError as error:
            fail(str(error), EX_TEMPFAIL)
        except RefusedError as error:
            fail(str(error), EX_DATAERR)


def asking(command: Callable[..., None]) -> Callable[..., None]:
    """The command with --url, --key and --patience in the place of its first parameter, the service that they make."""
    _, *own = inspect.signature(command, eval_str=True).parameters.values()
    kind = inspect.Parameter.KEYWORD_ONLY
    shared = [inspect.Parameter(name, kind, default=usual, annotation=of) for name, (of, usual) in _OPTIONS.items()]

    @functools.wraps(command)
    def with_service(*, url: str, key: str | None, patience: float, **given: Any) -> None:
        with service_at(url, key, patience) as service:
            command(service, **given)

    with_service.__signature__ = inspect.Signature([*own, *shared])  # type: ignore[attr-defined]
    with_service.__annotations__ = {parameter.name: parameter.annotation for parameter in [*own, *shared]}
    return with_service


def listed(items: Iterable[Any], as_json: bool, show: Callable[[list[Any]], object], nothing: str) -> None:
    """A list as JSON or as it is shown; without items the line that says so."""
    items = list(items)
    if as_json:
        out.print_json(json.dumps(items))
    elif items:
        show(items)
    else:
        print_line(nothing)
