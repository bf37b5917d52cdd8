// @ts-check
// The state of a clutch in one look: title, verdict, tiles.

import { limitText, placeText } from "../quantities/criteria.js";
import { h } from "../shared/dom.js";
import { aboutCycles, atLeast, estimate, fixed, interval, percent, probability, words } from "../shared/format.js";
import { healthBar } from "../shared/sparkline.js";
import { heldText, stateIcon, STATES } from "../shared/state.js";

/** @import { Content } from "../shared/dom.js" */
/** @import { ClutchOut, CourseShare, RemainingLife } from "../shared/types.js" */

/**
 * @param {ClutchOut} clutch
 * @param {RemainingLife | null} life null before the first run
 * @param {{ archive: () => unknown, end: () => unknown }} asks whether the clutch is to be archived; about its end
 * @returns {HTMLElement[]}
 */
export function head(clutch, life, { archive, end }) {
  const { state } = clutch;
  const simulated = clutch.origin === "simulated" && h("span", { class: "tag" }, "simulated");
  const title = h(
    "div",
    { class: "title" },
    h("h1", {}, clutch.clutch_id, simulated),
    h(
      "p",
      { class: `verdict state state-${state.name}` },
      stateIcon(state.name),
      h("b", {}, STATES[state.name].word),
      h("span", { class: "quiet" }, state.why),
      clutch.held > 0 && h("a", { href: "#held", class: "mark-held" }, heldText(clutch.held)),
    ),
    h("p", { class: "quiet" }, description(clutch)),
    h(
      "div",
      { class: "buttons start" },
      clutch.archived || life === null
        ? null
        : h(
            "button",
            { type: "button", class: "small", onclick: end },
            life.ended ? "Take the end back …" : "End of life …",
          ),
      clutch.archived ? null : h("button", { type: "button", class: "small", onclick: archive }, "Archive …"),
    ),
  );
  return life === null ? [title] : [title, h("dl", { class: "tiles" }, tiles(clutch, life))];
}

/** @param {ClutchOut} clutch */
function description({ friction_material: material, reaction_plate: plate, fluid, geometry, end_of_life: end }) {
  const { inner_diameter_mm: inner, outer_diameter_mm: outer, friction_faces: faces } = geometry;
  const disc = `${fixed(inner)}/${fixed(outer)} mm, ${faces} ${faces === 1 ? "face" : "faces"}`;
  const limits = end.criteria.map((criterion) => `${placeText(criterion)} (${limitText(criterion)})`);
  const limit =
    limits.length > 0
      ? `end of life at the first of ${limits.join(" and ")}`
      : `end of life at ${percent(end.cof_fraction)} of the new mean COF`;
  return `${words(material)} on ${plate}, ${fluid}; ${disc}; ${limit}`;
}

/**
 * @param {ClutchOut} clutch
 * @param {RemainingLife} life
 */
function tiles(clutch, life) {
  const { current, model, status } = life;
  const { health } = current;
  const [cof, deviation] = estimate(current.mean_cof, current.mean_cof_sd).split(" ± ");
  const spread = deviation ? `± ${deviation}; ` : "";
  const lasts = status === "reached" ? "the end of life is reached" : atLeast(life.at_least);
  const certain = life.ended ? `ended at ${fixed(life.ended.cycles)} cycles` : lasts;
  const quantiles = ["insufficient_data", "reached", "ended"].includes(status)
    ? ""
    : `90 %: ${interval(life.remaining_cycles)}; `;
  const share = current.fraction_of_initial;
  const at = current.mean_cof === null ? "" : `as measured at ${fixed(current.measured_at_cycles)} cycles`;
  const used = `${life.runs_used} ${life.runs_used === 1 ? "test" : "tests"} used, ${clutch.runs} runs`;
  const effects = model.effects.length > 0 ? model.effects.map(words).join(", ") : "without extension";
  return [
    tile("Health", percent(health), health === null ? null : healthBar(health, clutch.state.name)),
    tile(
      "Remaining cycles",
      remaining(life),
      small(quantiles + certain + heldRuns(life.held_runs) + backCast(life.back_cast) + endedLives(life.ended_lives)),
    ),
    tile("Mean COF", cof, small(spread + (share === null ? at : `${percent(share, 1)} of new`))),
    tile("Duty cycles so far", fixed(life.as_of_cycles), small(used)),
    tile(
      "Reaches end of life",
      probability(life.probability_of_reaching),
      small(`within ${fixed(life.horizon_cycles)} cycles`),
    ),
    tile(
      "Course",
      life.course ? COURSES[life.course.name] : "–",
      small(life.course ? course(life.course) : life.runs_used > 2 ? "of mean COF only" : "too few tests"),
    ),
    tile("Model", words(model.name), small(effects)),
  ];
}

/** @param {RemainingLife["held_runs"]} held */
const heldRuns = (held) => (held ? `; ${aboutCycles(held.remaining_cycles)} with ${heldText(held.count)}` : "");

const COURSES = { eq6: "As eq. 6", slowing: "Slowing down", accelerating: "Accelerating" };

/** @param {CourseShare} share */
const course = ({ probability: p, order }) => `${percent(p)} sure, order ${fixed(order, 1)}`;

/** @param {RemainingLife["back_cast"]} count */
const backCast = (count) =>
  count && count.of > 0 ? `; earlier forecasts held ${count.held} of ${count.of} tests` : "";

/** @param {number} count */
const endedLives = (count) => (count > 0 ? `; calibrated by ${count} lives that ended` : "");

/** @param {string} text */
const small = (text) => h("small", {}, text);

/**
 * @param {string} name
 * @param {string} value
 * @param {Content} more
 */
const tile = (name, value, more) =>
  h("div", { class: "tile" }, h("dt", {}, name), h("dd", {}, h("span", { class: "big" }, value), more));

/** @param {RemainingLife} life */
function remaining({ status, remaining_cycles: q, ended }) {
  if (ended) return ended.reason === "worn" ? "0" : "–";
  if (status === "insufficient_data") return "–";
  if (status === "reached") return "0";
  return aboutCycles(q);
}
