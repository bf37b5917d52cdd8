"""State, sentences, figures, report and JSON of a clutch say the same, over many lives of all kinds."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Browser

from service.clutch.condition import STATE_WORDS, bound_in_words
from tests.browser.modules import load, open_page
from tests.service.clients import client_on
from tests.support import Server, one_quick, stationary

pytestmark = pytest.mark.browser

SPEEDS = tuple(range(20, 1971, 150))
CRITERIA = (
    [],
    [
        {"quantity": "mean_cof", "fraction": 0.6},
        {"quantity": "slope", "speed_rpm": 100, "pressure_bar": 5.0, "below": 0.0},
    ],
    [{"quantity": "static_torque_nm", "pressure_bar": 5.0, "fraction": 0.7}],
)
#: What the pages draw of an answer: a row of the start page; the head, the report and a chart's note of the clutch's page.
_DRAWN = """async ([root, answers]) => {
  const [{ row }, { head }, { makeReport }, { fan }, { byMeanCof }, { atLeast }] = await Promise.all(
    ["fleet/row.js", "clutch/head.js", "clutch/report.js", "charts/fan.js", "quantities/criteria.js", "shared/format.js"]
      .map((name) => import(`${root}${name}`)));
  const pooled = { measured: { cycles: [] }, trajectory: { cycles: [] } };
  return answers.map(([clutch, life]) => {
    const report = document.createElement("div");
    makeReport(report, { clutch, life });
    const { note } = fan({ life: byMeanCof(life), pooled, predictions: [], events: [] });
    const made = row(clutch, { scale: 10000, group: null, chosen: false, choose: () => {} });
    return {
      row: made.textContent, safe: made.querySelector(".safe .number")?.textContent ?? "",
      health: made.querySelector(".share").textContent,
      head: head(clutch, {}).map((element) => element.textContent).join(" "), report: report.textContent, note,
      bound: life.at_least === null ? null : atLeast(life.at_least),
    };
  });
}"""


def lives(folder: Path, count: int) -> list[tuple[dict[str, Any], dict[str, Any]]]:
    """Clutches of any age, with criteria of their own or none, with a held run, with an end that was declared; each as the
    list and as the remaining life states it."""
    rng, found = np.random.default_rng(64), []
    with client_on(f"sqlite:///{folder}/lives.db") as client:
        for number in range(count):
            name, gone = f"life-{number}", float(np.exp(rng.uniform(np.log(8_000), np.log(80_000))))
            record = {"clutch_id": name, "end_of_life": {"criteria": CRITERIA[number % len(CRITERIA)]}}
            assert client.post("/v1/clutches", json=record).status_code == 201
            tests, step = int(rng.integers(1, 8)), int(0.9 * gone * rng.uniform(0.02, 0.14))
            for cycles in range(0, tests * step, step):
                body = stationary(cycles, wear=cycles / gone, pressures=(4.0, 5.0), speeds=SPEEDS)
                assert client.post(f"/v1/clutches/{name}/runs", json=body).status_code == 201
            last = (tests - 1) * step
            if number % 7 == 3:
                odd = stationary(last + step, wear=-0.5, pressures=(4.0, 5.0), speeds=SPEEDS)
                client.post(f"/v1/clutches/{name}/runs", json=odd)
            if number % 7 == 5:
                reason = ("worn", "other")[number % 2]
                end = {"kind": "maintenance", "event": "end_of_life", "cycles": last + 10, "reason": reason}
                assert client.post(f"/v1/clutches/{name}/runs", json=end).status_code == 201
            life = client.get(f"/v1/clutches/{name}/remaining-useful-life").json()
            found.append((client.get(f"/v1/clutches/{name}").json(), life))
    return found


@pytest.mark.parametrize("count", one_quick([21, 200]))
def test_everything_says_the_same(browser: Browser, server: Server, tmp_path: Path, count: int) -> None:
    made = lives(tmp_path, count)
    page = open_page(browser, server)
    root = load(page, server, "").address
    drawn = page.evaluate(_DRAWN, [root, json.loads(json.dumps(made))])
    page.context.close()
    kinds = set()
    for (clutch, life), shown in zip(made, drawn, strict=True):
        summary, state = clutch["summary"], clutch["state"]
        where = clutch["clutch_id"], state, clutch["headline"], clutch["action"], shown
        # the list and the remaining life state one prediction
        for field in (
            "status",
            "at_least",
            "at_least_at",
            "remaining_cycles",
            "probability_of_reaching",
            "statement",
            "ended",
        ):
            assert summary[field] == life[field], (field, where)
        assert summary["current"] == life["current"], where
        assert summary["criterion"]["quantity"] == life["criterion"]["quantity"], where
        # the state and its sentences follow from it
        over = life["ended"] is not None
        worn = over and life["ended"]["reason"] == "worn"
        assert (state["name"] == "failure") is (life["status"] == "reached" or worn), where
        assert clutch["headline"].startswith(f"{STATE_WORDS[state['name']]}: "), where
        assert ("Replace " in clutch["action"] or "replace the" in clutch["action"]) is (
            state["name"] in ("failure", "maintenance") and not over
        ), where
        health = life["current"]["health"]
        if clutch["action"].startswith("Nothing to do"):
            assert state["name"] == "normal", where
            assert health is None or health >= 0.2, where
            assert life["at_least"] >= 1.0, where
        # pages and report draw it
        for text in (clutch["headline"].partition(": ")[2], clutch["action"]):
            assert text in shown["head"], where
            assert text in shown["report"], where
        assert clutch["action"] in shown["row"], where
        assert STATE_WORDS[state["name"]] in shown["row"], where
        if health is not None:
            assert shown["health"] == f"{int(100 * health + 0.5)} %" or abs(100 * health % 1 - 0.5) < 1e-6, where
        if life["status"] in ("predicted", "may_never_reach"):
            assert shown["bound"] in shown["report"], where
            if life["at_least"] >= 10.0:
                assert f"safe for {shown['safe']} " in bound_in_words(life["at_least"]), where
                assert f"safe for {shown['safe']} " in clutch["headline"], where
        # a probability beside mean COF is that of mean COF
        own = [end["probability_of_reaching"] for end in life["criteria"] if end["quantity"] == "mean_cof"]
        if "with a probability of" in shown["note"] and own and 0.005 <= own[0] < 0.995:
            assert f"{int(100 * own[0] + 0.5)} %" in shown["note"], where
        if not own and life["criteria"] and life["status"] in ("predicted", "may_never_reach"):
            assert "no end-of-life criterion of the clutch uses mean COF" in shown["note"], where
        kinds.add((state["name"], life["status"], bool(life["criteria"])))
    assert len({name for name, *_ in kinds}) >= 4
    assert {"predicted", "insufficient_data", "reached", "ended"} <= {status for _, status, _ in kinds}
