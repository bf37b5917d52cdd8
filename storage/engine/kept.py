"""Values that were read from a database, kept in the memory of this process, those used last, up to so many bytes.

Whoever keeps a value keeps with it by which he can tell that the database still gives it: a clutch's revision.
"""

import threading
from collections import OrderedDict
from collections.abc import Hashable
from typing import Any


class Kept:
    """A cache of values by name, shared by threads. A value is never changed in place."""

    def __init__(self, most_bytes: int) -> None:
        self._most_bytes = most_bytes
        self._lock = threading.Lock()
        self._values: OrderedDict[Hashable, tuple[Any, int]] = OrderedDict()
        self._bytes = 0

    def get(self, name: Hashable) -> Any:
        """The value cached under a name, else None."""
        with self._lock:
            if name not in self._values:
                return None
            self._values.move_to_end(name)
            return self._values[name][0]

    def put(self, name: Hashable, value: object, size: int) -> None:
        """Cache a value of about `size` bytes, replacing the one of that name, unless it exceeds the cache's limit."""
        with self._lock:
            self._bytes -= self._values.pop(name, (None, 0))[1]
            if size > self._most_bytes:
                return
            self._values[name] = value, size
            self._bytes += size
            while self._bytes > self._most_bytes:
                self._bytes -= self._values.popitem(last=False)[1][1]
