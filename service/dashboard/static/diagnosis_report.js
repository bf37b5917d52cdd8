// A finished report in words and tables.

import { h, svg, table } from "./dom.js";
import { cycles, fixed, moment, percent, probability, quantity, significant, withSd, words } from "./format.js";
import { lifeBars } from "./lifebars.js";
import { VERDICTS } from "./state.js";

const SENTENCES = {
  model_adequate: () => "Nothing is left beyond noise and run-to-run scatter: the model is adequate.",
  cause_named: (causes) => `The data disagree with the model, and ${causes} ${causes.includes(" and ") ? "account" : "accounts"} for it.`,
  cause_ambiguous: (causes) => `The data disagree with the model; ${causes} cannot be told apart with these runs.`,
  unexplained_structure: () => "The data disagree with the model, and no cause in the catalogue accounts for it.",
  insufficient_data: () => "There is too little data to answer.",
};
const SHAPE = { model_adequate: "good", cause_named: "bad", cause_ambiguous: "bad", unexplained_structure: "bad", insufficient_data: "" };

/** The report's elements. */
export function report(found) {
  if (found.status === "failed") return [h("p", { class: "notice bad" }, h("b", {}, "The diagnosis failed. "), found.problem ?? "")];
  return [
    h("div", { class: `notice ${SHAPE[found.verdict] ?? ""}` },
      h("p", { class: "verdict" }, h("b", {}, `${VERDICTS[found.verdict] ?? words(found.verdict)}. `), sentence(found)),
      found.summary ? h("p", {}, found.summary) : null,
      h("p", { class: "quiet" }, `${moment(found.created_at)}, of the runs up to ${cycles(found.as_of_cycles, 0, 20)} cycles.`, found.earlier_life ? h("b", {}, " The clutch has been rebuilt since: this is of its earlier life.") : found.stale ? h("b", {}, " Runs have come since: run it again.") : null)),
    h("div", { class: "columns" }, candidates(found), fitness(found), gain(found), where(found), advice(found), notes(found), visible(found))];
}

export function sentence({ verdict, causes = [] }) {
  const named = causes.map((cause) => words(cause).toLowerCase());
  const joined = named.length > 1 ? `${named.slice(0, -1).join(", ")} and ${named.at(-1)}` : named[0] ?? "the named cause";
  return SENTENCES[verdict]?.(joined) ?? "";
}

const part = (title, ...content) => h("div", { class: "part" }, h("h3", {}, title), ...content);

function candidates({ candidates: found = [], causes = [] }) {
  if (found.length === 0) return null;
  const rows = found.slice(0, 8).map((each) => [
    h("span", { class: causes.includes(each.effect) ? "named" : null, title: each.effect }, each.title || words(each.effect)),
    h("span", { class: "chance" }, chance(each.probability), probability(each.probability)),
    fixed(each.log_evidence_gain, 1),
    each.estimate ? `${each.estimate.name ? `${words(each.estimate.name)} ` : ""}${withSd(each.estimate.value, each.estimate.sd)} ${each.estimate.unit.replace(/^[-1]$/, "")}` : "–"]);
  return h("div", { class: "part wide" }, h("h3", {}, "Candidates"), h("div", { class: "scroll", tabindex: "0", role: "group", "aria-label": "Candidates" }, table("Candidate causes", ["Cause", "Probability", "Evidence gain, nats", "Estimate"], rows)));
}

const chance = (value) => svg("svg", { viewBox: "0 0 60 8", width: 60, height: 8, "aria-hidden": "true" }, svg("rect", { class: "axis", width: 60, height: 8, rx: 3 }), svg("rect", { class: "fill", width: (60 * (value ?? 0)).toFixed(1), height: 8, rx: 3 }));

function fitness({ baseline, extended }) {
  if (!baseline) return null;
  const line = (name, told) => [name, significant(told.rmse_nm, 3), significant(told.noise_nm, 3), percent(told.unexplained_share, 1)];
  return part("Fit to all runs", table("Fit", ["Model", "RMSE, Nm", "Noise, Nm", "Unexplained"], [line("Baseline", baseline), ...(extended ? [line("Extended", extended)] : [])], { shown: false }));
}

function gain({ gain: found }) {
  if (!found) return null;
  const bars = found.remaining_useful_life ? lifeBars(found.remaining_useful_life) : null;
  const held = found.held_out_runs?.length ?? 0;
  const told = found.rmse_before_nm === null || found.rmse_before_nm === undefined ? null : h("p", {},
    h("b", {}, `${fixed(found.reduction_percent)} % less error`), ` on ${held} held-out ${held === 1 ? "run" : "runs"}: ${significant(found.rmse_before_nm, 3)} → ${significant(found.rmse_after_nm, 3)} Nm; log score ${found.log_score_gain >= 0 ? "+" : ""}${fixed(found.log_score_gain, 1)} nats.`);
  return told === null && bars === null ? null : part("Gain on runs held out", told, bars ? h("h4", {}, "Remaining cycles") : null, bars);
}

function where({ baseline }) {
  const found = baseline?.where ?? [];
  if (found.length === 0) return null;
  const rows = found.slice(0, 8).map((each) => [quantity(each.axis), significant(each.strength, 3), each.p_value < 0.001 ? "< 0.001" : significant(each.p_value, 2)]);
  return part("Where the baseline falls short", table("Where", ["Along", "Strength", "p"], rows));
}

function advice({ advice: found = [] }) {
  if (found.length === 0) return null;
  return part("The test that would decide", h("ul", {}, found.map((each) => h("li", {}, h("b", {}, each.test), each.separates?.length ? h("span", { class: "quiet" }, ` tells ${each.separates.map((name) => words(name).toLowerCase()).join(" from ")}`) : null))));
}

function notes({ notes: found = [] }) {
  return found.length > 0 ? part("Notes", h("ul", {}, found.map((note) => h("li", {}, note)))) : null;
}

function visible({ visible: found = [] }) {
  if (found.length === 0) return null;
  const rows = found.map((each) => [words(each.effect), significant(each.amplitude, 3), each.unit ?? ""]);
  return h("details", { class: "part" }, h("summary", {}, "What these runs would show"), h("p", { class: "quiet" }, "The smallest amplitude that would be seen, each effect in the middle one of its shapes, worked out before any residual was looked at."),
    h("div", { class: "scroll", tabindex: "0", role: "group", "aria-label": "Smallest visible amplitudes" }, table("Smallest visible amplitudes", ["Effect", "Amplitude", "Unit"], rows)));
}
