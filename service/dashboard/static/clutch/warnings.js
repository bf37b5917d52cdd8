// @ts-check
// Warnings of a life: what is odd about the clutch's course, in words, each with the run that it belongs to.

import { h } from "../shared/dom.js";
import { fixed, kindName, sentence, words } from "../shared/format.js";

/** @import { StribeckItem, Warned } from "../shared/types.js" */

/** @typedef {{ code: string, message: string, test: StribeckItem | null }} LifeWarning */

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
  tracks_disagree: {
    title: "Two predictions disagree",
    help: "Mean COF is predicted in two ways: directly, and from the four Stribeck parameters. The two predictions differ by more than their uncertainty. A diagnosis may show why.",
  },
};

/**
 * The warnings of the present life, those of its last test with their run.
 * @param {{ warned: Warned[], tests: StribeckItem[] }} answers `warned`: of remaining life and degradation
 * @returns {LifeWarning[]}
 */
export function lifeWarnings({ warned, tests }) {
  const last = tests.filter((test) => test.fits.some((fit) => fit.mean_cof !== null)).at(-1) ?? null;
  return warned.map(({ code, message }) => ({ code, message, test: code === OFF_TRACK ? last : null }));
}

/** @param {LifeWarning[]} warned */
export function warningsView(warned) {
  const codes = [...new Set(warned.map(({ code }) => code))];
  const items = codes.map((code) => {
    const { title, help } = CODES[code] ?? { title: words(code), help: "" };
    const own = warned.filter((warning) => warning.code === code);
    const sentences = own.map(({ message, test }) =>
      test
        ? [
            runLink({ ...test, kind: "stationary_stribeck" }),
            `: ${sentence(message.replace(/^the last test's/, "its"), false)} `,
          ]
        : `${sentence(message)} `,
    );
    return h("li", {}, h("b", {}, `${title}. `), sentences.flat(), help && h("span", { class: "quiet" }, help));
  });
  return h("div", { class: "notice odd" }, h("h2", { class: "hidden" }, "Warnings"), h("ul", {}, items));
}

/**
 * A run's name that leads to it in the list.
 * @param {{ run_id: string, kind: string, cycles: number }} run
 */
export const runLink = ({ run_id: id, kind, cycles }) =>
  h("a", { href: `#/runs/${encodeURIComponent(id)}` }, `${kindName(kind)} at ${fixed(cycles)} cycles`);
