// The one-page report: made beside the page whenever it changes, shown in print only, always in the light scheme.

import { h, table } from "./dom.js";
import { cycles, fixed, interval, moment, percent, probability, withSd, words } from "./format.js";
import { sentence } from "./diagnosis_report.js";
import { openVerdict, stateIcon, STATES, stateOf } from "./state.js";

const LAST_TESTS = 6;

export function makeReport(place, { clutch, life, tests, events, runs }, charts, diagnosis) {
  if (life === null) return;
  const [fan, cof] = [charts.charts.fan, charts.charts.foretelling].map((chart) => chart.light({ width: 760, height: 255, scheme: "light" }));
  const latest = diagnosis?.latest ?? null;
  const state = stateOf(clutch.summary, openVerdict(latest));
  place.replaceChildren(
    h("header", {}, h("div", {}, h("h1", {}, clutch.clutch_id), h("p", {}, `Wet clutch, ${clutch.friction_material} on ${clutch.reaction_plate}, ${clutch.fluid}${clutch.origin === "simulated" ? ", simulated" : ""}`)),
      h("p", { class: "made" }, "Clutchlife", h("br"), moment(new Date().toISOString()))),
    h("p", { class: "state" }, stateIcon(state.name), h("b", {}, STATES[state.name].word), ` – ${state.why}`),
    h("dl", { class: "facts" }, facts(clutch, life, runs).flatMap(([name, value]) => [h("dt", {}, name), h("dd", {}, value)])),
    fan ? h("img", { src: fan, alt: "" }) : "", cof ? h("img", { src: cof, alt: "" }) : "",
    h("p", {}, h("b", {}, "Diagnosis: "), told(latest)),
    table("The last tests", ["Cycles", "Test", "Mean COF, mean of pressures", "Fits acceptable"], tests.slice(-LAST_TESTS).map(testRow), { shown: true }),
    events.length > 0 ? h("p", {}, h("b", {}, "Events: "), events.slice(-6).map((event) => `${words(event.event)}${event.note ? ` (${event.note.slice(0, 80)})` : ""} at ${fixed(event.cycles)} cycles`).join("; ")) : "");
}

function told(latest) {
  if (latest === null || latest.status === "running") return "not asked.";
  if (latest.status === "failed") return `failed. ${latest.problem ?? ""}`;
  const since = latest.adopted ? "The extended model is adopted." : latest.earlier_life ? "That was before the rebuild." : "";
  return `${sentence(latest)} ${since}`;
}

function facts(clutch, life, runs) {
  const q = life.remaining_cycles;
  return [
    ["Remaining cycles", life.status === "predicted" ? `${cycles(q["0.5"], q["0.05"], q["0.95"])} (90 %: ${interval(q)})` : words(life.status)],
    ["Health", percent(life.current.health)], ["Mean COF", `${withSd(life.current.mean_cof, life.current.mean_cof_sd)} (${percent(life.current.fraction_of_initial, 1)} of new)`],
    ["Threshold", `${fixed(life.criterion.threshold_mean_cof, 4)} (${percent(life.criterion.fraction)} of new)`],
    ["Duty cycles so far", fixed(life.as_of_cycles)], ["Tests and runs", `${life.runs_used} tests, ${runs.length} runs`],
    ["Reaches end of life", `${probability(life.probability_of_reaching)} within ${fixed(life.horizon_cycles)} cycles`],
    ["Model", [words(life.model.name), ...life.model.effects.map(words)].join(", ")]];
}

function testRow({ cycles: at, run_id: id, fits }) {
  const known = fits.filter((fit) => fit.mean_cof !== null);
  const mean = known.length > 0 ? known.reduce((sum, fit) => sum + fit.mean_cof, 0) / known.length : null;
  return [fixed(at), id, fixed(mean, 4), `${fits.filter((fit) => fit.acceptable).length} of ${fits.length}`];
}
