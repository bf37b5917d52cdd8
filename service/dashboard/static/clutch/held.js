// @ts-check
// The runs that are held, at the top of the page: their doubts in words, and what can be done.

import { doubtList } from "../sending/receipt.js";
import { h } from "../shared/dom.js";
import { moment } from "../shared/format.js";
import { actionsOf, LABELS } from "./changes.js";
import { runLink } from "./warnings.js";

/** @import { Receipt } from "../shared/types.js" */
/** @import { RunAction } from "./changes.js" */

/** Held runs that are shown at the top; the others are in the list of runs. */
const MOST_SHOWN = 5;

/**
 * @param {Receipt[]} runs
 * @param {{ act: (action: RunAction, run: Receipt) => unknown, reveal: (runId: string) => void }} page
 */
export function heldView(runs, { act, reveal }) {
  const count = runs.length === 1 ? "1 run is held" : `${runs.length} runs are held`;
  const rest = runs.length - MOST_SHOWN;
  return h(
    "div",
    { class: "notice odd" },
    h("h2", { id: "held-title" }, count),
    h(
      "p",
      {},
      "A held run is stored but does not count: something about it is odd. Confirm it, correct it or withdraw it.",
    ),
    h(
      "ul",
      { class: "held" },
      runs.slice(0, MOST_SHOWN).map((run) => item(run, act, reveal)),
    ),
    rest > 0 ? h("p", { class: "quiet" }, `${rest} more in the list of runs.`) : "",
  );
}

/**
 * @param {Receipt} run
 * @param {(action: RunAction, run: Receipt) => unknown} act
 * @param {(runId: string) => void} reveal
 */
function item(run, act, reveal) {
  return h(
    "li",
    {},
    h(
      "p",
      {},
      h("b", {}, runLink(run, reveal)),
      h("span", { class: "quiet" }, ` · received ${moment(run.received_at)}`),
    ),
    doubtList(run),
    buttons(run, act),
  );
}

/**
 * What can be done to a run, as buttons.
 * @param {Receipt} run
 * @param {(action: RunAction, run: Receipt) => unknown} act
 */
export const buttons = (run, act) =>
  h(
    "div",
    { class: "buttons start" },
    actionsOf(run).map((action) => h("button", { type: "button", onclick: () => act(action, run) }, LABELS[action])),
  );
