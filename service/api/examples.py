"""An example of every field and parameter, by its name: names carry units, so one value serves wherever a name stands.

`Schema.name` is the example of a field of one schema, where the same name means something of another type there; `_at` that
of every name that ends so and has none of its own. A field whose schema has an enumeration or a constant, is a flag, or
consists of fields, has its example from these.
"""

from typing import Any

_QUANTILES = {"0.05": 1800, "0.1": 2300, "0.25": 3300, "0.5": 4900, "0.75": 7400, "0.9": 11200, "0.95": 14600}
_MOMENT, _RUN = "2026-11-02T08:00:00+01:00", "2026-11-02-stationary-7000"
_SHA256 = "9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08"
_DIAGNOSIS, _CURSOR = "3f9a1c0b7d2e4f56", "WzcwMDAuMCwgInM3MDAwIl0"
_SPEEDS, _TORQUES = [20, 120, 520, 1020, 1970], [21.9, 22.8, 22.4, 21.5, 20.8]

#: Values that several names have.
_SHARED: tuple[tuple[Any, str], ...] = (
    (_MOMENT, "_at at time"), ("key:1a2b3c4d bench 3", "_by by"), (_DIAGNOSIS, "_id"),
    (1, "attempts left repeats censored_lives check count failure life out_of_specification total_errors version"),
    (3, "done periods"), (0, "Degradation.held_runs Surfaces.held_runs StribeckPage.held_runs"),
    (0, "LoopPage.held_runs EngagementOut.held_runs"),
    (0, "JobResult.kinds changed skip_rows origin_cycles below"),
    ("order a new set", "AlarmIn.name AlarmOut.name EventOut.name"),
    ("shop floor", "WebhookIn.name WebhookOut.name"),
    (0.1, "hysteresis least frequency_hz attractor_sd_nm_s loop_area_sd_nm_m_s"),
    (_SHA256, "content_sha256 sha256 photograph_id"), (_CURSOR, "cursor next"),
    ("torque_nm[17] must be finite, got nan", "detail Preview.problem ProblemError.message"),
    ("Drehmoment", "RigColumn.title PreviewColumn.title"),
    ("Nm", "stated PreviewColumn.unit RigColumn.unit stated_unit unit"), ("bench-3", "rig name"),
    (0.3, "amplitude unexplained_share log_sd interval_share"),
    (_TORQUES, "baseline_nm extended_nm measured_nm torque_nm"), (["oil_temperature"], "causes effects unseen"),
    (0.02, "excess_after_nm film_time_s stop_time_difference_s"), (1.2, "mse_percent_after attractor_nm_s"),
    (42.0, "minutes reduction_percent"), (0.4, "narrows pit"), ([4.0, 5.0, 6.0], "pressures_bar Axes.pressure_bar"),
    ([[0.1, -0.2], [0.0, 0.1]], "pressure_cycles speed_pressure"), (5.0, "reduction_percent_sd pressure_bar"),
    (0.5, "cof_fraction fraction share_of_life"),
    (2, "friction_faces maintenance LifeNumber.number LifeNumber.of FleetTotals.archived"),
    (1.0, "pressure_factor exponent widening widening_later"), (20.0, "torque_filter_ms motor_torque_limit_nm"),
    (0.6, "coulomb_ratio asymptote fraction_of_initial"),
    (7000, "until cycles likely_cycles as_of_cycles at_cycles measured_at_cycles"),
    (0.9, "duration_s engagement_duration_s coverage above"), (18.0, "energy_kj energy_per_cycle_kj"),
    (8, "maximum_pressure_bar of predictions runs runs_used CriterionOutcome.tests"),
    (0.134, "mean_cof value initial_mean_cof median initial"), (0.001, "mean_cof_sd sd"),
    (0.2, "rmse_nm excess health"), (0.002, "film_time_sd_s now_sd"), (5100, "at_least true_remaining_cycles"),
    (_QUANTILES, "end_of_life_cycles recent_duty_cycles remaining_blocks remaining_cycles quantiles"),
    ("lot 7, second supplier", "ClutchIn.note ClutchEdit.note ClutchOut.note"),
    (7, "held normal"), (2.0, "median_within"), (1, "FleetTotals.alarms"), (2.1, "intercept order"),
    (0.067, "threshold_mean_cof Criterion.limit CriterionOutcome.limit"), (0.8, "alpha_lambda probability_first"),
    (12, "all clutches"),
    ({"status": "predicted", "remaining_cycles": _QUANTILES}, "BeforeAndAfter.after BeforeAndAfter.before"),
    ("smooth and flat, pores closed", "InspectionIn.note InspectionOut.note"),
    ("determined", "Loop.status LoopItem.status"),
)  # fmt: skip
_OWN: dict[str, Any] = {
    "step": "reads the runs", "replayed": 39, "SeverityWeighed.basis": "dissipated_energy",
    "SeverityWeighed.exponents": [0.0, 0.5, 1.0, 1.5, 2.0, 3.0],
    "Confirmations.run_ids": ["test-7000", "test-8000"], "Withdrawals.run_ids": ["test-7000", "test-8000"],
    "Corrections.cycles": {"test-7000": 7000, "test-8000": 8000},
    "SeverityWeighed.probabilities": [0.01, 0.07, 0.83, 0.08, 0.01, 0.0], "clutch_id": "bench3-017",
    "any_of": ["failure", "maintenance"], "EventOut.value": 3900.0, "EventOut.limit": 4000.0,
    "url": "https://example.org/hook", "secret": "wet-clutch-7000", "DeliveryOut.status": 503,
    "DeliveryOut.problem": "it answered 503", "code": "late_run", "code_version": "1.0.0", "event": "oil_change",
    "filename": "test.csv", "file_name": "bench3_{cycles}_*.csv", "scale": -1.0, "table": "Messung",
    "kinds": {"stat": "stationary_stribeck", "dyn": "dynamic_stribeck"}, "cycles_cell": "Lastspiele",
    "clutch_cell": "Kupplung", "Suggestion.why": "no column is known as torque_nm", "Suggestion.confidence": 0.75,
    "Suggestion.map": {"pressure_bar": "p", "speed_rpm": "n", "torque_nm": "Mz [kNm]"}, "Suggestion.time": "Zeit",
    "Suggestion.decimal": ",",
    "Suggestion.rows": [{"pressure_bar": 5.0, "speed_rpm": 20.0, "torque_nm": 20.9}],
    "together": ["KL-4712_01500.xlsx", "KL-4712_03000.xlsx"],
    "Preview.above": [["Prüfstand", "3"], ["Lastspiele", "7000"]], "tables": ["Messung", "Notizen"],
    "first_rows": [["5,0", "120", "21,9"]], "units": {"torque_nm": ["Nm", "N·m", "kNm"]},
    "Preview.kinds": ["stationary_stribeck"], "Preview.rows": 140_000, "Preview.missing": ["cycles"],
    "missing": "-9999,n/a", "good": "192", "stop_s": 17.5,
    "reading": {"columns": [{"title": "Mz", "channel": "torque_nm", "unit": "Nm"}], "decimal": ","}, "fluid": "ATF",
    "friction_material": "paper", "map": "torque_nm:Mz,speed_rpm:n",
    "message": "the run is later than runs that came before it", "note": "fresh ATF",
    "pointer": "/channels/torque_nm/17", "prefer": "wait=10",
    "problem": "it took longer than 300 s of processor time", "reaction_plate": "steel",
    "reason": "typed a zero too many", "run_id": _RUN,
    "summary": "Oil temperature explains what the baseline leaves.",
    "test": "A stationary test at 40 °C oil temperature", "title": "Oil temperature",
    "type": "urn:clutchlife:problem:invalid-content", "axis": "oil_temperature_c", "beside": ["torque_zero_shift"],
    "effect": "oil_temperature", "excess_before_nm": 0.21, "held_out_runs": [_RUN], "key": "hot_oil",
    "with_test": 0.99, "log_evidence_gain": 31.0,
    "log_score_gain": 12.5, "mse_percent_before": 4.8, "nats": 3.2, "pause_hours": 0.0,
    "speeds_rpm": [20, 500, 1000, 1970],
    "not_adoptable": "Adopt nothing before the next diagnosis.",
    "notes": ["2026-11-02-dynamic is left out: its record has no period"], "p_value": 1e-09,
    "prediction_log_score_gain": 4.1, "probability": 0.98, "rmse_after_nm": 0.18, "rmse_before_nm": 0.31,
    "separates": ["oil_temperature", "viscous_exponent"], "sign_probability": 0.99,
    "statistics": {"share_of_noise": 0.4}, "strength": 30.0, "verdict": "cause_named", "inner_diameter_mm": 99,
    "kinematic_viscosity_100c_cst": 9.3, "kinematic_viscosity_40c_cst": 56, "mean_radius_mm": 58,
    "outer_diameter_mm": 133, "bytes": 812345,
    "channels": {"pressure_bar": [5, 5, 5, 5, 5], "speed_rpm": _SPEEDS, "torque_nm": _TORQUES},
    "kind": "stationary_stribeck", "lining": "disc 2, side A", "initial_speed_rpm": 2000, "mse_percent": 1.7,
    "noise_nm": 0.17, "oil_temperature_c": [84.1, 84.3, 84.9, 85.2, 85.6],
    "plate_temperature_front_c": [84.3, 86.0, 92.4, 101.8, 117.5],
    "plate_temperature_rear_c": [84.2, 85.8, 91.9, 100.9, 115.7], "points": 40, "quantity": "mean_cof",
    "roughness_um": 1.94, "row": 18, "samples": 20000, "sent_cycles": 70000, "skewness": -3.4, "speed_rpm": _SPEEDS,
    "static_torque_nm": 22.0, "stribeck_velocity_m_s": 3.0, "time_s": [0.0, 0.001, 0.002, 0.003, 0.004],
    "torque_sd_nm": [0.1, 0.1, 0.1, 0.1, 0.1], "undetermined": ["stribeck_velocity"], "viscous_coefficient": 1.6,
    "better_law": "attractor", "direction": "clockwise", "loop_area_nm_m_s": 1.4,
    "at_least_at": "2027-01-12T08:00:00+00:00", "counted_from": "2026-11-27T08:00:00+00:00",
    "block_severity": [1.0, 1.4], "decay_bar": 2.0,
    "end_of_life_at": {"0.5": "2027-03-01T00:00:00+00:00"}, "end_of_life_sd": 900, "ended_lives": 4,
    "effective_draws": 812.0, "eq6_probability": 0.93, "horizon_cycles": 1000000, "lower": 0.131,
    "motor_torque_nm": [20.0, 20.0, 19.5], "pace_cycles_per_hour": 120, "probability_of_reaching": 0.97,
    "slope_per_bar": 4.4, "statement": "safe for 5,100 more cycles (95 %)", "upper": 0.137,
    "crps_cycles": 420, "crps_share": 0.04, "members": ["bench3-011", "bench3-012", "bench3-013"],
    "pit_histogram": [0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1], "prognostic_horizon_cycles": 5200,
    "criterion": "slope", "end_s": 1.31, "from_cycles": 15000, "inertia_kg_m2": 0.05, "rebuild": "new-lining",
    "start_s": 0.24, "stop_time_difference_sd_s": 0.01, "stop_time_s": 1.07, "torque_discrepancy": 0.03,
    "draws": 200, "find": "bench3", "limit": 100, "offset": 80, "revision": 17, "scale_cycles": 50000,
    "status": "predicted", "why": "safe for 3,400 more cycles (95 %)",
    "ClutchOut.action": "Replace within 6 days at the pace so far, counted from the last run on 27 Nov 2026.",
    "ClutchOut.what_to_do": "Replace within 6 days at the pace so far, counted from the last run on 27 Nov 2026.",
    "open_alarms": 1, "Doubt.id": "counter-test-7000", "doubt_id": "counter-test-7000", "CounterHypothesis.kind": "restart",
    "CounterHypothesis.runs": ["test-7000", "test-8000"], "cycles_offset": 9700, "cycles_factor": 1000,
    "ClutchOut.headline": "Normal: safe for 3,400 more cycles (95 %); 50 % chance of 5,200 or more",
    "AsymptoticLaw.covariance": [[0.01, 0.0, 0.0], [0.0, 0.04, 0.0], [0.0, 0.0, 0.1]],
    "LinearLaw.covariance": [[0.01, -0.001], [-0.001, 0.0002]], "CandidateOut.fit": "converged",
    "CoefficientDraws.initial": [22.1, 22.4], "CoefficientDraws.change": [-14.2, -14.9],
    "CoefficientDraws.scale_cycles": [3700, 4100], "CoefficientDraws.exponent": [0.55, 0.6],
    "DegradationItem.correlations": [[1, -0.6, 0.1, 0], [-0.6, 1, 0.2, 0.1], [0.1, 0.2, 1, 0.9], [0, 0.1, 0.9, 1]],
    "Amplitude.name": "temperature difference", "Amplitude.interval": [0.132, 0.136],
    "Change.after": {"cycles": 7000}, "Change.before": {"cycles": 70000}, "ModelName.name": "baseline",
    "Problem.status": 422, "Problem.title": "The content is not valid", "ProblemError.code": "not_finite",
    "ProblemError.value": "nan", "Axes.cycles": [0, 1000, 2000],
    "CandidateOut.isolability": 0.9, "VisibleOut.isolability": 0.8, "like_the_law": ["viscous_exponent"], "rms_percent": 3.1,
    "interval_percent": [2.2, 4.0], "effect_on_mean_cof_percent": -0.4, "effect_on_remaining_cycles_percent": -2.5,
    "from_rpm": 20, "to_rpm": 120, "LawBandOut.share": 0.7, "eq3_nm": [21.2, 22.6, 22.4, 21.6, 20.7],
    "law_nm": [21.8, 22.8, 22.4, 21.5, 20.8], "law_sd_nm": [0.1, 0.08, 0.06, 0.06, 0.07],
}  # fmt: skip
_EXAMPLES = _OWN | {name: value for value, names in _SHARED for name in names.split()}


def example_of(owner: str, name: str) -> Any:
    """The example of the field or parameter of that name; None if there is none."""
    ending = name[name.rfind("_") :] if "_" in name else ""
    return _EXAMPLES.get(f"{owner}.{name}", _EXAMPLES.get(name, _EXAMPLES.get(ending)))
