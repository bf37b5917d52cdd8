"""Computed answers as JSON or CSV bytes, by what they depend on: bounded, shared between threads, and each made once.

Where several ask for an answer that is not there yet, one computes it and the others wait for it.
"""

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from concurrent.futures import Future


class AnswerCache:
    """The last answers; the least lately asked for goes first. `most_bytes` bounds their sizes together."""

    def __init__(self, most_bytes: int) -> None:
        self._most = most_bytes
        self._held = 0
        self._answers: OrderedDict[Hashable, bytes] = OrderedDict()
        self._making: dict[Hashable, Future[bytes]] = {}
        self._lock = threading.Lock()

    def answer(self, key: Hashable, make: Callable[[], bytes]) -> bytes:
        """The answer for `key`, made by `make` where it is not there. What `make` raises is raised for all who wait."""
        with self._lock:
            if key in self._answers:
                self._answers.move_to_end(key)
                return self._answers[key]
            pending = self._making.get(key)
            if pending is not None:
                mine = False
            else:
                mine, pending = True, Future()
                self._making[key] = pending
        if mine:
            self._make(key, make, pending)
        return pending.result()

    def _make(self, key: Hashable, make: Callable[[], bytes], pending: "Future[bytes]") -> None:
        try:
            answer = make()
        except BaseException as error:  # noqa: BLE001  (raised again for each who asked)
            with self._lock:
                del self._making[key]
            pending.set_exception(error)
            return  # who asked is told by `pending`, as all who wait are
        with self._lock:
            if len(answer) <= self._most:
                self._held += len(answer)
                self._answers[key] = answer
            while self._held > self._most:
                self._held -= len(self._answers.popitem(last=False)[1])
            del self._making[key]
        pending.set_result(answer)
