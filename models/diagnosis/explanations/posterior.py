"""The posterior over what may be behind a campaign: an exclusive list, each with a log prior and a log evidence.

    nothing | e | e + f | u | S_k | e + S_k | e + u | T | a line | an outlying run

e, f are effects of the catalogue, u faults of the same catalogue that may not be named, S_k smooth structure on axis k, T
an oil temperature that nobody measured, a line is torque that swings with the tests' clock or at one frequency in raw
records. Their probabilities sum to one, and a verdict is read off them alone.

The search begins with each single cause that is promised to be more probable than nothing, and goes up, best first: what
the linear screen about a refitted alternative promises of one thing more is refitted, while it could hold more than
NEGLIGIBLE of the posterior; the promise errs by a share SLACK of what the leader explains more than the alternative about
which it was made, and a single cause that is further behind the leader than that is not screened, unless nothing with a
name leads. Then down: the leader without each of
its parts, from where it has the rest. Structure is refitted as an effect is, its likeliest form taken off: judged linearly
it looked 7.5 nats strong where it was a false lead. It draws no random numbers.

The linear screen refits nothing, and takes the changes about nothing at work for all,

    promise = ln Σ_g Σ_s p(g) p(shape) ∫ p(data | a; g) p(a) da - the same without the effect        [nats]

with the heavy-tailed prior of amplitudes as two normal ones (`effects.effect.SCALES`). The shapes that a refit moves are
summed over; those that it does not (a change point, which torque is meant) are kinds, and each kind is a start of its own.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import compress
from typing import NamedTuple, TypeAlias

import numpy as np
from scipy.special import expit

from models.arrays import FloatArray
from models.diagnosis import criteria
from models.diagnosis.effects.catalogue import BY_SLUG, Column, columns_at_rows, columns_of, effects_for
from models.diagnosis.effects.effect import SCALES, EffectKind, Shape
from models.diagnosis.effects.faults import FAULT_BY_SLUG, FAULTS
from models.diagnosis.effects.fitted_effect import FittedEffect
from models.diagnosis.effects.history import OIL_CHANGE
from models.diagnosis.effects.thermal import OIL_TEMPERATURE
from models.diagnosis.explanations.evidence import Evidence, evidence_of
from models.diagnosis.explanations.shapeless import highest_line, line_evidence, outlier_evidence, temperature_evidence
from models.diagnosis.explanations.verdict import LINE, LINES, NOTHING, OUTLIER, Alternative, is_axis
from models.diagnosis.noise.estimate import unlike
from models.diagnosis.pooled_fit.baseline_fit import Baseline
from models.diagnosis.pooled_fit.gauss_newton import PooledFit, fit, refit, refit_beside
from models.diagnosis.pooled_fit.problem import FitProblem
from models.diagnosis.pooled_fit.projection import Projected, Screened, isolability, left_over
from models.diagnosis.raw_records.evidence import RawEvidence
from models.gaussian_evidence import log_gain_alone, log_positive, log_sum


class Start(NamedTuple):
    """A start of a refit: one kind of an effect's shapes, with its promise and its linear fit."""

    promise: float  # [nats], its prior included
    column: Column  # its best
    gain: int  # the place of the projection (scatter of the gains, size of the law) that suits that
    fitted: FittedEffect  # the linear fit of it


def screen_of(projected: Projected) -> Screened:
    """Information and score of the screened columns of a projection; empty arrays where no column was screened."""
    none = np.zeros(0)
    return projected.screened or Screened(info=none, score=none, whole=none)


def starts(columns: Sequence[Column], screened: Sequence[Projected]) -> dict[str, list[Start]]:
    """Starts for refits by effect slug, one for each kind of the effect's shapes, of highest promise first."""
    if not columns:
        return {}
    sd = np.array([column.effect.prior_sd for column in columns])
    positive = np.array([column.effect.positive for column in columns], dtype=np.bool_)
    weight = np.array([column.log_weight for column in columns])
    null = log_sum([projected.evidence for projected in screened])
    by_gain = []
    for projected in screened:
        info, score = screen_of(projected).info, screen_of(projected).score
        wide = np.outer(SCALES, sd)
        gain = log_gain_alone(info, score, wide) + np.where(positive, log_positive(info, score, wide), 0.0)
        by_gain.append(projected.evidence + np.logaddexp.reduce(gain, axis=0) - np.log(len(SCALES)) + weight)
    table = np.stack(by_gain)
    total = np.logaddexp.reduce(table, axis=0)
    kinds: dict[tuple[str, Shape], list[int]] = {}
    for place, column in enumerate(columns):
        kinds.setdefault((column.effect.slug, column.effect.stiff(column.shape)), []).append(place)
    by_effect: dict[str, list[Start]] = {}
    for (slug, _), kind_starts in kinds.items():
        best = kind_starts[int(np.argmax(total[kind_starts]))]
        likely = int(np.argmax(table[:, best]))
        screen = screen_of(screened[likely])
        amplitude = float(screen.score[best] / (screen.info[best] + (SCALES[-1] * sd[best]) ** -2.0))
        column = columns[best]
        fitted = FittedEffect(effect=column.effect, amplitude=column.effect.within(amplitude), shape=column.shape)
        promise = log_sum(total[kind_starts]) - null
        by_effect.setdefault(slug, []).append(Start(promise, column, likely, fitted))
    return {slug: sorted(by_kind, key=lambda start: -start.promise) for slug, by_kind in by_effect.items()}


#: By slug, in order, the shapes of an alternative's effects that a refit does not move; an alternative that is promised, in
#: one of them.
ShapeKinds: TypeAlias = tuple[tuple[str, Shape], ...]
Key: TypeAlias = tuple[Alternative, ShapeKinds]


@dataclass(frozen=True, slots=True, kw_only=True)
class Node:
    """A refitted alternative: its fit and its log evidence [nats]."""

    fit: PooledFit
    evidence: Evidence
    shape_evidence: tuple[float, ...]  # of its kind of shapes [nats]
    log_evidence: float  # with that, and that of raw records
    promise: float  # what it had been promised to be

    @property
    def kind(self) -> ShapeKinds:
        """The kind of the effects' shapes, by slug: the values of the shapes that a refit does not move."""
        return tuple(sorted((e.effect.slug, e.effect.stiff(e.shape)) for e in self.fit.effects))


@dataclass(frozen=True, slots=True, kw_only=True)
class Posterior:
    """Result of the search: the alternatives' log weights, the refits behind them, probabilities of vibrations and
    isolabilities."""

    weights: Mapping[Alternative, float]  # log weights [nats] over nothing, prior included
    nodes: Mapping[Alternative, Node]  # the best one of each alternative that was refitted
    vibrations: Mapping[str, float]  # the probability of each, independent of the rest
    prior: "Prior"
    problem: FitProblem  # that all refits share
    columns: tuple[Column, ...]  # that were screened
    refits: int
    #: ι of each cause, the largest of its explanations', or where it was not refitted that of the shape which the screen
    #: likes best; and the probability of those that were counted as the law's form, for they cannot be told from it.
    isolability: Mapping[str, float]
    like_the_law: Mapping[str, float]

    @property
    def null(self) -> Node:
        """The node of the alternative that nothing is at work."""
        return self.nodes[NOTHING]

    @property
    def probabilities(self) -> dict[Alternative, float]:
        """Probabilities of the alternatives, most probable first; they sum to one."""
        total = log_sum(list(self.weights.values()))
        ranked = sorted(self.weights.items(), key=lambda item: -item[1])
        return {alternative: float(np.exp(weight - total)) for alternative, weight in ranked}


@dataclass(frozen=True, slots=True, kw_only=True)
class Prior:
    """Log prior odds of an alternative against nothing at work. ANYTHING_WRONG is the probability that anything is,
    UNCATALOGUED_SHARE of it for causes outside the catalogue; a second cause beside the first is as probable again;
    within each the odds are even."""

    effects: int
    unknowns: int

    def __call__(self, alternative: Alternative) -> float:
        if alternative == NOTHING:
            return 0.0
        wrong = np.log(criteria.ANYTHING_WRONG / (1 - criteria.ANYTHING_WRONG))
        of_effect = np.log1p(-criteria.UNCATALOGUED_SHARE) - np.log(self.effects)
        of_unknown = np.log(criteria.UNCATALOGUED_SHARE) - np.log(self.unknowns)
        if not alternative.causes:
            return float(wrong + of_unknown)
        value = wrong + of_effect
        if len(alternative.causes) > 1:  # in either order
            of_second = np.log1p(-criteria.UNCATALOGUED_SHARE) - np.log(max(self.effects - 1, 1))
            value += np.log(2.0 * criteria.ANYTHING_WRONG) + of_second
        if alternative.unknown:
            value += np.log(criteria.ANYTHING_WRONG) + of_unknown
        return float(value)


class Lead(NamedTuple):
    """The highest log evidence that a refit has reached [nats], and the fit's cost under the search's noise; other
    refits must come near to both."""

    log_evidence: float
    cost: float


class Search:
    """State of the search: refitted nodes by alternative, and the alternatives that wait for a refit, with their
    promised log weights."""

    def __init__(self, baseline: Baseline, raw: Sequence[RawEvidence], without: frozenset[str]) -> None:
        facts = baseline.problem.design.facts
        effects = effects_for(facts, without)
        self._exact = replace(baseline.exact.laws, learned=baseline.fit.laws.learned)
        self._raw = {r.effect: r.log_evidence for r in raw if r.effect in BY_SLUG and not is_vibration(r)}
        self.problem = self._null_problem = baseline.problem
        self._columns, self._changes = _shown(self.problem, baseline.fit, columns_of([*effects, *FAULTS], facts))
        fitted = baseline.fit
        null = self._node(fitted, (), (), self._changes, smooth=True)
        if null is None:
            raise ArithmeticError("the baseline's evidence is not finite")
        shown = {column.effect.slug for column in self._columns}
        self.prior = Prior(
            effects=max(len(effects), 1),
            unknowns=len(null.evidence.structure) + len(shown & set(FAULT_BY_SLUG)) + len(LINES) + 1,
        )
        firsts = [kinds[0] for kinds in starts(self._columns, null.evidence.screened).values()]
        best = max(firsts, key=lambda start: start.promise, default=None)
        if best is not None and best.promise > 0.0:  # the gains that suit the best, for the metric of all refits
            likely = null.evidence.screened[best.gain]
            self.problem = baseline.problem.with_noise(likely.noise(baseline.problem.noise))
            fitted = fit(self.problem, baseline.fit.laws)
            again = self._node(fitted, (), (), self._changes, smooth=True)
            if again is not None and again.log_evidence > null.log_evidence:
                null, self._null_problem = again, self.problem
        self.nodes: dict[Alternative, list[Node]] = {NOTHING: [null]}
        self._lead = Lead(null.log_evidence, fitted.cost)
        self.refits = 0
        self._promises: dict[Key, tuple[float, Node, Start | None]] = {}
        self._failed = set[Alternative]()
        self._unscreened = set[Alternative]()
        self._nearest: dict[Alternative, tuple[float, float]] = {}
        self._promise(NOTHING, null)

    @property
    def null(self) -> Node:
        """The node of the alternative that nothing is at work."""
        return self.nodes[NOTHING][0]

    def run(self) -> None:
        """Runs the search: refits single causes, adds effects to promising alternatives, then tries the leader without
        each of its parts; ends once the leader has been reduced already."""
        reduced = set[Alternative]()
        self._single()
        while True:
            self._up()
            weights = self.weights()
            leader = max(self.nodes, key=lambda alternative: weights[alternative])
            self._screen({leader} & self._unscreened)  # it may have come to lead by the last refit
            if leader in reduced:
                return
            reduced.add(leader)
            self._down(leader)

    def weights(self) -> dict[Alternative, float]:
        """Log weights (log prior + log evidence) [nats] of the refitted alternatives, and of smooth structure beside
        single causes or nothing as it was screened there."""
        out: dict[Alternative, float] = {}
        for alternative, nodes in self.nodes.items():
            out[alternative] = self._evidence(alternative) + self.prior(alternative)
            screened = [node for node in nodes if node.evidence.structure]
            if len(alternative.causes) > 1 or alternative.unknown or not screened:
                continue
            unscreened_share = self._evidence(alternative) - log_sum([node.log_evidence for node in screened])
            for axis in screened[0].evidence.structure:
                beside = Alternative(alternative.causes, axis)
                if beside not in self.nodes:
                    logs = [node.log_evidence + node.evidence.structure[axis] for node in screened]
                    out[beside] = log_sum(logs) + unscreened_share + self.prior(beside)
        return out

    def _evidence(self, alternative: Alternative) -> float:
        """Log evidence of an alternative over all its kinds of shapes [nats]: refitted kinds by their evidence, the
        others in proportion to their promises."""
        nodes = self.nodes[alternative]
        value = log_sum([node.log_evidence for node in nodes])
        left = [promise for (other, _), (promise, _, _) in self._promises.items() if other == alternative]
        if not left or alternative == NOTHING:
            return value
        done = log_sum([node.promise for node in nodes])
        return value + float(np.logaddexp(done, log_sum(left))) - done

    def _up(self) -> None:
        """Refit the most promising alternatives, from the best refitted one upwards, until none is promised to matter
        or MOST_REFITS is reached; alternatives near the best one are screened first."""
        most = self.refits + criteria.MOST_REFITS
        while self._promises and self.refits < most:
            weights = self.weights()
            leader = max(self.nodes, key=lambda alternative: weights[alternative])
            slack = criteria.SLACK * max(weights[leader] - weights[NOTHING], 0.0)
            least = weights[leader] - slack + np.log(criteria.NEGLIGIBLE)
            near = {one for one in self._unscreened if not leader.causes or weights[one] > least}
            if near:
                self._screen(near)
                continue
            hopes = {key: self._hope(key, leader, criteria.SLACK) for key in self._promises}
            enough = log_sum(list(weights.values())) + np.log(criteria.NEGLIGIBLE)
            able = [key for key in hopes if hopes[key] >= enough]
            if not able:  # structure leads causes only once one of them was refitted
                able = [key for key in hopes if key[0].causes]
                if not able or leader.causes or not leader.unknown or any(other.causes for other in self.nodes):
                    return
            self._take(max(able, key=lambda key: self._hope(key, leader, 0.0)))

    def _single(self) -> None:
        """Refits each single cause whose best kind has a promise above nothing at work: a strong cause may be a hundred
        nats better than its promise, because the screen is linear about a baseline that has absorbed a part of it."""
        best: dict[Alternative, Key] = {}
        for key, (promise, _, _) in sorted(self._promises.items(), key=lambda item: item[1][0]):
            if len(key[0].causes) == 1 and not key[0].unknown and promise > self.null.log_evidence:
                best[key[0]] = key
        for key in sorted(best.values(), key=lambda key: -self._promises[key][0]):
            self._take(key)

    def _screen(self, alternatives: set[Alternative]) -> None:
        """Screens smooth structure and one further effect about the best node of each given alternative (a single
        cause, or nothing), and records their promises."""
        for alternative in sorted(alternatives):
            first, *other_nodes = self.nodes[alternative]
            evidence = evidence_of(self.problem, first.fit, self._changes)
            self.nodes[alternative] = [replace(first, evidence=evidence), *other_nodes]
            if alternative != NOTHING:
                self._promise(alternative, self.nodes[alternative][0])
        self._unscreened -= alternatives

    def _take(self, key: Key) -> None:
        """Refits a promised alternative, about the node that promised it, and removes the promise."""
        promise, parent, start = self._promises.pop(key)
        self.refits += 1
        if start is None:
            self._add_structure(key[0], parent, promise)
        else:
            shape_evidence = (*parent.shape_evidence, start.column.log_weight_around)
            self._add(key[0], parent.fit, (*parent.fit.effects, start.fitted), shape_evidence, promise)
        if key[0] not in self.nodes:
            self._failed.add(key[0])

    def _hope(self, key: Key, leader: Alternative, slack: float) -> float:
        """The log weight [nats] hoped for from a refit: the promise plus the best surplus of refits of the
        alternative's other kinds over their promises. If none was refitted yet and the alternative competes with the
        leader, a share `slack` of the leader's gain over the promise's parent is added instead."""
        alternative, (promise, parent, _) = key[0], self._promises[key]
        beyond = [n.log_evidence + self.prior(alternative) - n.promise for n in self.nodes.get(alternative, [])]
        if beyond:
            return promise + max(beyond)
        adds_to_leader = set(leader.causes) <= set(alternative.causes) and leader.unknown in {"", alternative.unknown}
        more = max(self.nodes[leader][0].log_evidence - parent.log_evidence, 0.0)
        return promise + (0.0 if adds_to_leader else slack * more)

    def _down(self, leader: Alternative) -> None:
        """Refits the leader without each of its parts in turn, starting from the leader's fit."""
        node = self.nodes[leader][0]
        places = [None] if is_axis(leader.unknown) else range(len(node.fit.effects))
        fewer = set[Alternative]()
        for place in places:
            effects = tuple(e for k, e in enumerate(node.fit.effects) if k != place)
            shape_evidence = tuple(x for k, x in enumerate(node.shape_evidence) if k != place)
            gone = leader.unknown if place is None else node.fit.effects[place].effect.slug
            less = leader.without(gone)
            self._add(less, node.fit, effects, shape_evidence, -np.inf)
            fewer.add(less)
        self._screen(fewer & self._unscreened)

    def _add(
        self,
        alternative: Alternative,
        start: PooledFit,
        effects: tuple[FittedEffect, ...],
        shape_evidence: tuple[float, ...],
        promise: float,
    ) -> None:
        """Refits an alternative once more and stores the node; of nodes with one kind of shapes the better one is
        kept."""
        # beside a loud cause the law's form goes as far as its sizes allow, and bends eq. 3 along: from there a refit with
        # the cause may end elsewhere
        laws = (start.laws, self._exact)[: 2 if len(effects) == 1 else 1]
        slack = criteria.SLACK * (self._lead.log_evidence - self.null.log_evidence)
        fitted = refit(self.problem, laws, effects, self._lead.cost + slack)
        node = None if fitted is None else self._node(fitted, alternative.causes, shape_evidence)
        near = node is not None and node.log_evidence > self._lead.log_evidence - slack
        if node is not None and near and (problem := self._suiting(node)).noise.law != self.problem.noise.law:
            # beside another law than is likely with its causes it was not expanded about what is likely
            closer = refit(problem, [node.fit.laws], node.fit.effects)
            node = None if closer is None else self._node(closer, alternative.causes, shape_evidence)
        if node is None or fitted is None:
            return
        self._lead = max(self._lead, Lead(node.log_evidence, fitted.cost))
        node = replace(node, promise=max(promise, node.log_evidence + self.prior(alternative)))
        before = self.nodes.get(alternative, [])
        first = not before or node.log_evidence > before[0].log_evidence
        same = next((other for other in before if other.kind == node.kind), None)
        if same is None or node.log_evidence > same.log_evidence:
            nodes_kept = [node, *(other for other in before if other is not same)]
            self.nodes[alternative] = sorted(nodes_kept, key=lambda node: -node.log_evidence)
        if first and len(effects) < 2 and not alternative.unknown:
            self._unscreened.add(alternative)

    def _suiting(self, node: Node) -> FitProblem:
        """The problem with the sizes of the law's discrepancy that have the highest evidence beside a node."""
        likely = max(node.evidence.screened, key=lambda projected: projected.evidence)
        return self.problem.with_noise(replace(self.problem.noise, law=likely.sizes))

    def _add_structure(self, alternative: Alternative, parent: Node, promise: float) -> None:
        """Adds smooth structure on an axis (`alternative.unknown`) beside a parent explanation. The baseline is
        refitted with the likeliest form of the structure taken off; `promise` is the log evidence [nats] that was
        expected."""
        axis = alternative.unknown
        fitted = refit_beside(self._suiting(parent), parent.fit, parent.evidence.patterns[axis])
        node = None if fitted is None else self._node(fitted, alternative.causes, parent.shape_evidence, smooth=True)
        if node is not None and axis in node.evidence.structure:
            value = node.log_evidence + node.evidence.structure[axis]
            self.nodes[alternative] = [replace(node, log_evidence=value, promise=promise)]

    def _node(
        self,
        fitted: PooledFit,
        causes: tuple[str, ...],
        shape_evidence: tuple[float, ...],
        beside: FloatArray | None = None,
        *,
        smooth: bool = False,
    ) -> Node | None:
        """A node from a fit, with its evidence; None where the evidence is not finite."""
        evidence = evidence_of(self.problem, fitted, beside, smooth=smooth)
        value = evidence.whole + sum(shape_evidence)
        if not np.isfinite(value):
            return None
        if causes:
            value += self._by_raw(causes, value - self.null.log_evidence)
        return Node(fit=fitted, evidence=evidence, shape_evidence=shape_evidence, log_evidence=value, promise=value)

    def _by_raw(self, causes: Sequence[str], gained: float) -> float:
        """Log evidence [nats] of raw records for the causes beyond `gained`, the gain [nats] that averages of the same
        samples show already."""
        return sum(max(self._raw.get(slug, 0.0) - max(gained, 0.0), 0.0) for slug in causes)

    def _promise(self, parent: Alternative, node: Node) -> None:
        """Records the log weight [nats] that the screen about a node promises for the node's alternative with each
        further effect or axis of structure; an earlier, larger promise stays."""
        promises: dict[Key, tuple[float, Node, Start | None]] = {}
        for slug, kinds in starts(self._columns, node.evidence.screened).items():
            more = parent.and_effect(slug)
            if more is None or (parent != NOTHING and more in self.nodes):
                continue
            for start in kinds:
                value = node.log_evidence + start.promise + self._by_raw(more.causes, start.promise) + self.prior(more)
                kind = (slug, start.column.effect.stiff(start.column.shape))
                promises[more, tuple(sorted((*node.kind, kind)))] = (value, node, start)
        for axis, gained in node.evidence.structure.items():
            more = Alternative(parent.causes, axis)
            if more not in self.nodes:
                promises[more, ()] = (node.log_evidence + gained + self.prior(more), node, None)
        for more in dict.fromkeys(more for more, _ in promises):
            promised = log_sum([value for (other, _), (value, _, start) in promises.items() if other == more and start])
            self._nearest[more] = max(self._nearest.get(more, (-np.inf, -np.inf)), (node.log_evidence, promised))
        for key, promise in promises.items():
            if key not in self._promises or promise[0] > self._promises[key][0]:
                self._promises[key] = promise

    def posterior(self, raw: Sequence[RawEvidence], without: frozenset[str]) -> Posterior:
        """The posterior over all alternatives as far as they were searched. Alternatives that were not refitted have
        their screened weight about the likeliest parent, at most that of the best refitted one; an alternative whose
        refit failed is left out."""
        weights = self.weights()
        most = max(weights.values())
        for alternative, (_, promised) in self._nearest.items():
            if alternative not in self.nodes and alternative not in self._failed and not is_axis(alternative.unknown):
                weights[alternative] = min(promised, most)
        null = self.null
        # a line has its own phase in every test: what all tests have in common is the law's
        left = unlike(self.problem.design, left_over(self._null_problem, null.fit), null.fit.torque)
        swinging = [(record.effect, record.log_evidence) for record in raw if record.effect in LINES]
        for unknown, value in [(LINE, line_evidence(highest_line(self._null_problem, left))), *swinging]:
            line = Alternative((), unknown)
            weights[line] = max(null.log_evidence + value + self.prior(line), weights.get(line, -np.inf))
        outlier = Alternative((), OUTLIER)
        weights[outlier] = outlier_evidence(self._null_problem, null.fit) + self.prior(outlier)
        facts = self.problem.design.facts
        if not facts.temperature_measured and OIL_TEMPERATURE.slug not in without:
            warm = Alternative((OIL_TEMPERATURE.slug,))
            weights[warm] = null.log_evidence + temperature_evidence(self._null_problem, null.fit) + self.prior(warm)
            # oil of another temperature from some state on is oil of another viscosity as well
            changed = () if facts.oil_changes else [a for a in weights if OIL_CHANGE.slug in a.causes]
            for alternative in changed:
                causes = {*alternative.causes} - {OIL_CHANGE.slug} | {*warm.causes}
                twin = Alternative(tuple(sorted(causes)), alternative.unknown)
                weights[twin] = float(np.logaddexp(weights.get(twin, -np.inf), weights[alternative]))
        single = self.prior(Alternative(("",)))
        swings = {record.effect: record.log_evidence for record in raw if is_vibration(record)}
        isolabilities = self._isolabilities()
        merged, like_the_law = isolable(weights, isolabilities)
        return Posterior(
            weights={alternative: weight - null.log_evidence for alternative, weight in merged.items()},
            nodes={alternative: nodes[0] for alternative, nodes in self.nodes.items()},
            vibrations={slug: float(expit(value + single)) for slug, value in swings.items()},
            prior=self.prior,
            problem=self.problem,
            columns=tuple(self._columns),
            refits=self.refits,
            isolability=self._screened_isolability()
            | {
                slug: max(shares[slug] for shares in isolabilities.values() if slug in shares)
                for slug in {slug for shares in isolabilities.values() for slug in shares}
            },
            like_the_law=like_the_law,
        )

    def _isolabilities(self) -> dict[Alternative, dict[str, float]]:
        """Isolability ι of the effects of each refitted alternative, by slug."""
        return {
            alternative: {
                effect.effect.slug: share
                for effect, share in zip(nodes[0].fit.effects, nodes[0].evidence.isolability, strict=True)
            }
            for alternative, nodes in self.nodes.items()
        }

    def _screened_isolability(self) -> dict[str, float]:
        """Isolability ι of each screened effect, by slug, in its shape of highest promise beside nothing at work."""
        screened = self.null.evidence.screened
        best = {slug: kinds[0].column for slug, kinds in starts(self._columns, screened).items()}
        places = [next(k for k, column in enumerate(self._columns) if column is one) for one in best.values()]
        sizes = max(screened, key=lambda projected: projected.evidence).sizes
        shares = isolability(self._null_problem, self.null.fit, self._changes[:, places], sizes)
        return dict(zip(best, np.clip(shares, 0.0, 1.0).tolist(), strict=True))


def isolable(
    weights: Mapping[Alternative, float], isolabilities: Mapping[Alternative, Mapping[str, float]]
) -> tuple[dict[Alternative, float], dict[str, float]]:
    """Log weights [nats] of the explanations after causes that cannot be told from the law's form were merged into the
    explanation without them, and by cause the probability that was counted as the law's.

    A cause of which less than ISOLABLE is left beside the law's discrepancy is the law's: its explanation counts as the same
    without it, the least isolable first, and what is then left by its own ι (`isolabilities`, by explanation and slug). An
    explanation that was not refitted has the ι of its causes alone."""
    total = log_sum(list(weights.values()))
    merged: dict[Alternative, float] = {}
    like_the_law: dict[str, float] = {}
    for alternative, weight in weights.items():
        left = alternative
        while left.named:
            refitted = isolabilities.get(left)
            shares = [
                ((refitted or isolabilities.get(NOTHING.and_effect(slug) or NOTHING, {})).get(slug, 1.0), slug)
                for slug in left.named
            ]
            share, least = min(shares)
            if share >= criteria.ISOLABLE:
                break
            left = left.without(least)
            like_the_law[least] = like_the_law.get(least, 0.0) + float(np.exp(weight - total))
        merged[left] = float(np.logaddexp(merged.get(left, -np.inf), weight))
    return merged, like_the_law


def _shown(problem: FitProblem, fitted: PooledFit, columns: Sequence[Column]) -> tuple[list[Column], FloatArray]:
    """The columns of effects that change any reading, with their changes [N, m] Nm: a delay changes nothing without
    loops, a drift nothing without a clock."""
    changes = columns_at_rows(problem.design, fitted.prediction, columns)
    shown = {column.effect.slug for column, change in zip(columns, changes.T, strict=True) if change.any()}
    is_shown = [column.effect.slug in shown for column in columns]
    return list(compress(columns, is_shown)), changes[:, is_shown]


def is_vibration(record: RawEvidence) -> bool:
    """Whether a record shows a vibration of the catalogue."""
    return record.effect in BY_SLUG and BY_SLUG[record.effect].kind is EffectKind.VIBRATION


def posterior_of(baseline: Baseline, raw: Sequence[RawEvidence], without: frozenset[str] = frozenset()) -> Posterior:
    """Search the explanations of a baseline's campaign; effects `without` are not in the catalogue, and `raw` has none."""
    search = Search(baseline, raw, without)
    search.run()
    return search.posterior(raw, without)
