"""After the load: nothing acknowledged is lost, and what was computed under load is what calm computing gives."""

import json
import subprocess
import sys
from collections.abc import Collection, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

from tests.load.bodies import asked, registration
from tests.load.exchange import Answer, Blocking, LostError
from tests.load.field import Acknowledged, Counts, reason
from tests.support import Server, serving

#: Answers about a clutch that are to be those of the same runs posted calmly, but for what is a service's own.
_OWN = {"revision", "time"}
ANSWERS = ("remaining-useful-life", "degradation", "stribeck", "loops", "series", "scores")


def stored_hashes(port: int, clutch_id: str) -> dict[str, str]:
    """run_id -> content hash of all runs of a clutch, read page by page."""
    found, cursor = dict[str, str](), ""
    with closing(Blocking(port)) as line:
        while True:
            answer = _good(line.ask(asked(f"/v1/clutches/{clutch_id}/runs?limit=50{cursor}")))
            page = json.loads(answer.body)
            found |= {item["run_id"]: item["content_sha256"] for item in page["items"]}
            if page["next"] is None:
                return found
            cursor = f"&cursor={page['next']}"


def losses(port: int, counts: Counts) -> list[str]:
    """What is lost, added or changed of acknowledged runs, in words; empty where nothing is."""
    return [
        loss
        for clutch_id, own in counts.acknowledged.items()
        for loss in lost_of(clutch_id, own, stored_hashes(port, clutch_id), counts.unanswered)
    ]


def lost_of(
    clutch_id: str,
    acknowledged: Sequence[Acknowledged],
    stored: Mapping[str, str],
    unanswered: Collection[tuple[str, str]] = (),
) -> list[str]:
    """What is lost of a clutch's runs, beside what is stored of it by run_id; `unanswered` runs may be there or not."""
    wrong = []
    for run in acknowledged:
        sha256 = stored.get(run.post.run_id)
        if sha256 is None:
            wrong.append(f"{clutch_id}: {run.post.run_id} was acknowledged and is not in /runs")
        elif sha256 != run.sha256:
            wrong.append(f"{clutch_id}: {run.post.run_id} has sha256 {sha256}, its receipt said {run.sha256}")
    known = {run.post.run_id for run in acknowledged}
    wrong += [
        f"{clutch_id}: {run_id} is in /runs and was not acknowledged"
        for run_id in stored
        if run_id not in known and (clutch_id, run_id) not in unanswered
    ]
    return wrong


def calm_differences(
    folder: Path, loaded: Server, sample: Mapping[str, str], acknowledged: Mapping[str, Sequence[Acknowledged]]
) -> list[str]:
    """Differences from a fresh service on a file that is sent the same runs one by one: hashes and answers.

    `sample`: the fluid by clutch_id.
    """
    wrong = []
    with (
        closing(Blocking(loaded.port)) as line,
        serving(folder / "calm.db", loaded=loaded.loaded) as server,
        closing(Blocking(server.port)) as calm,
    ):
        for clutch_id, fluid in sample.items():
            _good(calm.ask(registration(clutch_id, fluid)))
            for run in acknowledged[clutch_id]:
                receipt = json.loads(_good(calm.ask(run.post.request(clutch_id))).body)
                if receipt["content_sha256"] != run.sha256:
                    wrong.append(f"{clutch_id}: {run.post.run_id} posted calmly has another sha256")
            wrong += [
                f"{clutch_id}: {name} is not that of the same runs posted calmly"
                for name in ANSWERS
                if answered(calm, clutch_id, name) != answered(line, clutch_id, name)
            ]
    return wrong


def replay_differences(loaded: Server, clutch_ids: Sequence[str]) -> list[str]:
    """Clutches that a fleet teaches: whose remaining life a replay of the raw runs changes."""
    with closing(Blocking(loaded.port)) as line:
        before = {clutch_id: answered(line, clutch_id) for clutch_id in clutch_ids}
        command = [sys.executable, "-m", "service.cli.main", "replay", *clutch_ids, "--database", loaded.address]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            return [f"replay ended with {done.returncode}: {done.stderr[-160:]}"]
        return [
            f"{clutch_id}: a replay changes the remaining life"
            for clutch_id in clutch_ids
            if answered(line, clutch_id) != before[clutch_id]
        ]


def answered(line: Blocking, clutch_id: str, name: str = ANSWERS[0]) -> dict[str, Any]:
    """The newest answer but for the revision, which says how often something was stored, and the times of arrival."""
    request = asked(f"/v1/clutches/{clutch_id}/{name}", "Prefer: wait=60")
    body = _good(line.ask(request)).body
    answer: dict[str, Any] = json.loads(body, object_hook=lambda found: {k: found[k] for k in found.keys() - _OWN})
    return answer


def _good(answer: Answer) -> Answer:
    if answer.status not in (200, 201):
        raise LostError(f"{answer.status}: {reason(answer)}")
    return answer
