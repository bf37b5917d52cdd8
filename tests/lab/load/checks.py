"""After the load: nothing acknowledged is lost, and what was computed under load is what calm computing gives."""

import subprocess
import sys
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

from service.client.clutchlife import Client
from tests.lab.load.bodies import registration
from tests.lab.load.field import Acknowledged, Counts
from tests.support import Server, serving

#: Answers about a clutch that are to be those of the same runs posted calmly, but for what is a service's own.
_OWN = {"revision", "time"}
ANSWERS = ("remaining-useful-life", "degradation", "stribeck", "loops", "series", "scores")


def losses(loaded: Server, counts: Counts) -> list[str]:
    """What is lost, added or changed of acknowledged runs, in words; empty where nothing is."""
    found = []
    with Client(loaded.url) as client:
        for clutch_id, own in counts.acknowledged.items():
            runs = client.service.pages(f"/v1/clutches/{clutch_id}/runs")
            stored = {run["run_id"]: run["content_sha256"] for run in runs}
            found += lost_of(clutch_id, own, stored, counts.unanswered)
    return found


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
    with serving(folder / "calm.db", loaded=loaded.loaded) as calm:
        for clutch_id, fluid in sample.items():
            calm.http.request(**registration(clutch_id, fluid)).raise_for_status()
            for run in acknowledged[clutch_id]:
                receipt = calm.http.request(**run.post.request(clutch_id)).raise_for_status().json()
                if receipt["content_sha256"] != run.sha256:
                    wrong.append(f"{clutch_id}: {run.post.run_id} posted calmly has another sha256")
            wrong += [
                f"{clutch_id}: {name} is not that of the same runs posted calmly"
                for name in ANSWERS
                if answered(calm, clutch_id, name) != answered(loaded, clutch_id, name)
            ]
    return wrong


def replay_differences(loaded: Server, clutch_ids: Sequence[str]) -> list[str]:
    """Clutches that a fleet teaches: whose remaining life a replay of the raw runs changes."""
    before = {clutch_id: answered(loaded, clutch_id) for clutch_id in clutch_ids}
    command = [sys.executable, "-m", "service.cli.main", "replay", *clutch_ids, "--database", loaded.address]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        return [f"replay ended with {done.returncode}: {done.stderr[-160:]}"]
    return [
        f"{clutch_id}: a replay changes the remaining life"
        for clutch_id in clutch_ids
        if answered(loaded, clutch_id) != before[clutch_id]
    ]


def answered(server: Server, clutch_id: str, name: str = ANSWERS[0]) -> dict[str, Any]:
    """The newest answer but for the revision, which says how often something was stored, and the times of arrival."""
    answer = server.http.get(f"/v1/clutches/{clutch_id}/{name}", headers={"Prefer": "wait=60"}).raise_for_status()
    found: dict[str, Any] = answer.json(object_hook=lambda found: {k: found[k] for k in found.keys() - _OWN})
    return found
