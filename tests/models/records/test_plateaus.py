"""Raw records cut into plateaus: against the protocol and the truth that the records were made of."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import cont2discrete, lfilter

from models.arrays import FloatArray
from models.friction.identification import fit_curves, mean_torques
from models.records.cleaning import UnusableRecordError, missing_samples
from models.records.plateaus import PlateauCut, cut_plateaus
from models.records.runs import Plateaus, Record, curves_by_pressure
from tests.models.records.raw_records import (
    GEOMETRY,
    RPM,
    SPEEDS,
    Made,
    Sensors,
    harmed,
    jitter,
    lose,
    make,
    protocol,
    spike,
    true_torque,
)

TENTH = SPEEDS[::4]


def of(cut: PlateauCut, made: Made) -> np.ndarray:
    """Which dwell each plateau was cut from."""
    return np.searchsorted(made.start, 0.5 * (cut.start + cut.stop)) - 1


def off(cut: PlateauCut, made: Made) -> np.ndarray:
    """By how many of its deviations each mean misses the truth."""
    return (cut.plateaus.torque - made.torque[of(cut, made)]) / cut.plateaus.torque_sd


def codes(cut: PlateauCut) -> set[str]:
    return {code for code, _ in cut.notes}


def assert_cuts(made: Made, record: Record | None = None, dwells: np.ndarray | None = None) -> PlateauCut:
    """Every dwell is found once, on its level, with its torque: 5 deviations in 300 plateaus is 2e-4 by chance."""
    cut = cut_plateaus(made.record if record is None else record)
    wanted = np.arange(made.start.size) if dwells is None else dwells
    np.testing.assert_array_equal(of(cut, made), wanted)
    np.testing.assert_allclose(cut.plateaus.pressure, made.pressure[wanted], atol=2000.0)
    np.testing.assert_allclose(cut.plateaus.speed, made.speed[wanted], atol=3 * RPM)
    assert (np.abs(off(cut, made)) < 5).all()
    assert (cut.start > made.start[wanted]).all()
    assert (cut.stop <= made.stop[wanted] + 0.011).all()
    return cut


@pytest.fixture(scope="module")
def reference() -> Made:
    return make(*protocol(speeds=TENTH), np.random.default_rng(7), tau=0.1, idle=8.0)


def test_the_reference_protocol_is_found(reference):
    cut = assert_cuts(reference)
    assert cut.settled.all()
    assert codes(cut) == {"no_pressure", "transient_discarded"}
    np.testing.assert_allclose(cut.noise, 0.25, rtol=0.1)
    np.testing.assert_allclose(cut.count, 1000 * (cut.stop - cut.start) + 1, atol=1.5)
    np.testing.assert_allclose(cut.plateaus.oil_temperature, 358.15, atol=0.35)


@pytest.mark.parametrize(
    "how",
    [
        *({"rate": rate, "sensors": Sensors(memory=m)} for rate in (10.0, 100.0, 1000.0, 2000.0) for m in (0.0, 0.6)),
        *({"dwell": dwell, "ramp": ramp} for dwell in (1.0, 2.0, 20.0) for ramp in (0.02, 0.5)),
        *(
            {"sensors": Sensors(torque=noise, torque_count=count, speed_count=2 * RPM, pressure=0.0)}
            for noise, count in ((0.0, 0.05), (0.01, 0.05), (0.05, 0.05), (0.0, 0.0))
        ),
    ],
    ids=str,
)
def test_every_rate_dwell_ramp_and_count(how):
    rng = np.random.default_rng(3)
    speeds = TENTH[:5] if "dwell" in how else TENTH
    assert_cuts(make(*protocol(rng, speeds), rng, **how))


def test_a_protocol_in_any_order_and_direction() -> None:
    rng = np.random.default_rng(6)
    pressure, speed = protocol(speeds=TENTH)
    order = rng.permutation(pressure.size)
    assert_cuts(make(pressure[order], speed[order], rng))
    # both directions of rotation
    rng = np.random.default_rng(9)
    speed = np.concatenate([-TENTH[::-1], TENTH])
    cut = assert_cuts(make(np.full(speed.size, 5e5), speed, rng))
    assert (np.sign(cut.plateaus.torque) == np.sign(speed)).all()


def test_a_missing_and_a_repeated_step():
    rng = np.random.default_rng(8)
    speed = SPEEDS[[0, 1, 2, 4, 5, 6, 6, 7, 5, 8]]
    made = make(np.full(10, 5e5), speed, rng)
    cut = cut_plateaus(made.record)
    assert cut.count.size == 9, "the repeated step is one dwell of twice the length"
    assert cut.count[5] > 1.8 * cut.count[4]
    np.testing.assert_allclose(cut.plateaus.speed, np.delete(speed, 6), atol=RPM)


def test_an_open_clutch_is_cut_by_its_speed():
    made = make(np.full(TENTH.size, 5e5), TENTH, np.random.default_rng(9), idle=8.0)
    for offset, noise in ((500.0, 0.0), (500.0, 1000.0), (0.0, 3000.0), (-4000.0, 3000.0), (-6000.0, 0.0)):
        pressure = offset + noise * np.random.default_rng(10).standard_normal(made.record.time.size)
        cut = cut_plateaus(replace(made.record, pressure=pressure))
        assert of(cut, made).tolist() == list(range(TENTH.size))
        assert (np.abs(off(cut, made)) < 5).all()


@pytest.mark.parametrize("gap", [False, True])
def test_lost_samples(reference, gap):
    record = lose(reference.record, 0.01, np.random.default_rng(10), gap=gap)
    cut = cut_plateaus(record)
    assert cut.count.size >= reference.start.size - 2
    assert np.unique(of(cut, reference)).size >= reference.start.size - 2
    assert (np.abs(off(cut, reference)) < 5).all()
    assert dict(cut.notes)["samples_missing"].startswith(f"About {reference.record.time.size - record.time.size} ")


def test_rows_that_were_stored_on_change_are_refused_with_the_way_to_give_them():
    """A dead band of 20 rpm, and a row every two seconds in any case."""
    rng = np.random.default_rng(13)
    record = make(*protocol(rng, TENTH), rng, rate=50.0, ramp=0.5).record
    kept, last = [0], 0
    for row in range(1, record.time.size):
        moved = abs(record.speed[row] - record.speed[last]) > 20 * RPM
        if moved or record.time[row] - record.time[last] > 2:
            kept.append(row)
            last = row
    with pytest.raises(UnusableRecordError, match="only when a value has changed"):
        cut_plateaus(record.take(np.array(kept)))


def test_a_recorder_that_is_started_for_each_dwell_is_read(reference):
    record = reference.record
    within = [
        (record.time > start + 1) & (record.time < stop)
        for start, stop in zip(reference.start, reference.stop, strict=True)
    ]
    cut = cut_plateaus(record.take(np.logical_or.reduce(within)))
    assert np.unique(of(cut, reference)).size >= reference.start.size - 2


@pytest.mark.parametrize(("step", "said"), [(0.0, []), (1.0, ["100 samples"]), (3600.0, ["360000 samples"])])
@pytest.mark.parametrize("unit", [1e-6, 0.01])
def test_a_clock_that_is_set_forwards_is_noted_whatever_its_resolution(step, said, unit):
    times = np.round(0.01 * np.arange(3000) * (1.23 if unit > 1e-3 else 1.0) / unit) * unit
    times[1500:] += step
    notes = missing_samples(times)
    assert [code for code, _ in notes] == ["samples_missing"] * len(said)
    if said and unit < 1e-3:
        assert f"About {said[0]}" in notes[0][1]
        assert "A clock that was set forwards there looks the same" in notes[0][1]


def test_a_clock_that_jitters_and_a_gap_that_parts_a_dwell(reference) -> None:
    cut = assert_cuts(reference, jitter(reference.record, np.random.default_rng(11)))
    assert "clock_jitter" in codes(cut)
    # a gap within a dwell parts it
    keep = (reference.record.time < reference.start[3] + 2) | (reference.record.time > reference.start[3] + 3)
    cut = cut_plateaus(reference.record.take(keep))
    assert np.count_nonzero(of(cut, reference) == 3) == 2


@pytest.mark.parametrize("rate", [10.0, 100.0, 1000.0, 2000.0])
def test_spikes(rate):
    rng = np.random.default_rng(12)
    made = make(*protocol(rng, TENTH), rng, rate=rate)
    cut = assert_cuts(made, spike(made.record, rng, every=10.0, longest=3))
    assert "spikes_removed" in codes(cut)
    np.testing.assert_allclose(cut.noise, 0.25, rtol=0.5)


def test_a_transient_of_half_a_second_is_found():
    rng = np.random.default_rng(14)
    cut = assert_cuts(make(*protocol(rng, TENTH), rng, tau=0.5))
    np.testing.assert_allclose(cut.time_constant, 0.5, rtol=0.2)
    assert cut.settled.all()


@pytest.mark.parametrize(("tau", "dwell"), [(2.0, 5.0), (1.0, 1.5), (0.3, 0.7)])
def test_a_dwell_too_short_to_settle_is_flagged(tau, dwell):
    rng = np.random.default_rng(15)
    pressure, speed = np.tile([4e5, 7e5, 5e5, 6.5e5], 6), np.repeat(TENTH[:6], 4)
    cut = cut_plateaus(make(pressure, speed, rng, tau=tau, dwell=dwell).record)
    assert cut.count.size == 24
    assert not cut.settled[1:].any()
    assert "unsettled" in codes(cut)
    assert cut_plateaus(make(pressure, speed, rng, tau=dwell / 15, dwell=dwell).record).settled.all()


def test_a_single_dwell_that_settles_and_one_that_does_not():
    rng = np.random.default_rng(16)
    t = np.arange(0, 5, 0.001)
    for tau, settled in ((0.3, True), (3.0, False)):
        torque = 20 + np.exp(-t / tau) + 0.2 * rng.standard_normal(t.size)
        cut = cut_plateaus(Record(time=t, pressure=np.full(5000, 5e5), speed=np.full(5000, 90.0), torque=torque))
        assert cut.settled.tolist() == [settled]
        assert cut.plateaus.oil_temperature is None
    assert abs(cut.plateaus.torque[0] - 20) < 3 * cut.plateaus.torque_sd[0], "what is left counts as a deviation"


@pytest.mark.parametrize(("memory", "flagged"), [(0.8, True), (0.95, True), (0.5, False), (0.0, False)])
def test_noise_autocorrelated_for_too_long_is_flagged(memory, flagged):
    """At 10 Hz a dwell holds 50 samples: a memory of 0.8 leaves five independent ones."""
    rng = np.random.default_rng(18)
    made = make(*protocol(rng, SPEEDS[::2]), rng, rate=10.0, tau=0.1, sensors=Sensors(memory=memory))
    assert ("slow_noise" in codes(cut_plateaus(made.record))) is flagged


def test_drift_is_reported():
    rng = np.random.default_rng(17)
    t = np.arange(0, 60, 0.01)
    torque = 20 + 0.05 * np.sin(t) + 0.003 * t + 0.02 * rng.standard_normal(t.size)
    cut = cut_plateaus(Record(time=t, pressure=np.full(6000, 5e5), speed=np.full(6000, 90.0), torque=torque))
    assert abs(cut.drift[0] - 0.003) < 4 * cut.drift_sd[0] + 5e-4


@pytest.mark.parametrize("harm", ["none", "gap", "all"])
def test_the_fits_are_those_of_the_exact_plateaus(harm: str) -> None:
    """Means over the fitted curves differ by less than five stated deviations, and by 0.1 % of the torque."""
    rng = np.random.default_rng(19)
    made = make(*protocol(rng, SPEEDS[::3]), rng, tau=0.3, dwell=4.0)
    cut = cut_plateaus(harmed(made.record, harm, rng))
    exact = curves_by_pressure(Plateaus(pressure=made.pressure, speed=made.speed, torque=made.torque), GEOMETRY)
    fits = fit_curves(curves_by_pressure(cut.plateaus, GEOMETRY))
    assert [fit.pressure for fit in fits] == [one.pressure for one in exact]
    velocities = GEOMETRY.sliding_velocity(SPEEDS)
    told = mean_torques(fits, velocities)
    truth = mean_torques(fit_curves(exact), velocities)
    assert (np.abs(told[:, 0] - truth[:, 0]) < np.minimum(5 * told[:, 1], 0.02)).all()


def plain(n: int = 5000, **changes) -> Record:
    columns = {"time": 0.001 * np.arange(n), "pressure": np.full(n, 5e5), "speed": np.full(n, 90.0)}
    return replace(Record(**columns, torque=np.full(n, 20.0)), **changes)


@pytest.mark.parametrize("n", [100, 1000, 5000])
def test_a_constant_record_is_one_plateau(n):
    cut = cut_plateaus(plain(n))
    assert cut.plateaus.torque == pytest.approx(20.0, abs=1e-12)
    assert 0 < cut.plateaus.torque_sd[0] < 1e-6
    assert cut.settled.all()
    assert np.isnan(cut.time_constant).all()


@pytest.mark.parametrize(
    ("record", "message"),
    [
        (plain(3), "at least 16 samples, got 3"),
        (plain(20), "must hold plateaus"),
        (plain(time=np.zeros(5000)), "time must advance"),
        (plain(time=-0.001 * np.arange(5000)), "time must advance"),
        (plain(time=np.tile(0.001 * np.arange(2500), 2)), "time must run forwards"),
        (plain(time=1e-9 * np.arange(5000)), "s apart"),
        (plain(torque=np.full(5000, 1e300)), "torque must lie within"),
        (plain(pressure=np.where(np.arange(5000) < 60, 5e5, 0.0)), "without pressure"),
        (plain(pressure=np.zeros(5000), speed=np.zeros(5000)), "at standstill"),
        (plain(speed=np.linspace(0, 200, 5000)), "must hold plateaus"),
    ],
)
def test_a_record_that_cannot_be_cut_is_refused(record, message):
    with pytest.raises(ValueError, match=message):
        cut_plateaus(record)


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    n=st.integers(1, 400),
    scales=st.tuples(*[st.sampled_from([0.0, 1e-12, 1.0, 1e6, 1e14])] * 4),
    counts=st.sampled_from([0, 1]),
)
def test_whatever_comes_is_cut_or_refused(seed, n, scales, counts):
    rng = np.random.default_rng(seed)
    pressure, speed, torque, shift = (s * rng.standard_normal(n).round(counts) for s in scales)
    time = np.cumsum(rng.choice([0.0, 0.001, 0.01, 0.5], size=n)) + np.clip(shift, -0.01, 0.01)
    record = Record(time=time, pressure=pressure + 5e5, speed=speed + 90, torque=torque)
    try:
        cut = cut_plateaus(record)
    except ValueError:
        with pytest.raises(ValueError, match="must"):
            cut_plateaus(record)
    else:
        assert np.isfinite(cut.plateaus.torque_sd).all()
        assert (cut.plateaus.torque_sd > 0).all()


# --- Raw records as controllers make them: speeds that overshoot, friction that follows slowly, steps in any order.

FINE = 1000.0


def overshooting(levels: FloatArray, dwell: float, natural: float, damping: float) -> FloatArray:
    """A speed loop of second order that follows the levels [k], `dwell` s each."""
    told = np.repeat(levels, round(dwell * FINE))
    numerator, denominator, _ = cont2discrete(
        ([natural**2], [1, 2 * damping * natural, natural**2]), 1 / FINE, method="zoh"
    )
    return np.asarray(lfilter(numerator.ravel(), denominator, told - told[0]) + told[0], dtype=np.float64)


def recorded(
    levels: FloatArray, speed: FloatArray, lag: float, noise: float, rate: float, seed: int
) -> tuple[Record, FloatArray]:
    """At 5 bar, torque a lag [s] behind its steady value; the torque [k] that the levels would settle at."""
    pressure = np.full(speed.size, 5e5)
    steady = true_torque(pressure, speed)
    keep = np.exp(-1 / (FINE * lag))
    torque = lfilter([1 - keep], [1, -keep], steady, zi=[keep * steady[0]])[0]
    rng, every = np.random.default_rng(seed), round(FINE / rate)
    time = np.arange(speed.size)[::every] / FINE
    record = Record(
        time=time,
        pressure=pressure[::every] + 500.0 * rng.standard_normal(time.size),
        speed=speed[::every] + RPM * rng.standard_normal(time.size),
        torque=torque[::every] + noise * rng.standard_normal(time.size),
    )
    return record, true_torque(np.full(levels.size, 5e5), levels)


def which(cut: PlateauCut, dwell: float) -> list[int]:
    """The dwell in which each plateau lies."""
    return np.floor(0.5 * (cut.start + cut.stop) / dwell).astype(int).tolist()


@pytest.mark.parametrize("rate", [20.0, 50.0, 100.0])
@pytest.mark.parametrize(("natural", "damping"), [(7.0, 0.6), (4.0, 0.5), (10.0, 0.4)])
def test_the_crest_of_an_overshoot_is_no_plateau(rate: float, natural: float, damping: float) -> None:
    levels = np.concatenate([np.arange(20.0, 1971.0, 140.0), np.arange(1900.0, 19.0, -180.0)]) * RPM
    speed = overshooting(levels, 5.0, natural, damping)
    record, wanted = recorded(levels, speed, 0.2, 0.05, rate, 4)
    cut = cut_plateaus(record)
    assert which(cut, 5.0) == list(range(levels.size))
    assert np.abs(cut.plateaus.torque - wanted).max() < 0.04


@pytest.mark.parametrize("short", [600.0, 800.0, 900.0])
def test_a_short_dwell_that_is_no_crest_stays(short: float) -> None:
    """One second on the way from 200 to 1000 rpm."""
    told = np.concatenate([np.full(5000, 200.0), np.full(1000, short), np.full(5000, 1000.0)]) * RPM
    record, _ = recorded(np.array([200.0]) * RPM, told, 0.02, 0.02, 200.0, 1)
    assert np.round(cut_plateaus(record).plateaus.speed / RPM, -2).tolist() == [200.0, short, 1000.0]


def test_a_dwell_that_lost_samples_is_no_crest() -> None:
    """A second of the dwell, then a gap, then the rest of it."""
    told = np.concatenate([np.full(5000, 200.0), np.full(6000, 1000.0)]) * RPM
    record, _ = recorded(np.array([200.0]) * RPM, told, 0.02, 0.02, 200.0, 1)
    cut = cut_plateaus(record.take((record.time < 6.0) | (record.time > 6.4)))
    assert "overshoot" not in {code for code, _ in cut.notes}
    assert np.round(cut.plateaus.speed / RPM, -2).tolist() == [200.0, 1000.0, 1000.0]


@pytest.mark.slow
@pytest.mark.parametrize("lag", [0.2, 0.4])
@pytest.mark.parametrize("rate", [50.0, 100.0])
def test_hardly_a_share_of_the_plateau_before_is_left_whatever_the_order(lag: float, rate: float) -> None:
    """Steps of some 6 Nm: the transient itself must not make the means look so unsure that much of it may stay."""
    rng = np.random.default_rng(8)
    left, steps = [], []
    for seed in range(10):
        pressure = rng.permutation(np.repeat([4e5, 5e5, 6e5, 7e5], 12))
        speed = rng.permutation(np.tile(np.linspace(20.0, 1970.0, 12), 4)) * RPM
        made = make(pressure, speed, np.random.default_rng(seed), ramp=0.3, tau=lag, rate=rate)
        cut = cut_plateaus(made.record)
        dwell = np.array(which(cut, 5.0))
        assert dwell.size >= 40  # of 48, some of which are on the level of the one before
        later = dwell > 0
        left += (cut.plateaus.torque - made.torque[dwell])[later].tolist()
        steps += (made.torque[dwell - 1] - made.torque[dwell])[later].tolist()
    assert abs(np.dot(left, steps) / np.dot(steps, steps)) < 0.003
