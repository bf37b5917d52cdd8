// @ts-check
// The runs that are held, at the top of the page: their doubts in words, and what can be done.

import { doubtList } from "../sending/receipt.js";
import { button, h, quiet } from "../shared/dom.js";
import { moment } from "../shared/format.js";
import { actionsOf, answerDoubts, answersOf, askRun, LABELS } from "./changes.js";
import { runLink } from "./warnings.js";

/** @import { Receipt } from "../shared/types.js" */
/** @import { Page } from "./clutch.js" */

/** Held runs that are shown at the top; the others are in the list of runs. */
const MOST_SHOWN = 5;
const ABOUT =
  "A held run is stored but does not count, because something about it looks wrong. Choose an answer for each run. If " +
  "later tests agree with a run, it is accepted automatically.";

/** @type {(runs: Receipt[], page: Page) => HTMLElement} */
export function heldView(runs, { done }) {
  const count = runs.length === 1 ? "1 run is held" : `${runs.length} runs are held`;
  const rest = runs.length - MOST_SHOWN;
  const listed = runs.slice(0, MOST_SHOWN).map((run) => item(run, done));
  return h(
    "div",
    { class: "notice odd" },
    h("h2", { id: "held-title" }, count),
    h("p", {}, ABOUT),
    together(runs, done),
    h("ul", { class: "held" }, listed),
    rest > 0 ? quiet(h("a", { href: "#/runs" }, `${rest} more in the list of runs`)) : "",
  );
}

/** @type {(runs: Receipt[], done: Page["done"]) => HTMLElement[]} several that are held for the same cause, answered together */
function together(runs, done) {
  const causes = [...new Set(runs.map((run) => run.doubts[0]?.code))];
  return causes
    .map((cause) => runs.filter((run) => run.doubts[0]?.code === cause))
    .filter((alike) => alike.length > 1)
    .map((alike) =>
      h(
        "div",
        { class: "buttons start" },
        h("span", {}, `${alike.length} runs for the same reason:`),
        button(`All ${alike.length} are right`, () => done(answerDoubts("right", alike))),
        button(`All ${alike.length} are another clutch’s`, () => done(answerDoubts("other", alike))),
      ),
    );
}

/** @type {(run: Receipt, done: Page["done"]) => HTMLElement} */
function item(run, done) {
  const answers = answersOf(run).map(([answer, words]) =>
    button(words, () => done(answerDoubts(answer, [run])), { class: "main" }),
  );
  return h(
    "li",
    {},
    h("p", {}, h("b", {}, runLink(run)), h("span", { class: "quiet" }, ` · received ${moment(run.received_at)}`)),
    doubtList(run),
    h("div", { class: "buttons start" }, answers),
    buttons(run, done),
  );
}

/** @type {(run: Receipt, done: Page["done"]) => HTMLElement} what can be done to a run */
export function buttons(run, done) {
  const each = actionsOf(run).map((action) => button(LABELS[action], () => done(askRun(action, run))));
  return h("div", { class: "buttons start" }, each);
}
