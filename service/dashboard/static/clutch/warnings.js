// @ts-check
// Warnings of a life: what is odd about the clutch's course, in words, each with the run that it belongs to.

import { h } from "../shared/dom.js";
import { fixed, kindName, sentence, words } from "../shared/format.js";
import { counts } from "./states.js";

/** @import { Receipt, StribeckItem, Warned } from "../shared/types.js" */

/** @typedef {{ code: string, message: string, run: Receipt | null }} LifeWarning */

const OFF_TRACK = "off_track";
/** Earlier tests off their course that are named; the others are in the list of runs. */
const MOST_EARLIER = 4;

/** @type {Record<string, { title: string, help: string }>} */
const CODES = {
  [OFF_TRACK]: {
    title: "Off its course",
    help: "Check the run's cycles, its clutch and the sensors. If all is right, the next test shows whether the clutch has changed.",
  },
  not_eq6: {
    title: "Not the course of eq. 6",
    help: "The forecast follows the tests. If another course is not what you expect, check cycles and sensors, or run a diagnosis.",
  },
  missed_forecasts: {
    title: "Earlier forecasts missed",
    help: "The clutch does not keep to one course. Remaining life is stated wider until it does.",
  },
  held_runs: {
    title: "Runs are held",
    help: "They do not count until someone confirms, corrects or withdraws them. Cycles that are certain are the fewer of both.",
  },
  tracks_disagree: {
    title: "Two predictions disagree",
    help: "Mean COF is predicted in two ways: directly, and from the four Stribeck parameters. They differ by more than their uncertainty. A diagnosis may show why.",
  },
};

/**
 * The warnings of the present life: those of its last test, then of earlier tests, the newest first.
 * @param {{ warned: Warned[], tests: StribeckItem[], runs: Receipt[] }} answers `warned`: of remaining life and degradation
 * @returns {LifeWarning[]}
 */
export function lifeWarnings({ warned, tests, runs }) {
  const last = tests.filter((test) => test.fits.some((fit) => fit.mean_cof !== null)).at(-1);
  const lastRun = runs.find((run) => run.run_id === last?.run_id) ?? null;
  const current = warned.map(({ code, message }) => ({ code, message, run: code === OFF_TRACK ? lastRun : null }));
  const rebuilt = runs.map((run) => run.event === "rebuild").lastIndexOf(true);
  const earlier = runs.slice(rebuilt + 1).flatMap((run) => {
    const own = run.warnings.find(({ code }) => code === OFF_TRACK);
    return own && counts(run) && run !== lastRun ? [{ code: own.code, message: own.message, run }] : [];
  });
  return [...current, ...earlier.reverse().slice(0, MOST_EARLIER)];
}

/**
 * The warnings as a list.
 * @param {LifeWarning[]} warned
 * @param {(runId: string) => void} reveal shows a run in the list of runs
 */
export function warningsView(warned, reveal) {
  const codes = [...new Set(warned.map(({ code }) => code))];
  const items = codes.map((code) => {
    const { title, help } = CODES[code] ?? { title: words(code), help: "" };
    const own = warned.filter((warning) => warning.code === code);
    const sentences = own.map(({ message, run }) =>
      h(
        "p",
        {},
        run && [runLink(run, reveal), ": "],
        run ? sentence(message.replace(/^the last test's/, "its"), false) : sentence(message),
      ),
    );
    return h("li", {}, h("b", {}, title), sentences, help && h("small", {}, help));
  });
  return h("div", { class: "notice odd" }, h("h2", { id: "warnings-title" }, "Warnings"), h("ul", {}, items));
}

/**
 * A run's name that leads to it in the list.
 * @param {Receipt} run
 * @param {(runId: string) => void} reveal
 */
export function runLink(run, reveal) {
  const open = (/** @type {Event} */ event) => {
    event.preventDefault();
    reveal(run.run_id);
  };
  return h("a", { href: "#runs", onclick: open }, `${kindName(run.kind)} at ${fixed(run.cycles)} cycles`);
}
