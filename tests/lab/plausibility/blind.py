"""Campaigns of the blind rig, with and without hidden effects, and of real measurements: plausibility never saw them."""

import zlib
from collections.abc import Iterator
from functools import cache

import numpy as np

from tests.lab.blind.rig.hide import hide
from tests.lab.blind.rig.loudness import UnreachableError
from tests.lab.blind.rig.makers import ALL
from tests.lab.blind.rig.more import with_test
from tests.lab.blind.rig.sent import runs
from tests.lab.plausibility.bench import Body, with_gain
from tests.lab.plausibility.simulated import Campaign
from tests.lab.real import loaders
from tests.support import stationary

SLUGS = ("", *ALL)
#: Advised tests that a campaign may end with: other pressures, other temperatures, other ways.
ADVISED = ("light_sweep", "sweep_60c", "sweep_100c", "falling_speeds", "open_sweep", "loops_0.3hz", "more_states")
LOUD = (20.0, 50.0, 200.0)


def campaign(rng: np.random.Generator, slug: str, *, thin: int = 5, advised: bool = False) -> Campaign:
    """A campaign of the blind rig that hides an effect ("": none); records are thinned to every so many samples."""
    states = int(rng.integers(6, 12))
    seed = [int(rng.integers(1 << 31)), zlib.crc32(slug.encode())]
    for attempt in range(5):
        try:
            slugs, loud = ((slug,), float(rng.choice(LOUD))) if slug else ((), 0.0)
            hidden = hide([*seed, attempt], slugs, loud, states=states, rate=100.0)
            break
        except UnreachableError:
            continue
    else:
        hidden = hide(seed, (), 0.0, states=states)
    source = f"blind rig, {'hidden ' + slug if slug else 'nothing hidden'}"
    sent = [_thinned(run, thin) for run in runs(hidden)]
    if advised:
        key = str(rng.choice(ADVISED))
        before = {run["run_id"] for run in sent}
        later = [_thinned(run, thin) for run in runs(with_test(hidden, key))]
        sent += [run for run in later if run["run_id"] not in before]
        source = "blind rig, with an advised test"
    return Campaign(source=source, runs=sent, record={"origin": "simulated"})


def _thinned(run: Body, every: int) -> Body:
    if "time_s" not in run.get("channels", {}):
        return run
    return run | {"channels": {name: values[::every] for name, values in run["channels"].items()}}


def real() -> Iterator[Campaign]:
    """Measured histories as clutches: their friction as it is, or their wear as a clutch's falling COF."""
    if not loaders.FOLDER.is_dir():
        return
    yield Campaign(source="real: traction sweeps", runs=loaders.traction_runs(), record=loaders.TRACTION_CLUTCH)
    for name, histories in (("filters", _filters()), ("lasers", _lasers()), ("cracks", _cracks())):
        for number, history in enumerate(histories):
            sent = [_test(f"{name}-{number}-{k}", cycles, share) for k, (cycles, share) in enumerate(history)]
            yield Campaign(source=f"real: {name}", runs=sent, record={})


@cache
def share_lives() -> dict[str, list[list[tuple[float, float]]]]:
    """Measured lives as cycles and the share of the first COF, by what was measured; none where the folder is not there."""
    if not loaders.FOLDER.is_dir():
        return {}
    found = {"filters": _filters(), "lasers": _lasers(), "cracks": _cracks(), "batteries": _batteries()}
    return {name: list(histories) for name, histories in found.items()}


def _batteries() -> Iterator[list[tuple[float, float]]]:
    """Capacity as what friction is left: a half at the threshold; some fifteen tests along each life."""
    for rows in loaders.cells().values():
        yield [
            (float(row["cycle"]), 1.0 - 0.5 * (1.0 - float(row["relative_capacity"])) / (1.0 - float(row["threshold"])))
            for row in rows[:: max(len(rows) // 15, 1)]
        ]


def _test(run_id: str, cycles: float, share: float) -> Body:
    """A stationary test whose mean COF is that share of when new."""
    return with_gain(stationary(round(cycles), run_id=run_id, wear=0.0, noise=0.01), share)


def _lasers() -> Iterator[list[tuple[float, float]]]:
    for _, (hours, rise) in sorted(loaders.lasers().items(), key=lambda each: str(each[0])):
        yield list(zip(hours.tolist(), (1.0 - rise).tolist(), strict=True))


def _filters() -> Iterator[list[tuple[float, float]]]:
    """As a falling quantity: a half at 600 Pa; twelve tests along each life."""
    data = loaders.columns("filter_lives", "filters_odd.csv")
    for life in np.unique(data["life"])[::3]:
        time, drop = (data[name][data["life"] == life] for name in ("time_s", "differential_pressure_pa"))
        when = np.linspace(0, time[-1], 12)
        fallen = np.interp(when, time, drop)
        share = 1.0 - 0.5 * (fallen - fallen[0]) / (600.0 - fallen[0])
        yield list(zip(when.tolist(), share.tolist(), strict=True))


def _cracks() -> Iterator[list[tuple[float, float]]]:
    """A crack's length as what friction has lost: a half at the longest; time in thousands of cycles."""
    data = loaders.columns("crack_growth", "crack_growth.csv")
    for unit in range(1, 11):
        share = 1.0 - 0.5 * data[f"unit{unit}"] / data[f"unit{unit}"].max()
        yield list(zip((1e4 * data["time"]).tolist(), share.tolist(), strict=True))
