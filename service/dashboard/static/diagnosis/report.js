// A finished report in words and tables; remaining life before and after on one scale.

import { clutchPath } from "../shared/api.js";
import { h, quiet, scrolling, table } from "../shared/dom.js";
import { files } from "../shared/files.js";
import {
  counted,
  cycles,
  fixed,
  interval,
  median,
  moment,
  percent,
  probability,
  quantity,
  significant,
  withSd,
  words,
} from "../shared/format.js";
import { intervalBar, shareBar } from "../shared/sparkline.js";

/** @import { Content } from "../shared/dom.js" */

/** @type {Record<string, (causes: string) => string>} */
const SENTENCES = {
  model_adequate: () => "Nothing is left beyond noise and run-to-run scatter: the model is adequate.",
  cause_named: (causes) =>
    `The data disagree with the model, and ${causes} ${causes.includes(" and ") ? "account" : "accounts"} for it.`,
  cause_ambiguous: (causes) => `These runs leave open what is at work: ${causes}.`,
  unexplained_structure: () => "The data disagree with the model, and no cause in the catalogue accounts for it.",
  insufficient_data: () => "There is too little data for a verdict.",
};

const MOST_ROWS = 8;
/** Other candidates than the first are listed from this probability on, and axes up to this p, as `clutchlife diagnose` does. */
const [LEAST_PROBABILITY, MOST_P] = [0.05, 0.01];

/** @type {(diagnosis: DiagnosisOut) => HTMLElement[]} the report's elements */
export function report(diagnosis) {
  if (diagnosis.status === "failed") {
    const reason = diagnosis.problem ?? "";
    return [h("p.notice.bad", h("b", "The diagnosis failed. "), reason)];
  }
  const { verdict } = diagnosis;
  const notice = verdict === "model_adequate" ? "good" : verdict === "insufficient_data" ? "" : "bad";
  const date = `${moment(diagnosis.created_at)}, of the runs up to ${cycles(diagnosis.as_of_cycles, 0, 20)} cycles.`;
  return [
    h(
      "div",
      { class: `notice ${notice}` },
      h("p.verdict", h("b", `${heading(diagnosis)}. `), sentence(diagnosis)),
      diagnosis.summary ? h("p", diagnosis.summary) : null,
      quiet(date, outdated(diagnosis)),
    ),
    h("div.columns", ...Object.values(PARTS).map((part) => part(diagnosis))),
  ];
}

/** @param {DiagnosisOut} diagnosis */
function outdated({ earlier_life: earlier, stale }) {
  if (earlier) return h("b", " The clutch was rebuilt after this diagnosis, which concerns the earlier life.");
  return stale ? h("b", " Runs were added after this diagnosis: start a new one.") : null;
}

/** @typedef {{ verdict: string | null, causes?: string[] }} Judged */

/** @type {(diagnosis: Judged) => string} */
export const heading = ({ verdict }) => (verdict === "insufficient_data" ? "Too little data" : words(verdict));

/** @type {(diagnosis: Judged) => string} the verdict as a sentence */
export function sentence({ verdict, causes = [] }) {
  const names = causes.map((cause) => (cause === "uncatalogued" ? "an unknown cause" : words(cause).toLowerCase()));
  const last = names.at(-1) ?? "the named cause";
  const between = verdict === "cause_ambiguous" ? "or" : "and";
  const joined = names.length > 1 ? `${names.slice(0, -1).join(", ")} ${between} ${last}` : last;
  return SENTENCES[verdict ?? ""]?.(joined) ?? "";
}

/** @type {(title: string, ...content: Content[]) => HTMLElement} */
const part = (title, ...content) => h("div.part", h("h3", title), ...content);

/**
 * Log evidence in a word (thresholds of Kass and Raftery, 1 and 3 in natural logarithms); the number under the pointer.
 * @param {number | null} value
 */
function evidence(value) {
  if (value === null) return "–";
  const word = value < 0 ? "none" : value < 1 ? "weak" : value < 3 ? "moderate" : "strong";
  return h("span", { title: `log evidence ${fixed(value, 1)}` }, word);
}

/** @param {GainOut} gained */
function errorGain(gained) {
  if (gained.rmse_before_nm === null || gained.rmse_before_nm === undefined) return null;
  const count = gained.held_out_runs?.length ?? 0;
  const [before, after] = [gained.rmse_before_nm, gained.rmse_after_nm].map((rmse) => significant(rmse, 3));
  const scores = [
    scoreText("on the runs that were left out of the fit", gained.log_score_gain),
    scoreText("in predicting the last tests from the earlier ones", gained.prediction_log_score_gain),
  ];
  return h(
    "p",
    { title: scores.filter(Boolean).join("; ") || null },
    h("b", `${fixed(gained.reduction_percent)} % less error`),
    ` on ${counted(count, "run that was", "runs that were")} left out of the fit: ${before} → ${after} Nm RMS.`,
  );
}

/** @type {(place: string, gained: number | null | undefined) => string} */
const scoreText = (place, gained) =>
  gained === null || gained === undefined ? "" : `log score ${gained >= 0 ? "+" : ""}${fixed(gained, 1)} ${place}`;

const VISIBLE =
  "For each effect, the smallest size that these runs can show: in its least visible shape, and in its most visible shape. " +
  "No number means that the least visible shape stays hidden at any size.";

/** @type {Record<string, (diagnosis: DiagnosisOut) => HTMLElement | null>} */
const PARTS = {
  candidates({ candidates: all = [], causes = [] }) {
    if (all.length === 0) return null;
    const likely = all.filter((each, at) => at === 0 || (each.probability ?? 0) >= LEAST_PROBABILITY);
    const rows = likely.slice(0, MOST_ROWS).map(({ effect, title, probability: chance, estimate }) => {
      const name = estimate?.name ? `${words(estimate.name)} ` : "";
      return [
        h("span", { class: causes.includes(effect) ? "named" : null, title: effect }, title || words(effect)),
        h("span.chance", shareBar(chance ?? 0, { class: "likely" }), probability(chance)),
        estimate ? `${name}${withSd(estimate.value, estimate.sd)} ${estimate.unit.replace(/^[-1]$/, "")}` : "–",
      ];
    });
    const columns = ["Cause", "Probability", "Estimate"];
    return h("div.part.wide", h("h3", "Candidates"), scrolling("Candidates", table("Candidate causes", columns, rows)));
  },

  fitness({ baseline, extended }) {
    if (!baseline) return null;
    /** @type {(name: string, misfit: MisfitOut) => string[]} */
    const line = (name, misfit) => [
      name,
      significant(misfit.rmse_nm, 3),
      significant(misfit.noise_nm, 3),
      percent(misfit.unexplained_share, 1),
    ];
    const rows = [line("Baseline", baseline), ...(extended ? [line("Extended", extended)] : [])];
    return part("Fit to all runs", table("Fit", ["Model", "RMSE, Nm", "Noise, Nm", "Unexplained"], rows));
  },

  gain({ gain: gained }) {
    if (!gained) return null;
    const bars = gained.remaining_useful_life ? lifeBars(gained.remaining_useful_life) : null;
    const error = errorGain(gained);
    if (error === null && bars === null) return null;
    return part("Gain on runs that were left out of the fit", error, bars && h("h4", "Remaining cycles"), bars);
  },

  law({ friction_law: law, like_the_law: like = [] }) {
    if (!law) return null;
    const [low, high] = law.interval_percent;
    const band = law.where[0];
    const lines = [
      `The friction curve differs from eq. 3 by ${significant(law.rms_percent, 2)} % RMS (90 %: ${significant(low, 2)} to ${significant(high, 2)} %).`,
      band && `${percent(band.share)} of it lies from ${fixed(band.from_rpm)} to ${fixed(band.to_rpm)} rpm.`,
      law.gain?.reduction_percent != null &&
        `On runs left out of the fit the curve as found has ${law.gain.reduction_percent < 0.5 ? "no" : `${fixed(law.gain.reduction_percent)} %`} less error than eq. 3.`,
      like.length > 0 &&
        `These tests cannot tell this from the form of the curve: ${like.map((cause) => words(cause).toLowerCase()).join(", ")}.`,
    ];
    return part("The friction law", ...lines.filter(Boolean).map((line) => h("p", line)));
  },

  where({ baseline }) {
    const axes = (baseline?.where ?? []).filter(({ p_value: p }) => p !== null && p < MOST_P);
    if (axes.length === 0) return null;
    const rows = axes.slice(0, MOST_ROWS).map(({ axis, strength, p_value: p }) => {
      return [quantity(axis), evidence(strength), (p ?? 0) < 0.001 ? "< 0.001" : significant(p, 2)];
    });
    return part("Where the baseline model is wrong", table("Where", ["Along", "Evidence", "p"], rows));
  },

  advice({ advice: tests = [], clutch_id: clutch, diagnosis_id: name }) {
    if (tests.length === 0) return null;
    const items = tests.map(({ test, separates, narrows }) => {
      const [cause, other] = separates.map((effect) => words(effect).toLowerCase());
      const use = narrows
        ? `narrows the size of ${cause} to ${percent(narrows)} of its present uncertainty`
        : `distinguishes ${cause} from ${other === "baseline" ? "no effect at all" : other}`;
      return h("li", h("b", test), h("span.quiet", `: ${use}`));
    });
    const choice = tests.length > 1 ? h("p", "One of these is enough; the best comes first.") : null;
    const plan = files(`${clutch}-plan`, `${clutchPath(clutch)}/diagnoses/${name}/plan.csv`);
    return part("What to test next", choice, h("ol", items), quiet("The plan for the rig: ", plan));
  },

  notes({ notes: all = [] }) {
    const items = all.map((note) => h("li", note));
    return items.length > 0 ? part("Notes", h("ul", items)) : null;
  },

  visible({ visible: all = [] }) {
    if (all.length === 0) return null;
    const rows = all.map(({ effect, amplitude, least, unit }) => [
      words(effect),
      significant(amplitude, 3),
      significant(least, 3),
      unit ?? "",
    ]);
    const label = "Smallest visible sizes";
    return h(
      "details.part",
      h("summary", "What these runs can show"),
      quiet(VISIBLE),
      scrolling(label, table(label, ["Effect", "For every shape", "For the most visible", "Unit"], rows)),
    );
  },
};

/** @typedef {Quantiles | { remaining_cycles?: Quantiles } | null | undefined} Answer quantiles by name, or what holds them */

/**
 * A bar for each; null where either answer holds no quantiles.
 * @type {(answers: { before: Answer, after: Answer }, names?: string[]) => HTMLElement | null}
 */
export function lifeBars({ before, after }, names = ["Before", "After"]) {
  const both = [before, after].map(quantilesOf).filter((quantiles) => quantiles !== null);
  if (both.length < 2) return null;
  const ends = both.map((q) => q["0.95"] ?? 1.6 * (q["0.5"] ?? q["0.05"] ?? 0));
  const scale = 1.05 * Math.max(1, ...ends);
  const rows = both.flatMap((q, index) => [
    h("dt", names[index]),
    h("dd", h("b", median(q)), h("span.quiet", ` (90 %: ${interval(q)})`), intervalBar(q, scale)),
  ]);
  return h("dl.lifebars", rows);
}

/** @type {(answer: Answer) => Quantiles | null} missing quartiles are taken from the 90 % interval */
function quantilesOf(answer) {
  const quantiles = /** @type {Quantiles | null | undefined} */ (answer?.remaining_cycles ?? answer);
  if (!quantiles || quantiles["0.5"] === undefined) return null;
  const quartiles = { 0.25: quantiles["0.05"] ?? null, 0.75: quantiles["0.95"] ?? null };
  return { 0.05: null, 0.95: null, ...quartiles, ...quantiles };
}
