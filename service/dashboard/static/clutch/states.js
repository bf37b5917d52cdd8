// @ts-check
// The state of a run: whether it counts, in a word.

import { h } from "../shared/dom.js";
import { fixed } from "../shared/format.js";

/** @import { Receipt } from "../shared/types.js" */

/** @param {Receipt} run */
export const counts = (run) => run.state === "accepted";

/** @param {Receipt} run */
export const isCorrected = (run) => run.cycles !== run.sent_cycles;

/**
 * The state as a mark in the list of runs; nothing where the run counts as it was sent.
 * @param {Receipt} run
 */
export function stateMark(run) {
  if (run.state === "held") return h("span", { class: "mark-held" }, "Held");
  if (run.state === "withdrawn") return h("span", { class: "mark-withdrawn" }, "Withdrawn");
  return isCorrected(run) ? h("span", { class: "mark-corrected" }, `Sent as ${fixed(run.sent_cycles)}`) : "";
}
