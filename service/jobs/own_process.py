"""The process of a job as it sees itself: it ends when the service does, says how far it has come, and answers."""

import json
import os
import resource
import sys
import threading
from collections.abc import Mapping
from typing import Any

from service.jobs.child import PROGRESS
from storage.encoding.json_text import Json, to_text


def end_with_the_service() -> None:
    """Have this process end when its service does, however that comes; what it held in memory goes to no file."""
    threading.Thread(target=_end_with_standard_input, daemon=True).start()
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def say(progress: Json) -> None:
    """Say how far the job has come."""
    sys.stdout.write(f"{PROGRESS.decode()}{to_text(progress)}\n")
    sys.stdout.flush()


def answer(ended: Mapping[str, Any]) -> None:
    """Write the last line: how the job ended."""
    sys.stdout.write(f"{json.dumps(ended, allow_nan=False)}\n")


def _end_with_standard_input() -> None:
    """It is a pipe whose other end nobody writes to: it ends when the service does."""
    while os.read(0, 1):  # not by way of sys.stdin, whose lock would be in the way when this process ends
        pass
    os._exit(3)
