"""Every route of the application, as it routes them."""

from collections.abc import Iterable, Iterator
from typing import Any


def routes_of(routes: Iterable[Any]) -> Iterator[tuple[str, str]]:
    """Method and path of every route, those of included routers too; HEAD goes with GET."""
    for route in routes:
        included = getattr(route, "original_router", None)
        if included is not None:
            yield from routes_of(included.routes)
            continue
        for method in (getattr(route, "methods", None) or {"GET"}) - {"HEAD"}:
            yield method, route.path
