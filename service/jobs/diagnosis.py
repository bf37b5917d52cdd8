"""The process in which one diagnosis is made: it reads a clutch's runs, and says on standard output what was found."""

import importlib
import json
import os
import sys
import threading
import zlib
from contextlib import closing
from typing import Any

import numpy as np

from service.jobs.remaining import before_and_after
from service.lives.campaign import read_campaign
from service.lives.diagnosis_report import public
from storage.engine.database import open_database

#: How much this process yields to the one that answers.
_NICE = 10


def main() -> None:
    """Diagnose what the first argument names, JSON."""
    asked = json.loads(sys.argv[1])
    threading.Thread(target=_end_with_the_service, daemon=True).start()
    os.nice(_NICE)
    _limit(asked["bytes"])
    try:
        said = diagnosed(asked)
    except MemoryError:
        said = {"problem": f"it needs more than {asked['bytes'] // 2**20} MB of memory"}
    json.dump(said, sys.stdout, allow_nan=False)


def diagnosed(asked: dict[str, Any]) -> dict[str, Any]:
    """The report in the public shape, and the extension. The same runs give the same."""
    module, _, function = asked["engine"].partition(":")
    diagnose = getattr(importlib.import_module(module), function)
    clutch_id = asked["clutch_id"]
    with closing(open_database(asked["database"])) as database:
        known = read_campaign(database, clutch_id, last_run_key=asked["last_run_key"])
        rng = np.random.default_rng([zlib.crc32(clutch_id.encode()), len(known.taken)])
        report = diagnose(known.campaign, rng=rng)
        before, after = before_and_after(database, clutch_id, known, report.extension)
    origin = 0.0 if known.life is None else known.life.origin
    return {
        "report": public(report, origin=origin, before=before, after=after, notes=known.notes),
        "extension": None if report.extension is None else report.extension.to_dict(),
    }


def _end_with_the_service() -> None:
    """Standard input is a pipe whose other end nobody writes to: it ends when the service does."""
    while os.read(0, 1):  # not by way of sys.stdin, whose lock would be in the way when this process ends
        pass
    os._exit(3)


def _limit(most: int) -> None:
    import resource

    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


if __name__ == "__main__":
    main()
