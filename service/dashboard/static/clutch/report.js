// @ts-check
// The one-page report: made beside the page whenever it changes, shown in print only, always in the light scheme.

import { sentence } from "../diagnosis/report.js";
import { byMeanCof } from "../quantities/criteria.js";
import { h, table } from "../shared/dom.js";
import { aboutCycles, estimate, fixed, interval, moment, percent, probability, words } from "../shared/format.js";
import { stateIcon, STATES } from "../shared/state.js";

/** @import { ClutchOut, DiagnosisOut, Receipt, RemainingLife, StribeckItem } from "../shared/types.js" */
/** @import { Board } from "./board.js" */

const LAST_TESTS = 6;
const LAST_EVENTS = 6;
const COLUMNS = ["Cycles", "Test", "Mean COF, mean of pressures", "Fits acceptable"];

/**
 * @param {HTMLElement} place
 * @param {{ clutch: ClutchOut, life: RemainingLife | null, tests: StribeckItem[], events: Receipt[], runs: Receipt[] }} answers
 * @param {Board} board
 * @param {DiagnosisOut | null} latest
 */
export function makeReport(place, { clutch, life, tests, events, runs }, board, latest) {
  if (life === null) return;
  const size = { width: 760, height: 255 };
  const drawings = [board.charts.fan, board.charts.remaining].map((chart) => chart.light({ ...size, scheme: "light" }));
  const { state } = clutch;
  const simulated = clutch.origin === "simulated" ? ", simulated" : "";
  const kind = `Wet clutch, ${clutch.friction_material} on ${clutch.reaction_plate}, ${clutch.fluid}${simulated}`;
  const values = facts(life, runs).flatMap(([name, value]) => [h("dt", {}, name), h("dd", {}, value)]);
  place.replaceChildren(
    h(
      "header",
      {},
      h("div", {}, h("h1", {}, clutch.clutch_id), h("p", {}, kind)),
      h("p", { class: "made" }, "Clutchlife", h("br"), moment(new Date().toISOString())),
    ),
    h("p", { class: "state" }, stateIcon(state.name), h("b", {}, STATES[state.name].word), ` – ${state.why}`),
    h("dl", { class: "facts" }, values),
    ...drawings.flatMap((src) => (src === null ? [] : [h("img", { src, alt: "" })])),
    h("p", {}, h("b", {}, "Diagnosis: "), diagnosisText(latest)),
    table("The last tests", COLUMNS, tests.slice(-LAST_TESTS).map(testRow), { shown: true }),
    events.length > 0 ? h("p", {}, h("b", {}, "Events: "), events.slice(-LAST_EVENTS).map(eventText).join("; ")) : "",
  );
}

/** @param {Receipt} event */
function eventText({ event, note, cycles: at }) {
  return `${words(event)}${note ? ` (${note.slice(0, 80)})` : ""} at ${fixed(at)} cycles`;
}

/** @param {DiagnosisOut | null} latest */
function diagnosisText(latest) {
  if (latest === null || latest.status === "running") return "not run.";
  if (latest.status === "failed") return `failed. ${latest.problem ?? ""}`;
  const earlier = latest.earlier_life ? "That was before the rebuild." : "";
  return `${sentence(latest)} ${latest.adopted ? "The extended model is adopted." : earlier}`;
}

/**
 * @param {RemainingLife} life
 * @param {Receipt[]} runs
 */
function facts(life, runs) {
  const { current, model, remaining_cycles: q } = life;
  const { criterion } = byMeanCof(life);
  const predicted = `${aboutCycles(q)} (90 %: ${interval(q)})`;
  const chance = probability(life.probability_of_reaching);
  const cof = estimate(current.mean_cof, current.mean_cof_sd);
  return [
    ["Remaining cycles", ["predicted", "may_never_reach"].includes(life.status) ? predicted : words(life.status)],
    ["What is certain", life.statement],
    ["Health", percent(current.health)],
    [
      "Mean COF",
      current.fraction_of_initial === null ? cof : `${cof} (${percent(current.fraction_of_initial, 1)} of new)`,
    ],
    ["Threshold", `${fixed(criterion.threshold_mean_cof, 4)} (${percent(criterion.fraction)} of new)`],
    ["Duty cycles so far", fixed(life.as_of_cycles)],
    ["Tests and runs", `${life.runs_used} tests, ${runs.length} runs`],
    ["Reaches end of life", `${chance} within ${fixed(life.horizon_cycles)} cycles`],
    ["Model", [words(model.name), ...model.effects.map(words)].join(", ")],
  ];
}

/** @param {StribeckItem} test */
function testRow({ cycles: at, run_id: id, fits }) {
  const cofs = fits.flatMap((fit) => (fit.mean_cof === null ? [] : [fit.mean_cof]));
  const mean = cofs.length > 0 ? cofs.reduce((sum, cof) => sum + cof, 0) / cofs.length : null;
  return [fixed(at), id, fixed(mean, 4), `${fits.filter((fit) => fit.acceptable).length} of ${fits.length}`];
}
