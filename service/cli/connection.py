"""A service for one command: its refusals, and that it does not answer, end the command with a line and an exit code."""

from collections.abc import Iterator
from contextlib import contextmanager

from service.cli.options import EX_DATAERR, EX_TEMPFAIL, errors_in_a_line, fail
from service.client.clutchlife.answers import RefusedError, ServiceAwayError
from service.client.clutchlife.transport import Service, connect


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
