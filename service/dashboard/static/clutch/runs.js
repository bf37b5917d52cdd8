// @ts-check
// Every run with its receipt and warnings, and what was done to the clutch, the latest first.

import { fitTable, loopTable, warnings } from "../sending/receipt.js";
import { clutchPath, readText } from "../shared/api.js";
import { h, saveText } from "../shared/dom.js";
import { fixed, kindName, moment, words } from "../shared/format.js";

/** @import { Receipt } from "../shared/types.js" */

/** Runs that are listed at first. */
const FIRST = 50;
let all = false;
/** @type {Set<string>} */
const open = new Set();

/**
 * Draw the list into `place`.
 * @param {HTMLElement} place
 * @param {Receipt[]} runs by cycles
 * @param {string} clutchId
 */
export function showRuns(place, runs, clutchId) {
  const latest = [...runs].reverse();
  const shown = all ? latest : latest.slice(0, FIRST);
  const more = latest.length - shown.length;
  const warned = runs.filter((run) => run.warnings.length > 0).length;
  const address = `${clutchPath(clutchId)}/runs.csv`;
  /** @param {Event} event */
  const save = async (event) => {
    event.preventDefault(); // with a key a plain link would be refused: the file is fetched as the page fetches everything
    saveText(`${clutchId}-runs.csv`, await readText(address), "text/csv");
  };
  const showAll = () => {
    all = true;
    showRuns(place, runs, clutchId);
  };
  const summary = `${runs.length} ${runs.length === 1 ? "run" : "runs"}, ${warned} with warnings. As a table: `;
  place.replaceChildren(
    h("p", { class: "quiet" }, summary, h("a", { href: address, onclick: save }, "CSV"), "."),
    h(
      "div",
      { class: "runs" },
      shown.map((run) => item(run)),
    ),
    more > 0 ? h("button", { type: "button", onclick: showAll }, `Show ${more} earlier`) : "",
  );
}

/** @param {Receipt} run */
function item(run) {
  const inside = h("div", { class: "inside" });
  const count = run.warnings.length;
  const warned = count > 0 ? `${count} ${count === 1 ? "warning" : "warnings"}` : "";
  const details = h(
    "details",
    { open: open.has(run.run_id) },
    h(
      "summary",
      {},
      h("span", { class: "at" }, `${fixed(run.cycles)} cycles`),
      h("span", {}, nameOf(run)),
      h("span", {}, resultOf(run)),
      h("span", { class: count > 0 ? "warned" : "quiet" }, warned),
      h("span", { class: "quiet" }, moment(run.started_at ?? run.received_at)),
    ),
    inside,
  );
  details.addEventListener("toggle", () => {
    if (details.open) open.add(run.run_id);
    else open.delete(run.run_id);
    if (details.open && !inside.hasChildNodes()) inside.append(...receipt(run));
  });
  return details;
}

/** @param {Receipt} run */
function nameOf({ kind, event, note }) {
  return kind === "maintenance" ? `${words(event)}${note ? `: ${note}` : ""}` : kindName(kind);
}

/** @param {Receipt} run */
function resultOf({ kind, fits, loops, duty }) {
  if (duty) {
    const energy = duty.energy_per_cycle_kj ? ` of ${fixed(duty.energy_per_cycle_kj, 1)} kJ` : "";
    return `${fixed(duty.cycles)} cycles${energy}`;
  }
  if (fits.length > 0) return `${fits.filter((fit) => fit.acceptable).length} of ${fits.length} fits acceptable`;
  if (loops.length > 0) return `${loops.length} ${loops.length === 1 ? "loop" : "loops"}`;
  return kind === "maintenance" ? "" : "no curve";
}

/** @param {Receipt} run */
function receipt(run) {
  const facts = [
    ["Run", run.run_id],
    ["Received", moment(run.received_at)],
    ["Origin", run.origin],
    ["SHA-256", run.content_sha256],
    ["Computed by", `version ${run.code_version}`],
  ];
  const list = facts.flatMap(([name, value]) => [h("dt", {}, name), h("dd", {}, value)]);
  return [
    warnings(run.warnings) ?? "",
    run.fits.length > 0 ? fitTable(run.fits) : "",
    run.loops.length > 0 ? loopTable(run.loops) : "",
    h("dl", { class: "facts" }, list),
  ];
}
