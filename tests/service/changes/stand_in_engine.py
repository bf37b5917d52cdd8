"""A quick engine that stands in for the real one: what it says hangs on the number of tests; others beside it misbehave.

Imported in the diagnosis' own process by name, and in a test's process for what an adopted extension does there.
"""

import os
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from models.diagnosis.campaign import Campaign, StationaryRun
from models.diagnosis.effects.fitted_effect import AmplitudeEstimate
from models.diagnosis.experiments.candidates import Step
from models.diagnosis.experiments.test_plan import Advice
from models.diagnosis.explanations.verdict import Explanation, Verdict, Where
from models.diagnosis.extension import Extension
from models.diagnosis.report.maps import LoopTrace, Maps
from models.diagnosis.report.report import Candidate, Isolability, Misfit, Pair, Report, Visible
from models.diagnosis.validation.held_out import Gain

#: Nm that the stand-in takes off every plateau from a cycle on, and that its course loses by 1,000 cycles.
SHIFT_NM, FROM_CYCLES, COURSE_NM = 1.5, 2000.0, -0.2


def _artefact(self: Extension, run: StationaryRun, campaign: Campaign) -> Any:
    assert all(each.run_id != run.run_id and each.cycles <= run.cycles for each in campaign.stationary)
    return np.full((1, run.plateaus.torque.size), self.content["shift_nm"] if run.cycles >= FROM_CYCLES else 0.0)


def _course(self: Extension, cycles: Any, pressure: Any, velocity: Any) -> Any:
    assert velocity.ndim == 1
    return np.outer(self.content["course_nm"] * (1 - np.exp(-cycles / 1000.0)), np.ones(pressure.size))[None]


def _exponent(self: Extension) -> float | None:
    return self.content.get("severity_exponent")


METHODS = {
    "artefact": _artefact,
    "course": _course,
    "severity_exponent": property(_exponent),
    "weights": property(lambda _: np.ones(1)),
    "has_course": property(lambda _: True),
}


def _report(campaign: Campaign, extension: Extension | None) -> Report:
    where = (Where(axis="oil_temperature_c", strength=30.0),)
    table = np.arange(6.0).reshape(2, 3)
    table[0, 0] = np.nan
    speed = np.linspace(0.0, 200.0, 8)
    causes = extension.effects if extension else ()
    return Report(
        verdict=Verdict.CAUSE_NAMED if extension else Verdict.MODEL_ADEQUATE,
        causes=causes,
        summary=f"A stand-in looked at {len(campaign.stationary)} tests.",
        explanations=(Explanation(effects=causes, probability=1.0),),
        candidates=(
            Candidate(
                effect="torque_zero_shift",
                title="Zero of the torque sensor",
                probability=0.98,
                log_evidence_gain=31.0,
                estimate=AmplitudeEstimate(name="zero shift", value=SHIFT_NM, sd=float("inf"), unit="Nm"),
            ),
        ),
        baseline=Misfit(rmse=0.3, noise=0.25, unexplained_share=0.3, where=where),
        extended=Misfit(rmse=0.25, noise=0.25, unexplained_share=0.0),
        gain=Gain(
            held_out_runs=tuple(run.run_id for run in campaign.stationary[-1:]),
            rmse_before=0.3,
            rmse_after=0.25,
            reduction_percent=16.7,
            reduction_sd=2.0,
            excess_before=0.166,
            excess_after=0.0,
            mse_percent_before=2.0,
            mse_percent_after=1.0,
            log_score_gain=20.0,
            forecast_log_score_gain=3.0,
        ),
        advice=(
            Advice(
                key="zero_reading",
                test="read the unloaded zero",
                effect="torque_zero_shift",
                other="baseline",
                nats=12.0,
                probability=0.9,
                steps=(
                    Step(
                        kind="stationary_stribeck",
                        pressures=(0.0, 4e5),
                        speeds=(10.0, 20.0),
                        temperature=333.15,
                        repeats=5,
                        cycles=3000.0,
                        pause=7200.0,
                        minutes=12.34,
                    ),
                ),
            ),
        ),
        visible=(Visible(effect="torque_zero_shift", amplitude=0.2, least=0.1, usual=0.5, unit="Nm", isolability=0.9),),
        maps=Maps(
            pressure=np.array([4e5, 5e5]),
            speed=np.array([10.0, 20.0, 30.0]),
            cycles=np.array([0.0, 1000.0, 2000.0]),
            speed_pressure_before=table,
            speed_pressure_after=table / 10,
            pressure_cycles_before=table.T,
            pressure_cycles_after=table.T / 10,
        ),
        loops=(
            LoopTrace(
                pressure=5e5,
                cycles=0.0,
                frequency=0.1,
                speed=speed,
                measured=np.sin(speed),
                baseline=np.cos(speed),
                extended=np.sin(speed),
            ),
        ),
        extension=extension,
        notes=("made by a stand-in",),
        statistics={"alarm": float("nan"), "threshold": 11.0},
    )


def diagnose(campaign: Campaign, *, rng: np.random.Generator) -> Report:
    """A cause is named from three tests on."""
    if len(campaign.stationary) < 3:
        return _report(campaign, None)
    shift = {"slug": "torque_zero_shift", "amplitude": SHIFT_NM}
    content = {
        "shift_nm": SHIFT_NM,
        "course_nm": COURSE_NM,
        "drawn": float(rng.standard_normal()),
        "law": None,
        "draws": [{"weight": 1.0, "effects": [shift]}],
    }
    return _report(campaign, Extension(effects=("torque_zero_shift", "running_in"), content=content))


def separating(campaign: Campaign, *, rng: np.random.Generator, isolability: bool) -> Report:
    """The same, and two effects that an open clutch parts, where that is asked for."""
    pair = Pair(
        effects=("hydrodynamic_drag", "torque_zero_shift"),
        probability=0.78,
        apart=False,
        trial="open_sweep",
        test="stationary test with the clutch open",
        with_trial=0.98,
    )
    apart = Isolability(pairs=(pair,), unseen=("channel_delay",)) if isolability else None
    return replace(diagnose(campaign, rng=rng), isolability=apart)


def overflowing(campaign: Campaign, *, rng: np.random.Generator) -> Report:
    """The same, and a number runs over on the way."""
    np.exp(np.array([1e3]))
    return diagnose(campaign, rng=rng)


def slow(campaign: Campaign, *, rng: np.random.Generator) -> Report:
    """The same, after two seconds of work."""
    until = time.monotonic() + 2.0
    while time.monotonic() < until:
        np.linalg.svd(np.ones((50, 50)))
    return diagnose(campaign, rng=rng)


def endless(campaign: Campaign, *, rng: np.random.Generator) -> Report:  # noqa: ARG001
    """Never, and it writes down its process' id."""
    if "STAND_IN_PID" in os.environ:
        path = Path(os.environ["STAND_IN_PID"])
        path.with_suffix(".part").write_text(str(os.getpid()))
        path.with_suffix(".part").rename(path)  # whoever sees it can read it whole
    while True:
        time.sleep(0.1)


def computing(campaign: Campaign, *, rng: np.random.Generator) -> Report:  # noqa: ARG001
    """Never, and it needs a processor all the time."""
    while True:
        pass


def greedy(campaign: Campaign, *, rng: np.random.Generator) -> Report:  # noqa: ARG001
    """More memory than there may be."""
    return _report(campaign, Extension(effects=(), content={"x": np.ones(2**33).sum()}))


def killed(campaign: Campaign, *, rng: np.random.Generator) -> Report:  # noqa: ARG001
    """Dies."""
    os.kill(os.getpid(), signal.SIGKILL)
    raise AssertionError


def raising(campaign: Campaign, *, rng: np.random.Generator) -> Report:  # noqa: ARG001
    """Breaks."""
    raise RuntimeError("it broke")


def apply(setting: Callable[[type, str, Any], None] = setattr) -> None:
    """Have extensions do what the stand-in's do, here until `setting` takes it back."""
    for name, method in METHODS.items():
        setting(Extension, name, method)


_main = sys.modules["__main__"].__spec__
if _main is not None and _main.name == "service.jobs.diagnosis":
    apply()
