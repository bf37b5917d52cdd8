// One clutch in the fleet's table: what it needs first, then what is known of it.

import { raisedLink } from "../alarms/raised.js";
import { pageOf } from "../shared/api.js";
import { h } from "../shared/dom.js";
import { age, cycles, fixed, kindName, likely, percent, roundedDown, words } from "../shared/format.js";
import { intervalBar, shareBar, sparkline } from "../shared/sparkline.js";
import { colourOf, heldText, stateIcon, STATES } from "../shared/state.js";

/** @import { Content } from "../shared/dom.js" */

/** @type {[Content, string][]} a column's title and width */
export const COLUMNS = [
  [h("span.hidden", "Choose"), "38px"],
  ["State", "196px"],
  ["Clutch", "170px"],
  ["What to do", ""],
  ["Safe for, cycles", "136px"],
  ["Health", "78px"],
  ["Trend", "132px"],
  ["Last run", "120px"],
];

/**
 * The row; `scale` is the cycles at the right end of every interval's bar, `group` the kind that begins with it.
 * @param {ClutchOut} clutch
 * @param {{ scale: number, group: string | null, chosen: boolean, choose: (chosen: boolean) => void }} options
 */
export function row(clutch, { scale, group, chosen, choose }) {
  const { state, held, summary, alarms } = clutch;
  const box = h("input", { type: "checkbox", checked: chosen, "aria-label": `Choose ${clutch.clutch_id}` });
  box.addEventListener("change", () => choose(box.checked));
  const address = pageOf(clutch.clutch_id);
  const over = clutch.archived || Boolean(summary?.ended);
  const why = state.name === "normal" && !summary?.ended ? null : state.why;
  return h(
    "tr",
    {
      role: "row",
      "data-clutch": clutch.clutch_id,
      class: `${group === null ? "" : "begins "}${over ? "over" : ""}`,
    },
    cell("box", {}, box),
    cell("state", { title: state.why }, stateIcon(state.name), h("span", STATES[state.name])),
    h(
      "th",
      { role: "rowheader", scope: "row" },
      group !== null && h("span.group", group),
      h("a", { href: address }, clutch.clutch_id),
      clutch.origin === "simulated" && h("span.tag", "simulated"),
      h("small", `${clutch.friction_material} on ${clutch.reaction_plate}`),
    ),
    cell(
      "do",
      { title: why ? `${clutch.action} ${words(why)}.` : clutch.action },
      h(
        "span.line",
        raisedLink(alarms, address),
        held > 0 && state.name !== "check" && h("a", { href: address, class: "mark-held" }, heldText(held)),
        why === null && alarms.length === 0
          ? h("span.quiet", clutch.action)
          : h("a", { href: state.name === "out_of_specification" ? `${address}#/diagnosis` : address }, clutch.action),
      ),
      why && h("small", why),
    ),
    safeFor(summary, scale),
    cell("share", {}, ...health(clutch)),
    trend(clutch),
    lastRun(clutch),
  );
}

/** @param {ClutchOut} clutch */
export const kindOf = ({ friction_material: material, reaction_plate: plate, fluid }) =>
  `${words(material)} on ${plate}, ${fluid}`;

/** @type {(name: string, attributes: Record<string, string | null>, ...content: Content[]) => HTMLTableCellElement} */
const cell = (name, attributes, ...content) => h("td", { role: "cell", class: name, ...attributes }, ...content);

/** @param {ClutchOut} clutch */
function health({ summary, state }) {
  const value = summary?.current.health ?? null;
  return value === null
    ? ["–"]
    : [h("span.number", percent(value)), shareBar(value, { class: "health", style: colourOf(state.name) })];
}

/**
 * The safe bound, and the interval that it begins.
 * @param {ClutchSummary | null} summary
 * @param {number} scale
 */
function safeFor(summary, scale) {
  if (!summary || summary.ended) return cell("safe", {}, "–");
  const { status, remaining_cycles: q, at_least: bound } = summary;
  const few = bound !== null && bound >= 1 && bound < 10;
  const number = h("span.number", few ? "< 10" : roundedDown(Math.max(0, bound ?? 0)));
  if (status === "reached") return cell("safe", {}, number, h("small", "reached"));
  if (status === "insufficient_data") return cell("safe", {}, number, h("small", "end not known yet"));
  const text = likely(q);
  return cell("safe", { title: text }, number, intervalBar(q, scale), h("span.hidden", text));
}

/** @param {ClutchOut} clutch */
function trend({ summary, recent, end_of_life: end }) {
  const cof = summary?.current.mean_cof ?? null;
  const share = summary?.current.fraction_of_initial ?? null;
  if (cof === null) return cell("trend", {}, "–");
  const title = `mean COF ${fixed(cof, 4)}${share === null ? "" : `, ${percent(share)} of new`}`;
  const line = sparkline(recent?.mean_cof ?? [], share ? (end.cof_fraction * cof) / share : null);
  return cell("trend", { title }, line, share !== null && h("small", percent(share)));
}

/** @param {ClutchOut} clutch */
function lastRun({ recent }) {
  if (recent === null) return cell("last", {}, "none");
  const { at, kind, cycles: count } = recent.last_run;
  const when = Date.parse(at);
  const title = `${kindName(kind)}, ${new Date(when).toLocaleString("en-GB")}`;
  return cell(
    "last",
    { title },
    h("time", { datetime: at, "data-age": String(when) }, age(when)),
    h("small", `at ${cycles(count, 0, 20)} cycles`),
  );
}
