"""`clutchlife fleet` asks a service where one is named and no database is, and works on a database where one is named."""

from pathlib import Path

import pytest

from tests.service.clients import clutchlife
from tests.support import serving

NOTHING, NONE = "nothing was learned", "no prior has been learned"


@pytest.mark.outside
def test_a_client_refreshes_and_reads_the_priors(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with serving(tmp_path / "clutchlife.db", loaded=True) as server:
        url, database = ("--url", server.url), ("--database", server.address)
        monkeypatch.chdir(tmp_path / "..")  # where no database is
        assert NOTHING in clutchlife("fleet", "refresh", *url)
        assert NOTHING in clutchlife("fleet", *url, "refresh")
        assert clutchlife("fleet", "refresh", "--quiet", *url) == ""
        assert NONE in clutchlife("fleet", *url)
        for words in (("fleet", "refresh", *database), ("fleet", *database, "refresh")):
            assert NOTHING in clutchlife(*words)
        jobs = server.http.get("/v1/jobs").json()["items"]
        assert [(job["kind"], job["state"]) for job in jobs] == [("fleet_refresh", "finished")] * 3
        assert NONE in clutchlife("fleet", *database, *url)
        assert len(server.http.get("/v1/jobs").json()["items"]) == 3
        monkeypatch.setenv("CLUTCHLIFE_URL", server.url)
        assert NOTHING in clutchlife("fleet", "refresh")
