// The one-page report: made beside the page whenever it changes, shown in print only, always in the light scheme.

import { sentence } from "../diagnosis/report.js";
import { byMeanCof, predicts } from "../quantities/criteria.js";
import { h, table } from "../shared/dom.js";
import { atLeast, counted, estimate, fixed, likely, moment, percent, probability, words } from "../shared/format.js";
import { stateIcon } from "../shared/state.js";

/** @import { Chart } from "../charts/chart.js" */

/** The service's release, which the page names. */
const RELEASE = document.querySelector("meta[name=release]")?.getAttribute("content") ?? "";
/** Tests and events that are listed. */
const LAST = 6;
const COLUMNS = ["Cycles", "Test", "Mean COF, measured", "Fits acceptable"];

/**
 * What is known of the clutch; before its overview was read, itself alone.
 * @param {HTMLElement} place
 * @param {{ clutch: ClutchOut, life?: RemainingLife, tests?: StribeckItem[], events?: Receipt[], charts?: Chart[] }} answers
 */
export function makeReport(place, { clutch, life, tests = [], events = [], charts = [] }) {
  const drawn = charts.filter(({ spec }) => spec?.figure).map((chart) => chart.light({ width: 760, height: 255 }));
  const { state, headline, action } = clutch;
  const simulated = clutch.origin === "simulated" ? ", simulated" : "";
  const kind = `Wet clutch, ${clutch.friction_material} on ${clutch.reaction_plate}, ${clutch.fluid}${simulated}`;
  const values = life ? facts(clutch, life).flatMap(([name, value]) => [h("dt", name), h("dd", value)]) : [];
  const last = tests.slice(-LAST);
  const done = events.slice(-LAST).map(({ event, note, cycles: at }) => {
    return `${words(event)}${note ? ` (${note.slice(0, 80)})` : ""} at ${fixed(at)} cycles`;
  });
  place.replaceChildren(
    h(
      "header",
      h("div", h("h1", clutch.clutch_id), h("p", kind)),
      h("p.made", `Clutchlife ${RELEASE}`, h("br"), moment(new Date().toISOString())),
    ),
    h("p.state", stateIcon(state.name), h("span", headline)),
    h("p.action", action),
    h("dl.facts", values),
    ...drawn,
    h("p", h("b", "Diagnosis: "), diagnosisText(clutch.diagnosis)),
    last.length > 0 ? table("The last tests", COLUMNS, last.map(testRow), { shown: true }) : "",
    done.length > 0 ? h("p", h("b", "Events: "), done.join("; ")) : "",
    h("p.basis", h("b", "Made of: "), basis(clutch, life, tests)),
  );
}

/** @type {(clutch: ClutchOut, life: RemainingLife | undefined, tests: StribeckItem[]) => string} */
function basis(clutch, life, tests) {
  const { severity, geometry, revision } = clutch;
  const disc = `${geometry.inner_diameter_mm}/${geometry.outer_diameter_mm} mm, ${geometry.friction_faces} faces, pressure factor ${geometry.pressure_factor}`;
  return [
    `Clutchlife ${RELEASE}`,
    life ? `${life.method} filter, horizon ${fixed(life.horizon_cycles)} cycles` : "",
    `ageing counted in ${severity.basis.replaceAll("_", " ")}`,
    disc,
    `revision ${revision} of the clutch's data, ${counted(clutch.runs, "run")}`,
    tests.length > 0 ? `tests ${tests[0].run_id} to ${tests[tests.length - 1].run_id}` : "",
  ]
    .filter(Boolean)
    .join("; ");
}

/** @param {ClutchOut["diagnosis"]} latest */
function diagnosisText(latest) {
  if (latest === null) return "not run.";
  const earlier = latest.earlier_life ? "That was before the rebuild." : "";
  return `${sentence(latest)} ${latest.adopted ? "Its model is adopted." : earlier}`;
}

/** @type {(clutch: ClutchOut, life: RemainingLife) => string[][]} */
function facts(clutch, life) {
  const { current, model } = life;
  const { criterion } = byMeanCof(life);
  const share = current.fraction_of_initial;
  const predicted = `${atLeast(life.at_least)}; ${likely(life.remaining_cycles)}`;
  const chance = probability(life.probability_of_reaching);
  const cof = estimate(current.mean_cof, current.mean_cof_sd);
  return [
    ["Remaining cycles", predicts(life) ? predicted : words(life.status)],
    ["Health", percent(current.health)],
    share === null ? ["Mean COF, measured", cof] : ["Mean COF, tracked", `${cof} (${percent(share, 1)} of new)`],
    ["Threshold", `${fixed(criterion.threshold_mean_cof, 4)} (${percent(criterion.fraction)} of new)`],
    ["Duty cycles so far", fixed(life.as_of_cycles)],
    ["Tests and runs", `${counted(life.runs_used, "test")}, ${counted(clutch.runs, "run")}`],
    ["Reaches end of life", `${chance} within ${fixed(life.horizon_cycles)} cycles`],
    ["Corrected for", model.effects.length > 0 ? model.effects.map(words).join(", ") : "nothing"],
  ];
}

/** @param {StribeckItem} test */
function testRow({ cycles: at, run_id: id, fits }) {
  const cofs = fits.flatMap((fit) => (fit.mean_cof === null ? [] : [fit.mean_cof]));
  const mean = cofs.length > 0 ? cofs.reduce((sum, cof) => sum + cof, 0) / cofs.length : null;
  return [fixed(at), id, fixed(mean, 4), `${fits.filter((fit) => fit.acceptable).length} of ${fits.length}`];
}
