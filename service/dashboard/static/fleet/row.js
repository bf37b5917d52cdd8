// One clutch in the fleet's table.

import { h } from "../shared/dom.js";
import { age, atLeast, cycles, fixed, kindName, likely, percent, words } from "../shared/format.js";
import { intervalBar, shareBar, sparkline } from "../shared/sparkline.js";
import { colourOf, heldText, stateIcon, STATES, VERDICTS } from "../shared/state.js";

/** @import { Content } from "../shared/dom.js" */
/** @import { StateName } from "../shared/state.js" */

/** @type {[Content, string][]} a column's title and width */
export const COLUMNS = [
  [h("span.hidden", "Choose"), "44px"],
  ["State", "18%"],
  ["Clutch", "15%"],
  ["Health", "8%"],
  ["Remaining cycles", "13.5%"],
  ["Mean COF over cycles", "15.5%"],
  ["Last run", "13%"],
  ["Diagnosis", ""],
];

/**
 * The row; `scale` is the cycles at the right end of every interval's bar, `group` the kind that begins with it.
 * @param {ClutchOut} clutch
 * @param {{ scale: number, group: string | null, chosen: boolean, choose: (chosen: boolean) => void }} options
 */
export function row(clutch, { scale, group, chosen, choose }) {
  const { summary, state, held } = clutch;
  const box = h("input", { type: "checkbox", checked: chosen, "aria-label": `Choose ${clutch.clutch_id}` });
  box.addEventListener("change", () => choose(box.checked));
  const address = `/clutches/${encodeURIComponent(clutch.clutch_id)}`;
  const label = h("span", STATES[state.name], state.name !== "normal" && h("small", state.why));
  return h(
    "tr",
    { role: "row", "data-clutch": clutch.clutch_id, class: group === null ? null : "begins" },
    cell("", box),
    cell("State", h("span.state", stateIcon(state.name), label)),
    h(
      "th",
      { role: "rowheader", scope: "row", "data-label": "Clutch" },
      group !== null && h("span.group", group),
      h("a", { href: address }, clutch.clutch_id),
      clutch.origin === "simulated" && h("span.tag", "simulated"),
      h("small", `${clutch.friction_material} on ${clutch.reaction_plate}`),
    ),
    cell("Health", ...health(summary, state.name)),
    cell("Remaining", ...remaining(summary, state.name, scale)),
    cell("Mean COF", ...meanCof(clutch)),
    cell("Last run", ...lastRun(clutch), held > 0 && h("a", { href: address, class: "mark-held" }, heldText(held))),
    cell("Diagnosis", ...diagnosis(clutch, address)),
  );
}

/** @param {ClutchOut} clutch */
export const kindOf = ({ friction_material: material, reaction_plate: plate, fluid }) =>
  `${words(material)} on ${plate}, ${fluid}`;

/** @type {(name: string, ...content: Content[]) => HTMLElement} */
const cell = (name, ...content) => h("td", { role: "cell", "data-label": name }, ...content);

/** @type {(summary: ClutchSummary | null, state: StateName) => string[] | (HTMLElement | SVGSVGElement)[]} */
function health(summary, state) {
  const value = summary?.current.health ?? null;
  return value === null
    ? ["–"]
    : [h("span.number", percent(value)), shareBar(value, { class: "health", style: colourOf(state) })];
}

/**
 * A failure's state says already where the life ended.
 * @param {ClutchSummary | null} summary
 * @param {StateName} state
 * @param {number} scale
 */
function remaining(summary, state, scale) {
  if (summary === null) return ["–", h("small", "after three tests")];
  const { ended } = summary;
  if (ended)
    return [
      ended.reason === "worn" ? h("span.number", "0") : "–",
      state !== "failure" && h("small", `ended at ${fixed(ended.cycles)} cycles`),
    ];
  if (summary.status === "insufficient_data") return ["–", h("small", atLeast(summary.at_least))];
  if (summary.status === "reached") return [h("span.number", "0"), h("small", "reached")];
  const { remaining_cycles: q, at_least: bound, held_runs: held } = summary;
  const lowered = held !== null && (bound ?? Infinity) < (q["0.05"] ?? Infinity);
  return [
    h("span.number", atLeast(bound)),
    lowered && h("small", `if the held ${held.count === 1 ? "run counts" : "runs count"}`),
    intervalBar(q, scale),
    h("small", likely(q)),
  ];
}

/** @param {ClutchOut} clutch */
function meanCof({ summary, recent, end_of_life: end }) {
  const cof = summary?.current.mean_cof ?? null;
  const share = summary?.current.fraction_of_initial ?? null;
  if (cof === null) return ["–"];
  const threshold = share ? (end.cof_fraction * cof) / share : null;
  return [
    sparkline(recent?.mean_cof ?? [], threshold),
    h(
      "span.beside",
      h("span.number", fixed(cof, 4)),
      h(
        "small",
        share === null ? `at ${fixed(summary?.current.measured_at_cycles)} cycles` : `${percent(share)} of new`,
      ),
    ),
  ];
}

/** @param {ClutchOut} clutch */
function lastRun({ recent }) {
  if (recent === null) return ["none"];
  const { at, kind, cycles: count } = recent.last_run;
  const when = Date.parse(at);
  const title = new Date(when).toLocaleString("en-GB");
  return [
    h("time", { datetime: at, title, "data-age": String(when) }, age(when)),
    h("small", `${kindName(kind)} at ${cycles(count, 0, 20)} cycles`),
  ];
}

/** @type {(clutch: ClutchOut, address: string) => HTMLElement[]} */
function diagnosis({ diagnosis: latest }, address) {
  if (latest === null) return [h("span.quiet", "not run")];
  const verdict = latest.verdict ?? "";
  const causes = latest.causes.map(words).join(", ");
  const remarks = [causes, latest.adopted && "adopted", latest.earlier_life && "before the rebuild"];
  return [
    h("a", { href: `${address}#/diagnosis` }, VERDICTS[verdict] ?? words(verdict)),
    h("small", remarks.filter(Boolean).join(" · ")),
  ];
}
