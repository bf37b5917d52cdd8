"""A filter that the rig declares: against the closed form of a low-pass, and loops and plateaus behind one."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from models.loops.lag_fit import StationaryCurve
from models.loops.loops import evaluate_loops
from models.records.plateaus import cut_plateaus
from models.records.runs import Record
from models.records.torque_filter import filtered, filtered_as_torque
from tests.models.loops.dynamic_records import FALLING, GEOMETRY, RISING, Torque, attractor, record, squeezed

#: 20 ms, the torque channel's own low-pass.
FILTER = 0.02


def behind(torque: Torque) -> Torque:
    """A torque behind the filter, by scipy on a clock of 0.1 ms that begins half a second before the record."""

    def at(time: np.ndarray) -> np.ndarray:
        fine = np.arange(-0.5, time.max() + 1e-3, 1e-4)
        sent, kept = torque(fine), np.exp(-1e-4 / FILTER)
        return np.interp(time, fine, lfilter([1 - kept], [1, -kept], sent, zi=[kept * sent[0]])[0])

    return at


def test_a_wave_is_as_behind_the_closed_form_whatever_the_clock() -> None:
    rng = np.random.default_rng(3)
    time = np.sort(rng.uniform(0.0, 4.0, 4000))
    turn = 2 * np.pi * 2.0 * FILTER  # a wave of 2 Hz
    gain = 1 / np.hypot(1.0, turn)
    expected = gain * np.sin(2 * np.pi * 2.0 * time - np.arctan(turn))
    late = filtered(time, np.sin(2 * np.pi * 2.0 * time), FILTER)
    settled = time > time[0] + 10 * FILTER
    np.testing.assert_allclose(late[settled], expected[settled], atol=1e-3)  # chords of steps of 1 to 10 ms
    assert np.abs(np.sin(2 * np.pi * 2.0 * time) - expected)[settled].max() > 0.2  # it would be noticed
    swapped = np.arange(time.size)
    swapped[[100, 101, 2000, 2001]] = swapped[[101, 100, 2001, 2000]]
    np.testing.assert_array_equal(
        filtered(time[swapped], np.sin(2 * np.pi * 2.0 * time[swapped]), FILTER), late[swapped]
    )


@pytest.mark.parametrize(
    ("made", "curve", "frequency", "read"),
    [
        (squeezed(FALLING, 0.15), FALLING, 0.1, lambda loop: loop.film_time),
        (squeezed(FALLING, 0.15, 0.5), FALLING, 0.5, lambda loop: loop.film_time),
        (attractor(FALLING, 150.0), FALLING, 0.1, lambda loop: loop.attractor),
        (attractor(RISING, 150.0), RISING, 0.1, lambda loop: loop.attractor),
    ],
    ids=["film", "film at 0.5 Hz", "attractor", "attractor of a rising curve"],
)
def test_a_loop_behind_a_declared_filter_is_that_of_the_bare_torque(made, curve, frequency, read):
    bare, late = (record([torque], [5e5], frequency=frequency) for torque in (made, behind(made)))
    (plain,), (wrong,), (mended,) = (
        evaluate_loops(one, GEOMETRY, {5e5: StationaryCurve(parameters=curve)})
        for one in (bare, late, filtered_as_torque(late, FILTER))
    )
    # measured: 0.4 % at most and 9 % at least
    assert mended.area == pytest.approx(plain.area, rel=0.01)
    assert read(mended) == pytest.approx(read(plain), rel=0.01)
    assert abs(wrong.area / plain.area - 1) > 0.08
    assert abs(read(wrong) / read(plain) - 1) > 0.08


def spiking(sent: Record, rng: np.random.Generator) -> Record:
    """The record with 24 samples of each channel far off, each one alone."""

    def spiked(channel: np.ndarray, size: float) -> np.ndarray:
        hit = 5 + 10 * rng.choice((channel.size - 10) // 10, size=24, replace=False)
        out = channel.copy()
        out[hit] += rng.choice([-1.0, 1.0], size=24) * size
        return out

    return replace(
        sent, pressure=spiked(sent.pressure, 2e5), speed=spiked(sent.speed, 200.0), torque=spiked(sent.torque, 30.0)
    )


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_spikes_are_removed_before_the_filter_spreads_them(seed: int) -> None:
    """A spike of speed behind the filter is a tail of several samples that no cleaning finds any more."""
    rng = np.random.default_rng(seed)
    sent = record([behind(attractor(FALLING, 150.0))], [5e5], noise=0.001, rng=rng)
    spiked = spiking(sent, rng)
    spread = replace(
        spiked,
        pressure=filtered(spiked.time, spiked.pressure, FILTER),
        speed=filtered(spiked.time, spiked.speed, FILTER),
    )
    (plain,), (cleaned,), (tailed,) = (
        evaluate_loops(one, GEOMETRY, {5e5: StationaryCurve(parameters=FALLING)})
        for one in (filtered_as_torque(sent, FILTER), filtered_as_torque(spiked, FILTER), spread)
    )
    # measured: 0.06 and 0.15 % at most, for 72 of 1500 samples are left out, whose noise counted; and 6 % at least
    assert cleaned.area == pytest.approx(plain.area, rel=0.005)
    assert cleaned.attractor == pytest.approx(plain.attractor, rel=0.005)
    assert abs(tailed.area / plain.area - 1) > 0.02


def test_no_noise_grows_and_without_a_declaration_nothing_changes() -> None:
    rng = np.random.default_rng(5)
    noisy = record([attractor(FALLING, 150.0)], [5e5], rate=1000.0, noise=0.02, rng=rng)
    mended = filtered_as_torque(noisy, FILTER)
    np.testing.assert_array_equal(mended.torque, noisy.torque)
    assert np.diff(mended.speed).std() < 0.2 * np.diff(noisy.speed).std()
    deconvolved = noisy.torque + FILTER * np.gradient(noisy.torque, noisy.time)
    assert np.diff(deconvolved).std() > 8 * np.diff(noisy.torque).std()
    # without a declaration the record is the same object
    swing = record([attractor(FALLING, 150.0)], [5e5])
    assert filtered_as_torque(swing, 0.0) is swing


def test_a_slow_filter_leaves_no_more_than_the_bare_torque_in_plateaus() -> None:
    """Dwells of 4 s at 6 speeds; behind 0.2 s, what is still settling belongs to no dwell."""
    time = np.arange(0.0, 24.0, 0.01)
    speed = 20.0 + 30.0 * np.floor(time / 4.0)
    rng = np.random.default_rng(2)
    torque = 30.0 - 0.1 * speed
    kept = np.exp(-0.01 / 0.2)
    late = lfilter([1 - kept], [1, -kept], torque, zi=[kept * torque[0]])[0] + 0.01 * rng.standard_normal(time.size)
    sent = Record(time=time, pressure=np.full(time.size, 5e5), speed=speed, torque=late)
    cut = cut_plateaus(sent, 0.2)
    assert cut.plateaus.speed.size == 6
    np.testing.assert_allclose(cut.plateaus.torque, 30.0 - 0.1 * cut.plateaus.speed, atol=0.02)
    assert (cut.start[1:] > cut_plateaus(replace(sent, torque=torque), 0.0).start[1:]).all()
