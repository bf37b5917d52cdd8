// Remaining life by any tracked quantity: a choice of quantity and pressure, answered when it is made. Nothing is stored.

import { chooser, setControls } from "../charts/chart.js";
import { levelsOf } from "../charts/columns.js";
import { PARAMETER_NAMES } from "../charts/parameters.js";
import { Problem, read } from "../shared/api.js";
import { computing, h, quiet, scrolling, table } from "../shared/dom.js";
import { interval, median } from "../shared/format.js";
import { problemView } from "../shared/problem_view.js";
import { criterionRow, OWN_COLUMNS } from "./criteria.js";
import { LAG_NAMES } from "./lag.js";
import { levelOptions, optionsOf, QUANTITIES, usual } from "./names.js";

/** @type {string[]} */
const OF_CURVES = ["mean_cof", ...PARAMETER_NAMES, "slope"];
/** @type {string[]} */
const OF_LOOPS = LAG_NAMES;
const ABOUT =
  "When another quantity reaches its limit. The limit is the clutch's own criterion for this quantity. If there is none, the " +
  "limit is the same share of the initial value as for mean COF; for a slope, the limit is 0 at 100 rpm.";
/** @type {["all", string][]} */
const ALL = [["all", "all pressures"]];
const NAMES = optionsOf(QUANTITIES);

/**
 * The levels that a quantity is tracked at, bar; none for those that have no pressure of their own.
 * @type {(name: string, answers: { tests: StribeckItem[], loops: LoopItem[] }) => number[]}
 */
function levelsAt(name, { tests, loops }) {
  const first = tests.find(({ fits }) => fits.length > 0);
  if (OF_CURVES.includes(name)) return levelsOf(first?.fits ?? []);
  return OF_LOOPS.includes(name) ? levelsOf(loops) : [];
}

/** @param {CriterionOutcome[]} criteria */
function remainingTable(criteria) {
  const rows = criteria.map((criterion) => {
    const { remaining_cycles: left } = criterion;
    return [...criterionRow(criterion), median(left), interval(left)];
  });
  const columns = [...OWN_COLUMNS, "Remaining cycles", "90 % interval of them"];
  return scrolling(
    "Remaining life by a quantity",
    table("Remaining life by a quantity", columns, rows, { shown: true }),
  );
}

/**
 * What is called with the clutch's life and tests whenever they are read.
 * @param {HTMLElement} place
 * @param {{ path: ClutchPath, loops: () => Promise<LoopItem[]> }} reader of the clutch
 */
export function remainingBy(place, reader) {
  const controls = h("div.row.controls");
  const answer = h("div.answer", { "aria-live": "polite" });
  const title = h("summary", "Remaining life by another quantity");
  const details = h("details.planned", { ontoggle: () => ask() }, title, quiet(ABOUT), controls, answer);
  place.append(details);
  /** @type {{ tests: StribeckItem[], loops: LoopItem[] }} */
  const answers = { tests: [], loops: [] };
  /** @type {{ name: string, level?: number | "all" }} bar */
  const chosen = { name: "static_torque_nm" };
  const choose = chooser(chosen, () => {
    draw();
    ask();
  });
  let request = "";
  let revision = 0;

  function draw() {
    const levels = levelsAt(chosen.name, answers);
    const whole = chosen.name === "mean_cof";
    if (typeof chosen.level !== "number" || !levels.includes(chosen.level))
      chosen.level = whole ? "all" : usual(levels);
    /** @type {[number | "all", string][]} */
    const options = [...(whole ? ALL : []), ...levelOptions(levels)];
    const pressure = options.length > 0 ? [choose("level", "Pressure", options)] : [];
    setControls({ controls }, [choose("name", "Quantity", NAMES), ...pressure]);
  }

  /** The answer to what is chosen, where it is looked at and not there yet. */
  async function ask() {
    if (details.open && OF_LOOPS.includes(chosen.name)) {
      answers.loops = await reader.loops();
      draw();
    }
    const place = typeof chosen.level === "number" ? `&pressure_bar=${chosen.level}` : "";
    const query = `quantity=${chosen.name}${place}`;
    const wanted = `${revision} ${query}`;
    if (!details.open || wanted === request) return;
    request = wanted;
    computing(answer, `the remaining life by ${QUANTITIES[chosen.name].title.toLowerCase()}`);
    try {
      const { body } = await read(`${reader.path}/remaining-useful-life?${query}`);
      if (wanted === request) answer.replaceChildren(remainingTable(body.criteria));
    } catch (problem) {
      if (!(problem instanceof Problem)) throw problem;
      if (wanted !== request) return;
      request = ""; // it is asked for again when the clutch changes or another choice is made
      answer.replaceChildren(problemView(problem, "No prediction. "));
    }
  }

  return (/** @type {RemainingLife} */ life, /** @type {StribeckItem[]} */ tests) => {
    answers.tests = tests;
    revision = life.revision;
    draw();
    ask();
  };
}
