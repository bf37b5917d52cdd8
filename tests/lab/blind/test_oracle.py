"""The oracle: a change imitates itself, a rival leaves a part of it; only what fell short is asked about."""

from dataclasses import replace

from tests.lab.blind import oracle
from tests.lab.blind.rig.loudness import listen
from tests.lab.blind.trials import Trial, nothing


def test_only_what_fell_short_is_asked_about() -> None:
    trial = Trial("loud/80/running_in", (1,), ("running_in",), 80.0)
    right = replace(nothing(trial, "cause_named", ""), causes=frozenset({"running_in"}))
    wrong = replace(right, causes=frozenset({"oil_change"}))
    quiet = replace(trial, lam=20.0)
    left = replace(trial, without=frozenset({"running_in"}))
    assert not oracle.falls_short(right)
    assert oracle.falls_short(wrong)
    assert oracle.falls_short(replace(right, verdict="cause_ambiguous"))
    assert not oracle.falls_short(replace(right, trial=quiet, verdict="cause_ambiguous"))
    assert oracle.falls_short(replace(wrong, trial=left))
    assert not oracle.falls_short(replace(wrong, trial=left, verdict="unexplained_structure"))


def test_a_change_imitates_itself_and_its_nearest_cousin_imitates_the_greater_part() -> None:
    """The exponent at λ = 80: drag leaves 9 nats of it, the baseline alone 80."""
    trial = Trial("law/viscous_exponent", (1, 2, 3), ("viscous_exponent",), 80.0)
    hidden = trial.hidden()
    ((effect, amplitude),) = hidden.effects
    ear = listen(hidden.plan, hidden.clutch, hidden.sensor)
    wanted = ear.changed(effect, amplitude)
    assert wanted is not None
    assert oracle._refitted(ear, effect, 0.7 * amplitude, wanted) < 0.5
    seen = oracle.look(nothing(trial, "cause_named", ""))
    assert seen.rival in {"hydrodynamic_drag", "interface_heating"}
    assert 3.0 < seen.left < 20.0
