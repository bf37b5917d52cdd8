"""What an adopted model takes off the measurements, in sentences: how large it is, and what would end it."""

import numpy as np

from models.diagnosis.effects.catalogue import BY_SLUG
from models.diagnosis.effects.effect import EffectKind
from models.diagnosis.extension import Extension
from models.diagnosis.report.summary import size_of


def corrections(extension: Extension) -> tuple[str, ...]:
    """A sentence for each artefact, `Corrected: the clutch gets 0.38 bar less than the gauge reads. Repair the gauge.`; its
    size is the mean over the draws in which it is at work."""
    sentences = []
    for slug in extension.effects:
        effect = BY_SLUG.get(slug)
        if effect is None or effect.kind is not EffectKind.ARTEFACT:
            continue
        drawn = [
            (draw["weight"], stored["amplitude"])
            for draw in extension.content["draws"]
            for stored in draw["effects"]
            if stored["slug"] == slug
        ]
        size = effect.scale * float(np.average([size for _, size in drawn], weights=[weight for weight, _ in drawn]))
        below = size < 0.0 and bool(effect.states_below)
        states = effect.states_below if below else effect.states
        said = states.format(size_of(slug, float(f"{abs(size) if below else size:.2g}"), effect.unit))
        repair = f" {effect.repair[0].upper()}{effect.repair[1:]}." if effect.repair else ""
        sentences.append(f"Corrected: {said[0].lower()}{said[1:]}{repair}")
    return tuple(sentences)
