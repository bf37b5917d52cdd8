// One clutch in the fleet's table.

import { h } from "./dom.js";
import { age, cycles, fixed, interval, kindName, percent, words } from "./format.js";
import { healthBar, intervalBar, sparkline } from "./sparkline.js";
import { openVerdict, stateIcon, stateOf, VERDICTS } from "./state.js";

export const COLUMNS = ["State", "Clutch", "Health", "Remaining cycles, 90 % interval", "Mean COF over cycles", "Last run", "Diagnosis"];

/** How a clutch stands: its state, and why. */
export function standing(clutch) {
  return { clutch, state: stateOf(clutch.summary, openVerdict(clutch.diagnosis)) };
}

/** The row; `scale` is the cycles at the right end of every interval's bar. */
export function row({ clutch, state, word }, scale) {
  const cell = (name, ...content) => h("td", { role: "cell", "data-label": name }, ...content);
  return h("tr", { role: "row", "data-clutch": clutch.clutch_id },
    cell("State", h("span", { class: "state" }, stateIcon(state.name), h("span", {}, word, h("small", {}, state.why)))),
    h("th", { role: "rowheader", scope: "row", "data-label": "Clutch" },
      h("a", { href: `/clutches/${encodeURIComponent(clutch.clutch_id)}` }, clutch.clutch_id),
      clutch.origin === "simulated" ? h("span", { class: "tag" }, "simulated") : null,
      h("small", {}, `${clutch.friction_material} on ${clutch.reaction_plate}`)),
    cell("Health", ...health(clutch.summary, state.name)),
    cell("Remaining", ...remaining(clutch.summary, scale)),
    cell("Mean COF", ...meanCof(clutch)),
    cell("Last run", ...lastRun(clutch)),
    cell("Diagnosis", ...diagnosis(clutch)));
}

function health(summary, state) {
  const value = summary?.current.health ?? null;
  if (value === null) return ["–"];
  return [h("span", { class: "number" }, percent(value)), healthBar(value, state)];
}

function remaining(summary, scale) {
  if (summary === null || summary.status === "insufficient_data") return ["–", h("small", {}, "after three tests")];
  if (summary.status === "reached") return [h("span", { class: "number" }, "0"), h("small", {}, "reached")];
  const q = summary.remaining_cycles;
  const middle = q["0.5"] === null ? "may never come" : cycles(q["0.5"], q["0.05"], q["0.95"]);
  return [h("span", { class: "number" }, middle), intervalBar(q, scale), h("small", {}, interval(q))];
}

function meanCof(clutch) {
  const now = clutch.summary?.current ?? null;
  if (now === null || now.mean_cof === null) return ["–"];
  const threshold = now.fraction_of_initial ? (clutch.end_of_life.cof_fraction * now.mean_cof) / now.fraction_of_initial : null;
  return [
    sparkline(clutch.recent?.mean_cof ?? [], threshold),
    h("span", { class: "beside" }, h("span", { class: "number" }, fixed(now.mean_cof, 4)), h("small", {}, `${percent(now.fraction_of_initial)} of new`))];
}

function lastRun(clutch) {
  const last = clutch.recent?.last_run ?? null;
  if (last === null) return ["none"];
  const when = Date.parse(last.at);
  return [
    h("time", { datetime: last.at, title: new Date(when).toLocaleString("en-GB"), "data-age": String(when) }, age(when)),
    h("small", {}, `${kindName(last.kind)} at ${cycles(last.cycles, 0, 20)} cycles`)];
}

function diagnosis(clutch) {
  const found = clutch.diagnosis ?? null;
  if (found === null) return [h("span", { class: "quiet" }, "not asked")];
  const causes = (found.causes ?? []).map(words).join(", ");
  return [h("a", { href: `/clutches/${encodeURIComponent(clutch.clutch_id)}#diagnosis` }, VERDICTS[found.verdict] ?? words(found.verdict)),
    h("small", {}, [causes, found.adopted ? "adopted" : "", found.earlier_life ? "before the rebuild" : ""].filter(Boolean).join(" · "))];
}
