"""A process that has loaded the libraries of formats and divides for each file, so that reading starts warm.

It opens no file itself: each file is read by a child of its own, which closes its doors first (`sandbox`). The parent sends
a line of JSON and the open file for the answer, over a socket; the zygote answers with the child's number when it has begun,
and with how it ended. It ends when the socket does.
"""

import atexit
import contextlib
import gc
import json
import os
import signal
import socket
import struct
import subprocess
import sys
from collections.abc import Callable, Mapping
from typing import Any, BinaryIO

#: Characters of a request, and how numbers of processes and their ends are sent.
_LONGEST_REQUEST, _NUMBER = 1 << 20, struct.Struct("i")
#: Environment variables that a reading process gets; no others, so no keys.
_ENVIRONMENT = ("PATH", "PYTHONPATH", "LANG", "LC_ALL", "LD_LIBRARY_PATH", "XDG_CACHE_HOME", "MPLCONFIGDIR")
# further threads would only reserve memory: the limit is on reserved memory
_FIXED = {
    "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "NUMEXPR_MAX_THREADS": "1", "ARROW_DEFAULT_MEMORY_POOL": "system",
    "MALLOC_ARENA_MAX": "2", "PYTHONIOENCODING": "utf-8",
}  # fmt: skip


class Zygote:
    """A zygote process, and the parent's end of its socket. It serves one file at a time."""

    def __init__(self, environment: Mapping[str, str]) -> None:
        self._socket, theirs = socket.socketpair()
        arguments = [sys.executable, "-P", "-W", "ignore", "-m", "service.readers.sandbox", str(theirs.fileno())]
        with theirs:
            self._process = subprocess.Popen(  # noqa: S603 (our own interpreter and module)
                arguments,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                pass_fds=[theirs.fileno()],
                env=dict(environment),
            )

    def run(self, request: Mapping[str, Any], result: BinaryIO, seconds: float) -> int:
        """Read a file in a child process; returns the child's exit status (minus a signal), or the zygote's own if that
        has ended.

        Raises TimeoutError if it takes longer, after killing the child.
        """
        child = 0
        try:
            self._socket.settimeout(seconds)
            message = json.dumps(request).encode()
            socket.send_fds(self._socket, [_NUMBER.pack(len(message))], [result.fileno()])
            self._socket.sendall(message)
            child = self._number()
            return self._number()
        except TimeoutError:
            if child:
                with contextlib.suppress(ProcessLookupError):  # it has just ended
                    os.kill(child, signal.SIGKILL)
            self.end(kill=True)
            raise
        except (ConnectionError, EOFError):
            return self.end()

    def _number(self) -> int:
        held = b""
        while len(held) < _NUMBER.size:
            held += (part := self._socket.recv(_NUMBER.size - len(held)))
            if not part:
                raise EOFError
        return int(_NUMBER.unpack(held)[0])

    def alive(self) -> bool:
        """Whether it can accept a file."""
        return self._process.poll() is None

    def end(self, *, kill: bool = False) -> int:
        """End the zygote; returns its exit status."""
        self._socket.close()
        if kill:
            self._process.kill()
        return self._process.wait()


#: Those that wait for a file, by what they have of the environment.
_idle: list[tuple[dict[str, str], Zygote]] = []


def run(request: Mapping[str, Any], result: BinaryIO, seconds: float) -> int:
    """Read a file in a child of an idle zygote, or of a new one; returns as `Zygote.run`."""
    environment = {name: os.environ[name] for name in _ENVIRONMENT if name in os.environ} | _FIXED
    zygote = _taken(environment) or Zygote(environment)
    ended = zygote.run(request, result, seconds)
    if zygote.alive():
        _idle.append((environment, zygote))
    return ended


def _taken(environment: Mapping[str, str]) -> Zygote | None:
    while _idle:
        held, zygote = _idle.pop()
        if held == environment and zygote.alive():
            return zygote
        zygote.end()
    return None


@atexit.register
def _end_all() -> None:
    while _idle:
        _idle.pop()[1].end()


def serve(control: socket.socket, load: Callable[[Any], None], read: Callable[[Any, int], None]) -> None:
    """The zygote's loop: `load` the module for each request, and `read` the file in a child, until the parent closes
    the socket."""
    while True:
        head, files, *_ = socket.recv_fds(control, _NUMBER.size, 1)
        if not head:
            return
        message = b""
        while len(message) < _NUMBER.unpack(head)[0]:
            message += control.recv(_LONGEST_REQUEST)
        request = json.loads(message)
        load(request)
        gc.freeze()  # what is loaded is shared with children: their collector must not touch it
        child = os.fork()
        if child == 0:
            control.close()
            status = 1
            try:
                read(request, files[0])
                status = 0
            finally:
                os._exit(status)
        os.close(files[0])
        control.sendall(_NUMBER.pack(child))
        _, status = os.waitpid(child, 0)
        control.sendall(_NUMBER.pack(os.waitstatus_to_exitcode(status)))
