"""The engine's numbers in a report, by public name: alarm statistics, their thresholds, p-values of the check,
the scatter from run to run."""

import numpy as np

from models.diagnosis.attribution.verdict import Comparison
from models.diagnosis.detection.alarm import Alarms
from models.diagnosis.effects.catalogued import oil_temperature
from models.diagnosis.pooled_fit.run_scatter import RunScatter


def statistics_of(alarms: Alarms, comparison: Comparison | None, scatter: RunScatter) -> dict[str, float]:
    """All finite numbers [nats; p-values and scatter as they are]; those of a comparison where hypotheses were compared."""
    numbers: dict[str, float] = {
        "run_scatter": scatter.median,
        "run_scatter_lower": scatter.lower,
        "run_scatter_upper": scatter.upper,
        "run_scatter_information": scatter.information,
    }
    for name, alarm in (("effects", alarms.effects), ("contrasts", alarms.contrasts), ("lines", alarms.lines)):
        numbers |= {
            f"{name}_value": alarm.value,
            f"{name}_threshold": alarm.threshold,
            f"{name}_p_value": alarm.p_value,
        }
    if comparison is not None:
        check = comparison.check
        numbers |= {
            "lambda": comparison.best_drop,
            "structure": comparison.structure,
            "tolerance": comparison.tolerance,
            "standing": float(comparison.credible),
            "undoing": check.undoing,
        }
        for name, statistic in (("closure", check.left), ("parts", check.parts), ("left_lines", check.lines)):
            numbers |= {f"{name}_value": statistic.value, f"{name}_p_value": statistic.p_value}
        if comparison.unmeasured is not None:
            numbers[f"{oil_temperature.EFFECT.slug}_unmeasured"] = comparison.unmeasured
    return {name: value for name, value in numbers.items() if np.isfinite(value)}
