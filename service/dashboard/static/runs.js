// Every run with its receipt and warnings, and what was done to the clutch, the latest first.

import { clutchPath, readText } from "./api.js";
import { h, saveText } from "./dom.js";
import { fixed, kindName, moment, words } from "./format.js";
import { fitTable, loopTable, warnings } from "./receipt.js";

const FIRST = 50;
let all = false;
const open = new Set();

/** Draw the list into `place`. */
export function showRuns(place, runs, clutchId) {
  const latest = runs.toReversed();
  const shown = all ? latest : latest.slice(0, FIRST);
  const more = latest.length - shown.length;
  const warned = runs.reduce((sum, run) => sum + (run.warnings.length > 0 ? 1 : 0), 0);
  place.replaceChildren(
    h("p", { class: "quiet" }, `${runs.length} ${runs.length === 1 ? "run" : "runs"}, ${warned} with warnings. As a table: `, h("a", { href: `${clutchPath(clutchId)}/runs.csv`, onclick: (event) => saveCsv(event, clutchId) }, "CSV"), "."),
    h("div", { class: "runs" }, shown.map((run) => item(run))),
    more > 0 ? h("button", { type: "button", onclick: () => { all = true; showRuns(place, runs, clutchId); } }, `Show ${more} earlier`) : "");
}

/** With a key a plain link would be refused: the file is fetched as the page fetches everything. */
async function saveCsv(event, clutchId) {
  event.preventDefault();
  saveText(`${clutchId}-runs.csv`, await readText(`${clutchPath(clutchId)}/runs.csv`), "text/csv");
}

function item(run) {
  const inside = h("div", { class: "inside" });
  const details = h("details", {
    open: open.has(run.run_id),
    ontoggle: () => { (details.open ? open.add : open.delete).call(open, run.run_id); if (details.open && !inside.hasChildNodes()) inside.append(...receipt(run)); },
  },
  h("summary", {},
    h("span", { class: "at" }, `${fixed(run.cycles)} cycles`),
    h("span", { class: "what" }, run.kind === "maintenance" ? `${words(run.event)}${run.note ? `: ${run.note}` : ""}` : kindName(run.kind)),
    h("span", { class: "said" }, said(run)),
    run.warnings.length > 0 ? h("span", { class: "warned" }, `${run.warnings.length} ${run.warnings.length === 1 ? "warning" : "warnings"}`) : h("span", { class: "quiet" }, ""),
    h("span", { class: "quiet" }, moment(run.started_at ?? run.received_at))),
  inside);
  return details;
}

function said({ kind, fits, loops, duty }) {
  if (duty) return `${fixed(duty.cycles)} cycles${duty.energy_per_cycle_kj ? ` of ${fixed(duty.energy_per_cycle_kj, 1)} kJ` : ""}`;
  if (fits.length > 0) return `${fits.filter((fit) => fit.acceptable).length} of ${fits.length} fits acceptable`;
  if (loops.length > 0) return `${loops.length} ${loops.length === 1 ? "loop" : "loops"}`;
  return kind === "maintenance" ? "" : "no curve";
}

function receipt(run) {
  const facts = [["Run", run.run_id], ["Received", moment(run.received_at)], ["Origin", run.origin], ["SHA-256", run.content_sha256], ["Worked out by", `version ${run.code_version}`]];
  return [
    warnings(run.warnings) ?? "",
    run.fits.length > 0 ? fitTable(run.fits) : "",
    run.loops.length > 0 ? loopTable(run.loops) : "",
    h("dl", { class: "facts" }, facts.flatMap(([name, value]) => [h("dt", {}, name), h("dd", {}, value)]))];
}
