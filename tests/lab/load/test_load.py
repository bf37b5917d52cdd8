"""The load generator itself: what it sends, what it counts, what it would miss."""

import json
from pathlib import Path

import pytest

from tests.lab.load.__main__ import run
from tests.lab.load.bodies import Post, life
from tests.lab.load.checks import lost_of
from tests.lab.load.field import ROUTES, Acknowledged, Counts, Options
from tests.lab.load.report import demands, markdown


def run_named(name: str) -> Post:
    return Post(run_id=name, kind="maintenance", content=b"{}")


def test_a_life_is_whole_and_the_same_for_a_seed(tmp_path: Path) -> None:
    own = life(3, tests=20)
    assert own == life(3, tests=20)
    assert own != life(4, tests=20)
    kinds = [post.kind for post in own]
    assert kinds.count("stationary_stribeck") == 20
    assert set(kinds) == {"run_in", "duty_cycles", "stationary_stribeck", "maintenance"}
    for post in own:
        body = json.loads(post.content)
        assert (body["run_id"], body["kind"]) == (post.run_id, post.kind)
    # sampled records: raw files take the place of stationary tests, one post in ten; dynamic tests come beside them
    raw = life(3, raw=tmp_path, tests=20, samples=2_000)
    assert sum(post.kind == "dynamic_stribeck" for post in raw) == 2
    assert [post.run_id for post in raw if post.kind != "dynamic_stribeck"] == [post.run_id for post in own]
    files = [post for post in raw if post.raw]
    assert len(files) == 4
    assert {Path(str(post.path)).suffix for post in files} == {".gz", ".parquet"}


def test_what_is_lost_changed_or_added_is_noticed() -> None:
    own = [Acknowledged(post=run_named(name), sha256=name * 2) for name in ("a", "b")]
    assert lost_of("c", own, {"a": "aa", "b": "bb"}) == []
    assert lost_of("c", own, {"a": "aa", "b": "bb", "x": "xx"}, {("c", "x")}) == []
    for wrong in ({"a": "aa", "b": "bb", "x": "xx"}, {"a": "aa"}, {"a": "aa", "b": "bx"}):
        assert len(lost_of("c", own, wrong)) == 1


def found(*, get: float = 0.01, post: float = 0.1, runs: int = 20, memory: int = 100, raw: bool = False) -> Counts:
    """What a load of one second might come to."""
    counts = Counts(Options(seconds=1.0, raw=raw))
    for route in ROUTES:
        counts.gets[route] = [0.001]
    counts.gets["runs"], counts.posts["plain"] = [get], [post]
    counts.acknowledged["c"] = [Acknowledged(post=run_named(str(number)), sha256="") for number in range(runs)]
    counts.alone, counts.together = [100, 100, memory], [100, 100, 100]
    counts.worked = dict.fromkeys(("service", "generator", "refreshes", "others"), 0.0)
    return counts


def test_each_demand_can_fail_by_itself() -> None:
    def unmet(loaded: Counts) -> list[str]:
        assert "**no**" in markdown(loaded) or all(each.met for each in demands(loaded))
        return [each.name.split()[0] for each in demands(loaded) if not each.met]

    assert unmet(found()) == []
    assert unmet(found(get=0.06)) == ["GET"]
    assert unmet(found(post=0.6)) == ["POST"]
    assert unmet(found(runs=10)) == ["at"]
    assert unmet(found(runs=10, raw=True)) == []
    assert unmet(found(memory=120)) == ["memory"]
    refused = found()
    refused.problems["GET runs: 503 busy"] = 1
    assert unmet(refused) == ["no"]


@pytest.mark.slow
def test_a_small_load_has_no_error_and_loses_nothing(tmp_path: Path) -> None:
    # the first test of the first life of this seed is a raw file
    options = Options(seconds=4.0, rigs=3, clients=3, seed=4, raw=True, tests=6, samples=2_000, states=2, loaded=True)
    loaded = run(options, tmp_path)
    assert not loaded.problems
    assert list(loaded.losses) == []
    assert loaded.kinds["raw file"] > 0
    assert all(loaded.gets[route] for route in ROUTES)
    assert loaded.refreshes
    assert min(loaded.alone) > 0
