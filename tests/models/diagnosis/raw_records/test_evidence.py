"""Evidence out of raw records: found where it is, named for what it is, and silent where there is only noise."""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.special import i0e

from models.arrays import FloatArray
from models.diagnosis.campaign import Campaign, DynamicRun, StationaryRun
from models.diagnosis.effects.fitted_effect import AmplitudeEstimate
from models.diagnosis.raw_records import whitened_torque
from models.diagnosis.raw_records.evidence import raw_evidence
from models.diagnosis.raw_records.settling_transient import settling_evidence
from models.diagnosis.raw_records.swing import amplitude, rice
from models.diagnosis.raw_records.whitened_torque import WhitenedRecord, whitened_record
from models.records.plateaus import cut_plateaus
from models.records.runs import Plateaus, Record
from tests.support import one_quick

# --- Campaigns of raw records with lines hidden in them, made without the product's own simulated rig.

RPM = 2 * np.pi / 60
RADIUS = 0.058
RATE = 200.0
LEVELS = (4.0e5, 6.0e5)


def friction(speed: FloatArray, pressure: FloatArray) -> FloatArray:
    velocity = np.maximum(np.abs(speed) * RADIUS, 1e-9)
    return pressure / 25e3 * (1 - 0.4 * np.exp(-1.5 / velocity)) + 2 * velocity**0.3


def noise(rng: np.random.Generator, size: int, memory: float = 0.8, deviation: float = 0.2) -> FloatArray:
    innovations = rng.standard_normal(size)
    return np.asarray(deviation * lfilter([np.sqrt(1 - memory**2)], [1, -memory], innovations), dtype=np.float64)


def stepped(rng: np.random.Generator, *, settling: float = 0.1, memory: float = 0.8) -> Record:
    """Twenty speeds at two pressures, five seconds each, torque settling exponentially."""
    dwell = int(5 * RATE)
    speed = np.repeat(np.tile(np.arange(20.0, 1971.0, 100.0) * RPM, len(LEVELS)), dwell)
    pressure = np.repeat(LEVELS, 20 * dwell)
    keep = np.exp(-1 / RATE / settling)
    steady = friction(speed, pressure)
    torque = lfilter([1 - keep], [1, -keep], steady, zi=[keep * steady[0]])[0]
    time = np.arange(speed.size) / RATE
    return Record(time=time, pressure=pressure, speed=speed, torque=torque + noise(rng, time.size, memory))


def reversing(
    rng: np.random.Generator, *, frequency: float = 0.1, rate: float = 100.0, deviation: float = 0.05
) -> Record:
    """A speed that swings about rest at three pressures, 40 s each; friction turns with it, within 5 cm/s of rest; white
    noise."""
    size = int(40 * rate)
    speed = np.tile(1000 * RPM * np.sin(2 * np.pi * frequency * np.arange(size) / rate), 3)
    pressure = np.repeat(np.linspace(4e5, 7e5, 3), size)
    torque = np.tanh(speed * RADIUS / 0.05) * friction(speed, pressure) + deviation * rng.standard_normal(speed.size)
    return Record(time=np.arange(speed.size) / rate, pressure=pressure, speed=speed, torque=torque)


def loops(
    rng: np.random.Generator,
    *,
    rate: float = 100.0,
    memory: float = 0.4,
    deviation: float = 0.15,
    count: float = 0.01,
    pointed: bool = False,
    levels: Sequence[float] = tuple(np.linspace(4e5, 7e5, 7)),
    pause: float = 3.0,
) -> Record:
    """A dynamic test of 0.1 Hz, 15 s at each pressure and a pause between; speed swings as a sine or is pointed."""
    size = int(15 * rate)
    swing = np.cos(2 * np.pi * 0.1 * np.arange(size) / rate)
    speed = np.tile((1000 - 1000 * (2 / np.pi * np.arcsin(swing) if pointed else swing)) * RPM, len(levels))
    pressure = np.repeat(levels, size)
    time = np.arange(speed.size) / rate + pause * (np.arange(speed.size) // size)
    torque = friction(speed, pressure) + noise(rng, time.size, memory, deviation)
    return Record(time=time, pressure=pressure, speed=speed, torque=np.round(torque / count) * count)


def swinging(rng: np.random.Generator, memory: float = 0.8) -> Record:
    return loops(rng, rate=RATE, memory=memory, deviation=0.2, count=1e-9, levels=LEVELS, pause=0.0)


def with_bursts(record: Record, rng: np.random.Generator, amplitude: float, hertz: float, below: float) -> Record:
    """A skewed wave at speeds below `below` rad/s, its phase anew in every passage."""
    slow = (record.speed < below).astype(int)
    passage = np.cumsum(np.diff(slow, prepend=0) > 0)
    phase = 2 * np.pi * (hertz * record.time + rng.random(passage.max() + 1)[passage])
    return _added(record, amplitude * slow * np.sin(phase + 0.4 * np.sin(phase)))


def with_wandering_ripple(record: Record, rng: np.random.Generator, amplitude: float, order: float) -> Record:
    """A ripple whose phase is anew in every loop and wanders by about a radian in one, its size with the torque."""
    step = float(np.median(np.diff(record.time)))
    loop = np.cumsum(np.diff(record.time, prepend=record.time[0]) > 1.0)
    wander = np.cumsum(rng.standard_normal(record.time.size)) * np.sqrt(step / 15)
    turn = order * np.cumsum(record.speed) * step + wander + 2 * np.pi * rng.random(loop.max() + 1)[loop]
    return _added(record, amplitude * record.torque / record.torque.mean() * np.sin(turn))


def ragged(record: Record, rng: np.random.Generator, jitter: float, lost: float) -> Record:
    """Samples a share of the interval off their time, and a share of them lost."""
    step = float(np.median(np.diff(record.time)))
    kept = rng.random(record.time.size) >= lost
    time = record.time + jitter * step * rng.standard_normal(record.time.size)
    return replace(record, time=time).take(kept)


def with_ripple(record: Record, amplitude: float, order: float, rate: float = RATE) -> Record:
    angle = np.cumsum(record.speed) / rate
    return _added(record, amplitude * np.sin(order * angle + 1.0))


def with_line(record: Record, amplitude: float, hertz: float, below: float = np.inf) -> Record:
    """A line of one frequency at sliding velocities below `below` m/s."""
    return _added(record, amplitude * np.sin(2 * np.pi * hertz * record.time) * (np.abs(record.speed) * RADIUS < below))


def _added(record: Record, torque: FloatArray) -> Record:
    return replace(record, torque=record.torque + torque)


def campaign(stationary: list[Record], dynamic: list[Record]) -> Campaign:
    """States a thousand cycles apart; plateaus are not looked at here."""
    one = Plateaus(pressure=np.full(1, 5e5), speed=np.ones(1), torque=np.ones(1))
    steady = [StationaryRun(run_id=f"s{i}", cycles=1e3 * i, plateaus=one, record=r) for i, r in enumerate(stationary)]
    moving = [DynamicRun(run_id=f"d{i}", cycles=1e3 * i, record=r) for i, r in enumerate(dynamic)]
    return Campaign(stationary=tuple(steady), dynamic=tuple(moving))


# --- What is found in them.


def found(of: Campaign) -> dict[str, tuple[float, float]]:
    return {each.effect: (each.estimate.value, each.estimate.sd) for each in raw_evidence(of)}


@pytest.mark.parametrize("memory", one_quick([0.8, 0.0, 0.95]))
def test_autocorrelated_noise_is_no_evidence(memory: float) -> None:
    print("seeds 0 to 3")
    rngs = [np.random.default_rng(seed) for seed in range(4)]
    assert [found(campaign([stepped(rng, memory=memory)], [swinging(rng, memory)])) for rng in rngs] == [{}] * 4


def test_ripple_is_found_at_its_order_with_its_amplitude() -> None:
    rng = np.random.default_rng(1)
    evidence = raw_evidence(campaign([with_ripple(stepped(rng), 0.03, 2.0) for _ in range(2)], []))
    assert [each.effect for each in evidence] == ["shaft_ripple"]
    assert "twice a revolution" in evidence[0].note
    assert evidence[0].estimate.value == pytest.approx(0.03, rel=0.25)


def ripple_and_line(rng: np.random.Generator) -> Record:
    return with_line(with_ripple(stepped(rng), 0.05, 2.0), 0.2, 17.0, below=2.0)


def ragged_loops(rng: np.random.Generator) -> Record:
    return ragged(with_wandering_ripple(loops(rng), rng, 0.05, 1.0), rng, 0.1, 0.02)


@pytest.mark.parametrize(
    ("seed", "made", "steady", "moving", "effects"),
    [
        (2, lambda rng: with_ripple(swinging(rng), 0.05, 1.0), 0, 3, {"shaft_ripple"}),
        (4, lambda rng: with_line(stepped(rng), 0.05, 30.0), 2, 0, {"fixed_line"}),
        (5, ripple_and_line, 2, 0, {"shaft_ripple", "stick_slip"}),
        (10, ragged_loops, 0, 6, {"shaft_ripple"}),
    ],
    ids=["dynamic tests alone", "a line at every speed", "both at once", "lost samples and a clock that jitters"],
)
def test_what_swings_is_named_for_what_it_is(seed, made, steady, moving, effects) -> None:
    rng = np.random.default_rng(seed)
    given = campaign([made(rng) for _ in range(steady)], [made(rng) for _ in range(moving)])
    assert found(given).keys() == effects


@pytest.mark.parametrize("record", [stepped, swinging])
def test_stick_slip_is_a_line_at_low_speed_only(record: Callable[[np.random.Generator], Record]) -> None:
    rng = np.random.default_rng(3)
    records = [with_line(record(rng), 0.15, 17.0, below=2.0) for _ in range(3)]
    evidence = raw_evidence(campaign(*((records, []) if record is stepped else ([], records))))
    assert [each.effect for each in evidence] == ["stick_slip"]
    assert "17" in evidence[0].note


def test_what_no_loop_shows_all_loops_show_together() -> None:
    """Swings of a fifth of the noise's deviation, whose phase no loop knows of another; half of the loops show nothing."""
    rng = np.random.default_rng(8)
    ripple = [with_wandering_ripple(loops(rng), rng, 0.03, 1.0) for _ in range(6)]
    bursts = [with_bursts(loops(rng), rng, 0.08, 12.0, 200 * RPM) for _ in range(6)]
    wrong = [with_wandering_ripple(loops(rng), rng, 0.03, 1.37) for _ in range(6)]
    assert found(campaign([], ripple)).keys() == {"shaft_ripple"}
    assert found(campaign([], ripple[:1])).get("shaft_ripple", (0.0, 0.0))[0] < 0.1
    evidence = raw_evidence(campaign([], bursts))
    assert [each.effect for each in evidence] == ["stick_slip"]
    assert float(evidence[0].note.split(" Hz")[0].split()[-1]) == pytest.approx(12.0, abs=0.3)
    assert found(campaign([], wrong)) == {}


@pytest.mark.parametrize("rate", one_quick([25.0, 100.0, 500.0]))
def test_loops_of_noise_are_no_evidence(rate: float) -> None:
    print("seed 9")
    rng = np.random.default_rng(9)
    for memory, deviation, count, pointed in [
        (0.0, 0.15, 0.01, False),
        (0.95, 0.15, 0.1, False),
        (0.7, 0.02, 0.001, True),
        (0.4, 0.02, 0.5, False),
    ]:
        records = [
            ragged(
                loops(rng, rate=rate, memory=memory, deviation=deviation, count=count, pointed=pointed), rng, 0.02, 0.01
            )
            for _ in range(3)
        ]
        assert found(campaign([], records)) == {}


@pytest.mark.parametrize(("frequency", "rate"), one_quick([(0.05, 50.0), (0.1, 100.0), (0.1, 200.0)]))
def test_torque_that_turns_with_the_clutch_is_no_ripple(frequency, rate, monkeypatch):
    """It jumps at the same angle of the shaft in every swing: taken as they are, records that reverse show a ripple of
    half a newton metre and more."""
    rng = np.random.default_rng(1)
    given = campaign([], [reversing(rng, frequency=frequency, rate=rate) for _ in range(4)])
    assert found(given) == {}
    monkeypatch.setattr(whitened_torque, "REVERSES", 2.0)
    assert "shaft_ripple" in found(given)


@pytest.mark.parametrize("order", [1.0, 2.0])
def test_ripple_is_found_between_slow_reversals(order: float) -> None:
    rng = np.random.default_rng(11)
    records = [reversing(rng, frequency=0.05, deviation=0.2) for _ in range(4)]
    given = campaign([], [with_ripple(record, 0.05, order, 100.0) for record in records])
    (evidence,) = raw_evidence(given)
    assert evidence.effect == "shaft_ripple"
    assert f"{ {1.0: 'once', 2.0: 'twice'}[order] } a revolution" in evidence.note
    assert evidence.estimate.value == pytest.approx(0.05, rel=0.25)


def test_dwells_that_end_before_torque_settles_along_the_step_are_evidence() -> None:
    slow = found(campaign([stepped(np.random.default_rng(6), settling=2.0)], []))
    assert slow.keys() == {"unsettled_dwell"}
    time_constant, deviation = slow["unsettled_dwell"]
    assert abs(time_constant - 2.0) < 2.0 * deviation < 2.0
    assert found(campaign([stepped(np.random.default_rng(6), settling=0.3)], [])) == {}
    # Torque that wanders into each dwell, from above or from below whatever the step.
    rng = np.random.default_rng(12)
    calm = stepped(rng)
    dwells = 40
    time = calm.time % 5.0
    side = 2.0 * rng.choice([-1, 1], dwells) * rng.uniform(0.5, 1.5, dwells)
    wander = np.repeat(side, calm.time.size // dwells) * np.exp(-time / 1.5)
    wandering = replace(calm, torque=calm.torque + wander)
    late = cut_plateaus(wandering)
    assert np.count_nonzero(late.time_constant > 1.0) > 0.5 * dwells
    assert found(campaign([wandering], [])) == {}


def test_records_that_hold_nothing_say_nothing() -> None:
    rng = np.random.default_rng(7)
    short = swinging(rng)
    cut, still = short.take(np.arange(20)), replace(short, speed=0 * short.speed, torque=0 * short.torque)
    assert raw_evidence(campaign([cut, still], [cut, still])) == ()
    assert raw_evidence(Campaign()) == ()


@pytest.mark.parametrize("where", ["evidence.cut_plateaus", "whitened_torque.clean"])
def test_a_fault_of_the_code_is_no_record_that_holds_nothing(where: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object) -> None:
        raise ValueError("shapes (3,) and (4,) do not match")

    monkeypatch.setattr(f"models.diagnosis.raw_records.{where}", broken)
    with pytest.raises(ValueError, match="do not match"):
        raw_evidence(campaign([stepped(np.random.default_rng(0))], [swinging(np.random.default_rng(1), 0.0)]))


# --- The matched filter: noise comes out even whatever its memory, and a swing as loud as it is.


def demodulated(of: WhitenedRecord, hertz: float) -> tuple[np.ndarray, np.ndarray]:
    """u and N of a line in windows of two seconds, by plain sums."""
    power, weight = [], []
    for first in range(0, of.time.size - 200, 200):
        rows = slice(first, first + 200)
        weight.append(of.weight[rows].sum() * float(of.response(np.array(hertz))))
        power.append(abs(of.matched[rows] @ np.exp(-2j * np.pi * hertz * of.time[rows])) ** 2 / weight[-1])
    return np.array(power), np.array(weight)


@pytest.mark.parametrize("memory", [0.0, 0.7, 0.95])
def test_power_of_noise_is_exponential_of_mean_one(memory: float) -> None:
    rng = np.random.default_rng(11)
    power = []
    for _ in range(6):
        record = whitened_record(loops(rng, memory=memory))
        power += [demodulated(record, hertz)[0] for hertz in (8.0, 17.0, 31.0)]
    u = np.concatenate(power)
    assert u.mean() == pytest.approx(1.0, abs=4 / np.sqrt(u.size))
    assert np.mean(u > 2.0) == pytest.approx(np.exp(-2.0), abs=4 * np.sqrt(np.exp(-2.0) / u.size))


def test_a_line_comes_out_with_its_amplitude_of_records_fast_enough() -> None:
    rng = np.random.default_rng(12)
    record = loops(rng)
    here = whitened_record(with_line(record, 0.1, 17.0))
    assert amplitude(*demodulated(here, 17.0)) == pytest.approx(0.1, rel=0.1)
    assert amplitude(*demodulated(here, 31.0)) < 0.03
    # records that are too slow or still have none
    record = loops(np.random.default_rng(13))
    assert whitened_record(record.take(np.arange(0, record.time.size, 20))) is None
    assert whitened_record(replace(record, torque=0 * record.torque)) is None
    assert whitened_record(with_ripple(record, 0.1, 1.0)) is not None


def test_the_table_of_the_bessel_function() -> None:
    power, lam = np.meshgrid(np.geomspace(1e-3, 1e4, 200), np.geomspace(1e-3, 1e4, 200))
    root = 2 * np.sqrt(power * lam)
    np.testing.assert_allclose(rice(power, lam), np.log(i0e(root)) + root - lam, atol=3e-3, rtol=1e-9)


def test_what_reverses_is_cut_where_it_does_and_settles_before_it_counts() -> None:
    """Three pressures of two swings of 20 s: four ways of 10 s each, all but the first without their first second
    at least."""
    found = whitened_record(reversing(np.random.default_rng(14), frequency=0.05))
    pieces = [slice(*ends) for ends in itertools.pairwise(found.starts)]
    assert len(pieces) == 3 * 4
    for number, piece in enumerate(pieces):
        way = found.speed[piece]
        assert np.abs(np.sign(way[1:]) - (-1) ** number).max() == 0.0
        assert 790 < way.size <= (1001 if number % 4 == 0 else 901)


@pytest.mark.parametrize("encoder", [0.0, 1.0, 3.0])
def test_an_encoders_noise_is_no_swing_of_the_speed(encoder: float) -> None:
    """Dwells from 20 rpm on, a line of 9 Hz: it is seen however the encoder scatters [rpm]."""
    rng = np.random.default_rng(3)
    record = with_line(stepped(rng), 0.1, 9.0)
    record = replace(record, speed=record.speed + encoder * RPM * rng.standard_normal(record.time.size))
    spans = np.stack([np.arange(0.0, 200.0, 5.0) + 1.0, np.arange(5.0, 205.0, 5.0)], axis=1)
    here = whitened_record(record, spans)
    assert amplitude(*demodulated(here, 9.0)) == pytest.approx(0.1, rel=0.15)


# --- Dwells that still settle are distinguished from friction's own lag, from drift and from autocorrelated noise.

SEED = 11
STEP, DWELL, COUNT = 0.02, 5.0, 40


def record(*, share: float = 0.0, late: float = 2.0, lag: float = 0.15, drift: float = 0.0, seed: int = SEED) -> Record:
    """Dwells of a shuffled sweep: torque follows steps within `lag` s, and a `share` of each step within `late` s."""
    rng = np.random.default_rng(seed)
    each = round(DWELL / STEP)
    speed = np.repeat(rng.permutation(np.linspace(10.0, 200.0, COUNT)), each)
    level = 15.0 - 3.0 * (1 - np.exp(-speed / 60.0)) + 0.01 * speed
    time = STEP * np.arange(speed.size)

    def followed(seconds: float) -> np.ndarray:
        keep = np.exp(-STEP / seconds)
        return np.asarray(lfilter([1 - keep], [1, -keep], level, zi=[keep * level[0]])[0])

    torque = (1 - share) * followed(lag) + share * followed(late) + drift * (time % DWELL)
    noise = lfilter([1.0], [1.0, -0.5], rng.standard_normal(speed.size)) * np.sqrt(1 - 0.25)
    return Record(time=time, pressure=np.full(speed.size, 5e5), speed=speed, torque=torque + 0.1 * noise)


def evidence_of(**wanted: float) -> tuple[float, AmplitudeEstimate]:
    made = record(**wanted)
    return settling_evidence([(made, cut_plateaus(made))])


def test_a_transient_is_seen_and_its_time_is_estimated() -> None:
    evidence, constant = evidence_of(share=0.3)
    assert evidence > 15.0
    assert abs(constant.value - 2.0) < 2.0 * constant.sd < 3.0
    # one dwell says nothing
    assert settling_evidence([])[0] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("wanted", [{}, {"lag": 0.08}, {"lag": 0.3}, {"drift": 0.02}], ids=str)
def test_lag_drift_and_noise_are_no_transient(wanted: dict[str, float]) -> None:
    assert max(evidence_of(**wanted, seed=seed)[0] for seed in range(4)) < 3.0
