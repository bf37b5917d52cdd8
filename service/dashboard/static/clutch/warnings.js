// What stands at the top of the page because it is odd: runs that are held, with their doubts and what can be done, and warnings
// about the course of the life, in words, each with the run that it belongs to.

import { doubtList } from "../sending/receipt.js";
import { button, h, quiet } from "../shared/dom.js";
import { counted, moment, runName, sentence, words } from "../shared/format.js";
import { actionsOf, answerDoubts, answersOf, askRun, LABELS } from "./changes.js";

/** @import { Page } from "./clutch.js" */

const OFF_TRACK = "off_track";

/** @type {Record<string, { title: string, help: string }>} */
const CODES = {
  [OFF_TRACK]: {
    title: "The last test does not fit the earlier ones",
    help: "Check the run's cycles, its clutch and the sensors. If all is right, the next test shows whether the clutch has changed.",
  },
  not_eq6: {
    title: "The clutch does not age as expected",
    help: "The forecast follows the tests. If you did not expect this, check the cycles and the sensors, or run a diagnosis.",
  },
  new_level: {
    title: "Friction has stepped",
    help: "The forecast goes on from the new level, as after an oil change.",
  },
  missed_forecasts: {
    title: "Earlier forecasts missed",
    help: "The clutch does not age along one curve, so the interval of the remaining life is wider for now.",
  },
  held_runs: {
    title: "Runs are held",
    help: "They do not count until someone confirms, corrects or withdraws them. The safe bound is the lower of two: with these runs, and without them.",
  },
  filters_disagree: {
    title: "Two methods disagree",
    help: "They compute different remaining lives from the same tests.",
  },
};

/** @type {(warned: Warned[], tests: StribeckItem[]) => HTMLElement} what is odd about the life or its last test */
export function warningsView(warned, tests) {
  const last = tests.filter((test) => test.fits.some((fit) => fit.mean_cof !== null)).at(-1);
  const items = [...new Set(warned.map(({ code }) => code))].map((code) => {
    const { title, help } = CODES[code] ?? { title: words(code), help: "" };
    const run = code === OFF_TRACK && last && { ...last, kind: "stationary_stribeck" };
    const sentences = warned
      .filter((warning) => warning.code === code)
      .map(({ message }) =>
        run
          ? [runLink(run), `: ${sentence(message.replace(/^the last test's/, "its"), false)} `]
          : `${sentence(message)} `,
      );
    return h("li", h("b", `${title}. `), sentences.flat(), help && h("span.quiet", help));
  });
  return h("div.notice.odd", h("h2.hidden", "Warnings"), h("ul", items));
}

/** @param {{ run_id: string, kind: string, cycles: number }} run its name, which leads to it in the list */
export const runLink = (run) => h("a", { href: `#/runs/${encodeURIComponent(run.run_id)}` }, runName(run));

/** Held runs that are shown at the top; the others are in the list of runs. */
const MOST_SHOWN = 5;
const ABOUT =
  "A held run is stored but does not count, because something about it looks wrong. Choose an answer for each run. If " +
  "later tests agree with a run, it is accepted automatically.";

/** @type {(runs: Receipt[], page: Page) => HTMLElement} */
export function heldView(runs, { done }) {
  const count = `${counted(runs.length, "run is", "runs are")} held`;
  const rest = runs.length - MOST_SHOWN;
  const listed = runs.slice(0, MOST_SHOWN).map((run) => item(run, done));
  return h(
    "div.notice.odd",
    h("h2", { id: "held-title" }, count),
    h("p", ABOUT),
    together(runs, done),
    h("ul.held", listed),
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
      h("div.row.buttons.start", h("span", `${alike.length} runs for the same reason:`), answers(alike, done)),
    );
}

/** @type {(runs: Receipt[], done: Page["done"]) => HTMLElement[]} a button for each */
const answers = (runs, done) =>
  answersOf(runs).map(([answer, words]) =>
    button(words, () => done(answerDoubts(answer, runs)), {
      class: runs.length === 1 || answer === "likely" ? "main" : "",
    }),
  );

/** @type {(run: Receipt, done: Page["done"]) => HTMLElement} */
function item(run, done) {
  return h(
    "li",
    h("p", h("b", runLink(run)), h("span.quiet", ` · received ${moment(run.received_at)}`)),
    doubtList(run),
    h("div.row.buttons.start", answers([run], done)),
    buttons(run, done),
  );
}

/** @type {(run: Receipt, done: Page["done"]) => HTMLElement} what can be done to a run */
export function buttons(run, done) {
  const each = actionsOf(run).map((action) => button(LABELS[action], () => done(askRun(action, run))));
  return h("div.row.buttons.start", each);
}
