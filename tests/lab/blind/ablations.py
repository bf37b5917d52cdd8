"""`make blind ABLATE=...`: numbers that gate a verdict, each taken for another, on the fixed set of campaigns.

ABLATE= each: all of the table; NAME=value: one number of the diagnosis' criteria, as SLACK=0.0
SEED=   other campaigns (1)    SIZE=   a share of them (1: some two hours of one core; any share is a fair sample)
ONLY=   rows whose names begin with these
Verdicts are stored in .blind/ablations, a file a campaign and what was tried: the next run goes on where this one ended.
After a change of code remove them.
"""

import os
import pickle
from ast import literal_eval
from collections.abc import Mapping, Sequence
from dataclasses import replace
from time import process_time
from unittest.mock import patch

from models.diagnosis import criteria
from models.diagnosis.design.design import build_design
from models.diagnosis.explanations.decide import judge
from models.diagnosis.explanations.posterior import Search
from models.diagnosis.pooled_fit.baseline_fit import fit_baseline
from models.diagnosis.raw_records.evidence import raw_evidence
from tests.lab.blind.rig.loudness import UnreachableError
from tests.lab.blind.rig.sent import campaign
from tests.lab.blind.subset import trials
from tests.lab.blind.trials import Outcome, Trial, file_of, nothing
from tests.lab.measuring import Asked, kept
from tests.lab.measuring import table as markdown

#: What each number is taken for.
EACH: dict[str, tuple[object, ...]] = {
    "ANYTHING_WRONG": (0.1,),
    "UNCATALOGUED_SHARE": (0.03,),
    "TEMPLATE_ERRORS": (((0.25, 0.05),),),
    "CONTRAST_SIZES": ((0.003,),),
    "FORM_SIZES": ({0.0: 1.0},),
    "PRESSURE_SIZES": ({0.0: 1.0},),
    "LIFE_SIZES": ({0.0: 1.0},),
    "USUAL_LAW": ((0.0, 0.0, 0.0),),
    "ISOLABLE": (0.0, 0.7),
    "NEGLIGIBLE_SIZES": (0.2,),
    "LEAST_REPEATS": (10**9,),
    "NEGLIGIBLE": (0.1,),
    "SLACK": (0.0,),
    "MOST_REFITS": (5, 1000),
    "LIKELY": (0.35, 0.65),
    "SURE": (0.8, 0.95),
    "SHARP": (1e9,),
}
#: Those that act on the baseline, and those that act on what was found: the search is as it is.
ON_BASELINE = {"SHARP", "LEAST_REPEATS", "FORM_SIZES", "PRESSURE_SIZES", "LIFE_SIZES", "NEGLIGIBLE_SIZES"}
ON_WHAT_WAS_FOUND = {"LIKELY", "SURE"}
AS_IT_IS = "as it is"


def asked(ablate: str) -> dict[str, tuple[object, ...]]:
    """The numbers and what they are taken for. Raises ValueError where the criteria have no such number."""
    if ablate == "each":
        return EACH
    name, _, value = ablate.partition("=")
    if not hasattr(criteria, name):
        raise ValueError(f"the diagnosis' criteria have no number {name}")
    return {name: (literal_eval(value),)}


def verdicts(trial: Trial, numbers: Mapping[str, Sequence[object]]) -> dict[str, Outcome]:
    """What is said as it is, and with each value of each number; what a number does not act on is computed once."""
    seen = campaign(trial.hidden())
    design = build_design(seen)
    raw = raw_evidence(seen, trial.without)

    def said(search: Search, began: float) -> Outcome:
        judgement = judge(search.posterior(raw, trial.without))
        seconds = process_time() - began
        return replace(nothing(trial, str(judgement.verdict), ""), causes=frozenset(judgement.causes), seconds=seconds)

    began = process_time()
    baseline = fit_baseline(design)
    search = Search(baseline, raw, trial.without)
    search.run()
    out = {AS_IT_IS: said(search, began)}
    for number, values in numbers.items():
        for value in values:
            began, other = process_time(), search
            with patch.object(criteria, number, value):
                if number not in ON_WHAT_WAS_FOUND:
                    other = Search(fit_baseline(design) if number in ON_BASELINE else baseline, raw, trial.without)
                    other.run()
                out[f"{number} = {value}"] = said(other, began)
    return out


def stored(trial: Trial, ablate: str) -> dict[str, Outcome]:
    """The verdicts on a trial, computed or read; none where no such campaign could be made."""

    def judged() -> bytes:
        try:
            return pickle.dumps(verdicts(trial, asked(ablate)))
        except UnreachableError:
            return pickle.dumps({})

    return pickle.loads(kept(file_of(trial, f"ablations/{ablate}"), judged))  # noqa: S301 -- of this program


def good(one: Outcome) -> bool:
    """Nothing, or another law, called adequate, an effect named right, what is left out or uncatalogued neither named nor
    overlooked."""
    if not one.truth or one.trial.row.startswith(("none", "law/")):
        return one.verdict == "model_adequate"
    if one.trial.row.startswith(("left/", "outside/")):
        return not one.named and one.verdict != "model_adequate"
    return one.right


def table(found: Sequence[dict[str, Outcome]]) -> list[str]:
    """A row a value: how many verdicts changed, became good or ceased to be, and of those named wrong."""
    titles = (
        f"{len(found)} campaigns",
        "changed",
        "good only so",
        "good only as it is",
        "named wrong (as it is)",
        "seconds",
    )
    lines: list[tuple[object, ...]] = []
    for variant in found[0]:
        pairs = [(each[AS_IT_IS], each[variant]) for each in found]
        changed = sum((a.verdict, a.causes) != (b.verdict, b.causes) for a, b in pairs)
        won, lost = sum(good(b) and not good(a) for a, b in pairs), sum(good(a) and not good(b) for a, b in pairs)
        wrong = f"{sum(b.wrong for _, b in pairs)} ({sum(a.wrong for a, _ in pairs)})"
        seconds = sum(b.seconds for _, b in pairs) / len(pairs)
        lines.append((variant, changed, won, lost, wrong, f"{seconds:.1f}"))
    return markdown(titles, lines)


def main() -> None:
    """Judge, and print the rows."""
    ablate = os.environ["ABLATE"]
    asked(ablate)  # what is not there is said at once
    wanted = Asked.here("full")
    chosen = [one for one in trials(wanted.seed) if one.row.startswith(wanted.only)]
    sample = [chosen[int(place / wanted.size)] for place in range(round(len(chosen) * wanted.size))]
    found = [said for one in sample if (said := stored(one, ablate))]
    print("\n".join(table(found)))


if __name__ == "__main__":
    main()
