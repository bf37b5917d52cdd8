// @ts-check
// The runs that are held, at the top of the page: their doubts in words, and what can be done.

import { doubtList } from "../sending/receipt.js";
import { h } from "../shared/dom.js";
import { moment } from "../shared/format.js";
import { actionsOf, answersOf, LABELS } from "./changes.js";
import { runLink } from "./warnings.js";

/** @import { Receipt } from "../shared/types.js" */
/** @import { Answer, RunAction } from "./changes.js" */
/** @import { Page } from "./clutch.js" */
/** @typedef {(answer: Answer, runs: Receipt[]) => unknown} Say */

/** Held runs that are shown at the top; the others are in the list of runs. */
const MOST_SHOWN = 5;

/** @type {(runs: Receipt[], page: Page) => HTMLElement} */
export function heldView(runs, { store }) {
  const { act, say } = store;
  const count = runs.length === 1 ? "1 run is held" : `${runs.length} runs are held`;
  const rest = runs.length - MOST_SHOWN;
  return h(
    "div",
    { class: "notice odd" },
    h("h2", { id: "held-title" }, count),
    h(
      "p",
      {},
      "A held run is stored but does not count, because something about it looks wrong. Choose an answer for each run. If " +
        "later tests agree with a run, it is accepted automatically.",
    ),
    together(runs, say),
    h(
      "ul",
      { class: "held" },
      runs.slice(0, MOST_SHOWN).map((run) => item(run, { act, say })),
    ),
    rest > 0 ? h("p", { class: "quiet" }, h("a", { href: "#/runs" }, `${rest} more in the list of runs`)) : "",
  );
}

/**
 * Several runs that are held for the same cause, answered together.
 * @type {(runs: Receipt[], say: Say) => HTMLElement[]}
 */
function together(runs, say) {
  const causes = [...new Set(runs.map((run) => run.doubts[0]?.code))];
  return causes
    .map((cause) => runs.filter((run) => run.doubts[0]?.code === cause))
    .filter((alike) => alike.length > 1)
    .map((alike) =>
      h(
        "div",
        { class: "buttons start" },
        h("span", {}, `${alike.length} runs for the same reason:`),
        h("button", { type: "button", onclick: () => say("right", alike) }, `All ${alike.length} are right`),
        h("button", { type: "button", onclick: () => say("other", alike) }, `All ${alike.length} are another clutch’s`),
      ),
    );
}

/** @type {(run: Receipt, page: { act: (action: RunAction, run: Receipt) => unknown, say: Say }) => HTMLElement} */
function item(run, { act, say }) {
  return h(
    "li",
    {},
    h("p", {}, h("b", {}, runLink(run)), h("span", { class: "quiet" }, ` · received ${moment(run.received_at)}`)),
    doubtList(run),
    h(
      "div",
      { class: "buttons start" },
      answersOf(run).map(([answer, words]) =>
        h("button", { type: "button", class: "main", onclick: () => say(answer, [run]) }, words),
      ),
    ),
    buttons(run, act),
  );
}

/**
 * What can be done to a run, as buttons.
 * @type {(run: Receipt, act: (action: RunAction, run: Receipt) => unknown) => HTMLElement}
 */
export const buttons = (run, act) =>
  h(
    "div",
    { class: "buttons start" },
    actionsOf(run).map((action) => h("button", { type: "button", onclick: () => act(action, run) }, LABELS[action])),
  );
