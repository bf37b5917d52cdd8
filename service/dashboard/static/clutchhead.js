// Where the clutch stands, in one look.

import { h } from "./dom.js";
import { cycles, fixed, interval, percent, probability, withSd, words } from "./format.js";
import { healthBar } from "./sparkline.js";
import { stateIcon, STATES } from "./state.js";

export function head(clutch, life, state) {
  const tile = (name, value, ...more) => h("div", { class: "tile" }, h("dt", {}, name), h("dd", {}, h("span", { class: "big" }, value), ...more));
  const q = life?.remaining_cycles;
  const disc = clutch.geometry;
  const [cof, deviation] = withSd(life?.current.mean_cof, life?.current.mean_cof_sd).split(" ± ");
  return [
    h("div", { class: "title" },
      h("h1", {}, clutch.clutch_id, clutch.origin === "simulated" ? h("span", { class: "tag" }, "simulated") : null),
      h("p", { class: `verdict state state-${state.name}` }, stateIcon(state.name), h("b", {}, STATES[state.name].word), h("span", { class: "quiet" }, state.why)),
      h("p", { class: "quiet" }, `${words(clutch.friction_material)} on ${clutch.reaction_plate}, ${clutch.fluid}; ${fixed(disc.inner_diameter_mm)}/${fixed(disc.outer_diameter_mm)} mm, ${disc.friction_faces} ${disc.friction_faces === 1 ? "face" : "faces"}; end of life at ${percent(clutch.end_of_life.cof_fraction)} of the new mean COF`)),
    life === null ? null : h("dl", { class: "tiles" },
      tile("Health", percent(life.current.health), life.current.health === null ? null : healthBar(life.current.health, state.name)),
      tile("Remaining cycles", remaining(life), h("small", {}, life.status === "predicted" ? `90 %: ${interval(q)}` : words(life.status))),
      tile("Mean COF", cof, h("small", {}, deviation ? `± ${deviation}; ` : "", `${percent(life.current.fraction_of_initial, 1)} of new`)),
      tile("Duty cycles so far", fixed(life.as_of_cycles), h("small", {}, `${life.runs_used} ${life.runs_used === 1 ? "test" : "tests"} used, ${clutch.runs} runs`)),
      tile("Reaches end of life", probability(life.probability_of_reaching), h("small", {}, `within ${fixed(life.horizon_cycles)} cycles`)),
      tile("Model", words(life.model.name), h("small", {}, life.model.effects.length > 0 ? life.model.effects.map(words).join(", ") : "without extension")))];
}

function remaining({ status, remaining_cycles: q }) {
  if (status === "insufficient_data") return "–";
  if (status === "reached") return "0";
  return q["0.5"] === null ? "may never end" : cycles(q["0.5"], q["0.05"], q["0.95"]);
}
