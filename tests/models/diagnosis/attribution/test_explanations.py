"""One list of explanations, and everything that is read off it: verdict, causes, probabilities, the paragraph agree."""

from dataclasses import replace

import numpy as np
import pytest

from models.diagnosis.attribution.decide import judged
from models.diagnosis.attribution.explanations import (
    credible_explanations,
    explanations_of,
    read,
    reconciled,
)
from models.diagnosis.attribution.verdict import UNCATALOGUED, Judgement, Verdict
from models.diagnosis.criteria import CREDIBLE_MASS, LEAST_NAMED, LEAST_SECOND_NAMED
from models.diagnosis.effects.catalogue import BY_SLUG
from models.diagnosis.report.summary import summarise
from tests.models.diagnosis.report.test_summary import candidate, findings

Weights = dict[tuple[str, ...], float]
UNKNOWN = (UNCATALOGUED,)


def weights_of(rng: np.random.Generator) -> Weights:
    """Explanations as evidences make them: some effects alone, some together, something unknown, nothing."""
    slugs = rng.permutation(list(BY_SLUG))[: rng.integers(1, 6)].tolist()
    pairs = [tuple(rng.permutation(slugs)[:2].tolist()) for _ in range(rng.integers(0, 4)) if len(slugs) > 1]
    listed = [(), UNKNOWN, *((slug,) for slug in slugs), *pairs]
    return dict(zip(listed, np.exp(rng.normal(0.0, rng.choice([0.3, 3.0, 20.0]), len(listed))).tolist(), strict=False))


def judgement_of(rng: np.random.Generator) -> Judgement:
    """A verdict as the rules may decide it, whatever the evidences are, with what they leave."""
    weights = weights_of(rng)
    slugs = list(dict.fromkeys(slug for effects in weights for slug in effects if slug != UNCATALOGUED))
    leader = tuple(rng.permutation(slugs)[: rng.integers(1, 3)].tolist())
    targets: list[tuple[Verdict, Weights]] = [
        (Verdict.MODEL_ADEQUATE, {(): 1.0}),
        (Verdict.CAUSE_NAMED, {leader: 1.0}),
        (Verdict.CAUSE_AMBIGUOUS, {leader: 0.6, (*leader, UNCATALOGUED): 0.4}),
        (Verdict.UNEXPLAINED_STRUCTURE, {UNKNOWN: 1.0}),
    ]
    if len(slugs) > 1:
        targets.append((Verdict.CAUSE_AMBIGUOUS, {(slug,): 1.0 for slug in slugs}))
    verdict, target = targets[rng.integers(len(targets))]
    found = judged(verdict, weights, target)
    assert found.verdict is verdict
    return found


def test_verdict_causes_probabilities_and_words_say_one_thing() -> None:
    rng = np.random.default_rng(11)
    for _ in range(600):
        found = judgement_of(rng)
        assert sum(one.probability for one in found.explanations) == pytest.approx(1.0)
        assert len({frozenset(one.effects) for one in found.explanations}) == len(found.explanations)
        assert read(found.explanations) == (found.verdict, found.causes)
        shares = found.probabilities
        assert all(0.0 <= share <= 1.0 for share in shares.values())
        said = said_of(found)
        if found.verdict is Verdict.CAUSE_NAMED:
            assert UNCATALOGUED not in found.causes
            assert shares[found.causes[0]] >= LEAST_NAMED
            assert min(shares[slug] for slug in found.causes) >= LEAST_SECOND_NAMED
            assert "cannot distinguish" not in said
            assert ("together with" in said) == (len(found.causes) > 1)
        elif found.verdict is Verdict.CAUSE_AMBIGUOUS:
            near = credible_explanations(found.explanations)
            assert len(near) > 1
            assert near[0].probability < CREDIBLE_MASS
            assert set(found.causes) == {slug for one in near for slug in one.effects}
            assert "cannot distinguish" in said
            assert "above 0.99" not in said.split("cannot distinguish")[1].split("bar")[0].split(";")[0]
        else:
            assert found.causes == ()
            assert "The cause is" not in said
        for slug in found.causes:
            assert (slug.replace("_", " ") if slug != UNCATALOGUED else "not in the catalogue") in said


def said_of(found: Judgement) -> str:
    candidates = tuple(candidate(slug, share) for slug, share in found.probabilities.items())
    base = replace(findings(found.verdict), causes=found.causes, advice=())
    return summarise(replace(base, explanations=found.explanations, candidates=candidates))


def test_evidence_that_reads_as_the_rules_decided_is_left_alone() -> None:
    weights: Weights = {("oil_change",): 0.6, ("running_in",): 0.3, (): 0.1}
    found = reconciled(weights, {("oil_change",): 1.0, ("running_in",): 1.0}, Verdict.CAUSE_AMBIGUOUS)
    assert [one.effects for one in found] == list(weights)
    assert [one.probability for one in found] == pytest.approx(list(weights.values()))
    # the control: where a check leaves a doubt, it costs the cause what makes it one
    sure = reconciled(
        {("oil_change",): 1.0}, {("oil_change",): 0.6, ("oil_change", UNCATALOGUED): 0.4}, Verdict.CAUSE_AMBIGUOUS
    )
    assert 0.8 < sure[0].probability < LEAST_NAMED


def test_two_that_share_an_effect_are_one_cause_with_another_that_is_open() -> None:
    found = explanations_of({("oil_change", "running_in"): 0.5, ("oil_change", "interface_heating"): 0.5})
    assert read(found)[0] is Verdict.CAUSE_AMBIGUOUS
    assert set(read(found)[1]) == {"oil_change", "running_in", "interface_heating"}
